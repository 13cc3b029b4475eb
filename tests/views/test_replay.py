"""Replay: a recording opens in the viewer and is drawn; what cannot be opened is refused with the way out."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from finback.errors import InputError
from finback.records import FlightRecord
from finback.views import replay
from finback.views.offscreen import OffscreenViewer
from finback.views.recording import RecordingContext, write_recording
from finback.views.replay import failure, has_screen, open_viewer
from finback.views.signals import COLORS

VIEWS = {"Aircraft", "Phase plane", "Flight", "α [deg]", "q [deg/s]", "δe [deg]"}
SIZE = (1000, 700)
COLORED = 60  # difference of the color channels above which a pixel is no gray
LEAST_COLORED = 2000  # pixels: three curves, the path, the tail and the arrow give some 6000


@pytest.fixture(scope="module")
def viewer() -> Iterator[OffscreenViewer]:
    """Return one viewer for all tests; where no driver is installed it fails, and says what to install."""
    with OffscreenViewer(SIZE) as started:
        yield started


@pytest.fixture
def recorded(tmp_path: Path, flight: FlightRecord) -> Path:
    path = tmp_path / "flight.rrd"
    write_recording(path, flight, context=RecordingContext(study="study", run="run"))
    return path


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def test_a_recording_is_drawn_without_a_report(viewer: OffscreenViewer, recorded: Path) -> None:
    assert set(viewer.load(recorded)) == VIEWS
    viewer.seek(0.4)
    early = pixels(viewer.picture())
    assert viewer.problems() == []
    assert (np.ptp(early, axis=2) > COLORED).sum() > LEAST_COLORED
    for color in COLORS.values():
        near = np.abs(early - color).max(axis=2) < 40
        assert near.sum() > 100, f"the curve of color {color} is missing"
    viewer.seek(1.4)
    late = pixels(viewer.picture())
    assert (np.abs(early - late).max(axis=2) > 30).sum() > 500, "the aircraft and the cursors move"


def test_a_flight_that_diverged_is_drawn(viewer: OffscreenViewer, tmp_path: Path, flight: FlightRecord) -> None:
    alpha = flight["alpha_rad"].copy()
    alpha[-10:] = [1e300, *[np.inf] * 4, *[np.nan] * 5]
    path = tmp_path / "diverged.rrd"
    write_recording(path, flight.with_columns(alpha_rad=alpha), context=RecordingContext(study="study", run="diverged"))
    assert set(viewer.load(path)) == VIEWS
    viewer.picture()
    assert viewer.problems() == []


def test_the_viewer_listens_on_this_machine_only(viewer: OffscreenViewer) -> None:
    listening = [
        line.split()[1]
        for table in ("/proc/net/tcp", "/proc/net/tcp6")
        for line in Path(table).read_text(encoding="ascii").splitlines()[1:]
        if line.split()[3] == "0A" and int(line.split()[1].rpartition(":")[2], 16) == viewer.port
    ]
    assert [address.partition(":")[0] for address in listening] == ["0100007F"]


def test_what_is_no_recording_is_refused(tmp_path: Path, recorded: Path) -> None:
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(recorded.read_bytes()[:-30])
    text = tmp_path / "text.rrd"
    text.write_text("not a recording", encoding="utf-8")
    for path, message in (
        (tmp_path / "none.rrd", "there is no recording"),
        (text, "cannot be read"),
        (cut, "never finished"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            open_viewer(path)
        assert caught.value.hint


def test_without_a_screen_it_says_so(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(replay.sys, "platform", "linux")
    with pytest.raises(InputError, match="no screen"):
        open_viewer(recorded)


@pytest.mark.parametrize(
    ("environment", "platform", "expected"),
    [
        ({}, "linux", False),
        ({"DISPLAY": ""}, "linux", False),
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({}, "darwin", True),
        ({}, "win32", True),
    ],
)
def test_a_screen_is_recognized(environment: dict[str, str], platform: str, *, expected: bool) -> None:
    assert has_screen(environment, platform) is expected


def test_a_screen_that_does_not_answer_is_named(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":987")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match="does not answer"):
        open_viewer(recorded)


def test_a_missing_driver_is_named() -> None:
    said = "thread 'main' panicked at 'Failed to get render context'\nre_viewer/src/app/mod.rs:1425"
    error = failure(Path("a.rrd"), 102, said)
    assert "Vulkan driver" in error.message
    assert "mesa-vulkan-drivers" in error.hint


def test_another_failure_is_passed_on() -> None:
    assert "Error: odd" in failure(Path("a.rrd"), 1, "noise\nError: odd\n").message

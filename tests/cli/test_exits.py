"""The one place where mistakes become exit codes."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from finback.cli import exits, signals
from finback.cli.main import main
from finback.errors import AircraftError, InputError, MissingResultError, RefusedError, StudyError


@pytest.fixture(autouse=True)
def _no_signal(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(signals, "_received", [])
    return


def code_of(error: BaseException) -> int:
    @exits.verb
    def fail() -> int:
        raise error

    with pytest.raises(typer.Exit) as caught:
        fail()
    assert isinstance(caught.value.exit_code, int)
    return caught.value.exit_code


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("no such thing", hint="try another"), 2, "finback: no such thing\n  try another\n"),
        (AircraftError("broken"), 2, "finback: broken\n"),
        (MissingResultError("gone", hint="finback sweep x"), 2, "finback: gone\n  finback sweep x\n"),
        (StudyError("s.toml", ("a: b", "c: d")), 2, "finback: s.toml: 2 faults\n  a: b\n  c: d\n"),
        (RefusedError("exactly collinear"), 3, "finback: exactly collinear\n"),
        (PermissionError(13, "Permission denied", "/logs"), 2, "finback: /logs: Permission denied\n"),
        (OSError(28, "No space left on device"), 2, "finback: No space left on device\n"),
    ],
)
def test_each_mistake_has_its_code_and_its_words(
    error: BaseException, code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert code_of(error) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(said)
    assert "Traceback" not in captured.err


def test_a_bug_is_4_and_leaves_a_log(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert code_of(ZeroDivisionError("division by zero")) == 4
    said = capsys.readouterr().err
    assert "this is a bug: ZeroDivisionError" in said
    assert "Traceback" not in said
    found = re.search(r"report it with (\S+)", said)
    assert found is not None
    log = Path(found[1]).read_text(encoding="utf-8")
    for part in ("Traceback", "ZeroDivisionError", "jsbsim 1.3", "Python 3."):
        assert part in log


def test_a_bug_without_a_place_for_its_log_says_all(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    assert code_of(ZeroDivisionError("division by zero")) == 4
    assert "Traceback" in capsys.readouterr().err


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that got SIGTERM a long time ago."""
    monkeypatch.setattr(signals, "_received", [(15, 0.0)])


@pytest.mark.usefixtures("stopped")
@pytest.mark.parametrize(
    "broken", [KeyboardInterrupt, ImportError]
)  # an import that is interrupted raises what it likes
def test_what_breaks_after_a_signal_is_the_signal(
    broken: type[BaseException], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @exits.verb
    def fail() -> int:
        raise broken

    with pytest.raises(broken):
        fail()
    with pytest.raises(KeyboardInterrupt):
        signals.raise_if_stopped()
    monkeypatch.setattr("finback.cli.main.listen", fail)
    monkeypatch.setattr("finback.cli.main.ignore", lambda: None)
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 143
    assert capsys.readouterr().err == "finback: interrupted; nothing is half-written\n"


def test_without_a_signal_the_program_hides_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise LookupError

    monkeypatch.setattr("finback.cli.main.listen", fail)
    monkeypatch.setattr("finback.cli.main.ignore", lambda: None)
    with pytest.raises(LookupError):
        main()


def test_an_impatient_second_signal_does_not_stop_the_cleaning_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.unraisablehook", sys.unraisablehook)  # the handler changes it
    with pytest.raises(KeyboardInterrupt):
        signals._stop(2, None)
    signals._stop(2, None)
    signals._received[-1] = (2, signals._received[-1][1] - 10.0)
    with pytest.raises(KeyboardInterrupt):
        signals._stop(2, None)


def test_a_code_is_passed_on() -> None:
    @exits.verb
    def disagree() -> int:
        return 1

    with pytest.raises(typer.Exit) as caught:
        disagree()
    assert caught.value.exit_code == 1

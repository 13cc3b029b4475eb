"""Results as tables: the verdict first, everything in degrees, nothing that is cut off."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from finback.arrays import frozen_array
from finback.cli import analysis_tables, region_tables, tables, terminal
from finback.cli.progress import watching
from finback.dynamics.located import located
from finback.store import load_accuracy, load_analysis, load_identification, load_sweep, load_validation
from finback.units import to_si
from finback.views.stability_rows import region_row


@pytest.fixture
def printed(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """What is printed on a terminal as wide as the parameter says."""
    out = io.StringIO()
    monkeypatch.setattr(terminal, "open_console", lambda: Console(file=out, width=request.param, highlight=False))
    return out


@pytest.mark.parametrize("printed", [80, 140], indirect=True)
def test_the_verdict_comes_first_and_every_metric_has_its_judgement(finished_run: Path, printed: io.StringIO) -> None:
    validation = load_validation(finished_run)
    tables.show_validation(finished_run, load_analysis(finished_run), validation)
    lines = printed.getvalue().splitlines()
    count = len(validation.metrics)
    assert lines[0] == f"verdict  AGREES  {count} of {count} metrics agree, 0 not counted"
    assert sum(" agrees " in line for line in lines) == len(validation.metrics)
    assert f"run      {finished_run}" in lines
    assert any("simulated" in line for line in lines) == any(len(line) > 100 and "metric" in line for line in lines)


@pytest.mark.parametrize("printed", [140], indirect=True)
def test_folds_stand_beside_each_other_by_each_road(finished_run: Path, printed: io.StringIO) -> None:
    validation, analysis = load_validation(finished_run), load_analysis(finished_run)
    far = replace(analysis.folds[0], alpha_rad=1.0)
    tables.show_validation(finished_run, replace(analysis, folds=(*analysis.folds, far)), validation)
    alone = (validation.folds[0], replace(validation.folds[1], predicted=()))
    fewer = replace(analysis, folds=analysis.folds[:1])
    tables.show_validation(finished_run, fewer, replace(validation, folds=alone))
    text = printed.getvalue()
    assert text.count("not flown") == 2
    assert text.count("not predicted") == 1
    assert "14.72" in text
    assert "-35.1" in text


@pytest.mark.parametrize("printed", [140], indirect=True)
def test_what_is_not_counted_says_why(finished_run: Path, printed: io.StringIO) -> None:
    validation = load_validation(finished_run)
    aside = replace(validation.metrics[0], counted=False, note="extrapolated [really]")
    changed = replace(validation, metrics=(aside, *validation.metrics[1:]), notes=("look here",))
    tables.show_validation(finished_run, load_analysis(finished_run), changed)
    text = printed.getvalue()
    counted = sum(metric.counted for metric in changed.metrics)
    assert f"{counted} of {counted} metrics agree, {len(changed.metrics) - counted} not counted" in text
    assert "not counted (1)" in text
    assert "\n(1) extrapolated [really]\n" in text
    assert "note     look here" in text


@pytest.mark.parametrize("printed", [140], indirect=True)
def test_sweep_and_model_are_shown_in_degrees(finished_run: Path, printed: io.StringIO) -> None:
    flown, identification = load_sweep(finished_run), load_identification(finished_run)
    tables.show_sweep(finished_run, flown, load_accuracy(finished_run))
    tables.show_identification(finished_run, identification)
    text = printed.getvalue()
    assert all(record.name in text for record in flown.records)
    # aircraft/f8ii/published.toml, dq/dt with the rate of alpha substituted
    digits = re.sub(r"-0\.0*", "-", text).replace(".", "")  # wherever the point stands
    for coefficient in ("-350", "-806", "-465"):
        assert coefficient in digits


@pytest.mark.parametrize("printed", [140], indirect=True)
def test_the_analysis_marks_what_is_extrapolated(finished_run: Path, printed: io.StringIO) -> None:
    analysis = load_analysis(finished_run)
    outside = replace(analysis.folds[0], in_domain=False, elevator_interval_rad=frozen_array([-np.inf, np.inf]))
    analysis_tables.show_analysis({"run": "here", "stored": ""}, replace(analysis, folds=(outside,), notes=("a note",)))
    text = printed.getvalue()
    assert "extrapolated" in text
    assert "not determined" in text
    assert "note     a note" in text
    assert "run      here\nstored   nowhere; --output FILE keeps it\n" in text


@pytest.mark.parametrize(
    ("area_deg2_s", "half", "beyond", "expected"),
    [
        (480e3, 460e3, 119189.0, ("480000 ± 460000", "120000")),
        (480e3, 500e3, 119189.0, ("not determined", "120000")),
        (4812.3, 21.0, 119.19, ("4812 ± 21", "119")),
        (4812.3, 0.0, 119.19, ("4812", "119")),
        (4812.3, 2100.0, np.inf, ("4800 ± 2100", "∞")),
    ],
)
def test_a_region_has_no_more_digits_than_are_known(
    finished_run: Path, area_deg2_s: float, half: float, beyond: float, expected: tuple[str, str]
) -> None:
    square = to_si(to_si(1.0, "deg"), "deg")
    analysis = load_analysis(finished_run)
    region = replace(
        analysis.regions[0],
        area_rad2_s=area_deg2_s * square,
        area_interval_rad2_s=frozen_array([(area_deg2_s - half) * square, (area_deg2_s + half) * square]),
        area_beyond_rad2_s=frozen_array([beyond * square] * 2),
        escape_distance_rad=to_si(100.0, "deg"),
        escape_interval_rad=frozen_array(to_si(np.array([-1400.0, 1600.0]), "deg")),
    )
    table = region_tables.regions_table([region], (-1.0, 1.0))
    cells = [str(next(iter(column.cells))) for column in table.columns]
    assert (cells[3], cells[4]) == expected
    assert cells[6] == "not determined"  # 100 ± 1500
    row = region_row(region)
    assert row.area == expected[0]
    assert row.beyond.startswith(f"{expected[1]} beyond")
    assert row.escape == "not determined"


@pytest.mark.parametrize(("half_deg", "expected"), [(0.0, "57.30"), (25.0, "57 ± 25"), (np.inf, "not determined")])
@pytest.mark.parametrize("printed", [140], indirect=True)
def test_a_fold_of_the_model_alone_is_known_to_its_interval(
    finished_run: Path, printed: io.StringIO, half_deg: float, expected: str
) -> None:
    analysis, half = load_analysis(finished_run), to_si(half_deg, "deg")
    far = replace(analysis.folds[0], alpha_rad=1.0, alpha_interval_rad=frozen_array([1.0 - half, 1.0 + half]))
    changed = replace(analysis, folds=(*analysis.folds, far))
    tables.show_validation(finished_run, changed, load_validation(finished_run))
    (line,) = (line for line in printed.getvalue().splitlines() if "not flown" in line)
    assert line.split("  ")[0].strip() == expected


def test_a_terminal_gets_bars(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes any stream for a terminal then
    monkeypatch.setenv("TERM", "xterm")
    with watching(quiet=False) as progress:
        progress.begin("sweep", 2)
        progress.step("hold-01")
        progress.begin("validate", 0)
        progress.step("ramps")
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "validate" in captured.err
    assert "ramps" in captured.err


def test_a_warning_goes_to_stderr(finished_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tables.warn(replace(load_identification(finished_run), warnings=("degrees?",)))
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "finback: warning: degrees?\n")


def test_maneuvers_that_were_not_flown_are_a_warning(finished_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sweep = load_sweep(finished_run)
    tables.warn_of_sweep(sweep)
    tables.warn_of_sweep(
        replace(sweep, provenance={**sweep.provenance, "not_flown": "'hold-01' is not flown: no trim"})
    )
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "finback: warning: 'hold-01' is not flown: no trim\n")


@pytest.mark.parametrize("printed", [40, 60], indirect=True)
def test_on_a_narrow_terminal_no_number_is_broken(finished_run: Path, printed: io.StringIO) -> None:
    validation, analysis = load_validation(finished_run), load_analysis(finished_run)
    tables.show_validation(finished_run, analysis, validation)
    analysis_tables.show_analysis({"run": "here", "stored": ""}, analysis)
    shown = [one for one in located(analysis) if one.kind not in analysis_tables.LISTED]
    lines = printed.getvalue().splitlines()
    assert sum(line.startswith("  judgement  agrees") for line in lines) == len(validation.metrics)
    assert sum(bool(re.match(r"  simulator: hold  \S+ ± \S+$", line)) for line in lines) == len(analysis.folds)
    assert sum(bool(re.match(r"  elevator \[deg\]  \S+ ± \S+$", line)) for line in lines) == len(shown)


@pytest.mark.parametrize("printed", [140], indirect=True)
def test_without_a_fold_there_is_no_table_of_folds(finished_run: Path, printed: io.StringIO) -> None:
    validation, analysis = load_validation(finished_run), load_analysis(finished_run)
    tables.show_validation(finished_run, replace(analysis, folds=()), replace(validation, folds=()))
    assert "fold at alpha [deg]" not in printed.getvalue()


@pytest.mark.parametrize("printed", [80], indirect=True)
def test_no_word_is_broken_on_a_narrow_terminal(finished_run: Path, printed: io.StringIO) -> None:
    """A table that would have to break words or numbers is written as a list."""
    source = {"run": str(finished_run), "form": "lienard", "stored": ""}
    analysis_tables.show_analysis(source, load_analysis(finished_run))
    tables.show_identification(finished_run, load_identification(finished_run))
    text = printed.getvalue()
    for word in ("unbounded", "smallest escape [deg]", "heteroclinic", "extrapolated"):
        assert word in text
    assert not re.search(r"±$|± *\n", text)

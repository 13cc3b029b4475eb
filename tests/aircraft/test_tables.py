"""The tables over the full circle: smooth at the joints, closed at ±180°, with the equilibria that SOURCE.md states."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from finback.flight.equilibrium import equilibria
from finback.flight.rig import Rig
from finback.units import from_si, to_si

FULL_CIRCLE = ("CL", "CL_elevator", "CL_q", "CD", "Cm", "Cm_elevator", "Cm_q", "Cm_alpha_dot")
JOINTS = (-45.0, -34.0, 46.0, 66.0)
CONTINUOUS = 0.02  # of the slope: a jump that falls at least so far when steps are a tenth is the curve's own bending

Table = tuple[np.ndarray, np.ndarray]


def tables(xml: Path) -> dict[str, Table]:
    found = {}
    for table in ET.parse(xml).iter("table"):  # noqa: S314 - the repository's own file
        name, data = table.get("name", ""), table.findtext("tableData", "")
        if name.startswith("aero/table/"):
            rows = np.array([[float(number) for number in line.split()] for line in data.strip().splitlines()])
            found[name.removeprefix("aero/table/")] = (rows[:, 0], rows[:, 1])
    return found


@pytest.fixture(scope="module")
def built(aircraft_folder: Path) -> dict[str, Table]:
    return tables(aircraft_folder / "f8ii.xml")


@pytest.fixture(scope="module")
def fine(builder: ModuleType, aircraft_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Table]:
    """The tables with a tenth of every step."""
    folder = tmp_path_factory.mktemp("fine")
    for name in ("published.toml", "f8ii.xml.in", "data", "Engines"):
        (folder / name).symlink_to(aircraft_folder / name)
    text = (aircraft_folder / "reference.toml").read_text(encoding="utf-8")
    text = re.sub(r"(_step_deg = )(\S+)", lambda found: f"{found[1]}{float(found[2]) / 10!r}", text)
    (folder / "reference.toml").write_text(text, encoding="utf-8")
    assert builder.main(["--source", str(folder), "--output", str(folder / "f8ii")]) == 0
    return tables(folder / "f8ii" / "f8ii.xml")


def slopes_beside(table: Table, alpha: float) -> tuple[float, float]:
    index = int(np.flatnonzero(table[0] == alpha)[0])
    slopes = np.diff(table[1]) / np.diff(table[0])
    return float(slopes[index - 1]), float(slopes[index])


@pytest.mark.parametrize("name", [name for name in FULL_CIRCLE if name != "CD"])
@pytest.mark.parametrize("joint", JOINTS)
def test_slopes_meet_at_the_joints(built: dict[str, Table], fine: dict[str, Table], name: str, joint: float) -> None:
    # The jump between neighboring chords of a smooth curve falls with their length; that of a corner stays.
    coarse = abs(np.subtract(*slopes_beside(built[name], joint)))
    small = abs(np.subtract(*slopes_beside(fine[name], joint)))
    scale = np.abs(slopes_beside(fine[name], joint)).max()
    assert small <= 0.2 * coarse + CONTINUOUS * scale
    if coarse > 0.1 * scale:
        assert small < 0.2 * coarse


@pytest.mark.parametrize("name", ["CL", "Cm"])
@pytest.mark.parametrize("joint", [-34.0, 46.0])
def test_values_run_on_across_the_ends_of_the_model(
    fine: dict[str, Table], builder: ModuleType, aircraft_folder: Path, name: str, joint: float
) -> None:
    model = builder.coefficients(
        *(builder.Settings.read(aircraft_folder / f"{file}.toml") for file in ("published", "reference"))
    )
    value, slope = builder.polynomial(getattr(model, name), joint)
    outward = -1 if joint < 0 else 1
    alpha, values = fine[name]
    index = int(np.flatnonzero(alpha == joint)[0])
    step = alpha[index + outward] - joint
    assert values[index] == value
    # one step outside, the blend is the tangent of the cubic but for its bending over that step
    assert abs(values[index + outward] - value - slope * step) < 2.0 * abs(slope * step) * abs(step)


@pytest.mark.parametrize("name", FULL_CIRCLE)
def test_the_circle_closes(built: dict[str, Table], name: str) -> None:
    alpha, values = built[name]
    assert (alpha[0], alpha[-1]) == (-180.0, 180.0)
    assert values[0] == values[-1]
    assert (np.diff(alpha) > 0).all()


@pytest.mark.parametrize("name", [name for name in FULL_CIRCLE if name != "CD"])
def test_slopes_meet_at_the_seam(built: dict[str, Table], fine: dict[str, Table], name: str) -> None:
    def jump(table: Table) -> float:
        slopes = np.diff(table[1]) / np.diff(table[0])
        return float(abs(slopes[-1] - slopes[0]))

    assert jump(fine[name]) <= 0.2 * jump(built[name]) + 1e-12


def test_breakpoints_inside_the_model_are_tenths_of_a_degree(built: dict[str, Table]) -> None:
    expected = {index / 10 for index in range(-340, 461)}
    for name in ("CL", "Cm"):
        alpha = built[name][0]
        assert set(alpha[(alpha >= -34.0) & (alpha <= 46.0)].tolist()) == expected


def test_outside_the_blend_the_tables_pass_through_the_estimates(
    built: dict[str, Table], builder: ModuleType, aircraft_folder: Path
) -> None:
    columns = builder.read_columns(aircraft_folder / "data" / "longitudinal.csv")
    alpha = np.array(columns.pop("alpha_deg"))
    outside = (alpha <= -45.0) | (alpha >= 66.0)
    for column, values in columns.items():
        at, table = built[column.removesuffix("_per_rad")]
        expected = np.array(values)[outside]
        found = table[np.searchsorted(at, alpha[outside])]
        assert np.abs(found - expected).max() <= 1e-15, column


def stated_equilibria(source: Path) -> dict[float, list[tuple[float, float, bool]]]:
    """Return elevator -> (alpha, q, stable), in degrees, from the table of SOURCE.md."""
    stated = {}
    for line in source.read_text(encoding="utf-8").splitlines():
        if row := re.fullmatch(r"\| (-?\d+) \| (.*;.*) \|", line):
            cells = [re.fullmatch(r"(\S+) \((\S+)\)( stable|)", cell.strip()) for cell in row[2].split(";")]
            assert all(cells), line
            stated[float(row[1])] = [(float(c[1]), float(c[2]), c[3] == " stable") for c in cells if c]
    return stated


def test_the_equilibria_are_those_of_the_source_file(rig: Rig, aircraft_folder: Path) -> None:
    stated = stated_equilibria(aircraft_folder / "SOURCE.md")
    assert list(stated) == [-35.0, -20.0, -10.0, -5.0, 0.0, 5.0, 10.0]
    limits = (to_si(-179.999, "deg"), to_si(179.999, "deg"))
    for elevator, expected in stated.items():
        found = equilibria(rig.derivatives, elevator_rad=to_si(elevator, "deg"), alpha_limits_rad=limits)
        text = "; ".join(
            f"{from_si(e.alpha_rad, 'deg'):.2f} ({from_si(e.q_rad_s, 'deg_s'):.2f}){' stable' * e.stable}"
            for e in found
        )
        assert len(found) == len(expected), text
        for equilibrium, (alpha, q, stable) in zip(found, expected, strict=True):
            assert from_si(equilibrium.alpha_rad, "deg") == pytest.approx(alpha, abs=0.0051), text  # two decimals
            assert from_si(equilibrium.q_rad_s, "deg_s") == pytest.approx(q, abs=0.0051), text
            assert equilibrium.stable is stable, text


def test_the_left_saddle_lies_inside_the_model_for_every_research_elevator(rig: Rig) -> None:
    limits = (to_si(-34.0, "deg"), to_si(46.0, "deg"))
    for elevator, saddle in ((-40.0, 0), (20.0, -1)):
        found = equilibria(rig.derivatives, elevator_rad=to_si(elevator, "deg"), alpha_limits_rad=limits)
        assert len(found) == 1  # beyond both folds one saddle is left
        assert not found[saddle].stable


def test_deep_stall_hump_and_inverted_stall_stand_where_they_should(rig: Rig, built: dict[str, Table]) -> None:
    alpha, cm = built["Cm"]
    beyond = (alpha > 46.0) & (alpha < 66.0)
    hump = alpha[beyond][np.argmax(cm[beyond])]
    assert 48.0 < hump < 52.0
    limits = (to_si(-179.0, "deg"), to_si(179.0, "deg"))
    found = equilibria(rig.derivatives, elevator_rad=0.0, alpha_limits_rad=limits)
    stable = [from_si(e.alpha_rad, "deg") for e in found if e.stable]
    assert stable == pytest.approx([-48.0, 0.25, 61.0], abs=1.0)
    kinds: Callable[[bool], str] = {True: "s", False: "u"}.__getitem__
    assert "".join(kinds(e.stable) for e in found) == "sususu"  # they alternate around the circle

"""Limit cycles of an analysis: families against connections found otherwise, absence, and what the notes say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze
from finback.dynamics.analysis_cycles import CycleVerdict, elevator_cycles
from finback.dynamics.consistency import inconsistencies_of_located
from finback.dynamics.cycle.branch import FamilyEnd
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.located import located
from finback.dynamics.stability.absence import AbsenceProven, Theorem
from finback.dynamics.stability.regime import Event
from finback.errors import RefusedError
from finback.units import to_si

Build = Callable[..., LienardSystem]
GRID = np.linspace(-0.5, 0.5, 21).tolist()
# x" = (0.1 + x) x' − x + x² + δ: one Hopf point, at x = −0.1 where f = 0, one saddle.
WITH_LOOP = (0.1, 1.0), (0.0, -1.0, 1.0)


def _options(elevator: Sequence[float] = (-0.5, 0.5)) -> AnalysisOptions:
    return AnalysisOptions(
        elevator_range_rad=(elevator[0], elevator[1]),
        elevator_step_rad=0.05,
        alpha_range_rad=(-3.0, 3.0),
        branch_points=11,
    )


@pytest.fixture(scope="module")
def looped(build_system: Build) -> Analysis:
    return analyze(build_system(*WITH_LOOP), _options())


def test_a_family_from_a_hopf_point_ends_at_the_homoclinic_loop(looped: Analysis) -> None:
    """Two roads: cycles followed until their period grows without bound, and manifolds of the saddle that meet."""
    (family,) = looped.limit_cycles.families
    (hopf,) = looped.hopf_points
    (loop,) = looped.connections.homoclinics
    assert hopf.elevator_rad == pytest.approx(-0.11, abs=1e-15)
    assert (family.begin, family.end) == (FamilyEnd.HOPF, FamilyEnd.LOOP)
    assert family.begin_elevator_rad == hopf.elevator_rad
    assert family.end_elevator_rad == pytest.approx(loop.elevator_rad, abs=1e-9)
    held = sorted({cycle.elevator_rad for cycle in looped.limit_cycles.cycles})
    assert held == [value for value in GRID if loop.elevator_rad < value < hopf.elevator_rad]
    # Supercritical or not, the cycles have the stability that the equilibrium inside has lost.
    inside = {p.elevator_rad: p.kind for p in looped.equilibria if p.kind != "saddle"}
    assert all(cycle.stable != inside[cycle.elevator_rad].stable for cycle in looped.limit_cycles.cycles)


def test_the_regimes_are_split_at_every_event(looped: Analysis) -> None:
    (loop,) = looped.connections.homoclinics
    (hopf,), (fold,) = looped.hopf_points, looped.folds
    inner = [regime.events[1] for regime in looped.regimes[:-1]]
    ends = [float(regime.elevator_rad[1]) for regime in looped.regimes[:-1]]
    assert inner == [Event.HOMOCLINIC, Event.HOPF, Event.FOLD]
    assert ends == [loop.elevator_rad, hopf.elevator_rad, fold.elevator_rad]
    assert [region.elevator_rad for region in looped.regions] == [
        regime.elevator_seen_rad for regime in looped.regimes if regime.bounds
    ]


def test_what_is_located_is_consistent(looped: Analysis) -> None:
    assert inconsistencies_of_located(located(looped)) == ()
    cycles = [one for one in located(looped) if one.kind == "cycle"]
    assert len(cycles) == len(looped.limit_cycles.cycles)
    for one, cycle in zip(cycles, looped.limit_cycles.cycles, strict=True):
        assert one.properties["period"].value == cycle.period_s
        assert one.words["stability"] == ("stable" if cycle.stable else "unstable")
        assert one.state["alpha_min"].value < one.state["alpha_max"].value
    spoiled = replace(cycles[0], parameter=replace(cycles[0].parameter, value=np.nan))
    assert inconsistencies_of_located([spoiled])


def test_cycles_that_no_hopf_point_bears_are_followed_both_ways(build_system: Build) -> None:
    """Two cycles for each elevator between two folds; a linear force, so that the picture is symmetric in δ."""
    found = elevator_cycles(build_system((-1.0, 0.0, 3.0, 0.0, -1.0), (0.0, -1.0)), GRID[::2])
    (family,) = found.families
    low, high = (fold.elevator_rad for fold in family.folds)
    assert family.begin is FamilyEnd.CLOSED
    assert low == pytest.approx(-high, rel=1e-9)
    for elevator in GRID[::2]:
        count = sum(cycle.elevator_rad == elevator for cycle in found.cycles)
        assert count == (2 if low < elevator < high else 0)
    assert found.absence.verdict is CycleVerdict.FOUND


@pytest.mark.parametrize(
    ("damping", "force", "verdict"),
    [
        ((-1.0,), (0.0, -1.0), CycleVerdict.PROVED_ABSENT),
        ((-1.0, 0.0, -1.0), (0.0, 1.0, 0.0, -1.0), CycleVerdict.PROVED_ABSENT),
        ((1.0, 0.0, -1.0), (0.0, -1.0), CycleVerdict.FOUND),  # van der Pol
        ((0.1, 0.05, -1.0), (0.0, 1.0, 0.0, -1.0), CycleVerdict.NONE_FOUND),  # f changes its sign between three
        ((1.0,), (0.0,), CycleVerdict.UNKNOWN),  # there is no equilibrium, or every angle is one
    ],
)
def test_the_verdict(
    build_system: Build, damping: Sequence[float], force: Sequence[float], verdict: CycleVerdict
) -> None:
    found = elevator_cycles(build_system(damping, force), GRID[::5])
    assert found.absence.verdict is verdict
    assert (found.searched_rad == ()) == (verdict is CycleVerdict.PROVED_ABSENT)
    assert ("proved for the coefficients" in found.absence.statement) == (verdict is CycleVerdict.PROVED_ABSENT)


def test_connections_outside_the_range_are_said(printed_system: LienardSystem) -> None:
    degrees = to_si(np.array([-10.0, 10.0]), "deg")
    analysis = analyze(printed_system, _options(degrees.tolist()))
    found = [note for note in analysis.notes if note.startswith("The saddle connection")]
    assert [note.split("°")[0] for note in found] == ["The saddle connection at elevator -18.307"]
    assert "outside the elevator range" in found[0]
    inner = replace(printed_system, domain=np.array([[-1.0, 1.0], [-0.1, 0.1]]))
    notes = analyze(inner, _options(to_si(np.array([-40.0, 20.0]), "deg").tolist())).notes
    assert sum("is beyond the elevators of the data" in note for note in notes) == 1


def test_without_damping_no_closed_orbit_is_a_cycle(build_system: Build) -> None:
    found = elevator_cycles(build_system((0.0,), (0.0, -1.0, 0.0, 1.0)), GRID)
    assert found.absence.verdict is CycleVerdict.PROVED_ABSENT
    assert "the energy is constant along every orbit" in found.absence.statement


def test_without_equilibria_there_is_nothing_to_enclose(build_system: Build) -> None:
    """A force that no angle changes: no equilibrium where it is not zero, every angle where it is."""
    found = elevator_cycles(build_system((1.0, 1.0), (2.0,)), GRID)
    assert found.absence.verdict is CycleVerdict.PROVED_ABSENT
    assert {part.theorem for part in found.absence.parts if isinstance(part, AbsenceProven)} == {Theorem.INDEX}
    through = elevator_cycles(build_system((1.0, 1.0), (0.1,)), GRID)
    assert through.absence.verdict is not CycleVerdict.PROVED_ABSENT
    low, high = through.absence.undecided_rad[0]
    assert low <= -0.1 <= high


def test_the_same_obstacle_is_said_once(build_system: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object) -> None:
        raise RefusedError("it is foggy")

    monkeypatch.setattr("finback.dynamics.analysis_cycles.cycles", refuses)
    found = elevator_cycles(build_system((1.0, 0.0, -1.0), (0.0, -1.0)), GRID)
    (said,) = (obstacle for obstacle in found.obstacles if "foggy" in obstacle)
    assert said.startswith("at elevator ")
    assert "more: it is foggy" in said
    assert len(found.searched_rad) > 10


def test_one_elevator_without_isolated_equilibria_stops_nothing(build_system: Build) -> None:
    analysis = analyze(build_system((-1.0,), (0.0,)), _options())
    assert analysis.equilibria == ()
    assert sum("no equilibrium is listed" in note for note in analysis.notes) == 1
    with pytest.raises(RefusedError, match="no equilibria can be told at any elevator"):
        analyze(build_system((-1.0,), (0.0,), gain=0.0), _options())

"""Phase portraits: what is drawn lies where it must, ends where it must, and solves the equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import plain_flow
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.portrait.orbit import clipped
from finback.dynamics.portrait.path import Box, PathEnd, Portrait
from finback.dynamics.portrait.portrait import natural_box, phase_portrait, system_portrait
from finback.errors import InputError
from finback.units import to_si

# Polylines are thinned to 2e-3 of the box: chords of an arc of the radius of the box miss it by less.
DRAWN = 2e-3


@pytest.fixture(scope="module")
def two_cycles() -> Portrait:
    return phase_portrait(Cubic(a1=0.5, b1=0.5, a0=0.0022, b0=-0.35).flow())


@pytest.fixture(scope="module")
def wells() -> Portrait:
    return phase_portrait(Cubic(a1=0.3, b1=0.2, b2=-1.0, a0=0.765, b0=1.0).flow())


def test_everything_is_there(two_cycles: Portrait) -> None:
    assert [point.kind for point in two_cycles.equilibria] == [Kind.SADDLE, Kind.UNSTABLE_FOCUS, Kind.SADDLE]
    branches = {(round(branch.saddle_x, 6), branch.side, branch.stable) for branch in two_cycles.separatrices}
    assert len(branches) == len(two_cycles.separatrices) == 8
    assert [drawn.cycle.stable for drawn in two_cycles.cycles] == [True, False]
    assert two_cycles.orbits
    assert two_cycles.nullclines
    assert two_cycles.notes == ()


def test_all_lies_in_the_box(two_cycles: Portrait, wells: Portrait) -> None:
    for portrait in (two_cycles, wells):
        box = portrait.box
        pieces = [
            *(piece for orbit in portrait.orbits for piece in orbit.pieces),
            *(piece for branch in portrait.separatrices for piece in branch.orbit.pieces),
            *(piece for drawn in portrait.cycles for piece in drawn.pieces),
            *portrait.nullclines,
        ]
        slack = 1e-12 * max(box.x_high - box.x_low, box.y_high - box.y_low)
        for piece in pieces:
            assert piece.shape[1] == 2
            assert len(piece) > 1
            assert box.x_low - slack <= piece[:, 0].min() and piece[:, 0].max() <= box.x_high + slack  # noqa: PT018
            assert box.y_low - slack <= piece[:, 1].min() and piece[:, 1].max() <= box.y_high + slack  # noqa: PT018


def test_cycles_are_closed_and_turn_where_they_turn(two_cycles: Portrait, wells: Portrait) -> None:
    for portrait in (two_cycles, wells):
        width = portrait.box.x_high - portrait.box.x_low
        for drawn in portrait.cycles:
            (piece,) = drawn.pieces
            np.testing.assert_array_equal(piece[0], piece[-1])
            assert piece[:, 0].max() == pytest.approx(drawn.cycle.x_max, abs=DRAWN * width)
            assert piece[:, 0].min() == pytest.approx(drawn.cycle.x_min, abs=DRAWN * width)


def test_orbits_solve_the_equations(two_cycles: Portrait) -> None:
    """Another road: scipy's DOP853 from the start of each orbit passes every point drawn of its first piece."""
    flow, box = two_cycles.flow, two_cycles.box
    width, height = box.x_high - box.x_low, box.y_high - box.y_low
    for orbit in two_cycles.orbits[:6]:
        way = 1.0 if orbit.forward else -1.0
        piece = orbit.pieces[0][:40]

        def leave(_: float, s: np.ndarray) -> float:
            return 3.0 * width - float(np.abs(s).max())

        leave.terminal = True  # type: ignore[attr-defined] - scipy's own way to mark an event
        solved = solve_ivp(
            lambda _, s, way=way: (way * s[1], way * flow.acceleration(s[0], s[1])),
            (0.0, 40.0),
            orbit.start,
            method="DOP853",
            rtol=1e-10,
            atol=1e-12,
            dense_output=True,
            events=leave,
        )
        path = solved.sol(np.linspace(0.0, solved.t[-1], 40_000)).T
        for point in piece:
            assert np.hypot(*((path - point) / (width, height)).T).min() < DRAWN


def test_separatrices_begin_at_their_saddle_along_the_eigenvectors(two_cycles: Portrait) -> None:
    for branch in two_cycles.separatrices:
        (saddle,) = (point for point in two_cycles.equilibria if point.x == pytest.approx(branch.saddle_x))
        x, y = branch.orbit.pieces[0][1] - (branch.saddle_x, 0.0)
        assert math.copysign(1.0, x) == branch.side
        slope = saddle.eigenvalues_real[1 if branch.stable else 0]
        assert y / x == pytest.approx(slope, rel=0.05)
        assert branch.orbit.forward is not branch.stable


def test_where_separatrices_go(two_cycles: Portrait, wells: Portrait) -> None:
    # The stable branch of the nearer saddle comes from the outer, unstable cycle.
    (inner,) = (b for b in two_cycles.separatrices if b.stable and b.saddle_x > 0.0 and b.side < 0)
    assert inner.orbit.end is PathEnd.CYCLE
    # In the wells both unstable branches of the saddle end in the left sink, both stable ones come from a cycle.
    ends = {(b.stable, b.orbit.end) for b in wells.separatrices}
    assert ends == {(False, PathEnd.REST), (True, PathEnd.CYCLE)}
    left = wells.equilibria[0].x
    assert all(b.orbit.to_x == pytest.approx(left) for b in wells.separatrices if not b.stable)


def test_regions_have_orbits_of_their_own(wells: Portrait) -> None:
    """Both sinks are reached, and the large stable cycle."""
    reached = {(o.end, round(o.to_x, 3)) for o in wells.orbits if o.forward and o.end is PathEnd.REST}
    assert {x for _, x in reached} == {round(wells.equilibria[0].x, 3), round(wells.equilibria[2].x, 3)}
    assert any(o.end is PathEnd.CYCLE for o in wells.orbits if o.forward)


def test_nullclines_are_where_y_stands_still(wells: Portrait) -> None:
    for piece in wells.nullclines:
        for x, y in piece[1:-1:20]:
            size = abs(wells.flow.acceleration(x, 0.0)) + abs(wells.flow.acceleration(x, 1.0))
            assert abs(wells.flow.acceleration(float(x), float(y))) <= 1e-9 * (1.0 + size) * (1.0 + abs(y))


def test_a_center_has_no_cycle_and_its_orbits_are_drawn_for_long() -> None:
    portrait = phase_portrait(plain_flow((0.0,), (0.0, -1.0)), Box(x_low=-1, x_high=1, y_low=-1, y_high=1))
    assert portrait.cycles == ()
    assert {orbit.end for orbit in portrait.orbits} <= {PathEnd.LONG, PathEnd.BOX}
    for orbit in portrait.orbits:
        radius = np.hypot(*orbit.start)
        for piece in orbit.pieces:
            assert np.abs(np.hypot(*piece[1:-1].T) - radius).max(initial=0.0) < 1e-9


def test_units_do_not_matter() -> None:
    cubic = Cubic(a1=0.5, b1=0.5, a0=0.0022, b0=-0.35)
    plain, scaled = phase_portrait(cubic.flow()), phase_portrait(cubic.rescaled(1e-4, 1e3).flow())
    assert len(plain.separatrices) == len(scaled.separatrices)
    for one, other in zip(plain.separatrices, scaled.separatrices, strict=True):
        assert one.orbit.end is other.orbit.end
        np.testing.assert_allclose(other.orbit.pieces[0][1] * (1e-4, 1e-7), one.orbit.pieces[0][1], rtol=1e-6)


def test_the_published_aircraft(printed_system: LienardSystem) -> None:
    """Between the two connections the region of the sink is bounded by both saddles, and both run into it."""
    portrait = system_portrait(printed_system, to_si(-5.0, "deg"))
    assert [point.kind for point in portrait.equilibria] == [Kind.SADDLE, Kind.STABLE_FOCUS, Kind.SADDLE]
    assert portrait.cycles == ()
    inward = [b for b in portrait.separatrices if not b.stable and b.orbit.end is PathEnd.REST]
    assert len(inward) == 2
    assert all(b.orbit.to_x == pytest.approx(portrait.equilibria[1].x) for b in inward)


def test_boxes() -> None:
    box = natural_box(Cubic(a1=0.5, b1=0.5, a0=0.0, b0=-0.35).flow())
    assert box.x_low < -0.9 < 0.4 < box.x_high
    with pytest.raises(InputError, match="no box"):
        Box(x_low=1.0, x_high=1.0, y_low=0.0, y_high=1.0)


def test_cutting_at_the_edge() -> None:
    box = Box(x_low=0.0, x_high=1.0, y_low=0.0, y_high=1.0)
    line = np.array([[-1.0, 0.5], [2.0, 0.5], [2.0, 2.0], [0.5, 2.0], [0.5, -1.0]])
    first, second = clipped(line, box)
    np.testing.assert_allclose(first, [[0.0, 0.5], [1.0, 0.5]])
    np.testing.assert_allclose(second, [[0.5, 1.0], [0.5, 0.0]])
    assert clipped(np.array([[2.0, 2.0], [3.0, 3.0]]), box) == []

"""The cubic system of Shi & Fan 2013, Eq. 17-18: coordinates, equilibria, Hopf, Bautin, regions."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from scipy.integrate import solve_ivp

from finback.dynamics.cycle.lyapunov import lyapunov_coefficients
from finback.dynamics.equilibrium import Kind, equilibria
from finback.dynamics.flow import rests
from finback.dynamics.fold import folds
from finback.dynamics.hopf import Criticality
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.normal_form.cubic import MIRROR, Cubic, centered, cubic_normal_form, outer_roots
from finback.dynamics.normal_form.cubic_equilibria import CubicCase, cubic_equilibria
from finback.dynamics.normal_form.cubic_hopf import cubic_bautin_points, cubic_bogdanov_takens_points, cubic_hopf_points
from finback.dynamics.normal_form.cubic_reduction import held_cubic, held_cubic_about
from finback.dynamics.normal_form.cubic_region import CurveSource, Region, RegionCurves, first_order_curves, region
from finback.dynamics.normal_form.nature import Nature
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, RefusedError
from finback.units import from_si

_ROUNDING = 1e-12  # some dozens of operations on numbers up to 1e3

_number = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))
_nonzero = _number.filter(lambda value: abs(value) >= 0.1)
_cubic = st.builds(Cubic, a2=_nonzero, a1=_number, a0=_number, b2=_nonzero, b1=_number, b0=_number)


def _assert_same_field(cubic: Cubic, change: Rescaling, moved: Cubic) -> None:
    flow = change.flow(cubic.flow())
    scale = max(1.0, *flow.force_sizes, *map(abs, flow.damping))
    np.testing.assert_allclose(moved.flow().damping, flow.damping, rtol=_ROUNDING, atol=_ROUNDING * scale)
    np.testing.assert_allclose(moved.flow().force, flow.force, rtol=_ROUNDING, atol=_ROUNDING * scale)


# --- coordinates -------------------------------------------------------------------------------------------------


@given(_cubic)
def test_the_normal_form_is_the_same_field(cubic: Cubic) -> None:
    form = cubic_normal_form(cubic)
    assert form.normal.is_normal
    assert form.normal.b2 == math.copysign(1.0, cubic.b2)
    assert form.rescaling.reverses_time == (cubic.a2 > 0.0)
    _assert_same_field(cubic, form.rescaling, form.normal)
    again = cubic_normal_form(form.normal)
    assert again.normal == form.normal
    assert again.rescaling == Rescaling()


@given(_cubic, st.floats(0.2, 5.0), st.floats(0.2, 5.0))
def test_the_normal_form_does_not_depend_on_the_units(cubic: Cubic, length: float, time: float) -> None:
    one, other = cubic_normal_form(cubic).normal, cubic_normal_form(cubic.rescaled(length, time)).normal
    np.testing.assert_allclose(one.damping, other.damping, rtol=1e-11)
    np.testing.assert_allclose(one.force, other.force, rtol=1e-11)


@given(_cubic)
def test_symmetry_and_reversal(cubic: Cubic) -> None:
    _assert_same_field(cubic, MIRROR, cubic.mirrored())
    mirrored = cubic.mirrored()
    assert (mirrored.a1, mirrored.b1) == (-cubic.a1, -cubic.b1)
    assert (mirrored.a2, mirrored.a0, mirrored.b2, mirrored.b0) == (cubic.a2, cubic.a0, cubic.b2, cubic.b0)
    _assert_same_field(cubic, Rescaling(time=-1.0), cubic.reversed())
    assert cubic.reversed().reversed() == cubic


@given(_cubic)
def test_moving_the_origin_to_an_equilibrium(cubic: Cubic) -> None:
    for x in outer_roots(cubic):
        assume(x == 0.0 or abs(x) > 1e-6)
        assert cubic.flow().acceleration(x, 0.0) == pytest.approx(0.0, abs=1e-11 * max(1.0, abs(x) ** 3))
        _assert_same_field(cubic, Rescaling(shift=x), cubic.moved(x))


@given(_cubic)
def test_the_outer_roots_are_those_of_the_general_search(cubic: Cubic) -> None:
    assume(cubic.b0 != 0.0 and abs(cubic.discriminant) > 1e-9)
    expected = [point.x for point in rests(cubic.flow()) if point.x != 0.0]
    np.testing.assert_allclose(outer_roots(cubic), expected, rtol=1e-9)


@given(_cubic)
def test_the_centered_form_has_its_origin_in_the_middle(cubic: Cubic) -> None:
    """Erratum E5: for 0 < b0 < b1²/4 the translation leads to b0 < 0; for b2 = −1 to the saddle between the wells."""
    form = centered(cubic)
    _assert_same_field(cubic, form.rescaling, form.normal)
    places = sorted((0.0, *outer_roots(cubic)))
    if len(places) == 3 and cubic.b0 != 0.0:
        assert form.normal.b0 * form.normal.b2 < 0.0
        assert form.rescaling.shift == pytest.approx(places[1], abs=1e-12)
    else:
        assert form.rescaling.shift == 0.0


def test_what_has_no_normal_form_is_refused_with_the_class_that_holds_it() -> None:
    with pytest.raises(RefusedError, match="b2 is zero") as quadratic:
        cubic_normal_form(Cubic(a2=0.0, a1=1.0, a0=0.0, b2=0.0, b1=1.0, b0=0.0))
    assert "Quadratic" in quadratic.value.hint
    with pytest.raises(RefusedError, match="b2 is zero") as mixed:
        cubic_normal_form(Cubic(a1=1.0, a0=0.0, b2=0.0, b1=1.0, b0=0.0))
    assert "Family" in mixed.value.hint
    with pytest.raises(RefusedError, match="a2 is zero"):
        cubic_normal_form(Cubic(a2=0.0, a1=1.0, a0=0.0, b1=1.0, b0=0.0))
    with pytest.raises(RefusedError, match="b2 is zero"):
        cubic_equilibria(Cubic(a1=1.0, a0=0.0, b2=0.0, b1=1.0, b0=0.0))
    with pytest.raises(InputError, match="finite"):
        Cubic(a1=math.inf, a0=0.0, b1=1.0, b0=0.0)


# --- equilibria --------------------------------------------------------------------------------------------------


def _natures(cubic: Cubic) -> tuple[CubicCase, list[tuple[float, Nature]]]:
    found = cubic_equilibria(cubic)
    return found.case, [(point.x, point.nature) for point in found.points]


def test_the_four_statements_of_the_paper() -> None:
    """Shi & Fan 2013, section 3, after Eq. 18."""
    saddle = [(0.0, Nature.SADDLE)]
    assert _natures(Cubic(a1=0.3, a0=0.1, b1=1.0, b0=0.3)) == (CubicCase.ONE_SADDLE, saddle)
    degenerate = [(0.0, Nature.TOPOLOGICAL_SADDLE)]
    for a0 in (-0.1, 0.0, 0.1):
        assert _natures(Cubic(a1=0.3, a0=a0, b1=0.0, b0=0.0)) == (CubicCase.ONE_SADDLE, degenerate)
    for a0, met in ((0.1, Nature.SADDLE_NODE), (-0.1, Nature.SADDLE_NODE), (0.0, Nature.CUSP)):
        case = _natures(Cubic(a1=0.3, a0=a0, b1=0.5, b0=0.0))
        assert case == (CubicCase.SADDLE_AT_ORIGIN_MET, [(-0.5, Nature.SADDLE), (0.0, met)])
    x = -0.25  # trace there: −x² + a1 x + a0
    for a0, met in ((0.1, Nature.SADDLE_NODE), (x * x - 0.5 * x, Nature.CUSP)):
        case = _natures(Cubic(a1=0.5, a0=a0, b1=0.5, b0=0.0625))
        assert case == (CubicCase.OUTER_PAIR_MET, [(x, met), (0.0, Nature.SADDLE)])
    for a0, middle in ((-0.1, Nature.SINK), (0.1, Nature.SOURCE), (0.0, Nature.WEAK_FOCUS)):
        case, points = _natures(Cubic(a1=0.5, a0=a0, b1=0.5, b0=-1.0))
        assert case is CubicCase.BETWEEN_SADDLES
        assert [nature for _, nature in points] == [Nature.SADDLE, middle, Nature.SADDLE]
        root = math.sqrt(0.25 + 4.0)
        assert points[0][0] == pytest.approx((-0.5 - root) / 2.0, rel=_ROUNDING)
        assert points[2][0] == pytest.approx((-0.5 + root) / 2.0, rel=_ROUNDING)


def test_the_case_that_the_paper_leaves_out() -> None:
    """Erratum E5: 0 < b0 < b1²/4."""
    case, points = _natures(Cubic(a1=0.5, a0=-0.1, b1=1.0, b0=0.1))
    assert case is CubicCase.OUTER_SADDLE
    assert [nature for _, nature in points] == [Nature.SADDLE, Nature.SINK, Nature.SADDLE]
    assert points[2][0] == 0.0


def test_the_cases_of_the_wells() -> None:
    def of(a0: float, b1: float, b0: float, a1: float = 0.0) -> tuple[CubicCase, list[Nature]]:
        case, points = _natures(Cubic(b2=-1.0, a1=a1, a0=a0, b1=b1, b0=b0))
        return case, [nature for _, nature in points]

    assert of(-0.1, 0.5, -1.0) == (CubicCase.SINGLE_WELL, [Nature.SINK])
    assert of(0.1, 0.0, 0.0) == (CubicCase.SINGLE_WELL, [Nature.TOPOLOGICAL_SOURCE])
    assert of(0.0, 0.0, 0.0, 1.0) == (CubicCase.SINGLE_WELL, [Nature.NILPOTENT_FOCUS])
    assert of(0.0, 0.0, 0.0, 3.0) == (CubicCase.SINGLE_WELL, [Nature.ELLIPTIC])
    assert of(0.1, 0.0, 1.0) == (CubicCase.DOUBLE_WELL, [Nature.SINK, Nature.SADDLE, Nature.SINK])
    assert of(1.1, 0.0, 1.0) == (CubicCase.DOUBLE_WELL, [Nature.SOURCE, Nature.SADDLE, Nature.SOURCE])
    assert of(0.1, 1.0, -0.1) == (CubicCase.OUTER_WELL, [Nature.SOURCE, Nature.SADDLE, Nature.SINK])
    assert of(0.1, 1.0, -0.25) == (CubicCase.CUSPIDAL, [Nature.SOURCE, Nature.SADDLE_NODE])
    assert of(0.25, 1.0, -0.25)[1] == [Nature.SOURCE, Nature.CUSP]
    assert of(0.1, 1.0, 0.0) == (CubicCase.WELL_AT_ORIGIN_MET, [Nature.SADDLE_NODE, Nature.SINK])


@given(_cubic)
def test_natures_agree_with_the_general_classification(cubic: Cubic) -> None:
    named = {
        Nature.SADDLE: {Kind.SADDLE},
        Nature.SINK: {Kind.STABLE_FOCUS, Kind.STABLE_NODE},
        Nature.SOURCE: {Kind.UNSTABLE_FOCUS, Kind.UNSTABLE_NODE},
        Nature.WEAK_FOCUS: {Kind.DEGENERATE},
    }
    assume(cubic.b0 != 0.0 and abs(cubic.discriminant) > 1e-9)
    exact, general = cubic_equilibria(cubic).points, rests(cubic.flow())
    assert len(exact) == len(general)
    for one, other in zip(exact, general, strict=True):
        if other.kind is not Kind.DEGENERATE:  # the general search does not know signs within rounding
            assert other.kind in named[one.nature]


# --- Hopf, Bautin, Bogdanov-Takens ---------------------------------------------------------------------------------


@given(_cubic)
def test_hopf_points_by_the_general_theory(cubic: Cubic) -> None:
    """Two roads: closed form about each equilibrium, and the series of Cherkas."""
    for hopf in cubic_hopf_points(cubic):
        at = Cubic(a2=cubic.a2, a1=cubic.a1, a0=hopf.a0, b2=cubic.b2, b1=cubic.b1, b0=cubic.b0)
        size = abs(cubic.a2) * hopf.x**2 + abs(cubic.a1 * hopf.x)
        assert np.polyval(at.damping[::-1], hopf.x) == pytest.approx(0.0, abs=_ROUNDING * max(1.0, size))
        if hopf.frequency < 1e-3:
            continue  # next to a fold
        first, _ = lyapunov_coefficients(at.damping, at.force, hopf.x)
        assert hopf.first == pytest.approx(first, rel=1e-9, abs=1e-9 * max(1.0, 1.0 / hopf.frequency**2))
        if hopf.criticality is not Criticality.DEGENERATE:
            assert (hopf.criticality is Criticality.SUBCRITICAL) == (hopf.first > 0.0)


def test_the_criticality_at_the_origin() -> None:
    """Supercritical if and only if b0 < −a1 b1 (Shi & Fan 2013, section 3.1)."""
    for b0, expected in (
        (-0.26, Criticality.SUPERCRITICAL),
        (-0.25, Criticality.DEGENERATE),
        (-0.24, Criticality.SUBCRITICAL),
    ):
        (hopf,) = cubic_hopf_points(Cubic(a1=0.5, a0=9.0, b1=0.5, b0=b0))
        assert hopf.criticality is expected
        assert (hopf.a0, hopf.x) == (0.0, 0.0)
        assert hopf.first == pytest.approx((0.25 + b0) / (-8.0 * b0), abs=_ROUNDING)


def test_the_hopf_points_of_two_wells() -> None:
    """Set c of the independent values: Hopf at 1.090498756 and 0.889501244; a1 = b1 = 0: both at 1, +1/4."""
    left, right = cubic_hopf_points(Cubic(b2=-1.0, a1=0.3, a0=0.0, b1=0.2, b0=1.0))
    assert left.a0 == pytest.approx(1.090498756, abs=1e-9)
    assert right.a0 == pytest.approx(0.889501244, abs=1e-9)
    for hopf in cubic_hopf_points(Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.0, b0=1.0)):
        assert hopf.a0 == pytest.approx(1.0, abs=_ROUNDING)
        assert hopf.first == pytest.approx(0.25, abs=_ROUNDING)
        assert hopf.criticality is Criticality.SUBCRITICAL


@given(_cubic)
def test_bautin_points_by_the_general_theory(cubic: Cubic) -> None:
    for point in cubic_bautin_points(cubic):
        assume(0.05 < point.frequency < 20.0)
        at = Cubic(a2=cubic.a2, a1=cubic.a1, a0=point.a0, b2=cubic.b2, b1=cubic.b1, b0=point.b0)
        first, second = lyapunov_coefficients(at.damping, at.force, point.x)
        scale = max(1.0, point.x**2) ** 2 / point.frequency**2
        assert first == pytest.approx(0.0, abs=1e-9 * scale)
        assert point.second == pytest.approx(second, rel=1e-6, abs=1e-6 * scale / point.frequency**2)
        assert point.lienard == pytest.approx(-point.second * 16.0 / 5.0 / point.frequency**5, rel=_ROUNDING)


def test_bautin_points_of_the_normal_forms() -> None:
    (point,) = (p for p in cubic_bautin_points(Cubic(a1=0.5, a0=0.0, b1=0.5, b0=-1.0)) if p.x == 0.0)
    assert (point.b0, point.a0) == (-0.25, 0.0)
    assert point.lienard == pytest.approx(-1.0 / (3.0 * 0.5**7), rel=_ROUNDING)
    assert point.second > 0.0
    assert not [p for p in cubic_bautin_points(Cubic(a1=-0.5, a0=0.0, b1=0.5, b0=-1.0)) if p.x == 0.0]
    wells = cubic_bautin_points(Cubic(b2=-1.0, a1=2.0, a0=0.0, b1=1.2, b0=-1.0))
    assert all(p.second < 0.0 for p in wells)
    assert any(p.x == 0.0 and p.b0 == pytest.approx(-2.4) for p in wells)


def _growth(cubic: Cubic, radius: float) -> float:
    """Return how much x at y = 0 grows over one turn (DOP853)."""
    flow = cubic.flow()

    def crossing(_: float, s: np.ndarray) -> float:
        return float(s[1])

    crossing.direction = -1.0  # type: ignore[attr-defined]
    end = solve_ivp(
        lambda _, s: [s[1], flow.acceleration(s[0], s[1])],
        (0.0, 30.0),
        [radius, 0.0],
        method="DOP853",
        events=crossing,
        rtol=1e-13,
        atol=1e-16,
    )
    times, states = end.t_events[0], end.y_events[0]
    return float(states[times > 0.1][0][0]) - radius


def test_the_lyapunov_coefficients_by_simulation() -> None:
    """A turn of duration 2π/ω makes the amplitude grow by first r³, or by second r⁵ at a Bautin point."""
    cubic = Cubic(a1=0.5, a0=0.0, b1=0.5, b0=-1.0)
    (hopf,) = cubic_hopf_points(cubic)
    radius = 0.02
    assert _growth(cubic, radius) == pytest.approx(2.0 * np.pi * hopf.first * radius**3, rel=0.1)
    cubic = Cubic(a1=2.0, a0=0.0, b1=0.5, b0=-1.0)
    (point,) = (p for p in cubic_bautin_points(cubic) if p.x == 0.0)
    assert point.b0 == -1.0
    assert _growth(cubic, 0.05) == pytest.approx(2.0 * np.pi * point.second * 0.05**5, rel=0.2)


@given(_cubic)
def test_bogdanov_takens_points_are_cusps(cubic: Cubic) -> None:
    points = cubic_bogdanov_takens_points(cubic)
    assert len(points) == (2 if cubic.b1 else 1)
    for point in points:
        at = Cubic(a2=cubic.a2, a1=cubic.a1, a0=point.a0, b2=cubic.b2, b1=cubic.b1, b0=point.b0)
        moved = Rescaling(shift=point.x).flow(at.flow())
        scale = max(1.0, *moved.force_sizes, abs(point.x) ** 2)
        np.testing.assert_allclose((moved.damping[0], *moved.force[:2]), 0.0, atol=_ROUNDING * scale)
        np.testing.assert_allclose((point.a, point.b), (moved.force[2], moved.damping[1]), atol=_ROUNDING * scale)
        assert point.nondegenerate == (point.a != 0.0 and point.b != 0.0)


# --- regions -----------------------------------------------------------------------------------------------------

# Set H, (a1, b1, b0) = (1, 0.75, −1): independent values by Taylor shooting in two precisions.
_H = {"a1": 1.0, "b1": 0.75, "b0": -1.0}
_H_EXACT = RegionCurves(loop=4.34108613069e-4, folds=(0.00533818018161,), source=CurveSource.EXACT)
# Set A, (0.5, 0.5, −1), and a system with k_sc < 0.
_A_EXACT = RegionCurves(loop=0.0594558236872, folds=(), source=CurveSource.EXACT)
_SUBCRITICAL = {"a1": 2.0, "b1": 1.0, "b0": -0.2}


@pytest.mark.parametrize(
    ("parameters", "curves", "a0", "expected"),
    [
        (_H, _H_EXACT, 0.006, Region.I),
        (_H, _H_EXACT, 0.003, Region.II),
        (_H, _H_EXACT, 0.0002, Region.III),
        (_H, _H_EXACT, -0.001, Region.V),
        (_H, _H_EXACT, 0.0, Region.BORDER),
        ({"a1": 0.5, "b1": 0.5, "b0": -1.0}, _A_EXACT, 0.03, Region.III),
        ({"a1": 0.5, "b1": 0.5, "b0": -1.0}, _A_EXACT, 0.07, Region.I),
    ],
)
def test_regions_by_exact_curves(
    parameters: dict[str, float], curves: RegionCurves, a0: float, expected: Region
) -> None:
    answer = region(Cubic(a0=a0, **parameters), curves)
    assert answer.region is expected
    assert answer.source is CurveSource.EXACT
    assert answer.distance == min(abs(a0 - mark) for mark in (0.0, curves.loop, *curves.folds))


def _gains(cubic: Cubic, places: np.ndarray) -> list[int]:
    """Return for each x > 0 whether the orbit through (x, 0) moves outward (1) or inward (−1) over half turns."""
    flow = cubic.flow()

    def crossing(_: float, s: np.ndarray) -> float:
        return float(s[1])

    def gone(_: float, s: np.ndarray) -> float:
        return abs(float(s[0])) - 3.0

    gone.terminal = True  # type: ignore[attr-defined]
    signs = []
    for x in places:
        landed = []
        for span in (60.0, -60.0):
            end = solve_ivp(
                lambda _, s: [s[1], flow.acceleration(s[0], s[1])],
                (0.0, span),
                [x, 0.0],
                method="DOP853",
                events=(crossing, gone),
                rtol=1e-9,
                atol=1e-13,
            )
            after = np.abs(end.t_events[0]) > 1e-3
            landed.append(float(end.y_events[0][after][0][0]) if after.any() else -9.0)
        signs.append(1 if landed[0] < landed[1] else -1)
    return signs


@pytest.mark.parametrize(
    ("a0", "expected"), [(0.006, Region.I), (0.003, Region.II), (0.0002, Region.III), (-0.001, Region.V)]
)
def test_the_cycles_of_each_region_by_simulation(a0: float, expected: Region) -> None:
    """Along x > 0 orbits change between gaining and losing exactly at the cycles."""
    assert region(Cubic(a0=a0, **_H), _H_EXACT).region is expected
    saddle = outer_roots(Cubic(a0=a0, **_H))[1]
    signs = _gains(Cubic(a0=a0, **_H), np.concatenate([np.linspace(0.05, 0.95, 9), [0.999]]) * saddle)
    changes = [before > after for before, after in pairwise(signs) if before != after]
    assert tuple(changes) == expected.cycles  # from gaining to losing: stable
    assert (signs[0] < 0) == expected.origin_stable


def test_region_four_and_its_unstable_cycle() -> None:
    curves = first_order_curves(Cubic(a0=0.0, **_SUBCRITICAL))
    assert curves.loop < 0.0
    cubic = Cubic(a0=0.5 * curves.loop, **_SUBCRITICAL)
    answer = region(cubic, curves)
    assert answer.region is Region.IV
    assert answer.source is CurveSource.FIRST_ORDER
    signs = _gains(cubic, np.linspace(0.05, 0.95, 10) * outer_roots(cubic)[1])
    assert signs == sorted(signs)
    assert len(set(signs)) == 2
    assert Region.IV.cycles == (False,)
    assert Region.IV.origin_stable


def test_first_order_regions_say_so() -> None:
    curves = first_order_curves(Cubic(a0=0.0, **_H))
    assert curves.loop == pytest.approx(1.08920469e-4, abs=1e-12)
    assert curves.folds == (pytest.approx(0.00538574599, abs=1e-10),)
    assert any("k_sc nearly vanishes" in text for text in curves.cautions)
    assert region(Cubic(a0=0.003, **_H), curves).cautions == curves.cautions


def test_what_is_no_diagram_of_five_regions_is_refused() -> None:
    with pytest.raises(RefusedError, match="normal form with b2 = 1"):
        region(Cubic(a1=0.5, a0=0.1, b1=1.0, b0=0.1), _A_EXACT)
    with pytest.raises(RefusedError, match="normal form with b2 = 1"):
        first_order_curves(Cubic(b2=-1.0, a1=0.5, a0=0.1, b1=1.0, b0=0.1))
    with pytest.raises(InputError, match="below the loop"):
        RegionCurves(loop=0.1, folds=(0.05,), source=CurveSource.EXACT)
    with pytest.raises(InputError, match="one at most"):
        RegionCurves(loop=0.1, folds=(0.15, 0.2), source=CurveSource.EXACT)
    with pytest.raises(InputError, match="finite"):
        RegionCurves(loop=math.nan, folds=(), source=CurveSource.EXACT)


# --- a Liénard system at a held elevator -----------------------------------------------------------------------------


def test_the_normal_form_of_the_paper_example(printed_system: LienardSystem) -> None:
    """F-8 II at zero elevator: independent values, to their printed digits."""
    held = held_cubic(printed_system, 0.0)
    normal = held.normal
    found = (normal.a1, normal.b1, normal.b0, normal.a0)
    np.testing.assert_allclose(found, (0.208941, -0.364762, -0.520617, 0.304402), rtol=0, atol=5e-7)
    assert -held.rescaling.time == pytest.approx(0.250295410, abs=5e-10)
    assert from_si(held.rescaling.length, "deg") == pytest.approx(44.1393523, abs=5e-8)
    assert held.rescaling.reverses_time
    assert held.equilibrium.kind is Kind.STABLE_FOCUS
    assert cubic_equilibria(normal).points[1].nature is Nature.SOURCE
    assert normal.a0 / -normal.b0 == pytest.approx(0.585, abs=5e-4)
    # In region I by far, in reversed time: no cycle.
    answer = region(normal, first_order_curves(normal))
    assert answer.region is Region.I
    assert answer.distance > 0.1


def test_the_held_cubic_is_the_same_field(printed_system: LienardSystem) -> None:
    for elevator in (-0.4, 0.0, 0.2):
        held = held_cubic(printed_system, elevator)
        for alpha, rate in ((0.3, 0.1), (-0.2, 0.7)):
            force = float(printed_system.force(alpha)) + printed_system.elevator_gain * elevator
            expected = float(printed_system.damping(alpha)) * rate + force
            x, y = held.rescaling.to_new(alpha, rate)
            got = held.normal.flow().acceleration(float(x), float(y))
            back = got * held.rescaling.length / held.rescaling.time**2
            assert back == pytest.approx(expected, rel=1e-11)
            at = held.cubic.flow().acceleration(alpha - held.equilibrium.alpha_rad, rate)
            assert at == pytest.approx(expected, rel=1e-11)


def test_beyond_the_folds_the_only_equilibrium_is_the_origin(printed_system: LienardSystem) -> None:
    held = held_cubic(printed_system, 0.5)
    assert cubic_equilibria(held.normal).case is CubicCase.ONE_SADDLE
    outer = held_cubic_about(printed_system, equilibria(printed_system, 0.0)[0])
    assert cubic_equilibria(outer.normal).case is CubicCase.OUTER_SADDLE
    middle, held = centered(outer.normal).normal, held_cubic(printed_system, 0.0).normal
    np.testing.assert_allclose((middle.a0, middle.b0), (held.a0, held.b0), rtol=1e-11)


def test_what_cannot_be_a_cubic_about_its_middle_is_refused(printed_system: LienardSystem) -> None:
    at_fold = folds(printed_system)[0].elevator_rad
    assert len(equilibria(printed_system, at_fold)) == 2
    with pytest.raises(RefusedError, match="none is the middle one"):
        held_cubic(printed_system, at_fold)
    quartic = Curve(
        polynomial=Polynomial.build({(1,): -1.0, (4,): 1.0}, variables=("alpha_rad",), value_unit="rad_s2"),
        sensitivity=np.zeros((2, 1)),
    )
    system = replace(printed_system, force=quartic)
    with pytest.raises(RefusedError, match="more than quadratic and cubic"):
        held_cubic_about(system, equilibria(system, 0.0)[0])

"""Stability regions of planar fields: exact and published ones, the Liénard road, a map that follows no curve."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.planar.boundary import BoundaryKind
from finback.dynamics.planar.cycle import planar_cycles
from finback.dynamics.planar.map import planar_map
from finback.dynamics.planar.region import PlanarRegion, planar_regions
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.stability.region import stability_region
from finback.errors import InputError, RefusedError
from finback.units import from_si, to_si

_VARIABLES = ("x_1", "y_1", "mu_1")
_ONE = (1.0, 1.0)
# Of the region's area: a grid of n² states misjudges some of the cells that the boundary crosses, about 4n of them,
# as often too many as too few.
_GRID = 4e-3
Terms = Mapping[tuple[int, int, int], float]
Box = tuple[tuple[float, float], tuple[float, float]]


def _system(first: Terms, second: Terms, *, covariance: ArrayLike | None = None) -> PlanarSystem:
    p, q = (Polynomial.build(terms, variables=_VARIABLES, value_unit="1") for terms in (first, second))
    return PlanarSystem.from_polynomials(p, q, covariance=covariance)


def _van_der_pol(covariance: ArrayLike | None = None) -> PlanarSystem:
    """With x' = y, y' = mu (1 − x²) y − x: for mu < 0 the origin attracts what lies inside the cycle."""
    return _system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 1): -1.0}, covariance=covariance)


def _hahn() -> PlanarSystem:
    """Hahn, Stability of Motion (1967): x' = −x + 2 x² y, y' = −y; the region is x y < 1."""
    return _system({(1, 0, 0): -1.0, (2, 1, 0): 2.0}, {(0, 1, 0): -1.0})


def _genesio() -> PlanarSystem:
    """Genesio, Tartaglia & Vicino, IEEE Trans. Automatic Control 30 (1985), example with two sinks and a saddle."""
    second = {(1, 0, 0): 0.1, (0, 1, 0): -2.0, (2, 0, 0): -1.0, (3, 0, 0): -0.1}
    return _system({(1, 0, 0): -1.0, (0, 1, 0): 1.0}, second)


def _share(system: PlanarSystem, parameter: float, box: Box, sink: int, n: int = 300) -> float:
    """Return the part of the box that goes to a sink, by the middles of n² cells."""
    x, y = np.meshgrid(*((np.arange(n) + 0.5) / n * (high - low) + low for low, high in box))
    return float((planar_map(system, parameter, x, y, box=box).fate == sink).mean())


def _size(box: Box) -> float:
    return math.prod(high - low for low, high in box)


def test_van_der_pol_backward_in_time() -> None:
    """The region is the inside of the cycle: ½∮(x dy − y dx) by DOP853, and the map, say the same area."""
    box: Box = ((-3.0, 3.0), (-4.0, 4.0))
    system = _van_der_pol()
    (region,) = planar_regions(system, -1.0, box, disturbance_units=_ONE)
    (cycle,) = planar_cycles(system, -1.0, box)
    (curve,) = region.boundary
    assert (curve.kind, curve.separates) == (BoundaryKind.CYCLE, True)

    def rates(_: float, s: np.ndarray) -> list[float]:
        p, q = s[1], (s[0] ** 2 - 1.0) * s[1] - s[0]
        return [-p, -q, 0.5 * (s[1] * p - s[0] * q)]  # backward in time the cycle attracts

    start = [*cycle.orbit[0], 0.0]
    found = solve_ivp(rates, (0.0, cycle.period), start, method="DOP853", rtol=1e-12, atol=1e-13)
    assert region.area == pytest.approx(abs(found.y[2, -1]), rel=1e-10)
    assert _size(box) * _share(system, -1.0, box, 0) == pytest.approx(region.area, rel=_GRID)
    # The nearest point of the cycle has r' = 0, which is (1 − x²) y² = 0 there.
    assert abs(region.escape_state[0]) == pytest.approx(1.0, abs=1e-7)
    assert region.escape_distance == pytest.approx(np.hypot(*cycle.orbit.T).min(), abs=1e-3)


@pytest.mark.parametrize(("mu", "half"), [(-1.0, 1.0), (-1.0, 1.5), (-1.0, 2.0), (-0.2, 2.0), (-3.0, 1.2)])
def test_a_box_that_holds_a_part_of_the_region(mu: float, half: float) -> None:
    """Within the cycle nothing bounds the region; where the cycle leaves and enters the box, what lies outside is cut.

    At mu = −0.2 the cycle reaches 2.0003: it leaves a box of 2 for a moment on each side.
    """
    box: Box = ((-half, half), (-half, half))
    (region,) = planar_regions(_van_der_pol(), mu, box, disturbance_units=_ONE)
    cut = _share(_van_der_pol(), mu, box, 0)
    assert [curve.kind for curve in region.boundary] == ([] if cut == 1.0 else [BoundaryKind.CYCLE])
    assert region.area == pytest.approx(_size(box) * cut, rel=1e-14 if cut == 1.0 else _GRID)
    if cut < 1.0:
        (whole,) = planar_regions(_van_der_pol(), mu, ((-4.0, 4.0), (-6.0, 6.0)), disturbance_units=_ONE)
        assert region.escape_distance == pytest.approx(whole.escape_distance, rel=1e-12)


def test_a_hyperbola_that_no_saddle_and_no_cycle_makes() -> None:
    box: Box = ((-3.0, 3.0), (-3.0, 3.0))
    (region,) = planar_regions(_hahn(), 0.0, box, disturbance_units=_ONE)
    assert [curve.kind for curve in region.boundary] == [BoundaryKind.ORBIT] * 2
    assert region.area == pytest.approx(20.0 + 2.0 * math.log(9.0), abs=1e-12)
    assert region.escape_distance == pytest.approx(math.sqrt(2.0), abs=1e-13)
    np.testing.assert_allclose(np.abs(region.escape_state), 1.0, rtol=0, atol=1e-6)
    for curve in region.boundary:
        x, y = curve.states.T
        near = np.hypot(x, y) < 5.0
        np.testing.assert_allclose((x * y)[near], 1.0, rtol=0, atol=1e-12)
    assert not region.in_domain
    assert np.isinf(region.escape_distance_interval).all()
    (other,) = planar_regions(_hahn(), 0.0, box, disturbance_units=(1.0, 4.0))
    # The least of x² + y²/16 on x y = 1 is 2/4, at x = 1/2.
    assert other.escape_distance == pytest.approx(math.sqrt(0.5), abs=1e-13)
    np.testing.assert_allclose(np.abs(other.escape_state), [0.5, 2.0], rtol=0, atol=1e-6)


def test_two_sinks_share_the_plane() -> None:
    box: Box = ((-12.0, 12.0), (-12.0, 12.0))
    system = _genesio()
    left, right = planar_regions(system, 0.0, box, disturbance_units=_ONE)
    assert left.area + right.area == pytest.approx(_size(box), rel=1e-12)
    for sink, region in enumerate((left, right)):
        assert [curve.kind for curve in region.boundary] == [BoundaryKind.SADDLE] * 2
        assert _size(box) * _share(system, 0.0, box, sink) == pytest.approx(region.area, rel=_GRID)
        np.testing.assert_allclose(region.boundary[0].states[0], [-2.55051026, -2.55051026], atol=1e-8)
    _assert_smallest(system, 0.0, right, box, 1)
    _assert_smallest(system, 0.0, left, box, 0)


def _assert_smallest(system: PlanarSystem, parameter: float, region: PlanarRegion, box: Box, sink: int) -> None:
    """All smaller disturbances return; the nearest point of the boundary, moved outward, does not."""
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ring = region.state + region.escape_distance * np.column_stack([np.cos(angle), np.sin(angle)])
    inner = region.state + 0.9995 * (ring - region.state)
    assert (planar_map(system, parameter, *inner.T, box=box).fate == sink).all()
    outer = region.state + 1.0005 * (region.escape_state - region.state)
    assert planar_map(system, parameter, *outer, box=box).fate != sink
    assert np.hypot(*(region.escape_state - region.state)) == pytest.approx(region.escape_distance, rel=1e-12)


@pytest.mark.parametrize(
    ("elevator_deg", "area_deg2_s", "curves"), [(10.0, 2709.797, 2), (0.0, 9469.046, 2), (-10.0, 0.0, 4)]
)
def test_the_lienard_road_finds_the_same(
    printed_system: LienardSystem, elevator_deg: float, area_deg2_s: float, curves: int
) -> None:
    """Areas by Taylor integration in 130 bits, within 100 degrees; the tongues end below 1000 deg/s there."""
    elevator, cut, high = (float(to_si(value, "deg")) for value in (elevator_deg, 100.0, 1000.0))
    box: Box = ((-cut, cut), (-high, high))
    other = stability_region(printed_system, elevator, alpha_range_rad=(-cut, cut))
    (region,) = planar_regions(
        PlanarSystem.from_lienard(printed_system), elevator, box, disturbance_units=(1.0, other.frequency_rad_s)
    )
    assert len(region.boundary) == curves
    assert region.area == pytest.approx(other.area_rad2_s, rel=1e-9)
    if area_deg2_s:
        assert from_si(from_si(region.area, "deg"), "deg") == pytest.approx(area_deg2_s, abs=6e-4)
    assert region.escape_distance == pytest.approx(other.escape_distance_rad, rel=1e-9)


def test_a_hole_in_a_region() -> None:
    """With r' = r (r² − 1)(4 − r²)/4: inside the circle of radius 1 the origin attracts, outside it r = 2 does."""
    radial = {(0, 0): -4.0, (2, 0): 5.0, (0, 2): 5.0, (4, 0): -1.0, (2, 2): -2.0, (0, 4): -1.0}
    first: dict[tuple[int, int, int], float] = {(i + 1, j, 0): 0.25 * c for (i, j), c in radial.items()}
    second: dict[tuple[int, int, int], float] = {(i, j + 1, 0): 0.25 * c for (i, j), c in radial.items()}
    first[0, 1, 0], second[1, 0, 0] = -1.0, 1.0
    box: Box = ((-3.0, 3.0), (-3.0, 3.0))
    (region,) = planar_regions(_system(first, second), 0.0, box, disturbance_units=_ONE)
    assert region.area == pytest.approx(math.pi, abs=1e-12)
    assert region.escape_distance == pytest.approx(1.0, abs=1e-13)


def test_a_sink_that_attracts_the_whole_box() -> None:
    system = _system({(1, 0, 0): -1.0}, {(0, 1, 0): -2.0})
    box: Box = ((-3.0, 1.0), (-2.0, 2.0))
    (region,) = planar_regions(system, 0.0, box, disturbance_units=_ONE)
    assert region.boundary == ()
    assert region.area == pytest.approx(16.0, abs=1e-14)
    assert region.escape_distance == math.inf
    assert planar_regions(_van_der_pol(), 1.0, ((-3.0, 3.0), (-4.0, 4.0)), disturbance_units=_ONE) == ()


def test_the_box_cuts_the_area_and_nothing_else() -> None:
    whole, part = (
        planar_regions(_genesio(), 0.0, box, disturbance_units=_ONE)[-1]
        for box in (((-12.0, 12.0), (-12.0, 12.0)), ((-5.0, 12.0), (-12.0, 12.0)))
    )
    assert part.escape_distance == pytest.approx(whole.escape_distance, rel=1e-10)
    assert _share(_genesio(), 0.0, ((-5.0, 12.0), (-12.0, 12.0)), 1) * 408.0 == pytest.approx(part.area, rel=_GRID)


@pytest.mark.parametrize("name", ["cycle", "saddle"])
def test_the_interval_of_the_smallest_disturbance(name: str) -> None:
    """Central differences along a random direction of the coefficients, step 1e-5: their own error is some 1e-8."""
    box: Box = ((-3.0, 3.0), (-4.0, 4.0)) if name == "cycle" else ((-12.0, 12.0), (-12.0, 12.0))
    plain = _van_der_pol() if name == "cycle" else _genesio()
    theta = np.concatenate([plain.first.polynomial.coefficients, plain.second.polynomial.coefficients])
    direction = np.random.default_rng(2).normal(size=theta.size)
    system = PlanarSystem(first=plain.first, second=plain.second, covariance=np.outer(direction, direction))
    found = [
        planar_regions(system.with_coefficients(theta + step * direction), -1.0, box, disturbance_units=(1.0, 1.5))[-1]
        for step in (-1e-5, 0.0, 1e-5)
    ]
    slope = abs(found[2].escape_distance - found[0].escape_distance) / 2e-5
    half = 0.5 * float(np.ptp(found[1].escape_distance_interval))
    assert half == pytest.approx(NORMAL_95 * slope, rel=1e-5)


@settings(max_examples=6, deadline=None, derandomize=True)  # some random fields take seconds
@given(seed=st.integers(0, 10**6))
def test_maps_and_boundaries_agree_for_any_field(seed: int) -> None:
    """A random cubic field with a sink at the origin: area by boundaries against the map."""
    rng = np.random.default_rng(seed)
    linear = rng.normal(size=(2, 2))
    linear -= (np.linalg.eigvals(linear).real.max() + 0.4) * np.eye(2)
    tables: list[dict[tuple[int, int, int], float]] = []
    for row in linear.tolist():
        terms: dict[tuple[int, int, int], float] = {(1, 0, 0): row[0], (0, 1, 0): row[1]}
        terms |= {(i, k - i, 0): float(rng.normal()) for k in (2, 3) for i in range(k + 1)}
        tables.append(terms)
    system = _system(*tables)
    box: Box = ((-2.0, 2.0), (-2.0, 2.0))
    try:
        regions = planar_regions(system, 0.0, box, disturbance_units=_ONE)
    except RefusedError:
        return  # a saddle or cycle far outside the box bounds it: said, not guessed
    n = 200
    x, y = np.meshgrid(*(((np.arange(n) + 0.5) / n * 4.0 - 2.0),) * 2)
    mapped = planar_map(system, 0.0, x, y, box=box)
    for region in regions:
        sink = int(np.argmin(np.hypot(*(mapped.sinks - region.state).T)))
        share = float((mapped.fate == sink).mean())
        assert region.area / 16.0 == pytest.approx(share, abs=0.01)


def test_a_map_tells_where_states_go() -> None:
    system, box = _van_der_pol(), ((-3.0, 3.0), (-4.0, 4.0))
    found = planar_map(system, -1.0, [[0.5, 2.5]], [[0.0, 3.0]], box=box)
    np.testing.assert_array_equal(found.fate, [[0, -1]])
    np.testing.assert_array_equal(found.sinks, [[0.0, 0.0]])
    turning = planar_map(system, 1.0, [0.5], [0.0], box=box)  # onto the stable cycle
    np.testing.assert_array_equal(turning.fate, [-2])
    assert planar_map(system, 1.0, [], [], box=box).fate.shape == (0,)


def test_refusals() -> None:
    with pytest.raises(InputError, match="two positive units"):
        planar_regions(_hahn(), 0.0, ((-1.0, 1.0), (-1.0, 1.0)), disturbance_units=(1.0, 0.0))
    with pytest.raises(InputError, match="a box is two finite intervals"):
        planar_map(_hahn(), 0.0, 0.0, 0.0, box=((1.0, -1.0), (-1.0, 1.0)))

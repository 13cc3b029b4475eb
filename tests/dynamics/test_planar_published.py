"""Published planar models with known answers: Brusselator, FitzHugh-Nagumo with canards, predator and prey.

All are polynomial, the rational ones after a change of time. Closed forms are derived in the docstrings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from finback.arrays import FloatArray
from finback.dynamics.hopf import Criticality
from finback.dynamics.planar.branch import PlanarBranches, planar_branches
from finback.dynamics.planar.connection_search import planar_connections
from finback.dynamics.planar.cycle import planar_cycles
from finback.dynamics.planar.cycle_family import FamilyEnd, family_from_hopf
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial

_VARIABLES = ("x_1", "y_1", "mu_1")
Terms = Mapping[tuple[int, int, int], float]
Box = list[list[float]]


def _system(first: Terms, second: Terms) -> PlanarSystem:
    p, q = (Polynomial.build(terms, variables=_VARIABLES, value_unit="1") for terms in (first, second))
    return PlanarSystem.from_polynomials(p, q)


def _branches(system: PlanarSystem, low: float, high: float, box: Box) -> PlanarBranches:
    starts = [p for parameter in np.linspace(low, high, 5) for p in planar_equilibria(system, float(parameter))]
    return planar_branches(system, (low, high), np.array(box), starts)


def _brusselator(a: float) -> PlanarSystem:
    """Prigogine & Lefever (1968): x' = a − (b + 1) x + x² y, y' = b x − x² y; b is the parameter."""
    first = {(0, 0, 0): a, (1, 0, 0): -1.0, (1, 0, 1): -1.0, (2, 1, 0): 1.0}
    return _system(first, {(1, 0, 1): 1.0, (2, 1, 0): -1.0})


@pytest.mark.parametrize("a", [0.5, 1.0, 2.0, 10.0])
def test_the_brusselator(a: float) -> None:
    """At (a, b/a) a Hopf point at b = 1 + a², ω = a; r' = −(2 + a²)/(8 a²) r³, r the amplitude of x.

    By Kuznetsov, Elements of Applied Bifurcation Theory (2004), example 3.1, l₁ = −(2 + a²)/(2 a (1 + a²)) of his
    normalization; the amplitude of x has a unit eigenvector component, which leaves (2 + a²)/(8 a²).
    """
    box = [[0.0, 8.0 * a + 4.0], [0.0, 12.0 + 3.0 * a]]
    (hopf,) = _branches(_brusselator(a), 0.5, a * a + 3.0, box).hopf_points
    assert hopf.parameter == pytest.approx(1.0 + a * a, rel=1e-13)
    assert hopf.frequency == pytest.approx(a, rel=1e-13)
    assert hopf.lyapunov == pytest.approx(-(2.0 + a * a) / (8.0 * a * a), rel=1e-11)
    np.testing.assert_allclose(hopf.state, [a, (1.0 + a * a) / a], rtol=1e-13)


@pytest.mark.parametrize(("b", "period"), [(5.0, 11.65558980), (10.0, 33.0523631), (30.0, 245.825610)])
def test_the_brusselator_far_from_its_hopf_point(b: float, period: float) -> None:
    """Periods by scipy's implicit Radau method at rtol 1e-11, to the digits that are certain; ever stiffer."""
    (cycle,) = planar_cycles(_brusselator(1.0), b, [[1e-6, 12.0 * b], [1e-6, 12.0 * b]])
    assert cycle.period == pytest.approx(period, rel=3e-9)
    assert cycle.stable


def _fitzhugh_nagumo(eps: float) -> PlanarSystem:
    """FitzHugh (1961): v' = v − v³/3 − w + I, w' = ε (v + 0.7 − 0.8 w); the current I is the parameter."""
    first = {(1, 0, 0): 1.0, (3, 0, 0): -1.0 / 3.0, (0, 1, 0): -1.0, (0, 0, 1): 1.0}
    return _system(first, {(1, 0, 0): eps, (0, 0, 0): 0.7 * eps, (0, 1, 0): -0.8 * eps})


def test_fitzhugh_and_nagumo_from_hopf_to_hopf_by_way_of_canards() -> None:
    """At ε = 0.08 both Hopf points are subcritical: v = ∓√(1 − 0.8 ε), I = v³/3 − v + (v + 0.7)/0.8.

    The field has the symmetry v → −v, w → 7/4 − w, I → 7/4 − I. Beside each Hopf point the family explodes: canards,
    over which the parameter moves by 1e-10, up to a fold; between both it is the large stable oscillation.
    """
    eps, box = 0.08, [[-3.0, 3.0], [-1.5, 3.0]]
    system = _fitzhugh_nagumo(eps)
    points = _branches(system, 0.0, 2.0, box).hopf_points
    v = -math.sqrt(1.0 - 0.8 * eps)
    expected = v**3 / 3.0 - v + (v + 0.7) / 0.8
    np.testing.assert_allclose([point.parameter for point in points], [expected, 1.75 - expected], rtol=1e-13)
    assert {point.criticality for point in points} == {Criticality.SUBCRITICAL}
    family = family_from_hopf(system, points[0], (0.0, 2.0), box)
    assert family.ends == (FamilyEnd.HOPF, FamilyEnd.HOPF)
    first, last = family.folds
    # Where one unit in the last place of I moves the orbit by 1e-6, the fold is known to some 1e-10.
    assert first.parameter + last.parameter == pytest.approx(1.75, abs=1e-9)
    assert not first.resolved
    assert first.parameter < expected
    large = np.flatnonzero(family.stable)
    assert (np.diff(large) == 1).all()
    # Beyond the fold there is one stable cycle; before it, two, of which the small one is unstable, or none.
    (cycle,) = planar_cycles(system, 0.5, box)
    assert cycle.stable
    inner, outer = planar_cycles(system, 0.5 * (first.parameter + expected), box)
    assert (inner.stable, outer.stable) == (False, True)
    assert planar_cycles(system, first.parameter - 1e-3, box) == ()


def test_an_explosion_that_double_precision_cannot_follow_is_said() -> None:
    eps = 0.01
    box = [[-3.0, 3.0], [-1.5, 3.0]]
    system = _fitzhugh_nagumo(eps)
    family = family_from_hopf(system, _branches(system, 0.0, 1.0, box).hopf_points[0], (0.0, 2.0), box)
    assert family.ends == (FamilyEnd.HOPF, FamilyEnd.FLAT)
    assert np.ptp(family.parameter[-5:]) < 1e-9
    (cycle,) = planar_cycles(system, 0.5, box)
    assert cycle.stable
    # As ε → 0 the period over 1/ε is ∫ of dw/(v + 0.7 − 0.8 w) along both outer branches of the cubic.
    slow = 0.0
    for v in (np.linspace(-2.0, -1.0, 200_001), np.linspace(2.0, 1.0, 200_001)):
        drift = v + 0.7 - 0.8 * (v - v**3 / 3.0 + 0.5)
        slow += float(np.trapezoid((1.0 - v**2) / drift, v))
    assert cycle.period * eps == pytest.approx(slow, rel=6.0 * eps ** (2.0 / 3.0))


def test_rosenzweig_and_macarthur() -> None:
    """X' = x (1 − x/k) − m x y/(1 + x), y' = −d y + m x y/(1 + x) (1963), times 1 + x: cubic; the parameter is 1/k.

    With m = 2, d = 1: x* = d/(m − d) = 1; the prey's isocline has its top at (k − 1)/2, so the Hopf point is at k = 3.
    The cycle beyond is unique and stable (Cheng, SIAM J. Math. Anal. 12, 1981).
    """
    m, d = 2.0, 1.0
    first = {(1, 0, 0): 1.0, (2, 0, 0): 1.0, (2, 0, 1): -1.0, (3, 0, 1): -1.0, (1, 1, 0): -m}
    second = {(0, 1, 0): -d, (1, 1, 0): m - d}
    system, box = _system(first, second), [[1e-3, 6.0], [1e-3, 6.0]]
    found = _branches(system, 0.15, 0.9, box)
    (hopf,) = found.hopf_points
    assert hopf.parameter == pytest.approx(1.0 / 3.0, rel=1e-13)
    assert hopf.criticality is Criticality.SUPERCRITICAL
    # In the box there is no other: all of k > 3 has one stable cycle.
    for k in (3.2, 4.0, 5.0):
        (cycle,) = planar_cycles(system, 1.0 / k, box)
        assert cycle.stable
    assert planar_cycles(system, 1.0 / 2.8, box) == ()


@pytest.mark.parametrize(("second_parameter", "loop"), [(0.1, -1.9373648777e-2), (0.5, -0.46360219842)])
def test_the_loop_of_bogdanov_and_takens(second_parameter: float, loop: float) -> None:
    """X' = y, y' = m₁ + m₂ y + x² + x y: the loop by Taylor shooting in 130 bits, to the digits printed.

    Turned by a shear y = z + x/2, so that no term of the planar form is special.
    """
    plain: dict[tuple[int, int], float] = {(0, 0): 0.0, (0, 1): second_parameter, (2, 0): 1.0, (1, 1): 1.0}
    sheared: dict[tuple[int, int, int], float] = {(0, 0, 1): 1.0}
    for (i, j), c in plain.items():
        for power, weight in (((i, j), 1.0), ((i + 1, 0), 0.5)) if j else (((i, j), 1.0),):
            sheared[*power, 0] = sheared.get((*power, 0), 0.0) + weight * c
    first = {(0, 1, 0): 1.0, (1, 0, 0): 0.5}
    for key, value in first.items():  # z' = y' − x'/2
        sheared[key] = sheared.get(key, 0.0) - 0.5 * value
    size = 2.0 * math.sqrt(-loop)
    box = [[-size, size], [-size, size]]
    (found,) = planar_connections(_system(first, sheared), (1.3 * loop, 0.7 * loop), box).homoclinics
    assert found.parameter == pytest.approx(loop, rel=1e-10)


def _random_field(seed: int) -> tuple[Terms, Terms]:
    """A cubic field whose coefficients are standard normal, with a focus at the origin."""
    rng = np.random.default_rng(seed)
    powers = [(i, k - i, 0) for k in (2, 3) for i in range(k + 1)]
    growth = 0.2 * float(rng.normal())
    linear = {(1, 0, 0): (growth, 1.0), (0, 1, 0): (-1.0, 0.5 * growth)}
    first, second = (
        {power: c[row] for power, c in linear.items()} | {power: float(rng.normal()) for power in powers}
        for row in (0, 1)
    )
    return first, second


@pytest.mark.parametrize("seed", [0, 4, 9, 15, 21, 29, 31, 33])  # most have a cycle
def test_equilibria_and_cycles_of_random_fields_are_those_of_brute_force(seed: int) -> None:
    """Newton's method of scipy from 15 starts, and an unrelated integrator onto what attracts forward or backward."""
    first, second = _random_field(seed)
    system = _system(first, second)

    def rates(s: FloatArray) -> FloatArray:
        powers = [(s[0] ** i * s[1] ** j) for i, j, _ in first]
        return np.array([np.dot(list(terms.values()), powers) for terms in (first, second)])

    known = np.array([point.state for point in planar_equilibria(system, 0.0)])
    for start in np.random.default_rng(seed + 1000).uniform(-3.0, 3.0, (15, 2)):
        found = root(rates, start, tol=1e-12)
        if found.success and np.abs(found.fun).max() < 1e-10:
            assert np.hypot(*(known - found.x).T).min() < 1e-6
    cycles = planar_cycles(system, 0.0, [[-2.5, 2.5], [-2.5, 2.5]])
    for heading in (1.0, -1.0):
        extents = _recurrent(lambda s, way=heading: way * rates(s))
        if extents is not None:
            alike = [cycle for cycle in cycles if cycle.stable == (heading > 0.0)]
            assert any(np.abs(np.array([c.low, c.high]) - extents).max() < 5e-3 for c in alike)


def _recurrent(rates: Callable[[FloatArray], FloatArray]) -> FloatArray | None:
    """Return low and high of what an orbit from beside the origin winds onto within [−2.4, 2.4]; nothing else."""

    def leaves(_: float, s: FloatArray) -> float:
        return 2.4 - float(np.abs(s).max())

    leaves.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, s: rates(s), (0.0, 90.0), [0.05, 0.0], "DOP853", events=leaves, rtol=1e-8, atol=1e-10, max_step=0.2
    )
    late, before = (found.y[:, (found.t > low) & (found.t <= low + 30.0)] for low in (60.0, 30.0))
    if found.status != 0:
        return None
    extents = np.array([late.min(axis=1), late.max(axis=1)])
    size = float(np.ptp(extents, axis=0).max())
    settled = np.abs(extents - [before.min(axis=1), before.max(axis=1)]).max() < 1e-5 * size
    moving = float(np.hypot(*rates(late)).min()) > 1e-3
    return extents if size > 1e-2 and settled and moving else None

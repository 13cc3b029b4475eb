"""Families of cycles of planar fields: closed forms, references of folds, ends, intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.planar.branch import planar_branches
from finback.dynamics.planar.connection_search import planar_connections
from finback.dynamics.planar.cycle import planar_cycles
from finback.dynamics.planar.cycle_family import FamilyEnd, PlanarCycleFamily, family_from_cycle, family_from_hopf
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.hopf import PlanarHopf
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError

_VARIABLES = ("x_1", "y_1", "mu_1")
_BOX = np.array([[-2.0, 2.0], [-2.5, 2.5]])
Terms = Mapping[tuple[int, int, int], float]


def _system(first: Terms, second: Terms, *, covariance: ArrayLike | None = None) -> PlanarSystem:
    p, q = (Polynomial.build(terms, variables=_VARIABLES, value_unit="1") for terms in (first, second))
    return PlanarSystem.from_polynomials(p, q, covariance=covariance)


def _cubic(a1: float, b1: float, b0: float, covariance: ArrayLike | None = None) -> PlanarSystem:
    """Eq. (18) of Shi & Fan (2013), a0 the parameter."""
    second = {(0, 1, 1): 1.0, (1, 1, 0): a1, (2, 1, 0): -1.0, (1, 0, 0): b0, (2, 0, 0): b1, (3, 0, 0): 1.0}
    return _system({(0, 1, 0): 1.0}, second, covariance=covariance)


def _round(radial: Mapping[tuple[int, int], float]) -> PlanarSystem:
    """With r' = r h(r², mu) and theta' = 1; ``radial`` gives h by powers of r² and mu."""
    first: dict[tuple[int, int, int], float] = {(0, 1, 0): -1.0}
    second: dict[tuple[int, int, int], float] = {(1, 0, 0): 1.0}
    for (power, k), value in radial.items():
        row = np.polynomial.polynomial.polypow([1.0, 1.0], power)  # (x² + y²)^power
        for m, c in enumerate(row):
            for table, (i, j) in ((first, (2 * m + 1, 2 * (power - m))), (second, (2 * m, 2 * (power - m) + 1))):
                table[i, j, k] = table.get((i, j, k), 0.0) + value * float(c)
    return _system(first, second)


def _hopf(system: PlanarSystem, low: float, high: float, near: float) -> PlanarHopf:
    starts = [point for parameter in np.linspace(low, high, 3) for point in planar_equilibria(system, float(parameter))]
    inside = [point for point in starts if (np.abs(point.state) <= _BOX[:, 1]).all()]
    found = planar_branches(system, (low, high), _BOX, inside).hopf_points
    return min(found, key=lambda point: abs(point.parameter - near))


def _assert_each_is_a_cycle(system: PlanarSystem, family: PlanarCycleFamily, box: ArrayLike) -> None:
    for k in range(len(family.parameter) // 4, len(family.parameter) - 1, 7):
        cycles = planar_cycles(system, float(family.parameter[k]), box)
        near = min(cycles, key=lambda cycle: float(np.abs(cycle.high - family.high[k]).sum()))
        np.testing.assert_allclose(near.high, family.high[k], rtol=0, atol=1e-9)
        np.testing.assert_allclose(near.low, family.low[k], rtol=0, atol=1e-9)
        assert near.period == pytest.approx(family.period[k], rel=1e-9)
        assert near.log_multiplier == pytest.approx(family.log_multiplier[k], abs=1e-7)
        assert near.stable == family.stable[k]


def test_a_bubble_from_one_hopf_point_to_another() -> None:
    """With h = 1/4 − mu² − r²: r² = 1/4 − mu², and the logarithm of the multiplier is −4π r²."""
    system = _round({(0, 0): 0.25, (0, 2): -1.0, (1, 0): -1.0})
    hopf = _hopf(system, -1.0, 1.0, -0.5)
    family = family_from_hopf(system, hopf, (-1.0, 1.0), _BOX)
    assert family.ends == (FamilyEnd.HOPF, FamilyEnd.HOPF)
    assert family.folds == ()
    assert family.parameter.min() < -0.49995
    assert family.parameter.max() > 0.4999
    square = 0.25 - family.parameter**2
    np.testing.assert_allclose(family.high[:, 0] ** 2, square, rtol=0, atol=1e-12)
    np.testing.assert_allclose(family.period, 2.0 * np.pi, rtol=1e-12)
    np.testing.assert_allclose(family.log_multiplier, -4.0 * np.pi * square, rtol=0, atol=1e-11)
    assert family.stable.all()


def test_an_isola() -> None:
    """With h = 1/4 − mu² − (r² − 2)²: a closed family that no Hopf point begins, with folds at mu = ±1/2."""
    system = _round({(0, 0): 0.25 - 4.0, (0, 2): -1.0, (1, 0): 4.0, (2, 0): -1.0})
    inner, outer = sorted(planar_cycles(system, 0.1, _BOX), key=lambda cycle: cycle.high[0])
    for cycle in (inner, outer):
        family = family_from_cycle(system, cycle, (-1.0, 1.0), _BOX)
        assert family.ends == (FamilyEnd.CLOSED, FamilyEnd.CLOSED)
        assert sorted(fold.parameter for fold in family.folds) == pytest.approx([-0.5, 0.5], abs=1e-13)
        for fold in family.folds:
            np.testing.assert_allclose(fold.high, np.sqrt(2.0), rtol=0, atol=1e-8)
            assert abs(fold.residual) < 1e-10
            assert fold.resolved
            below, above = np.hypot(*fold.bracket.T)
            assert below < np.sqrt(2.0) < above
        np.testing.assert_allclose((family.high[:, 0] ** 2 - 2.0) ** 2 + family.parameter**2, 0.25, rtol=0, atol=1e-11)
        assert family.stable.any()
        assert not family.stable.all()


def test_the_range_and_the_box_end_a_family() -> None:
    van_der_pol = _system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 0): -1.0})
    hopf = _hopf(van_der_pol, -0.5, 0.6, 0.0)
    by_range = family_from_hopf(van_der_pol, hopf, (-0.5, 0.6), _BOX)
    assert by_range.ends == (FamilyEnd.HOPF, FamilyEnd.PARAMETER)
    assert (np.diff(by_range.parameter) > 0.0).all()
    assert by_range.stable.all()
    _assert_each_is_a_cycle(van_der_pol, by_range, _BOX)
    by_box = family_from_hopf(van_der_pol, hopf, (-0.5, 0.6), [[-1.0, 1.0], [-1.0, 1.0]])
    assert by_box.ends == (FamilyEnd.HOPF, FamilyEnd.BOX)
    assert by_box.high.max() <= 1.0


@pytest.mark.parametrize(
    ("b0", "parameter", "period"), [(-0.383335, 0.00424373, 13.31827), (-0.472226, 0.01021202, 16.81604)]
)
def test_folds_of_cycles_of_the_cubic_family(b0: float, parameter: float, period: float) -> None:
    """References of AUTO-07p, to the digits printed; the family then comes to a loop, known by shooting."""
    system, box = _cubic(0.5, 0.5, b0), [[-1.0, 0.6], [-0.5, 0.5]]
    family = family_from_hopf(system, _hopf(system, -0.02, 0.03, 0.0), (-0.02, 0.03), box)
    (fold,) = family.folds
    assert fold.parameter == pytest.approx(parameter, abs=3e-8)  # b0 is printed to six digits, and so moves it
    assert fold.period == pytest.approx(period, abs=2e-4)
    assert family.ends == (FamilyEnd.HOPF, FamilyEnd.CONNECTION)
    (loop,) = planar_connections(system, (0.0, 0.03), box).homoclinics
    assert family.parameter[-1] == pytest.approx(loop.parameter, abs=1e-8)
    assert family.period[-1] > 2.0 * family.period[0]
    before = family.parameter[: int(np.argmax(family.log_multiplier > 0.0))]
    assert (np.diff(before) > 0.0).all()
    _assert_each_is_a_cycle(system, family, box)


def test_a_family_is_the_same_from_a_cycle_of_it() -> None:
    system, box = _cubic(0.5, 0.5, -0.35), [[-1.0, 0.6], [-0.5, 0.5]]
    outer = planar_cycles(system, 0.0022, box)[1]
    family = family_from_cycle(system, outer, (-0.02, 0.03), box)
    assert set(family.ends) == {FamilyEnd.HOPF, FamilyEnd.CONNECTION}
    (fold,) = family.folds
    (other,) = family_from_hopf(system, _hopf(system, -0.02, 0.03, 0.0), (-0.02, 0.03), box).folds
    assert fold.parameter == pytest.approx(other.parameter, abs=1e-14)
    assert fold.parameter > 0.0022  # the two cycles at 0.0022 are either side of it
    crossed = np.flatnonzero(np.diff(np.sign(family.parameter - 0.0022)))
    assert len(crossed) + int((family.parameter == 0.0022).any()) >= 2


def test_an_unstable_family_from_a_subcritical_point() -> None:
    """Bogdanov-Takens: one unstable cycle between Hopf point and loop (mu1 = −1.9373648777e-2 at mu2 = 0.1)."""
    system = _system({(0, 1, 0): 1.0}, {(0, 0, 1): 1.0, (0, 1, 0): 0.1, (2, 0, 0): 1.0, (1, 1, 0): 1.0})
    hopf = _hopf(system, -0.05, -0.005, -0.01)
    family = family_from_hopf(system, hopf, (-0.05, -0.001), [[-0.5, 0.5], [-0.2, 0.2]])
    assert family.ends == (FamilyEnd.HOPF, FamilyEnd.CONNECTION)
    assert not family.stable.any()
    assert family.folds == ()
    assert family.parameter[-1] == pytest.approx(-1.9373648777e-2, rel=1e-5)


def test_the_interval_of_a_fold() -> None:
    """Central differences along a random direction of the coefficients, step 1e-6: their own error is some 1e-8."""
    direction = np.array([0.0, *np.random.default_rng(3).normal(size=6)])
    deviation, box = 1e-5, [[-1.0, 0.6], [-0.5, 0.5]]
    system = _cubic(0.5, 0.5, -0.35, deviation**2 * np.outer(direction, direction))
    theta = np.concatenate([system.first.polynomial.coefficients, system.second.polynomial.coefficients])
    outer = planar_cycles(system, 0.0022, box)[1]
    (fold,) = family_from_cycle(system, outer, (-0.02, 0.03), box).folds
    places = []
    for sign in (1.0, -1.0):
        moved = system.with_coefficients(theta + sign * 1e-6 * direction)
        places.append(family_from_cycle(moved, planar_cycles(moved, 0.0022, box)[1], (-0.02, 0.03), box).folds[0])
    slope = abs(places[0].parameter - places[1].parameter) / 2e-6
    assert np.ptp(fold.parameter_interval) == pytest.approx(2.0 * NORMAL_95 * deviation * slope, rel=1e-6)

    for size, stated in ((1e-5, True), (1.0, False)):
        vague = replace(system, covariance=size**2 * np.outer(direction, direction))
        (again,) = family_from_cycle(vague, outer, (-0.02, 0.03), box).folds
        assert np.isfinite(again.parameter_interval).all() == stated


def test_refusals() -> None:
    system = _cubic(0.5, 0.5, -0.35)
    cycle = planar_cycles(system, 0.0022, [[-1.0, 0.6], [-0.5, 0.5]])[0]
    with pytest.raises(InputError, match="needs a range of parameters around it"):
        family_from_cycle(system, cycle, (0.01, 0.02), _BOX)

"""Closed orbits that lie beside others: centers are told from weak foci, and nothing near them is a limit cycle."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from scipy.special import ellipk

from finback.dynamics.analysis_cycles import CycleVerdict
from finback.dynamics.planar.analysis import PlanarAnalysisOptions, analyze_planar
from finback.dynamics.planar.branch import planar_branches
from finback.dynamics.planar.center import planar_centers
from finback.dynamics.planar.cycle import planar_cycles
from finback.dynamics.planar.cycle_family import family_from_cycle, family_from_hopf
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.errors import RefusedError

_VARIABLES = ("x_1", "y_1", "mu_1")
_BOX = ((-3.0, 3.0), (-3.0, 3.0))
Terms = Mapping[tuple[int, int, int], float]


def _system(first: Terms, second: Terms) -> PlanarSystem:
    p, q = (Polynomial.build(terms, variables=_VARIABLES, value_unit="1") for terms in (first, second))
    return PlanarSystem.from_polynomials(p, q)


_CENTERS: dict[str, tuple[Terms, Terms]] = {
    "linear": ({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0}),
    "a loop around it": ({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (2, 0, 0): 1.0}),
    "Lotka and Volterra": ({(1, 0, 0): 1.0, (1, 1, 0): -1.0}, {(0, 1, 0): -1.3, (1, 1, 0): 1.0}),
    "reversible": ({(0, 1, 0): -1.0, (1, 1, 0): 0.4}, {(1, 0, 0): 1.0, (2, 0, 0): 0.3, (0, 2, 0): -0.5}),
    # Its orbits leave the box at a hundredth of the first range.
    "fast": ({(0, 1, 0): 1.0}, {(1, 0, 0): -1e4, (3, 0, 0): -1.0}),
}


@pytest.mark.parametrize("name", _CENTERS)
def test_a_center_is_a_continuum_and_has_no_limit_cycle(name: str) -> None:
    system = _system(*_CENTERS[name])
    (center,) = planar_centers(system, 0.0, _BOX)
    np.testing.assert_array_equal(center.reach[0], center.state)
    assert center.miss < 1e-14
    assert center.tried >= 5
    assert planar_cycles(system, 0.0, _BOX) == ()


def test_the_periods_of_a_center() -> None:
    """Duffing's x" = −x − x³ from amplitude a: 4 K(m)/√(1 + a²), m = a²/(2 (1 + a²))."""
    box = ((-1.0, 1.0), (-2.0, 2.0))
    (center,) = planar_centers(_system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (3, 0, 0): -1.0}), 0.0, box)
    assert center.periods[0] == pytest.approx(2.0 * math.pi, rel=1e-12)
    x, y = center.reach[1]
    # Energy gives the amplitude: a² + a⁴/2 = y² + x² + x⁴/2.
    a2 = math.sqrt(1.0 + 2.0 * (y**2 + x**2 + 0.5 * x**4)) - 1.0
    expected = 4.0 * ellipk(0.5 * a2 / (1.0 + a2)) / math.sqrt(1.0 + a2)
    assert center.periods[1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "damping", [{(3, 0, 0): -1.0}, {(3, 0, 0): 1.0}, {(5, 0, 0): -1.0}, {(1, 0, 0): 1e-9}, {(3, 0, 0): 1e-6}]
)
def test_a_weak_focus_is_no_center(damping: Terms) -> None:
    """Of x' = y + damping, y' = −x nothing is closed but what the damping leaves so: not even to 1e-9."""
    system = _system({(0, 1, 0): 1.0, **damping}, {(1, 0, 0): -1.0})
    assert planar_centers(system, 0.0, _BOX) == ()
    assert planar_cycles(system, 0.0, _BOX) == ()


def test_a_cycle_of_tiny_damping_is_none_of_a_center() -> None:
    """With x' = y + k x³, y' = −x − d y: averaging gives a² = 4 d/(3 k), to first order in both."""
    system = _system({(0, 1, 0): 1.0, (3, 0, 0): 1e-6}, {(1, 0, 0): -1.0, (0, 1, 0): -1e-6})
    (cycle,) = planar_cycles(system, 0.0, _BOX)
    assert cycle.high[0] == pytest.approx(math.sqrt(4.0 / 3.0), rel=1e-5)
    assert planar_centers(system, 0.0, _BOX) == ()


def test_an_analysis_says_that_there_is_a_continuum() -> None:
    options = PlanarAnalysisOptions(
        parameter_range=(-1.0, 1.0), parameter_step=1.0, first_range=(-2.0, 2.0), second_range=(-2.0, 2.0)
    )
    found = analyze_planar(_system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): 1.0}), options)
    assert {center.parameter for center in found.limit_cycles.centers} == {0.0}
    assert found.limit_cycles.cycles == found.limit_cycles.families == ()
    assert found.limit_cycles.verdict is CycleVerdict.NONE_FOUND
    assert any("At 1 of its values" in note and "a continuum and no limit cycles" in note for note in found.notes)
    assert not any("could not be searched" in note for note in found.notes)


def test_a_family_goes_through_a_center_and_is_not_folded_there() -> None:
    """Van der Pol's cycle turns into one of a center's orbits at mu = 0, of amplitude 2, and comes out unstable."""
    system = _system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 1): -1.0})
    (cycle,) = planar_cycles(system, 0.5, _BOX)
    family = family_from_cycle(system, cycle, (-0.6, 0.6), _BOX)
    assert family.folds == ()
    assert family.parameter.min() < -0.5 < 0.5 < family.parameter.max()
    np.testing.assert_array_equal(family.stable, family.parameter > 0.0)
    near = family.high[np.argmin(np.abs(family.parameter)), 0]
    assert near == pytest.approx(2.0, abs=1e-3)
    hopf = planar_branches(system, (-1.0, 1.0), np.array(_BOX), planar_equilibria(system, 0.5)).hopf_points[0]
    with pytest.raises(RefusedError, match="a center"):
        family_from_hopf(system, hopf, (-0.6, 0.6), _BOX)

"""Degenerate points of branches of any field: each is said by name, and nothing is left out or made up beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.continuation.branch import EquilibriumBranch, equilibrium_branch
from finback.dynamics.continuation.branch_point import Crossing
from finback.dynamics.continuation.degenerate import Degeneracy
from finback.dynamics.continuation.field import BlackBox
from finback.dynamics.continuation.hopf import Criticality
from finback.dynamics.continuation.path import ContinuationOptions
from finback.dynamics.continuation.search import equilibrium_branches

Rates = Callable[[FloatArray, float], Sequence[float]]
# Where a test function is flat, a difference's rounding of 1e-11 moves a point by its root.
_ROOT_OF_ROUNDING = 1e-5
_RANGES = ([-1.0, 1.0], [-1.0, 1.1])  # in the first a step, or the middle of one, may land on the very point


def _oscillators(*frequencies: float, apart: float = 0.0) -> Rates:
    """Uncoupled z' = (m + iω) z − z |z|²; the last one's parameter is less by ``apart``."""

    def rates(u: FloatArray, m: float) -> list[float]:
        found: list[float] = []
        for k, frequency in enumerate(frequencies):
            x, y = u[2 * k : 2 * k + 2]
            growth = m - (apart if k + 1 == len(frequencies) else 0.0) - (x * x + y * y)
            found += [growth * x - frequency * y, growth * y + frequency * x]
        return found

    return rates


def _branch(
    rates: Rates, states: int, ends: Sequence[float], state: float = 0.0, at: float = -0.5
) -> EquilibriumBranch:
    box = BlackBox(field=rates, state_box=[[-1.0, 1.2]] * states, parameter_range=[ends])
    return equilibrium_branch(box, state=[state] * states, parameter=at)


@pytest.mark.parametrize("ends", _RANGES)
@pytest.mark.parametrize("power", [3, 5])
def test_where_the_parameter_stands_still_and_goes_on(power: int, ends: Sequence[float]) -> None:
    box = BlackBox(field=lambda u, m: [m - u[0] ** power], state_box=[[-1.0, 1.2]], parameter_range=[ends])
    (branch,) = equilibrium_branches(box).branches
    (point,) = branch.degenerate_points
    assert point.kind is Degeneracy.CUSP
    assert abs(point.parameter) < 1e-12
    assert abs(point.state[0]) < {3: _ROOT_OF_ROUNDING, 5: 1e-2}[power]
    assert branch.limit_points == ()


def test_two_folds_are_no_cusp_however_near() -> None:
    """With m = u³ − e u: folds at u = ±√(e/3)."""
    for e in (1e-2, 1e-4, 1e-6):
        branch = _branch(lambda u, m, e=e: [m - u[0] ** 3 + e * u[0]], 1, [-1.0, 1.1], 0.8, 0.5)
        assert branch.degenerate_points == ()
        found = sorted(point.parameter for point in branch.limit_points)
        np.testing.assert_allclose(found, [-2.0 * (e / 3.0) ** 1.5, 2.0 * (e / 3.0) ** 1.5], rtol=1e-6, atol=1e-13)
    # The other way there is neither.
    branch = _branch(lambda u, m: [m - u[0] ** 3 - 1e-6 * u[0]], 1, [-1.0, 1.1], 0.8, 0.5)
    assert branch.degenerate_points == branch.limit_points == ()


@pytest.mark.parametrize("ends", _RANGES)
@pytest.mark.parametrize("frequencies", [(1.0, 2.0), (1.0, 1.0), (1.0, 2.0, 3.0)])
def test_pairs_that_cross_together_are_all_found(frequencies: tuple[float, ...], ends: Sequence[float]) -> None:
    branch = _branch(_oscillators(*frequencies), 2 * len(frequencies), ends)
    assert [point.kind for point in branch.degenerate_points] == [Degeneracy.COINCIDENT_PAIRS]
    assert [point.frequency for point in branch.hopf_points] == pytest.approx(frequencies, rel=1e-9)
    for point in branch.hopf_points:
        assert abs(point.parameter) < 1e-9
        assert point.crossing_speed == pytest.approx(1.0, rel=1e-6)
        assert point.criticality is not Criticality.SUBCRITICAL


@pytest.mark.parametrize("apart", [1e-3, 1e-5])
def test_pairs_that_cross_beside_each_other_are_two_ordinary_points(apart: float) -> None:
    branch = _branch(_oscillators(1.0, 2.0, apart=apart), 4, [-1.0, 1.1])
    assert branch.degenerate_points == ()
    assert [point.parameter for point in branch.hopf_points] == pytest.approx([0.0, apart], abs=1e-9)


@pytest.mark.parametrize("ends", _RANGES)
def test_a_bogdanov_takens_point_is_no_hopf_point_and_no_neutral_saddle(ends: Sequence[float]) -> None:
    branch = _branch(lambda u, m: [u[1], m + u[0] ** 2 + u[0] * u[1]], 2, ends, -0.5, -0.25)
    (point,) = branch.degenerate_points
    assert point.kind is Degeneracy.BOGDANOV_TAKENS
    assert abs(point.parameter) < 1e-9
    assert len(branch.limit_points) == 1
    assert branch.hopf_points == branch.neutral_saddles == ()


def test_a_fold_beside_a_pair_on_the_axis() -> None:
    branch = _branch(lambda u, m: [m * u[0] - u[1], u[0] + m * u[1], m - u[2] ** 2], 3, [-1.0, 1.1], 0.0, 0.25)
    assert [point.kind for point in branch.degenerate_points] == [Degeneracy.ZERO_HOPF]
    assert len(branch.limit_points) == 1


def test_two_zeros_with_two_eigenvectors() -> None:
    branch = _branch(lambda u, m: [m * u[0] - u[0] ** 2, m * u[1] - u[1] ** 2], 2, [-1.0, 1.1])
    assert [point.kind for point in branch.degenerate_points] == [Degeneracy.DOUBLE_ZERO]
    assert branch.hopf_points == ()


@pytest.mark.parametrize("rates", [lambda u, m: [u[1], m - u[0] ** 2 - 0.3 * u[0]], lambda u, m: [u[1], m - u[0]]])
def test_a_conservative_field_has_no_hopf_points(rates: Rates) -> None:
    branch = _branch(rates, 2, [-1.0, 1.1], 0.2, 0.1)
    assert Degeneracy.NEUTRAL_THROUGHOUT in {point.kind for point in branch.degenerate_points}
    assert branch.hopf_points == branch.neutral_saddles == ()


@pytest.mark.parametrize("ends", _RANGES)
@pytest.mark.parametrize(("power", "kind"), [(2, Crossing.TRANSCRITICAL), (3, Crossing.PITCHFORK)])
def test_branch_points_are_nothing_else(power: int, kind: Crossing, ends: Sequence[float]) -> None:
    branch = _branch(lambda u, m: [m * u[0] - u[0] ** power], 1, ends)
    assert branch.degenerate_points == branch.limit_points == ()
    assert [point.kind for point in branch.branch_points] == [kind]


@pytest.mark.parametrize("parts", [1, 3, 7, 16, 25])
def test_a_step_that_lands_on_a_hopf_point_still_reports_it(parts: int) -> None:
    """The branch is straight and each step as long as allowed, so from 0.25 of one the others follow."""
    box = BlackBox(field=_oscillators(1.0), state_box=[[-1.0, 1.0]] * 2, parameter_range=[-2.0, 2.0])
    options = ContinuationOptions(largest_step=0.5 / parts)
    branch = equilibrium_branch(box, state=[0.0, 0.0], parameter=-1.0, options=options)
    (point,) = branch.hopf_points
    assert abs(point.parameter) < 1e-9

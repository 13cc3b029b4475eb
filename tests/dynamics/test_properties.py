"""What must hold for any model whose force and damping are known by construction."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.polynomial import polynomial as npp

from finback.arrays import FloatArray
from finback.dynamics.analysis import AnalysisOptions
from finback.dynamics.branch import branch
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.fold import folds
from finback.dynamics.hopf import bogdanov_takens_points, hopf_points, neutral_saddles
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.units import si_factor

_OPTIONS = AnalysisOptions(
    elevator_range_rad=(-0.7, 0.5), elevator_step_rad=0.1, alpha_range_rad=(-1.2, 1.2), branch_points=401
)


@dataclass(frozen=True, kw_only=True)
class Built:
    """A planar model made from the Liénard form it must reduce to."""

    model: PolynomialModel
    damping: FloatArray
    force: FloatArray
    gain: float
    turns: tuple[float, ...]


def _polynomial(in_alpha: FloatArray, q: float, elevator: float, unit: str) -> Polynomial:
    terms = {(k, 0, 0): float(value) for k, value in enumerate(in_alpha)} | {(0, 1, 0): q, (0, 0, 1): elevator}
    return Polynomial.build(terms, variables=VARIABLES, value_unit=unit)


def _number(low: float, high: float) -> st.SearchStrategy[float]:
    """Six decimals: the underflow of numbers near 1e-300 is the business of the roots, tested there."""
    return st.floats(low, high).map(lambda value: round(value, 6))


@st.composite
def built(draw: st.DrawFn) -> Built:
    """Choose f, the zeros of g' (at least 0.05 rad apart), the gain and the lift equation; solve for the moment."""
    turns = tuple(k / 20.0 for k in sorted(draw(st.sets(st.integers(-20, 20), max_size=4))))
    slope = draw(st.sampled_from([-1.0, 1.0])) * draw(_number(5.0, 60.0)) * npp.polyfromroots(turns)
    force = npp.polyint(slope, k=[draw(_number(-1.0, 1.0))])
    damping = np.array(draw(st.lists(_number(-2.0, 2.0), min_size=1, max_size=4)))
    gain = draw(st.sampled_from([-1.0, 1.0])) * draw(_number(1.0, 6.0))
    a_q, b_q, a_elevator = draw(_number(0.7, 1.3)), draw(_number(-1.0, 1.0)), draw(_number(-0.1, 0.1))
    # f = A' + b_q, g = a_q B - b_q A, c1 = a_q b_elevator - b_q a_elevator, solved for A, B and b_elevator.
    a = npp.polyint(npp.polysub(damping, [b_q]), k=[draw(_number(-0.2, 0.2))])
    b = npp.polyadd(force, b_q * a) / a_q
    b_elevator = (gain + b_q * a_elevator) / a_q
    alpha_dot = _polynomial(a, a_q, a_elevator, "rad_s")
    q_dot = _polynomial(b, b_q, b_elevator, "rad_s2")
    size = alpha_dot.coefficients.size + q_dot.coefficients.size
    model = PolynomialModel(alpha_dot=alpha_dot, q_dot=q_dot, covariance=1e-6 * np.eye(size))
    return Built(model=model, damping=damping, force=force, gain=gain, turns=turns)


@settings(deadline=None, derandomize=True)
@given(built())
def test_the_reduction_returns_what_the_model_was_made_of(case: Built) -> None:
    system = reduce(case.model)
    # Made with a handful of operations on numbers up to 100.
    np.testing.assert_allclose(npp.polysub(system.damping.ascending, case.damping), 0.0, atol=1e-14)
    np.testing.assert_allclose(npp.polysub(system.force.ascending, case.force), 0.0, atol=1e-12)
    assert system.elevator_gain == pytest.approx(case.gain, rel=1e-13)


@settings(deadline=None, derandomize=True)
@given(built())
def test_the_folds_are_where_they_were_put(case: Built) -> None:
    found = folds(reduce(case.model))
    assert len(found) == len(case.turns)
    # Four turns 0.05 rad apart: the slope of g' at the closest is 5 * 0.05 * 0.05 * 0.05, its rounding 1e-13.
    np.testing.assert_allclose([fold.alpha_rad for fold in found], case.turns, rtol=0, atol=1e-9)
    for fold in found:
        assert fold.elevator_rad == pytest.approx(-npp.polyval(fold.alpha_rad, case.force) / case.gain, abs=1e-12)


@settings(deadline=None, max_examples=50, derandomize=True)  # 13 elevators and a branch each
@given(built())
def test_any_statics_are_consistent(assert_consistent: Callable[[SimpleNamespace], None], case: Built) -> None:
    """What an analysis lists but for orbits, of which each has properties and tests of its own."""
    system, (low, high) = reduce(case.model), _OPTIONS.alpha_range_rad
    elevators = np.linspace(*_OPTIONS.elevator_range_rad, 13).tolist()

    def kept(points: Iterable[Any]) -> list[Any]:
        return [point for point in points if low <= point.alpha_rad <= high]

    statics = SimpleNamespace(
        system=system,
        options=_OPTIONS,
        branch=branch(system, np.linspace(low, high, _OPTIONS.branch_points)),
        equilibria=[point for elevator in elevators for point in equilibria(system, elevator)],
        folds=kept(folds(system)),
        hopf_points=kept(hopf_points(system)),
        neutral_saddles=kept(neutral_saddles(system)),
        bogdanov_takens=kept(bogdanov_takens_points(system)),
    )
    assert_consistent(statics)


@settings(deadline=None, max_examples=50, derandomize=True)
@given(built())
def test_the_number_of_equilibria_changes_by_two_and_across_folds_only(case: Built) -> None:
    system = reduce(case.model)
    edges = sorted(fold.elevator_rad for fold in folds(system))
    inner = [0.5 * (low + high) for low, high in pairwise(edges) if high - low > 1e-9]
    ends = [edges[0] - 0.5, edges[-1] + 0.5] if edges else [-0.5, 0.5]
    probes = sorted([*inner, *ends])
    counts = [len(equilibria(system, probe)) for probe in probes]
    for (low, high), (before, after) in zip(pairwise(probes), pairwise(counts), strict=True):
        between = [fold for fold in folds(system) if low < fold.elevator_rad < high]
        # Each fold makes or takes two: a maximum of the holding elevator takes, a minimum makes.
        curvature = system.force.derivative("alpha_rad").derivative("alpha_rad")
        gained = sum(2 if -float(curvature(f.alpha_rad)) / system.elevator_gain > 0.0 else -2 for f in between)
        assert after - before == gained
    # Within one stretch between two folds the count is constant.
    for low, high in pairwise(edges):
        stretch = np.linspace(low, high, 7)[1:-1] if high - low > 1e-9 else []
        assert len({len(equilibria(system, float(e))) for e in stretch}) <= 1


@settings(deadline=None, max_examples=50, derandomize=True)
@given(built(), _number(-0.6, 0.4))
def test_stability_is_that_of_the_planar_field(case: Built, elevator: float) -> None:
    """Two roads: the Jacobian of the model in (alpha, q), of which the Liénard form knows nothing."""
    for point in equilibria(reduce(case.model), elevator):
        state = (point.alpha_rad, point.q_rad_s, elevator)
        jacobian = np.array(
            [
                [float(rate.derivative(name)(*state)) for name in VARIABLES[:2]]
                for rate in (case.model.alpha_dot, case.model.q_dot)
            ]
        )
        own = point.eigenvalues_real_1_s + 1j * point.eigenvalues_imag_1_s
        size = np.abs(jacobian).max()
        # Trace and determinant are well conditioned; eigenvalues near a double one are not.
        assert own.sum().real == pytest.approx(np.trace(jacobian), abs=1e-12 * size)
        assert own.prod().real == pytest.approx(np.linalg.det(jacobian), abs=1e-12 * size**2)
        # The angle of a far equilibrium is itself known to some roundings of a large number only.
        rates = [float(case.model.alpha_dot(*state)), float(case.model.q_dot(*state))]
        terms = [np.abs(p.term_values(*state) * p.coefficients).sum() for p in (case.model.alpha_dot, case.model.q_dot)]
        assert (np.abs(rates) <= 1e-12 * np.array(terms)).all()


@settings(deadline=None, max_examples=50, derandomize=True)
@given(built())
def test_the_unit_of_angle_does_not_matter(case: Built) -> None:
    """The same model with the numbers of degrees in the place of radians has its angles in degrees."""
    degree = si_factor("deg")

    def rescaled(polynomial: Polynomial) -> Polynomial:
        return replace(polynomial, coefficients=polynomial.coefficients * degree ** (polynomial.powers.sum(axis=1) - 1))

    model = replace(case.model, alpha_dot=rescaled(case.model.alpha_dot), q_dot=rescaled(case.model.q_dot))
    radians, degrees = reduce(case.model), reduce(model)
    zeros = (*hopf_points(radians), *neutral_saddles(radians), *bogdanov_takens_points(radians))
    if all(abs(zero.alpha_rad - fold.alpha_rad) > 1e-9 for zero in zeros for fold in folds(radians)):
        # Where trace and determinant vanish together, rounding decides the sign of the latter.
        assert len(hopf_points(degrees)) == len(hopf_points(radians))
        assert len(neutral_saddles(degrees)) == len(neutral_saddles(radians))
    for name in ("elevator_rad", "alpha_rad", "q_rad_s"):
        expected = [getattr(fold, name) for fold in folds(radians)]
        found = [getattr(fold, name) * degree for fold in folds(degrees)]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)  # as where the folds were put
    angles = np.linspace(*_OPTIONS.alpha_range_rad, _OPTIONS.branch_points)
    one, other = branch(radians, angles), branch(degrees, angles / degree)
    np.testing.assert_allclose(other.divergence_1_s, one.divergence_1_s, rtol=0, atol=1e-11)
    np.testing.assert_allclose(other.elevator_rad * degree, one.elevator_rad, rtol=0, atol=1e-11 * 100.0)

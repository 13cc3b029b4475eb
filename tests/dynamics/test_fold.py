"""Folds, the branch between them and the zeros of its trace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.branch import branch
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points, neutral_saddles
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.units import from_si, to_si

ANGLE_DEG = 1e-10  # the reference has ten decimals
ALPHA_DEG = 0.5e-10


def test_the_folds_of_the_paper(printed_system: LienardSystem) -> None:
    """Reference: independent 130-bit arithmetic on Eq. (37); the paper prints 14.725215 and -35.129324."""
    left, right = folds(printed_system)
    assert from_si(left.elevator_rad, "deg") == pytest.approx(14.7252153801, rel=0, abs=ANGLE_DEG)
    assert from_si(left.alpha_rad, "deg") == pytest.approx(-13.5416505800, rel=0, abs=ALPHA_DEG)
    assert left.divergence_1_s == pytest.approx(-0.56555687, rel=0, abs=0.5e-8)
    assert from_si(right.elevator_rad, "deg") == pytest.approx(-35.1293238979, rel=0, abs=ANGLE_DEG)
    assert from_si(right.alpha_rad, "deg") == pytest.approx(24.7678926978, rel=0, abs=ALPHA_DEG)
    assert right.divergence_1_s == pytest.approx(-0.44684986, rel=0, abs=0.5e-8)


def test_the_primitive_model_has_the_same_folds_to_its_printed_digits(paper_model: PolynomialModel) -> None:
    found = [from_si(fold.elevator_rad, "deg") for fold in folds(reduce(paper_model))]
    # Eq. (37) is rounded to ten digits, which moves the folds by 1e-8 degrees.
    assert found == pytest.approx([14.7252153801, -35.1293238979], rel=0, abs=2e-8)


def test_the_folds_are_a_quadratic_equation(printed_system: LienardSystem) -> None:
    """A second road: g' = 0 in closed form."""
    _, b1, b2, b3 = printed_system.force.ascending
    angles = (-2.0 * b2 + np.array([-1.0, 1.0]) * np.sqrt(4.0 * b2**2 - 12.0 * b1 * b3)) / (6.0 * b3)
    np.testing.assert_allclose([fold.alpha_rad for fold in folds(printed_system)], angles, rtol=1e-14)
    for fold in folds(printed_system):
        assert fold.bracket_rad[1] - fold.bracket_rad[0] < 1e-14


def test_a_fold_is_an_equilibrium_of_the_planar_field(paper_model: PolynomialModel) -> None:
    for fold in folds(reduce(paper_model)):
        state = (fold.alpha_rad, fold.q_rad_s, fold.elevator_rad)
        assert paper_model.alpha_dot(*state) == pytest.approx(0.0, abs=1e-14)  # rounding of terms of size 1
        assert paper_model.q_dot(*state) == pytest.approx(0.0, abs=1e-14)


def _uncertain(model: PolynomialModel, relative: float) -> tuple[PolynomialModel, FloatArray]:
    """Return the model with a correlated covariance, and a root of it."""
    generator = np.random.default_rng(11)
    size = model.coefficients.size
    mix = np.eye(size) + 0.3 * generator.standard_normal((size, size))
    root = mix * (relative * np.abs(model.coefficients))[:, np.newaxis]
    return replace(model, covariance=root @ root.T), root


def test_intervals_of_folds_and_neutral_saddles_are_the_scatter_of_samples(paper_model: PolynomialModel) -> None:
    model, root = _uncertain(paper_model, 0.001)
    system = reduce(model)
    generator = np.random.default_rng(12)
    draws = model.coefficients + generator.standard_normal((300, len(root))) @ root.T
    rows = []
    for draw in draws:
        sample = reduce(model.with_coefficients(draw))
        rows.append(
            [
                *((p.elevator_rad, p.alpha_rad, p.q_rad_s) for p in folds(sample)),
                *((p.elevator_rad, p.alpha_rad, p.q_rad_s) for p in neutral_saddles(sample)),
            ]
        )
    scatter = 1.959964 * np.std(rows, axis=0)
    # The standard deviation of 300 draws is known to 4.1 %; four times that.
    for index, fold in enumerate(folds(system)):
        intervals = (fold.elevator_interval_rad, fold.alpha_interval_rad, fold.q_interval_rad_s)
        np.testing.assert_allclose([0.5 * np.diff(i)[0] for i in intervals], scatter[index], rtol=0.165)
    for index, zero in enumerate(neutral_saddles(system), start=2):
        found = [0.5 * np.diff(i)[0] for i in (zero.elevator_interval_rad, zero.alpha_interval_rad)]
        np.testing.assert_allclose(found, scatter[index, :2], rtol=0.165)


def _located(system: LienardSystem) -> FloatArray:
    """Every located value that carries an interval, one row a value: low, value, high."""
    rows = []
    for fold in folds(system):
        rows += [
            (fold.elevator_interval_rad, fold.elevator_rad),
            (fold.alpha_interval_rad, fold.alpha_rad),
            (fold.q_interval_rad_s, fold.q_rad_s),
        ]
    for zero in neutral_saddles(system):
        rows += [(zero.elevator_interval_rad, zero.elevator_rad), (zero.alpha_interval_rad, zero.alpha_rad)]
    rows += [(point.alpha_interval_rad, point.alpha_rad) for point in equilibria(system, -0.2)]
    return np.array([(low, value, high) for (low, high), value in rows])


@pytest.mark.parametrize("index", range(12))
def test_one_uncertain_coefficient_moves_each_value_as_its_interval_says(
    paper_model: PolynomialModel, index: int
) -> None:
    """The delta method, coefficient by coefficient, against a central difference."""
    step = 1e-4 * abs(paper_model.coefficients[index])
    shift = step * np.eye(12)[index]
    up, down = (
        _located(reduce(paper_model.with_coefficients(paper_model.coefficients + sign * shift))) for sign in (1.0, -1.0)
    )
    stated = _located(reduce(replace(paper_model, covariance=np.outer(shift, shift))))
    half = 0.5 * (stated[:, 2] - stated[:, 0]) / 1.959963984540054
    # The difference errs by the third derivative (1e-8 relative) and by the rounding of the values.
    np.testing.assert_allclose(half, 0.5 * np.abs(up[:, 1] - down[:, 1]), rtol=1e-6, atol=1e-14)


def test_the_elevator_of_a_fold_does_not_feel_the_angle(printed_system: LienardSystem) -> None:
    """With the constant of g alone uncertain, the angle is known exactly and the elevator by σ/c₁."""
    sensitivity = np.zeros((4, 1))
    sensitivity[0] = 1.0
    force = replace(printed_system.force, sensitivity=sensitivity)
    fold = folds(replace(printed_system, force=force, covariance=np.array([[1e-4]])))[0]
    assert np.ptp(fold.alpha_interval_rad) == 0.0
    half = 1.959963984540054 * 1e-2 / abs(printed_system.elevator_gain)
    np.testing.assert_allclose(fold.elevator_interval_rad, fold.elevator_rad + half * np.array([-1, 1]), rtol=1e-12)


def _system_of(force: list[float], printed: LienardSystem, damping: tuple[float, ...] = (-1.0,)) -> LienardSystem:
    def curve(row: tuple[float, ...] | list[float], unit: str) -> Curve:
        terms = {(k,): value for k, value in enumerate(row)}
        polynomial = Polynomial.build(terms, variables=("alpha_rad",), value_unit=unit)
        return Curve(polynomial=polynomial, sensitivity=np.zeros((len(row), 1)))

    return replace(printed, damping=curve(damping, "1"), force=curve(force, "rad_s2"))


def test_an_inflection_is_no_fold(printed_system: LienardSystem) -> None:
    assert folds(_system_of([0.0, 0.0, 0.0, 1.0], printed_system)) == ()  # g = x³: g' touches zero


def test_a_flat_extremum_is_a_fold_of_unknown_angle(printed_system: LienardSystem) -> None:
    (fold,) = folds(_system_of([0.5, 0.0, 0.0, 0.0, 1.0], printed_system))  # g = x⁴ + ½
    assert fold.alpha_rad == pytest.approx(0.0, abs=1e-100)
    assert fold.elevator_rad == pytest.approx(-0.5 / printed_system.elevator_gain)
    np.testing.assert_array_equal(fold.alpha_interval_rad, [-np.inf, np.inf])
    assert np.ptp(fold.elevator_interval_rad) == 0.0


def test_without_effect_of_the_elevator_there_is_nothing_to_fold(printed_system: LienardSystem) -> None:
    idle = replace(printed_system, elevator_gain=0.0)
    assert folds(idle) == ()
    assert hopf_points(idle) == neutral_saddles(idle) == ()
    assert branch(idle, np.linspace(-0.5, 0.5, 11)).alpha_rad.size == 0
    assert folds(_system_of([0.5], printed_system)) == ()


def test_the_trace_along_the_stable_branch(printed_system: LienardSystem) -> None:
    """Eq. (38): a0(δ) between the folds, with its reference minimum at alpha 4.857604°, elevator -8.728019°."""
    left, right = folds(printed_system)
    stable = branch(printed_system, np.linspace(left.alpha_rad, right.alpha_rad, 200_001)[1:-1])
    assert stable.stable.all()
    # The grid ends one step (1.9e-4°) off the fold, where f has the slope 0.082 per degree.
    assert stable.divergence_1_s.max() == pytest.approx(-0.44684986, rel=0, abs=1.7e-5)
    assert stable.divergence_1_s.min() == pytest.approx(-1.25977454, rel=0, abs=0.5e-8)
    lowest = int(stable.divergence_1_s.argmin())
    assert from_si(stable.alpha_rad[lowest], "deg") == pytest.approx(4.857604, abs=2e-4)  # one step of the grid
    assert from_si(stable.elevator_rad[lowest], "deg") == pytest.approx(-8.728019, abs=4e-4)


def test_support_is_judged_by_angle(printed_system: LienardSystem) -> None:
    domain = to_si(np.array([[-10.0, 30.0], [-1.0, 1.0]]), "deg")
    left, right = folds(replace(printed_system, domain=domain))
    assert (left.in_domain, right.in_domain) == (False, True)

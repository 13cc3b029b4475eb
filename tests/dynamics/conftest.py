"""The published model of the paper as test data, and one consistency check for every analysis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.analysis import Analysis
from finback.dynamics.hopf import BogdanovTakens, Hopf, NeutralSaddle
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import PaperForm, from_paper, reduce

# Shi Z., Fan L., "Bifurcation analysis of polynomial models for longitudinal motion at high angle of attack",
# Chinese J. Aeronautics 26(1) (2013) 151-160, doi 10.1016/j.cja.2012.12.019: the primitive model of section 5
# (F-8 II), in degrees, signs as the reduction to its Eq. (35) requires.
_PAPER = PaperForm(
    C_zq=0.98471492754086 - 1.0,
    C_z=(0.08691763804, -0.3504260784, -0.00996132996307, 0.000683555761819),
    C_zde=-0.03768490060652,
    M_zq=-0.43379543105980,
    M_zad=-0.43379543105980,
    M_z=(2.032347041, -8.21732823573954, -0.13571798007977, 0.00801903617531),
    M_zde=-4.67496672860152,
)

# The same paper, Eq. (37): the reduced coefficients as printed, in degrees. The paper's folds and equilibria follow
# from these ten-digit values; those of the primitive model differ by 1e-8 degrees.
_PRINTED_DAMPING = (-1.211386346, -0.01992265993, 0.002050667285)
_PRINTED_FORCE = (2.038986943, -8.243739010, -0.1379647003, 0.008192987992)
_PRINTED_GAINS = (-4.619857062, -0.03768490060652)


@pytest.fixture(scope="session")
def paper_model() -> PolynomialModel:
    return from_paper(_PAPER)


@pytest.fixture(scope="session")
def printed_system(paper_model: PolynomialModel) -> LienardSystem:
    """The reduced system of Eq. (37), exact by definition."""

    def exact(polynomial: Polynomial) -> Curve:
        return Curve(polynomial=polynomial, sensitivity=np.zeros((polynomial.coefficients.size, 1)))

    def in_alpha(coefficients: tuple[float, ...], unit: str) -> Curve:
        terms = {(k,): value for k, value in enumerate(coefficients)}
        return exact(Polynomial.build(terms, variables=("alpha_deg",), value_unit=unit).to_si())

    return LienardSystem(
        damping=in_alpha(_PRINTED_DAMPING, "1_s"),
        force=in_alpha(_PRINTED_FORCE, "deg_s2"),
        elevator_gain=_PRINTED_GAINS[0],
        elevator_gain_sensitivity=np.zeros(1),
        elevator_rate_gain=_PRINTED_GAINS[1],
        elevator_rate_gain_sensitivity=np.zeros(1),
        pitch_rate=exact(reduce(paper_model).pitch_rate.polynomial),
        pitch_rate_gain=1.0 / (1.0 + _PAPER.C_zq),
        covariance=np.zeros((1, 1)),
        domain=np.array([[-np.inf, np.inf], [-np.inf, np.inf]]),
    )


@pytest.fixture(scope="session")
def build_system() -> Callable[..., LienardSystem]:
    """A Liénard system from plain numbers in rad and s; θ are all its coefficients: f, then g, then the gain."""

    def build(
        damping: Sequence[float], force: Sequence[float], *, gain: float = 1.0, covariance: FloatArray | None = None
    ) -> LienardSystem:
        rows = np.eye(len(damping) + len(force) + 1)

        def curve(row: Sequence[float], unit: str, first: int) -> Curve:
            terms = {(k,): float(value) for k, value in enumerate(row)}
            polynomial = Polynomial.build(terms, variables=("alpha_rad",), value_unit=unit)
            return Curve(polynomial=polynomial, sensitivity=rows[first : first + len(row)])

        pitch = Polynomial.build({(1, 0): 0.5}, variables=("alpha_rad", "elevator_rad"), value_unit="rad_s")
        return LienardSystem(
            damping=curve(damping, "1", 0),
            force=curve(force, "rad_s2", len(damping)),
            elevator_gain=gain,
            elevator_gain_sensitivity=rows[-1],
            elevator_rate_gain=0.0,
            elevator_rate_gain_sensitivity=np.zeros(len(rows)),
            pitch_rate=Curve(polynomial=pitch, sensitivity=np.zeros((1, len(rows)))),
            pitch_rate_gain=1.0,
            covariance=np.zeros_like(rows) if covariance is None else covariance,
            domain=np.array([[-np.inf, np.inf], [-np.inf, np.inf]]),
        )

    return build


@pytest.fixture(scope="session")
def assert_consistent() -> Callable[[Analysis], None]:
    """What must hold for any analysis whatever, whoever made the system."""

    def check(analysis: Analysis) -> None:
        _check_points(analysis)
        _check_equilibria(analysis)
        _check_branch(analysis)

    return check


def _trace_zeros(analysis: Analysis) -> list[Hopf | NeutralSaddle | BogdanovTakens]:
    zeros = [*analysis.hopf_points, *analysis.neutral_saddles, *analysis.bogdanov_takens]
    return sorted(zeros, key=lambda zero: zero.alpha_rad)


def _check_points(analysis: Analysis) -> None:
    """Each located point lies in its bracket, and what it is a zero of changes sign across it."""
    system, (low, high) = analysis.system, analysis.options.alpha_range_rad
    slope = system.force.derivative("alpha_rad")
    for points, curve in ((analysis.folds, slope), (_trace_zeros(analysis), system.damping)):
        assert all(a.alpha_rad < b.alpha_rad for a, b in pairwise(points))
        for point in points:
            left, right = point.bracket_rad
            assert left <= point.alpha_rad <= right
            assert np.sign(curve(left)) == -np.sign(curve(right)) != 0.0
            assert low <= point.alpha_rad <= high
            assert point.residual == curve(point.alpha_rad)
            assert point.alpha_interval_rad[0] <= point.alpha_rad <= point.alpha_interval_rad[1]
            assert point.elevator_interval_rad[0] <= point.elevator_rad <= point.elevator_interval_rad[1]
            assert point.in_domain == (system.domain[0, 0] <= point.alpha_rad <= system.domain[0, 1])


def _check_equilibria(analysis: Analysis) -> None:
    """Each equilibrium solves its equation to rounding, and its kind is what its eigenvalues say."""
    system = analysis.system
    slope = system.force.derivative("alpha_rad")
    for point in analysis.equilibria:
        terms = np.abs(system.force.polynomial.term_values(point.alpha_rad) * system.force.polynomial.coefficients)
        size = float(terms.sum()) + abs(system.elevator_gain * point.elevator_rad)
        assert abs(point.residual) <= 1e-14 * size  # some 40 roundings of the evaluation
        trace, determinant = float(system.damping(point.alpha_rad)), -float(slope(point.alpha_rad))
        values = point.eigenvalues_real_1_s + 1j * point.eigenvalues_imag_1_s
        scale = np.abs(values).max()
        assert abs(values.sum() - trace) <= 1e-14 * scale
        assert abs(values.prod() - determinant) <= 1e-14 * scale**2
        if point.kind == "degenerate":
            continue
        assert point.kind.stable == bool((point.eigenvalues_real_1_s < 0.0).all())
        assert (point.kind == "saddle") == bool(point.eigenvalues_real_1_s.prod() < 0.0)
        assert point.kind.endswith("focus") == bool((point.eigenvalues_imag_1_s != 0.0).all())


def _check_branch(analysis: Analysis) -> None:
    """The branch is made of equilibria; determinant and trace change sign across folds and trace zeros only."""
    branch, system = analysis.branch, analysis.system
    held = system.force(branch.alpha_rad) + system.elevator_gain * branch.elevator_rad
    assert (np.abs(held) <= 4 * np.finfo(float).eps * np.abs(system.elevator_gain * branch.elevator_rad)).all()
    assert (branch.stable == ((branch.divergence_1_s < 0.0) & (branch.determinant_1_s2 > 0.0))).all()
    for values, points, curve in (
        (branch.determinant_1_s2, analysis.folds, system.force.derivative("alpha_rad").polynomial),
        (branch.divergence_1_s, _trace_zeros(analysis), system.damping.polynomial),
    ):
        # Points of the grid that fall on a zero have no sign to compare: some 40 roundings of the evaluation.
        clear = np.abs(values) > 1e-14 * (np.abs(curve.term_values(branch.alpha_rad)) @ np.abs(curve.coefficients))
        if clear.any():
            inside, _ = np.histogram([point.alpha_rad for point in points], bins=branch.alpha_rad[clear])
            signs = np.sign(values[clear])
            np.testing.assert_array_equal(signs[:-1] != signs[1:], inside % 2 == 1)

"""Equilibria: the paper's table, their kinds, and what happens next to a fold."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.equilibrium import Kind, eigenvalues, equilibria, kind_of
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.errors import InputError, RefusedError
from finback.units import from_si, to_si

# Reference values for the coefficients of Eq. (37), computed independently in 130-bit arithmetic; alpha in degrees.
_TABLE = [
    (10.0, -19.9979469048, -6.2546245939, 43.0919346755, -0.503277404, 2.302841483),
    (5.0, -22.6197208933, -2.6957964483, 42.1548805183, -0.571388029, 2.644765032),
    (0.0, -24.5533582793, 0.2463369416, 41.1463845145, -0.608084797, 2.817880763),
    (-5.0, -26.1412513568, 2.9306546844, 40.0499598491, -0.626080070, 2.906770423),
    (-10.0, -27.5120404108, 5.5096108358, 38.8417927517, -0.629451390, 2.936269602),
    (-30.0, -31.7923055025, 17.1505445732, 31.4811241060, -0.474942560, 2.349643082),
]
ANGLE = 0.5e-10  # half a unit of the last digit of the table
EIGENVALUE = 0.5e-9  # the same


def _at(system: LienardSystem, elevator_deg: float) -> tuple[list[float], list[Kind]]:
    points = equilibria(system, to_si(elevator_deg, "deg"))
    return [from_si(p.alpha_rad, "deg") for p in points], [p.kind for p in points]


@pytest.mark.parametrize("row", _TABLE, ids=lambda row: f"{row[0]} deg")
def test_the_table_of_the_paper(printed_system: LienardSystem, row: tuple[float, ...]) -> None:
    elevator, *expected, real, imaginary = row
    angles, kinds = _at(printed_system, elevator)
    np.testing.assert_allclose(angles, expected, rtol=0, atol=ANGLE)
    assert kinds == [Kind.SADDLE, Kind.STABLE_FOCUS, Kind.SADDLE]
    sink = equilibria(printed_system, to_si(elevator, "deg"))[1]
    np.testing.assert_allclose(sink.eigenvalues_real_1_s, real, rtol=0, atol=EIGENVALUE)
    np.testing.assert_allclose(sink.eigenvalues_imag_1_s, [imaginary, -imaginary], rtol=0, atol=EIGENVALUE)


def test_saddle_eigenvalues(printed_system: LienardSystem) -> None:
    left, _, right = equilibria(printed_system, 0.0)
    np.testing.assert_allclose(left.eigenvalues_real_1_s, [3.919704449, -3.405642128], rtol=0, atol=EIGENVALUE)
    np.testing.assert_allclose(right.eigenvalues_real_1_s, [5.467397774, -4.026698651], rtol=0, atol=EIGENVALUE)


@pytest.mark.parametrize(
    ("switch", "towards_fold"),
    [(14.7244434, 1.0), (-35.1290254, -1.0)],  # 7.7e-4° and 3.0e-4° inside the folds
)
def test_the_sink_is_a_node_only_next_to_the_folds(
    printed_system: LienardSystem, switch: float, towards_fold: float
) -> None:
    step = 1e-7  # one unit of the last digit of the reference
    assert _at(printed_system, switch - towards_fold * step)[1][1] == Kind.STABLE_FOCUS
    assert Kind.STABLE_NODE in _at(printed_system, switch + towards_fold * step)[1]


@pytest.mark.parametrize(("index", "outward"), [(0, 1.0), (1, -1.0)])
def test_next_to_a_fold_the_count_does_not_flip(printed_system: LienardSystem, index: int, outward: float) -> None:
    fold = folds(printed_system)[index]
    for distance_deg in (1e-9, 1e-7, 1e-3, 1.0):
        shift = to_si(distance_deg, "deg") * outward
        outside = equilibria(printed_system, fold.elevator_rad + shift)
        inside = equilibria(printed_system, fold.elevator_rad - shift)
        assert [p.kind for p in outside] == [Kind.SADDLE]
        assert len(inside) == 3
        pair = inside[:2] if index == 0 else inside[1:]
        assert {p.kind.stable for p in pair} == {True, False}
        # Two roads: near a fold the pair is 2 sqrt(2 c1 Δδ / g'') apart, to first order in their distance.
        bend = float(printed_system.force.derivative("alpha_rad").derivative("alpha_rad")(fold.alpha_rad))
        apart = 2.0 * math.sqrt(2.0 * printed_system.elevator_gain * shift / bend)
        assert pair[1].alpha_rad - pair[0].alpha_rad == pytest.approx(apart, rel=1e-3 + apart)


def test_on_a_fold_the_pair_is_one_degenerate_equilibrium(printed_system: LienardSystem) -> None:
    for fold in folds(printed_system):
        met = [p for p in equilibria(printed_system, fold.elevator_rad) if p.kind == Kind.DEGENERATE]
        assert [p.alpha_rad for p in met] == [pytest.approx(fold.alpha_rad, abs=1e-15)]
        np.testing.assert_array_equal(met[0].alpha_interval_rad, [-np.inf, np.inf])


def test_equilibria_rest_in_the_planar_field(paper_model: PolynomialModel) -> None:
    for elevator in (-0.5, 0.0, 0.2):
        for point in equilibria(reduce(paper_model), elevator):
            state = (point.alpha_rad, point.q_rad_s, elevator)
            assert paper_model.alpha_dot(*state) == pytest.approx(0.0, abs=1e-14)  # rounding of terms of size 10
            assert paper_model.q_dot(*state) == pytest.approx(0.0, abs=1e-13)
            jacobian = [
                [float(p.derivative(v)(*state)) for v in ("alpha_rad", "q_rad_s")]
                for p in (paper_model.alpha_dot, paper_model.q_dot)
            ]
            own = point.eigenvalues_real_1_s + 1j * point.eigenvalues_imag_1_s
            expected = np.linalg.eigvals(np.array(jacobian))
            np.testing.assert_allclose(np.sort_complex(own), np.sort_complex(expected), atol=1e-12)


@pytest.mark.parametrize(
    ("trace", "determinant", "kind"),
    [
        (-1.0, 5.0, Kind.STABLE_FOCUS),
        (-3.0, 1.0, Kind.STABLE_NODE),
        (1.0, 5.0, Kind.UNSTABLE_FOCUS),
        (3.0, 1.0, Kind.UNSTABLE_NODE),
        (-1.0, -1.0, Kind.SADDLE),
        (0.0, -1.0, Kind.SADDLE),
        (0.0, 1.0, Kind.DEGENERATE),
        (-1.0, 0.0, Kind.DEGENERATE),
        (0.0, 0.0, Kind.DEGENERATE),
    ],
)
def test_kinds(trace: float, determinant: float, kind: Kind) -> None:
    assert kind_of(trace, determinant) == kind
    real, imaginary = eigenvalues(trace, determinant)
    expected = np.linalg.eigvals(np.array([[0.0, 1.0], [-determinant, trace]]))
    np.testing.assert_allclose(
        np.sort_complex(np.array(real) + 1j * np.array(imaginary)), np.sort_complex(expected), atol=1e-14
    )
    assert kind.stable == (max(real) < 0.0)


def test_small_eigenvalue_is_not_lost_to_cancellation() -> None:
    (large, small), _ = eigenvalues(-1e9, 1.0)
    assert sorted((large, small), key=abs) == [pytest.approx(-1e-9, rel=1e-15), pytest.approx(-1e9, rel=1e-15)]


def test_a_center_is_degenerate(printed_system: LienardSystem) -> None:
    """Without damping the middle equilibrium is a center: neither stable nor unstable to first order."""
    still = replace(
        printed_system.damping,
        polynomial=replace(printed_system.damping.polynomial, coefficients=np.zeros(3)),
    )
    kinds = [p.kind for p in equilibria(replace(printed_system, damping=still), 0.0)]
    assert kinds == [Kind.SADDLE, Kind.DEGENERATE, Kind.SADDLE]


def test_intervals_are_the_scatter_of_samples(paper_model: PolynomialModel) -> None:
    errors = 0.003 * np.abs(paper_model.coefficients)
    points = equilibria(reduce(replace(paper_model, covariance=np.diag(errors**2))), -0.2)
    generator = np.random.default_rng(8)
    draws = paper_model.coefficients + generator.standard_normal((600, errors.size)) * errors
    samples = [[p.alpha_rad for p in equilibria(reduce(paper_model.with_coefficients(row)), -0.2)] for row in draws]
    halves = np.array([0.5 * np.diff(p.alpha_interval_rad)[0] for p in points])
    # The standard deviation of 600 draws is known to 2.9 %; four times that.
    np.testing.assert_allclose(1.959964 * np.std(samples, axis=0), halves, rtol=0.12)


def test_an_exact_model_has_intervals_of_no_width(paper_model: PolynomialModel) -> None:
    for point in equilibria(reduce(paper_model), 0.1):
        np.testing.assert_array_equal(point.alpha_interval_rad, [point.alpha_rad] * 2)


def test_no_force_at_all_is_refused(printed_system: LienardSystem) -> None:
    nothing = replace(
        printed_system.force, polynomial=replace(printed_system.force.polynomial, coefficients=np.zeros(4))
    )
    with pytest.raises(RefusedError, match="every point is a root"):
        equilibria(replace(printed_system, force=nothing), 0.0)
    assert equilibria(replace(printed_system, force=nothing), 0.1) == ()
    assert folds(replace(printed_system, force=nothing)) == ()


def test_a_system_checks_its_parts(printed_system: LienardSystem) -> None:
    with pytest.raises(InputError, match="rows of sensitivity"):
        replace(printed_system.force, sensitivity=np.zeros((2, 1)))
    with pytest.raises(InputError, match="do not fit a covariance"):
        replace(printed_system, covariance=np.zeros((3, 3)))
    with pytest.raises(InputError, match="curves in alpha_rad"):
        replace(printed_system, force=printed_system.pitch_rate)
    with pytest.raises(InputError, match="pitch rate is a curve"):
        replace(printed_system, pitch_rate=printed_system.force)
    with pytest.raises(InputError, match="domain"):
        replace(printed_system, domain=np.zeros((3, 2)))
    with pytest.raises(InputError, match="no single row"):
        _ = printed_system.pitch_rate.ascending

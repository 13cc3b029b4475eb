"""Hopf points and first Lyapunov coefficients of planar fields: published ones, and by roads of their own."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.hopf import Criticality
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.planar.branch import PlanarBranches, planar_branches
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.fold import PlanarFold
from finback.dynamics.planar.hopf import PlanarHopf
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial

_NAMES = ("x_1", "y_1", "mu_1")
Terms = dict[tuple[int, ...], float]


def _system(first: Terms, second: Terms) -> PlanarSystem:
    one, two = (Polynomial.build(t, variables=_NAMES, value_unit="1") for t in (first, second))
    return PlanarSystem.from_polynomials(one, two)


def _branches(
    system: PlanarSystem, parameters: tuple[float, float], box: tuple[tuple[float, float], tuple[float, float]]
) -> PlanarBranches:
    starts = [p for mu in np.linspace(*parameters, 4).tolist() for p in planar_equilibria(system, mu)]
    return planar_branches(system, parameters, np.array(box), starts)


def _derivative(polynomial: Polynomial, names: tuple[str, ...], at: FloatArray) -> float:
    for name in names:
        polynomial = polynomial.derivative(name)
    return float(polynomial(*at))


def guckenheimer_holmes(system: PlanarSystem, hopf: PlanarHopf) -> float:
    """Guckenheimer & Holmes (1983), Eq. 3.4.11, in coordinates where the linear part is a rotation.

    With s = (u, Re w u − Im w v) for the eigenvector (1, w), u is the first state and the amplitude is its own.
    """
    at = np.array([*hopf.state, hopf.parameter])
    names = system.variables[:2]
    polynomials = (system.first.polynomial, system.second.polynomial)
    (p, q), _ = jacobian = system.jacobian(hopf.state, hopf.parameter)
    omega = float(np.linalg.det(jacobian)) ** 0.5
    w = (1j * omega - p) / q
    change = np.array([[1.0, 0.0], [w.real, -w.imag]])
    back = np.linalg.inv(change)
    np.testing.assert_allclose(back @ jacobian @ change, [[0.0, -omega], [omega, 0.0]], atol=1e-10 * omega)

    def tensor(order: int) -> FloatArray:
        result = np.zeros((2,) * (order + 1))
        for index in np.ndindex(*result.shape):
            result[index] = _derivative(polynomials[index[0]], tuple(names[k] for k in index[1:]), at)
        letters = "abc"[:order]
        new = "xyz"[:order]
        rule = f"ki,i{letters}," + ",".join(f"{a}{b}" for a, b in zip(letters, new, strict=True)) + f"->k{new}"
        return np.einsum(rule, back, result, *([change] * order))

    (f, g), (f3, g3) = tensor(2), tensor(3)
    cubic = f3[0, 0, 0] + f3[0, 1, 1] + g3[0, 0, 1] + g3[1, 1, 1]
    mixed = f[0, 1] * (f[0, 0] + f[1, 1]) - g[0, 1] * (g[0, 0] + g[1, 1]) - f[0, 0] * g[0, 0] + f[1, 1] * g[1, 1]
    return float(cubic + mixed / omega) / 16.0


def test_van_der_pol() -> None:
    """Of x'' − (μ − x²) x' + x = 0: averaging gives r' = μ r/2 − r³/8 (Guckenheimer & Holmes 1983, section 4.1)."""
    system = _system({(0, 1, 0): 1.0}, {(0, 1, 1): 1.0, (2, 1, 0): -1.0, (1, 0, 0): -1.0})
    (hopf,) = _branches(system, (-0.7, 1.3), ((-1.0, 1.0), (-1.0, 1.0))).hopf_points
    assert abs(hopf.parameter) < 1e-14
    assert hopf.frequency == pytest.approx(1.0, abs=1e-14)
    assert hopf.lyapunov == pytest.approx(-0.125, abs=1e-14)
    assert hopf.crossing_speed == pytest.approx(0.5, abs=1e-14)
    assert hopf.criticality is Criticality.SUPERCRITICAL


def test_fitzhugh_nagumo() -> None:
    """The field v' = v − v³/3 − w + I, w' = ε (v + a − b w) (FitzHugh 1961, Nagumo et al. 1962), usual a, b, ε.

    The trace 1 − v² − b ε vanishes at v = ∓ sqrt(1 − b ε); the rest follows. With the first state v, whose second
    derivative is −2 v and third −2, and everything else linear, r' = a r³ has
    a = (−2 + 4 v² b / (1 − b² ε)) / 16: the formula of Kuznetsov or of Guckenheimer & Holmes, worked out.
    """
    a, b, eps = 0.7, 0.8, 0.08
    system = _system(
        {(1, 0, 0): 1.0, (3, 0, 0): -1.0 / 3.0, (0, 1, 0): -1.0, (0, 0, 1): 1.0},
        {(1, 0, 0): eps, (0, 0, 0): eps * a, (0, 1, 0): -eps * b},
    )
    found = _branches(system, (-0.5, 2.0), ((-3.0, 3.0), (-3.0, 4.0)))
    assert found.folds == ()
    for hopf, v in zip(found.hopf_points, (-((1 - b * eps) ** 0.5), (1 - b * eps) ** 0.5), strict=True):
        w = (v + a) / b
        np.testing.assert_allclose(hopf.state, [v, w], atol=1e-14)
        assert hopf.parameter == pytest.approx(w - v + v**3 / 3.0, abs=1e-13)
        assert hopf.frequency == pytest.approx((eps - (b * eps) ** 2) ** 0.5, abs=1e-14)
        assert hopf.lyapunov == pytest.approx((-2.0 + 4.0 * v * v * b / (1.0 - b * b * eps)) / 16.0, rel=1e-12)
        assert hopf.lyapunov == pytest.approx(guckenheimer_holmes(system, hopf), rel=1e-11)
        assert hopf.criticality is Criticality.SUBCRITICAL
    # To the four digits in which it is usually quoted for these a, b, ε.
    assert found.hopf_points[0].parameter == pytest.approx(0.3313, abs=5e-5)


def test_rosenzweig_and_macarthur() -> None:
    """Kuznetsov (2004), Example 3.1, multiplied by (α + x), which moves no equilibrium and no Hopf point.

    x' = r x (α + x)(1 − x) − c x y, y' = −α d y + (c − d) x y: the Hopf point is at α = (c − d)/(c + d).
    """
    r, c, d = 1.3, 2.0, 0.7
    system = _system(
        {(1, 0, 1): r, (2, 0, 1): -r, (2, 0, 0): r, (3, 0, 0): -r, (1, 1, 0): -c},
        {(0, 1, 1): -d, (1, 1, 0): c - d},
    )
    found = _branches(system, (0.1, 1.0), ((0.01, 1.5), (0.01, 2.0)))
    (hopf,) = found.hopf_points
    alpha = (c - d) / (c + d)
    x = alpha * d / (c - d)
    y = r / c * (alpha + x) * (1.0 - x)
    assert hopf.parameter == pytest.approx(alpha, abs=1e-13)
    np.testing.assert_allclose(hopf.state, [x, y], atol=1e-13)
    assert hopf.frequency == pytest.approx((c * x * (c - d) * y) ** 0.5, abs=1e-13)
    assert hopf.lyapunov == pytest.approx(guckenheimer_holmes(system, hopf), rel=1e-10)
    assert hopf.criticality is Criticality.SUPERCRITICAL  # as Kuznetsov finds: a unique stable cycle
    assert hopf.crossing_speed < 0.0


def test_bazykin() -> None:
    """Bazykin (1985; Kuznetsov 2004, section 8.4.3): x' = x − x y/(1+αx) − ε x², y' = −γ y + x y/(1+αx) − δ y².

    Multiplied by 1 + αx. At α = 0.1, γ = 1, ε = 0.01 over δ the positive equilibrium is Hopf where the trace
    vanishes; the place is found anew by Newton's method in 40 digits, with derivatives by hand.
    """
    al, ga, ep = 0.1, 1.0, 0.01
    system = _system(
        {(1, 0, 0): 1.0, (2, 0, 0): al - ep, (3, 0, 0): -al * ep, (1, 1, 0): -1.0},
        {(0, 1, 0): -ga, (1, 1, 0): 1.0 - ga * al, (0, 2, 1): -1.0, (1, 2, 1): -al},
    )
    found = _branches(system, (0.001, 0.9), ((0.05, 200.0), (0.05, 40.0)))
    assert found.hopf_points
    first, second = (_exact(curve.polynomial) for curve in (system.first, system.second))
    for hopf in found.hopf_points:
        place = _newton(first, second, hopf.state.tolist(), hopf.parameter, determinant=False)
        np.testing.assert_allclose([*hopf.state, hopf.parameter], place, rtol=1e-12)
        assert hopf.lyapunov == pytest.approx(guckenheimer_holmes(system, hopf), rel=1e-8)


Exact = dict[tuple[int, int, int], Decimal]


def _exact(polynomial: Polynomial) -> Exact:
    rows = zip(polynomial.powers.tolist(), polynomial.coefficients.tolist(), strict=True)
    return {(i, j, k): Decimal(c) for (i, j, k), c in rows}


def _slope(terms: Exact, by: int) -> Exact:
    result: Exact = {}
    for powers, c in terms.items():
        if powers[by]:
            lower = list(powers)
            lower[by] -= 1
            result[lower[0], lower[1], lower[2]] = c * powers[by]
    return result


def _value(terms: Exact, at: list[Decimal]) -> Decimal:
    total = Decimal(0)
    for powers, c in terms.items():
        for x, power in zip(at, powers, strict=True):
            if power:
                c *= x**power  # noqa: PLW2901 - the running product of this term
        total += c
    return total


def _newton(first: Exact, second: Exact, state: list[float], parameter: float, *, determinant: bool) -> list[float]:
    """Solve P = Q = 0 and det J = 0 (or trace J = 0) in 40 digits from a rough place (three digits of it)."""
    with localcontext() as context:
        context.prec = 40
        at = [Decimal(f"{v:.3g}") for v in (*state, parameter)]

        def values(place: list[Decimal]) -> list[Decimal]:
            p, q, r, s = (_value(_slope(terms, by), place) for terms in (first, second) for by in (0, 1))
            return [_value(first, place), _value(second, place), p * s - q * r if determinant else p + s]

        step = Decimal("1e-15")
        for _ in range(30):
            here = values(at)
            columns = []
            for k in range(3):
                ends = []
                for sign in (-1, 1):
                    moved = list(at)
                    moved[k] += sign * step
                    ends.append(values(moved))
                columns.append([(b - a) / (2 * step) for a, b in zip(*ends, strict=True)])
            at = [x - d for x, d in zip(at, _cramer(columns, here), strict=True)]
        return [float(x) for x in at]


def _cramer(columns: list[list[Decimal]], right: list[Decimal]) -> list[Decimal]:
    def volume(a: list[Decimal], b: list[Decimal], c: list[Decimal]) -> Decimal:
        return (
            a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        )

    whole = volume(*columns)
    return [volume(*(right if j == k else c for j, c in enumerate(columns))) / whole for k in range(3)]  # type: ignore[arg-type]


def short_period() -> PolynomialModel:
    """A short-period model with αq, α²q, αδ and δ² terms, which no Liénard form holds; made up, of aircraft size."""
    alpha_dot = Polynomial.build(
        {
            (0, 0, 0): 0.01, (1, 0, 0): -0.6, (2, 0, 0): -0.4, (3, 0, 0): 3.0, (0, 1, 0): 1.0,
            (1, 1, 0): -0.3, (2, 1, 0): 0.5, (0, 0, 1): -0.05, (1, 0, 1): 0.1,
        },
        variables=VARIABLES,
        value_unit="rad_s",
    )  # fmt: skip
    q_dot = Polynomial.build(
        {
            (0, 0, 0): 0.02, (1, 0, 0): -6.0, (2, 0, 0): -3.0, (3, 0, 0): 18.0, (0, 1, 0): -0.8,
            (1, 1, 0): 2.5, (2, 1, 0): 3.0, (0, 0, 1): -5.0, (1, 0, 1): 1.5, (0, 0, 2): 0.8,
        },
        variables=VARIABLES,
        value_unit="rad_s2",
    )  # fmt: skip
    theta = np.concatenate([alpha_dot.coefficients, q_dot.coefficients])
    return PolynomialModel(alpha_dot=alpha_dot, q_dot=q_dot, covariance=np.diag((0.002 * theta) ** 2))


def _found(system: PlanarSystem) -> PlanarBranches:
    return _branches(system, (-0.8, 0.6), ((-0.8, 0.8), (-3.0, 3.0)))


def test_a_short_period_model_with_products_of_states() -> None:
    """Two roads: Newton's method in 40 digits, with none of the product's code."""
    system = PlanarSystem.from_model(short_period())
    found = _found(system)
    assert found.hopf_points
    assert found.folds
    first, second = (_exact(curve.polynomial) for curve in (system.first, system.second))
    points: list[tuple[PlanarHopf | PlanarFold, bool]] = [(h, False) for h in found.hopf_points]
    points += [(f, True) for f in found.folds]
    for point, fold in points:
        place = _newton(first, second, point.state.tolist(), point.parameter, determinant=fold)
        np.testing.assert_allclose([*point.state, point.parameter], place, rtol=0, atol=1e-13)
    for hopf in found.hopf_points:
        assert hopf.lyapunov == pytest.approx(guckenheimer_holmes(system, hopf), rel=1e-10)


def test_the_cycle_that_is_born_has_the_amplitude_foretold() -> None:
    """Two roads: long integration just past a supercritical point; r² = −d (μ − μ₀)/a, up to the next order."""
    system = _system(
        {(0, 1, 0): 1.0, (1, 0, 1): 1.0, (2, 0, 0): 0.6, (1, 1, 0): -0.3},
        {(1, 0, 0): -2.0, (0, 1, 0): -0.1, (2, 0, 0): 0.4, (3, 0, 0): -0.7, (2, 1, 0): -0.9, (1, 1, 0): 0.5},
    )
    (hopf,) = _branches(system, (-0.4, 0.6), ((-0.4, 0.4), (-0.4, 0.4))).hopf_points
    assert hopf.criticality is Criticality.SUPERCRITICAL
    beyond = hopf.parameter + 1e-3 * np.sign(hopf.crossing_speed)
    foretold = (-hopf.crossing_speed * (beyond - hopf.parameter) / hopf.lyapunov) ** 0.5
    (rest,) = (p for p in planar_equilibria(system, beyond) if np.abs(p.state - hopf.state).max() < 1e-2)
    time = 4.0 / abs(hopf.crossing_speed * (beyond - hopf.parameter))

    def rates(_: float, state: FloatArray) -> tuple[float, float]:
        x, y = state.tolist()
        return (
            y + beyond * x + 0.6 * x * x - 0.3 * x * y,
            -2.0 * x - 0.1 * y + 0.4 * x * x - 0.7 * x**3 - 0.9 * x * x * y + 0.5 * x * y,
        )

    start = rest.state + np.array([foretold, 0.0])
    flown = solve_ivp(rates, (0.0, time), start, method="DOP853", rtol=1e-8, atol=1e-11)
    ending = solve_ivp(
        rates, (0.0, 4.0 * np.pi / hopf.frequency), flown.y[:, -1], method="DOP853", rtol=1e-9, max_step=0.01
    )
    assert 0.5 * np.ptp(ending.y[0]) == pytest.approx(foretold, rel=2e-2)


@settings(deadline=None, max_examples=12)
@given(
    st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.3, 3.0), st.sampled_from([-1.0, 1.0]), st.floats(0.2, 5.0)
)
def test_criticality_does_not_depend_on_the_coordinates(
    shear: float, other: float, stretch: float, mirror: float, time: float
) -> None:
    """Any linear change of the states, and any unit of time, keeps place, frequency and the sign of a."""
    model = short_period()
    system = PlanarSystem.from_model(model)
    first, second = system.first.polynomial, system.second.polynomial
    change = np.array([[1.0, shear], [other, 1.0 + shear * other]]) @ np.diag([stretch, mirror])
    back = np.linalg.inv(change)
    moved = []
    tables = [_substituted(p, change) for p in (first, second)]
    for row in back:
        total: Terms = {}
        for weight, table in zip(row.tolist(), tables, strict=True):
            for powers, c in table.items():
                total[powers] = total.get(powers, 0.0) + weight * c / time
        moved.append(total)
    turned = _system(*moved)
    for hopf in _found(system).hopf_points:
        new = back @ hopf.state
        wide = 1e-2 * (1.0 + np.abs(new))
        box = ((new[0] - wide[0], new[0] + wide[0]), (new[1] - wide[1], new[1] + wide[1]))
        (same,) = _branches(turned, (hopf.parameter - 1e-3, hopf.parameter + 1e-3), box).hopf_points
        assert same.parameter == pytest.approx(hopf.parameter, abs=1e-9)
        assert same.frequency == pytest.approx(hopf.frequency / time, rel=1e-8)
        assert same.criticality == hopf.criticality
        # The amplitude of the first state: |change row 0 · eigenvector| turns one into the other.
        jacobian = turned.jacobian(same.state, same.parameter)
        w = (1j * same.frequency - jacobian[0, 0]) / jacobian[0, 1]
        factor = abs(change[0] @ np.array([1.0, w]))
        assert same.lyapunov == pytest.approx(hopf.lyapunov / time * factor**2, rel=1e-6)


def _substituted(polynomial: Polynomial, change: FloatArray) -> Terms:
    """Return p(A (x, y), μ) by multiplying out."""
    total: Terms = {}
    for (i, j, k), c in zip(polynomial.powers.tolist(), polynomial.coefficients.tolist(), strict=True):
        row = np.array([c])
        for factor in [change[0]] * i + [change[1]] * j:
            row = np.convolve(row, factor)
        for power, value in enumerate(row.tolist()):
            key = (i + j - power, power, k)
            total[key] = total.get(key, 0.0) + value
    return total


def test_intervals_are_the_scatter_of_samples() -> None:
    model = short_period()
    system = PlanarSystem.from_model(model)
    found = _found(system)
    generator = np.random.default_rng(11)
    errors = np.sqrt(np.diag(model.covariance))
    draws = model.coefficients + generator.standard_normal((60, errors.size)) * errors
    hopfs, turns = [], []
    for row in draws:
        other = _found(system.with_coefficients(row))
        assert len(other.hopf_points) == len(found.hopf_points)
        assert len(other.folds) == len(found.folds)
        hopfs.append([[h.parameter, *h.state, h.frequency, h.lyapunov] for h in other.hopf_points])
        turns.append([[f.parameter, *f.state] for f in other.folds])
    halves = [
        [
            0.5 * np.ptp(interval)
            for interval in (h.parameter_interval, *h.state_interval, h.frequency_interval, h.lyapunov_interval)
        ]
        for h in found.hopf_points
    ]
    # The standard deviation of 60 draws is known to 9.1 %; four times that.
    np.testing.assert_allclose(1.959964 * np.std(hopfs, axis=0), halves, rtol=0.36)
    halves = [[0.5 * np.ptp(interval) for interval in (f.parameter_interval, *f.state_interval)] for f in found.folds]
    np.testing.assert_allclose(1.959964 * np.std(turns, axis=0), halves, rtol=0.36)


def test_a_bautin_point_is_neither_super_nor_subcritical() -> None:
    """Negative control of the sign: in x'' = (μ + k x² − x⁴) x' − x the coefficient is k/8; at k = 0 it vanishes."""
    for k, expected in (
        (1e-6, Criticality.SUBCRITICAL),
        (0.0, Criticality.DEGENERATE),
        (-1e-6, Criticality.SUPERCRITICAL),
    ):
        system = _system({(0, 1, 0): 1.0}, {(0, 1, 1): 1.0, (2, 1, 0): k, (4, 1, 0): -1.0, (1, 0, 0): -1.0})
        (hopf,) = _branches(system, (-0.7, 1.3), ((-1.0, 1.0), (-1.0, 1.0))).hopf_points
        assert hopf.criticality is expected
        assert hopf.lyapunov == pytest.approx(k / 8.0, abs=1e-15)

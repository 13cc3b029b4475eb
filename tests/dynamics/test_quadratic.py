"""The quadratic systems of Shi & Fan 2013, Eq. 13-16."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from finback.dynamics.cycle.lyapunov import lyapunov_coefficients
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import rests
from finback.dynamics.hopf import Criticality
from finback.dynamics.normal_form.bogdanov_takens import (
    BogdanovTakensRegion,
    Unfolding,
    fold_nature,
    homoclinic_estimate,
    hopf_point,
    region,
    unfolding,
)
from finback.dynamics.normal_form.nature import Nature
from finback.dynamics.normal_form.quadratic import Quadratic, QuadraticCase, quadratic_normal_form
from finback.dynamics.normal_form.quadratic_center import ClosedOrbits, center, first_integral, line_of_equilibria
from finback.errors import InputError, RefusedError

_ROUNDING = 1e-12  # some dozens of operations on numbers up to 1e3

_number = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))
_nonzero = _number.filter(lambda value: abs(value) >= 0.1)


def _assert_same_field(one: tuple[float, ...], other: tuple[float, ...]) -> None:
    size = max(len(one), len(other))
    padded = [np.pad(np.array(row), (0, size - len(row))) for row in (one, other)]
    scale = 1.0 + np.abs(padded[0]).max()
    np.testing.assert_allclose(padded[0], padded[1], rtol=_ROUNDING, atol=_ROUNDING * scale)


@given(_number, _number, _number, _number, _number)
def test_the_normal_form_is_the_same_field(a1: float, a0: float, b2: float, b1: float, b0: float) -> None:
    assume(a1 or b2)
    assume(all(c == 0.0 or abs(c) >= 0.1 for c in (a1, b2, b1, b0)))
    system = Quadratic(a1=a1, a0=a0, b2=b2, b1=b1, b0=b0)
    form = quadratic_normal_form(system)
    moved = form.rescaling.flow(system.flow())
    _assert_same_field(moved.damping, form.normal.flow().damping)
    # Of the order of b1^6/(a1 b0)^2 in the worst case: the scale of what was summed.
    tolerance = _ROUNDING * max(1.0, *moved.force_sizes)
    np.testing.assert_allclose(moved.force, form.normal.flow().force, rtol=_ROUNDING, atol=tolerance)
    assert form.case is system.case
    back = form.rescaling.inverse().flow(form.normal.flow())
    sizes = np.abs(form.rescaling.inverse().flow(form.normal.flow()).force_sizes).max()
    np.testing.assert_allclose(back.force, system.flow().force, rtol=1e-9, atol=1e-9 * (1.0 + sizes))


def test_the_cases_and_their_normal_forms() -> None:
    bt = quadratic_normal_form(Quadratic(a1=-2.0, a0=0.3, b2=3.0, b1=1.2, b0=-0.4))
    assert bt.case is QuadraticCase.BOGDANOV_TAKENS
    assert bt.rescaling.reverses_time  # b/a < 0
    assert (bt.normal.a1, bt.normal.b2, bt.normal.b1) == (1.0, 1.0, 0.0)
    mu1, mu2 = -0.4 - 1.2**2 / 12.0, 0.3 + 2.0 * 0.2
    assert bt.normal.b0 == pytest.approx(mu1 * 16.0 / 27.0, rel=_ROUNDING)
    assert bt.normal.a0 == pytest.approx(mu2 * -2.0 / 3.0, rel=_ROUNDING)
    constant = quadratic_normal_form(Quadratic(a1=0.0, a0=0.3, b2=-3.0, b1=1.2, b0=-0.4))
    assert constant.case is QuadraticCase.CONSTANT_DIVERGENCE
    assert constant.normal == Quadratic(a1=0.0, a0=0.3, b2=1.0, b1=0.0, b0=constant.normal.b0)
    linear = quadratic_normal_form(Quadratic(a1=2.0, a0=0.3, b2=0.0, b1=-4.0, b0=1.0))
    assert linear.case is QuadraticCase.LINEAR_FORCE
    # mu = a0 - a1 b0/b1 = 0.8, in units of sqrt(-b1) = 2
    assert linear.normal == Quadratic(a1=1.0, a0=linear.normal.a0, b2=0.0, b1=-1.0, b0=0.0)
    assert linear.normal.a0 == pytest.approx(0.4, rel=_ROUNDING)
    pushed = quadratic_normal_form(Quadratic(a1=2.0, a0=0.3, b2=0.0, b1=0.0, b0=-4.0))
    assert pushed.normal == Quadratic(a1=1.0, a0=0.0, b2=0.0, b1=0.0, b0=1.0)
    assert pushed.rescaling.reverses_time
    free = quadratic_normal_form(Quadratic(a1=2.0, a0=0.3, b2=0.0, b1=0.0, b0=0.0))
    assert free.normal == Quadratic(a1=1.0, a0=0.0, b2=0.0, b1=0.0, b0=0.0)


def test_what_is_no_quadratic_system_is_refused() -> None:
    with pytest.raises(InputError, match="linear"):
        Quadratic(a1=0.0, a0=1.0, b2=0.0, b1=1.0, b0=0.0)
    with pytest.raises(InputError, match="finite"):
        Quadratic(a1=math.nan, a0=1.0, b2=0.0, b1=1.0, b0=0.0)
    with pytest.raises(InputError, match="finite"):
        Unfolding(mu1=math.inf, mu2=0.0)
    with pytest.raises(InputError, match="must not vanish"):
        Unfolding(mu1=-1.0, mu2=0.0, a=0.0)
    with pytest.raises(InputError, match="must not vanish"):
        unfolding(Quadratic(a1=0.0, a0=1.0, b2=1.0, b1=1.0, b0=0.0))
    for function in (hopf_point, homoclinic_estimate):
        with pytest.raises(InputError, match="no two equilibria"):
            function(Unfolding(mu1=1.0, mu2=0.0))


# --- Bogdanov-Takens ---------------------------------------------------------------------------------------------


@given(_nonzero, _number, _nonzero, _number, _number)
def test_the_unfolding_keeps_equilibria_and_trace(a1: float, a0: float, b2: float, b1: float, b0: float) -> None:
    system = Quadratic(a1=a1, a0=a0, b2=b2, b1=b1, b0=b0)
    moved, shift = unfolding(system)
    flow = shift.flow(system.flow())
    _assert_same_field(flow.damping, moved.flow().damping)
    _assert_same_field(flow.force, moved.flow().force)
    normal, scale = moved.normal()
    assert (normal.a, normal.b) == (1.0, 1.0)
    _assert_same_field(scale.flow(moved.flow()).damping, normal.flow().damping)
    np.testing.assert_allclose(scale.flow(moved.flow()).force, normal.flow().force, rtol=1e-11, atol=1e-13)
    direct = quadratic_normal_form(system).normal
    assert (direct.b0, direct.a0) == (
        pytest.approx(normal.mu1, rel=1e-12),
        pytest.approx(normal.mu2, rel=1e-12),
    )


def test_equilibria_of_the_normal_form() -> None:
    """mu1 > 0 none, mu1 < 0 a saddle at +sqrt(-mu1) and a focus or node at −sqrt(-mu1) (G&H 1983, section 7.3)."""
    assert rests(Unfolding(mu1=0.1, mu2=0.0).flow()) == ()
    left, right = rests(Unfolding(mu1=-0.04, mu2=0.1).flow())
    assert (left.x, right.x) == (pytest.approx(-0.2), pytest.approx(0.2))
    assert (left.kind, right.kind) == (Kind.STABLE_FOCUS, Kind.SADDLE)
    assert rests(Unfolding(mu1=-0.04, mu2=0.3).flow())[0].kind is Kind.UNSTABLE_FOCUS
    assert fold_nature(Unfolding(mu1=0.0, mu2=0.1)) is Nature.SADDLE_NODE
    assert fold_nature(Unfolding(mu1=0.0, mu2=0.0)) is Nature.CUSP


@given(_nonzero, _nonzero, st.floats(0.01, 2.0))
def test_the_hopf_point_by_two_roads(a: float, b: float, size: float) -> None:
    """Eigenvalues and Lyapunov coefficient from the general theory of Liénard flows."""
    system = Unfolding(mu1=-math.copysign(size, a), mu2=0.0, a=a, b=b)
    hopf = hopf_point(system)
    assert hopf.mu2 == pytest.approx(b * math.copysign(1.0, a) * math.sqrt(size / abs(a)), rel=_ROUNDING)
    flow = Unfolding(mu1=system.mu1, mu2=hopf.mu2, a=a, b=b).flow()
    assert hopf.mu2 + b * hopf.x == 0.0
    assert flow.acceleration(hopf.x, 0.0) == pytest.approx(0.0, abs=_ROUNDING)
    assert hopf.frequency**2 == pytest.approx(-2.0 * a * hopf.x, rel=_ROUNDING)
    first, _ = lyapunov_coefficients(flow.damping, flow.force, hopf.x)
    assert hopf.first == pytest.approx(first, rel=_ROUNDING)
    assert (hopf.criticality is Criticality.SUBCRITICAL) == (a * b > 0.0)


def _loop_mu2(mu1: float) -> float:
    """Shoot: where the unstable manifold of the saddle turns against where the stable one does (DOP853)."""
    saddle = math.sqrt(-mu1)

    def turn(mu2: float, *, stable: bool) -> float:
        trace, slope = mu2 + saddle, 2.0 * saddle
        value = 0.5 * trace + (-1.0 if stable else 1.0) * math.sqrt(0.25 * trace * trace + slope)
        step = 1e-7 * saddle  # the manifold bends by its square
        start = [saddle - step, -step * value]

        def crossing(_: float, s: np.ndarray) -> float:
            return float(s[1])

        crossing.terminal = True  # type: ignore[attr-defined]
        end = solve_ivp(
            lambda _, s: [s[1], mu1 + mu2 * s[1] + s[0] ** 2 + s[0] * s[1]],
            (0.0, -1e3 if stable else 1e3),
            start,
            method="DOP853",
            events=crossing,
            rtol=1e-12,
            atol=1e-15,
        )
        return float(end.y_events[0][0][0])

    first = 5.0 / 7.0 * saddle
    low, high = 0.99 * first, min(1.1 * first, 0.999 * saddle)
    return float(brentq(lambda mu2: turn(mu2, stable=False) - turn(mu2, stable=True), low, high, xtol=1e-13))


def test_the_homoclinic_estimate_approaches_the_loop_at_its_order() -> None:
    """The loop at mu1 = −0.1: 0.2288528176297, an independent value (Taylor shooting in two precisions)."""
    exact = [_loop_mu2(mu1) for mu1 in (-0.1, -0.1 / 16.0, -0.1 / 256.0)]
    assert exact[0] == pytest.approx(0.2288528176297, abs=1e-10)
    guess = [homoclinic_estimate(Unfolding(mu1=mu1, mu2=0.0)) for mu1 in (-0.1, -0.1 / 16.0, -0.1 / 256.0)]
    errors = [abs(estimate.value - value) for estimate, value in zip(guess, exact, strict=True)]
    # The next term is ε⁶: 64 times less for half the ε, up to the term after it.
    assert errors[0] < 3e-5
    assert 40.0 < errors[0] / errors[1] < 80.0
    assert 50.0 < errors[1] / errors[2] < 75.0
    assert guess[0].order.startswith("O(eps^6)")
    assert homoclinic_estimate(Unfolding(mu1=-9.0, mu2=0.0)).caution  # eps is not small


@given(_nonzero, _nonzero, st.floats(0.01, 0.5))
def test_the_homoclinic_estimate_commutes_with_scaling(a: float, b: float, size: float) -> None:
    mu1 = -math.copysign(size, a)
    scaled, _ = Unfolding(mu1=mu1, mu2=0.0, a=a, b=b).normal()
    direct = homoclinic_estimate(Unfolding(mu1=mu1, mu2=0.0, a=a, b=b)).value
    assert direct * b / a == pytest.approx(homoclinic_estimate(scaled).value, rel=_ROUNDING)
    # To first order it is 5/7 of the Hopf point's.
    ratio = direct / hopf_point(Unfolding(mu1=mu1, mu2=0.0, a=a, b=b)).mu2
    assert ratio == pytest.approx(5.0 / 7.0 + 72.0 / 2401.0 * math.sqrt(-scaled.mu1), rel=_ROUNDING)


def test_regions_of_the_unfolding() -> None:
    mu1, loop = -0.1, 0.2288528176297
    names = [
        (0.1, BogdanovTakensRegion.SINK),
        (loop, BogdanovTakensRegion.BORDER),
        (0.27, BogdanovTakensRegion.CYCLE),
        (0.4, BogdanovTakensRegion.SOURCE),
    ]
    for mu2, expected in names:
        assert region(Unfolding(mu1=mu1, mu2=mu2), loop) is expected
    assert region(Unfolding(mu1=0.1, mu2=0.1), math.nan) is BogdanovTakensRegion.NO_EQUILIBRIUM
    assert region(Unfolding(mu1=0.0, mu2=0.1), math.nan) is BogdanovTakensRegion.BORDER
    # mirrored and reversed: a supercritical Hopf point, the stable cycle at larger mu2
    system = Unfolding(mu1=mu1, mu2=-0.27, b=-1.0)
    assert region(system, -loop) is BogdanovTakensRegion.CYCLE
    assert hopf_point(system).criticality is Criticality.SUPERCRITICAL


def test_the_unstable_cycle_lies_between_loop_and_hopf_point() -> None:
    """At the middle of the strip an orbit near the focus spirals in, one near the saddle escapes."""

    def escapes(mu2: float, x: float) -> bool:
        def gone(_: float, s: np.ndarray) -> float:
            return float(np.hypot(*s)) - 3.0

        gone.terminal = True  # type: ignore[attr-defined]
        end = solve_ivp(
            lambda _, s: [s[1], -0.1 + mu2 * s[1] + s[0] ** 2 + s[0] * s[1]],
            (0.0, 300.0),
            [x, 0.0],
            events=gone,
            rtol=1e-8,
            atol=1e-10,
        )
        return end.status == 1

    focus, saddle = -math.sqrt(0.1), math.sqrt(0.1)
    middle = 0.5 * (0.2288528176297 + hopf_point(Unfolding(mu1=-0.1, mu2=0.0)).mu2)
    assert not escapes(middle, focus + 0.05)
    assert escapes(middle, saddle - 0.01)
    assert escapes(0.35, focus + 0.05)  # above the Hopf point the focus is a source
    assert not escapes(0.2, saddle - 0.01)  # below the loop everything inside falls in


# --- the systems without limit cycles ------------------------------------------------------------------------------


def _orbit(system: Quadratic, start: tuple[float, float], span: float) -> np.ndarray:
    flow = system.flow()
    end = solve_ivp(
        lambda _, s: [s[1], flow.acceleration(s[0], s[1])], (0.0, span), start, method="DOP853", rtol=1e-11, atol=1e-13
    )
    return np.asarray(end.y)


@pytest.mark.parametrize(
    ("system", "start"),
    [
        (Quadratic(a1=0.0, a0=0.0, b2=2.0, b1=0.4, b0=-0.5), (-0.4, 0.1)),
        (Quadratic(a1=0.7, a0=0.7 * 0.25, b2=0.0, b1=-2.0, b0=-0.5), (0.1, 0.3)),
        (Quadratic(a1=0.7, a0=0.1, b2=0.0, b1=0.0, b0=0.0), (-0.1, 0.3)),
    ],
)
def test_first_integrals_are_constant(system: Quadratic, start: tuple[float, float]) -> None:
    path = _orbit(system, start, 4.0)
    values = first_integral(system, path[0], path[1])
    assert np.ptp(path[0]) > 0.05
    np.testing.assert_allclose(values, values[0], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("system", "sign"),
    [
        (Quadratic(a1=0.0, a0=-0.2, b2=2.0, b1=0.4, b0=-0.5), -1),
        (Quadratic(a1=0.0, a0=0.2, b2=2.0, b1=0.4, b0=-0.5), 1),
        (Quadratic(a1=0.7, a0=0.3, b2=0.0, b1=-2.0, b0=-0.5), 1),  # mu = 0.125 > 0 and a1 y + b1 < 0
        (Quadratic(a1=0.7, a0=0.0, b2=0.0, b1=-2.0, b0=-0.5), -1),
    ],
)
def test_off_the_center_the_first_integral_changes_one_way(system: Quadratic, sign: int) -> None:
    """Why there is no limit cycle: the integral never comes back to its value."""
    path = _orbit(system, (-0.3, 0.1), 4.0)
    change = np.diff(first_integral(system, path[0], path[1])) * sign
    assert (change > -1e-12).all()
    assert change.sum() > 1e-4


def test_which_closed_orbits_there_are() -> None:
    """Errata E4: at one value of the parameter a whole annulus, at any other none."""

    def of(a1: float, a0: float, b2: float, b1: float, b0: float) -> ClosedOrbits:
        return center(Quadratic(a1=a1, a0=a0, b2=b2, b1=b1, b0=b0)).closed_orbits

    assert of(0.0, 0.0, 1.0, 0.0, -0.1) is ClosedOrbits.ANNULUS_TO_LOOP
    assert of(0.0, 0.0, -1.0, 0.0, 0.1) is ClosedOrbits.ANNULUS_TO_LOOP
    assert of(0.0, 0.0, 1.0, 0.0, 0.1) is ClosedOrbits.NONE_TO_SURROUND
    assert of(0.0, 1e-9, 1.0, 0.0, -0.1) is ClosedOrbits.NONE_CONSTANT_DIVERGENCE
    assert of(2.0, 1.0, 0.0, -4.0, -2.0) is ClosedOrbits.CENTER  # mu = 1 − 2 · 2/4
    assert of(2.0, 1.0 + 1e-15, 0.0, -4.0, -2.0) is ClosedOrbits.NONE_MONOTONE
    assert of(2.0, 1.0, 0.0, 4.0, -2.0) is ClosedOrbits.NONE_TO_SURROUND
    assert of(2.0, 1.0, 0.0, 0.0, -2.0) is ClosedOrbits.NONE_TO_SURROUND
    assert line_of_equilibria(Quadratic(a1=2.0, a0=1.0, b2=0.0, b1=0.0, b0=0.0))
    assert not line_of_equilibria(Quadratic(a1=2.0, a0=1.0, b2=0.0, b1=0.0, b0=1.0))
    found = center(Quadratic(a1=2.0, a0=1.5, b2=0.0, b1=-4.0, b0=-2.0))
    assert found.mu2 == 0.5
    assert rests(Quadratic(a1=2.0, a0=1.5, b2=0.0, b1=-4.0, b0=-2.0).flow())[0].kind is Kind.UNSTABLE_FOCUS
    with pytest.raises(InputError, match="limit cycles"):
        center(Quadratic(a1=2.0, a0=1.0, b2=1.0, b1=0.0, b0=1.0))
    with pytest.raises(InputError, match="limit cycles"):
        first_integral(Quadratic(a1=2.0, a0=1.0, b2=1.0, b1=0.0, b0=1.0), 0.0, 0.0)
    with pytest.raises(RefusedError, match="elementary"):
        first_integral(Quadratic(a1=2.0, a0=1.0, b2=0.0, b1=0.0, b0=1.0), 0.0, 0.0)


@settings(max_examples=30)
@given(_nonzero, st.floats(0.2, 2.0), _number)
def test_the_center_of_a_linear_force_closes_its_orbits(a1: float, stiffness: float, b0: float) -> None:
    """Half a turn from u lands on the same level: V has equal values, whatever the size of the orbit."""
    centered = Quadratic(a1=a1, a0=-a1 * b0 / stiffness, b2=0.0, b1=-stiffness, b0=b0)
    rest = b0 / stiffness
    assert abs(center(centered).mu2) < 1e-12
    amplitude = 0.3
    levels = first_integral(centered, np.array([rest - amplitude, rest + amplitude]), np.zeros(2))
    assert levels[0] == pytest.approx(levels[1], abs=1e-12)

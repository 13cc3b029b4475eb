"""The general reduction, with moving inputs, against the planar field, the paper's own formulas, and held inputs."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.arrays import FloatArray
from finback.dynamics.lienard_form import lienard_form
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import PaperForm, from_paper, reduce
from finback.errors import InputError, RefusedError
from finback.units import from_si, si_factor, to_si

INPUTS = ("canard_rad", "beta_rad", "p_rad_s", "r_rad_s")
ROUNDING = 1e-13  # a few hundred roundings, relative to the size of what is compared

_small = st.floats(-2.0, 2.0)
_some = st.lists(_small, min_size=1, max_size=5).map(
    lambda row: tuple(value * si_factor("deg") ** (k - 1) for k, value in enumerate(row))
)
_nonzero = st.floats(0.1, 2.0) | st.floats(-2.0, -0.1)


@st.composite
def forms(draw: st.DrawFn) -> PaperForm:
    return PaperForm(
        C_zq=draw(st.floats(0.3, 1.5)) - 1.0,
        C_z=draw(_some),
        C_zde=draw(_small),
        M_zq=draw(_small),
        M_zad=draw(_small),
        M_z=draw(_some),
        M_zde=draw(_small),
        C_zdc=draw(_nonzero),
        M_zdc=draw(_nonzero),
        C_zab=draw(_nonzero) * si_factor("deg"),
        f_pr=draw(_nonzero),
        f_rr=draw(_nonzero),
    )


def _moving(t: float) -> tuple[dict[str, float], dict[str, float]]:
    """All inputs as functions of time, and their exact rates."""
    waves = {
        "elevator_rad": (0.05, 3.0, 0.2),
        "canard_rad": (0.04, 5.0, 1.0),
        "beta_rad": (0.08, 4.0, -0.7),
        "p_rad_s": (0.5, 2.0, 0.4),
        "r_rad_s": (0.3, 3.5, 2.0),
    }
    values = {name: size * math.sin(rate * t + phase) for name, (size, rate, phase) in waves.items()}
    rates = {name: size * rate * math.cos(rate * t + phase) for name, (size, rate, phase) in waves.items()}
    return values, rates


@settings(max_examples=50)
@given(forms(), st.floats(-0.4, 0.4), st.floats(-0.5, 0.5), st.floats(0.0, 3.0))
def test_the_second_derivative_with_every_input_moving(form: PaperForm, alpha: float, q: float, t: float) -> None:
    """The chain rule on the planar field: α'' = ∂α̇/∂α α' + ∂α̇/∂q q' + Σ ∂α̇/∂u u'; nothing is dropped."""
    model = from_paper(form)
    reduced = lienard_form(model)
    values, rates = _moving(t)
    state = (alpha, q, *values.values())
    alpha_dot, q_dot = float(model.alpha_dot(*state)), float(model.q_dot(*state))
    parts = [
        float(model.alpha_dot.derivative("alpha_rad")(*state)) * alpha_dot,
        float(model.alpha_dot.derivative("q_rad_s")(*state)) * q_dot,
        *(float(model.alpha_dot.derivative(name)(*state)) * rate for name, rate in rates.items()),
    ]
    # Where terms cancel the two roads round differently: the size is that of the terms, not of their sum.
    terms = [np.abs(p.term_values(*np.abs(state))) @ np.abs(p.coefficients) for p in (model.alpha_dot, model.q_dot)]
    size = 10.0 * (1.0 + float(sum(terms))) ** 2
    assert reduced.acceleration(alpha, alpha_dot, values, rates) == pytest.approx(
        math.fsum(parts), rel=0, abs=ROUNDING * size
    )
    rest = float(reduced.pitch_rate(alpha, *values.values()))
    assert rest + reduced.pitch_rate_gain * alpha_dot == pytest.approx(q, rel=0, abs=ROUNDING * size)


def test_along_a_flown_orbit_the_dropped_term_is_seen() -> None:
    """α'' by differences along an integrated orbit tells C_zab·alpha·beta' and f_q (not its rate) from the paper's."""
    form = PaperForm(
        C_zq=-0.02, C_z=(0.1, -0.35), C_zde=-0.04, M_zq=-0.4, M_zad=-0.3, M_z=(2.0, -8.0), M_zde=-4.7,
        C_zdc=0.02, M_zdc=1.5, C_zab=0.03, f_pr=0.9, f_rr=0.1,
    )  # fmt: skip
    model = from_paper(form)
    reduced = lienard_form(model)

    def field(t: float, state: FloatArray) -> FloatArray:
        inputs = _moving(t)[0].values()
        return np.array([float(model.alpha_dot(*state, *inputs)), float(model.q_dot(*state, *inputs))])

    step, states = 5e-4, [np.array([0.3, -0.2])]
    for i in range(6):  # Runge and Kutta's rule: the error of 1e-13 a step leaves 1e-10 in the difference below
        t, s = i * step, states[-1]
        k1 = field(t, s)
        k2 = field(t + step / 2, s + step / 2 * k1)
        k3 = field(t + step / 2, s + step / 2 * k2)
        k4 = field(t + step, s + step * k3)
        states.append(s + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    rates_of_alpha = [field(i * step, s)[0] for i, s in enumerate(states)]
    second = float(np.dot([-1, 9, -45, 0, 45, -9, 1], rates_of_alpha) / (60.0 * step))
    alpha, values, rates = float(states[3][0]), *_moving(3 * step)
    exact = reduced.acceleration(alpha, rates_of_alpha[3], values, rates)
    assert second == pytest.approx(exact, rel=0, abs=1e-8)
    # Negative controls: what the paper prints misses by far more.
    without_beta_rate = {name: rate for name, rate in rates.items() if name != "beta_rad"}
    assert abs(second - reduced.acceleration(alpha, rates_of_alpha[3], values, without_beta_rate)) > 1e-2
    f_q, f_q_rate = (
        form.f_pr * a * d + form.f_pr * b * c + form.f_rr * e
        for a, b, c, d, e in (
            (values["p_rad_s"], 0.0, 0.0, values["r_rad_s"], values["r_rad_s"] ** 2 - values["p_rad_s"] ** 2),
            (
                *(values["p_rad_s"], rates["p_rad_s"], values["r_rad_s"], rates["r_rad_s"]),
                2.0 * (values["r_rad_s"] * rates["r_rad_s"] - values["p_rad_s"] * rates["p_rad_s"]),
            ),
        )
    )
    assert abs(second - (exact + (1.0 + form.C_zq) * (f_q_rate - f_q))) > 1e-2


@given(forms(), st.floats(-0.5, 0.5), st.floats(0.0, 3.0))
def test_eq_11_with_every_term(form: PaperForm, alpha: float, t: float) -> None:
    """The paper's f, g and b in degrees, with f_q in the place of its derivative."""
    reduced = lienard_form(from_paper(form))
    values, _ = _moving(t)
    x, de, dc, beta = (
        from_si(v, "deg") for v in (alpha, values["elevator_rad"], values["canard_rad"], values["beta_rad"])
    )
    p, r = values["p_rad_s"], values["r_rad_s"]
    a_q = 1.0 + form.C_zq
    f = [form.M_zq, a_q * form.M_zad, *(k * c * x ** (k - 1) for k, c in enumerate(form.C_z) if k), form.C_zab * beta]
    g = [
        *(a_q * c * x**k for k, c in enumerate(form.M_z)),
        a_q * from_si(form.f_pr * p * r + form.f_rr * (r * r - p * p), "deg_s2"),
        *(-form.M_zq * c * x**k for k, c in enumerate(form.C_z)),
        -form.M_zq * form.C_zab * x * beta,
        a_q * (form.M_zde * de + form.M_zdc * dc),
        -form.M_zq * (form.C_zde * de + form.C_zdc * dc),
    ]
    # The substituted form adds and cancels M_zad times alpha_dot, which rounds.
    inner = [abs(c * x**k) for k, c in enumerate(form.C_z)] + [abs(form.C_zab * x * beta), abs(form.C_zde * de)]
    size = sum(map(abs, g)) + 2.0 * abs(a_q * form.M_zad) * (sum(inner) + abs(form.C_zdc * dc)) + 1.0
    point = (alpha, *values.values())
    assert reduced.damping(*point) == pytest.approx(sum(f), rel=0, abs=ROUNDING * (sum(map(abs, f)) + 1.0))
    assert from_si(float(reduced.force(*point)), "deg_s2") == pytest.approx(sum(g), rel=0, abs=ROUNDING * size)
    canard = a_q * form.M_zdc - form.M_zq * form.C_zdc
    assert reduced.gain("canard_rad")(*point) == pytest.approx(canard, rel=0, abs=ROUNDING * 20.0)
    assert reduced.rate_gain("canard_rad")(*point) == pytest.approx(form.C_zdc)
    assert reduced.rate_gain("elevator_rad")(*point) == pytest.approx(form.C_zde)
    assert reduced.rate_gain("beta_rad")(*point) == pytest.approx(form.C_zab * x)
    assert reduced.rate_gain("p_rad_s")(*point) == 0.0


@given(forms(), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3), st.floats(0.0, 3.0))
def test_holding_inputs_and_reducing_commute(form: PaperForm, alpha: float, elevator: float, t: float) -> None:
    model = from_paper(form)
    values = {name: value for name, value in _moving(t)[0].items() if name in INPUTS}
    system, general = reduce(model.held(**values)), lienard_form(model)
    point = (alpha, elevator, *values.values())
    force = system.force(alpha) + system.elevator_gain * elevator
    sizes = [np.abs(curve.polynomial.term_values(*np.abs(point))) for curve in (general.damping, general.force)]
    size = 10.0 + sum(
        float(terms @ np.abs(curve.polynomial.coefficients))
        for terms, curve in zip(sizes, (general.damping, general.force), strict=True)
    )
    assert system.damping(alpha) == pytest.approx(float(general.damping(*point)), rel=0, abs=ROUNDING * size)
    assert force == pytest.approx(float(general.force(*point)), rel=0, abs=ROUNDING * size)
    assert system.elevator_rate_gain == form.C_zde


def test_uncertainty_passes_through_held_inputs() -> None:
    """The spread of the reduced coefficients, held first or reduced first, is that of sampled models."""
    form = PaperForm(
        C_zq=-0.02, C_z=(0.1, -0.35, -0.01), C_zde=-0.04, M_zq=-0.4, M_zad=-0.3, M_z=(2.0, -8.0, 0.1), M_zde=-4.7,
        C_zdc=0.02, M_zdc=1.5, C_zab=0.03, f_pr=0.9, f_rr=0.1,
    )  # fmt: skip
    exact = from_paper(form)
    generator = np.random.default_rng(11)
    size = exact.coefficients.size
    mix = (np.eye(size) + 0.3 * generator.standard_normal((size, size))) * (0.002 * np.abs(exact.coefficients))[:, None]
    model = PolynomialModel(alpha_dot=exact.alpha_dot, q_dot=exact.q_dot, covariance=mix @ mix.T)
    held = {"canard_rad": 0.1, "beta_rad": -0.2, "p_rad_s": 1.0, "r_rad_s": 0.4}
    system = reduce(model.held(**held))
    draws = exact.coefficients + generator.standard_normal((1500, size)) @ mix.T
    samples = [reduce(model.with_coefficients(row).held(**held)) for row in draws]
    # The standard deviation of 1500 draws is known to 1.8 %; four times that.
    for curve, name in ((system.damping, "damping"), (system.force, "force")):
        scatter = np.std([getattr(sample, name).polynomial.coefficients for sample in samples], axis=0)
        spread = np.sqrt(np.einsum("ij,jk,ik->i", curve.sensitivity, system.covariance, curve.sensitivity))
        np.testing.assert_allclose(scatter, spread, rtol=0.075)
    c2 = system.elevator_rate_gain_sensitivity
    assert np.std([s.elevator_rate_gain for s in samples]) == pytest.approx(
        math.sqrt(c2 @ system.covariance @ c2), rel=0.075
    )


def test_without_further_coefficients_there_are_no_further_inputs(paper_model: PolynomialModel) -> None:
    form = lienard_form(paper_model)
    system = reduce(paper_model)
    assert form.inputs == ("elevator_rad",)
    assert form.gain("elevator_rad")(0.1, 0.2) == system.elevator_gain
    assert form.rate_gain("elevator_rad")(0.1, 0.2) == system.elevator_rate_gain


@pytest.fixture
def with_inputs() -> Callable[..., PolynomialModel]:
    def make(
        alpha_dot: dict[tuple[int, ...], float], q_dot: dict[tuple[int, ...], float], *inputs: str
    ) -> PolynomialModel:
        variables = (*VARIABLES, *inputs)
        rest = (0,) * len(inputs)
        return PolynomialModel(
            alpha_dot=Polynomial.build(
                {(0, 1, 0, *rest): 1.0, (1, 0, 0, *rest): -0.5} | alpha_dot, variables=variables, value_unit="rad_s"
            ),
            q_dot=Polynomial.build(
                {(1, 0, 0, *rest): -8.0, (0, 0, 1, *rest): -4.0} | q_dot, variables=variables, value_unit="rad_s2"
            ),
            covariance=np.zeros((4 + len(alpha_dot) + len(q_dot),) * 2),
        )

    return make


def test_a_damping_by_angle_is_held_where_the_elevator_gives_no_lift(
    with_inputs: Callable[..., PolynomialModel],
) -> None:
    """With q' = … + (b₀ + b₁ α) q: f = A' + b₀ + b₁ α, g = B − (b₀ + b₁ α) A."""
    system = reduce(with_inputs({(2, 0, 0): 0.7}, {(0, 1, 0): -0.4, (1, 1, 0): 3.0}))
    np.testing.assert_allclose(system.damping.ascending, [-0.9, 1.4 + 3.0], rtol=1e-15)
    np.testing.assert_allclose(system.force.ascending, [0.0, -8.0 - 0.2, 0.4 * 0.7 + 1.5, -3.0 * 0.7], rtol=1e-15)
    with pytest.raises(RefusedError, match=r"cannot hold alpha\*q in q_dot"):
        reduce(with_inputs({(0, 0, 1): -0.1}, {(1, 1, 0): 3.0}))


def test_the_general_form_holds_what_a_single_gain_cannot(with_inputs: Callable[..., PolynomialModel]) -> None:
    model = with_inputs({(0, 0, 1): -0.1}, {(1, 1, 0): 3.0, (1, 0, 1): 0.6, (0, 0, 2): 0.2})
    form = lienard_form(model)
    # g = B − b A with b = 3 α, A = −0.5 α − 0.1 δ, B = −8 α − 4 δ + 0.6 α δ + 0.2 δ²
    assert form.force.polynomial.coefficient(alpha_rad=1, elevator_rad=1) == pytest.approx(0.6 + 0.3, rel=1e-15)
    assert form.force.polynomial.coefficient(elevator_rad=2) == 0.2
    assert form.gain("elevator_rad")(0.0, 0.5) == pytest.approx(-4.0 + 0.2)


def test_what_no_form_holds_is_named(with_inputs: Callable[..., PolynomialModel]) -> None:
    model = with_inputs({(1, 1, 0, 0): 0.1}, {(0, 2, 0, 0): 1.0, (0, 1, 0, 1): 1.0}, "canard_rad")
    with pytest.raises(RefusedError) as caught:
        lienard_form(model)
    assert caught.value.message.endswith("cannot hold alpha*q in alpha_dot, q^2 in q_dot")
    with pytest.raises(InputError, match="further inputs") as refused:
        reduce(model)
    assert "held(canard_rad=…)" in refused.value.hint
    general = lienard_form(with_inputs({}, {}, "canard_rad"))
    with pytest.raises(InputError, match="no input flap_rad"):
        general.rate_gain("flap_rad")
    with pytest.raises(InputError, match="the inputs are"):
        general.acceleration(0.0, 0.0, {"elevator_rad": 0.0}, {})


def test_degrees_of_the_further_coefficients() -> None:
    """One degree of canard, of sideslip, and inertia ratios that are pure numbers."""
    model = from_paper(
        PaperForm(
            C_zq=0.0, C_z=(0.0,), C_zde=0.0, M_zq=0.0, M_zad=0.0, M_z=(0.0,), M_zde=-1.0,
            C_zdc=0.5, M_zdc=2.0, C_zab=0.25, f_pr=0.9, f_rr=-0.2,
        )
    )  # fmt: skip
    degree = to_si(1.0, "deg")
    assert model.inputs == INPUTS
    assert model.alpha_dot(2 * degree, 0, 0, degree, 3 * degree, 0, 0) == pytest.approx((0.5 + 0.25 * 6) * degree)
    assert model.q_dot(0, 0, 0, degree, 0, 0, 0) == pytest.approx(2.0 * degree)
    assert model.q_dot(0, 0, 0, 0, 0, 2.0, 3.0) == pytest.approx(0.9 * 6.0 - 0.2 * (9.0 - 4.0))

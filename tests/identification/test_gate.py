"""The collinearity gate: what only a combination is known of is not told apart, and the combination is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.model import PolynomialModel
from finback.errors import RefusedError
from finback.identification.gate import HALF, STRONG, Collinearity, collinearity, judge
from finback.identification.identify import identify
from finback.identification.model_form import ModelForm
from finback.identification.noise import measured_noise
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import stretches
from finback.records import Sweep

TERMS = ("1", "q", "alpha", "alpha^2", "alpha^3", "elevator")
SHARED_RATE = -0.43379543105980  # M_q and M_alpha-dot of Shi & Fan (2013), section 4, in 1/s
WIDE = 3.3  # standard errors: one of 1000 random numbers lies beyond; seven combinations are judged


@pytest.fixture(scope="module")
def judged(
    clean: Sweep, noisy: Callable[..., Sweep], options: IdentificationOptions
) -> Callable[[ModelForm], Collinearity]:
    """Judge a form on the noisy flights of the published model."""
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=3)
    used = [piece for record in sweep.records for piece in stretches(record, options, windowed=True)]
    noise = measured_noise(used).assumed
    return lambda form: judge(used, form, options, noise)


def explicit(truth: PolynomialModel) -> dict[str, float]:
    """The coefficients of the published explicit dq/dt."""
    return {
        f"{label} in dq/dt": value
        for label, value in zip(truth.q_dot.labels(), truth.q_dot.coefficients.tolist(), strict=True)
    }


def test_the_explicit_form_passes_the_gate(judged: Callable[[ModelForm], Collinearity]) -> None:
    found = judged(ModelForm.parse(TERMS, TERMS))
    assert (found.unknown, found.known, found.shared) == ((), (), ())
    found.refuse()
    np.testing.assert_allclose(found.proportions.sum(axis=0), 1.0)
    assert (np.diff(found.condition_indices) <= 0).all()
    assert found.condition_indices[-1] == pytest.approx(1.0)


def test_one_rate_term_passes_the_gate(judged: Callable[[ModelForm], Collinearity]) -> None:
    assert judged(ModelForm.parse(TERMS, ("q+alpha_dot", *(t for t in TERMS if t != "q")))).unknown == ()


def test_separate_q_and_alpha_dot_are_refused_and_their_combination_is_named(
    judged: Callable[[ModelForm], Collinearity], truth: PolynomialModel
) -> None:
    found = judged(ModelForm.parse(TERMS, (*TERMS, "alpha_dot")))
    assert set(found.unknown) == {f"{term} in dq/dt" for term in (*TERMS, "alpha_dot")}
    known = {item.labels[0]: item for item in found.known}
    for label, value in explicit(truth).items():  # with dα/dt substituted: the explicit model
        item = known[label]
        assert abs(item.value - value) < WIDE * item.standard_error
        assert item.labels[1] == "alpha_dot in dq/dt"
    assert known["q in dq/dt"].weights[1] == pytest.approx(truth.alpha_dot.coefficient(q_rad_s=1), rel=0.01)
    (shared,) = found.shared
    assert shared.labels == ("q+alpha_dot in dq/dt",)
    assert abs(shared.value - SHARED_RATE) < WIDE * shared.standard_error
    assert shared.standard_error < 0.02 * abs(SHARED_RATE)
    with pytest.raises(RefusedError, match=r"q in dq/dt.*only together|only together.*q in dq/dt") as caught:
        found.refuse()
    assert "q+alpha_dot in dq/dt) = -0.43" in str(caught.value)


def test_identify_refuses_what_the_gate_refuses(
    clean: Sweep, noisy: Callable[..., Sweep], options: IdentificationOptions
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=3)
    with pytest.raises(RefusedError, match="only together") as caught:
        identify(sweep, replace(options, form=(ModelForm.parse(TERMS, (*TERMS, "alpha_dot")),)))
    assert "(q+alpha_dot in dq/dt) = -0.43" in str(caught.value)


def test_belsleys_numbers_of_two_columns_follow_from_their_correlation() -> None:
    # Columns of length 1 with cosine c have singular values sqrt(1 ± c), and equal shares in both.
    cosine = 1.0 - 1e-4
    form = ModelForm.parse(("1", "alpha"), ("1",))
    x = np.zeros((50, 3))
    x[0] = (1.0, cosine, 0.0)
    x[1, 1] = np.sqrt(1 - cosine**2)
    target = 1e4 * x[:, 0] + 2e4 * x[:, 1]
    found = collinearity(x, target, form, np.array([0, 1]))
    assert found.condition_indices[0] == pytest.approx(np.sqrt((1 + cosine) / (1 - cosine)))
    small, large = 1 / (1 + cosine), 1 / (1 - cosine)
    np.testing.assert_allclose(found.proportions[0], large / (large + small))
    assert found.condition_indices[0] > STRONG
    assert (found.proportions[0] > HALF).all()
    assert found.unknown == ()  # strong, but both coefficients are far above the noise


def test_a_strong_dependency_closes_the_gate_only_where_noise_hides_its_parts() -> None:
    random = np.random.default_rng(1)
    form = ModelForm.parse(("1", "alpha", "q"), ("1",))
    common, other = random.normal(size=(2, 400))
    x = np.column_stack([common, common + 0.01 * random.normal(size=400), other, np.zeros(400)])
    target = 2.0 * x[:, 0] + 2.0 * x[:, 1] + 3.0 * other + random.normal(size=400)
    found = collinearity(x, target, form, np.arange(4))
    assert found.unknown == ("1 in dalpha/dt", "alpha in dalpha/dt")
    (combination,) = found.known
    assert combination.weights[1] == pytest.approx(1.0, rel=0.01)
    low, high = combination.interval
    assert low < 4.0 < high
    assert high - low < 0.3
    clear = collinearity(x, target + 1e3 * (x[:, 0] + x[:, 1]), form, np.arange(4))
    assert clear.unknown == ()


def test_residuals_beyond_the_noise_leave_no_interval_to_be_believed() -> None:
    random = np.random.default_rng(1)
    form = ModelForm.parse(("1", "alpha", "q"), ("1",))
    common, other = random.normal(size=(2, 400))
    x = np.column_stack([common, common, other, np.zeros(400)])
    for size, said in ((1.0, "Known (SI, 95 %)"), (5.0, "no interval")):
        target = 2.0 * x[:, 0] + 3.0 * other + size * random.normal(size=400)
        with pytest.raises(RefusedError, match="only together") as caught:
            collinearity(x, target, form, np.arange(4)).refuse()
        assert said in str(caught.value)
    assert "Known" not in str(caught.value)

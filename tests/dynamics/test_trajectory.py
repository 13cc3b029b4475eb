"""Free runs against an independent integrator, the paper's time histories, and blow-up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.dynamics.trajectory import free_run, free_run_samples
from finback.errors import InputError
from finback.units import from_si, si_factor, to_si

_TIME = np.linspace(0.0, 5.0, 501)


def test_the_time_history_of_the_paper(paper_model: PolynomialModel) -> None:
    """Elevator 0 from (alpha, alpha_dot) = (10°, 0), the paper's Fig. 8; reference by 130-bit Taylor series."""
    start = to_si(10.0, "deg")
    q = float(reduce(paper_model).pitch_rate(start, 0.0))
    states = free_run(
        paper_model, time_s=_TIME, elevator_rad=0.0 * _TIME, hold="foh", alpha_rad=start, q_rad_s=q, substeps=8
    )
    for index, alpha, alpha_dot in (
        (100, -4.752475157, -5.055375146),
        (200, 2.053296123, 6.086562887),
        (500, 0.409073270, -1.441426790),
    ):
        found = (states[index, 0], float(paper_model.alpha_dot(*states[index], 0.0)))
        # The reference used Eq. (37), rounded to ten digits: 1e-8.
        assert [from_si(value, "deg") for value in found] == pytest.approx([alpha, alpha_dot], rel=0, abs=2e-8)


def _reference(model: PolynomialModel, time: FloatArray, elevator: FloatArray, hold: str) -> FloatArray:
    """Integrate from sample to sample, so that the input is smooth within each call."""
    state = np.array([0.05, -0.1])
    states = [state]
    for i in range(len(time) - 1):
        slope = (elevator[i + 1] - elevator[i]) / (time[i + 1] - time[i]) if hold == "foh" else 0.0

        def field(t: float, y: FloatArray, i: int = i, slope: float = slope) -> list[float]:
            held = elevator[i] + slope * (t - time[i])
            return [float(model.alpha_dot(*y, held)), float(model.q_dot(*y, held))]

        state = solve_ivp(field, (time[i], time[i + 1]), state, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        states.append(state)
    return np.array(states)


@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_agrees_with_an_adaptive_integrator_and_converges_with_order_four(
    paper_model: PolynomialModel, hold: str
) -> None:
    time = np.array([0.0, 0.3, 0.5, 0.6, 1.1, 1.2, 1.8])  # uneven samples
    elevator = np.array([0.0, 0.1, 0.1, -0.15, -0.1, 0.05, 0.05])
    reference = _reference(paper_model, time, elevator, hold)
    errors = []
    for substeps in (8, 16, 64):
        states = free_run(
            paper_model,
            time_s=time,
            elevator_rad=elevator,
            hold=hold,
            alpha_rad=0.05,
            q_rad_s=-0.1,
            substeps=substeps,
        )
        errors.append(np.abs(states - reference).max())
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.25)  # order 4, up to its next term
    assert errors[2] < 1e-9


def test_samples_are_the_single_runs(paper_model: PolynomialModel) -> None:
    generator = np.random.default_rng(3)
    rows = paper_model.coefficients * (1.0 + 0.02 * generator.standard_normal((5, 12)))
    inputs = {
        "time_s": _TIME,
        "elevator_rad": 0.05 * np.sin(_TIME),
        "hold": "foh",
        "alpha_rad": 0.1,
        "q_rad_s": 0.2,
    }
    together = free_run_samples(paper_model, rows, **inputs)
    assert together.shape == (5, _TIME.size, 2)
    for row, states in zip(rows, together, strict=True):
        alone = free_run(paper_model.with_coefficients(row), **inputs)
        np.testing.assert_allclose(states, alone, rtol=0, atol=1e-13)  # the same operations on numbers and arrays


def test_blow_up_is_nan_from_there_on_and_warns_nobody(paper_model: PolynomialModel) -> None:
    inputs = {"time_s": _TIME, "elevator_rad": 0.0 * _TIME, "hold": "zoh", "alpha_rad": 1.2, "q_rad_s": 0.0}
    states = free_run(paper_model, **inputs)  # beyond the right saddle: the cubic escapes in finite time
    lost = np.isnan(states).any(axis=1)
    first = int(lost.argmax())
    assert 0 < first < _TIME.size
    assert np.isfinite(states[:first]).all()
    assert np.isnan(states[first:]).all()
    linear = np.where([label in {"1", "alpha", "q", "elevator"} for label in _labels(paper_model)], 1.0, 0.0)
    both = free_run_samples(
        paper_model, np.stack([paper_model.coefficients * linear, paper_model.coefficients]), **inputs
    )
    assert np.isfinite(both[0]).all()  # the linear part is stable: it is not drawn into its neighbor's blow-up
    np.testing.assert_array_equal(np.isnan(both[1]), np.isnan(states))


def _labels(model: PolynomialModel) -> tuple[str, ...]:
    return (*model.alpha_dot.labels(), *model.q_dot.labels())


def test_a_model_of_any_terms_runs(paper_model: PolynomialModel) -> None:
    """The planar field may hold what the Liénard form cannot: here alpha*q, q^2 and elevator^2."""
    powers = np.array([[1, 1, 0], [0, 2, 0], [0, 0, 2], [2, 0, 1], [0, 0, 0], [0, 1, 0]])
    q_dot = replace(paper_model.q_dot, powers=powers, coefficients=np.array([-0.3, 0.2, -1.5, 0.4, 0.02, -0.6]))
    model = replace(paper_model, q_dot=q_dot)
    time = np.linspace(0.0, 1.0, 11)
    elevator = 0.2 * np.cos(time)
    states = free_run(model, time_s=time, elevator_rad=elevator, hold="foh", alpha_rad=0.05, q_rad_s=-0.1)
    np.testing.assert_allclose(states, _reference(model, time, elevator, "foh"), rtol=0, atol=1e-9)


def test_one_sample_is_the_start_itself(paper_model: PolynomialModel) -> None:
    degree = si_factor("deg")
    states = free_run(
        paper_model, time_s=[0.0], elevator_rad=[0.1], hold="zoh", alpha_rad=3.0 * degree, q_rad_s=2.0 * degree
    )
    np.testing.assert_array_equal(states, [[3.0 * degree, 2.0 * degree]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time_s": [0.0, 0.0]}, "do not rise"),
        ({"time_s": [0.0, 1.0, 2.0]}, "shapes"),
        ({"hold": "cubic"}, "use foh or zoh"),
        ({"substeps": 0}, "substeps"),
    ],
)
def test_inputs_that_make_no_sense(paper_model: PolynomialModel, change: dict[str, object], message: str) -> None:
    inputs: dict[str, object] = {"time_s": [0.0, 1.0], "elevator_rad": [0.0, 0.0], "hold": "foh"}
    with pytest.raises(InputError, match=message):
        free_run(paper_model, **(inputs | change), alpha_rad=0.0, q_rad_s=0.0)


def test_samples_have_the_width_of_the_model(paper_model: PolynomialModel) -> None:
    with pytest.raises(InputError, match=r"expected \(samples, 12\)"):
        free_run_samples(
            paper_model, np.zeros((2, 5)), time_s=[0.0], elevator_rad=[0.0], hold="foh", alpha_rad=0.0, q_rad_s=0.0
        )

"""Flights whose constants differ, against an independent likelihood: a matrix exponential and numerical derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pytest
from scipy.linalg import expm

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.identification.bootstrap import Scheme, bootstrap
from finback.identification.flight_constants import with_terms
from finback.identification.identify import Identification, identify
from finback.identification.instruments import InstrumentFaults, KnownFault, with_instruments
from finback.identification.method import Method
from finback.identification.model_form import Equation, ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.selection.library import library, polynomial_terms
from finback.identification.selection.options import SelectionOptions
from finback.identification.term import Term
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep

CONDITION = Condition(airspeed_m_s=150.0, density_kg_m3=0.9, gravity_m_s2=9.80665, altitude_m=3000.0)
INTERVAL_S = 0.04
RATES = np.array([[-0.7, 0.97], [-2.7, -1.1]])  # a transport of 20 t
ELEVATOR = np.array([-0.04, -3.2])
OWN = ((0.012, -0.030), (0.018, -0.055), (0.009, -0.02))  # constants of dα/dt and dq/dt, flight by flight
NOISE = np.radians([0.1, 0.15])
AT_THE_TOP = 0.02
"""Standard errors by which an estimate may miss the most likely one: iterations end when steps are that small."""


def elevator(unit_s: float) -> FloatArray:
    time = INTERVAL_S * np.arange(301)
    switch = np.searchsorted(1.0 + unit_s * np.array([0, 3, 5, 6, 7]), time, side="right")
    sharp = np.radians(3.0) * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[switch]
    smooth: FloatArray = np.convolve(np.pad(sharp, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    return smooth


def flown(
    rates: FloatArray, gain: FloatArray, own: FloatArray, start: FloatArray, deflection: FloatArray
) -> FloatArray:
    """Solve x' = rates x + gain δ + own exactly, the elevator straight between samples."""
    system = np.zeros((6, 6))
    system[:2, :2], system[:2, 2], system[:2, 3] = rates, gain, own
    system[2:4, 4:] = np.eye(2)
    step = expm(system * INTERVAL_S)[:2]
    states = np.empty((deflection.size, 2))
    states[0] = start
    inputs = np.column_stack([deflection, np.ones(deflection.size)])
    slopes = np.diff(inputs, axis=0) / INTERVAL_S
    forced = inputs[:-1] @ step[:, 2:4].T + slopes @ step[:, 4:].T
    for index, force in enumerate(forced):
        states[index + 1] = step[:, :2] @ states[index] + force
    return states


def record(index: int, random: np.random.Generator) -> FlightRecord:
    deflection = elevator((1.0, 0.8, 1.2)[index])
    states = flown(RATES, ELEVATOR, np.array(OWN[index]), np.array([0.02, 0.0]), deflection)
    measured = states + NOISE * random.standard_normal(states.shape)
    time = INTERVAL_S * np.arange(deflection.size)
    return FlightRecord(
        name=f"flight {index}",
        columns={"time_s": time, "alpha_rad": measured[:, 0], "q_rad_s": measured[:, 1], "elevator_rad": deflection},
        outcome=Outcome.COMPLETED,
        note="",
        condition=CONDITION,
        schedule=Schedule(time_s=time, elevator_rad=deflection),
        hold=Hold.FOH,
    )


@pytest.fixture(scope="module")
def sweep() -> Sweep:
    random = np.random.default_rng(5)
    return Sweep(study="transport", records=tuple(record(index, random) for index in range(3)))


def options(method: Method = Method.OUTPUT_ERROR, **changed: object) -> IdentificationOptions:
    given = {"alpha_order": (1, 1), "half_width_s": 0.32, "method": method, "constants_per_flight": True, **changed}
    return IdentificationOptions(alpha_window_rad=(-1.0, 1.0), **given)  # type: ignore[arg-type] # named options


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """One Gauss-Newton step of an independent likelihood from an estimate: how far, and the Cramér-Rao bounds."""

    step: FloatArray
    bounds: FloatArray


def reference(found: Identification, sweep: Sweep) -> Reference:
    one, two = found.model.alpha_dot, found.model.q_dot
    theta = [p.coefficient(**k) for p in (one, two) for k in ({"q_rad_s": 1}, {"alpha_rad": 1}, {"elevator_rad": 1})]
    for item in found.constants:
        theta += [one.coefficient() + item.alpha_dot_rad_s, two.coefficient() + item.q_dot_rad_s2]
    theta += [value for flight in sweep.records for value in (flight["alpha_rad"][0], flight["q_rad_s"][0])]
    start = np.array(theta)

    def predicted(x: FloatArray) -> FloatArray:
        rates, gain = np.array([[x[1], x[0]], [x[4], x[3]]]), x[[2, 5]]
        return np.concatenate(
            [
                flown(rates, gain, x[6 + 2 * k : 8 + 2 * k], x[12 + 2 * k : 14 + 2 * k], flight["elevator_rad"])
                for k, flight in enumerate(sweep.records)
            ]
        )

    steps = 1e-6 * np.eye(start.size)
    derivative = np.stack([(predicted(start + h) - predicted(start - h)) / 2e-6 for h in steps], axis=2)
    measured = np.concatenate([np.column_stack([r["alpha_rad"], r["q_rad_s"]]) for r in sweep.records])
    # The starts enter linearly: with them at their best, the residuals give the noise.
    begins = derivative[:, :, 12:].reshape(-1, 6)
    left = (measured - predicted(start)).ravel()
    left = (left - begins @ np.linalg.lstsq(begins, left, rcond=None)[0]).reshape(-1, 2)
    noise = left.T @ left / (len(left) - 0.5 * start.size)
    white = np.linalg.inv(np.linalg.cholesky(noise))
    rows = np.einsum("ij,njp->nip", white, derivative).reshape(-1, start.size)
    inverse = np.linalg.inv(rows.T @ rows)
    step = inverse @ rows.T @ ((measured - predicted(start)) @ white.T).ravel()
    return Reference(step=step[:12], bounds=np.sqrt(np.diag(inverse))[:12])


def test_estimate_and_plain_bounds_are_those_of_an_independent_likelihood(sweep: Sweep) -> None:
    found = identify(sweep, options())
    expected = reference(found, sweep)
    assert (np.abs(expected.step) <= AT_THE_TOP * expected.bounds).all()
    order = [1, 2, 3, 5, 6, 7]  # without the model's own constants, the means
    np.testing.assert_allclose(found.cramer_rao_errors[order], expected.bounds[:6], rtol=2e-3)
    assert len(found.warnings) == 1
    assert "the means of 3 flights" in found.warnings[0]
    assert [item.flight for item in found.constants] == [flight.name for flight in sweep.records]
    total = sum(item.alpha_dot_rad_s for item in found.constants), sum(item.q_dot_rad_s2 for item in found.constants)
    np.testing.assert_allclose(total, 0.0, atol=1e-15)
    mean = np.mean(OWN, axis=0)
    for item, own in zip(found.constants, OWN, strict=True):
        assert abs(item.alpha_dot_rad_s - (own[0] - mean[0])) < 4.0 * item.alpha_dot_error_rad_s
        assert abs(item.q_dot_rad_s2 - (own[1] - mean[1])) < 4.0 * item.q_dot_error_rad_s2


def test_one_constant_for_all_is_told_not_to_hold(sweep: Sweep) -> None:
    found = identify(sweep, options(constants_per_flight=False))
    assert any("constants of their own (constants_per_flight)" in warning for warning in found.warnings)
    assert not found.constants
    assert (found.standard_errors > 1.5 * found.cramer_rao_errors).all()  # the plain ones stay plain


@pytest.mark.parametrize("method", [Method.WEAK_FORM, Method.FREQUENCY, Method.FILTER_ERROR])
def test_every_method_fits_them(sweep: Sweep, method: Method) -> None:
    likely, found = identify(sweep, options()), identify(sweep, options(method))
    assert (np.abs(found.model.coefficients - likely.model.coefficients) < likely.standard_errors).all()
    for one, two in zip(likely.constants, found.constants, strict=True):
        assert abs(one.q_dot_rad_s2 - two.q_dot_rad_s2) < 2.0 * one.q_dot_error_rad_s2


def test_one_flight_has_no_constant_beside_the_models(sweep: Sweep) -> None:
    alone = Sweep(study="alone", records=sweep.records[:1])
    found, plain = identify(alone, options()), identify(alone, options(constants_per_flight=False))
    assert not found.constants
    np.testing.assert_array_equal(found.model.coefficients, plain.model.coefficients)
    (said,) = set(found.warnings) - set(plain.warnings)
    assert said.startswith("constants_per_flight does nothing: only one flight is used")


def test_only_constants_that_are_fitted_can_differ() -> None:
    form = ModelForm.parse(["1", "q", "alpha"], ["q", "alpha", "elevator"])
    own = with_terms(form, ("a", "b"))
    assert own.sizes == (4, 3)
    with pytest.raises(InputError, match="no equation has a constant"):
        with_terms(form.fix(Equation.ALPHA_DOT, Term.of(), 0.0), ("a", "b"))


@pytest.mark.parametrize(("method", "order"), [*((method, 1) for method in Method), (Method.OUTPUT_ERROR, 2)])
def test_biases_that_nothing_is_known_of_are_refused_not_printed(sweep: Sweep, method: Method, order: int) -> None:
    # With biases of alpha and elevator unknown in every flight, no data tell the constants: their columns are rounding.
    unknown = Nuisances(alpha_bias_rad=np.inf, elevator_bias_rad=np.inf)
    asked = options(method, constants_per_flight=False, nuisances=unknown, alpha_order=(order, order))
    with pytest.raises(RefusedError, match="nothing is known of the alpha bias and the elevator bias") as refusal:
        identify(sweep, asked)
    assert "expected size" in refusal.value.hint


def _seen(sweep: Sweep, **columns: Callable[[FlightRecord], FloatArray]) -> tuple[str, ...]:
    records = tuple(one.with_columns(**{name: value(one) for name, value in columns.items()}) for one in sweep.records)
    return identify(replace(sweep, records=records), options(Method.WEAK_FORM)).warnings[1:]


def test_channels_that_are_not_what_they_are_taken_for_are_told_by_signs(sweep: Sweep) -> None:
    """No residual tells: with a scaled or late alpha, or an elevator of the other sign, equations keep their form."""
    assert not _seen(sweep, alpha_rad=lambda one: one["alpha_rad"])
    (said,) = _seen(sweep, elevator_rad=lambda one: -one["elevator_rad"])
    assert "dq/dt rises with the elevator" in said
    (said,) = _seen(sweep, alpha_rad=lambda one: 1.15 * one["alpha_rad"])
    assert "alpha reads too much" in said
    (said,) = _seen(sweep, alpha_rad=lambda one: 0.75 * one["alpha_rad"])
    assert "alpha reads too little" in said
    late = _seen(sweep, alpha_rad=lambda one: np.concatenate([one["alpha_rad"][:1]] * 2 + [one["alpha_rad"][:-2]]))
    assert any("or is late" in said or "one of the two is late" in said for said in late)


def test_a_late_alpha_is_another_model_of_the_same_form(sweep: Sweep) -> None:
    """To first order in τ the coefficient of q in dα/dt is Zq (1 - τ Mq), the damping Mq + τ Mα Zq: only Zq tells."""

    def fitted(late: int) -> FloatArray:
        records = []
        for one in sweep.records:
            alpha = one["alpha_rad"]
            records.append(one.with_columns(alpha_rad=np.concatenate([alpha[:1].repeat(late), alpha])[: alpha.size]))
        model = identify(replace(sweep, records=tuple(records)), options(Method.WEAK_FORM)).model
        return np.array([model.alpha_dot.coefficient(q_rad_s=1), model.q_dot.coefficient(q_rad_s=1)])

    moved = fitted(1) - fitted(0)
    turning, (stiffness, damping) = RATES[0, 1], RATES[1]
    # The second order is smaller by the delay times an eigenvalue, 2 1/s.
    first = INTERVAL_S * np.array([-turning * damping, stiffness * turning])
    np.testing.assert_allclose(moved, first, rtol=0.2)


def test_the_bootstrap_draws_with_them(sweep: Sweep) -> None:
    asked = options(Method.WEAK_FORM)
    found, drawn = identify(sweep, asked), bootstrap(sweep, asked, scheme=Scheme.PARAMETRIC, draws=12)
    assert drawn.coefficients.shape == (12, found.model.coefficients.size)
    np.testing.assert_allclose(drawn.estimate, found.model.coefficients, rtol=1e-12)
    # 12 draws tell a standard deviation to 21 %.
    assert (np.abs(drawn.standard_errors / found.standard_errors - 1.0) < 0.8).all()


@pytest.mark.parametrize("damping", ["q", "q+alpha_dot"])
def test_a_fault_left_in_moves_the_model_as_it_is_stated(sweep: Sweep, damping: str) -> None:
    """A bias of alpha moves constants alone where each flight has its own; the model may be explicit or not."""
    form = ModelForm.parse(["1", "q", "alpha", "elevator"], ["1", damping, "alpha", "elevator"])
    found = identify(sweep, options(Method.WEAK_FORM, form=(form,)))
    bias = KnownFault(name="alpha bias", value=0.01, standard_error=0.001, taken_out=False)
    names = tuple(flight.name for flight in sweep.records)
    faults = {name: InstrumentFaults(together=names, known=(bias,), unknown=()) for name in names}
    widened = with_instruments(found, sweep, faults)
    size = found.model.alpha_dot.coefficients.size
    slope = np.array([found.model.alpha_dot.coefficient(alpha_rad=1), found.model.q_dot.coefficient(alpha_rad=1)])
    grown = np.sqrt(np.diag(widened.model.covariance) - np.diag(found.model.covariance))
    constants = [int(np.flatnonzero(~p.powers.any(axis=1))[0]) for p in (found.model.alpha_dot, found.model.q_dot)]
    places = [constants[0], size + constants[1]]
    np.testing.assert_allclose(grown[places], np.hypot(0.01, 0.001) * np.abs(slope), rtol=1e-3)
    rest = np.delete(np.arange(grown.size), places)
    assert (grown[rest] < 0.01 * found.standard_errors[rest]).all()


QUADRATIC = library(polynomial_terms(("alpha", "q", "elevator"), 2))
LINEAR = ModelForm.polynomial((1, 1))


def selected(sweep: Sweep, **changed: object) -> Identification:
    asked = SelectionOptions(library=QUADRATIC, bootstraps=10)
    return identify(sweep, options(selection=(asked,), **changed))


def test_terms_are_found_beside_constants_of_each_flight(sweep: Sweep) -> None:
    found = selected(sweep)
    (selection,) = found.selection
    assert set(selection.form.labels()) == set(LINEAR.labels())
    assert selection.determined
    assert all(item.frequency == 1.0 for item in selection.candidates if not item.term.variables)
    assert min(step.predicted_squared_error for step in selection.path) > 0.0  # constants are free, not paid for
    given = identify(sweep, options(form=(selection.form,)))
    np.testing.assert_array_equal(found.model.coefficients, given.model.coefficients)
    assert found.constants == given.constants


def test_flights_taken_for_alike_would_need_terms_that_are_not_there(sweep: Sweep) -> None:
    """The negative control: what one constant for all leaves, curves stand for; a warning says what may be wrong."""
    found = selected(sweep, constants_per_flight=False)
    assert set(found.selection[0].form.labels()) > set(LINEAR.labels())
    said = [warning for warning in found.warnings if warning.startswith("even all candidates leave")]
    assert len(said) == 1
    assert "constants of their own (constants_per_flight)" in said[0]


def test_constants_are_in_the_model_though_their_mean_is_nothing() -> None:
    random = np.random.default_rng(8)
    flights = [record(index, random) for index in (0, 1)]
    mean = np.mean(OWN[:2], axis=0)
    trim = np.linalg.solve(RATES, mean)  # alpha and q from the mean flight's trim: its constants are 0
    moved = [
        flight.with_columns(alpha_rad=flight["alpha_rad"] + trim[0], q_rad_s=flight["q_rad_s"] + trim[1])
        for flight in flights
    ]
    found = selected(Sweep(study="mean", records=tuple(moved)))
    assert set(found.selection[0].form.labels()) == set(LINEAR.labels())
    assert abs(found.model.alpha_dot.coefficient()) < 4.0 * found.standard_errors[0]
    assert found.constants[0].q_dot_rad_s2 == pytest.approx(OWN[0][1] - mean[1], rel=0.2)


def test_flights_kept_out_have_constants_that_nothing_fits(sweep: Sweep) -> None:
    kept = SelectionOptions(library=QUADRATIC, prediction=(sweep.records[0].name,))
    with pytest.raises(InputError, match="kept out"):
        options(selection=(kept,))

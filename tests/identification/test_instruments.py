"""What faults of the instruments leave in a model: its intervals hold the truth, and the warnings name the fault."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.model import PolynomialModel
from finback.identification.compatibility.wording import weight_read, with_error
from finback.identification.identify import Identification, identify
from finback.identification.instruments import InstrumentFaults, KnownFault, with_instruments
from finback.identification.nuisance import Nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.propagation import PropagatedNumber, propagate
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si

BIAS_RAD = to_si(1.2, "deg")
ERROR_RAD = to_si(0.1, "deg")
NAMES = ("one", "two", "three")
OPTIONS = IdentificationOptions(alpha_window_rad=(-0.5, 0.5), alpha_order=(1, 1))
TRIM_RAD = 0.05
"""Of the truth, with the elevator at zero."""
MATRIX = np.array([[-0.9, 1.0], [-6.0, -1.4]])
GAIN = np.array([-0.1, -9.0])


def _record(name: str, seed: int) -> FlightRecord:
    """Fly a linear aircraft; alpha reads too much."""
    random, step, count = np.random.default_rng(seed), 0.02, 401
    time = step * np.arange(count)
    elevator = (
        0.04
        * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[
            np.searchsorted(1.0 + 0.4 * np.array([0, 3, 5, 6, 7]), time + 1e-9, side="right")
        ]
    )
    values, vectors = np.linalg.eig(MATRIX)
    across = np.real(vectors @ np.diag(np.exp(values * step)) @ np.linalg.inv(vectors))
    held = np.linalg.solve(MATRIX, (across - np.eye(2)) @ GAIN)
    states = np.zeros((count, 2))
    for k in range(count - 1):
        states[k + 1] = across @ states[k] + held * elevator[k]
    noise = to_si(0.1, "deg") * random.standard_normal((2, count))
    return FlightRecord(
        name=name,
        columns={
            "time_s": time,
            "alpha_rad": states[:, 0] + TRIM_RAD + BIAS_RAD + noise[0],
            "q_rad_s": states[:, 1] + noise[1],
            "elevator_rad": elevator,
        },
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=120.0, density_kg_m3=0.9, gravity_m_s2=9.80665, altitude_m=3000.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=Hold.ZOH,
    )


@pytest.fixture(scope="module")
def sweep() -> Sweep:
    return Sweep(study="biased", records=tuple(_record(name, seed) for seed, name in enumerate(NAMES)))


@pytest.fixture(scope="module")
def found(sweep: Sweep) -> Identification:
    return identify(sweep, OPTIONS)


def _faults(*, taken_out: bool, together: bool = True, unknown: tuple[str, ...] = ()) -> dict[str, InstrumentFaults]:
    known = KnownFault(name="alpha bias", value=BIAS_RAD, standard_error=ERROR_RAD, taken_out=taken_out)
    return {
        name: InstrumentFaults(together=NAMES if together else (name,), known=(known,), unknown=unknown)
        for name in NAMES
    }


def _numbers(model: PolynomialModel) -> Mapping[str, float]:
    """Return where both rates are zero with the elevator at zero."""
    rows = [
        dict(zip(side.labels(), side.coefficients.tolist(), strict=True)) for side in (model.alpha_dot, model.q_dot)
    ]
    matrix = np.array([[row["alpha"], row["q"]] for row in rows])
    return {"trim_alpha_rad": float(np.linalg.solve(matrix, [-row["1"] for row in rows])[0])}


def _trim(found: Identification) -> PropagatedNumber:
    return propagate(found.model, _numbers)[0]


def test_a_bias_left_in_is_in_the_interval_and_in_a_warning(sweep: Sweep, found: Identification) -> None:
    before, after = _trim(found), _trim(with_instruments(found, sweep, _faults(taken_out=False)))
    assert abs(before.value - TRIM_RAD) > 10.0 * before.linear_error  # the negative control: certain, and wrong
    assert after.value == before.value
    # A bias moves the equilibrium by itself, whatever else the model is.
    assert after.linear_error == pytest.approx(np.hypot(BIAS_RAD, ERROR_RAD), rel=0.03)
    assert after.linear_interval[0] < TRIM_RAD < after.linear_interval[1]
    (said,) = with_instruments(found, sweep, _faults(taken_out=False)).warnings[len(found.warnings) :]
    assert "alpha bias, 1.20 ± 0.20 deg: left in" in said


def test_the_error_of_a_shared_correction_does_not_average_out(sweep: Sweep, found: Identification) -> None:
    shared = _trim(with_instruments(found, sweep, _faults(taken_out=True)))
    own = _trim(with_instruments(found, sweep, _faults(taken_out=True, together=False)))
    assert shared.linear_error == pytest.approx(ERROR_RAD, rel=0.03)
    # Three flights, of errors of their own: about √3 less.
    assert own.linear_error == pytest.approx(ERROR_RAD / np.sqrt(3.0), rel=0.15)


def test_a_scale_and_a_delay_count_too(sweep: Sweep, found: Identification) -> None:
    for name, size in (("alpha scale", 0.05), ("q scale", 0.05), ("alpha delay", 0.02)):
        fault = KnownFault(name=name, value=size, standard_error=0.2 * size, taken_out=True)
        doubt = {flight: InstrumentFaults(together=NAMES, known=(fault,), unknown=()) for flight in NAMES}
        errors = with_instruments(found, sweep, doubt).standard_errors
        assert (errors >= found.standard_errors).all()
        assert (errors > 1.2 * found.standard_errors).any()


def test_what_the_fit_estimates_itself_is_not_counted_twice(sweep: Sweep) -> None:
    asked = identify(sweep, replace(OPTIONS, nuisances=Nuisances(alpha_bias_rad=BIAS_RAD)))
    again = with_instruments(asked, sweep, _faults(taken_out=False, unknown=("alpha bias",)))
    np.testing.assert_array_equal(again.model.covariance, asked.model.covariance)
    assert again.warnings == asked.warnings


def test_what_nothing_tells_is_said(sweep: Sweep, found: Identification) -> None:
    faults = {name: InstrumentFaults(together=NAMES, known=(), unknown=("alpha bias",)) for name in NAMES}
    again = with_instruments(found, sweep, faults)
    np.testing.assert_array_equal(again.model.covariance, found.model.covariance)
    assert "no interval holds" in again.warnings[-1]
    assert "alpha bias" in again.warnings[-1]
    assert with_instruments(found, sweep, {}).warnings == found.warnings  # a run that was made before


def test_what_one_flight_tells_and_another_does_not_is_said_of_each(sweep: Sweep, found: Identification) -> None:
    faults = _faults(taken_out=False, together=False)
    faults[NAMES[0]] = InstrumentFaults(together=(NAMES[0],), known=(), unknown=("alpha bias",))
    untold, told = with_instruments(found, sweep, faults).warnings[-2:]
    assert untold.endswith(f"alpha bias in {NAMES[0]}")
    assert told.startswith(f"alpha bias in {', '.join(NAMES[1:])},")


def test_sizes_are_read_in_degrees() -> None:
    assert with_error(to_si(1.25, "deg"), to_si(0.17, "deg"), "rad") == "1.25 ± 0.17 deg"
    assert with_error(to_si(0.6, "deg_s"), to_si(0.0053, "deg_s"), "rad_s") == "0.6000 ± 0.0053 deg/s"
    assert with_error(0.031, 0.033, "1") == "0.031 ± 0.033"
    assert weight_read(0.1, "m_s2", "rad") == pytest.approx(0.1 * to_si(1.0, "deg"))

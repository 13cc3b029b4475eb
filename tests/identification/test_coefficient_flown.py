"""Coefficients of the simulator's own aircraft, from flights in which airspeed and altitude move."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from finback.flight.airborne import Airborne
from finback.flight.aircraft import find_aircraft
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.power import FixedThrust
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import identify_coefficients
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.records import Condition, FlightRecord, Hold, Schedule, Sweep
from finback.store.model_file import read_model_file
from finback.units import to_si

AIRCRAFT = Path(__file__).resolve().parents[2] / "aircraft"
CONDITION = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
# At 13 km, less V² / r: what the flights feel. The polynomial's condition has standard gravity.
FELT_M_S2 = 9.80665 * (6356766.0 / (6356766.0 + 13026.6)) ** 2 - 280.0**2 / 6.37e6
THRUST_N = 25900.0
FRAME = Airframe(mass_kg=14300.0, wing_area_m2=42.2, chord_m=5.725, pitch_inertia_kg_m2=2.2e5, thrust_n=THRUST_N)
FORM = CoefficientForm.parse(
    Axes.WIND,
    ["1", "alpha", "alpha^2", "alpha^3", "alpha^4"],
    ["1", "alpha", "alpha^2", "alpha^3", "pitch_rate", "elevator"],
    ["1", "alpha", "alpha^2", "alpha^3", "pitch_rate+alpha_rate", "elevator"],
)
NOISE = {
    "airspeed_m_s": 0.2,
    "alpha_rad": to_si(0.1, "deg"),
    "theta_rad": to_si(0.1, "deg"),
    "q_rad_s": to_si(0.1, "deg_s"),
}
# Elevator and amplitude in deg, unit step in s, alpha at the start in deg.
FLOWN = ((0.0, 8.0, 0.6, 0.2), (-10.0, 8.0, 0.7, 5.5), (4.0, 6.0, 0.5, -2.0), (-18.0, 8.0, 0.7, 10.0))
# Twelve numbers; and the tables of the simulator are chords of the polynomials, 0.1 % of a number beside them.
CLOSE = 4.0  # standard errors
CHORDS = 1e-3


def _plan(index: int) -> FlightPlan:
    trim, amplitude, unit, alpha = FLOWN[index]
    starts = 1.0 + unit * np.cumsum([0, 3, 2, 1, 1])
    levels = to_si(trim + amplitude * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0]), "deg")
    ends = starts + np.abs(np.diff(levels))  # at 1 rad/s
    return FlightPlan(
        kind="test",
        name=f"multistep-{index}",
        alpha_rad=to_si(alpha, "deg"),
        q_rad_s=0.0,
        schedule=Schedule(
            time_s=np.concatenate([[0.0], np.stack([starts, ends], axis=1).ravel()]),
            elevator_rad=np.concatenate([levels[:1], np.stack([levels[:-1], levels[1:]], axis=1).ravel()]),
        ),
        hold=Hold.FOH,
        duration_s=12.0,
        sample_interval_s=0.02,
        alpha_limits_rad=(-0.5, 0.75),
        power=FixedThrust(thrust_n=THRUST_N),
    )


@pytest.fixture(scope="module")
def flown() -> tuple[FlightRecord, ...]:
    """Four flights in the plane of symmetry."""
    options = FlightOptions(
        fidelity="symmetric",
        alpha_limits_rad=(-0.5, 0.75),
        elevator_limits_rad=(-0.7, 0.35),
        elevator_rate_rad_s=1.0,
    )
    with Airborne(find_aircraft("f8ii", near=AIRCRAFT), CONDITION, options) as vehicle:
        return tuple(vehicle.fly(_plan(index)) for index in range(len(FLOWN)))


def test_the_f8ii_is_found_again_from_flights_at_any_speed_and_height(flown: tuple[FlightRecord, ...]) -> None:
    speed = np.concatenate([record["airspeed_m_s"] for record in flown])
    height = np.concatenate([record["altitude_m"] for record in flown])
    assert np.ptp(speed) > 60.0
    assert np.ptp(height) > 800.0
    random = np.random.default_rng(4)
    noisy = tuple(
        replace(
            record.with_columns(
                **{name: record[name] + size * random.standard_normal(len(record)) for name, size in NOISE.items()}
            ),
            condition=replace(CONDITION, gravity_m_s2=FELT_M_S2),
        )
        for record in flown
    )
    options = CoefficientOptions(
        airframe=FRAME,
        form=FORM,
        reference_speed_m_s=CONDITION.airspeed_m_s,
        method=CoefficientMethod.OUTPUT_ERROR,
        outputs=tuple(NOISE),
    )
    model = identify_coefficients(Sweep(study="f8ii", records=noisy), options).model
    published = read_model_file(AIRCRAFT / "f8ii" / "published.toml").model()
    # Reduced at the published condition, with standard gravity and without thrust, both are the same motion.
    found = replace(model, airframe=replace(FRAME, thrust_n=0.0)).reduced(CONDITION)
    errors = np.sqrt(np.diag(found.covariance))
    count = found.alpha_dot.coefficients.size
    for polynomial, truth, deviations in (
        (found.alpha_dot, published.alpha_dot, errors[:count]),
        (found.q_dot, published.q_dot, errors[count:]),
    ):
        for powers, value in zip(truth.powers.tolist(), truth.coefficients.tolist(), strict=True):
            row = polynomial.powers.tolist().index(powers)
            off = abs(float(polynomial.coefficients[row]) - value)
            assert off < CLOSE * float(deviations[row]) + CHORDS * abs(value), powers

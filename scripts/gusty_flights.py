"""Flights of known aircraft through disturbed air, many at once: the truth of studies of the coefficient form.

Two aircraft: Morelli's polynomial F-16 (see study_coefficients.py), and a twin-jet transport whose record is coarse,
60 s at 10 Hz with rounded sensors. The transport's numbers are of the size of those of the HFB-320 (Jategaonkar 2006,
Flight Vehicle System Identification, test case 4). The air moves by gusts along and across the body, each with an
exponential correlation, or kicks airspeed, alpha and q as white noise does. Equations are written anew here, in body
axes with the wind beside the motion, and integrated by Runge and Kutta's rule, all seeds at once.

Run as a script (scripts/study-coefficients gusts): are the numbers found again, with errors that are what they say?
Exit code 1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.optimize import fsolve
from study_coefficients import AFT, CHORD_M, F16, FORM, INTERVAL_S, LEVEL, MANEUVERS, NOISE, TRUTH, multistep, trim

from finback.arrays import FloatArray
from finback.errors import FinbackError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import identify_coefficients
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si

SUBSTEPS: Final = 4
CHANNELS: Final = ("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "q_dot_rad_s2", "ax_m_s2", "az_m_s2")

# The transport: S / m, S c / Iy, thrust moment over thrust and inertia as published; the chord is a unit of q c / 2V.
CRUISE: Final = Condition(airspeed_m_s=104.67, density_kg_m3=0.792, gravity_m_s2=9.80665, altitude_m=4300.0)
_MASS_KG: Final = 7472.0
_AREA_M2: Final = 4.028e-3 * _MASS_KG
_INERTIA: Final = _AREA_M2 * 2.0 / 8.0027e-4
TRANSPORT: Final = Airframe(
    mass_kg=_MASS_KG,
    wing_area_m2=_AREA_M2,
    chord_m=2.0,
    pitch_inertia_kg_m2=_INERTIA,
    thrust_angle_rad=0.0524,
    thrust_arm_m=-7.0153e-6 * _INERTIA,
)
DRAG: Final = {"1": 0.124, "speed_ratio": -0.065, "alpha": 0.32}
LIFT: Final = {"1": -0.1, "speed_ratio": 0.155, "alpha": 4.4}
MOMENT: Final = {"1": 0.108, "speed_ratio": 0.01, "alpha": -1.0, "reference_pitch_rate": -45.0, "elevator": -1.6}
TRANSPORT_FORM: Final = CoefficientForm.parse(Axes.WIND, list(DRAG), list(LIFT), list(MOMENT))
TRANSPORT_TRUTH: Final = np.array([*DRAG.values(), *LIFT.values(), *MOMENT.values()])
KICKS: Final = np.array([0.34, 2.5e-3, 3.5e-3])  # m/s, rad, rad/s, per square root of a second
TRANSPORT_NOISE: Final = np.array([0.04, 1.5e-4, 2e-4, 4e-4, 4e-3, 0.01, 0.03])
TRANSPORT_STEPS: Final = np.array([0.04, 1e-4, 1.8e-4, 3.4e-4, 0.0, 0.0, 0.0])  # rounded to; 0: not rounded
_POWERS: Final = np.array(
    [
        [dict(term.monomials[0].factors).get(name, 0) for name in ("alpha_rad", "pitch_rate_1", "elevator_rad")]
        for _, term in FORM.terms
    ]
)

# Limits of the 95 % intervals.
POOLED: Final = 0.93
EACH: Final = 0.85

Three = tuple[FloatArray, FloatArray, FloatArray]
Forces = Callable[[FloatArray, FloatArray, FloatArray, float], Three]
"""Airspeed, alpha, q (seeds,) and elevator -> CX, CZ, Cm about the center of gravity."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """How the air moves.

    Attributes:
        gust_m_s: standard deviation of the gusts across the body; along it they are as large.
        memory_s: time over which they forget.
        kicks: white noise on airspeed, alpha and q per square root of a second, shape (3,).
    """

    gust_m_s: float = 0.0
    memory_s: float = 1.5
    kicks: tuple[float, float, float] = (0.0, 0.0, 0.0)


def polynomial(speed: FloatArray, alpha: FloatArray, q: FloatArray, elevator: float) -> Three:
    """Return CX, CZ and Cm of Morelli's F-16 about the center of gravity."""
    point = np.stack([alpha, q * CHORD_M / (2.0 * speed), np.full(alpha.shape, elevator)])
    powers = [np.ones_like(point)]
    for _ in range(int(_POWERS.max())):
        powers.append(powers[-1] * point)
    table = np.stack(powers)  # (power, variable, seeds)
    terms = TRUTH[:, np.newaxis] * table[_POWERS[:, 0], 0] * table[_POWERS[:, 1], 1] * table[_POWERS[:, 2], 2]
    one, two, _ = FORM.ends()
    cz = terms[one:two].sum(axis=0)
    return terms[:one].sum(axis=0), cz, terms[two:].sum(axis=0) + cz * AFT


def transport(speed: FloatArray, alpha: FloatArray, q: FloatArray, elevator: float) -> Three:
    """Return CX, CZ and Cm of the transport."""
    ratio, rate = speed / CRUISE.airspeed_m_s, q * TRANSPORT.chord_m / (2.0 * CRUISE.airspeed_m_s)
    drag = DRAG["1"] + DRAG["speed_ratio"] * ratio + DRAG["alpha"] * alpha
    lift = LIFT["1"] + LIFT["speed_ratio"] * ratio + LIFT["alpha"] * alpha
    moment = (
        MOMENT["1"]
        + MOMENT["speed_ratio"] * ratio
        + MOMENT["alpha"] * alpha
        + MOMENT["reference_pitch_rate"] * rate
        + MOMENT["elevator"] * elevator
    )
    sine, cosine = np.sin(alpha), np.cos(alpha)
    return lift * sine - drag * cosine, -lift * cosine - drag * sine, moment


def _rates(
    forces: Forces, frame: Airframe, level: Condition, state: FloatArray, wind: FloatArray, inputs: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return rates of u, w, θ, q (4, seeds) and what is measured (7, seeds), the wind beside the motion (2, seeds)."""
    u, w, theta, q = state
    elevator, thrust = inputs
    along, down = u + wind[0], w + wind[1]
    speed, alpha = np.hypot(along, down), np.arctan2(down, along)
    load = 0.5 * level.density_kg_m3 * speed**2 * frame.wing_area_m2
    cx, cz, cm = forces(speed, alpha, q, elevator)
    ax = (load * cx + thrust * np.cos(frame.thrust_angle_rad)) / frame.mass_kg
    az = (load * cz - thrust * np.sin(frame.thrust_angle_rad)) / frame.mass_kg
    turning = (load * frame.chord_m * cm + thrust * frame.thrust_arm_m) / frame.pitch_inertia_kg_m2
    g = level.gravity_m_s2
    rates = np.stack([ax - q * w - g * np.sin(theta), az + q * u + g * np.cos(theta), q, turning])
    return rates, np.stack([speed, alpha, theta, q, turning, ax, az])


def _flown(  # noqa: PLR0913, PLR0917 - an aircraft, its start, its inputs, its air
    forces: Forces,
    frame: Airframe,
    level: Condition,
    start: FloatArray,
    elevator: FloatArray,
    thrust: FloatArray,
    interval_s: float,
    air: Air,
    random: np.random.Generator,
    seeds: int,
) -> FloatArray:
    """Integrate from a start (4,) for every seed; return what is measured, shape (n, 7, seeds)."""
    state = np.repeat(start[:, np.newaxis], seeds, axis=1)
    h = interval_s / SUBSTEPS
    keep = np.exp(-h / air.memory_s)
    wind = air.gust_m_s * random.standard_normal((2, seeds))
    found = np.empty((elevator.size, 7, seeds))
    for i in range(elevator.size):
        found[i] = _rates(forces, frame, level, state, wind, (float(elevator[i]), float(thrust[i])))[1]
        for step in range(SUBSTEPS if i + 1 < elevator.size else 0):
            later = keep * wind + air.gust_m_s * np.sqrt(1.0 - keep**2) * random.standard_normal((2, seeds))
            slope = np.zeros_like(state)
            total = np.zeros_like(state)
            for node, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
                share = (step + node) / SUBSTEPS
                inputs = tuple(float(column[i] + share * (column[i + 1] - column[i])) for column in (elevator, thrust))
                blown = wind + node * (later - wind)
                slope = _rates(forces, frame, level, state + node * h * slope, blown, (inputs[0], inputs[1]))[0]
                total += weight / 6.0 * slope
            state = state + h * total
            wind = later
            speed, turned, pitched = (
                np.sqrt(h) * np.array(air.kicks)[:, np.newaxis] * random.standard_normal((3, seeds))
            )
            size, angle = np.hypot(state[0], state[1]) + speed, np.arctan2(state[1], state[0]) + turned
            state[0], state[1] = size * np.cos(angle), size * np.sin(angle)
            state[3] += pitched
    return found


def _record(
    name: str, level: Condition, interval_s: float, measured: FloatArray, inputs: tuple[FloatArray, FloatArray]
) -> FlightRecord:
    time_s: FloatArray = interval_s * np.arange(len(measured), dtype=np.float64)
    columns = dict(zip(("time_s", "elevator_rad", "thrust_n", *CHANNELS), (time_s, *inputs, *measured.T), strict=True))
    return FlightRecord(
        name=name,
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=level,
        schedule=Schedule(time_s=time_s, elevator_rad=inputs[0]),
        hold=Hold.FOH,
    )


def f16_flights(air: Air, seeds: int, noise: FloatArray, *, first: int = 0) -> list[tuple[FlightRecord, ...]]:
    """Fly the eight maneuvers of study_coefficients.py, with noise (7,), for every seed."""
    random = np.random.default_rng(first)
    every: list[list[FlightRecord]] = [[] for _ in range(seeds)]
    for number, (speed, amplitude_deg, unit_s) in enumerate(MANEUVERS):
        alpha, elevator_rad, thrust_n = trim(speed)
        elevator = multistep(elevator_rad, amplitude_deg, unit_s, 10.0, Hold.FOH)
        thrust = np.full(elevator.size, thrust_n)
        start = np.array([speed * np.cos(alpha), speed * np.sin(alpha), alpha, 0.0])
        flown = _flown(polynomial, F16, LEVEL, start, elevator, thrust, INTERVAL_S, air, random, seeds)
        flown += noise[:, np.newaxis] * random.standard_normal(flown.shape)
        for k in range(seeds):
            every[k].append(_record(f"maneuver-{number}", LEVEL, INTERVAL_S, flown[:, :, k], (elevator, thrust)))
    return [tuple(records) for records in every]


def transport_flights(air: Air, seeds: int, *, first: int = 0) -> list[tuple[FlightRecord, ...]]:
    """Fly 60 s at 10 Hz, a 3-2-1-1 and a doublet, sensors rounded, for every seed."""
    interval_s = 0.1
    time_s = interval_s * np.arange(601)

    def unsteady(unknown: FloatArray) -> list[float]:
        alpha, elevator, thrust = unknown.tolist()
        state = CRUISE.airspeed_m_s * np.array([np.cos(alpha), np.sin(alpha), 0.0, 0.0])
        state[2] = alpha
        still = np.zeros((2, 1))
        rates = _rates(transport, TRANSPORT, CRUISE, state[:, np.newaxis], still, (elevator, 1e4 * thrust))[0]
        return [float(rates[0, 0]), float(rates[1, 0]), float(rates[3, 0])]

    alpha, trimmed, thrust_4 = fsolve(unsteady, [0.1, 0.0, 1.0]).tolist()
    # Corners in s: a 3-2-1-1 of 0.8 s, then a doublet; the elevator moves within 0.2 s.
    corners = np.concatenate([3.0 + 0.8 * np.array([0.0, 3.0, 5.0, 6.0, 7.0]), [30.0, 31.2, 32.4]])
    levels = np.array([0.0, 1.5, -1.5, 1.5, -1.5, 0.0, 1.5, -1.5, 0.0])
    knots = np.stack([corners, corners + 0.2], axis=1).ravel()
    moved = np.interp(time_s, knots, np.stack([levels[:-1], levels[1:]], axis=1).ravel())
    elevator = trimmed + to_si(1.0, "deg") * moved
    thrust = 1e4 * thrust_4 * (1.0 + 0.03 * np.sin(2.0 * np.pi * time_s / 25.0))
    start = np.array([CRUISE.airspeed_m_s * np.cos(alpha), CRUISE.airspeed_m_s * np.sin(alpha), alpha, 0.0])
    random = np.random.default_rng(first)
    flown = _flown(transport, TRANSPORT, CRUISE, start, elevator, thrust, interval_s, air, random, seeds)
    flown += TRANSPORT_NOISE[:, np.newaxis] * random.standard_normal(flown.shape)
    steps = TRANSPORT_STEPS[:, np.newaxis]
    flown = np.where(steps > 0.0, np.round(flown / np.where(steps > 0.0, steps, 1.0)) * steps, flown)
    return [(_record("transport", CRUISE, interval_s, flown[:, :, k], (elevator, thrust)),) for k in range(seeds)]


def main() -> int:
    """Run the study and print what all seeds gave."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--aircraft", choices=("transport", "f16"), default="transport")
    parser.add_argument("--method", choices=list(CoefficientMethod), default=CoefficientMethod.FILTER_ERROR)
    parser.add_argument("--gusts", type=float, default=0.0, metavar="M/S", help="Standard deviation of gusts (0).")
    parser.add_argument("--rough", type=float, default=0.0, help="White noise on the rates, in rough days (0).")
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="Seed of all of them (0).")
    asked = parser.parse_args()
    kicks = (asked.rough * KICKS).tolist()
    air = Air(gust_m_s=asked.gusts, kicks=(kicks[0], kicks[1], kicks[2]))
    if asked.aircraft == "transport":
        sets = transport_flights(air, asked.seeds, first=asked.first)
        frame, form, truth, reference = TRANSPORT, TRANSPORT_FORM, TRANSPORT_TRUTH, CRUISE.airspeed_m_s
    else:
        sets = f16_flights(air, asked.seeds, np.array(list(NOISE.values())), first=asked.first)
        frame, form, truth, reference = F16, FORM, TRUTH, LEVEL.airspeed_m_s
    options = CoefficientOptions(
        airframe=frame, form=form, reference_speed_m_s=reference, method=CoefficientMethod(asked.method)
    )
    offs, errors, told, begun = [], [], 0, time.process_time()
    for records in sets:
        try:
            found = identify_coefficients(Sweep(study=asked.aircraft, records=records), options)
        except FinbackError as refusal:
            print(refusal.message, file=sys.stderr)
            continue
        offs.append(found.model.numbers - truth)
        errors.append(found.model.standard_errors)
        told += any("the motion is disturbed" in warning for warning in found.warnings)
    spent = (time.process_time() - begun) / asked.seeds
    print(f"{len(offs)} of {asked.seeds} seeds, {spent:.2f} s each; turbulence told in {told}")
    return _report(form, np.array(offs), np.array(errors))


def _report(form: CoefficientForm, offs: FloatArray, errors: FloatArray) -> int:
    """Print what all seeds gave, shape (seeds, p); return 1 if intervals hold the truth too seldom."""
    rms, covered = np.sqrt((offs**2).mean(axis=0)), (np.abs(offs) <= 1.959964 * errors).mean(axis=0)
    print(f"{'number':28} {'rms error':>12} {'rms / stated':>13} {'coverage':>9}")
    for row in zip(form.labels(), rms, rms / np.median(errors, axis=0), covered, strict=True):
        print("{:28} {:12.4g} {:13.3f} {:9.3f}".format(*row))
    chance = 3.0 * np.sqrt(0.95 * 0.05 / len(offs))
    print(
        f"coverage: pooled {covered.mean():.3f}, {covered.min():.3f} … {covered.max():.3f} (± {chance:.3f} of chance)"
    )
    return 0 if covered.mean() >= POOLED and covered.min() >= EACH else 1


if __name__ == "__main__":
    sys.exit(main())

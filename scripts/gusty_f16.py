"""A polynomial F-16 that flies through gusts, with a stall that can lag: the truth of studies, known to the last digit.

Coefficients: Morelli 1998, Global nonlinear parametric modeling with application to F-16 aerodynamics, Proc. American
Control Conference. Angles in rad, pitch rate as q c / 2V. The stall is an addition: a share of the flow separates about
an angle of attack, takes lift and adds a nose-down moment, and follows alpha with a time constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.optimize import fsolve

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled
from finback.flight.air import DrydenAir
from finback.flight.turbulence import dryden_gusts
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule
from finback.units import to_si

AREA, CHORD, INERTIA, MASS = 27.870912, 3.450336, 75673.6, 9298.644  # m², m, kg m², kg
GRAVITY, DENSITY = 9.80665, 0.9
CENTER, REFERENCE = 0.28, 0.35  # of gravity and of moments, in chords
STALL_WIDTH_RAD: Final = 0.0262
PITCH_DOWN: Final = 0.15  # moment of the lift that is lost, in chords
INTERVAL_S, SUBSTEPS = 0.01, 4
HELD_SPEED_M_S: Final = 150.0
TRIM_GUESS: Final = np.array([1.2, -0.03, 1.0])  # airspeed in 100 m/s, elevator in rad, thrust in 10 kN


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """What is flown.

    Attributes:
        alpha_rad: of the trim.
        elevator_rad: about the trim, at every sample.
        held: whether airspeed and path are held, as on a rig.
        gust_rad: standard deviation of the vertical gusts over the airspeed.
        length_m: their scale length.
        stall: lift coefficient that is lost when all flow has separated.
        stall_rad: alpha at which half of it has.
        lag_s: time constant of the separation.
        delay_s: of the elevator.
        seed: of the gusts.
    """

    alpha_rad: float
    elevator_rad: FloatArray
    held: bool = False
    gust_rad: float = 0.0
    length_m: float = 300.0
    stall: float = 0.0
    stall_rad: float = 0.244
    lag_s: float = 0.3
    delay_s: float = 0.0
    seed: int = 0


@compiled
def _rates(
    state: FloatArray, elevator: float, gust: float, thrust: float, flow: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rates of (u, w, q, theta, separated share), and (airspeed, alpha, ax, az); ``flow``: held, stall."""
    u, w, q, theta, separated = state
    held, stall, middle, lag = flow
    down = w + gust
    speed = np.sqrt(u * u + down * down)
    a, d = np.arctan2(down, u), elevator
    rate = q * CHORD / (2.0 * speed)
    lost = stall * separated
    cx = (
        -1.943367e-2 + 2.136104e-1 * a - 2.903457e-1 * d**2 - 3.348641e-3 * d - 2.060504e-1 * a * d
        + 6.988016e-1 * a**2 - 9.035381e-1 * a**3
        + (4.833383e-1 + 8.644627 * a + 1.131098e1 * a**2 - 7.422961e1 * a**3 + 6.075776e1 * a**4) * rate
    )  # fmt: skip
    cz = (
        -1.378278e-1 - 4.211369 * a + 4.775187 * a**2 - 1.026225e1 * a**3 + 8.399763 * a**4 - 4.354000e-1 * d
        + (-3.054956e1 - 4.132305e1 * a + 3.292788e2 * a**2 - 6.848038e2 * a**3 + 4.080244e2 * a**4) * rate + lost
    )  # fmt: skip
    cm = (
        -2.029370e-2 + 4.660702e-2 * a - 6.012308e-1 * d - 8.062977e-2 * a * d + 8.320429e-2 * d**2
        + 5.018538e-1 * a**2 * d + 6.378864e-1 * d**3 + 4.226356e-1 * a * d**2
        + (-5.19153 - 3.554716 * a - 3.598636e1 * a**2 + 2.247355e2 * a**3 - 4.120991e2 * a**4 + 2.411750e2 * a**5)
        * rate + cz * (REFERENCE - CENTER) - PITCH_DOWN * lost
    )  # fmt: skip
    pressure = 0.5 * DENSITY * speed * speed * AREA
    ax, az = (pressure * cx + thrust) / MASS, pressure * cz / MASS
    found = np.zeros(5)
    if held > 0.0:
        turn = q + (az * np.cos(a) - pressure * cx / MASS * np.sin(a) + GRAVITY) / speed
        found[0], found[1] = -w * turn, u * turn
    else:
        found[0], found[1] = ax - GRAVITY * np.sin(theta) - q * w, az + GRAVITY * np.cos(theta) + q * u
    found[2], found[3] = pressure * CHORD * cm / INERTIA, q
    found[4] = (1.0 / (1.0 + np.exp(-(a - middle) / STALL_WIDTH_RAD)) - separated) / lag
    return found, np.array([speed, a, ax, az])


@compiled
def _flown(start: FloatArray, elevator: FloatArray, gusts: FloatArray, thrust: float, flow: FloatArray) -> FloatArray:
    """Integrate by Runge and Kutta's rule; elevator and gust are straight between samples."""
    found = np.empty((elevator.size, 6))
    state, step = start.copy(), INTERVAL_S / SUBSTEPS
    slopes, inputs = np.zeros((4, 5)), np.empty(2)
    for i in range(elevator.size):
        seen = _rates(state, elevator[i], gusts[i], thrust, flow)[1]
        found[i, :4], found[i, 4], found[i, 5] = seen, state[2], state[3]
        for k in range(SUBSTEPS if i + 1 < elevator.size else 0):
            for stage in range(4):
                node = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
                share = (k + node) / SUBSTEPS
                inputs[0] = elevator[i] + share * (elevator[i + 1] - elevator[i])
                inputs[1] = gusts[i] + share * (gusts[i + 1] - gusts[i])
                there = state + node * step * slopes[max(stage - 1, 0)] if stage else state
                slopes[stage] = _rates(there, inputs[0], inputs[1], thrust, flow)[0]
            state = state + step / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
    return found


def fly(flight: Flight, name: str) -> FlightRecord:
    """Fly from a level trim (held: from one at the held speed) and return the record, without noise."""
    count, alpha = flight.elevator_rad.size, flight.alpha_rad
    clock: FloatArray = INTERVAL_S * np.arange(count, dtype=np.float64)
    flow = np.array([float(flight.held), flight.stall, flight.stall_rad, flight.lag_s])
    separated = 1.0 / (1.0 + np.exp(-(alpha - flight.stall_rad) / STALL_WIDTH_RAD))

    def state(speed: float, q: float) -> FloatArray:
        return np.array([speed * np.cos(alpha), speed * np.sin(alpha), q, alpha, separated])

    def level(values: FloatArray) -> FloatArray:
        rates, _ = _rates(state(100.0 * values[0], 0.0), values[1], 0.0, 1e4 * values[2], flow)
        return np.asarray(rates[:3])

    def steady(values: FloatArray) -> FloatArray:
        return np.asarray(_rates(state(HELD_SPEED_M_S, values[0]), values[1], 0.0, 0.0, flow)[0][1:3])

    if flight.held:
        q, trim = fsolve(steady, np.array([0.0, -0.03]), xtol=1e-12)
        speed, thrust = HELD_SPEED_M_S, 0.0
    else:
        found = fsolve(level, TRIM_GUESS, xtol=1e-12)
        speed, trim, thrust, q = 100.0 * float(found[0]), found[1], 1e4 * float(found[2]), np.float64(0.0)
    elevator = trim + flight.elevator_rad
    air = DrydenAir(intensity_m_s=flight.gust_rad * speed, length_m=flight.length_m, seed=flight.seed)
    gusts = dryden_gusts(air, airspeed_m_s=speed, step_s=INTERVAL_S, steps=count - 1)[:, 2]
    table = _flown(state(speed, q), np.interp(clock - flight.delay_s, clock, elevator), gusts, thrust, flow)
    columns: dict[str, FloatArray] = {
        "time_s": clock, "elevator_rad": elevator, "alpha_rad": table[:, 1], "q_rad_s": table[:, 4],
        "airspeed_m_s": table[:, 0], "theta_rad": table[:, 5],
        "az_m_s2": table[:, 3],
    }  # fmt: skip
    if flight.held:
        del columns["theta_rad"]
    return FlightRecord(
        name=name, columns=columns, outcome=Outcome.COMPLETED, note="", hold=Hold.FOH,
        condition=Condition(airspeed_m_s=speed, density_kg_m3=DENSITY, gravity_m_s2=GRAVITY, altitude_m=3100.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.full(1, trim)),
    )  # fmt: skip


def wave(kind: str, amplitude_deg: float, duration_s: float) -> FloatArray:
    """Return the elevator about the trim in rad: a 3-2-1-1 of 0.7 s at 60 deg/s, a multisine or a sweep to 1.5 Hz."""
    clock = INTERVAL_S * np.arange(round(duration_s / INTERVAL_S) + 1)
    if kind == "3-2-1-1":
        knots = 1.0 + 0.7 * np.array([0.0, 3.0, 5.0, 6.0, 7.0])
        ramp = amplitude_deg / 60.0
        times = np.stack([knots, knots + ramp * np.array([1.0, 2.0, 2.0, 2.0, 1.0])], axis=1).ravel()
        shape = np.interp(clock, times, [0.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 0.0])
    elif kind == "multisine":
        period = duration_s - 2.0
        lines = np.arange(2, int(1.5 * period) + 1)
        phases = np.pi * (lines - 2) ** 2 / lines.size  # Schroeder 1970
        shape = np.cos(2.0 * np.pi * lines / period * clock[:, np.newaxis] + phases).sum(axis=1)
        shape = shape / np.abs(shape).max()
    else:
        growth = np.log(15.0) / (duration_s - 2.0)
        since = np.clip(clock - 0.5, 0.0, duration_s - 2.0)
        shape = np.sin(2.0 * np.pi * 0.1 * np.expm1(growth * since) / growth) * (since < duration_s - 2.0)
    return to_si(amplitude_deg, "deg") * np.asarray(shape)

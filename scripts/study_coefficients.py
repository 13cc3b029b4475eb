"""Are the coefficients of an aircraft recovered from its own flights, with errors that are what they say?

The truth is Morelli's polynomial model of the F-16 (Morelli 1998, "Global nonlinear parametric modeling with
application to F-16 aerodynamics", ACC), flown with its airspeed moving by an integrator of this script's own: body
axes, DOP853. For each seed noise is added, 37 numbers of CX, CZ and Cm are estimated, and compared. Exit code 1 if a
limit is missed.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from finback.arrays import FloatArray
from finback.errors import FinbackError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import identify_coefficients
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import from_si, to_si

# Angles in rad; as coded in AeroBenchVVPython (morellif16.py).
AXIAL: Final = {
    "1": -1.943367e-2, "alpha": 2.136104e-1, "elevator^2": -2.903457e-1, "elevator": -3.348641e-3,
    "alpha*elevator": -2.060504e-1, "alpha^2": 6.988016e-1, "alpha^3": -9.035381e-1, "pitch_rate": 4.833383e-1,
    "alpha*pitch_rate": 8.644627, "alpha^2*pitch_rate": 1.131098e1, "alpha^3*pitch_rate": -7.422961e1,
    "alpha^4*pitch_rate": 6.075776e1,
}  # fmt: skip
NORMAL: Final = {
    "1": -1.378278e-1, "alpha": -4.211369, "alpha^2": 4.775187, "alpha^3": -1.026225e1, "alpha^4": 8.399763,
    "elevator": -4.354000e-1, "pitch_rate": -3.054956e1, "alpha*pitch_rate": -4.132305e1,
    "alpha^2*pitch_rate": 3.292788e2, "alpha^3*pitch_rate": -6.848038e2, "alpha^4*pitch_rate": 4.080244e2,
}  # fmt: skip
PITCHING: Final = {
    "1": -2.029370e-2, "alpha": 4.660702e-2, "elevator": -6.012308e-1, "alpha*elevator": -8.062977e-2,
    "elevator^2": 8.320429e-2, "alpha^2*elevator": 5.018538e-1, "elevator^3": 6.378864e-1,
    "alpha*elevator^2": 4.226356e-1, "pitch_rate": -5.19153, "alpha*pitch_rate": -3.554716,
    "alpha^2*pitch_rate": -3.598636e1, "alpha^3*pitch_rate": 2.247355e2, "alpha^4*pitch_rate": -4.120991e2,
    "alpha^5*pitch_rate": 2.411750e2,
}  # fmt: skip
TRUTH: Final = np.array([*AXIAL.values(), *NORMAL.values(), *PITCHING.values()])
FORM: Final = CoefficientForm.parse(Axes.BODY, list(AXIAL), list(NORMAL), list(PITCHING))
_POWERS: Final = np.array(
    [
        [dict(term.monomials[0].factors).get(name, 0) for name in ("alpha_rad", "pitch_rate_1", "elevator_rad")]
        for _, term in FORM.terms
    ]
)
CHORD_M: Final = to_si(11.32, "ft")
AFT: Final = 0.05  # of the chord that the reference point of Cm lies behind the center of gravity: 0.35 to 0.30
F16: Final = Airframe(
    mass_kg=to_si(20500.0, "lb"),
    wing_area_m2=to_si(300.0, "ft2"),
    chord_m=CHORD_M,
    pitch_inertia_kg_m2=to_si(55814.0, "slug_ft2"),
    reference_x_m=-AFT * CHORD_M,
)
LEVEL: Final = Condition(airspeed_m_s=150.0, density_kg_m3=1.0, gravity_m_s2=9.80665, altitude_m=2000.0)
INTERVAL_S: Final = 0.02
DURATION_S: Final = 10.0
# Trim speed in m/s, amplitude in deg and unit step in s of a 3-2-1-1.
MANEUVERS: Final = (
    (110.0, 4.0, 0.6), (150.0, 4.0, 0.5), (190.0, 4.0, 0.4), (130.0, -8.0, 0.6),
    (150.0, -10.0, 0.6), (180.0, -8.0, 0.7), (120.0, -10.0, 0.5), (190.0, -10.0, 0.5),
)  # fmt: skip
ALPHA_RAD: Final = (to_si(-10.0, "deg"), to_si(45.0, "deg"))
"""Where the polynomials hold: a flight ends where it leaves."""
NOISE: Final = {
    "airspeed_m_s": 0.1,
    "alpha_rad": to_si(0.1, "deg"),
    "theta_rad": to_si(0.1, "deg"),
    "q_rad_s": to_si(0.1, "deg_s"),
    "q_dot_rad_s2": to_si(1.0, "deg_s2"),
    "ax_m_s2": 0.05,
    "az_m_s2": 0.1,
}

# Limits. Chance adds three standard deviations of what so many seeds can tell.
RMS: Final = 1.15  # rms error of every number, in Cramér-Rao bounds
POOLED: Final = (0.93, 0.97)  # of the 95 % intervals
EACH: Final = (0.90, 0.99)


def forces(speed: float, alpha: float, q: float, elevator: float) -> tuple[float, float, float]:
    """Return CX, CZ and Cm about the center of gravity."""
    rate = q * CHORD_M / (2.0 * speed)
    terms = np.prod(np.array([alpha, rate, elevator]) ** _POWERS, axis=1) * TRUTH
    one, two, _ = FORM.ends()
    cx, cz, cm = terms[:one].sum(), terms[one:two].sum(), terms[two:].sum()
    return float(cx), float(cz), float(cm + cz * AFT)


def motion(state: FloatArray, elevator: float, thrust_n: float) -> tuple[float, ...]:
    """Return ax, az, dq/dt and the rates of u, w, θ and q: body axes, x forward and z down."""
    u, w, theta, q = state.tolist()
    speed = float(np.hypot(u, w))
    load = 0.5 * LEVEL.density_kg_m3 * speed**2 * F16.wing_area_m2
    cx, cz, cm = forces(speed, float(np.arctan2(w, u)), q, elevator)
    ax, az = (load * cx + thrust_n) / F16.mass_kg, load * cz / F16.mass_kg
    turning = load * CHORD_M * cm / F16.pitch_inertia_kg_m2
    g = LEVEL.gravity_m_s2
    return ax, az, turning, ax - q * w - g * np.sin(theta), az + q * u + g * np.cos(theta), q, turning


def trim(speed: float) -> tuple[float, float, float]:
    """Return alpha and elevator in rad and thrust in N of level flight."""

    def rates(unknown: FloatArray) -> list[float]:
        alpha, elevator, thrust = unknown.tolist()
        state = np.array([speed * np.cos(alpha), speed * np.sin(alpha), alpha, 0.0])
        *_, forward, down, _, turning = motion(state, elevator, 1e4 * thrust)
        return [forward, down, turning]

    alpha, elevator, thrust = fsolve(rates, [0.1, -0.05, 1.0]).tolist()
    return alpha, elevator, 1e4 * thrust


def multistep(trim_rad: float, amplitude_deg: float, unit_s: float, duration_s: float, hold: Hold) -> FloatArray:
    """Sample a 3-2-1-1 that begins at 1 s: jumps, or straight at 60 deg/s with corners at samples."""
    time_s = INTERVAL_S * np.arange(round(duration_s / INTERVAL_S) + 1)
    starts = 1.0 + unit_s * np.cumsum([0, 3, 2, 1, 1])
    levels = trim_rad + to_si(amplitude_deg, "deg") * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    if hold is Hold.ZOH:
        held: FloatArray = levels[np.searchsorted(starts, time_s + 1e-9, side="right")]
        return held
    moving = np.ceil(np.abs(np.diff(levels)) / to_si(60.0, "deg") / INTERVAL_S) * INTERVAL_S
    knots = np.stack([starts, starts + moving], axis=1).ravel()
    straight: FloatArray = np.interp(time_s, knots, np.stack([levels[:-1], levels[1:]], axis=1).ravel())
    return straight


def fly(
    name: str, speed: float, amplitude_deg: float, unit_s: float, *, hold: Hold, duration_s: float = DURATION_S
) -> FlightRecord:
    """Fly one 3-2-1-1 from level flight until alpha leaves where the polynomials hold."""
    alpha, elevator_rad, thrust = trim(speed)
    elevator = multistep(elevator_rad, amplitude_deg, unit_s, duration_s, hold)
    states = [np.array([speed * np.cos(alpha), speed * np.sin(alpha), alpha, 0.0])]
    for before, after in zip(elevator[:-1].tolist(), elevator[1:].tolist(), strict=True):
        slope = 0.0 if hold is Hold.ZOH else (after - before) / INTERVAL_S

        def rates(time_s: float, state: FloatArray, before: float = before, slope: float = slope) -> tuple[float, ...]:
            return motion(state, before + slope * time_s, thrust)[3:]

        found = solve_ivp(rates, (0.0, INTERVAL_S), states[-1], method="DOP853", rtol=1e-9, atol=1e-9).y[:, -1]
        if not ALPHA_RAD[0] < np.arctan2(found[1], found[0]) < ALPHA_RAD[1]:
            break
        states.append(found)
    flown, elevator = np.array(states), elevator[: len(states)]
    felt = np.array([motion(state, value, thrust)[:3] for state, value in zip(flown, elevator.tolist(), strict=True)])
    columns = {
        "time_s": INTERVAL_S * np.arange(len(states)),
        "airspeed_m_s": np.hypot(flown[:, 0], flown[:, 1]),
        "alpha_rad": np.arctan2(flown[:, 1], flown[:, 0]),
        "theta_rad": flown[:, 2],
        "q_rad_s": flown[:, 3],
        "q_dot_rad_s2": felt[:, 2],
        "ax_m_s2": felt[:, 0],
        "az_m_s2": felt[:, 1],
        "elevator_rad": elevator,
        "thrust_n": np.full(len(states), thrust),
    }
    return FlightRecord(
        name=name,
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=LEVEL,
        schedule=Schedule(time_s=columns["time_s"], elevator_rad=elevator),
        hold=hold,
    )


def flights(hold: Hold = Hold.FOH, count: int = len(MANEUVERS)) -> tuple[FlightRecord, ...]:
    """Fly the first maneuvers of the study, without noise."""
    return tuple(fly(f"maneuver-{i}", *MANEUVERS[i], hold=hold) for i in range(count))


def measured(records: tuple[FlightRecord, ...], seed: int, channels: tuple[str, ...] = tuple(NOISE)) -> Sweep:
    """Add white noise; channels that are not named are left out."""
    random = np.random.default_rng(seed)
    found = []
    for record in records:
        noisy = {name: record[name] + NOISE[name] * random.standard_normal(len(record)) for name in channels}
        kept = {name: record[name] for name in ("time_s", "elevator_rad", "thrust_n")}
        found.append(
            FlightRecord(
                name=record.name,
                columns={**kept, **noisy},
                outcome=record.outcome,
                note="",
                condition=LEVEL,
                schedule=record.schedule,
                hold=record.hold,
            )
        )
    return Sweep(study="morelli", records=tuple(found))


def main() -> int:
    """Run the study and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--method", choices=list(CoefficientMethod), default=CoefficientMethod.OUTPUT_ERROR)
    parser.add_argument("--without-accelerations", action="store_true", help="Only V, alpha, theta and q are measured.")
    asked = parser.parse_args()
    records = flights()
    channels = tuple(NOISE)[:4] if asked.without_accelerations else tuple(NOISE)
    options = CoefficientOptions(
        airframe=F16, form=FORM, reference_speed_m_s=LEVEL.airspeed_m_s, method=CoefficientMethod(asked.method)
    )
    numbers, errors, begun, refused = [], [], time.process_time(), 0
    for seed in range(asked.seeds):
        try:
            model = identify_coefficients(measured(records, seed, channels), options).model
        except FinbackError as refusal:
            refused += 1
            print(f"seed {seed}: {refusal.message}", file=sys.stderr)
            continue
        numbers.append(model.numbers)
        errors.append(model.standard_errors)
    spent = (time.process_time() - begun) / asked.seeds
    return report(np.array(numbers), np.array(errors), spent_s=spent, refused=refused)


def report(numbers: FloatArray, errors: FloatArray, *, spent_s: float, refused: int) -> int:
    """Print what all seeds gave, shape (seeds, p); return 1 if a limit is missed."""
    missed = numbers - TRUTH
    rms = np.sqrt((missed**2).mean(axis=0)) / np.median(errors, axis=0)
    covered = (np.abs(missed) <= 1.959964 * errors).mean(axis=0)
    relative = np.median(np.abs(missed / TRUTH), axis=0)
    print(f"{'number':28} {'truth':>12} {'median error %':>15} {'rms / bound':>12} {'coverage':>9}")
    for row in zip(FORM.labels(), TRUTH, 100.0 * relative, rms, covered, strict=True):
        print("{:28} {:12.5g} {:15.3g} {:12.3f} {:9.3f}".format(*row))
    seeds = len(numbers)
    chance = 3.0 * np.sqrt(0.95 * 0.05 / seeds)
    span = from_si(np.array(ALPHA_RAD), "deg")
    print(f"{seeds} seeds, {refused} refused, {spent_s:.2f} s each; flights within alpha {span[0]:g} … {span[1]:g} deg")
    print(f"rms / bound: worst {rms.max():.3f} (limit {RMS} + {3.0 / np.sqrt(2.0 * seeds):.2f} of chance)")
    print(
        f"coverage: pooled {covered.mean():.3f}, {covered.min():.3f} … {covered.max():.3f} (± {chance:.3f} of chance)"
    )
    good = (
        refused == 0
        and rms.max() <= RMS + 3.0 / np.sqrt(2.0 * seeds)
        and POOLED[0] <= covered.mean() <= POOLED[1]
        and covered.min() >= min(EACH[0], 0.95 - chance)
    )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

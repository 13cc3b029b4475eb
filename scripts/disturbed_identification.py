"""Gusts: which estimator is right in them?

The three maneuvers of judged_identification.py are flown with gusts of alpha (first-order, 0.6 s), sensor noise added.
Errors of the coefficients are compared, and how often their 95 % intervals hold the truth; refused seeds are counted
and left out. Exit code 1 if a limit is missed. Only this script reads the truth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from judged_identification import PATTERN, PUBLISHED, THREE, UNIT_S, WIDTH_95, aligned, trim

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled
from finback.dynamics.model import PolynomialModel
from finback.errors import RefusedError
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.model_file import read_model_file
from finback.units import to_si

GUST_S, SEPARATION_S = 0.6, 0.5
STALL_RAD, STALL_WIDTH_RAD = np.radians(10.0), np.radians(2.0)
NOISE_RAD = np.radians(0.1)
COLUMNS = ("time_s", "alpha_rad", "q_rad_s", "elevator_rad")
OPTIONS = IdentificationOptions(alpha_window_rad=(-0.6, 0.8))
FALSE_ALARMS, FOUND = 0.05, 0.95


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """How the flights are flown.

    Attributes:
        hold: of the elevator between samples.
        rate_hz: samples a second.
        lead_s: quiet time before the maneuver.
        gust_rad: standard deviation of the gusts of alpha.
        lag: pitching moment in rad/s² of a flow that has not separated yet, though it should have.
    """

    hold: Hold = Hold.ZOH
    rate_hz: int = 100
    lead_s: float = 1.0
    gust_rad: float = 0.0
    lag: float = 0.0


@compiled
def _value(powers: FloatArray, coefficients: FloatArray, alpha: float, q: float, elevator: float) -> float:
    total = 0.0
    for k in range(coefficients.size):
        total += coefficients[k] * alpha ** powers[k, 0] * q ** powers[k, 1] * elevator ** powers[k, 2]
    return total


@compiled
def _fly(  # noqa: PLR0913, PLR0917 - a kernel takes its arrays one by one
    first: FloatArray,
    one: FloatArray,
    second: FloatArray,
    two: FloatArray,
    elevator: FloatArray,
    straight: bool,  # noqa: FBT001 - a kernel takes no keywords
    start: FloatArray,
    gusts: FloatArray,
    lag: float,
    step: float,
) -> FloatArray:
    """Integrate by the midpoint rule, four steps a sample; gust and separation stay over each step."""
    state = np.empty((elevator.size, 2))
    alpha, q, gust = start[0], start[1], 0.0
    separated = 1.0 / (1.0 + np.exp(-(alpha - STALL_RAD) / STALL_WIDTH_RAD))
    for i in range(elevator.size):
        state[i, 0], state[i, 1] = alpha + gust, q
        rise = (elevator[min(i + 1, elevator.size - 1)] - elevator[i]) / 4.0 if straight else 0.0
        for k in range(4):
            wanted = 1.0 / (1.0 + np.exp(-(alpha + gust - STALL_RAD) / STALL_WIDTH_RAD))
            separated += step / 4.0 * (wanted - separated) / SEPARATION_S
            moment, moved = lag * (separated - wanted), elevator[i] + (k + 0.5) * rise
            a = alpha + gust
            half = alpha + step / 8.0 * _value(first, one, a, q, moved) + gust
            turned = q + step / 8.0 * (_value(second, two, a, q, moved) + moment)
            alpha += step / 4.0 * _value(first, one, half, turned, moved)
            q += step / 4.0 * (_value(second, two, half, turned, moved) + moment)
        gust += -step / GUST_S * gust + gusts[i]
    return state


def flights(model: PolynomialModel, case: Case, seed: int) -> Sweep:
    """Fly three maneuvers and measure them."""
    random, step = np.random.default_rng(seed), 1.0 / case.rate_hz
    last = round((case.lead_s + 14.0) * case.rate_hz)
    clock = np.linspace(0.0, step * last, last + 1)
    records = []
    for alpha_deg, amplitude_deg in THREE:
        alpha = to_si(alpha_deg, "deg")
        q, level = trim(model, alpha)
        elevator, begin = np.full(clock.size, level), case.lead_s
        for sign, units in PATTERN:
            end = begin + units * UNIT_S
            elevator[(clock >= begin - 1e-9) & (clock < end - 1e-9)] += sign * to_si(amplitude_deg, "deg")
            begin = end
        gusts = case.gust_rad * np.sqrt(2.0 * step / GUST_S) * random.standard_normal(clock.size)
        parts = [(np.array(p.powers, dtype=float), np.array(p.coefficients)) for p in (model.alpha_dot, model.q_dot)]
        start = np.array([alpha, q])
        straight = case.hold is Hold.FOH
        state = _fly(*parts[0], *parts[1], elevator, straight, start, gusts, case.lag, step)
        state += NOISE_RAD * random.standard_normal(state.shape)
        records.append(
            FlightRecord(
                name=f"trim {alpha_deg:g} deg",
                columns=dict(zip(COLUMNS, (clock, state[:, 0], state[:, 1], elevator), strict=True)),
                outcome=Outcome.COMPLETED,
                note="",
                condition=Condition(airspeed_m_s=1.0, density_kg_m3=1.0, gravity_m_s2=1.0, altitude_m=0.0),
                schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.full(1, level)),
                hold=case.hold,
            )
        )
    return Sweep(study="disturbed", records=tuple(records))


def truths() -> Iterator[tuple[str, PolynomialModel]]:
    """Yield the F-8 II model and two aircraft like it, at random."""
    published = read_model_file(PUBLISHED).model()
    yield "F-8 II", published
    random = np.random.default_rng(7)
    for number in (1, 2):
        yield (
            f"random {number}",
            published.with_coefficients(published.coefficients * random.uniform(0.7, 1.3, published.coefficients.size)),
        )


def turbulence(seeds: int) -> bool:
    """Compare the estimators; return whether filter error is better than output error, and its intervals honest."""
    model = read_model_file(PUBLISHED).model()
    fine = True
    print(f"{'gusts deg':<11}{'method':<14}{'rms error / truth: median':>26}{'covered':>9}{'least':>7}{'refused':>9}")
    for gust in (0.1, 0.3):
        rms: dict[Method, float] = {}
        for method in (Method.WEAK_FORM, Method.OUTPUT_ERROR, Method.FILTER_ERROR):
            case, off, inside, refused = Case(gust_rad=to_si(gust, "deg")), [], [], 0
            for seed in range(seeds):
                try:
                    found = identify(flights(model, case, seed), replace(OPTIONS, method=method))
                except RefusedError:
                    refused += 1
                    continue
                errors = found.model.with_coefficients(found.standard_errors)
                off.append(aligned(found.model, model) - model.coefficients)
                inside.append(np.abs(off[-1]) < WIDTH_95 * aligned(errors, model))
            rms[method] = float(np.median(np.sqrt(np.mean(np.square(off), axis=0)) / np.abs(model.coefficients)))
            each = np.mean(inside, axis=0)
            line = f"{gust:<11}{method:<14}{rms[method]:>26.3f}{each.mean():>9.3f}{each.min():>7.2f}{refused:>9}"
            print(line, flush=True)
        fine &= rms[Method.FILTER_ERROR] < rms[Method.OUTPUT_ERROR] and bool(each.mean() >= 0.93)
    return fine


def main() -> int:
    """Compare them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=40, metavar="N", help="number of seeds (40)")
    return 0 if turbulence(parser.parse_args().seeds) else 1


if __name__ == "__main__":
    sys.exit(main())

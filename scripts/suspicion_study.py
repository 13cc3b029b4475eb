"""How often are records suspected wrongly, and how often rightly?

False alarms: calm, attached flights of JSBSim aircraft (rig, symmetric, free), of Morelli's F-16 and of the published
F-8 II model, each flown once and measured with other noise for every seed. Power: the same with gusts (Dryden), a stall
whose separation lags, a pitching moment that lags, an elevator that acts late. A record is a set of three flights at
three trims. Exit code 1 if more than 5 % of a calm condition are suspected, or fewer than 90 % of a row that must be
found. Only this script reads the truth.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, product
from pathlib import Path
from typing import Final

import numpy as np
from disturbed_identification import Case, flights, truths
from gusty_f16 import Flight, fly, wave
from scipy.signal import lfilter
from scipy.stats import beta

from finback.dynamics.model import PolynomialModel
from finback.errors import RefusedError
from finback.flight import excitation
from finback.flight.air import CALM, Air, DrydenAir
from finback.flight.aircraft import find_aircraft
from finback.flight.equilibrium import trim
from finback.flight.excitation import ThreeTwoOneOne
from finback.flight.oscillation import LogSweep, MultisineInput
from finback.flight.plan import Drive, FlightOptions, FlightPlan
from finback.flight.power import ENGINES_OFF, FixedThrust
from finback.flight.vehicle import make_vehicle
from finback.identification.identify import identify
from finback.identification.options import IdentificationOptions
from finback.identification.suspicions.finding import Suspect
from finback.identification.suspicions.lift import lift_hysteresis
from finback.records import Condition, FlightRecord, Hold, Sweep
from finback.units import to_si

Records = tuple[FlightRecord, ...]
Seen = Callable[[int], Records]

OPTIONS: Final = IdentificationOptions(alpha_window_rad=(-0.6, 0.8))
COARSE: Final = replace(OPTIONS, half_width_s=0.4, spacing_s=0.1)
FALSE_ALARMS, FOUND = 0.05, 0.9
LIMITS_RAD: Final = (to_si(-33.0, "deg"), to_si(46.0, "deg"))
ELEVATOR_RAD: Final = (to_si(-40.0, "deg"), to_si(20.0, "deg"))
RATE_RAD_S: Final = to_si(60.0, "deg")
DURATION_S: Final = 20.0
HIGH: Final = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
LOW: Final = Condition(airspeed_m_s=180.0, density_kg_m3=0.66, gravity_m_s2=9.80665, altitude_m=6000.0)
AIRCRAFT: Final = {
    "f8ii": (HIGH, (-3.5, -10.0, -16.0)),
    "f8ii-r": (HIGH, (-3.5, -10.0, -16.0)),
    "f16": (LOW, (-1.5, -2.0, -2.5)),
}
SHORT: Final = {Suspect.TURBULENCE: "turb.", Suspect.HYSTERESIS: "hyst.", Suspect.INPUT: "input"}


def flown(name: str, fidelity: str, kind: str, air: Air = CALM) -> Records:
    """Fly three maneuvers of a JSBSim aircraft; engines give a constant thrust where the airspeed moves."""
    condition, elevators = AIRCRAFT[name]
    options = FlightOptions(
        fidelity=fidelity, alpha_limits_rad=LIMITS_RAD, elevator_limits_rad=ELEVATOR_RAD,
        elevator_rate_rad_s=RATE_RAD_S, drive=Drive.DIRECT if fidelity == "free" else Drive.OWN,
    )  # fmt: skip
    power = ENGINES_OFF if fidelity == "rig" else FixedThrust(thrust_n=30e3)
    found = []
    with make_vehicle(find_aircraft(name, near=Path.cwd()), condition, options) as vehicle:
        for number, elevator in enumerate(elevators):
            level = trim(vehicle.derivatives, elevator_rad=to_si(elevator, "deg"), alpha_limits_rad=LIMITS_RAD)
            plan = FlightPlan(
                name=f"{kind} {number}", kind=kind, alpha_rad=level.alpha_rad, q_rad_s=level.q_rad_s,
                schedule=excitation.schedule(
                    _maneuver(kind, to_si(elevator, "deg")), rate_limit_rad_s=RATE_RAD_S, limits_rad=ELEVATOR_RAD,
                    grid_s=0.01,
                ),
                hold=Hold.FOH, duration_s=DURATION_S, sample_interval_s=0.01, alpha_limits_rad=LIMITS_RAD, power=power,
                air=replace(air, seed=air.seed + number) if isinstance(air, DrydenAir) else air,
            )  # fmt: skip
            found.append(vehicle.fly(plan))
    return tuple(found)


def _maneuver(kind: str, elevator: float) -> ThreeTwoOneOne | LogSweep | MultisineInput:
    size = to_si(2.0, "deg")
    if kind == "3-2-1-1":
        return ThreeTwoOneOne(elevator_rad=elevator, amplitude_rad=size, unit_s=0.7, lead_s=1.0, duration_s=DURATION_S)
    if kind == "sweep":
        return LogSweep(
            elevator_rad=elevator, amplitude_rad=size, from_1_s=0.1, to_1_s=1.5, sweep_s=18.5, lead_s=0.5,
            duration_s=DURATION_S,
        )  # fmt: skip
    return MultisineInput(
        elevator_rad=elevator, amplitude_rad=size, lowest_1_s=0.1, highest_1_s=1.5, period_s=18.0, lead_s=0.5,
        duration_s=DURATION_S,
    )  # fmt: skip


def f16(kind: str, seed: int, trims_deg: tuple[float, ...] = (4.0, 8.0, 12.0), **changes: float) -> Records:
    """Fly Morelli's F-16 at three trims; ``changes`` are fields of ``Flight``."""
    return tuple(
        fly(
            Flight(
                alpha_rad=to_si(alpha, "deg"), elevator_rad=wave(kind, 2.0, DURATION_S), seed=1000 * seed + number,
                **changes,  # type: ignore[arg-type] # held is a bool, seed is given
            ),
            f"{kind} {number}",
        )
        for number, alpha in enumerate(trims_deg)
    )  # fmt: skip


def measured(  # noqa: PLR0913 - what sensors do, one by one
    records: Records,
    seed: int,
    *,
    noise_deg: float = 0.1,
    bias_deg: float = 0.0,
    colored_deg: float = 0.0,
    correlation_s: float = 0.1,
    speed: bool = True,
) -> Records:
    """Add white noise, biases of alpha that differ between flights, colored noise of alpha; or drop the airspeed."""
    random, found = np.random.default_rng(seed), []
    for record, sign in zip(records, (1.0, -1.0, 0.5), strict=True):
        white = to_si(noise_deg, "deg") * random.standard_normal((2, len(record)))
        stays = np.exp(-0.01 / correlation_s)
        driven = to_si(colored_deg, "deg") * np.sqrt(1.0 - stays**2) * random.standard_normal(len(record))
        alpha = record["alpha_rad"] + white[0] + to_si(bias_deg * sign, "deg") + lfilter([1.0], [1.0, -stays], driven)
        normal = record.or_zero("az_m_s2") + 0.1 * random.standard_normal(len(record)) + 0.2 * random.standard_normal()
        kept = {k: v for k, v in record.columns.items() if speed or k not in ("airspeed_m_s", "theta_rad")}
        found.append(
            replace(
                record,
                columns={**kept, "alpha_rad": alpha, "q_rad_s": record["q_rad_s"] + white[1]}
                | ({"az_m_s2": normal} if "az_m_s2" in kept else {}),
            )
        )
    return tuple(found)


def calm() -> Iterator[tuple[str, Seen, IdentificationOptions]]:
    """Yield every calm condition: its name, the record of a seed, the options of the fit."""
    for name, fidelity, kind in (
        ("f8ii", "rig", "3-2-1-1"), ("f8ii", "rig", "multisine"), ("f8ii", "symmetric", "3-2-1-1"),
        ("f8ii", "symmetric", "multisine"), ("f8ii", "free", "sweep"), ("f8ii-r", "symmetric", "3-2-1-1"),
        ("f16", "rig", "3-2-1-1"), ("f16", "rig", "multisine"), ("f16", "symmetric", "3-2-1-1"),
        ("f16", "free", "sweep"),
    ):  # fmt: skip
        yield f"{name} {fidelity} {kind}", partial(measured, flown(name, fidelity, kind)), OPTIONS
    symmetric = flown("f8ii", "symmetric", "3-2-1-1")
    yield "f8ii symmetric 3-2-1-1, no airspeed", partial(measured, symmetric, speed=False), OPTIONS
    for noise in (0.03, 0.3):
        yield f"f8ii symmetric 3-2-1-1, noise {noise} deg", partial(measured, symmetric, noise_deg=noise), OPTIONS
    rig = flown("f8ii", "rig", "3-2-1-1")
    yield "f8ii rig 3-2-1-1, bias 0.1 deg", partial(measured, rig, bias_deg=0.1), OPTIONS
    yield "f8ii rig 3-2-1-1, colored 0.1 deg", partial(measured, rig, colored_deg=0.1), OPTIONS
    for held, kind in ((True, "3-2-1-1"), (True, "multisine"), (False, "3-2-1-1"), (False, "multisine")):
        yield (
            f"F-16 polynomials {'rig' if held else 'level'} {kind}",
            partial(measured, f16(kind, 0, held=held)),
            OPTIONS,
        )
    for name, model in truths():
        yield f"{name} polynomials, 25 Hz", partial(_coarse, model), COARSE


def _coarse(model: PolynomialModel, seed: int) -> Records:
    return flights(model, Case(hold=Hold.ZOH, rate_hz=25, lead_s=8.0), seed).records


Disturbed = Iterator[tuple[str, Seen, Suspect, bool]]
"""A condition: its name, the record of a seed, what must be found, whether it must be."""


def gusts() -> Disturbed:
    """Yield flights in Dryden gusts."""

    def polynomials(seed: int, *, held: bool, kind: str, gust_deg: float, noise_deg: float) -> Records:
        return measured(f16(kind, seed + 1, held=held, gust_rad=to_si(gust_deg, "deg")), seed, noise_deg=noise_deg)

    def simulator(seed: int, *, intensity_m_s: float) -> Records:
        air = DrydenAir(intensity_m_s=intensity_m_s, length_m=500.0, seed=100 * seed)
        return measured(flown("f8ii", "free", "3-2-1-1", air), seed)

    for held, kind in product((True, False), ("3-2-1-1", "multisine")):
        for gust, noise in ((0.1, 0.03), (0.1, 0.1), (0.3, 0.1), (0.3, 0.3), (1.0, 0.3), (0.1, 0.3)):
            name = f"F-16 polynomials {_named(held)} {kind}, gusts {gust} deg, noise {noise} deg"
            seen = partial(polynomials, held=held, kind=kind, gust_deg=gust, noise_deg=noise)
            yield name, seen, Suspect.TURBULENCE, gust >= noise
    for intensity in (0.5, 1.5):  # 0.1 and 0.3 deg
        name = f"f8ii free 3-2-1-1, gusts {intensity} m/s"
        yield name, partial(simulator, intensity_m_s=intensity), Suspect.TURBULENCE, True


def stalls() -> Disturbed:
    """Yield flights with a flow or a moment that lags behind alpha."""

    def separating(seed: int, *, kind: str, lag_s: float) -> Records:
        return measured(f16(kind, 0, (8.0, 12.0, 15.0), held=True, stall=0.3, lag_s=lag_s), seed)

    def lagging(seed: int, *, lag: float) -> Records:
        records = flights(next(truths())[1], Case(lag=lag), seed).records
        return tuple(record.with_columns(airspeed_m_s=np.full(len(record), HIGH.airspeed_m_s)) for record in records)

    for kind, lag in product(("3-2-1-1", "multisine", "sweep"), (0.05, 0.2, 0.5)):
        name = f"F-16 polynomials rig {kind}, stall lags {lag} s"
        yield name, partial(separating, kind=kind, lag_s=lag), Suspect.HYSTERESIS, lag > 0.1
    for lag in (0.1, 0.5, 2.0):
        name = f"F-8 II polynomials, moment of {lag} rad/s² lags 0.5 s"
        yield name, partial(lagging, lag=lag), Suspect.HYSTERESIS, lag > 0.1


def delays() -> Disturbed:
    """Yield flights whose elevator acts late."""

    def late(seed: int, *, held: bool, delay_s: float) -> Records:
        return measured(f16("3-2-1-1", 0, held=held, delay_s=delay_s), seed)

    for held, delay in product((True, False), (0.02, 0.05, 0.1)):
        name = f"F-16 polynomials {_named(held)}, elevator {delay} s late"
        yield name, partial(late, held=held, delay_s=delay), Suspect.INPUT, True


def _named(held: bool) -> str:  # noqa: FBT001 - the word for it
    return "rig" if held else "level"


def slow_stalls(seeds: int) -> None:
    """Print how often slow pulls through a stall are found by the lift alone; no model can be fitted to them."""
    clock = np.arange(4001) * 0.01
    pull = -3.0 * np.interp(clock, [0, 3, 15, 20, 28, 34, 40], [0.0, 0.0, 1.0, 0.4, 1.1, 0.3, 0.0])
    print("\n| slow pulls | found | 95 % interval | records |")
    print("|---|---|---|---|")
    for pump, (stall, lag) in product((0.0, 1.0), ((0.0, 0.3), (0.3, 0.1), (0.3, 0.3), (0.3, 1.0))):
        elevator = to_si(pull + pump * np.sin(1.2 * np.pi * clock) * ((clock > 8.0) & (clock < 36.0)), "deg")
        records = tuple(
            fly(Flight(alpha_rad=to_si(alpha, "deg"), elevator_rad=elevator, stall=stall, lag_s=lag), f"pull {alpha}")
            for alpha in (6.0, 7.0, 8.0)
        )
        count = sum(lift_hysteresis(measured(records, seed))[0].raised for seed in range(seeds))
        name = f"pumped by {pump} deg, " + (f"stall lags {lag} s" if stall else "no stall")
        print(f"| {name} | {count} | {interval(count, seeds)} | {seeds} |", flush=True)


def alarms(seen: Seen, options: IdentificationOptions, seeds: int) -> tuple[Counter[Suspect], Counter[Suspect], int]:
    """Count alarms and checks that were not judged over seeds, and seeds whose fit was not refused."""
    raised: Counter[Suspect] = Counter()
    unjudged: Counter[Suspect] = Counter()
    fitted = 0
    for seed in range(seeds):
        try:
            found = identify(Sweep(study="suspicions", records=seen(seed)), options)
        except RefusedError:
            continue
        fitted += 1
        raised.update({doubt.suspect for doubt in found.suspicions if doubt.raised})
        unjudged.update({doubt.suspect for doubt in found.suspicions if not doubt.judged})
    return raised, unjudged, fitted


def interval(count: int, of: int) -> str:
    """Return the 95 % interval of a share (Clopper and Pearson 1934), in percent."""
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{100 * low:.0f}…{100 * high:.0f} %"


def main() -> int:
    """Count both kinds of errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200, metavar="N", help="records of each calm condition (200)")
    parser.add_argument("--power", type=int, default=40, metavar="N", help="records of each disturbed condition (40)")
    parser.add_argument("--only", default="", metavar="TEXT", help="conditions whose name has this text")
    asked = parser.parse_args()
    fine = True
    print(
        "| calm condition | "
        + " | ".join(SHORT.values())
        + " | turb. not judged | records |\n|---|---|---|---|---|---|"
    )
    for name, seen, options in calm():
        if asked.only not in name:
            continue
        raised, unjudged, fitted = alarms(seen, options, asked.seeds)
        fine &= all(count <= FALSE_ALARMS * fitted for count in raised.values())
        counts = " | ".join(str(raised[suspect]) for suspect in SHORT)
        print(f"| {name} | {counts} | {unjudged[Suspect.TURBULENCE]} | {fitted} |", flush=True)
    print("\n| disturbed condition | found | 95 % interval | other alarms | not judged | records |")
    print("|---|---|---|---|---|---|")
    for name, seen, wanted, must in chain(gusts(), stalls(), delays()):
        if asked.only not in name:
            continue
        raised, unjudged, fitted = alarms(seen, OPTIONS, asked.power)
        fine &= not must or raised[wanted] >= FOUND * fitted
        others = ", ".join(
            f"{SHORT[other]} {raised[other]}" for other in SHORT if other is not wanted and raised[other]
        )
        found = f"{raised[wanted]} | {interval(raised[wanted], fitted)}" if fitted else "0 | "
        print(f"| {name} | {found} | {others or 'none'} | {unjudged[wanted]} | {fitted} |", flush=True)
    if asked.only in "slow pulls":
        slow_stalls(asked.power)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())

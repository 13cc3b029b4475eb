"""Suspicions on aircraft on which no threshold was set: calm and rough air, attached flow and stalls that lag.

A business jet, a transport and a small unmanned aircraft, each with the sensors it may have, at 10 to 50 Hz. A refused
fit counts as found if the refusal names what is looked for. Exit code 1 if more than 5 % of a calm condition are
suspected, or fewer than 90 % of a disturbed one found. Only this script reads the truth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from held_out_aircraft import (
    CHEAP,
    JET,
    LOGGER,
    TENTH,
    TRANSPORT,
    UNMANNED,
    Airplane,
    Mission,
    Sensing,
    fly,
    slow_stalls,
    stalling,
    steps,
)

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.suspicions.finding import Suspect
from finback.identification.suspicions.lift import lift_hysteresis
from finback.records import FlightRecord, Sweep

Case = tuple[str, Airplane, Sensing, int, float, tuple[FloatArray, ...]]

CASES: Final[tuple[Case, ...]] = (
    ("jet, 10 Hz, 20 s", JET, LOGGER, 10, 300.0, (steps(20.0, 0.7, 2.0),)),
    ("jet, 25 Hz, 20 s", JET, LOGGER, 25, 300.0, (steps(20.0, 0.7, 2.0),)),
    ("jet, 10 Hz, 60 s", JET, LOGGER, 10, 300.0, (steps(60.0, 0.8, 1.5, starts_s=(3.0, 30.0)),)),
    ("jet, 25 Hz, 60 s", JET, LOGGER, 25, 300.0, (steps(60.0, 0.8, 1.5, starts_s=(3.0, 30.0)),)),
    ("transport, 25 Hz, 20 s", TRANSPORT, TENTH, 25, 300.0, (steps(20.0, 0.7, 2.0),)),
    ("transport, 50 Hz, 3 x 20 s", TRANSPORT, TENTH, 50, 300.0, tuple(steps(20.0, 0.7, a) for a in (2.0, 1.0, -2.0))),
    ("unmanned, 50 Hz, 20 s", UNMANNED, CHEAP, 50, 100.0, (steps(20.0, 0.3, 3.0),)),
    ("unmanned, 50 Hz, 3 x 15 s", UNMANNED, CHEAP, 50, 100.0, tuple(steps(15.0, 0.3, a) for a in (3.0, 2.0, -3.0))),
)
AT_REST: Final[tuple[Case, ...]] = (
    ("jet, 25 Hz, 30 s, elevator at rest", JET, LOGGER, 25, 300.0, (steps(30.0, 0.7, 0.0),)),
    ("transport, 25 Hz, 30 s, elevator at rest", TRANSPORT, TENTH, 25, 300.0, (steps(30.0, 0.7, 0.0),)),
)
STALLS: Final = ((15.0, 15.0, 0.2, 0.0), (15.0, 25.0, 0.5, 0.0), (18.0, 20.0, 0.3, 5.0), (20.0, 15.0, 0.02, 5.0),
                 (20.0, 25.0, 0.2, 5.0))  # fmt: skip
"""Stall angle in deg, steepness, relaxation time in s, lag in chords."""
ALLOWED, WANTED = 0.05, 0.9
WITHOUT_SPEED: Final = ("airspeed_m_s", "theta_rad")


def records(case: Case, gust_m_s: float, seed: int, *, speed: bool = True) -> tuple[FlightRecord, ...]:
    """Fly a case."""
    _, airplane, sensing, rate_hz, length_m, elevators = case
    found = []
    for number, elevator in enumerate(elevators):
        mission = Mission(rate_hz=rate_hz, elevator_rad=elevator, gust_m_s=gust_m_s, length_m=length_m)
        record = fly(airplane, mission, sensing, seed=seed + 1000 * number, name=f"flight {number}")
        kept = {name: column for name, column in record.columns.items() if speed or name not in WITHOUT_SPEED}
        found.append(replace(record, columns=kept))
    return tuple(found)


def options(case: Case, method: Method) -> IdentificationOptions:
    """Return options for a linear model: test functions as narrow as the sampling allows."""
    half = max(0.2, 8.0 / case[3])
    return IdentificationOptions(
        alpha_window_rad=(-0.6, 0.8), alpha_order=(1, 1), half_width_s=half, spacing_s=half / 4.0, method=method
    )


def suspected(flown: tuple[FlightRecord, ...], chosen: IdentificationOptions) -> tuple[set[Suspect], set[Suspect]]:
    """Return what is raised, and what is not judged."""
    try:
        found = identify(Sweep(study="held out", records=flown), chosen).suspicions
    except RefusedError as refusal:
        named = {Suspect.TURBULENCE: "the air was not calm", Suspect.HYSTERESIS: "stall hysteresis"}
        return {suspect for suspect, words in named.items() if words in refusal.message}, set()
    return {one.suspect for one in found if one.raised}, {one.suspect for one in found if not one.judged}


def flights(seeds: int, power: int, only: str) -> Iterator[bool]:
    """Print the rows of maneuvers; yield whether each is as it must be."""
    print("| record | method | gusts m/s | turb. | hyst. | input | not judged: turb., hyst., input | records |")
    print("|---|---|--:|--:|--:|--:|--:|--:|")
    plain = ((case, Method.WEAK_FORM, speed) for case in CASES for speed in (True, False))
    resting = ((case, Method.WEAK_FORM, True) for case in AT_REST)
    following = ((case, method, True) for method in (Method.OUTPUT_ERROR, Method.FREQUENCY) for case in CASES[1:7:3])
    for case, method, speed in (*plain, *resting, *following):
        name = case[0] + ("" if speed else ", airspeed not recorded")
        for gust in (0.0, 1.0, 2.0) if only in name else ():
            count = power if gust else seeds
            outcomes = [
                suspected(records(case, gust, seed, speed=speed), options(case, method)) for seed in range(count)
            ]
            raised = [sum(suspect in one for one, _ in outcomes) for suspect in Suspect]
            unjudged = [sum(suspect in one for _, one in outcomes) for suspect in Suspect]
            counts = " | ".join(map(str, raised))
            print(
                f"| {name} | {method} | {gust:g} | {counts} | {', '.join(map(str, unjudged))} | {count} |", flush=True
            )
            yield raised[0] >= WANTED * count if gust else max(raised) <= ALLOWED * count


def stalls(seeds: int) -> Iterator[bool]:
    """Print the rows of slow stalls, by the lift alone; yield whether each is as it must be."""
    print(
        "\n| slow stalls of the transport, 25 Hz | beyond, deg | entries | lag found | records |\n|---|--:|--:|--:|--:|"
    )
    for stall, (beyond, wanted), entries in (
        (stall, reach, entries)
        for stall in STALLS
        for reach in ((-7.0, False), (2.0, True), (4.0, True))
        for entries in (1, 3)
    ):
        airplane = stalling(*stall)
        count = 0
        for seed in range(seeds):
            flown = tuple(
                fly(
                    airplane,
                    slow_stalls(airplane, entries=4 - entries, beyond_deg=beyond, top_deg=stall[0], seed=9 * seed + k),
                    TENTH, seed=9 * seed + k, name=f"stall {k}",
                )
                for k in range(entries)
            )  # fmt: skip
            count += lift_hysteresis(flown)[0].raised
        said = f"{stall[0]:g} deg, steepness {stall[1]:g}, {stall[2]:g} s, {stall[3]:g} chords"
        print(f"| {said} | {beyond:g} | {entries} flights of {4 - entries} | {count} | {seeds} |", flush=True)
        yield count >= WANTED * seeds if wanted else count <= ALLOWED * seeds


def main() -> int:
    """Count both kinds of errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=40, metavar="N", help="records of each calm condition (40)")
    parser.add_argument("--power", type=int, default=10, metavar="N", help="records of each disturbed condition (10)")
    parser.add_argument("--only", default="", metavar="TEXT", help="records whose name has this text; 'stalls'")
    asked = parser.parse_args()
    fine = [] if asked.only == "stalls" else list(flights(asked.seeds, asked.power, asked.only))
    if asked.only in "stalls":
        fine += list(stalls(asked.power))
    return 0 if all(fine) else 1


if __name__ == "__main__":
    sys.exit(main())

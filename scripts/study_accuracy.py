"""Violent flights of aircraft in every fidelity at the default step, against half the step and against DOP853.

Releases and steps of the elevator, drawn over the whole of alpha up to 40 deg and pitch rates up to 60 deg/s, 10 s
each. Exit code 1 if a regular flight is not within its bar, or the two roads to its error are more than a factor of ten
apart.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.flight.accuracy import FlightAccuracy, SweepAccuracy, sweep_accuracy
from finback.flight.aircraft import Aircraft, find_aircraft
from finback.flight.plan import Drive, FlightOptions, FlightPlan
from finback.flight.power import ENGINES_OFF, FixedThrust
from finback.flight.reference import Reference
from finback.flight.vehicle import make_vehicle
from finback.records import Condition, Hold, Schedule
from finback.store.export.jsbsim_aircraft import Airframe, jsbsim_aircraft
from finback.store.model_file import read_model_file
from finback.units import to_si

CONDITION: Final = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
DURATION_S: Final = 10.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """What is drawn, in degrees.

    Attributes:
        alpha_deg: of the start.
        elevator_deg: of both ends of a step.
        limits_deg: of alpha.
        thrust_n: beside the rig.
    """

    alpha_deg: tuple[float, float]
    elevator_deg: tuple[float, float]
    limits_deg: tuple[float, float]
    thrust_n: float


F8: Final = Envelope(alpha_deg=(-25.0, 40.0), elevator_deg=(-30.0, 10.0), limits_deg=(-33.0, 46.0), thrust_n=25900.0)
F16: Final = Envelope(alpha_deg=(-15.0, 40.0), elevator_deg=(-20.0, 20.0), limits_deg=(-60.0, 80.0), thrust_n=40000.0)
PUBLISHED: Final = Path(__file__).resolve().parents[1] / "aircraft" / "f8ii" / "published.toml"
POLYNOMIAL: Final = "polynomial"
"""The published polynomials of the F-8 II as an aircraft without tables; its equations hold on the rig only."""
AIRCRAFT: Final = {"f8ii": F8, "f8ii-r": F8, "f16": F16, POLYNOMIAL: F8}
FLOWN: Final = (("rig", Drive.DIRECT), ("symmetric", Drive.DIRECT), ("free", Drive.DIRECT), ("free", Drive.OWN))
RESEARCH: Final = (("fcs/stabilator-research-mode", 1.0),)


def plans(envelope: Envelope, fidelity: str, count: int, seed: int) -> list[FlightPlan]:
    """Return releases, every other one with a step of the elevator at 1 s."""
    random = np.random.default_rng([seed, len(fidelity)])
    power = ENGINES_OFF if fidelity == "rig" else FixedThrust(thrust_n=envelope.thrust_n)
    made = []
    for number in range(count):
        first, last = to_si(random.uniform(*envelope.elevator_deg, size=2), "deg").tolist()
        knots = ([0.0, 1.0, 1.2], [first, first, last]) if number % 2 else ([0.0], [first])
        made.append(
            FlightPlan(
                name=f"flight-{number:02d}",
                kind="step" if number % 2 else "release",
                alpha_rad=to_si(float(random.uniform(*envelope.alpha_deg)), "deg"),
                q_rad_s=to_si(float(random.uniform(-60.0, 60.0)), "deg_s"),
                schedule=Schedule(time_s=np.array(knots[0]), elevator_rad=np.array(knots[1])),
                hold=Hold.FOH,
                duration_s=DURATION_S,
                sample_interval_s=0.01,
                alpha_limits_rad=(to_si(envelope.limits_deg[0], "deg"), to_si(envelope.limits_deg[1], "deg")),
                power=power,
            )
        )
    return made


def polynomial(folder: Path) -> Aircraft:
    """Write the aircraft without tables."""
    file = folder / POLYNOMIAL / f"{POLYNOMIAL}.xml"
    file.parent.mkdir(exist_ok=True)
    model = read_model_file(PUBLISHED).model()
    text = jsbsim_aircraft(model, name=POLYNOMIAL, condition=CONDITION, airframe=Airframe(), source="published.toml")
    file.write_text(text, encoding="utf-8")
    return find_aircraft(str(file), near=folder)


def studied(name: str, flown: tuple[str, Drive], given: argparse.Namespace, folder: Path) -> SweepAccuracy:
    """Fly one aircraft in one fidelity."""
    fidelity, drive = flown
    step = 1.0 / given.step_hz
    envelope = AIRCRAFT[name]
    aircraft = polynomial(folder) if name == POLYNOMIAL else find_aircraft(name, near=Path(__file__))

    def options(step_s: float) -> FlightOptions:
        return FlightOptions(
            fidelity=fidelity,
            step_s=step_s,
            drive=drive,
            alpha_limits_rad=(to_si(envelope.limits_deg[0], "deg"), to_si(envelope.limits_deg[1], "deg")),
            elevator_limits_rad=(-0.7, 0.7),
            elevator_rate_rad_s=2.0,
            properties=RESEARCH if drive is Drive.OWN and name.startswith("f8ii") else (),
        )

    with make_vehicle(aircraft, CONDITION, options(step)) as vehicle:
        return sweep_accuracy(
            vehicle,
            lambda: make_vehicle(aircraft, CONDITION, options(0.5 * step)),
            plans(envelope, fidelity, given.flights, given.seed),
            step_s=step,
            sample=f"{given.flights} drawn with seed {given.seed}",
        )


def show(title: str, found: SweepAccuracy, cpu_s: float) -> None:
    """Print what was found in one line for each class of flights."""
    sensitive = [flight for flight in found.flights if flight.sensitive]
    other = sum(not flight.same_outcome for flight in found.flights)
    print(
        f"{title}: {len(found.flights)} flights, {len(sensitive)} sensitive, {other} end otherwise, {cpu_s:.0f} s CPU"
    )
    for word, flights in (
        ("smooth", [flight for flight in found.regular if flight.smooth]),
        ("tabulated", [flight for flight in found.regular if not flight.smooth]),
    ):
        if flights:
            print(f"  regular, {word}: {_worst(flights)}")
    for fault in (*found.unknown, *found.faults):
        print(f"  {fault}")


def _worst(flights: list[FlightAccuracy]) -> str:
    half = max(flight.alpha_error_rad for flight in flights)
    text = f"{len(flights)} flights, worst error of alpha by half the step {half:.1e} rad"
    beside = [(flight, flight.reference) for flight in flights if isinstance(flight.reference, Reference)]
    if beside:
        worst = max(found.alpha_error_rad for _, found in beside)
        unsure = max(found.uncertainty_rad for _, found in beside)
        ratios = [flight.alpha_error_rad / found.alpha_error_rad for flight, found in beside]
        text += (
            f", against DOP853 {worst:.1e} rad (itself {unsure:.0e}); half the step over DOP853"
            f" {min(ratios):.2f} … {max(ratios):.2f}"
        )
    return text


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--flights", type=int, default=40, help="of each aircraft in each fidelity")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step-hz", type=float, default=400.0, help="steps a second, in whole hundreds")
    parser.add_argument("--aircraft", nargs="*", default=list(AIRCRAFT), choices=list(AIRCRAFT))
    given = parser.parse_args()
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in given.aircraft:
            for fidelity, drive in FLOWN[:1] if name == POLYNOMIAL else FLOWN:
                begun = time.process_time()
                found = studied(name, (fidelity, drive), given, Path(folder))
                show(f"{name} {fidelity}, {drive.value}", found, time.process_time() - begun)
                regular = {flight.flight for flight in found.regular}
                faults += sum(any(f"'{one}'" in fault for one in regular) for fault in found.faults)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

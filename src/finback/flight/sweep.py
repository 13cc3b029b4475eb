"""A sweep: maneuvers made into plans, plans into measured records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from finback.errors import RefusedError
from finback.flight import excitation
from finback.flight.air import Air, DrydenAir
from finback.flight.equilibrium import Field, trim
from finback.flight.excitation import Maneuver, Release
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.power import ENGINES_OFF
from finback.flight.sensors import Sensors, measure
from finback.flight.vehicle import Vehicle
from finback.records import FlightRecord, Hold


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """What a list of maneuvers came to.

    Attributes:
        plans: a plan for each maneuver that can be flown, in order.
        notes: which maneuvers cannot, and why, one sentence each.
    """

    plans: tuple[FlightPlan, ...]
    notes: tuple[str, ...]


def plan_flights(maneuvers: Iterable[Maneuver], field: Field, options: FlightOptions) -> Planned:
    """Plan a flight for each maneuver, in order, named by kind and number: ``three-two-one-one-03``.

    A flight starts at the stable equilibrium of smallest |alpha| at its first elevator (``trim``), a release where
    it says. A maneuver whose elevator has no such equilibrium is left out and noted; the others keep their numbers.

    Args:
        maneuvers: what to fly.
        field: (alpha, q, elevator) -> (alpha_dot, q_dot) of the aircraft.
        options: limits, rates and samples of all flights.

    Raises:
        InputError: a maneuver does not fit the options.
        RefusedError: no maneuver can be flown, because the aircraft has no stable equilibrium at their elevators.
    """
    counts: Counter[str] = Counter()
    trims: dict[float, tuple[float, float]] = {}
    made: list[FlightPlan] = []
    notes: list[str] = []
    for maneuver in maneuvers:
        counts[maneuver.kind] += 1
        name = f"{maneuver.kind}-{counts[maneuver.kind]:02d}"
        schedule = excitation.schedule(
            maneuver,
            rate_limit_rad_s=options.elevator_rate_rad_s,
            limits_rad=options.elevator_limits_rad,
            grid_s=options.sample_interval_s,
        )
        if isinstance(maneuver, Release):
            alpha, q = maneuver.alpha_rad, maneuver.q_rad_s
        else:
            elevator = maneuver.elevator_rad
            if elevator not in trims:
                try:
                    found = trim(field, elevator_rad=elevator, alpha_limits_rad=options.alpha_limits_rad)
                except RefusedError as error:
                    notes.append(f"'{name}' is not flown: {error.message}")
                    continue
                trims[elevator] = (found.alpha_rad, found.q_rad_s)
            alpha, q = trims[elevator]
        plan = FlightPlan(
            name=name,
            kind=maneuver.kind,
            alpha_rad=alpha,
            q_rad_s=q,
            schedule=schedule,
            hold=Hold.FOH,
            duration_s=maneuver.duration_s,
            sample_interval_s=options.sample_interval_s,
            alpha_limits_rad=options.alpha_limits_rad,
            power=ENGINES_OFF if options.fidelity == "rig" else options.power,
            air=_air(options.air, sum(counts.values())),
        )
        made.append(plan)
    if notes and not made:
        raise RefusedError(
            f"no maneuver can be flown: {'; '.join(notes)}",
            hint="choose elevators between the folds, or release the aircraft from a state",
        )
    return Planned(plans=tuple(made), notes=tuple(notes))


def _air(air: Air, number: int) -> Air:
    """Return the air of a flight: gusts of its own."""
    if not isinstance(air, DrydenAir):
        return air
    own = np.random.SeedSequence([air.seed, number]).generate_state(1, np.uint64)[0]
    return replace(air, seed=int(own))


def fly_sweep(vehicle: Vehicle, plans: Iterable[FlightPlan], *, sensors: Sensors, seed: int) -> Iterator[FlightRecord]:
    """Fly plans in order and yield what the sensors saw, flight by flight.

    Args:
        vehicle: the aircraft, in any fidelity.
        plans: what to fly; the number of a plan seeds its noise.
        sensors: noise of the sensors.
        seed: the study's seed; the same seed gives the same bits.
    """
    for index, plan in enumerate(plans):
        yield measure(vehicle.fly(plan), sensors, seed=seed, index=index)

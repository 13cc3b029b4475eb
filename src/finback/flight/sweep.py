"""A sweep: maneuvers made into plans, plans into measured records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from finback.flight import excitation
from finback.flight.equilibrium import Field, trim
from finback.flight.excitation import Maneuver, Release
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.rig import Rig
from finback.flight.sensors import Sensors, measure
from finback.records import FlightRecord, Hold


def plans(maneuvers: Iterable[Maneuver], field: Field, options: FlightOptions) -> tuple[FlightPlan, ...]:
    """Return a plan for each maneuver, in order, named by kind and number: ``three-two-one-one-03``.

    A flight starts at the stable equilibrium of smallest |alpha| at its first elevator (``trim``), a release where
    it says.

    Args:
        maneuvers: what to fly.
        field: (alpha, q, elevator) -> (alpha_dot, q_dot) of the aircraft.
        options: limits, rates and samples of all flights.

    Raises:
        InputError: a maneuver does not fit the options.
        RefusedError: the aircraft has no stable equilibrium at an elevator.
    """
    counts: Counter[str] = Counter()
    trims: dict[float, tuple[float, float]] = {}
    made = []
    for maneuver in maneuvers:
        counts[maneuver.kind] += 1
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
                found = trim(field, elevator_rad=elevator, alpha_limits_rad=options.alpha_limits_rad)
                trims[elevator] = (found.alpha_rad, found.q_rad_s)
            alpha, q = trims[elevator]
        plan = FlightPlan(
            name=f"{maneuver.kind}-{counts[maneuver.kind]:02d}",
            kind=maneuver.kind,
            alpha_rad=alpha,
            q_rad_s=q,
            schedule=schedule,
            hold=Hold.FOH,
            duration_s=maneuver.duration_s,
            sample_interval_s=options.sample_interval_s,
            alpha_limits_rad=options.alpha_limits_rad,
        )
        made.append(plan)
    return tuple(made)


def fly_sweep(rig: Rig, plans: Iterable[FlightPlan], *, sensors: Sensors, seed: int) -> Iterator[FlightRecord]:
    """Fly plans in order and yield what the sensors saw, flight by flight.

    Args:
        rig: the aircraft.
        plans: what to fly; the number of a plan seeds its noise.
        sensors: noise of the sensors.
        seed: the study's seed; the same seed gives the same bits.
    """
    for index, plan in enumerate(plans):
        yield measure(rig.fly(plan), sensors, seed=seed, index=index)

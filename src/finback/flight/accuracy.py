"""How well the step resolves a sweep: flights flown again at half the step, and from a start a hair beside.

The integrator ends at second order (its first step is Euler's), so the error of a flight at step h is 4/3 of what it
differs from the same flight at h/2 (Richardson). Near a separatrix errors grow by many powers of e: a flight that
takes a perturbation of 1e-9 rad beyond 1e-7 rad is *sensitive*. Its error is told, but no step makes it small; what
counts is whether it ends the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.flight.air import CALM
from finback.flight.plan import FlightPlan
from finback.flight.vehicle import Vehicle
from finback.records import FlightRecord, Outcome

PERTURBATION_RAD: Final = 1e-9
REGULAR_RAD: Final = 1e-7
"""A flight that keeps ``PERTURBATION_RAD`` below this is regular."""
_RICHARDSON: Final = 4.0 / 3.0  # of the difference to half the step, for a method of second order
_COMPARED: Final = ("alpha_rad", "q_rad_s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightAccuracy:
    """How well one flight is resolved.

    Attributes:
        flight: its name.
        alpha_error_rad: estimated largest error of alpha until the earlier end of both flights.
        q_error_rad_s: the same of the pitch rate.
        growth: by how much a perturbation of alpha at the start has grown at most.
        sensitive: whether it passes ``REGULAR_RAD``.
        outcome: of the flight.
        outcome_at_half_step: of the same flight at half the step.
    """

    flight: str
    alpha_error_rad: float
    q_error_rad_s: float
    growth: float
    sensitive: bool
    outcome: Outcome
    outcome_at_half_step: Outcome

    @property
    def same_outcome(self) -> bool:
        """Whether half the step ends the flight the same way."""
        return self.outcome == self.outcome_at_half_step


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SweepAccuracy:
    """How well a sample of a sweep's flights is resolved.

    Attributes:
        step_s: the step of the sweep.
        flights: those of the sample, in the order of the sweep.
        stilled: whether some of them meet turbulence in the sweep; here they are flown in still air.
    """

    step_s: float
    flights: tuple[FlightAccuracy, ...]
    stilled: bool = False

    @property
    def regular(self) -> tuple[FlightAccuracy, ...]:
        """Flights that are not sensitive."""
        return tuple(flight for flight in self.flights if not flight.sensitive)

    def sentence(self) -> str:
        """Return everything in one sentence, for a record's provenance and for people."""
        regular = self.regular
        parts = [f"{len(self.flights)} flights again at half the step of {self.step_s:.6g} s"]
        if self.stilled:
            parts.append("without their turbulence, whose gusts belong to a step")
        if regular:
            alpha = max(flight.alpha_error_rad for flight in regular)
            q = max(flight.q_error_rad_s for flight in regular)
            parts.append(f"error at most {alpha:.2g} rad and {q:.2g} rad/s in {len(regular)} regular ones")
        for flight in self.flights:
            if flight.sensitive:
                parts.append(
                    f"'{flight.flight}' is sensitive (a perturbation grows {flight.growth:.2g}-fold), "
                    f"error {flight.alpha_error_rad:.2g} rad"
                )
            if not flight.same_outcome:
                parts.append(
                    f"'{flight.flight}' is {flight.outcome.value}, at half the step {flight.outcome_at_half_step.value}"
                )
        return "; ".join(parts)


def sweep_accuracy(
    vehicle: Vehicle, finer: Callable[[], Vehicle], plans: Sequence[FlightPlan], *, step_s: float, most: int
) -> SweepAccuracy:
    """Fly a sample of plans at the step, from a start a hair beside, and at half the step.

    All in still air: gusts are drawn step by step, so those of another step are others.

    Args:
        vehicle: the aircraft at the step of the sweep, open.
        finer: makes the same aircraft at half of it; it is opened, used and closed.
        plans: of the sweep, not empty.
        step_s: the step of the sweep.
        most: of the sample: at least one of every kind of maneuver, as far as that goes, spread over the sweep.
    """
    chosen = _sample(plans, most)
    sample = [replace(plan, air=CALM) for plan in chosen]
    flown = [vehicle.fly(plan) for plan in sample]
    beside = [vehicle.fly(_beside(plan)) for plan in sample]
    with finer() as other:
        again = [other.fly(plan) for plan in sample]
    return SweepAccuracy(
        step_s=step_s,
        flights=tuple(_accuracy(*records) for records in zip(flown, again, beside, strict=True)),
        stilled=any(plan.air != CALM for plan in chosen),
    )


def _beside(plan: FlightPlan) -> FlightPlan:
    """Return the plan from a start a hair nearer to the middle of its limits."""
    way = math.copysign(PERTURBATION_RAD, sum(plan.alpha_limits_rad) - 2.0 * plan.alpha_rad)
    return replace(plan, alpha_rad=plan.alpha_rad + way)


def _accuracy(record: FlightRecord, finer: FlightRecord, beside: FlightRecord) -> FlightAccuracy:
    errors = [_RICHARDSON * _largest(record, finer, name) for name in _COMPARED]
    moved = _largest(record, beside, "alpha_rad")
    return FlightAccuracy(
        flight=record.name,
        alpha_error_rad=errors[0],
        q_error_rad_s=errors[1],
        growth=moved / PERTURBATION_RAD,
        sensitive=moved > REGULAR_RAD,
        outcome=record.outcome,
        outcome_at_half_step=finer.outcome,
    )


def _largest(one: FlightRecord, other: FlightRecord, name: str) -> float:
    rows = min(len(one), len(other))
    difference = np.abs(one[name][:rows] - other[name][:rows])
    return float(difference.max()) if rows and np.isfinite(difference).all() else math.inf


def _sample(plans: Sequence[FlightPlan], most: int) -> list[FlightPlan]:
    """Return plans spread over the sweep: the first of each kind, then evenly what is left of the number."""
    first = {plan.kind: number for number, plan in reversed(list(enumerate(plans)))}
    chosen = sorted(first.values())[:most]
    rest = [number for number in range(len(plans)) if number not in chosen]
    wanted = min(most - len(chosen), len(rest))
    chosen += [rest[(2 * k + 1) * len(rest) // (2 * wanted)] for k in range(wanted)]
    return [plans[number] for number in sorted(chosen)]

"""How well the step resolves a study: flights again at half the step, from a start a hair beside, and by DOP853.

Two roads to the error of a flight. Half the step: at corners of the elevator the integrator is of second order, so the
error at step h is 4/3 of what it differs from the same flight at h/2 (Richardson; where there are none it is of fourth,
and that is a fourth too much); flights that remember more than their state may do so a step late, which is an error of
first order, and 2 is taken for 4/3. And, where the state is complete, DOP853 on the suspended simulator's own
right-hand side (``reference``).

Near a separatrix errors grow by many powers of e: a flight that takes a perturbation of 1e-9 rad beyond 1e-7 rad is
*sensitive*. Its error is told, but no step makes it small; what counts is whether it ends the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, final

import numpy as np

from finback.errors import FinbackError
from finback.flight.air import CALM
from finback.flight.motion import Incomplete
from finback.flight.plan import FlightPlan
from finback.flight.reference import NoReference, Reference, reference
from finback.records import FlightRecord, Outcome

if TYPE_CHECKING:
    from finback.flight.vehicle import Vehicle  # JSBSim, which whoever only reads results does not need

PERTURBATION_RAD: Final = 1e-9
REGULAR_RAD: Final = 1e-7
"""A flight that keeps ``PERTURBATION_RAD`` below this is regular."""
SMOOTH_RAD: Final = 1e-5
"""What a regular flight through smooth aerodynamics may err in alpha over 10 s at the default step."""
TABULATED_RAD: Final = 5e-4
"""The same of a flight over the corners of tables, or of which nobody knows."""

_RICHARDSON: Final = {1: 2.0, 2: 4.0 / 3.0}  # of the difference to half the step, by the order of the method
_MAGNITUDE: Final = 10.0  # two roads to an error agree if one is less than this times the other
_NOTHING_RAD: Final = 1e-8  # errors below this are those of the comparison
_COMPARED: Final = ("alpha_rad", "q_rad_s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightAccuracy:
    """How well one flight is resolved.

    Attributes:
        flight: its name.
        alpha_error_rad: largest error of alpha until the earlier end of both flights, estimated by half the step.
        q_error_rad_s: the same of the pitch rate.
        order: of the method, as that estimate takes it.
        growth: by how much a perturbation of alpha at the start has grown at most.
        sensitive: whether it passes ``REGULAR_RAD``.
        outcome: of the flight.
        outcome_at_half_step: of the same flight at half the step.
        reference: the difference to another integrator, or why there is none.
    """

    flight: str
    alpha_error_rad: float
    q_error_rad_s: float
    order: int
    growth: float
    sensitive: bool
    outcome: Outcome
    outcome_at_half_step: Outcome
    reference: Reference | NoReference

    @property
    def same_outcome(self) -> bool:
        """Whether half the step ends the flight the same way."""
        return self.outcome == self.outcome_at_half_step

    @property
    def smooth(self) -> bool:
        """Whether it is known to pass no corner of a table."""
        return isinstance(self.reference, Reference) and not self.reference.corners

    @property
    def limit_rad(self) -> float:
        """What the error of alpha may be if the flight is regular."""
        return SMOOTH_RAD if self.smooth else TABULATED_RAD

    @property
    def worse_error_rad(self) -> float:
        """The error of alpha by the road that says more."""
        if isinstance(self.reference, NoReference):
            return self.alpha_error_rad
        return max(self.alpha_error_rad, self.reference.alpha_error_rad)

    @property
    def resolved(self) -> bool:
        """Whether the error is within its limit, or, of a sensitive flight, the outcome that of half the step."""
        return self.same_outcome if self.sensitive else self.worse_error_rad <= self.limit_rad

    @property
    def roads_agree(self) -> bool:
        """Whether both roads to the error say the same in order of magnitude, as far as a regular flight has both."""
        if self.sensitive or isinstance(self.reference, NoReference):
            return True
        found = (self.alpha_error_rad, self.reference.alpha_error_rad)
        small = max(_NOTHING_RAD, 2.0 * self.reference.uncertainty_rad)
        return max(found) <= small or max(found) <= _MAGNITUDE * min(found)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SweepAccuracy:
    """How well a sample of a study's flights is resolved, in one fidelity.

    Attributes:
        fidelity: what moves.
        step_s: the step of the study.
        sample: which flights these are, in words.
        flights: those of the sample, in the order of the study.
        stilled: whether some of them meet turbulence in the study; here they are flown in still air.
        unknown: flights of the sample that could not be flown again, and why.
    """

    fidelity: str
    step_s: float
    sample: str
    flights: tuple[FlightAccuracy, ...]
    stilled: bool = False
    unknown: tuple[str, ...] = ()

    @property
    def regular(self) -> tuple[FlightAccuracy, ...]:
        """Flights that are not sensitive."""
        return tuple(flight for flight in self.flights if not flight.sensitive)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the numbers alone do not say, one sentence each; the last ones are faults of the step."""
        found = [f"{self.fidelity}: {why}" for why in self.unknown]
        if self.stilled:
            found.append(f"{self.fidelity}: flown without turbulence, whose gusts belong to a step")
        alone = dict.fromkeys(one.reference.reason for one in self.flights if isinstance(one.reference, NoReference))
        found += [f"{self.fidelity}: no second integrator, half the step alone: {reason}" for reason in alone]
        return (*found, *self.faults)

    @property
    def faults(self) -> tuple[str, ...]:
        """What is wrong with the step, or with what is said of it, one sentence each."""
        found = []
        for flight in self.flights:
            name = f"{self.fidelity}: '{flight.flight}'"
            if not flight.same_outcome:
                found.append(f"{name} is {flight.outcome.value}, at half the step {flight.outcome_at_half_step.value}")
            elif not flight.resolved:
                found.append(
                    f"{name} is not resolved by the step: its error of alpha is {flight.worse_error_rad:.2g} rad,"
                    f" more than {flight.limit_rad:.0e}"
                )
            if not flight.roads_agree:
                found.append(f"{name}: half the step and DOP853 do not say the same of its error")
        return tuple(found)

    def sentence(self) -> str:
        """Return everything in one sentence, for a record's provenance and for people."""
        parts = [f"{len(self.flights)} flights again at half the step of {self.step_s:.6g} s ({self.sample})"]
        if self.stilled:
            parts.append("without their turbulence, whose gusts belong to a step")
        if regular := self.regular:
            alpha = max(flight.alpha_error_rad for flight in regular)
            q = max(flight.q_error_rad_s for flight in regular)
            parts.append(f"error at most {alpha:.2g} rad and {q:.2g} rad/s in {len(regular)} regular ones")
            beside = [flight.reference for flight in regular if isinstance(flight.reference, Reference)]
            if beside:
                worst = max(found.alpha_error_rad for found in beside)
                parts.append(f"{worst:.2g} rad against DOP853 in {len(beside)} of them")
        parts += [
            f"'{flight.flight}' is sensitive (a perturbation grows {flight.growth:.2g}-fold), "
            f"error {flight.alpha_error_rad:.2g} rad"
            for flight in self.flights
            if flight.sensitive
        ]
        return "; ".join((*parts, *(remark.removeprefix(f"{self.fidelity}: ") for remark in self.faults)))


def sentences(found: Iterable[SweepAccuracy]) -> str:
    """Return what is known in all fidelities in one sentence; a fidelity is named where there are several."""
    told = [(accuracy.fidelity, accuracy.sentence()) for accuracy in found]
    return told[0][1] if len(told) == 1 else " | ".join(f"{fidelity}: {words}" for fidelity, words in told)


def sweep_accuracy(
    vehicle: Vehicle, finer: Callable[[], Vehicle], plans: Sequence[FlightPlan], *, step_s: float, sample: str
) -> SweepAccuracy:
    """Fly plans at the step, from a start a hair beside, at half the step, and by DOP853.

    All in still air: gusts are drawn step by step, so those of another step are others.

    Args:
        vehicle: the aircraft at the step of the study, open.
        finer: makes the same aircraft at half of it; it is opened, used and closed.
        plans: the sample, not empty.
        step_s: the step of the study.
        sample: which plans these are, in words.
    """
    unknown, flights = [], []
    try:
        with finer() as other:
            for plan in plans:
                try:
                    flights.append(_accuracy(vehicle, other, replace(plan, air=CALM)))
                except FinbackError as error:  # such as a step at which the rig does not hold its airspeed
                    unknown.append(f"'{plan.name}' could not be flown again: {error.message}")
    except FinbackError as error:  # the flights of the study stand, whatever half its step is like
        unknown.append(f"it does not fly at half the step: {error.message}")
    return SweepAccuracy(
        fidelity=vehicle.provenance["fidelity"],
        step_s=step_s,
        sample=sample,
        flights=tuple(flights),
        stilled=any(plan.air != CALM for plan in plans),
        unknown=tuple(unknown),
    )


def chosen(plans: Sequence[FlightPlan], turning: Sequence[float], *, most: int) -> tuple[list[FlightPlan], str]:
    """Return a sample of a study, and what it is in words.

    Of each kind of maneuver the flight that turns fastest, however many kinds there are; then, up to the number asked
    for, flights spread evenly over the others.

    Args:
        plans: of the study, not empty.
        turning: largest pitch rate of each, shape as ``plans``.
        most: of the sample, if there are no more kinds.
    """
    fastest: dict[str, int] = {}
    for number, plan in enumerate(plans):
        if plan.kind not in fastest or turning[number] > turning[fastest[plan.kind]]:
            fastest[plan.kind] = number
    rest = [number for number in range(len(plans)) if number not in fastest.values()]
    wanted = max(0, min(most - len(fastest), len(rest)))
    spread = [rest[(2 * k + 1) * len(rest) // (2 * wanted)] for k in range(wanted)]
    numbers = sorted((*fastest.values(), *spread))
    if len(numbers) == len(plans):
        return list(plans), "all of the study"
    return [plans[number] for number in numbers], sample_in_words(len(numbers), len(plans), kinds=len(fastest))


def sample_in_words(flights: int, of: int, *, kinds: int = 1) -> str:
    """Say what a sample is that holds the fastest turning flight of each kind."""
    fastest = "the one that turns fastest" if kinds == 1 else "of each kind the one that turns fastest"
    return f"{flights} of {of}: {fastest}{', the others spread evenly' if flights > kinds else ''}"


def _accuracy(vehicle: Vehicle, finer: Vehicle, plan: FlightPlan) -> FlightAccuracy:
    record, again, beside = vehicle.fly(plan), finer.fly(plan), vehicle.fly(_beside(plan))
    motion = vehicle.motion(plan)
    order = 1 if isinstance(motion, Incomplete) else 2
    errors = [_RICHARDSON[order] * _largest(record, again, name) for name in _COMPARED]
    moved = _largest(record, beside, "alpha_rad")
    return FlightAccuracy(
        flight=record.name,
        alpha_error_rad=errors[0],
        q_error_rad_s=errors[1],
        order=order,
        growth=moved / PERTURBATION_RAD,
        sensitive=moved > REGULAR_RAD,
        outcome=record.outcome,
        outcome_at_half_step=again.outcome,
        reference=reference(motion, record),
    )


def _beside(plan: FlightPlan) -> FlightPlan:
    """Return the plan from a start a hair nearer to the middle of its limits."""
    way = math.copysign(PERTURBATION_RAD, sum(plan.alpha_limits_rad) - 2.0 * plan.alpha_rad)
    return replace(plan, alpha_rad=plan.alpha_rad + way)


def _largest(one: FlightRecord, other: FlightRecord, name: str) -> float:
    rows = min(len(one), len(other))
    difference = np.abs(one[name][:rows] - other[name][:rows])
    return float(difference.max()) if rows and np.isfinite(difference).all() else math.inf

"""How well the step resolves a campaign: some of its flights flown again, in each fidelity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Final

from finback.errors import FinbackError
from finback.flight.accuracy import sweep_accuracy
from finback.flight.campaign.crew import Crew
from finback.flight.campaign.plan import Campaign
from finback.flight.plan import FlightPlan
from finback.flight.vehicle import Vehicle, make_vehicle

_SAMPLE: Final = 5  # flights of each fidelity
_TRIED: Final = 20  # of each fidelity, if the first ones chosen cannot be flown


def resolution(campaign: Campaign) -> str:
    """Fly a sample of a campaign again, at half the step too, and say how large the error of discretization is.

    The same campaign gives the same sentence. Flights that are refused are no part of the sample.

    Raises:
        AircraftError: the aircraft does not load, or is not the campaign's.
    """
    with Crew(campaign) as crew:
        told = [f"{fidelity}: {_of(crew, fidelity)}" for fidelity in campaign.fidelities]
    return told[0].partition(": ")[2] if len(told) == 1 else " | ".join(told)


def _of(crew: Crew, fidelity: str) -> str:
    campaign = crew.campaign
    plans = _flyable(crew, fidelity)
    if not plans:
        return "no flight of the sample could be flown"
    step_s = campaign.options.step_s
    finer = partial(_made, campaign, fidelity, 0.5 * step_s)
    try:
        return sweep_accuracy(crew.vehicle(fidelity), finer, plans, step_s=step_s, most=_SAMPLE).sentence()
    except FinbackError as error:  # such as a step at which the rig does not hold its airspeed
        return f"not known, a flight of the sample could not be flown again: {error.message}"


def _flyable(crew: Crew, fidelity: str) -> list[FlightPlan]:
    """Return plans spread over the campaign."""
    found: list[FlightPlan] = []
    for index in _spread(crew.campaign, fidelity):
        try:
            plan = crew.plan(index)
            crew.vehicle(fidelity).fly(plan)
        except FinbackError:  # data of the campaign, as ``Crew.fly`` says
            crew.retire(fidelity)
            continue
        found.append(plan)
        if len(found) == _SAMPLE:
            break
    return found


def _spread(campaign: Campaign, fidelity: str) -> Iterator[int]:
    """Yield numbers of flights of a fidelity: first some far apart, then more between them."""
    kinds = len(campaign.fidelities)
    count = campaign.flights // kinds
    place = campaign.fidelities.index(fidelity)
    seen: set[int] = set()
    for sample in (_SAMPLE, _TRIED):
        for k in range(min(sample, count)):
            number = (2 * k + 1) * count // (2 * min(sample, count))
            if number not in seen:
                seen.add(number)
                yield number * kinds + place  # fidelities vary fastest


def _made(campaign: Campaign, fidelity: str, step_s: float) -> Vehicle:
    options = replace(campaign.options, fidelity=fidelity, step_s=step_s)
    return make_vehicle(campaign.aircraft, campaign.condition, options)

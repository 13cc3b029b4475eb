"""How well the step resolves a campaign: some of its flights flown again, in each fidelity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Final

from finback.errors import FinbackError
from finback.flight.accuracy import SweepAccuracy, sample_in_words, sweep_accuracy
from finback.flight.campaign.crew import Crew
from finback.flight.campaign.plan import Campaign
from finback.flight.plan import FlightPlan
from finback.flight.vehicle import Vehicle, make_vehicle

_SAMPLE: Final = 5  # flights of each fidelity
_TRIED: Final = 20  # of each fidelity, if the first ones chosen cannot be flown


def resolution(campaign: Campaign, fastest: Mapping[str, int]) -> tuple[SweepAccuracy, ...]:
    """Fly a sample of a campaign again, at half the step and by DOP853 too, and say how large the error of a step is.

    The same campaign gives the same numbers. Flights that are refused are no part of the sample.

    Args:
        campaign: the plan.
        fastest: fidelity -> number of its flight that turned fastest; none where all were refused.

    Returns:
        What is known in each fidelity.

    Raises:
        AircraftError: the aircraft does not load, or is not the campaign's.
    """
    with Crew(campaign) as crew:
        return tuple(
            _of(crew, fidelity, fastest[fidelity])
            if fidelity in fastest
            else _nothing(campaign, fidelity, "no flight could be flown")
            for fidelity in campaign.fidelities
        )


def _of(crew: Crew, fidelity: str, fastest: int) -> SweepAccuracy:
    campaign = crew.campaign
    plans = _flyable(crew, fidelity, fastest)
    if not plans:
        return _nothing(campaign, fidelity, "no flight of the sample could be flown")
    step_s = campaign.options.step_s
    finer = partial(_made, campaign, fidelity, 0.5 * step_s)
    sample = sample_in_words(len(plans), campaign.flights // len(campaign.fidelities))
    return sweep_accuracy(crew.vehicle(fidelity), finer, plans, step_s=step_s, sample=sample)


def _nothing(campaign: Campaign, fidelity: str, why: str) -> SweepAccuracy:
    return SweepAccuracy(fidelity=fidelity, step_s=campaign.options.step_s, sample="none", flights=(), unknown=(why,))


def _flyable(crew: Crew, fidelity: str, fastest: int) -> list[FlightPlan]:
    """Return the plan of the flight that turned fastest, and others spread over the campaign, in its order."""
    found: dict[int, FlightPlan] = {}
    for index in (fastest, *_spread(crew.campaign, fidelity)):
        if index in found:
            continue
        try:
            plan = crew.plan(index)
            crew.vehicle(fidelity).fly(plan)
        except FinbackError:  # data of the campaign, as ``Crew.fly`` says
            crew.retire(fidelity)
            continue
        found[index] = plan
        if len(found) == _SAMPLE:
            break
    return [found[index] for index in sorted(found)]


def _spread(campaign: Campaign, fidelity: str) -> Iterator[int]:
    """Yield numbers of flights of a fidelity: first some far apart, then more between them."""
    kinds = len(campaign.fidelities)
    count = campaign.flights // kinds
    place = campaign.fidelities.index(fidelity)
    for sample in (_SAMPLE - 1, _TRIED):
        for k in range(min(sample, count)):
            number = (2 * k + 1) * count // (2 * min(sample, count))
            yield number * kinds + place  # fidelities vary fastest


def _made(campaign: Campaign, fidelity: str, step_s: float) -> Vehicle:
    options = replace(campaign.options, fidelity=fidelity, step_s=step_s)
    return make_vehicle(campaign.aircraft, campaign.condition, options)

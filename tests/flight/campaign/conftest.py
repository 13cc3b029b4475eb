"""A small campaign of the shipped aircraft."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from finback.flight.aircraft import Aircraft
from finback.flight.campaign.plan import Campaign, Varied
from finback.flight.campaign.spread import Fixed, Grid, Spread, Uniform
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.records import Condition

Planner = Callable[..., Campaign]


@pytest.fixture
def plan(f8ii: Aircraft, condition: Condition) -> Planner:
    """Return a campaign of 24 releases, with changes."""
    spreads: dict[str, Spread] = {
        "elevator_rad": Grid(values=(-0.2, 0.0, 0.1)),
        "alpha_rad": Uniform(low=-0.3, high=0.5),
        "q_rad_s": Grid(values=(-0.5, 0.5)),
        "duration_s": Fixed(value=1.0),
    }
    options = FlightOptions(
        alpha_limits_rad=(-0.57, 0.8), elevator_limits_rad=(-0.69, 0.34), elevator_rate_rad_s=1.0, step_s=1 / 200
    )
    whole = Campaign(
        study="small",
        aircraft=f8ii,
        condition=condition,
        options=options,
        sensors=Sensors(alpha_noise_rad=1e-3, q_noise_rad_s=1e-3),
        seed=3,
        kind="release",
        varied=tuple(Varied(name=name, spread=spread) for name, spread in spreads.items()),
        draws=4,
        partition_flights=10,
    )

    def change(**changes: object) -> Campaign:
        return replace(whole, **changes)  # type: ignore[arg-type] # the fields' own types

    return change


@pytest.fixture
def campaign(plan: Planner) -> Campaign:
    return plan()

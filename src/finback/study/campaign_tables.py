"""What stands in the section ``[campaign]`` of a study, table by table; of each number its extremes are checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from finback.flight.campaign.plan import DEFAULT_CHANNELS, DEFAULT_DEPARTURES, DEFAULT_PARTITION, DEFAULT_RECORDINGS
from finback.study.tables import AnyAngle, AnyPitchRate, Frequency, Table, as_list

Ratio = Annotated[list[Annotated[float, Field(ge=1e-3, le=1e3)]], Field(min_length=1), BeforeValidator(as_list)]
Inclination = Annotated[list[Annotated[float, Field(gt=-90.0, lt=90.0)]], Field(min_length=1), BeforeValidator(as_list)]
Length = Annotated[list[Annotated[float, Field(ge=-100.0, le=100.0)]], Field(min_length=1), BeforeValidator(as_list)]
Airspeed = Annotated[list[Annotated[float, Field(ge=1.0, le=1e4)]], Field(min_length=1), BeforeValidator(as_list)]
Altitude = Annotated[list[Annotated[float, Field(gt=0.0, le=1e5)]], Field(min_length=1), BeforeValidator(as_list)]
Force = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=1), BeforeValidator(as_list)]
Share = Annotated[list[Annotated[float, Field(ge=0.0, le=1.0)]], Field(min_length=1), BeforeValidator(as_list)]
Gust = Annotated[list[Annotated[float, Field(ge=0.0, le=100.0)]], Field(min_length=1), BeforeValidator(as_list)]
Scale = Annotated[list[Annotated[float, Field(ge=1.0, le=1e5)]], Field(min_length=1), BeforeValidator(as_list)]


class CampaignTable(Table):
    """``[campaign]``, without its sub-tables."""

    draws: Annotated[int, Field(ge=1)] = 1
    partition_flights: Annotated[int, Field(ge=1, le=100_000)] = DEFAULT_PARTITION
    fidelity: Annotated[list[str], Field(min_length=1), BeforeValidator(as_list)] = Field(default_factory=list)


class LoadingTable(Table):
    """``[campaign.loading]``: what differs from the aircraft's file."""

    mass_ratio: Ratio = Field(default_factory=list)
    inertia_ratio: Ratio = Field(default_factory=list)
    center_aft_m: Length = Field(default_factory=list)
    center_up_m: Length = Field(default_factory=list)


class StartTable(Table):
    """``[campaign.start]``: the initial state beside alpha and q, as far as the fidelity has it."""

    theta_deg: Inclination = Field(default_factory=list)
    airspeed_m_s: Airspeed = Field(default_factory=list)
    altitude_m: Altitude = Field(default_factory=list)
    beta_deg: Inclination = Field(default_factory=list)
    phi_deg: AnyAngle = Field(default_factory=list)
    psi_deg: AnyAngle = Field(default_factory=list)
    p_deg_s: AnyPitchRate = Field(default_factory=list)
    r_deg_s: AnyPitchRate = Field(default_factory=list)
    latitude_deg: Inclination = Field(default_factory=list)


class PowerTable(Table):
    """``[campaign.power]``: one of them."""

    thrust_n: Force = Field(default_factory=list)
    throttle: Share = Field(default_factory=list)


class AirTable(Table):
    """``[campaign.air]``: Dryden turbulence; both."""

    intensity_m_s: Gust = Field(default_factory=list)
    length_m: Scale = Field(default_factory=list)


class HistoryTable(Table):
    """``[campaign.history]``."""

    channels: Annotated[list[str], Field(min_length=1)] = Field(default_factory=lambda: list(DEFAULT_CHANNELS))
    sample_hz: Annotated[list[Frequency], Field(max_length=1), BeforeValidator(as_list)] = Field(default_factory=list)
    every: Annotated[int, Field(ge=0)] = 1
    departures: Annotated[int, Field(ge=0, le=100_000)] = DEFAULT_DEPARTURES
    recordings: Annotated[int, Field(ge=0, le=10_000)] = DEFAULT_RECORDINGS


OTHERS: Final[Mapping[str, type[Table]]] = {
    "loading": LoadingTable,
    "start": StartTable,
    "power": PowerTable,
    "air": AirTable,
}
"""Optional table of a campaign -> its form."""

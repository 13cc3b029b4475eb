"""What one flight of a campaign is asked to do: its sample made into a plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from finback.flight import excitation
from finback.flight.air import CALM, Air, DrydenAir
from finback.flight.campaign.fidelity import FREE_START, GUSTS, LOADING, MANEUVERS, THROTTLE, THRUST
from finback.flight.campaign.plan import Campaign, Sample
from finback.flight.excitation import Maneuver
from finback.flight.loading import Loading
from finback.flight.plan import FlightPlan
from finback.flight.power import ENGINES_OFF, FixedThrust, Power, Throttle
from finback.flight.start import LEVEL, FreeStart, Start, SymmetricStart
from finback.records import Condition, Hold, Schedule

_GUST_STREAM = 0x67757374  # keeps the gusts' seeds apart from those of noise and draws


def maneuver_of(campaign: Campaign, sample: Sample) -> Maneuver:
    """Return what a flight does.

    Raises:
        InputError: its numbers are no such maneuver.
    """
    kind, values = MANEUVERS[campaign.kind], _values(campaign, sample)
    return kind(**{part.name: values[part.name] for part in fields(kind)})


def schedule_of(campaign: Campaign, maneuver: Maneuver) -> Schedule:
    """Return the elevator of a flight.

    Raises:
        InputError: the maneuver does not fit the limits, rates or samples.
    """
    return excitation.schedule(
        maneuver,
        rate_limit_rad_s=campaign.options.elevator_rate_rad_s,
        limits_rad=campaign.options.elevator_limits_rad,
        grid_s=campaign.options.sample_interval_s,
    )


def plan_of(
    campaign: Campaign, sample: Sample, maneuver: Maneuver, schedule: Schedule, *, alpha_rad: float, q_rad_s: float
) -> FlightPlan:
    """Return the plan of a flight that starts at ``alpha_rad``, ``q_rad_s``.

    Raises:
        InputError: a number is none that can be flown.
    """
    values = _values(campaign, sample)
    return FlightPlan(
        name=sample.name,
        kind=maneuver.kind,
        alpha_rad=alpha_rad,
        q_rad_s=q_rad_s,
        schedule=schedule,
        hold=Hold.FOH,
        duration_s=maneuver.duration_s,
        sample_interval_s=campaign.options.sample_interval_s,
        alpha_limits_rad=campaign.options.alpha_limits_rad,
        start=_start(values, campaign.condition, sample.fidelity, alpha_rad),
        power=_power(values, campaign.options.power if sample.fidelity != "rig" else ENGINES_OFF),
        loading=Loading(**{name: values[name] for name in LOADING if name in values}),
        air=_air(values, campaign.options.air if sample.fidelity == "free" else CALM, campaign.seed, sample.index),
    )


def _values(campaign: Campaign, sample: Sample) -> dict[str, float]:
    return dict(zip(campaign.names, sample.values, strict=True))


def _start(values: Mapping[str, float], condition: Condition, fidelity: str, alpha_rad: float) -> Start:
    """Return the start; what is not given is that of a level path at the reference flight."""
    given = {name: values[name] for name in FREE_START if name in values}
    if not given:
        return LEVEL
    level = {"theta_rad": alpha_rad, "airspeed_m_s": condition.airspeed_m_s, "altitude_m": condition.altitude_m}
    return (FreeStart if fidelity == "free" else SymmetricStart)(**{**level, **given})


def _power(values: Mapping[str, float], usual: Power) -> Power:
    if THRUST[0] in values:
        return FixedThrust(thrust_n=values[THRUST[0]])
    return Throttle(setting=values[THROTTLE[0]]) if THROTTLE[0] in values else usual


def _air(values: Mapping[str, float], usual: Air, seed: int, index: int) -> Air:
    """Return the air of a flight: gusts of its own, which follow from the campaign's seed and the flight's number."""
    own = int(np.random.SeedSequence([seed, index, _GUST_STREAM]).generate_state(1, np.uint64)[0])
    if GUSTS[0] in values:
        return DrydenAir(**{name: values[name] for name in GUSTS}, seed=own)
    return replace(usual, seed=own) if isinstance(usual, DrydenAir) else usual

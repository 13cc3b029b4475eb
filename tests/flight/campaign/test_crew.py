"""What one flight of a campaign leaves, whatever flew before it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from finback.errors import AircraftError
from finback.flight.campaign.assignment import maneuver_of, plan_of, schedule_of
from finback.flight.campaign.crew import MEASURES, REFUSED, Crew, Flown
from finback.flight.campaign.fidelity import RECORDED
from finback.flight.campaign.plan import Campaign, History, Varied
from finback.flight.campaign.resolution import resolution
from finback.flight.campaign.spread import Fixed, Grid, Uniform
from finback.flight.excitation import Release
from finback.flight.loading import Loading
from finback.flight.plan import FIDELITIES
from finback.flight.reference import Reference
from finback.flight.rig import Rig
from finback.flight.sensors import Instrument
from finback.records import Outcome

Planner = Callable[..., Campaign]


def held(**values: float) -> tuple[Varied, ...]:
    return tuple(Varied(name=name, spread=Fixed(value=value)) for name, value in values.items())


def same(one: Flown, two: Flown) -> bool:
    """Tell whether two flights left the same bits."""
    return (
        (one.sample, one.outcome, one.note) == (two.sample, two.outcome, two.note)
        and np.array_equal(one.measures, two.measures, equal_nan=True)
        and list(one.history) == list(two.history)
        and all(one.history[name].tobytes() == two.history[name].tobytes() for name in one.history)
    )


def test_a_flight_does_not_depend_on_those_before_it(plan: Planner) -> None:
    campaign = plan(options=replace(plan().options, alpha_limits_rad=(-0.31, 0.51)))  # some depart
    with Crew(campaign) as crew:
        forward = [crew.fly(index) for index in range(campaign.flights)]
        backward = [crew.fly(index) for index in reversed(range(campaign.flights))]
    with Crew(campaign) as other:
        alone = other.fly(17)
    assert all(same(one, two) for one, two in zip(forward, reversed(backward), strict=True))
    assert same(forward[17], alone)
    assert {flown.outcome for flown in forward} == {Outcome.COMPLETED.value, Outcome.DEPARTED.value}


def test_nor_does_one_in_gusts_with_other_loading_and_sensors(plan: Planner) -> None:
    spreads = {
        "mass_ratio": Uniform(low=0.9, high=1.1),
        "airspeed_m_s": Uniform(low=250.0, high=300.0),
        "beta_rad": Grid(values=(-0.02, 0.02)),
        "intensity_m_s": Uniform(low=0.5, high=2.0),
        "length_m": Fixed(value=500.0),
    }
    shown = Instrument(channel="beta_rad", noise=1e-3, lag_s=0.1, sample_interval_s=0.02)
    campaign = plan(
        fidelities=("free",),
        varied=(*plan().varied, *(Varied(name=name, spread=spread) for name, spread in spreads.items())),
        history=History(channels=("alpha_rad", "beta_rad", "p_rad_s", "airspeed_m_s")),
        sensors=replace(plan().sensors, instruments=(shown,), vane_forward_m=3.0),
        draws=1,
    )
    with Crew(campaign) as crew:
        forward = [crew.fly(index) for index in range(4)]
        backward = [crew.fly(index) for index in (3, 2, 1, 0)]
    assert all(same(one, two) for one, two in zip(forward, reversed(backward), strict=True))
    assert {flown.outcome for flown in forward} <= {outcome.value for outcome in Outcome}
    assert all(list(flown.history) == ["time_s", *campaign.history.channels] for flown in forward)
    gusts = {flown.history["airspeed_m_s"].std() for flown in forward}
    assert len(gusts) == 4  # each has its own


def test_a_flight_is_the_rigs_own_with_the_sensors_noise(campaign: Campaign) -> None:
    sample = campaign.sample(5)
    maneuver = maneuver_of(campaign, sample)
    assert isinstance(maneuver, Release)
    plan = plan_of(
        campaign,
        sample,
        maneuver,
        schedule_of(campaign, maneuver),
        alpha_rad=maneuver.alpha_rad,
        q_rad_s=maneuver.q_rad_s,
    )
    with Crew(campaign) as crew, Rig(campaign.aircraft, campaign.condition, step_s=campaign.options.step_s) as rig:
        flown, record = crew.fly(5), rig.fly(plan)
    facts = dict(zip(MEASURES, flown.measures, strict=True))
    assert facts["alpha_start_rad"] == record["alpha_rad"][0]
    assert facts["q_end_rad_s"] == record["q_rad_s"][-1]
    assert facts["alpha_max_rad"] == record["alpha_rad"].max()
    assert facts["duration_s"] == record.duration_s
    noise = flown.history["alpha_rad"] - record["alpha_rad"]
    assert noise.std() == pytest.approx(1e-3, rel=0.4)  # five standard errors of a hundred samples
    assert flown.history["q_dot_rad_s2"].tobytes() == record["q_dot_rad_s2"].tobytes()


def test_only_the_histories_asked_for_are_kept(plan: Planner) -> None:
    history = History(channels=("q_rad_s", "beta_rad"), every=3)
    with Crew(plan(history=history, fidelities=("rig", "symmetric"))) as crew:
        flights = [crew.fly(index) for index in range(7)]
    assert [bool(flown.history) for flown in flights] == [True, False, False, True, False, False, True]
    assert list(flights[0].history) == ["time_s", "q_rad_s"]  # the rig has no sideslip
    assert list(flights[3].history) == ["time_s", "q_rad_s", "beta_rad"]


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_what_a_fidelity_records_is_what_the_plan_says(plan: Planner, fidelity: str) -> None:
    campaign = plan(fidelities=(fidelity,), draws=1)
    with Crew(campaign) as crew:
        record = crew.vehicle(fidelity).fly(crew.plan(0))
    assert set(record.columns) == set(RECORDED[fidelity])


def test_a_flight_that_cannot_begin_is_data(plan: Planner) -> None:
    """Sampled beyond a limit, or without a trim: the flight is refused, with the reason, and the next one flies."""
    beyond = plan(
        varied=(
            Varied(name="elevator_rad", spread=Grid(values=(0.5, 0.1))),
            *held(alpha_rad=0.0, q_rad_s=0.0, duration_s=1.0),
        ),
        draws=1,
    )
    with Crew(beyond) as crew:
        refused, flown = crew.fly(0), crew.fly(1)
    assert refused.outcome == REFUSED
    assert "outside its limits" in refused.note
    assert all(math.isnan(value) for value in refused.measures)
    assert flown.outcome == Outcome.COMPLETED.value


def test_a_maneuver_starts_at_its_trim_found_once(plan: Planner) -> None:
    holds = plan(
        kind="hold",
        varied=(Varied(name="elevator_rad", spread=Grid(values=(-0.1, 0.33, -0.1))), *held(duration_s=1.0)),
        draws=1,
    )
    with Crew(holds) as crew:
        first, untrimmed, again = (crew.fly(index) for index in range(3))
    still = dict(zip(MEASURES, first.measures, strict=True))
    assert abs(still["alpha_end_rad"] - still["alpha_start_rad"]) < 1e-9  # the residual of a trim, over a second
    assert untrimmed.outcome == REFUSED
    assert first.measures == again.measures


def test_a_vehicle_that_jsbsim_failed_in_is_made_anew(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    with Crew(campaign) as crew:
        whole = [crew.fly(index) for index in range(3)]
        broken = crew.vehicle("rig")

        def fail(plan: object) -> None:
            raise AircraftError(f"/any/where/f8ii.xml: it broke {plan is None}")

        monkeypatch.setattr(broken, "fly", fail)
        lost, after = crew.fly(1), crew.fly(2)
        assert crew.vehicle("rig") is not broken
    assert lost.outcome == REFUSED
    assert lost.note == "f8ii.xml: it broke False"  # the same wherever the copy lay
    assert same(after, whole[2])


def test_another_aircraft_at_the_same_place_is_not_flown(campaign: Campaign) -> None:
    with pytest.raises(AircraftError, match="have changed"):
        Crew(replace(campaign, aircraft=replace(campaign.aircraft, sha256="0" * 64)))


def test_what_varies_beside_the_maneuver_reaches_the_plan(plan: Planner) -> None:
    heavy = Varied(name="mass_ratio", spread=Uniform(low=0.9, high=1.1))
    loaded = plan(varied=(*plan().varied, heavy, *held(center_aft_m=0.1)))
    sample = loaded.sample(0)
    maneuver = maneuver_of(loaded, sample)
    made = plan_of(loaded, sample, maneuver, schedule_of(loaded, maneuver), alpha_rad=0.0, q_rad_s=0.0)
    assert made.loading == Loading(mass_ratio=sample.values[4], center_aft_m=0.1)


def test_a_campaign_says_how_well_its_step_resolves_it_whatever_was_flown(
    plan: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("finback.flight.campaign.resolution._SAMPLE", 2)
    short = plan(fidelities=("rig", "symmetric"), draws=1)
    fastest = {"rig": 2, "symmetric": 3}
    told = resolution(short, fastest)
    for found, fidelity in zip(told, ("rig", "symmetric"), strict=True):
        assert (found.fidelity, found.step_s, len(found.flights)) == (fidelity, 0.005, 2)
        assert short.sample(fastest[fidelity]).name in {flight.flight for flight in found.flights}
        assert all(isinstance(flight.reference, Reference) and flight.roads_agree for flight in found.flights)
    alone = plan(fidelities=("rig",), draws=1)
    assert resolution(alone, {"rig": 1}) == resolution(alone, {"rig": 1})


def test_flights_that_are_refused_are_no_part_of_the_sample(plan: Planner) -> None:
    """Some start outside the limits of alpha, all of the second campaign do."""
    wide = plan(varied=tuple(_wide(item) for item in plan().varied))
    assert resolution(wide, {"rig": 0})[0].flights
    outside = plan(varied=tuple(_wide(item, low=1.0) for item in plan().varied))
    for fastest, why in (({}, "no flight could be flown"), ({"rig": 1}, "no flight of the sample could be flown")):
        (found,) = resolution(outside, fastest)
        assert not found.flights
        assert found.unknown == (why,)
        assert found.remarks == (f"rig: {why}",)


def _wide(item: Varied, low: float = -0.9) -> Varied:
    return Varied(name=item.name, spread=Uniform(low=low, high=1.2)) if item.name == "alpha_rad" else item

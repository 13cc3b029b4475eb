"""The plan of a campaign: every flight's values are a function of plan and number."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.errors import InputError
from finback.flight.campaign.plan import Campaign, History, Varied
from finback.flight.campaign.spread import Choice, Fixed, Grid, Normal, Uniform, extremes
from finback.flight.sensors import Instrument

Planner = Callable[..., Campaign]


def test_the_grids_are_run_through_for_each_draw_and_a_draw_is_the_same_all_over_the_grid(campaign: Campaign) -> None:
    samples = [campaign.sample(index) for index in range(campaign.flights)]
    assert campaign.flights == 3 * 2 * 4
    assert len({sample.name for sample in samples}) == campaign.flights
    for draw in range(4):
        part = samples[6 * draw : 6 * draw + 6]
        assert [(one.values[0], one.values[2]) for one in part] == [
            (elevator, q) for elevator in (-0.2, 0.0, 0.1) for q in (-0.5, 0.5)
        ]
        assert len({one.values[1] for one in part}) == 1
    assert len({sample.values[1] for sample in samples}) == 4


def test_another_seed_draws_otherwise_and_what_else_varies_changes_no_draw(campaign: Campaign) -> None:
    other = replace(campaign, seed=4)
    assert other.sample(0).values[1] != campaign.sample(0).values[1]
    more = replace(
        campaign,
        varied=(*campaign.varied[:2], Varied(name="q_rad_s", spread=Uniform(low=-1, high=1)), campaign.varied[3]),
    )
    assert more.sample(0).values[1] == campaign.sample(0).values[1]


def test_a_pickled_plan_draws_the_same(campaign: Campaign) -> None:
    back = pickle.loads(pickle.dumps(campaign))  # noqa: S301 - our own bytes
    assert back == campaign
    assert [back.sample(n) for n in range(5)] == [campaign.sample(n) for n in range(5)]
    assert back.sha256 == campaign.sha256


def test_the_fingerprint_tells_plans_apart_but_not_the_place_of_the_aircraft(campaign: Campaign) -> None:
    moved = replace(campaign, aircraft=replace(campaign.aircraft, path=campaign.aircraft.path.parent / "other.xml"))
    assert moved.sha256 == campaign.sha256
    changed = (
        replace(campaign, seed=9),
        replace(campaign, draws=5),
        replace(campaign, partition_flights=7),
        replace(campaign, history=History(every=2)),
        replace(campaign, aircraft=replace(campaign.aircraft, sha256="0" * 64)),
    )
    assert len({one.sha256 for one in (campaign, *changed)}) == 1 + len(changed)


@given(uniform=st.floats(0, 1, exclude_max=True))
def test_draws_stay_inside_what_the_plan_says(uniform: float) -> None:
    for spread in (
        Uniform(low=-2.0, high=5.0),
        Normal(mean=1.0, standard_deviation=3.0, low=-2.0, high=5.0),
        Normal(mean=1.0, standard_deviation=3.0, low=-2.0),
        Normal(mean=1.0, standard_deviation=3.0, high=5.0),
        Normal(mean=1.0, standard_deviation=3.0),
        Choice(values=(-2.0, 5.0, 1.0)),
    ):
        low, high = extremes(spread)
        assert low <= spread.at(uniform) <= high
    assert math.isfinite(Normal(mean=0.0, standard_deviation=1.0).at(uniform))


@given(uniform=st.floats(1e-9, 1 - 1e-9))
def test_a_normal_draw_is_the_quantile_of_its_cut_distribution(uniform: float) -> None:
    whole = NormalDist(1.0, 2.0)
    cut = Normal(mean=1.0, standard_deviation=2.0, low=0.0, high=4.0)
    share = (whole.cdf(cut.at(uniform)) - whole.cdf(0.0)) / (whole.cdf(4.0) - whole.cdf(0.0))
    assert share == pytest.approx(uniform, abs=1e-9)  # the quantile function is good to 1e-16 of the density here


def test_the_draws_of_many_flights_have_the_distribution_asked_for(plan: Planner) -> None:
    spreads = (Fixed(value=0.0), Normal(mean=0.1, standard_deviation=0.05), Fixed(value=0.0), Fixed(value=1.0))
    names = ("elevator_rad", "alpha_rad", "q_rad_s", "duration_s")
    varied = tuple(Varied(name=name, spread=spread) for name, spread in zip(names, spreads, strict=True))
    many = plan(varied=varied, draws=2000)
    drawn = np.array([many.sample(index).values[1] for index in range(2000)])
    assert drawn.mean() == pytest.approx(0.1, abs=5 * 0.05 / math.sqrt(2000))  # five standard errors
    assert drawn.std() == pytest.approx(0.05, rel=5 / math.sqrt(2 * 2000))
    lag = np.corrcoef(drawn[1:], drawn[:-1])[0, 1]
    assert abs(lag) < 5 / math.sqrt(2000)


@pytest.mark.parametrize(
    "build",
    [
        lambda: Fixed(value=math.nan),
        lambda: Grid(values=()),
        lambda: Grid(values=(1.0, math.inf)),
        lambda: Uniform(low=2.0, high=1.0),
        lambda: Normal(mean=0.0, standard_deviation=0.0),
        lambda: Normal(mean=0.0, standard_deviation=1.0, low=1.0),
        lambda: Normal(mean=0.0, standard_deviation=1.0, high=math.nan),
        lambda: Choice(values=()),
    ],
)
def test_impossible_spreads_are_refused(build: object) -> None:
    with pytest.raises(InputError):
        build()  # type: ignore[operator] # one of the lambdas above


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "loop"}, "unknown kind"),
        ({"kind": "hold"}, "a hold needs"),
        ({"fidelities": ("rig", "rig")}, "each fidelity once"),
        ({"fidelities": ("real",)}, "unknown fidelity"),
        ({"draws": 0}, "must be positive"),
        ({"draws": 10_000_000}, "more than"),
        ({"partition_flights": 0}, "must be positive"),
        ({"seed": -1}, "must not be negative"),
    ],
)
def test_impossible_plans_are_refused(campaign: Campaign, changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(campaign, **changes)  # type: ignore[arg-type] # wrong on purpose


def test_numbers_beside_the_maneuver_must_be_of_the_fidelity_and_of_a_release(campaign: Campaign) -> None:
    heavy = Varied(name="mass_ratio", spread=Uniform(low=0.9, high=1.1))
    assert replace(campaign, varied=(*campaign.varied, heavy)).names[-1] == "mass_ratio"
    with pytest.raises(InputError, match="fidelity 'rig' has no airspeed_m_s"):
        replace(campaign, varied=(*campaign.varied, Varied(name="airspeed_m_s", spread=Fixed(value=200.0))))
    hold = tuple(item for item in campaign.varied if item.name in {"elevator_rad", "duration_s"})
    with pytest.raises(InputError, match="starts at the trim"):
        replace(campaign, kind="hold", varied=(*hold, heavy))


def test_histories_are_counted_before_the_start(campaign: Campaign) -> None:
    assert campaign.flights == 24
    assert replace(campaign, history=History(every=5)).histories == 5
    assert replace(campaign, history=History(every=0)).histories == 0
    assert campaign.most_rows == 101


@pytest.mark.parametrize("channels", [(), ("alpha_rad", "alpha_rad"), ("time_s",), ("alfa_rad",)])
def test_impossible_histories_are_refused(channels: tuple[str, ...]) -> None:
    with pytest.raises(InputError):
        History(channels=channels)


def test_nobody_asks_for_what_nobody_records(plan: Planner) -> None:
    """A channel must be recorded in one of the fidelities, a sensor needs its channel in all of them."""
    sideways = History(channels=("q_rad_s", "beta_rad"))
    assert plan(fidelities=("rig", "free"), history=sideways).history == sideways
    with pytest.raises(InputError, match="flights of fidelity rig record no beta_rad"):
        plan(history=sideways)
    sensors = replace(plan().sensors, instruments=(Instrument(channel="beta_rad", bias=0.1),))
    assert plan(fidelities=("free",), sensors=sensors).sensors == sensors
    with pytest.raises(InputError, match="flights of fidelity rig record no beta_rad"):
        plan(fidelities=("rig", "free"), sensors=sensors)

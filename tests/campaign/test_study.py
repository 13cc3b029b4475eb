"""The section ``[campaign]`` of a study: what it becomes, and every fault by its place."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from finback import pipeline
from finback.errors import StudyError
from finback.flight.campaign.plan import DEFAULT_CHANNELS, Campaign
from finback.flight.campaign.spread import Fixed, Grid, Normal, Uniform
from finback.study import is_campaign_study, read_campaign_study, read_study

RAD = math.pi / 180.0


def read(text: str, folder: Path) -> Campaign:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return read_campaign_study(path).campaign


def faults(text: str, folder: Path) -> str:
    with pytest.raises(StudyError) as error:
        read(text, folder)
    return str(error.value)


def test_numbers_lists_and_draws_become_spreads_in_si(campaign_text: str, tmp_path: Path) -> None:
    campaign = read(campaign_text, tmp_path)
    found = {item.name: item.spread for item in campaign.varied}
    assert found == {
        "elevator_rad": Uniform(low=-20.0 * RAD, high=5.0 * RAD),
        "alpha_rad": Normal(mean=5.0 * RAD, standard_deviation=12.0 * RAD, low=-25.0 * RAD, high=40.0 * RAD),
        "q_rad_s": Grid(values=(-20.0 * RAD, 0.0, 20.0 * RAD)),
        "duration_s": Fixed(value=1.5),
    }
    assert (campaign.flights, campaign.draws, campaign.partition_flights, campaign.seed) == (90, 30, 25, 7)
    assert campaign.history.channels == ("alpha_rad", "q_rad_s", "elevator_rad")
    assert campaign.fidelities == ("rig",)


def test_what_is_not_said_is_eight_channels_of_every_flight_at_the_rate_of_the_study(
    campaign_text: str, tmp_path: Path
) -> None:
    head, _, rest = campaign_text.partition("[campaign.history]")
    campaign = read(head + rest[rest.index("[identification]") :], tmp_path)
    assert campaign.history.channels == DEFAULT_CHANNELS
    assert len(DEFAULT_CHANNELS) == 8
    assert campaign.histories == campaign.flights
    assert campaign.options.sample_interval_s == 1 / 100
    slower = read(campaign_text.replace("every = 2", "every = 2\nsample_hz = 50"), tmp_path)
    assert slower.options.sample_interval_s == 1 / 50


def test_fidelity_loading_start_power_and_air_may_vary(campaign_text: str, tmp_path: Path) -> None:
    parts = """
[campaign.loading]
mass_ratio = { uniform = [0.9, 1.1] }
center_aft_m = [0.0, 0.1]
[campaign.start]
airspeed_m_s = 250.0
beta_deg = { choice = [-2.0, 2.0] }
[campaign.power]
thrust_n = 30000.0
[campaign.air]
intensity_m_s = 1.0
length_m = 500.0
"""
    text = campaign_text.replace("[campaign.history]", parts + "[campaign.history]")
    campaign = read(text.replace("partition_flights = 25", 'partition_flights = 25\nfidelity = "free"'), tmp_path)
    assert campaign.flights == 90 * 2
    assert campaign.fidelities == ("free",)
    assert campaign.names[4:] == (
        "mass_ratio",
        "center_aft_m",
        "airspeed_m_s",
        "beta_rad",
        "thrust_n",
        "intensity_m_s",
        "length_m",
    )
    assert "fidelity 'rig' has no airspeed_m_s" in faults(text, tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("draws = 30", "draws = 0", "campaign.draws"),
        ("draws = 30", "draws = 30\nflights = 3", "campaign.flights: unknown key"),
        ("draws = 30", 'draws = 30\nfidelity = ["rig", "real"]', "campaign.fidelity[1]"),
        ("uniform = [-20.0, 5.0]", "uniform = [5.0, -20.0]", "campaign.maneuver.elevator_deg: uniform: 5 is above"),
        ("uniform = [-20.0, 5.0]", "uniform = [-90.0, 5.0]", "reaches -90 deg, outside flight.elevator_limits_deg"),
        ("uniform = [-20.0, 5.0]", "uniform = [nan, 5.0]", "must be a finite number, got nan"),
        (
            "uniform = [-20.0, 5.0]",
            "unifrom = [-20.0, 5.0]",
            "elevator_deg.unifrom: unknown key; did you mean 'uniform'",
        ),
        ("uniform = [-20.0, 5.0]", "uniform = [-20.0]", "uniform: needs [low, high]"),
        ("uniform = [-20.0, 5.0]", "uniform = [-20.0, 5.0], limits = [-1.0, 1.0]", "must have one of"),
        ("uniform = [-20.0, 5.0]", "uniform = 3.0", "must be a list of numbers"),
        ("[5.0, 12.0]", "[5.0, -12.0]", "standard deviation must be positive"),
        ("[5.0, 12.0]", "[80.0, 12.0]", "must increase and hold the mean"),
        ("[-20.0, 0.0, 20.0]", "[]", "campaign.maneuver.q_deg_s: needs at least one value"),
        ("[-20.0, 0.0, 20.0]", '["much"]', "must be a number"),
        ("[-20.0, 0.0, 20.0]", "inf", "must be a finite number, got inf"),
        ('kind = "release"', 'kind = "releese"', "did you mean 'release'"),
        ("alpha_deg = {", "alfa_deg = {", "campaign.maneuver.alfa_deg: unknown key; did you mean 'alpha_deg'"),
        ('"q_rad_s", "elevator_rad"]', '"q_rad", "elevator_rad"]', "unknown channel 'q_rad'"),
        ('kind = "release"', 'kind = "matched-three-two-one-one"', "campaign.maneuver.kind: unknown kind"),
        (", limits = [-25.0, 40.0]", "", "alpha_deg: reaches 103.514 deg, outside flight.alpha_limits_deg"),
        (", limits = [-25.0, 40.0]", "", "cut it with limits = [low, high]"),
        (", limits = [-25.0, 40.0]", ", limits = [-25.0, 46.0]", "alpha_deg: reaches 46 deg, outside"),
        ("[-20.0, 0.0, 20.0]", "[-20.0, 2000.0]", "q_deg_s: reaches 2000 deg/s, outside what counts as flying"),
        (
            "duration_s = 1.5",
            "duration_s = { normal = [1.5, 0.3] }",
            "duration_s: must be greater than or equal to 0.0001, may be drawn as -0.962861; cut it with limits",
        ),
        ('"q_rad_s", "elevator_rad"]', '"q_rad_s", "beta_rad"]', "channels[2]: flights of fidelity rig record no beta"),
        (
            "[campaign]\n",
            "[sensors.beta]\nbias_deg = 0.1\n[campaign]\n",
            "sensors.beta: flights of fidelity rig record no",
        ),
        ("every = 2", "every = -1", "campaign.history.every"),
        ("every = 2", "every = 2\nsample_hz = 33.0", "campaign.history.sample_hz"),
        (
            "[campaign.history]",
            "[campaign.loading]\nmass_ratio = 0.0\n[campaign.history]",
            "campaign.loading.mass_ratio",
        ),
        ("[campaign.history]", "[campaign.loading]\nmass_kg = 1.0\n[campaign.history]", "loading.mass_kg: unknown key"),
        ("[campaign]\n", '[[sweep]]\nkind = "hold"\n[campaign]\n', "maneuvers [[sweep]] or a [campaign], not both"),
    ],
)
def test_every_fault_is_named_by_its_place(campaign_text: str, tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in campaign_text
    assert said in faults(campaign_text.replace(old, new, 1), tmp_path)


@pytest.mark.parametrize(
    ("number", "said"),
    [
        ("airspeed_m_s = { uniform = [-10.0, 200.0] }", "must be greater than or equal to 1, may be drawn as -10"),
        ("airspeed_m_s = [200.0, -5.0, 100.0]", "must be greater than or equal to 1, got -5.0"),
        ("airspeed_m_s = { normal = [200.0, 50.0] }", "may be drawn as -210.477; cut it with limits = [low, high]"),
        ("theta_deg = { choice = [0.0, 90.0] }", "must be less than 90, may be drawn as 90"),
        ("beta_deg = -90.0", "must be greater than -90, got -90.0"),
        ("latitude_deg = 91.0", "must be less than 90, got 91.0"),
        ("altitude_m = [0.0, 1000.0]", "must be greater than 0, got 0.0"),
    ],
)
def test_no_flight_starts_where_none_can(campaign_text: str, tmp_path: Path, number: str, said: str) -> None:
    text = campaign_text.replace("[campaign.history]", f"[campaign.start]\n{number}\n[campaign.history]")
    place = f"campaign.start.{number.partition(' ')[0]}: "
    told = faults(text.replace("partition_flights = 25", 'partition_flights = 25\nfidelity = "free"'), tmp_path)
    assert said in told.partition(place)[2]


def test_all_faults_of_a_campaign_come_together(campaign_text: str, tmp_path: Path) -> None:
    """A fault in one key, or one table, hides none of another."""
    text = campaign_text
    for old, new in (
        ("draws = 30", 'draws = 0\nfidelity = ["rig", "real"]'),
        ("uniform = [-20.0, 5.0]", "uniform = [5.0, -20.0]"),
        ("{ normal = [5.0, 12.0], limits = [-25.0, 40.0] }", "100.0"),
        ("duration_s = 1.5", "duration_s = -1.5"),
        ("every = 2", "every = -1\n[campaign.loading]\nmass_ratio = nan\ncenter_aft_m = 1e3"),
        ('"q_rad_s", "elevator_rad"]', '"q_rad", "beta_rad"]'),
        ("q_noise_deg_s", "q_noise_deg"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    said = faults(text, tmp_path)
    for place in (
        "campaign.draws:",
        "campaign.fidelity[1]:",
        "campaign.maneuver.elevator_deg:",
        "campaign.maneuver.alpha_deg:",
        "campaign.maneuver.duration_s:",
        "campaign.loading.mass_ratio:",
        "campaign.loading.center_aft_m:",
        "campaign.history.every:",
        "campaign.history.channels[1]:",
        "campaign.history.channels[2]:",
        "sensors.q_noise_deg:",
    ):
        assert said.count(place) == 1, place


def test_faults_come_together(campaign_text: str, tmp_path: Path) -> None:
    text = (
        campaign_text.replace("draws = 30", "draws = 0")
        .replace("seed = 7", "seed = -7")
        .replace("[5.0, 12.0]", "[1.0]")
    )
    said = faults(text, tmp_path)
    assert all(place in said for place in ("campaign.draws", "seed", "campaign.maneuver.alpha_deg"))


def test_later_stages_may_be_missing_until_they_are_asked_for(campaign_text: str, tmp_path: Path) -> None:
    text = campaign_text[: campaign_text.index("[identification]")]
    assert read(text, tmp_path).flights == 90
    path = tmp_path / "study.toml"
    assert is_campaign_study(path)
    assert pipeline.check(path).faults == ()
    with pytest.raises(StudyError, match="identification: missing"):
        read_study(path)
    path.write_text(campaign_text)
    assert read_study(path).maneuvers == ()

"""A small campaign as a study file, and what its run leaves."""

from __future__ import annotations

from pathlib import Path

import pytest

SECTION = """
[campaign]
draws = 30
partition_flights = 25

[campaign.maneuver]
kind = "release"
elevator_deg = { uniform = [-20.0, 5.0] }
alpha_deg = { normal = [5.0, 12.0], limits = [-25.0, 40.0] }
q_deg_s = [-20.0, 0.0, 20.0]
duration_s = 1.5

[campaign.history]
channels = ["alpha_rad", "q_rad_s", "elevator_rad"]
every = 2
recordings = 3
"""


@pytest.fixture(scope="session")
def campaign_text(small_study_text: str) -> str:
    """The small study with a campaign of 90 releases in place of its sweep."""
    head, _, rest = small_study_text.partition("[[sweep]]")
    return head + SECTION + rest[rest.index("[identification]") - 1 :]


@pytest.fixture
def campaign_file(campaign_text: str, tmp_path: Path) -> Path:
    path = tmp_path / "campaign.toml"
    path.write_text(campaign_text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def finished_campaign(campaign_text: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run of the campaign, flown by two processes. Tests must not write to it."""
    from finback.campaign import Processes, begin_campaign, fly
    from finback.pipeline import SILENCE

    folder = tmp_path_factory.mktemp("campaign")
    study = folder / "campaign.toml"
    study.write_text(campaign_text, encoding="utf-8")
    opened = begin_campaign(study, output=folder)
    fly(opened, Processes(count=2), SILENCE)
    return opened.run

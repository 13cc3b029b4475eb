"""A study that is a campaign: what later stages need may be missing in its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import final

from finback.errors import StudyError
from finback.flight.aircraft import Aircraft
from finback.flight.campaign.plan import Campaign
from finback.study.faults import read_toml
from finback.study.flight import read_flight, read_sensors
from finback.study.reader import StudyReader
from finback.study.tables import ConditionTable


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignStudy:
    """A study that is a campaign, in SI.

    Attributes:
        name: folder-safe name of the study.
        path: the file it was read from.
        text: that file's content.
        campaign: what is flown.
    """

    name: str
    path: Path
    text: str
    campaign: Campaign


def is_campaign_study(path: Path) -> bool:
    """Return whether a study file has a section ``[campaign]``; a file that cannot be read has none."""
    return "campaign" in read_toml(path, [])[1]


def read_campaign_study(path: Path, *, aircraft: str = "") -> CampaignStudy:
    """Read the study file of a campaign.

    Args:
        path: the file.
        aircraft: name or path of the aircraft to take in place of the file's, if not empty.

    Raises:
        StudyError: with every fault of the file, a missing or broken aircraft included.
    """
    study, _, faults = inspect_campaign(path, aircraft=aircraft)
    if study is None:
        raise StudyError(str(path), faults)
    return study


def inspect_campaign(
    path: Path, *, aircraft: str = ""
) -> tuple[CampaignStudy | None, Aircraft | None, tuple[str, ...]]:
    """Return the campaign if its file has no fault, its aircraft if that was found, and every fault."""
    faults: list[str] = []
    text, table = read_toml(path, faults)
    if faults:
        return None, None, tuple(faults)
    reader = StudyReader(table, faults)
    found = reader.aircraft(path.resolve().parent, aircraft)
    campaign = _campaign(reader, found)
    if faults or campaign is None:
        return None, found, tuple(dict.fromkeys(faults))
    return CampaignStudy(name=campaign.study, path=path, text=text, campaign=campaign), found, ()


def _campaign(reader: StudyReader, aircraft: Aircraft | None) -> Campaign | None:
    """Read the campaign and what it needs; sections of later stages are checked where they are."""
    condition = reader.table(ConditionTable, "condition")
    flight = read_flight(reader, reader.seed)
    sensors = read_sensors(reader, flight)
    campaign = reader.campaign(aircraft, condition, sensors, flight)
    reader.part(flight, (), ())
    if "validation" in reader.root:
        reader.validation(flight)
    return campaign

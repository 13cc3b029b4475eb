"""From a study file to plans in SI, or to one complete error."""

from finback.study.campaign_study import CampaignStudy, inspect_campaign, is_campaign_study, read_campaign_study
from finback.study.reader import inspect_study, read_study, read_study_part
from finback.study.study import Study, StudyPart

__all__ = [
    "CampaignStudy",
    "Study",
    "StudyPart",
    "inspect_campaign",
    "inspect_study",
    "is_campaign_study",
    "read_campaign_study",
    "read_study",
    "read_study_part",
]

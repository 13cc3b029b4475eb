"""From a study file to plans in SI, or to one complete error."""

from finback.study.reader import inspect_study, read_study
from finback.study.study import Study

__all__ = ["Study", "inspect_study", "read_study"]

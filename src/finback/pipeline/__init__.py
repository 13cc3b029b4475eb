"""The stages of a run and what stands beside them, one function for each verb of the command line."""

from finback.pipeline.check import Checked, check
from finback.pipeline.flights import compare, fly
from finback.pipeline.folder import newest_run, recording
from finback.pipeline.models import analyze_file, analyze_otherwise
from finback.pipeline.progress import SILENCE, Progress, Silence
from finback.pipeline.reflown import Reflown, recording_of, refly
from finback.pipeline.stages import (
    NOT_FLOWN,
    REPORT,
    Run,
    analyze,
    identify,
    report,
    run,
    sweep,
    validate,
)
from finback.store.campaign import DISCRETIZATION
from finback.store.run import LOGS, RECORDINGS
from finback.store.sweep import load_accuracy

__all__ = [
    "DISCRETIZATION",
    "LOGS",
    "NOT_FLOWN",
    "RECORDINGS",
    "REPORT",
    "SILENCE",
    "Checked",
    "Progress",
    "Reflown",
    "Run",
    "Silence",
    "analyze",
    "analyze_file",
    "analyze_otherwise",
    "check",
    "compare",
    "fly",
    "identify",
    "load_accuracy",
    "newest_run",
    "recording",
    "recording_of",
    "refly",
    "report",
    "run",
    "sweep",
    "validate",
]

"""Results on disk: typed values to and from JSON and Parquet, with provenance, never half-written, never stale."""

from finback.store.model_file import ModelFile, read_model_file
from finback.store.results import (
    load_analysis,
    load_identification,
    load_validation,
    read_analysis_alone,
    save_analysis,
    save_analysis_alone,
    save_identification,
    save_validation,
)
from finback.store.sweep import load_sweep, save_sweep

__all__ = [
    "ModelFile",
    "load_analysis",
    "load_identification",
    "load_sweep",
    "load_validation",
    "read_analysis_alone",
    "read_model_file",
    "save_analysis",
    "save_analysis_alone",
    "save_identification",
    "save_sweep",
    "save_validation",
]

"""Results on disk: typed values to and from JSON and Parquet, with provenance, never half-written, never stale."""

from finback.store.results import (
    load_analysis,
    load_identification,
    load_validation,
    save_analysis,
    save_identification,
    save_validation,
)
from finback.store.sweep import load_sweep, save_sweep

__all__ = [
    "load_analysis",
    "load_identification",
    "load_sweep",
    "load_validation",
    "save_analysis",
    "save_identification",
    "save_sweep",
    "save_validation",
]

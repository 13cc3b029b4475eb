"""Results on disk: typed values to and from JSON and Parquet, with provenance, never half-written, never stale.

What is named here is imported when it is first asked for: a campaign needs none of what the others are made of.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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
    from finback.store.sweep import load_accuracy, load_sweep, save_sweep

_HOMES = {
    "ModelFile": "model_file",
    "read_model_file": "model_file",
    "load_accuracy": "sweep",
    "load_sweep": "sweep",
    "save_sweep": "sweep",
}  # of the rest: results

__all__ = [
    "ModelFile",
    "load_accuracy",
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


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES.get(name, 'results')}"), name)

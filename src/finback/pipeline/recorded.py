"""Runs whose flights were recorded, not flown here: what is asked of a model of theirs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

from finback.dynamics.analysis import AnalysisOptions
from finback.errors import RefusedError
from finback.identification.identify import Identification
from finback.identification.options import IdentificationOptions
from finback.records import Sweep
from finback.store.codec import from_tree
from finback.store.envelope import ORIGIN, RECORDED, STUDY_FILE
from finback.units import to_si

INSTRUMENTS: Final = "instruments"
"""Key in a flight's provenance: faults of its instruments that bear upon a model (``InstrumentFaults``, as JSON)."""
_MARGIN_RAD: Final = to_si(0.5, "deg")  # of the window beyond what was flown
_ELEVATORS: Final = 200  # of an analysis that nobody asked for


def is_recorded(sweep: Sweep) -> bool:
    """Tell whether the flights of a sweep were recorded, not flown here."""
    return sweep.provenance.get(ORIGIN) == RECORDED


def identification_of_records(run: Path, sweep: Sweep) -> IdentificationOptions:
    """Return what the run's study asks ``identify``; without ``[identification]``, cubics over all of alpha flown."""
    from finback.study.recorded import read_recorded_study  # noqa: PLC0415 - scipy.signal, for these runs only

    for asked in read_recorded_study(run / STUDY_FILE).identification:
        return asked
    low, high = _reach(sweep, "alpha_rad")
    return IdentificationOptions(alpha_window_rad=(low - _MARGIN_RAD, high + _MARGIN_RAD))


def analysis_of_records(run: Path, sweep: Sweep) -> AnalysisOptions:
    """Return what the run's study asks ``analyze``; without ``[analysis]``, the elevators and angles flown."""
    from finback.study.recorded import read_recorded_study  # noqa: PLC0415 - as above

    for asked in read_recorded_study(run / STUDY_FILE).analysis:
        return asked
    elevator, alpha = _reach(sweep, "elevator_rad"), identification_of_records(run, sweep).alpha_window_rad
    return AnalysisOptions(
        elevator_range_rad=elevator, elevator_step_rad=(elevator[1] - elevator[0]) / _ELEVATORS, alpha_range_rad=alpha
    )


def with_instruments_of_records(identification: Identification, sweep: Sweep) -> Identification:
    """Widen a model's covariance by the faults of the instruments that its flights' provenance tells of."""
    from finback.identification.instruments import InstrumentFaults, with_instruments  # noqa: PLC0415 - as above

    faults = {
        record.name: from_tree(json.loads(record.provenance[INSTRUMENTS]), InstrumentFaults)
        for record in sweep.records
        if INSTRUMENTS in record.provenance
    }
    return with_instruments(identification, sweep, faults)


def _reach(sweep: Sweep, name: str) -> tuple[float, float]:
    values = np.concatenate([record[name] for record in sweep.records])
    if not np.isfinite(values).any() or np.nanmin(values) == np.nanmax(values):
        raise RefusedError(f"{name} never changes in '{sweep.study}': there is nothing to identify or analyze")
    return float(np.nanmin(values)), float(np.nanmax(values))

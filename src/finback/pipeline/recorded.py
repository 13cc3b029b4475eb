"""Runs whose flights were recorded, not flown here: what is asked of a model of theirs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from finback.dynamics.analysis import AnalysisOptions
from finback.errors import RefusedError
from finback.identification.identify import Identification
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import least_half_width_s
from finback.records import FlightRecord, Sweep
from finback.store.codec import from_tree
from finback.store.envelope import ORIGIN, RECORDED, STUDY_FILE
from finback.units import to_si

INSTRUMENTS: Final = "instruments"
"""Key in a flight's provenance: faults of its instruments that bear upon a model (``InstrumentFaults``, as JSON)."""
_MARGIN_RAD: Final = to_si(0.5, "deg")  # of the window beyond what was flown
_APART: Final = 0.1  # of the condition's airspeed: beyond, forces are off by a fifth
_LIKE: Final = 0.05  # as near a wrong unit must come to be named
_UNITS: Final = ("kt", "km_h", "ft_s", "mi_h")
_MEANT: Final = (
    "identify takes that of the condition for all flights, so one of them is wrong, or the airspeed differs from "
    "flight to flight: then finback coefficients is what fits them together"
)
_ELEVATORS: Final = 200  # of an analysis that nobody asked for


def is_recorded(sweep: Sweep) -> bool:
    """Tell whether the flights of a sweep were recorded, not flown here."""
    return sweep.provenance.get(ORIGIN) == RECORDED


def identification_of_records(run: Path, sweep: Sweep) -> IdentificationOptions:
    """Return what the run's study asks ``identify``; what it leaves out follows from the flights.

    That is: a window of all of alpha that was flown, and test functions as wide as the samples need. Without
    ``[identification]``, cubics.
    """
    from finback.study.recorded import read_recorded_study  # noqa: PLC0415 - scipy.signal, for these runs only

    study = read_recorded_study(run / STUDY_FILE)
    for asked in study.identification:
        return _completed(asked, sweep, study.left_out)
    every = frozenset(("alpha_window_deg", "half_width_s", "spacing_s", "minimum_duration_s"))
    return _completed(IdentificationOptions(alpha_window_rad=(-math.pi, math.pi)), sweep, every)


def _completed(asked: IdentificationOptions, sweep: Sweep, left_out: frozenset[str]) -> IdentificationOptions:
    """Let the flights say what was left out."""
    changed: dict[str, Any] = {}
    if "alpha_window_deg" in left_out:
        (low, high), (least, most) = _reach(sweep, "alpha_rad"), asked.alpha_window_rad
        changed["alpha_window_rad"] = (max(low - _MARGIN_RAD, least), min(high + _MARGIN_RAD, most))
    width = asked.half_width_s
    if "half_width_s" in left_out:
        width = max(width, *(least_half_width_s(record) for record in sweep.records))
        changed["half_width_s"] = width
    if "spacing_s" in left_out:
        changed["spacing_s"] = width / 4.0
    if "minimum_duration_s" in left_out:
        changed["minimum_duration_s"] = max(asked.minimum_duration_s, 2.0 * width)
    return replace(asked, **changed)


def analysis_of_records(run: Path, sweep: Sweep) -> AnalysisOptions:
    """Return what the run's study asks ``analyze``; without ``[analysis]``, the elevators and angles flown."""
    from finback.study.recorded import read_recorded_study  # noqa: PLC0415 - as above

    for asked in read_recorded_study(run / STUDY_FILE).analysis:
        return asked
    elevator, alpha = _reach(sweep, "elevator_rad"), identification_of_records(run, sweep).alpha_window_rad
    return AnalysisOptions(
        elevator_range_rad=elevator, elevator_step_rad=(elevator[1] - elevator[0]) / _ELEVATORS, alpha_range_rad=alpha
    )


def contradictions(record: FlightRecord) -> tuple[str, ...]:
    """Say where a flight's columns contradict the condition that its map gives."""
    speeds = record.columns.get("airspeed_m_s", np.empty(0))
    speeds = speeds[np.isfinite(speeds)]
    if not speeds.size:
        return ()
    flown, given = float(np.median(speeds)), record.condition.airspeed_m_s
    if abs(flown - given) <= _APART * given:
        return ()
    # In a unit u of which one is f m/s, a speed declared m/s is 1/f times too large; and the other way round.
    units = [
        (unit, raw)
        for unit in _UNITS
        for raw, ratio in ((True, flown / given * to_si(1.0, unit)), (False, given / flown * to_si(1.0, unit)))
        if abs(ratio - 1.0) < _LIKE
    ]
    like = ""
    for unit, raw in units[:1]:
        like = f" (numbers in {unit} taken for m/s?)" if raw else f" (numbers in m/s taken for {unit}?)"
    said = f"airspeed_m_s is {flown:.4g} m/s in the middle, the map's condition says {given:.4g} m/s{like}"
    return (f"{said}: {_MEANT if not like else 'one of them is wrong'}",)


def with_instruments_of_records(identification: Identification, sweep: Sweep) -> Identification:
    """Widen a model's covariance by faults of instruments that its flights' provenance tells of; say contradictions."""
    from finback.identification.instruments import InstrumentFaults, with_instruments  # noqa: PLC0415 - as above

    faults = {
        record.name: from_tree(json.loads(record.provenance[INSTRUMENTS]), InstrumentFaults)
        for record in sweep.records
        if INSTRUMENTS in record.provenance
    }
    widened = with_instruments(identification, sweep, faults)
    against = [(record.name, line) for record in sweep.records for line in contradictions(record)]
    if not against:
        return widened
    flight, line = against[0]
    said = f"{line} (in {len(against)} of {len(sweep.records)} flights, first in '{flight}')"
    return replace(widened, warnings=(*widened.warnings, said))


def _reach(sweep: Sweep, name: str) -> tuple[float, float]:
    values = np.concatenate([record[name] for record in sweep.records])
    if not np.isfinite(values).any() or np.nanmin(values) == np.nanmax(values):
        raise RefusedError(f"{name} never changes in '{sweep.study}': there is nothing to identify or analyze")
    return float(np.nanmin(values)), float(np.nanmax(values))

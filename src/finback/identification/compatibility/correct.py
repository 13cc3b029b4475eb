"""Faults of instruments taken out of a record."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from finback.arrays import FloatArray
from finback.identification.compatibility.check import Compatibility
from finback.identification.compatibility.fault import ALL, Fault, Kind
from finback.identification.compatibility.judgement import InstrumentError
from finback.records import FlightRecord


def corrected(record: FlightRecord, found: Compatibility) -> tuple[FlightRecord, tuple[InstrumentError, ...]]:
    """Return the record with every significant fault taken out, and these faults.

    A fault that the record does not tell from others, or whose 95 % interval holds 0, is left alone. A delay is taken
    out by a cubic spline between finite samples; what lies beyond the record's ends is held.
    """
    faults = {fault.name: fault for fault in ALL}
    taken_out = tuple(error for error in found.errors if error.significant)
    sizes: dict[Fault, float] = {faults[error.name]: error.value for error in taken_out}
    columns: dict[str, FloatArray] = {}
    for name in dict.fromkeys(fault.channel for fault in sizes):
        bias, scale, delay = (sizes.get(Fault(channel=name, kind=kind), 0.0) for kind in Kind)
        columns[name] = true_values(record["time_s"], record[name], bias=bias, scale=scale, delay_s=delay)
    return record.with_columns(**columns), taken_out


def true_values(time: FloatArray, values: FloatArray, *, bias: float, scale: float, delay_s: float) -> FloatArray:
    """Take faults out of one channel: measured(t) = (1 + scale) · true(t − delay) + bias.

    Args:
        time: of the samples, in s, shape (n,).
        values: as measured, in SI, shape (n,).
        bias: in SI.
        scale: what it differs from 1.
        delay_s: against q, in s.
    """
    return (_earlier(time, values, delay_s) - bias) / (1.0 + scale)


def _earlier(time: FloatArray, values: FloatArray, delay_s: float) -> FloatArray:
    """Return values(t + delay); missing where the sample nearest to that time is missing."""
    known = np.isfinite(values)
    if delay_s == 0.0 or known.sum() < 2:
        return values
    then = np.clip(time + delay_s, time[0], time[-1])
    after = np.clip(np.searchsorted(time, then), 1, time.size - 1)
    place = np.where(time[after] - then <= then - time[after - 1], after, after - 1)
    moved = CubicSpline(time[known], values[known])(then)
    return np.where(known[place], moved, np.nan)

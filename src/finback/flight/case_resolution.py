"""How well the step resolves a flown case: the same case at half the step."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.channels import CIRCULAR
from finback.errors import FinbackError
from finback.flight.case import Case, FlownCase
from finback.flight.case_flight import fly_case

_FEWEST: Final = 2  # rows
_FACTOR: Final = 2.0
"""Of the difference to half the step: h^p − (h/2)^p leaves out 1/(2^p − 1) of it, all of it again at first order.

Flight controls and lagged terms are of first order. What is smooth is of second, for the first step is Euler's; its
error is told 1.5 times too large. An f16 with a stepped elevator: 0.6 to 1.7 times what a sixteenth of the step shows.
"""


def with_step_error(case: Case, flown: FlownCase) -> FlownCase:
    """Return a flown case with the error of its step, column by column, as Richardson estimates it.

    Args:
        case: what was flown.
        flown: what it gave.
    """
    step = float(flown.provenance["step_s"])
    half = replace(case, step_s=0.5 * step, sample_interval_s=case.sample_interval_s or step)
    try:
        again = fly_case(half)
    except FinbackError as error:
        warning = f"the error of the step is not known: at half the step, {error.message}"
        return replace(flown, warnings=(*flown.warnings, warning))
    rows = min(again.columns["time_s"].size, flown.columns["time_s"].size)
    if rows < _FEWEST:  # both begin at the start: that says nothing of a step
        warning = "the error of the step is not known: the flight at half the step has no row beside its start"
        return replace(flown, warnings=(*flown.warnings, warning))
    errors = {
        name: _FACTOR * _largest(name, values[:rows], again.columns[name][:rows])
        for name, values in flown.columns.items()
        if name != "time_s" and name in again.columns
    }
    said = f"flown again at {0.5 * step!r} s; an error is estimated as {_FACTOR:g} times the largest difference"
    warnings = flown.warnings
    if (again.outcome, again.columns["time_s"].size) != (flown.outcome, flown.columns["time_s"].size):
        other = f"at half the step the flight ends otherwise: {again.outcome.value}, {again.note}"
        said, warnings = f"{said}; {other}", (*warnings, other)
    return replace(flown, step_error=errors, warnings=warnings, provenance={**flown.provenance, "step_check": said})


def _largest(name: str, one: FloatArray, other: FloatArray) -> float:
    difference = one - other
    if name in CIRCULAR:
        difference = np.pi - np.mod(np.pi - difference, 2.0 * np.pi)
    return float(np.abs(difference).max()) if np.isfinite(difference).all() else math.inf

"""What an identification found beside its coefficients: biases and delays of flights, numbers of the analysis."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from rich.markup import escape

from finback.cli import terminal
from finback.cli.exits import say
from finback.cli.numbers import decimals, measured, plain, shown, to_places, written
from finback.digits import NOT_DETERMINED
from finback.errors import FinbackError
from finback.identification.followed_numbers import analysis_numbers
from finback.identification.identify import Identification
from finback.identification.nuisance import NAMES, UNITS, FlightNuisances
from finback.identification.propagation import PropagatedNumber, propagate
from finback.store.codec import to_tree
from finback.units import unit_of

_EXTRAS = tuple(f"{name.replace(' ', '_')}{{}}_{unit}" for name, unit in zip(NAMES, UNITS, strict=True))
_CONSTANTS = ("dα/dt [deg/s]", "dq/dt [deg/s²]")
_DEGREES = {"rad": "deg", "rad_s": "deg_s"}


def show_nuisances(identification: Identification) -> None:
    """Print biases and delay of every stretch, if any were estimated."""
    if not identification.nuisances:
        return
    console = terminal.open_console()
    asked = [place for place, size in enumerate(identification.options.nuisances.deviations) if size > 0.0]
    units = [written(_DEGREES.get(unit, unit)) for unit in UNITS]
    table = terminal.new_table("flight", "from [s]", *(f"{NAMES[place]} [{units[place]}]" for place in asked))
    for flight in identification.nuisances:
        table.add_row(flight.flight, f"{flight.start_s:.2f}", *(_extra(flight, place) for place in asked))
    terminal.print_table(console, table)


def show_constants(identification: Identification) -> None:
    """Print by how much the constants of each flight differ from the model's, if they were told apart."""
    if not identification.constants:
        return
    table = terminal.new_table("flight", *(f"constant of {rate}, beside the model's" for rate in _CONSTANTS))
    for own in identification.constants:
        table.add_row(
            own.flight,
            measured(shown(own.alpha_dot_rad_s, "rad_s"), shown(own.alpha_dot_error_rad_s, "rad_s")),
            measured(shown(own.q_dot_rad_s2, "rad_s2"), shown(own.q_dot_error_rad_s2, "rad_s2")),
        )
    terminal.print_table(terminal.open_console(), table)


def _extra(flight: FlightNuisances, place: int) -> str:
    value, error = (getattr(flight, _EXTRAS[place].format(part)) for part in ("", "_error"))
    return measured(shown(value, UNITS[place]), shown(error, UNITS[place]))


def numbers_of(identification: Identification) -> tuple[PropagatedNumber, ...]:
    """Return every number of the analysis with its uncertainty by two roads; none if the model allows no analysis."""
    try:
        return propagate(identification.model, analysis_numbers(identification.model))
    except FinbackError as refusal:
        say(f"finback: warning: nothing is derived from the coefficients: {refusal.message}")
        return ()


def show_numbers(numbers: tuple[PropagatedNumber, ...]) -> None:
    """Print numbers derived from the coefficients with their 95 % intervals by two roads."""
    if not numbers:
        return
    console = terminal.open_console()
    table = terminal.new_table("derived number", "estimate", "linear 95 %", "sampled 95 %")
    for number in numbers:
        unit = unit_of(number.name)
        title = escape(f"{number.name.removesuffix(unit).rstrip('_')} [{written(_DEGREES.get(unit, unit))}]")
        if number.determined:
            half = shown(0.5 * float(np.ptp(number.linear_interval)), unit)
            intervals = [_interval(ends, unit, half) for ends in (number.linear_interval, number.sampled_interval)]
            table.add_row(title, _rounded(shown(number.value, unit), half), *intervals)
        else:
            table.add_row(title, NOT_DETERMINED, "", number.reason)
    terminal.print_table(console, table)


def _rounded(value: float, half: float) -> str:
    return to_places(value, decimals(half)) if half > 0.0 and math.isfinite(half) else plain(value)


def _interval(ends: np.ndarray[Any, np.dtype[np.float64]], unit: str, half: float) -> str:
    return " … ".join(_rounded(shown(float(end), unit), half) for end in ends)


def of_identified(identification: Identification, numbers: tuple[PropagatedNumber, ...]) -> dict[str, Any]:
    """Return biases, delays, constants of flights, suspicions and derived numbers for ``--json``."""
    return {
        "nuisances": [to_tree(flight) for flight in identification.nuisances],
        "constants": [to_tree(flight) for flight in identification.constants],
        "suspicions": [to_tree(suspicion) for suspicion in identification.suspicions],
        "derived": [to_tree(number) for number in numbers],
    }

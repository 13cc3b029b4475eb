"""Maneuvers that suit a model: at trims over its elevators, matched to the mode that it has at each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.system import PlanarSystem
from finback.errors import InputError
from finback.flight.excitation import Maneuver, ThreeTwoOneOne, schedule
from finback.flight.oscillation import FEWEST_SAMPLES, LogSweep, MultisineInput
from finback.flight.plan import FlightOptions
from finback.flight.pulse import matched_unit
from finback.units import from_si, to_si

_TRIMS: Final = 11
"""A tenth of the range of the elevator apart: with all amplitudes, neighbors reach beyond each other."""
_ENDS: Final = 0.03  # of the range of the elevator, that is left free at both ends
_AMPLITUDES_RAD: Final = tuple(to_si(amplitude, "deg") for amplitude in (1.0, 2.0, 4.0, 8.0))
"""Of the elevator: from what hardly rises above usual noise, by factors of two, to a third of usual stops."""
_LEAD_S: Final = 0.5
"""At trim before the maneuver, so that many samples tell where the flight began."""
_BAND: Final = (0.3, 2.5)
"""Of the frequency of the mode: below, only the trim is seen; above, hardly anything of an input of this size."""
_LEAST_DAMPED: Final = 0.95
"""Damping ratio up to which a 3-2-1-1 is matched; a mode that does not oscillate has the unit of such a one."""


def candidates(
    model: PolynomialModel,
    options: FlightOptions,
    *,
    elevator_range_rad: tuple[float, float],
    duration_s: float,
) -> tuple[Maneuver, ...]:
    """Return 3-2-1-1s, multisines and sweeps of several sizes at trims over a range of the elevator.

    At each of eleven elevators that has a stable equilibrium, undamped frequency and damping ratio of the mode there
    give the unit of the 3-2-1-1 and the band of multisine and logarithmic sweep, 0.3 to 2.5 times the frequency.
    Whatever the elevator cannot fly is left out.

    Args:
        model: as well as it is known; without further inputs.
        options: limits and samples of the flights.
        elevator_range_rad: lowest and highest elevator.
        duration_s: of each flight; all are of one length, so that none wins by being longer.

    Raises:
        InputError: the model has further inputs, or nothing can be flown.
    """
    model.refuse_inputs("input design")
    low = max(elevator_range_rad[0], options.elevator_limits_rad[0])
    high = min(elevator_range_rad[1], options.elevator_limits_rad[1])
    room = _ENDS * (high - low)
    found: list[Maneuver] = []
    for elevator in np.linspace(low + room, high - room, _TRIMS).tolist():
        rounded = to_si(round(from_si(elevator, "deg"), 2), "deg")
        for frequency, damping in _modes(PlanarSystem.from_model(model), rounded, options):
            unit = matched_unit(frequency_rad_s=frequency, damping_ratio=min(damping, _LEAST_DAMPED))
            for amplitude in _AMPLITUDES_RAD:
                found += _at(rounded, amplitude, (frequency, unit), options, duration_s)
    if not found:
        raise InputError(
            "no maneuver can be proposed: the model has no stable equilibrium there, or flights are too short",
            hint="widen elevator_range_deg and the limits of the flight, or lengthen the flights",
        )
    return tuple(found)


def _modes(system: PlanarSystem, elevator_rad: float, options: FlightOptions) -> Iterator[tuple[float, float]]:
    """Yield undamped frequency and damping ratio of the stable equilibrium of smallest |alpha|, if there is one."""
    low, high = options.alpha_limits_rad
    there = [p for p in planar_equilibria(system, elevator_rad) if p.kind.stable and low < p.state[0] < high]
    for point in sorted(there, key=lambda p: abs(float(p.state[0])))[:1]:
        values = point.eigenvalues_real + 1j * point.eigenvalues_imag
        frequency = math.sqrt(abs(float((values[0] * values[1]).real)))
        yield frequency, -float(point.eigenvalues_real.sum()) / (2.0 * frequency)


def _at(
    elevator_rad: float, amplitude_rad: float, mode: tuple[float, float], options: FlightOptions, duration_s: float
) -> Iterator[Maneuver]:
    """Yield what can be flown at a trim with an amplitude; of the mode, the frequency and the unit that suits it."""
    frequency, unit = mode
    grid, hertz = options.sample_interval_s, frequency / (2.0 * math.pi)
    lead = round(_LEAD_S / grid) * grid
    place = {"elevator_rad": elevator_rad, "amplitude_rad": amplitude_rad, "lead_s": lead, "duration_s": duration_s}
    lowest, highest = (float(f"{share * hertz:.3g}") for share in _BAND)
    highest = min(highest, 1.0 / (FEWEST_SAMPLES * grid))
    period = math.floor((duration_s - lead) / grid + 0.5) * grid
    makers = (
        lambda: ThreeTwoOneOne(unit_s=max(1, round(unit / grid)) * grid, **place),
        lambda: MultisineInput(lowest_1_s=lowest, highest_1_s=highest, period_s=period, **place),
        lambda: LogSweep(from_1_s=lowest, to_1_s=highest, sweep_s=period, **place),
    )
    for make in makers:
        try:
            maneuver: Maneuver = make()
            schedule(
                maneuver,
                rate_limit_rad_s=options.elevator_rate_rad_s,
                limits_rad=options.elevator_limits_rad,
                grid_s=grid,
            )
        except InputError:
            continue
        yield maneuver

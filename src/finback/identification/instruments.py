"""What errors of instruments leave in a model: its covariance widened by what biases, scales and delays move it.

A bias that all flights share is not seen by any fit: the model moves as a whole. How far, a second fit to the same
samples tells, from which the fault is taken out. Its square is added to the covariance (a Type B uncertainty that is
propagated as the others: JCGM 100:2008, Guide to the expression of uncertainty in measurement, sections 4.3 and 5.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import NORMAL_95
from finback.errors import RefusedError
from finback.identification.compatibility.correct import true_values
from finback.identification.compatibility.fault import ALL, Fault, Kind
from finback.identification.compatibility.wording import with_error
from finback.identification.estimators import estimated
from finback.identification.flight_constants import with_constants, without_columns
from finback.identification.identify import Identification
from finback.identification.method import Method
from finback.identification.noise import measured_noise
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, beyond_half_turn, stretches
from finback.records import Sweep

STATES: Final = ("alpha_rad", "q_rad_s")
"""Channels whose faults move a model; the others are not fitted."""
FAULTS: Final[Mapping[str, Fault]] = {fault.name: fault for fault in ALL if fault.channel in STATES}
"""By name: what can be wrong with them."""

_NAMED: Final = 6  # flights, before the rest is counted


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class KnownFault:
    """A fault of an instrument that was found.

    Attributes:
        name: such as ``alpha bias``.
        value: in SI.
        standard_error: in SI.
        taken_out: whether the records are without it; else it is in them.
    """

    name: str
    value: float
    standard_error: float
    taken_out: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentFaults:
    """What is known of the instruments of one flight.

    Attributes:
        together: names of the flights that were checked together, this one among them: they share every fault.
        known: significant faults of alpha and q.
        unknown: faults of alpha and q of which the record tells nothing, by name.
    """

    together: tuple[str, ...]
    known: tuple[KnownFault, ...]
    unknown: tuple[str, ...]


def with_instruments(
    identification: Identification, sweep: Sweep, faults: Mapping[str, InstrumentFaults]
) -> Identification:
    """Widen the covariance by what faults of the instruments move the coefficients, and say so in the warnings.

    A fault that was taken out counts with its standard error, one that was left in with its whole value beside it.
    Flights that were checked together share an error; others have errors of their own. The fits that tell how far the
    coefficients move are made by the weak form, whatever the method. A bias that the options ask to be estimated is
    left to that.

    Args:
        identification: a model.
        sweep: what it was identified from.
        faults: flight -> what is known of its instruments.
    """
    estimable = {"alpha bias": identification.options.nuisances.alpha_bias_rad > 0.0,
                 "q bias": identification.options.nuisances.q_bias_rad_s > 0.0}  # fmt: skip
    used = {segment.flight for segment in identification.segments}
    known = {
        flight: tuple(fault for fault in item.known if not estimable.get(fault.name, False))
        for flight, item in faults.items()
        if flight in used
    }
    unknown = {
        name: [flight for flight in known if name in faults[flight].unknown]
        for name in FAULTS
        if not estimable.get(name, False)
    }
    said = _untold(unknown, len(known))
    said += _statements(known)
    try:
        moved = _moves(identification, sweep, known, faults)
    except RefusedError as refusal:
        said.append(f"how far faults of the instruments move the model is not known: {refusal.message}")
        moved = np.empty((0, identification.model.covariance.shape[0]))
    covariance = frozen_array(identification.model.covariance + moved.T @ moved)
    return replace(
        identification,
        model=replace(identification.model, covariance=covariance),
        warnings=(*identification.warnings, *said),
    )


def _untold(unknown: Mapping[str, Sequence[str]], count: int) -> list[str]:
    """Say which faults the check does not tell, and in which of that many flights."""
    names = [name + _where(flights, count) for name, flights in unknown.items() if flights]
    return [f"no interval holds what the check of the instruments does not tell: {', '.join(names)}"] if names else []


def _where(flights: Sequence[str], count: int) -> str:
    """Name flights, unless they are all of that many."""
    if len(flights) == count:
        return ""
    more = f" and {len(flights) - _NAMED} more" if len(flights) > _NAMED else ""
    return f" in {', '.join(flights[:_NAMED])}{more}"


def _statements(known: Mapping[str, Sequence[KnownFault]]) -> list[str]:
    """Say each fault once, with the largest of all flights, those left in first."""
    said = []
    for taken_out in (False, True):
        for name, fault in FAULTS.items():
            of_flights = {
                flight: item
                for flight, items in known.items()
                for item in items
                if (item.name, item.taken_out) == (name, taken_out)
            }
            found = list(of_flights.values())
            if not found:
                continue
            worst = max(found, key=lambda item: abs(item.value))
            size = with_error(worst.value, NORMAL_95 * worst.standard_error, fault.unit)
            where = _where(list(of_flights), len(known))
            most = "at most " if len({item.value for item in found}) > 1 else ""
            said.append(
                f"{name}{where}, {most}{size}: taken out; the intervals hold the error of that"
                if taken_out
                else f"{name}{where}, {most}{size}: left in; the intervals hold all of it, the estimates are off by it "
                "(prepare --correct takes it out)"
            )
    return said


def _moves(
    identification: Identification,
    sweep: Sweep,
    known: Mapping[str, Sequence[KnownFault]],
    faults: Mapping[str, InstrumentFaults],
) -> FloatArray:
    """Return by how much the coefficients move with each independent part of the faults, shape (parts, p)."""
    parts: dict[tuple[str, tuple[str, ...]], dict[str, float]] = {}
    for flight, items in known.items():
        for item in items:
            if not item.taken_out:  # its direction is known, in every flight
                parts.setdefault((item.name, ()), {})[flight] = item.value
            parts.setdefault((item.name, faults[flight].together), {})[flight] = item.standard_error
    if not parts:
        return np.empty((0, identification.model.covariance.shape[0]))
    options = _weak(identification)
    # The samples stay those of the fit: a window of alpha would cut them elsewhere once alpha has moved.
    windowed = not any(lasting for record in sweep.records for _, lasting in [beyond_half_turn(record["alpha_rad"])])
    used = [
        piece
        for flight in known
        for piece in stretches(sweep[flight], options, windowed=windowed, further=options.model_form.inputs[1:])
    ]
    used, options, apart = with_constants(used, options)
    noise = measured_noise(used)

    def fitted(pieces: Sequence[Stretch]) -> FloatArray:
        """Return the coefficients of the model as it is stated: explicit, and of the mean flight."""
        found, form = estimated(pieces, options, noise).coefficients, options.model_form
        exact, everywhere = np.zeros((form.size, form.size)), np.tile([-1.0, 1.0], (len(form.variables), 1))
        return without_columns(form.model(found, exact, everywhere), apart).coefficients

    first = fitted(used)
    return np.array(
        [
            fitted([_without(piece, FAULTS[name], sizes.get(piece.flight, 0.0)) for piece in used]) - first
            for (name, _), sizes in parts.items()
        ]
    )


def _weak(identification: Identification) -> IdentificationOptions:
    options = replace(identification.options, method=Method.WEAK_FORM)
    for found in identification.selection:
        return replace(options, form=(found.form,), selection=())
    return options


def _without(piece: Stretch, fault: Fault, size: float) -> Stretch:
    """Take a fault of that size out of a stretch."""
    if size == 0.0:
        return piece
    column = STATES.index(fault.channel)
    bias, scale, delay = (size if fault.kind is kind else 0.0 for kind in Kind)
    measured = piece.measured.copy()
    time = piece.interval_s * np.arange(len(piece), dtype=np.float64)
    measured[:, column] = true_values(np.asarray(time), measured[:, column], bias=bias, scale=scale, delay_s=delay)
    return replace(piece, measured=frozen_array(measured))

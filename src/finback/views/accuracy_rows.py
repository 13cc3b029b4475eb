"""The report's table of how well the step resolves a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.flight.accuracy import FlightAccuracy, SweepAccuracy
from finback.flight.reference import Reference
from finback.views.labels import minus


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyRow:
    """One flight that was flown again, ready to be read; errors in rad.

    Attributes:
        name: the flight's name.
        outcome: how it ended, at half the step too.
        half_step: error of alpha by half the step.
        reference: the same by DOP853, with what that differs from itself.
        growth: by how much a perturbation of the start grows.
        judged: whether the step resolves it.
        limit: what the error may be.
        corners: tables whose corners it passes, or why nobody knows.
    """

    name: str
    outcome: str
    half_step: str
    reference: str
    growth: str
    judged: str
    limit: str
    corners: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyTable:
    """The flights of one fidelity, ready to be read.

    Attributes:
        caption: fidelity, step, and which flights these are.
        rows: the flights.
        remarks: what the numbers alone do not say.
    """

    caption: str
    rows: tuple[AccuracyRow, ...]
    remarks: tuple[str, ...]


def accuracy_table(found: SweepAccuracy) -> AccuracyTable:
    """Return what is known of a step as text."""
    return AccuracyTable(
        caption=f"Flights flown again, {found.fidelity}, step {found.step_s:.6g} s: {found.sample}",
        rows=tuple(_row(flight) for flight in found.flights),
        remarks=tuple(minus(remark) for remark in found.remarks),
    )


def _row(flight: FlightAccuracy) -> AccuracyRow:
    reference, corners = "–", "unknown"
    if isinstance(flight.reference, Reference):
        reference = f"{flight.reference.alpha_error_rad:.1e} ± {flight.reference.uncertainty_rad:.0e}"
        corners = ", ".join(f"{name} ({count})" for name, count in flight.reference.corners.items()) or "none"
    outcome = flight.outcome.value
    if not flight.same_outcome:
        outcome += f", at half the step {flight.outcome_at_half_step.value}"
    judged = "sensitive" if flight.sensitive else "resolved" if flight.resolved else "not resolved"
    return AccuracyRow(
        name=flight.flight,
        outcome=outcome,
        half_step=minus(f"{flight.alpha_error_rad:.1e}"),
        reference=minus(reference),
        growth=minus(f"{flight.growth:.1e}"),
        judged=judged,
        limit="none" if flight.sensitive else minus(f"{flight.limit_rad:.0e}"),
        corners=corners,
    )

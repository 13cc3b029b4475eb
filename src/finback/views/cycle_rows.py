"""Families of limit cycles and regimes of the stability region as rows of text, in degrees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.dynamics.cycle.family import CycleFamily
from finback.dynamics.stability.regime import Bounds, Regime
from finback.units import from_si
from finback.views.labels import angle, minus


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyRow:
    """One family of limit cycles, ready to be read; angles in degrees.

    Attributes:
        begin: what it begins at, and the elevator.
        end: what it ends at, and the elevator.
        amplitude: the least and the greatest amplitude of alpha.
        period: the least and the greatest period, in s.
        stable: how many of the cycles computed are stable.
        folds: elevators of its folds, with 95 % intervals.
        remark: that it is extrapolated.
    """

    begin: str
    end: str
    amplitude: str
    period: str
    stable: str
    folds: str
    remark: str


def family_row(family: CycleFamily) -> FamilyRow:
    """Return a family as text."""
    amplitudes = [from_si(cycle.amplitude_rad, "deg") for cycle in family.cycles]
    periods = [cycle.period_s for cycle in family.cycles]
    outside = any(not cycle.in_domain for cycle in family.cycles)
    return FamilyRow(
        begin=f"{family.begin.value} at {_degrees(family.begin_elevator_rad)}",
        end=f"{family.end.value} at {_degrees(family.end_elevator_rad)}",
        amplitude=_span(amplitudes),
        period=_span(periods),
        stable=f"{sum(cycle.stable for cycle in family.cycles)} of {len(family.cycles)}",
        folds=", ".join(angle(fold.elevator_rad, fold.elevator_interval_rad) for fold in family.folds) or "–",
        remark="extrapolated in part: outside the fitted domain" if outside else "",
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegimeRow:
    """One interval of elevators in which nothing changes what bounds the stability regions.

    Attributes:
        elevator: its ends, with what lies there, in degrees.
        bounds: what bounds the region of each stable equilibrium.
    """

    elevator: str
    bounds: str


def regime_row(regime: Regime) -> RegimeRow:
    """Return a regime as text."""
    low, high = (
        f"{_degrees(float(end))} ({event.value})" for end, event in zip(regime.elevator_rad, regime.events, strict=True)
    )
    said = "; ".join(_bounds(bounds) for bounds in regime.bounds) or regime.obstacle or "no stable equilibrium"
    return RegimeRow(elevator=f"{low} … {high}", bounds=minus(said))


def _bounds(bounds: Bounds) -> str:
    if bounds.cycle:
        return "an unstable limit cycle"
    number = len(bounds.saddles_alpha_rad)
    return f"{number} saddle{'s' if number > 1 else ''}" if number else "nothing: no saddle and no cycle around it"


def _span(values: list[float]) -> str:
    return f"{min(values):.3g} … {max(values):.3g}" if values else "–"


def _degrees(value: float) -> str:
    return minus(f"{from_si(value, 'deg'):.3f}")

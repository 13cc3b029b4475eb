"""Saddle connections and stability regions as rows of text, in degrees."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from finback.arrays import FloatArray
from finback.digits import NOT_DETERMINED, supported
from finback.dynamics.analysis import Analysis
from finback.dynamics.connection.connection import Heteroclinic, Homoclinic
from finback.dynamics.stability.region import StabilityRegion
from finback.units import Quantity, from_si
from finback.views.labels import EXTRAPOLATED, angle, minus, with_error

_UNRESOLVED = "not told from its neighbor in double precision"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionRow:
    """One saddle connection, ready to be read; angles in degrees.

    Attributes:
        name: its kind and which way alpha moves as it leaves.
        elevator: with 95 % interval.
        start: alpha of the saddle that it leaves.
        end: alpha of the saddle that it enters.
        remark: that it is extrapolated, or not resolved.
    """

    name: str
    elevator: str
    start: str
    end: str
    remark: str


def connections_of(analysis: Analysis) -> tuple[Heteroclinic | Homoclinic, ...]:
    """Return all connections of an analysis by rising elevator."""
    found: list[Heteroclinic | Homoclinic] = [*analysis.connections.heteroclinics]
    found += analysis.connections.homoclinics
    return tuple(sorted(found, key=lambda connection: connection.elevator_rad))


def connection_row(found: Heteroclinic | Homoclinic) -> ConnectionRow:
    """Return a connection as text."""
    remarks = [*([] if found.resolved else [_UNRESOLVED]), *([] if found.in_domain else [EXTRAPOLATED])]
    turns = found.turns_alpha_rad.size - isinstance(found, Homoclinic)
    more = f", {turns} more turn{'s' if turns > 1 else ''}" if turns else ""
    if isinstance(found, Heteroclinic):
        name, start, end = "heteroclinic", found.from_alpha_rad, found.to_alpha_rad
    else:
        name, start, end = "homoclinic", found.alpha_rad, found.alpha_rad
    return ConnectionRow(
        name=f"{name}, α {found.direction.value}{more}",
        elevator=angle(found.elevator_rad, found.elevator_interval_rad),
        start=_degrees(start),
        end=_degrees(end),
        remark="; ".join(remarks),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegionRow:
    """One stability region, ready to be read; angles in degrees.

    Attributes:
        elevator: the elevator held.
        sink: alpha of the stable equilibrium.
        saddles: alpha of the saddles that bound it, or what else does.
        area: in deg²/s, with its 95 % interval if the model has a covariance.
        range: the angles within which it was counted.
        beyond: what lies beyond them, and whether the region is proved to reach to infinity.
        escape: the smallest escaping disturbance, with its interval.
        escape_place: alpha and q of the nearest point of the boundary.
        remark: that it is extrapolated.
    """

    elevator: str
    sink: str
    saddles: str
    area: str
    range: str
    beyond: str
    escape: str
    escape_place: str
    remark: str


def region_row(region: StabilityRegion) -> RegionRow:
    """Return a stability region as text."""
    saddles = sorted({branch.saddle_alpha_rad for branch in region.boundary})
    low, high = from_si(region.alpha_range_rad, "deg")
    q = from_si(region.escape_q_rad_s, "deg_s")
    return RegionRow(
        elevator=_degrees(region.elevator_rad),
        sink=_degrees(region.alpha_rad),
        saddles=", ".join(_degrees(saddle) for saddle in saddles) or ("a limit cycle" if region.cycles else "nothing"),
        area=_with_interval(_squared(region.area_rad2_s), _squared(region.area_interval_rad2_s), 0),
        range=minus(f"α {low:g} … {high:g}"),
        beyond=_beyond(region),
        escape=_with_interval(
            from_si(region.escape_distance_rad, "deg"), from_si(region.escape_interval_rad, "deg"), 2
        ),
        escape_place=minus(f"α {from_si(region.escape_alpha_rad, 'deg'):.1f}, q {q:.1f} deg/s")
        if math.isfinite(q)
        else "none escapes",
        remark="" if region.in_domain else EXTRAPOLATED,
    )


def _degrees(value: float) -> str:
    return minus(f"{from_si(value, 'deg'):.2f}")


def _squared(value: Quantity) -> Quantity:
    return from_si(from_si(value, "deg"), "deg")


def _beyond(region: StabilityRegion) -> str:
    """Say how much lies beyond the angles counted, and whether the region is proved to be unbounded."""
    if not region.boundary and not region.cycles:
        return ""
    least, most = region.area_interval_rad2_s.tolist()
    half = _squared(0.5 * (most - least)) if math.isfinite(region.area_rad2_s) else 0.0
    low, high = (_to_digit_of(_squared(float(end)), half) for end in region.area_beyond_rad2_s)
    more = f"{low} beyond" if low == high else f"{low} to {high} beyond"
    if any(not tongue.obstacle for tongue in region.tongues):
        return f"{more}; proved unbounded"
    return f"{more}; not proved unbounded" if region.tongues else more


def _with_interval(value: float, interval: FloatArray, places: int) -> str:
    """Write a size >= 0 with its interval: one that reaches below nothing says nothing of a size."""
    half = 0.5 * float(interval[1] - interval[0]) if math.isfinite(value) else 0.0
    if half > value:
        return NOT_DETERMINED
    return with_error(value, half) if half > 0.0 else _or_infinite(value, places)


def _to_digit_of(value: float, half: float) -> str:
    known = math.isfinite(value) and 0.0 < half < math.inf
    return supported(value, half, most=0)[0] if known else _or_infinite(value, 0)


def _or_infinite(value: float, places: int) -> str:
    return f"{value:.{places}f}" if math.isfinite(value) else "∞"

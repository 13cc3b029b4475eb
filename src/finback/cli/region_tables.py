"""Regimes and stability regions as tables."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from rich.table import Table

from finback.arrays import FloatArray
from finback.cli import terminal
from finback.cli.numbers import head, measured, plain, shown, to_places
from finback.digits import NOT_DETERMINED, supported
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.stability.regime import Bounds, Regime
from finback.dynamics.stability.region import StabilityRegion
from finback.units import quantity_of, unit_of


def regimes_table(regimes: Sequence[Regime]) -> Table:
    """Return a table of what bounds the stability regions between neighboring events."""
    table = terminal.new_table("regime", "elevator [deg]", "begins at", "ends at", "stable alpha [deg]: bounded by")
    for number, regime in enumerate(regimes, start=1):
        low, high = (to_places(shown(float(end), "rad"), 3) for end in regime.elevator_rad)
        table.add_row(
            str(number),
            f"{low} … {high}",
            *(event.value for event in regime.events),
            "; ".join(_bounds(one) for one in regime.bounds) or ("not found" if regime.obstacle else "none is stable"),
        )
    return table


def _bounds(bounds: Bounds) -> str:
    saddles = ", ".join(to_places(shown(saddle, "rad"), 2) for saddle in bounds.saddles_alpha_rad)
    if saddles:
        by = f"saddle{'s' if len(bounds.saddles_alpha_rad) > 1 else ''} at {saddles}"
    else:
        by = "an unstable cycle" if bounds.cycle else "nothing found"
    return f"{to_places(shown(bounds.alpha_rad, 'rad'), 2)}: {by}"


def regions_table(regions: Sequence[StabilityRegion], alpha_range_rad: tuple[float, float]) -> Table:
    """Return a table of stability regions over alpha and its rate."""
    low, high = (to_places(shown(end, "rad"), 0) for end in alpha_range_rad)
    table = terminal.new_table(
        "stability region at elevator [deg]",
        "sink alpha [deg]",
        "saddles alpha [deg]",
        f"area in alpha {low} … {high} [deg²/s]",
        "area beyond [deg²/s]",
        "unbounded",
        "smallest escape [deg]",
        "",
    )
    for region in regions:
        saddles = sorted({branch.saddle_alpha_rad for branch in region.boundary})
        table.add_row(
            to_places(shown(region.elevator_rad, "rad"), 2),
            to_places(shown(region.alpha_rad, "rad"), 2),
            ", ".join(to_places(shown(saddle, "rad"), 2) for saddle in saddles)
            or ("a cycle" if region.cycles else "nothing"),
            _with_interval(_squared(region.area_rad2_s), _squared_all(region.area_interval_rad2_s), 0),
            _beyond(region),
            unbounded(region),
            _with_interval(
                shown(region.escape_distance_rad, "rad"),
                np.array([shown(float(end), "rad") for end in region.escape_interval_rad]),
                2,
            ),
            "" if region.in_domain else "extrapolated",
        )
    return table


def unbounded(region: StabilityRegion) -> str:
    """Tell in a word whether a region reaches to infinity, and whether that is proved."""
    if not region.boundary and not region.cycles:
        return "whole plane"
    if any(not tongue.obstacle for tongue in region.tongues):
        return "proved"
    if region.tongues or np.isinf(region.area_rad2_s):
        return "not proved"
    return "no" if np.isfinite(region.area_beyond_rad2_s[1]) else "not known"


def _beyond(region: StabilityRegion) -> str:
    """Write what lies beyond the range of angles, to the digit to which the area within it is known."""
    half = _half(region.area_interval_rad2_s)
    low, high = (_to_digit_of(_squared(float(end)), _squared(half)) for end in region.area_beyond_rad2_s)
    return low if low == high else f"{low} … {high}"


def _to_digit_of(value: float, half: float) -> str:
    known = math.isfinite(value) and half > 0.0
    return supported(value, half, most=0)[0] if known else to_places(value, 0)


def _half(interval: FloatArray) -> float:
    """Return half the width of an interval; 0 where it has no width that is a number."""
    half = 0.5 * float(interval[1] - interval[0]) if np.isfinite(interval).all() else 0.0
    return half if math.isfinite(half) else 0.0


def _squared(value: float) -> float:
    return shown(shown(value, "rad"), "rad")


def _squared_all(values: FloatArray) -> FloatArray:
    return np.array([_squared(float(value)) for value in values])


def _with_interval(value: float, interval: FloatArray, places: int) -> str:
    """Write a size >= 0 with its interval; with these decimals where the model is exact.

    An interval that reaches below nothing says nothing of a size.
    """
    half = 0.5 * float(interval[1] - interval[0]) if np.isfinite(value) else 0.0
    if half > value:
        return NOT_DETERMINED
    return measured(value, half) if half > 0.0 else to_places(value, places)


def planar_regimes_table(analysis: PlanarAnalysis) -> Table:
    """Return a table of the events that split the range of the parameter."""
    name = analysis.system.variables[2]
    unit = unit_of(name)
    table = terminal.new_table("regime", head(quantity_of(name), unit), "begins at", "ends at", "stability regions")
    for number, regime in enumerate(analysis.regimes, start=1):
        low, high = (plain(shown(float(end), unit)) for end in regime.parameter)
        events = (event.value for event in regime.events)
        table.add_row(str(number), f"{low} … {high}", *events, "not found" if regime.obstacle else str(regime.regions))
    return table


def planar_regions_table(analysis: PlanarAnalysis) -> Table:
    """Return a table of the stability regions of a planar field within its ranges."""
    first, second, parameter = analysis.system.variables
    table = terminal.new_table(
        "stability region",
        *(head(f"sink {quantity_of(name)}", unit_of(name)) for name in (first, second)),
        head(quantity_of(parameter), unit_of(parameter)),
        "bounded by",
        "share of the ranges",
        "smallest escape in half ranges",
        "",
    )
    for number, region in enumerate(analysis.regions, start=1):
        kinds = Counter(curve.kind.value for curve in region.boundary)
        whole = float(np.prod(region.box[:, 1] - region.box[:, 0]))
        table.add_row(
            str(number),
            *(plain(shown(x, unit_of(name))) for x, name in zip(region.state.tolist(), (first, second), strict=True)),
            plain(shown(region.parameter, unit_of(parameter))),
            ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "nothing seen",
            to_places(region.area / whole, 3),
            _with_interval(region.escape_distance, region.escape_distance_interval, 3),
            "" if region.in_domain else "extrapolated",
        )
    return table

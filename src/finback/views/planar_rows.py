"""What was found of a planar field in (alpha, q, elevator) as rows of text, in degrees."""

from __future__ import annotations

import math
from collections import Counter
from typing import Final

from finback.digits import NOT_DETERMINED
from finback.dynamics.planar.analysis import PlanarAnalysis, PlanarRegime
from finback.dynamics.planar.boundary import BoundaryKind
from finback.dynamics.planar.branch_point import PlanarBranchPoint
from finback.dynamics.planar.connection import PlanarHeteroclinic, PlanarHomoclinic
from finback.dynamics.planar.cycle_family import PlanarCycleFamily
from finback.dynamics.planar.fold import PlanarCusp
from finback.dynamics.planar.hopf import PlanarBogdanovTakens, PlanarHopf, PlanarNeutralSaddle
from finback.dynamics.planar.region import PlanarRegion
from finback.units import from_si
from finback.views.cycle_rows import FamilyRow, RegimeRow
from finback.views.labels import EXTRAPOLATED, angle, minus, short, with_error
from finback.views.point_rows import PointRow
from finback.views.stability_rows import ConnectionRow, RegionRow

_Point = PlanarHopf | PlanarNeutralSaddle | PlanarBogdanovTakens | PlanarCusp | PlanarBranchPoint
_BOUNDARIES: Final = {
    BoundaryKind.SADDLE: ("a saddle's stable branch", "stable branches of saddles"),
    BoundaryKind.CYCLE: ("an unstable limit cycle", "unstable limit cycles"),
    BoundaryKind.ORBIT: ("an orbit that leaves the ranges", "orbits that leave the ranges"),
}


def planar_connection_rows(analysis: PlanarAnalysis) -> tuple[ConnectionRow, ...]:
    """Return all saddle connections by rising elevator."""
    found: list[PlanarHeteroclinic | PlanarHomoclinic] = [*analysis.connections.heteroclinics]
    found += analysis.connections.homoclinics
    rows = []
    for one in sorted(found, key=lambda connection: connection.parameter):
        loop = isinstance(one, PlanarHomoclinic)
        start, end = (one.state, one.state) if isinstance(one, PlanarHomoclinic) else (one.from_state, one.to_state)
        rows.append(
            ConnectionRow(
                name="homoclinic" if loop else "heteroclinic",
                elevator=angle(one.parameter, one.parameter_interval),
                start=_degrees(float(start[0])),
                end=_degrees(float(end[0])),
                remark="" if one.in_domain else EXTRAPOLATED,
            )
        )
    return tuple(rows)


def planar_point_rows(analysis: PlanarAnalysis) -> tuple[PointRow, ...]:
    """Return all points of the branches but folds, by angle."""
    found = analysis.found
    points: list[_Point] = [*found.hopf_points, *found.neutral_saddles, *found.bogdanov_takens]
    points += [*found.cusps, *found.branch_points]
    return tuple(_point_row(point) for point in sorted(points, key=lambda point: float(point.state[0])))


def _point_row(point: _Point) -> PointRow:
    name, known = _said(point)
    elevator, alpha = _degrees(point.parameter), _degrees(float(point.state[0]))
    if isinstance(point, PlanarHopf | PlanarNeutralSaddle):
        elevator = angle(point.parameter, point.parameter_interval)
        alpha = angle(float(point.state[0]), point.state_interval[0])
    return PointRow(
        name=name,
        elevator=elevator,
        alpha=alpha,
        known=minus(known),
        remark="" if point.in_domain else EXTRAPOLATED,
    )


def _said(point: _Point) -> tuple[str, str]:
    match point:
        case PlanarHopf():
            half = 0.5 * float(point.lyapunov_interval[1] - point.lyapunov_interval[0])
            first = with_error(point.lyapunov, half) if half else short(point.lyapunov)
            known = f"ω = {point.frequency:.4g} rad/s, first Lyapunov coefficient {first} 1/(s rad²)"
            return f"Hopf point, {point.criticality.value}", known
        case PlanarNeutralSaddle():
            return "neutral saddle", f"eigenvalues ±{point.eigenvalue:.4g} 1/s"
        case PlanarBogdanovTakens():
            return "Bogdanov–Takens point within rounding", "both eigenvalues 0"
        case PlanarCusp():
            return "cusp, or two folds within rounding", "one eigenvalue 0"
        case PlanarBranchPoint():
            return "branch point", f"branches cross: {point.crossing.value}"


def planar_family_row(family: PlanarCycleFamily) -> FamilyRow:
    """Return a family of limit cycles; its amplitude is half of what alpha swings."""
    amplitudes = from_si(0.5 * (family.high[:, 0] - family.low[:, 0]), "deg")
    begin, end = (
        f"{why.value} at {_degrees(float(family.parameter[place]))}"
        for why, place in zip(family.ends, (0, -1), strict=True)
    )
    return FamilyRow(
        begin=begin,
        end=end,
        amplitude=f"{amplitudes.min():.3g} … {amplitudes.max():.3g}",
        period=f"{family.period.min():.3g} … {family.period.max():.3g}",
        stable=f"{int(family.stable.sum())} of {family.stable.size}",
        folds=", ".join(angle(fold.parameter, fold.parameter_interval) for fold in family.folds) or "–",
        remark="" if family.in_domain.all() else "extrapolated in part: outside the fitted domain",
    )


def planar_regime_row(regime: PlanarRegime, analysis: PlanarAnalysis) -> RegimeRow:
    """Return a regime with what bounds the stability regions in its middle."""
    low, high = (
        f"{from_si(float(end), 'deg'):.3f} ({event.value})"
        for end, event in zip(regime.parameter, regime.events, strict=True)
    )
    regions = [region for region in analysis.regions if region.parameter == regime.parameter_seen]
    said = "; ".join(_bounds(region) for region in regions) or regime.obstacle or "no stable equilibrium"
    return RegimeRow(elevator=minus(f"{low} … {high}"), bounds=minus(said))


def planar_region_row(region: PlanarRegion) -> RegionRow:
    """Return a stability region within the ranges of alpha and q."""
    (least, most), (slowest, fastest) = from_si(region.box, "deg")
    alpha, q = from_si(region.escape_state, "deg")
    low, high = region.escape_distance_interval.tolist()
    half = 0.5 * (high - low)
    return RegionRow(
        elevator=_degrees(region.parameter),
        sink=_degrees(float(region.state[0])),
        saddles=_bounds(region),
        area=f"{from_si(from_si(region.area, 'deg'), 'deg'):.0f}",
        range=minus(f"α {least:g} … {most:g}, q {slowest:.3g} … {fastest:.3g} deg/s"),
        beyond="",
        escape=_escape(region.escape_distance, half),
        escape_place=minus(f"α {alpha:.1f}, q {q:.1f} deg/s") if math.isfinite(q) else "none escapes",
        remark="" if region.in_domain else EXTRAPOLATED,
    )


def _escape(distance: float, half: float) -> str:
    if not math.isfinite(distance):
        return "∞"
    if half > distance:
        return NOT_DETERMINED
    return f"{with_error(distance, half) if half else f'{distance:.3f}'} of half the ranges"


def _bounds(region: PlanarRegion) -> str:
    kinds = Counter(curve.kind for curve in region.boundary if curve.separates)
    said = (f"{count} {_BOUNDARIES[kind][1]}" if count > 1 else _BOUNDARIES[kind][0] for kind, count in kinds.items())
    return ", ".join(said) or "nothing within the ranges"


def _degrees(value: float) -> str:
    return minus(f"{from_si(value, 'deg'):.2f}")

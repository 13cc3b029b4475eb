"""Points on the curve of equilibria where the damping vanishes, as rows of text, in degrees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.dynamics.analysis import Analysis
from finback.dynamics.hopf import BogdanovTakens, Hopf, NeutralSaddle
from finback.views.labels import EXTRAPOLATED, angle, minus, short, with_error


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PointRow:
    """One zero of the damping, ready to be read; angles in degrees.

    Attributes:
        name: what it is.
        elevator: with 95 % interval.
        alpha: with 95 % interval.
        known: what else is known of it.
        remark: that it is extrapolated.
    """

    name: str
    elevator: str
    alpha: str
    known: str
    remark: str


def point_rows(analysis: Analysis) -> tuple[PointRow, ...]:
    """Return all Hopf points, neutral saddles and Bogdanov-Takens points by angle."""
    points: list[Hopf | NeutralSaddle | BogdanovTakens] = [*analysis.hopf_points, *analysis.neutral_saddles]
    points += analysis.bogdanov_takens
    return tuple(_row(point) for point in sorted(points, key=lambda point: point.alpha_rad))


def _row(point: Hopf | NeutralSaddle | BogdanovTakens) -> PointRow:
    name, known = _said(point)
    return PointRow(
        name=name,
        elevator=angle(point.elevator_rad, point.elevator_interval_rad),
        alpha=angle(point.alpha_rad, point.alpha_interval_rad),
        known=minus(known),
        remark="" if point.in_domain else EXTRAPOLATED,
    )


def _said(point: Hopf | NeutralSaddle | BogdanovTakens) -> tuple[str, str]:
    if isinstance(point, Hopf):
        half = 0.5 * float(point.lyapunov_interval_1_s[1] - point.lyapunov_interval_1_s[0])
        first = with_error(point.lyapunov_1_s, half) if half else short(point.lyapunov_1_s)
        frequency = f"ω = {point.frequency_rad_s:.4g} rad/s"
        return f"Hopf point, {point.criticality.value}", f"{frequency}, first Lyapunov coefficient {first} 1/(s rad²)"
    if isinstance(point, NeutralSaddle):
        return "neutral saddle", f"eigenvalues ±{point.eigenvalue_1_s:.4g} 1/s"
    return "Bogdanov–Takens point within rounding", "both eigenvalues 0"

"""Fig. 1-4 of the paper, and those of b2 = −1 that it leaves to a later one, from the cubic normal form.

The values below are chosen for the pictures: the paper's own are not given in its text.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from paper_portraits import portrait_of

from finback.arrays import FloatArray
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramOptions, PointKind
from finback.dynamics.diagram.diagram import diagram
from finback.dynamics.first_order.abelian import level_integrals, rings, turning_points
from finback.dynamics.first_order.abelian_zeros import first_order_folds
from finback.dynamics.first_order.saddles import loop_estimate, slope_at_loop
from finback.dynamics.first_order.wells import well_loops_estimate
from finback.dynamics.normal_form.cubic import Cubic, outer_roots
from finback.dynamics.normal_form.cubic_region import Region
from finback.dynamics.portrait.path import Box
from finback.views import style
from finback.views.diagram_figure import Note, Window, draw_curve, draw_diagram, legend_panel
from finback.views.moment_figure import MomentCurve, MomentLine, draw_moments
from finback.views.plane import Plane
from finback.views.portrait_figure import draw_portrait, portrait_legend
from finback.views.sheet import Canvas, Layout, Panel, Sheet, draw_sheet

MOMENT_B1: Final = 0.5
"""b1 of Fig. 2, for b0 = −1."""
MOMENT_LEVELS: Final = (0.35, 0.93)
"""The levels, as shares of that of the loop, at which the line L of Fig. 2 meets R."""
HAMILTON_B1: Final = (0.5, 0.0)
"""b1 of both portraits of Fig. 1, for b0 = −1."""
HAMILTON_LEVELS: Final = (0.1, 0.35, 0.7)
"""Closed orbits of Fig. 1, as shares of the level of the loop."""
PLANE: Final = (1.0, 0.75)
"""a1 and b1 of Fig. 3 (a, b) and 4, with a positive product: all five regions."""
PLANE_MIXED: Final = (-0.5, 0.5)
"""a1 and b1 of Fig. 3 (c), with a negative product: regions I, III and V."""
PLANE_B0: Final = (-2.3, 0.1)
PLANE_A0: Final = (-0.1, 0.25)
DETAIL_B0: Final = (-1.4, -0.6)
DETAIL_A0: Final = (-0.025, 0.03)
REGION_POINTS: Final = (
    (Region.I, -1.0, 0.15),
    (Region.II, -1.0, 0.003),
    (Region.III, -2.0, 0.045),
    (Region.IV, -0.5, -0.012),
    (Region.V, -1.0, -0.15),
)
"""b0 and a0 of the portraits in Fig. 4."""
WELLS: Final = (0.3, 0.2)
"""a1 and b1 of the figures with b2 = −1."""
WELLS_B0: Final = (0.5, 1.2)
WELLS_A0: Final = (0.3, 1.25)
CORNER_B0: Final = (-0.014, 0.052)
CORNER_A0: Final = (-0.026, 0.016)
EVEN_B0: Final = (-0.3, 1.2)
EVEN_A0: Final = (-0.15, 1.25)
WELLS_SEQUENCE: Final = (
    (0.6, (0, 0, 0)),
    (0.73, (0, 1, 0)),
    (0.766, (0, 1, 2)),
    (0.83, (0, 1, 1)),
    (0.895, (0, 0, 1)),
    (1.0, (1, 0, 1)),
    (1.15, (0, 0, 1)),
)
"""a0 of the portraits with b2 = −1, at b0 = 1, and cycles around the left well, the right one and both."""
WELLS_BOX: Final = Box(x_low=-2.5, x_high=2.6, y_low=-3.2, y_high=3.2)
WELLS_STARTS: Final = ((-2.4, 1.9), (2.5, -1.9))
WELLS_TURNS: Final = 2
FINE: Final = DiagramOptions(smoothness=1e-3)
ESTIMATED: Final = 121
"""How many b0 the first-order curves are computed at."""
CURVES: Final = (CurveKind.TRANSCRITICAL, CurveKind.HOPF, CurveKind.HOMOCLINIC, CurveKind.CYCLE_FOLD)
LOOPS: Final = (CurveKind.HOPF, CurveKind.HOMOCLINIC, CurveKind.SADDLE_CYCLE, CurveKind.CYCLE_FOLD)
HAMILTON_BOX: Final = Box(x_low=-2.1, x_high=1.9, y_low=-1.5, y_high=1.5)


def hamiltonian() -> Sheet:
    """Fig. 1: the system without damping: a loop, and the cycle of two saddles."""
    return draw_sheet(
        "fig-01", [_hamiltonian(b1) for b1 in HAMILTON_B1], Layout(columns=2, panel=(style.PAGE / 2, 2.6))
    )


def _hamiltonian(b1: float) -> Panel:
    cubic = Cubic(a2=0.0, a1=0.0, a0=0.0, b1=b1, b0=-1.0)
    (ring,) = rings(cubic)
    starts = [(turning_points(ring, share * ring.top)[1], 0.0) for share in HAMILTON_LEVELS]
    left, right = outer_roots(cubic)
    # Beyond the loop: outside both saddles, above and below both, and between the loop and the other saddle.
    starts += [(left - 0.35, 0.0), (right + 0.35, 0.0), (0.0, 1.1), (0.0, -1.1)]
    starts += [(0.5 * (turning_points(ring, ring.top)[0] + left), 0.0)] if b1 else []
    flow = cubic.flow()
    found = portrait_of(flow, HAMILTON_BOX, starts)
    plane = Plane(x_label="$z_1$", y_label="$z_2$")
    said = r"$\tilde b_1 = " + (f"{b1:g}$: a loop" if b1 else "0$: a cycle of two saddles")
    return Panel(draw=lambda axes: draw_portrait(axes, found, plane), title=said)


def moment_curve() -> Sheet:
    """Fig. 2: the curve R with its end tangents and a line that meets it twice."""
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=MOMENT_B1, b0=-1.0))
    levels = ring.top * (0.5 * (1.0 - np.cos(np.linspace(0.05, np.pi, 121))))
    on = [level_integrals(ring, float(level)) for level in levels]
    P, Q = (np.array([0.0, *(getattr(found, name) for found in on)]) for name in "PQ")
    curve = MomentCurve(level=np.array([0.0, *levels]), P=P, Q=Q)
    cuts = np.array([[found.P, found.Q] for found in (level_integrals(ring, k * ring.top) for k in MOMENT_LEVELS)])
    a1 = float((cuts[1, 1] - cuts[0, 1]) / (cuts[1, 0] - cuts[0, 0]))
    a0 = float(cuts[0, 1] - a1 * cuts[0, 0])
    slopes = 1.0 / MOMENT_B1, slope_at_loop(MOMENT_B1)
    low, high = np.array([-0.1, 1.22]) * P[-1]
    lines = [
        MomentLine(intercept=0.0, slope=slopes[0], text="$L_0$", tangent=True, text_at=0.6 * high),
        MomentLine(
            intercept=Q[-1] - slopes[1] * P[-1], slope=slopes[1], text="$L_*$", tangent=True, text_at=0.05 * high
        ),
        MomentLine(intercept=a0, slope=a1, text="$L$", tangent=False, text_at=0.94 * high),
    ]
    limits = np.array([[low, high], [-0.08 * Q[-1], 1.3 * Q[-1]]])
    panel = Panel(draw=lambda axes: draw_moments(axes, curve, lines, cuts=cuts, limits=limits))
    return draw_sheet("fig-02", [panel], Layout(columns=1, panel=(style.COLUMN, 2.75)))


def saddles_plane() -> Sheet:
    """Fig. 3: the plane of b0 and a0 with exact curves and first-order estimates."""
    wide = [
        Note(x=-1.1, y=0.13, text="I"),
        Note(x=-2.1, y=0.04, text="III"),
        Note(x=-0.9, y=-0.05, text="V"),
        Note(x=-0.1, y=0.15, text="$B_t$"),
        Note(x=-1.8, y=-0.017, text="$B_h$", color=style.PREDICTED),
        Note(x=-2.0, y=0.115, text="$B_{sc}, B_d$", color=style.SIMULATED, target=(-1.9, 0.0735)),
    ]
    near = [
        Note(x=-0.85, y=0.018, text="I"),
        Note(x=-0.93, y=0.009, text="II", target=(-0.985, 0.003)),
        Note(x=-1.3, y=0.006, text="III"),
        Note(x=-0.72, y=-0.0055, text="IV"),
        Note(x=-1.0, y=-0.016, text="V"),
        Note(x=-1.32, y=0.016, text="$B_{sc}$", color=style.SIMULATED),
        Note(x=-1.1, y=0.016, text="$B_d$", color=style.FLOWN),
        Note(x=-0.67, y=0.002, text="$B_h$", color=style.PREDICTED),
    ]
    mixed = [
        Note(x=-1.0, y=0.2, text="I"),
        Note(x=-1.35, y=0.21, text="$B_{sc}$", color=style.SIMULATED),
        Note(x=-1.0, y=-0.017, text="$B_h$", color=style.PREDICTED),
        Note(x=-1.7, y=0.09, text="III"),
        Note(x=-1.3, y=-0.05, text="V"),
    ]
    points = (PointKind.BOGDANOV_TAKENS, PointKind.BAUTIN, PointKind.NEUTRAL_LOOP, PointKind.CROSSING)
    panels = [
        _plane(PLANE, Window(x=PLANE_B0, y=PLANE_A0, kinds=CURVES), wide),
        _plane(PLANE, Window(x=DETAIL_B0, y=DETAIL_A0, kinds=CURVES), near),
        _plane(PLANE_MIXED, Window(x=PLANE_B0, y=PLANE_A0, kinds=CURVES), mixed),
        Panel(draw=lambda axes: legend_panel(axes, CURVES, points)),
    ]
    return draw_sheet("fig-03", panels, Layout(columns=2, panel=(style.PAGE / 2, 2.5)))


def _plane(a1_b1: tuple[float, float], window: Window, notes: list[Note]) -> Panel:
    a1, b1 = a1_b1
    found = plane_of(a1, b1)
    estimates = first_order_plane(a1, b1)

    def draw(axes: Canvas) -> None:
        for kind, points in estimates:
            draw_curve(axes, kind, points, exact=False)
        draw_diagram(axes, found, window, notes)

    return Panel(draw=draw, title=f"$a_1 = {a1:g}$, $b_1 = {b1:g}$")


@cache
def plane_of(a1: float, b1: float) -> Diagram:
    """Return all curves for b0 < 0."""
    return diagram(Cubic(a1=a1, a0=0.0, b1=b1, b0=-1.0).family(), (PLANE_B0[0], 0.0), options=FINE)


def first_order_plane(a1: float, b1: float) -> list[tuple[CurveKind, tuple[FloatArray, FloatArray]]]:
    """Return the estimates of loop and fold of cycles over b0."""
    loop, fold = [], []
    for b0 in np.linspace(PLANE_B0[0], -1e-3, ESTIMATED):
        cubic = Cubic(a1=a1, a0=0.0, b1=b1, b0=float(b0))
        loop.append((b0, loop_estimate(cubic).value))
        fold += [(b0, one.a0.value) for one in first_order_folds(cubic)]
    rows = ((CurveKind.HOMOCLINIC, loop), (CurveKind.CYCLE_FOLD, fold))
    return [(kind, (np.array(row)[:, 0], np.array(row)[:, 1])) for kind, row in rows if row]


def saddles_portraits() -> Sheet:
    """Fig. 4: a portrait in each region."""
    panels = [_region_panel(region, b0, a0) for region, b0, a0 in REGION_POINTS]
    panels.append(Panel(draw=portrait_legend))
    return draw_sheet("fig-04", panels, Layout(columns=3, panel=(style.PAGE / 3, 2.3)))


def _region_panel(named: Region, b0: float, a0: float) -> Panel:
    cubic = Cubic(a1=PLANE[0], a0=a0, b1=PLANE[1], b0=b0)
    left, right = outer_roots(cubic)
    wide, high = right - left, -b0
    box = Box(x_low=left - 0.3 * wide, x_high=right + 0.35 * wide, y_low=-1.3 * high, y_high=1.3 * high)
    starts = [(left - 0.15 * wide, 0.0), (right + 0.15 * wide, 0.0), (0.0, 1.05 * high), (0.0, -1.05 * high)]
    starts += [(0.5 * left, 0.0), (0.15 * right, 0.0)]
    found = portrait_of(cubic.flow(), box, starts)
    assert [drawn.cycle.stable for drawn in found.cycles] == list(named.cycles)
    said = f"region {named}: $b_0 = {b0:g}$, $a_0 = {a0:g}$"
    return Panel(draw=lambda axes: draw_portrait(axes, found), title=said)


def wells_plane() -> Sheet:
    """Not in the paper: the plane of b0 and a0 for b2 = −1."""
    even = [
        Note(x=0.75, y=0.95, text="$B_h$", color=style.PREDICTED),
        Note(x=1.1, y=1.02, text="$B_8$", color=style.PURPLE),
        Note(x=1.08, y=0.7, text="$B_d$", color=style.FLOWN),
    ]
    wide = [
        Note(x=0.8, y=1.0, text="$B_h$, left", color=style.PREDICTED),
        Note(x=1.12, y=1.08, text="$B_{sc}$, left", color=style.SIMULATED),
        Note(x=1.12, y=0.66, text="$B_{sc}$, right", color=style.SIMULATED),
        Note(x=0.93, y=0.42, text="$B_{sc}$, large, and $B_d$", color=style.FLOWN, target=(0.87, 0.66)),
    ]
    near = [
        Note(x=0.006, y=0.0125, text="$B_h$", color=style.PREDICTED),
        Note(x=-0.0125, y=-0.024, text="$B_s$"),
        Note(x=0.002, y=-0.024, text="$B_t$"),
        Note(x=0.022, y=-0.013, text="$B_d$", color=style.FLOWN),
    ]
    kinds = (CurveKind.TRANSCRITICAL, CurveKind.FOLD, CurveKind.PITCHFORK, *LOOPS)
    points = (PointKind.BOGDANOV_TAKENS, PointKind.BAUTIN, PointKind.NEUTRAL_LOOP, PointKind.SADDLE_NODE_LOOP)
    panels = [
        _wells((0.0, 0.0), Window(x=EVEN_B0, y=EVEN_A0, kinds=kinds[2:]), even),
        _wells(WELLS, Window(x=WELLS_B0, y=WELLS_A0, kinds=kinds, points=()), wide),
        _wells(WELLS, Window(x=CORNER_B0, y=CORNER_A0, kinds=kinds, points=points), near, estimated=False),
        Panel(draw=lambda axes: legend_panel(axes, kinds, points)),
    ]
    return draw_sheet("wells-plane", panels, Layout(columns=2, panel=(style.PAGE / 2, 2.6)))


def _wells(a1_b1: tuple[float, float], window: Window, notes: list[Note], *, estimated: bool = True) -> Panel:
    a1, b1 = a1_b1
    found = diagram(Cubic(a1=a1, a0=0.0, b1=b1, b0=1.0, b2=-1.0).family(), window.x)
    estimates = first_order_wells(a1, b1, window.x) if estimated else []

    def draw(axes: Canvas) -> None:
        for kind, line in estimates:
            draw_curve(axes, kind, line, exact=False)
        draw_diagram(axes, found, window, notes)

    return Panel(draw=draw, title=f"$a_1 = {a1:g}$, $b_1 = {b1:g}$")


def first_order_wells(
    a1: float, b1: float, b0_range: tuple[float, float]
) -> list[tuple[CurveKind, tuple[FloatArray, FloatArray]]]:
    """Return the estimates of all loops and folds of cycles over b0 > 0."""
    rows: dict[tuple[CurveKind, str], list[tuple[float, float]]] = {}
    for b0 in np.linspace(max(0.02, b0_range[0]), b0_range[1], ESTIMATED):
        cubic = Cubic(a1=a1, a0=0.0, b1=b1, b0=float(b0), b2=-1.0)
        found = well_loops_estimate(cubic)
        for name in ("left", "right", "large"):
            rows.setdefault((CurveKind.HOMOCLINIC, name), []).append((b0, getattr(found, name).value))
        for fold in first_order_folds(cubic):
            rows.setdefault((CurveKind.CYCLE_FOLD, fold.ring), []).append((b0, fold.a0.value))
    return [(kind, (np.array(row)[:, 0], np.array(row)[:, 1])) for (kind, _), row in rows.items()]


def wells_portraits() -> Sheet:
    """Not in the paper: the sequence of portraits for b2 = −1 as a0 rises."""
    panels = [_wells_panel(a0, counts) for a0, counts in WELLS_SEQUENCE]
    panels.append(Panel(draw=portrait_legend))
    layout = Layout(columns=4, panel=(style.PAGE / 4, 1.95), same_x=True, same_y=True)
    return draw_sheet("wells-portraits", panels, layout)


def _wells_panel(a0: float, counts: tuple[int, int, int]) -> Panel:
    cubic = Cubic(a1=WELLS[0], a0=a0, b1=WELLS[1], b0=1.0, b2=-1.0)
    found = portrait_of(cubic.flow(), WELLS_BOX, WELLS_STARTS, most_turns=WELLS_TURNS)
    inside = [drawn.cycle.enclosed for drawn in found.cycles]
    around = [len(points) > 1 for points in inside]
    left = sum(len(points) == 1 and points[0] < 0.0 for points in inside)
    assert (left, len(inside) - left - sum(around), sum(around)) == counts
    return Panel(draw=lambda axes: draw_portrait(axes, found), title=f"$a_0 = {a0:g}$")

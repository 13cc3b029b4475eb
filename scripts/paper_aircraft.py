"""Fig. 5-11 of the paper, and two that it does not have, from the published model of the F-8 II.

The values below are chosen for the pictures; every other number is computed from the model file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final, final

import numpy as np
from paper_portraits import future_of, portrait_of

from finback.arrays import FloatArray
from finback.dynamics.branch import branch
from finback.dynamics.connection.loop import LoopKind, TwoSaddleCycle, loops, two_saddle_cycle
from finback.dynamics.connection.search import Connections, connections
from finback.dynamics.cycle.fold import cycle_folds
from finback.dynamics.diagram.curve import CurveKind, PointKind
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.family import Family, lienard_family
from finback.dynamics.first_order.saddles import loop_estimate
from finback.dynamics.flow import Scale, natural_scale
from finback.dynamics.fold import Fold, folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.normal_form.cubic_reduction import held_cubic
from finback.dynamics.portrait.path import Box, Portrait
from finback.dynamics.response import ElevatorSchedule, Response, respond
from finback.dynamics.stability.map import stability_map
from finback.dynamics.stability.region import StabilityRegion, stability_region
from finback.store.model_file import read_model_file
from finback.units import from_si, to_si
from finback.views import style
from finback.views.diagram_figure import (
    Note,
    draw_curve,
    draw_notes,
    draw_point,
)
from finback.views.force_figure import draw_force_cuts
from finback.views.plane import PITCH, Plane
from finback.views.portrait_figure import draw_orbits, draw_portrait, portrait_legend
from finback.views.region_figure import Frame, draw_over_elevator, draw_region, draw_regions
from finback.views.response_figure import draw_responses, draw_rest
from finback.views.sheet import Canvas, Layout, Panel, Sheet, draw_sheet

MODEL: Final = Path(__file__).resolve().parent.parent / "aircraft" / "f8ii" / "published.toml"

CUT_DEG: Final = (5.0, -5.0, -25.0)
"""Elevators of the lines in Fig. 5."""
SHOWN_ALPHA_DEG: Final = (-34.0, 46.5)
"""Abscissa of Fig. 5."""
HISTORY_DEG: Final = (0.0, 5.0, -5.0)
"""Elevators of Fig. 8: the paper has 0 and 5, whose sign is lost in print."""
HISTORY_START_DEG: Final = (10.0, 0.0)
"""Alpha and its rate at the start of Fig. 8."""
TRACE_1_S: Final = (-1.6, 0.35)
"""Ordinate of Fig. 6."""
HISTORY_S: Final = 8.0
TRACE_POINTS: Final = (
    ("I", 0.0, 0.15),
    ("II", 0.0, -0.15),
    ("III", 0.0, None),
    ("III", -10.0, None),
    ("III", -25.0, None),
)
"""Name, elevator in deg and a0 in 1/s (None: the aircraft's own) of the portraits in Fig. 7."""
PORTRAIT_FRAME: Final = Frame(alpha_deg=(-50.0, 60.0), alpha_dot_deg_s=(-180.0, 180.0))
PORTRAIT_STARTS: Final = (
    (-40.0, 0.0),
    (52.0, 0.0),
    (0.0, 150.0),
    (0.0, -150.0),
    (-10.0, 0.0),
    (10.0, 90.0),
    (20.0, -90.0),
)
"""States, in deg and deg/s, through which the orbits of Fig. 7 run."""
PORTRAIT_TURNS: Final = 4
SEPARATRIX_FRAME: Final = Frame(alpha_deg=(-60.0, 70.0), alpha_dot_deg_s=(-220.0, 220.0))
SEPARATRIX_NOTES: Final = (
    ("$S_1$", 5.0, 80.0),
    ("$U_2$", 40.0, 130.0),
    ("$U_3$", -46.0, -10.0),
    ("$U_4$", 20.0, -140.0),
    ("$U_5$", 60.0, 10.0),
    ("$W^s_L$", -46.0, 55.0),
    ("$W^s_L$", 20.0, 30.0),
    ("$W^s_R$", 36.0, 62.0),
    ("$W^s_R$", 48.0, -62.0),
    ("$W^u_L$", -10.0, 52.0),
    ("$W^u_L$", -50.0, -70.0),
    ("$W^u_R$", 63.0, 95.0),
    ("$W^u_R$", -6.0, -82.0),
)
"""Names in Fig. 9 and where they stand, in deg and deg/s."""
STRIP: Final = ((-30.0, 165.0), (-18.0, 118.5))
"""Where the name of the thin region in Fig. 9 stands, and what it points at."""
ORBIT_STARTS: Final = (
    ("$s_1$", -42.0, 95.0),
    ("$u_1$", -20.0, 119.0),
    ("$u_2$", -55.0, 200.0),
    ("$u_3$", -40.0, 30.0),
    ("$u_4$", 60.0, -150.0),
    ("$u_5$", 66.0, -60.0),
)
"""Names of the orbits in Fig. 10 and where they begin, in deg and deg/s."""
ORBIT_NAMES: Final = ((6.0, -13.0), (0.0, 17.0), (5.0, 10.0), (-5.0, 8.0), (4.0, -12.0), (-2.0, -17.0))
"""How far from there the names stand."""
REGIME_DEG: Final = ((10.0, 5.0, 0.0), (-4.0, -10.0, -16.0), (-20.0, -26.0, -32.0))
"""Elevators of Fig. 11, above, between and below the two connections of the saddles."""
REGION_FRAME: Final = Frame(alpha_deg=(-60.0, 60.0), alpha_dot_deg_s=(-150.0, 230.0))
AREA_ALPHA_DEG: Final = (-100.0, 100.0)
"""Within these angles areas are measured, and stability regions followed."""
ELEVATORS: Final = 61
"""How many elevators the curves of Fig. 6 and of the area are computed at."""
CORNER_ELEVATORS: Final = 14
"""How many more where the smallest escape is greatest."""
NEAREST_DEG: Final = 0.02
"""How near to the folds of the equilibria they begin and end."""


Starts = tuple[tuple[float, float], ...]


@cache
def aircraft() -> LienardSystem:
    """Return the aircraft's Liénard system."""
    system = read_model_file(MODEL).system()
    assert isinstance(system, LienardSystem)
    return system


@cache
def both_folds() -> tuple[Fold, ...]:
    """Return the folds of the equilibria by falling elevator: L1, L2."""
    found = sorted(folds(aircraft()), key=lambda fold: -fold.elevator_rad)
    assert len(found) == 2
    return tuple(found)


def elevator_range() -> tuple[float, float]:
    """Return the elevators between which there are three equilibria, a little shortened."""
    high, low = (fold.elevator_rad for fold in both_folds())
    return low + to_si(NEAREST_DEG, "deg"), high - to_si(NEAREST_DEG, "deg")


@cache
def saddle_connections() -> Connections:
    """Return the connections of the two saddles."""
    return connections(aircraft(), elevator_range())


def connection_elevators_deg() -> tuple[float, float]:
    """Return the elevators of the lower and of the upper connection."""
    high, low = sorted((from_si(c.elevator_rad, "deg") for c in saddle_connections().heteroclinics), reverse=True)
    return high, low


@cache
def region_at(elevator_deg: float) -> StabilityRegion:
    """Return the stability region at an elevator."""
    low, high = (to_si(end, "deg") for end in AREA_ALPHA_DEG)
    return stability_region(aircraft(), to_si(elevator_deg, "deg"), alpha_range_rad=(low, high))


def force_cut() -> Sheet:
    """Fig. 5: the cubic y = g0(x), cut by y = −δ."""
    system = aircraft()
    elevators = [to_si(value, "deg") for value in CUT_DEG]
    cuts = [(elevator, equilibria(system, elevator)) for elevator in elevators]
    shown = (to_si(SHOWN_ALPHA_DEG[0], "deg"), to_si(SHOWN_ALPHA_DEG[1], "deg"))
    panel = Panel(draw=lambda axes: draw_force_cuts(axes, system, cuts, both_folds(), alpha_range_rad=shown))
    return draw_sheet("fig-05", [panel], Layout(columns=1, panel=(style.COLUMN, 2.6)))


def histories() -> Sheet:
    """Fig. 8: how alpha and its rate decay."""
    system = aircraft()
    times = np.linspace(0.0, HISTORY_S, 321)
    found: list[tuple[str, Response]] = []
    rest = []
    for value in HISTORY_DEG:
        held = ElevatorSchedule.held(to_si(value, "deg"))
        start = {"alpha_rad": to_si(HISTORY_START_DEG[0], "deg"), "alpha_dot_rad_s": to_si(HISTORY_START_DEG[1], "deg")}
        found.append((rf"$\delta_e = {value:g}$°".replace("-", "−"), respond(system, held, time_s=times, **start)))
        rest.append(from_si(equilibria(system, to_si(value, "deg"))[1].alpha_rad, "deg"))
    return _history_sheet(found, rest)


def _history_sheet(found: list[tuple[str, Response]], rest: list[float]) -> Sheet:
    def alpha(axes: Canvas) -> None:
        draw_rest(axes, rest)
        draw_responses(axes, found, "alpha_rad")
        axes.set_ylim(-12.0, 14.5)
        axes.legend(loc="upper right", ncols=3)

    def rate(axes: Canvas) -> None:
        draw_rest(axes, [0.0])
        draw_responses(axes, found, "alpha_dot_rad_s")

    layout = Layout(columns=1, panel=(style.COLUMN, 1.75), same_x=True)
    return draw_sheet("fig-08", [Panel(draw=alpha), Panel(draw=rate)], layout)


def delta_deg_s2(elevator_rad: float | FloatArray) -> FloatArray:
    """Return the paper's δ = c₁ δe."""
    return np.asarray(from_si(aircraft().elevator_gain * np.asarray(elevator_rad), "deg_s2"))


def _elevators(low: float, high: float) -> list[float]:
    """Return values between two ends, denser towards them: near a fold everything goes as a square root."""
    share = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, ELEVATORS)))
    return [float(low + (high - low) * part) for part in share]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LoopCurves:
    """a0 of the loop and of both connections over the elevator; arrays of one length.

    Attributes:
        elevator_rad: the elevator.
        loop: a0 of the homoclinic loop in 1/s.
        estimate: the same to first order.
        falling: a0 of the connection from the right saddle to the left.
        rising: a0 of the connection from the left saddle to the right.
    """

    elevator_rad: FloatArray
    loop: FloatArray
    estimate: FloatArray
    falling: FloatArray
    rising: FloatArray


@cache
def two_saddle_point() -> TwoSaddleCycle:
    """Return where both connections exist at once, as the parameter the elevator in rad, in units of ``_units``."""
    system, scale = aircraft(), _units()

    def family(elevator: float) -> Family:
        whole = lienard_family(system, scale)
        return replace(whole, force=(whole.force[0] + elevator * whole.direction[0], *whole.force[1:]))

    low, high = elevator_range()
    third = (high - low) / 3.0
    return two_saddle_cycle(family, 0.0, (low + third, high - third))


def _units() -> Scale:
    """Return units that fit the middle of the elevator range."""
    return natural_scale(aircraft(), 0.5 * sum(elevator_range()))[0]


@cache
def loop_curves() -> LoopCurves:
    """Return the curves of Fig. 6; that no cycles fold anywhere on them is checked."""
    system = aircraft()
    low, high = elevator_range()
    near = to_si(np.geomspace(0.01, 1.0, 8), "deg")
    corner = two_saddle_point().parameter
    rows = []
    for elevator in sorted([*_elevators(low, high), *(corner + near).tolist(), *(corner - near).tolist()]):
        scale, _ = natural_scale(system, elevator)
        family = lienard_family(system, scale)
        own = float(system.damping(equilibria(system, elevator)[1].alpha_rad))
        every = loops(family, elevator)
        closed = [loop for loop in every if loop.kind is LoopKind.HOMOCLINIC]
        across = sorted((loop for loop in every if loop.kind is LoopKind.HETEROCLINIC), key=lambda loop: loop.from_x)
        assert len(closed) == 1
        assert len(across) == 2
        assert not cycle_folds(family, elevator)
        held = held_cubic(system, elevator)
        estimate = loop_estimate(held.normal).value / held.rescaling.time
        traces = [own + loop.lam / scale.time_s for loop in (*closed, *across[::-1])]
        rows.append((elevator, traces[0], estimate, *traces[1:]))
    columns = np.array(rows).T
    return LoopCurves(
        elevator_rad=columns[0], loop=columns[1], estimate=columns[2], falling=columns[3], rising=columns[4]
    )


def trace_plane() -> Sheet:
    """Fig. 6: the plane of δ and a0 with its curves, and the aircraft's own a0."""
    system = aircraft()
    curves = loop_curves()
    left, right = (delta_deg_s2(fold.elevator_rad).item() for fold in both_folds())
    edges = sorted(fold.alpha_rad for fold in both_folds())
    middle = branch(system, np.linspace(edges[0], edges[1], 301))
    delta = delta_deg_s2(curves.elevator_rad)
    corner = delta_deg_s2(two_saddle_point().parameter).item()
    found = np.sort(delta_deg_s2(to_si(np.array(connection_elevators_deg()), "deg")))

    def plane(axes: Canvas) -> None:
        axes.set_xlim(left - 18.0, right + 18.0)
        axes.set_ylim(*TRACE_1_S)
        axes.set_ylabel("$a_0$ [1/s]")
        for end in (left, right):
            draw_curve(axes, CurveKind.FOLD, (np.full(2, end), np.array(TRACE_1_S)), exact=True)
        draw_curve(axes, CurveKind.HOPF, (np.array([left, right]), np.zeros(2)), exact=True)
        for values in (curves.falling, curves.rising):
            draw_curve(axes, CurveKind.HETEROCLINIC, (delta, values), exact=True)
        draw_curve(axes, CurveKind.HOMOCLINIC, (delta, curves.loop), exact=True)
        draw_curve(axes, CurveKind.HOMOCLINIC, (delta, curves.estimate), exact=False)
        own = delta_deg_s2(middle.elevator_rad)
        axes.plot(own, middle.divergence_1_s, color=style.FLOWN, linewidth=1.8, linestyle=(0, (6, 1.6, 1, 1.6)))
        draw_point(axes, PointKind.TWO_SADDLE_CYCLE, corner, float(np.interp(-corner, -delta, curves.loop)))
        order = np.argsort(own)
        there = np.interp(found, own[order], middle.divergence_1_s[order])
        axes.plot(found, there, color=style.INK, marker="o", markerfacecolor=style.PAPER, linestyle="none", zorder=6)
        draw_notes(axes, _trace_notes(left, right))

    def error(axes: Canvas) -> None:
        axes.set_xlabel(r"$\delta = c_1\delta_e$ [deg/s$^2$]")
        axes.set_ylabel("error [%]")
        share = 100.0 * (curves.estimate / curves.loop - 1.0)
        draw_curve(axes, CurveKind.HOMOCLINIC, (delta, share), exact=False)
        axes.axhline(0.0, color=style.MUTED, linewidth=0.5)

    layout = Layout(columns=1, panel=(style.COLUMN, 2.2), same_x=True, heights=(2.6, 1.0))
    panels = [Panel(draw=plane), Panel(draw=error, title="first order against exact")]
    return draw_sheet("fig-06", panels, layout)


def _trace_notes(left: float, right: float) -> list[Note]:
    return [
        Note(x=left - 10.0, y=-1.33, text="$L_1$"),
        Note(x=right + 10.0, y=-1.33, text="$L_2$"),
        Note(x=120.0, y=0.07, text="$B_h$", color=style.PREDICTED),
        Note(x=120.0, y=-0.29, text="$B_{sc}$", color=style.SIMULATED),
        Note(x=-18.0, y=-1.06, text=r"$a_0(\delta)$", color=style.FLOWN),
        Note(x=113.0, y=-1.47, text="$B_{he}$", color=style.BAND),
        Note(x=-18.0, y=-1.5, text="$B_{he}$", color=style.BAND),
        Note(x=45.0, y=0.2, text="I"),
        Note(x=45.0, y=-0.14, text="II"),
        Note(x=45.0, y=-0.85, text="III"),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Portrayed:
    """A portrait of the aircraft and the plane in which its units are degrees."""

    portrait: Portrait
    plane: Plane


def portrayed(elevator_deg: float, frame: Frame, *, a0: float | None = None, orbits_deg: Starts = ()) -> Portrayed:
    """Return the aircraft's portrait at an elevator, with its own trace a0 at the sink or another one in 1/s."""
    system, elevator = aircraft(), to_si(elevator_deg, "deg")
    scale, _ = natural_scale(system, elevator)
    own = float(system.damping(equilibria(system, elevator)[1].alpha_rad))
    flow = lienard_family(system, scale).at(elevator, 0.0 if a0 is None else (a0 - own) * scale.time_s)
    x, y = from_si(scale.length_rad, "deg"), from_si(scale.speed_rad_s, "deg_s")
    (left, right), (low, high) = frame.alpha_deg, frame.alpha_dot_deg_s
    box = Box(x_low=left / x, x_high=right / x, y_low=low / y, y_high=high / y)
    starts = [(alpha / x, rate / y) for alpha, rate in orbits_deg]
    found = portrait_of(flow, box, starts, most_turns=PORTRAIT_TURNS)
    return Portrayed(portrait=found, plane=replace(PITCH, x_unit=x, y_unit=y))


def traces() -> Sheet:
    """Fig. 7: portraits in the regions of Fig. 6, the last one in its three regimes."""
    panels = []
    for name, elevator, a0 in TRACE_POINTS:
        shown = portrayed(elevator, PORTRAIT_FRAME, a0=a0, orbits_deg=PORTRAIT_STARTS)

        def draw(axes: Canvas, shown: Portrayed = shown, elevator: float | None = None if a0 else elevator) -> None:
            draw_portrait(axes, shown.portrait, shown.plane)
            if elevator is not None:
                draw_region(axes, region_at(elevator))

        held = f"$\\delta_e = {elevator:g}$°" + (f", $a_0 = {a0:g}$ s$^{{-1}}$" if a0 else "")
        panels.append(Panel(draw=draw, title=f"region {name}: {held}".replace("-", "−")))
    panels.append(Panel(draw=portrait_legend))
    return draw_sheet("fig-07", panels, Layout(columns=3, panel=(style.PAGE / 3, 2.3), same_x=True, same_y=True))


def separatrices() -> Sheet:
    """Fig. 9: the stability region S1 and the diverging regions that the eight branches cut out."""
    shown = portrayed(0.0, SEPARATRIX_FRAME)

    def draw(axes: Canvas) -> None:
        draw_portrait(axes, shown.portrait, shown.plane)
        draw_region(axes, region_at(0.0))
        strip = Note(x=STRIP[0][0], y=STRIP[0][1], text="$U_1$", target=STRIP[1])
        draw_notes(axes, [strip, *(Note(x=x, y=y, text=text) for text, x, y in SEPARATRIX_NOTES)])

    return draw_sheet("fig-09", [Panel(draw=draw)], Layout(columns=1, panel=(style.COLUMN, 3.2)))


def orbits() -> Sheet:
    """Fig. 10: an orbit in S1 and five that diverge."""
    shown = portrayed(0.0, SEPARATRIX_FRAME)
    plane, portrait = shown.plane, shown.portrait
    starts = [(alpha / plane.x_unit, rate / plane.y_unit) for _, alpha, rate in ORBIT_STARTS]
    found = [future_of(portrait.flow, portrait.box, start) for start in starts]
    reached = stability_map(
        aircraft(),
        0.0,
        to_si(np.array([alpha for _, alpha, _ in ORBIT_STARTS]), "deg"),
        to_si(np.array([rate for _, _, rate in ORBIT_STARTS]), "deg_s"),
    )
    assert [label >= 0 for label in reached] == [True] + [False] * (len(ORBIT_STARTS) - 1)

    def draw(axes: Canvas) -> None:
        draw_portrait(axes, replace(portrait, separatrices=tuple(b for b in portrait.separatrices if b.stable)), plane)
        draw_region(axes, region_at(0.0))
        looks = [(style.FLOWN, 1.6)] + [(style.INK, 0.9)] * (len(found) - 1)
        for orbit, (color, width) in zip(found, looks, strict=True):
            draw_orbits(axes, [orbit], plane, color=color, linewidth=width, zorder=4)
        for (name, alpha, rate), (across, up) in zip(ORBIT_STARTS, ORBIT_NAMES, strict=True):
            axes.plot([alpha], [rate], color=style.INK, marker=".", linestyle="none", zorder=6)
            draw_notes(axes, [Note(x=alpha + across, y=rate + up, text=name)])

    return draw_sheet("fig-10", [Panel(draw=draw)], Layout(columns=1, panel=(style.COLUMN, 3.2)))


def regimes() -> Sheet:
    """Fig. 11: the stability region for elevators above, between and below the two saddle connections."""
    lower, upper = connection_elevators_deg()
    said = (
        f"$\\delta_e$ > {lower:.2f}°",
        f"{upper:.2f}° < $\\delta_e$ < {lower:.2f}°",
        f"$\\delta_e$ < {upper:.2f}°",
    )

    def panel(values: tuple[float, ...], title: str) -> Panel:
        found = [region_at(value) for value in values]

        def draw(axes: Canvas) -> None:
            draw_regions(axes, found, REGION_FRAME)
            axes.legend(loc="upper right")

        return Panel(draw=draw, title=title.replace("-", "−"))

    panels = [panel(values, title) for values, title in zip(REGIME_DEG, said, strict=True)]
    return draw_sheet("fig-11", panels, Layout(columns=3, panel=(style.PAGE / 3.0, 2.6), same_y=True))


def region_measures() -> Sheet:
    """Not in the paper: area of the stability region and the smallest disturbance that escapes, over the elevator."""
    lower, upper = connection_elevators_deg()
    elevators = _elevators(*(from_si(end, "deg") for end in elevator_range()))
    elevators += [mark + side * NEAREST_DEG for mark in (lower, upper) for side in (-1.0, 1.0)]  # corners
    coarse = [region_at(value) for value in sorted(elevators)]
    # Where the nearest point of the boundary jumps from one side to the other the smallest escape has a corner.
    top = int(np.argmax([region.escape_distance_rad for region in coarse]))
    beside = [from_si(coarse[top + side].elevator_rad, "deg") for side in (-1, 1)]
    fine = [region_at(float(value)) for value in np.linspace(beside[0], beside[1], CORNER_ELEVATORS)[1:-1]]
    regions = sorted([*coarse, *fine], key=lambda region: region.elevator_rad)
    area = np.array([region.area_rad2_s for region in regions]) * from_si(1.0, "deg") * from_si(1.0, "deg_s")
    escape = from_si(np.array([region.escape_distance_rad for region in regions]), "deg")
    marks = (lower, upper)

    def areas(axes: Canvas) -> None:
        draw_over_elevator(axes, regions, area * 1e-3, label=r"area [$10^3$ deg$^2$/s]", marks=marks)
        axes.set_ylim(bottom=0.0)

    def escapes(axes: Canvas) -> None:
        draw_over_elevator(axes, regions, escape, label="smallest escape [deg]", marks=marks)
        axes.set_ylim(bottom=0.0)

    layout = Layout(columns=1, panel=(style.COLUMN, 1.85), same_x=True)
    return draw_sheet("stability-over-elevator", [Panel(draw=areas), Panel(draw=escapes)], layout)

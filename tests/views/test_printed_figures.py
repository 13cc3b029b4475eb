"""What printed figures show: the data themselves, in the right unit, look and place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch

from finback.arrays import FloatArray
from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.diagram.curve import (
    CurveKind,
    Diagram,
    DiagramCurve,
    DiagramOptions,
    DiagramPoint,
    PointKind,
)
from finback.dynamics.equilibrium import Kind, equilibria
from finback.dynamics.family import Family
from finback.dynamics.flow import plain_flow, rests
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.portrait.path import Box, DrawnCycle, Orbit, PathEnd, Portrait, Separatrix
from finback.dynamics.response import ElevatorSchedule, respond
from finback.dynamics.stability.boundary_curve import CurveEnd
from finback.dynamics.stability.map import stability_map
from finback.dynamics.stability.region import BoundaryCycle, StabilityRegion, stability_region
from finback.errors import InputError
from finback.store.model_file import read_model_file
from finback.units import from_si, to_si
from finback.views import style
from finback.views.diagram_figure import (
    COLORS,
    ESTIMATE,
    UNRESOLVED,
    Note,
    Window,
    diagram_legend,
    draw_diagram,
    draw_notes,
    legend_panel,
)
from finback.views.force_figure import draw_force_cuts
from finback.views.moment_figure import MomentCurve, MomentLine, draw_moments
from finback.views.plane import MARKERS, NUMBERS, PITCH, draw_arrow, draw_equilibria, role
from finback.views.portrait_figure import draw_orbits, draw_portrait, portrait_legend
from finback.views.region_figure import Frame, draw_over_elevator, draw_region, draw_regions, outline
from finback.views.response_figure import draw_responses, draw_rest
from finback.views.sheet import Layout, Panel, draw_sheet, save_pixels, save_sheet

PRINTED = 1e-7  # deg: the references were computed from the paper's Eq. (35), printed to ten digits
DEG = from_si(1.0, "deg")
EXAMPLE = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"


@pytest.fixture
def axes() -> Iterator[Axes]:
    with style.printed("test"):
        yield style.new_figure(2.0).add_subplot()


@pytest.fixture(scope="module")
def system() -> LienardSystem:
    found = read_model_file(EXAMPLE).system()
    assert isinstance(found, LienardSystem)
    return found


@pytest.fixture(scope="module")
def region(system: LienardSystem) -> StabilityRegion:
    return stability_region(system, 0.0, alpha_range_rad=(to_si(-100.0, "deg"), to_si(100.0, "deg")))


def lines(axes: Axes, **wanted: Any) -> list[Line2D]:
    """Return the lines with these properties."""
    return [line for line in axes.get_lines() if all(getattr(line, f"get_{k}")() == v for k, v in wanted.items())]


def data(line: Line2D) -> FloatArray:
    return np.asarray(line.get_xydata())


# --- sheets


def _plain(axes: Axes) -> None:
    axes.plot([0.0, 1.0], [0.0, 1.0])


def test_a_sheet_letters_its_panels_only_if_there_are_several() -> None:
    drawn: list[Axes] = []

    def kept(axes: Axes) -> None:
        drawn.append(axes)
        _plain(axes)

    draw_sheet("one", [Panel(draw=kept, title="alone")])
    many = draw_sheet("two", [Panel(draw=kept), Panel(draw=kept, title="right")], Layout(columns=2, panel=(3.0, 2.0)))
    assert [axes.get_title(loc="left") for axes in drawn] == ["alone", "(a)", "(b) right"]
    assert many.name == "two"


def test_shared_axes_are_labeled_once_and_above_what_is_no_picture() -> None:
    kept: list[Axes] = []

    def labeled(axes: Axes) -> None:
        kept.append(axes)
        _plain(axes)
        axes.set_xlabel("x")
        axes.set_ylabel("y")

    panels = [Panel(draw=labeled)] * 3 + [Panel(draw=Axes.set_axis_off, title="")]
    draw_sheet("shared", panels, Layout(columns=2, panel=(2.0, 2.0), same_x=True, same_y=True))
    assert [axes.xaxis.label.get_visible() for axes in kept] == [False, True, True]
    assert [axes.yaxis.label.get_visible() for axes in kept] == [True, False, True]
    assert [axes.get_title(loc="left") for axes in kept] == ["(a)", "(b)", "(c)"]


def test_a_sheet_has_the_size_of_its_panels() -> None:
    sheet = draw_sheet("three", [Panel(draw=_plain)] * 3, Layout(columns=2, panel=(2.0, 1.5)))
    root = ET.fromstring(sheet.svg)  # noqa: S314 - our own picture
    assert (root.get("width"), root.get("height")) == ("288pt", "216pt")
    assert sheet.png.startswith(b"\x89PNG")
    assert int.from_bytes(sheet.png[16:20], "big") == 4 * 220


def test_the_same_sheet_has_the_same_bytes_and_leaves_matplotlib_alone() -> None:
    before = mpl.rcParams.copy()
    first, second = (draw_sheet("same", [Panel(draw=_plain)]) for _ in range(2))
    assert first == second
    assert "<dc:date>" not in first.svg
    assert dict.items(mpl.rcParams) == dict.items(before)


@pytest.mark.parametrize("count", [0, 13])
def test_a_sheet_without_panels_or_letters_is_refused(count: int) -> None:
    with pytest.raises(InputError, match=f"not {count}"):
        draw_sheet("none", [Panel(draw=_plain)] * count)


def test_a_sheet_is_saved_as_it_is(tmp_path: Path) -> None:
    sheet = draw_sheet("saved", [Panel(draw=_plain)])
    assert save_sheet(tmp_path / "new", sheet).read_text(encoding="utf-8") == sheet.svg
    assert save_pixels(tmp_path / "newer", sheet).read_bytes() == sheet.png
    assert [path.name for path in sorted(tmp_path.rglob("*.*"))] == ["saved.svg", "saved.png"]


# --- planes


@pytest.mark.parametrize("kind", Kind)
def test_every_kind_of_equilibrium_has_its_mark(axes: Axes, kind: Kind) -> None:
    draw_equilibria(axes, [kind], np.array([[1.0, 2.0]]))
    (line,) = axes.get_lines()
    assert line.get_marker() == MARKERS[role(kind)]["marker"]
    assert data(line).tolist() == [[1.0, 2.0]]
    is_open = line.get_markerfacecolor() == style.PAPER
    assert is_open == (kind in (Kind.UNSTABLE_FOCUS, Kind.UNSTABLE_NODE))
    assert (line.get_marker() == "x") == (kind is Kind.SADDLE)


def test_an_arrow_points_the_way_of_time(axes: Axes) -> None:
    axes.set_xlim(0.0, 4.0)
    axes.set_ylim(0.0, 1.0)
    piece = np.column_stack([np.linspace(0.5, 3.5, 7), np.full(7, 0.5)])
    draw_arrow(axes, piece, forward=True, color=style.INK)
    draw_arrow(axes, piece, forward=False, color=style.INK)
    ahead, back = (note.xy[0] - note.xyann[0] for note in axes.texts)  # type: ignore[attr-defined]
    assert ahead == pytest.approx(-back)
    assert ahead > 0.0
    assert axes.texts[0].xy[0] == pytest.approx(2.0, abs=0.02)  # type: ignore[attr-defined]


def test_a_short_piece_has_no_arrow(axes: Axes) -> None:
    draw_arrow(axes, np.array([[0.5, 0.5], [0.51, 0.5]]), forward=True, color=style.INK)
    assert not axes.texts


# --- portraits


def _orbit(points: list[list[float]], *, forward: bool) -> Orbit:
    return Orbit(
        start=np.array(points[0]), forward=forward, pieces=(np.array(points),), end=PathEnd.BOX, to_x=float("nan")
    )


@pytest.fixture(scope="module")
def portrait() -> Portrait:
    """Return van der Pol's oscillator with made-up orbits and branches, which drawing does not question."""
    flow = plain_flow((1.0, 0.0, -1.0), (0.0, -1.0))
    (cycle,) = flow_cycles(flow).cycles
    ring = np.array([[cycle.x_max, 0.0], [0.0, -2.0], [cycle.x_min, 0.0], [0.0, 2.0], [cycle.x_max, 0.0]])
    orbit = _orbit([[0.1, 0.0], [1.0, -1.0], [-1.5, 0.5]], forward=True)
    branches = tuple(
        Separatrix(
            saddle_x=0.0,
            side=1,
            stable=stable,
            orbit=_orbit([[0.0, 0.0], [2.0, 1.0 if stable else -1.0]], forward=not stable),
        )
        for stable in (True, False)
    )
    return Portrait(
        flow=flow,
        box=Box(x_low=-3.0, x_high=3.0, y_low=-4.0, y_high=4.0),
        equilibria=rests(flow),
        separatrices=branches,
        cycles=(DrawnCycle(cycle=cycle, pieces=(ring,)),),
        orbits=(orbit, orbit),
        nullclines=(),
        notes=(),
    )


def test_a_portrait_shows_its_box_and_everything_in_it(axes: Axes, portrait: Portrait) -> None:
    draw_portrait(axes, portrait)
    assert axes.get_xlim() == (-3.0, 3.0)
    assert axes.get_ylim() == (-4.0, 4.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$x$", "$y$")
    (stable,) = lines(axes, label="stable manifold")
    (unstable,) = lines(axes, label="unstable manifold")
    assert data(stable).tolist() == portrait.separatrices[0].orbit.pieces[0].tolist()
    assert data(unstable).tolist() == portrait.separatrices[1].orbit.pieces[0].tolist()
    assert stable.get_linestyle() == "-"
    assert unstable.get_linestyle() == "--"
    (cycle,) = lines(axes, label="stable cycle")
    assert data(cycle).tolist() == portrait.cycles[0].pieces[0].tolist()
    (source,) = lines(axes, label="source")
    assert data(source).tolist() == [[0.0, 0.0]]
    assert len(lines(axes, color=style.MUTED)) == len(portrait.orbits)
    assert len(lines(axes, label="orbit")) == 1, "a legend names each thing once"


def test_a_portrait_in_units_is_scaled(axes: Axes, portrait: Portrait) -> None:
    draw_portrait(axes, portrait, PITCH, orbits=False)
    assert axes.get_xlim() == pytest.approx((-3.0 * DEG, 3.0 * DEG))
    assert axes.get_xlabel() == r"$\alpha$ [deg]"
    assert axes.get_ylabel() == r"$\dot\alpha$ [deg/s]"
    (cycle,) = lines(axes, label="stable cycle")
    assert data(cycle) == pytest.approx(portrait.cycles[0].pieces[0] * DEG)
    assert not lines(axes, label="orbit")


def test_equilibria_outside_the_box_are_not_drawn(axes: Axes) -> None:
    flow = plain_flow((-1.0,), (0.0, -1.0, 0.0, 1.0))
    empty = Portrait(
        flow=flow,
        box=Box(x_low=-0.5, x_high=2.0, y_low=-1.0, y_high=1.0),
        equilibria=rests(flow),
        separatrices=(),
        cycles=(),
        orbits=(),
        nullclines=(),
        notes=(),
    )
    draw_portrait(axes, empty)
    (saddles,) = lines(axes, label="saddle")
    assert data(saddles) == pytest.approx(np.array([[1.0, 0.0]]))


def test_orbits_can_be_drawn_in_another_look(axes: Axes, portrait: Portrait) -> None:
    draw_orbits(axes, portrait.orbits[:1], NUMBERS, name="s1", color=style.SIMULATED, linewidth=2.0)
    (line,) = axes.get_lines()
    assert (line.get_label(), line.get_color(), line.get_linewidth()) == ("s1", style.SIMULATED, 2.0)


# --- diagrams


def _curve(
    kind: CurveKind, lam: list[float], *, exact: bool = True, resolved: list[bool] | None = None
) -> DiagramCurve:
    count = len(lam)
    return DiagramCurve(
        kind=kind,
        name=f"{kind} {exact}",
        cell=0,
        exact=exact,
        mu=np.linspace(-1.0, 0.0, count),
        lam=np.array(lam),
        x=np.zeros(count),
        residual=np.zeros(count),
        resolved=np.array(resolved or [True] * count),
        enclosed=(),
        change=np.zeros((count, 2)),
        ends=("range", "range"),
    )


@pytest.fixture(scope="module")
def diagram() -> Diagram:
    def point(kind: PointKind, mu: float) -> DiagramPoint:
        return DiagramPoint(
            kind=kind,
            name=f"{kind}",
            exact=True,
            mu=mu,
            lam=0.1,
            x=0.0,
            bracket=np.array([mu, mu]),
            residual=0.0,
            resolved=True,
            curves=(),
        )

    return Diagram(
        family=Family(damping=(0.0, 0.5, -1.0), force=(0.0, 0.0, 0.5, 1.0), direction=(0.0, 1.0)),
        mu_range=np.array([-1.0, 0.0]),
        lam_range=np.array([-1.0, 1.0]),
        cells=(),
        curves=(
            _curve(CurveKind.HOPF, [0.0, 0.0]),
            _curve(CurveKind.HOMOCLINIC, [0.3, 0.2, 0.1, 0.0, -0.1], resolved=[True, True, False, False, False]),
            _curve(CurveKind.HOMOCLINIC, [0.4, 0.3, 0.0], exact=False),
            _curve(CurveKind.HETEROCLINIC, [0.7, 0.7]),
        ),
        points=(point(PointKind.BAUTIN, -0.5), point(PointKind.BOGDANOV_TAKENS, 0.5)),
        notes=(),
        options=DiagramOptions(),
    )


WINDOW = Window(x=(-1.0, 0.1), y=(-0.5, 0.5), kinds=(CurveKind.HOPF, CurveKind.HOMOCLINIC))


def test_exact_curves_are_solid_estimates_dashed_and_the_rest_dotted(axes: Axes, diagram: Diagram) -> None:
    draw_diagram(axes, diagram, WINDOW)
    solid, dotted, dashed = (lines(axes, label="homoclinic", linestyle=look) for look in ("-", ":", "--"))
    assert [len(found) for found in (solid, dotted, dashed)] == [1, 1, 1]
    exact, estimate = diagram.curves[1], diagram.curves[2]
    points = np.column_stack([exact.mu, exact.lam])
    assert data(solid[0]) == pytest.approx(points[:3]), "stretches of one look share a point, so that none is missing"
    assert data(dotted[0]) == pytest.approx(points[2:])
    assert data(dashed[0]) == pytest.approx(np.column_stack([estimate.mu, estimate.lam]))
    assert {line.get_color() for line in (*solid, *dotted, *dashed)} == {COLORS[CurveKind.HOMOCLINIC]}


def test_a_window_chooses_what_is_shown(axes: Axes, diagram: Diagram) -> None:
    draw_diagram(axes, diagram, WINDOW)
    assert axes.get_xlim() == WINDOW.x
    assert axes.get_ylim() == WINDOW.y
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$b_0$", "$a_0$")
    assert not lines(axes, label="heteroclinic")
    (point,) = lines(axes, label="Bautin")
    assert data(point).tolist() == [[-0.5, 0.1]]
    assert not lines(axes, label="Bogdanov–Takens"), "it lies outside the window"


def test_the_legend_of_a_diagram_explains_the_lines_that_are_there(axes: Axes, diagram: Diagram) -> None:
    draw_diagram(axes, diagram, WINDOW)
    diagram_legend(axes)
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["Hopf", "homoclinic", "Bautin", ESTIMATE, UNRESOLVED]


def test_a_legend_says_nothing_of_lines_that_are_not_there(axes: Axes, diagram: Diagram) -> None:
    draw_diagram(axes, diagram, Window(x=(-1.0, -0.6), y=(-1.0, 1.0), kinds=(CurveKind.HOPF,)))
    diagram_legend(axes)
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["Hopf"]


def test_a_line_of_equilibria_that_meet_crosses_the_whole_picture(axes: Axes, diagram: Diagram) -> None:
    line = replace(diagram.curves[0], kind=CurveKind.FOLD, mu=np.array([-0.7, -0.7]), lam=np.array([0.0, 0.1]))
    draw_diagram(axes, replace(diagram, curves=(line,)), Window(x=(-1.0, 0.0), y=(-9.0, 9.0)))
    (drawn,) = lines(axes, label="saddle-node")
    assert data(drawn)[:, 0].tolist() == [-0.7, -0.7]
    assert drawn.get_window_extent().height == pytest.approx(axes.bbox.height)


def test_a_crossing_is_shown_only_with_both_its_curves(axes: Axes, diagram: Diagram) -> None:
    names = tuple(curve.name for curve in (diagram.curves[0], diagram.curves[3]))
    crossing = replace(diagram.points[0], kind=PointKind.CROSSING, curves=names)
    changed = replace(diagram, points=(crossing,))
    draw_diagram(axes, changed, WINDOW)
    assert not lines(axes, label="crossing"), "the heteroclinic curve is not shown"
    draw_diagram(axes, changed, replace(WINDOW, kinds=tuple(CurveKind)))
    assert lines(axes, label="crossing")


def test_a_legend_instead_of_a_picture(axes: Axes) -> None:
    legend_panel(axes, (CurveKind.HOPF, CurveKind.FOLD), (PointKind.BAUTIN,))
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["Hopf", "saddle-node", "Bautin", ESTIMATE]
    assert not axes.axison


def test_a_legend_of_portraits_looks_like_what_it_names(axes: Axes, portrait: Portrait) -> None:
    portrait_legend(axes)
    legend = axes.get_legend()
    assert legend is not None
    named = dict(zip((text.get_text() for text in legend.get_texts()), legend.get_lines(), strict=True))
    with style.printed("other"):
        drawn = style.new_figure(2.0).add_subplot()
        draw_portrait(drawn, portrait)
    for line in drawn.get_lines():
        if not str(line.get_label()).startswith("_"):
            shown = named[str(line.get_label())]
            assert (shown.get_color(), shown.get_linestyle(), shown.get_marker()) == (
                line.get_color(),
                line.get_linestyle(),
                line.get_marker(),
            )


def test_notes_stand_where_they_are_put(axes: Axes) -> None:
    draw_notes(axes, [Note(x=0.2, y=0.3, text="I"), Note(x=0.4, y=0.5, text="II", target=(0.6, 0.7))])
    plain, led = axes.texts
    assert plain.get_position() == (0.2, 0.3)
    assert plain.arrow_patch is None  # type: ignore[attr-defined]
    assert led.get_position() == (0.4, 0.5)
    assert led.xy == (0.6, 0.7)  # type: ignore[attr-defined]
    assert led.arrow_patch is not None  # type: ignore[attr-defined]


# --- moments


def test_the_moment_curve_its_lines_and_cuts(axes: Axes) -> None:
    P = np.linspace(0.0, 0.5, 6)
    curve = MomentCurve(level=P, P=P, Q=P - P**2)
    tangent = MomentLine(intercept=0.0, slope=1.0, text="$L_0$", tangent=True, text_at=0.4)
    line = MomentLine(intercept=0.06, slope=0.5, text="$L$", tangent=False, text_at=0.3)
    cuts = np.array([[0.2, 0.16], [0.3, 0.21]])
    draw_moments(axes, curve, [tangent, line], cuts=cuts, limits=np.array([[-0.1, 0.6], [-0.1, 0.5]]))
    (shown,) = lines(axes, label="curve $R$")
    assert data(shown) == pytest.approx(np.column_stack([curve.P, curve.Q]))
    straight = [data(one) for one in axes.get_lines() if len(data(one)) == 2 and one.get_marker() == "None"]
    assert straight[0] == pytest.approx(np.array([[-0.1, -0.1], [0.6, 0.6]]))
    assert straight[1] == pytest.approx(np.array([[-0.1, 0.01], [0.6, 0.36]]))
    (marks,) = lines(axes, color=style.SIMULATED, marker="o")
    assert data(marks) == pytest.approx(cuts)
    assert [(text.get_text(), text.get_position()) for text in axes.texts] == [
        ("$L_0$", (0.4, 0.4)),
        ("$L$", (0.3, pytest.approx(0.21))),
    ]


# --- forces


def test_equilibria_lie_on_the_force_and_on_their_line(axes: Axes, system: LienardSystem) -> None:
    elevators = [to_si(value, "deg") for value in (5.0, -25.0)]
    cuts = [(elevator, equilibria(system, elevator)) for elevator in elevators]
    span = (to_si(-32.0, "deg"), to_si(46.0, "deg"))
    draw_force_cuts(axes, system, cuts, folds(system), alpha_range_rad=span)
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"$\alpha$ [deg]", "$y$ [deg/s$^2$]")
    assert axes.get_xlim() == pytest.approx((-32.0, 46.0))
    (force,) = lines(axes, label="$y = g_0(\\alpha)$")
    x, y = data(force).T
    # Shi & Fan 2013, Eq. 37, as printed, in deg and s
    assert y == pytest.approx(2.038986943 - 8.243739010 * x - 0.1379647003 * x**2 + 0.008192987992 * x**3, abs=1e-5)
    marks = np.concatenate([data(line) for line in axes.get_lines() if line.get_marker() in ("o", "x")])
    assert len(marks) == 6
    assert np.interp(marks[:, 0], x, y) == pytest.approx(marks[:, 1], abs=0.05)
    assert sorted(set(np.round(marks[:, 1], 4))) == [round(4.619857062 * d, 4) for d in (-25.0, 5.0)]
    turns = sorted(tuple(data(line)[0]) for line in axes.get_lines() if line.get_marker() == "D")
    assert turns[0] == pytest.approx((-13.5416505800, 68.0283902633), abs=PRINTED)
    assert turns[1] == pytest.approx((24.7678926978, -162.2924550930), abs=PRINTED)


# --- stability regions


def test_the_border_of_a_region_separates_what_the_map_separates(
    system: LienardSystem, region: StabilityRegion
) -> None:
    (ring,) = outline(region)
    assert ring[0].tolist() == ring[-1].tolist()
    path = mpl.path.Path(ring * DEG)
    alpha, rate = np.meshgrid(np.linspace(-40.0, 40.0, 33), np.linspace(-150.0, 150.0, 33))
    labels = stability_map(system, region.elevator_rad, to_si(alpha, "deg"), to_si(rate, "deg_s"))
    inside = path.contains_points(np.column_stack([alpha.ravel(), rate.ravel()])).reshape(alpha.shape)
    assert (inside == (labels == 0)).mean() == 1.0
    assert 0.2 < inside.mean() < 0.8, "otherwise this would show nothing"


def test_a_hole_runs_against_the_border(region: StabilityRegion) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    hole = _cycle(0.05 * np.cos(angle), 0.05 * np.sin(angle), around=False)
    rings = outline(_with_cycles(region, hole))
    assert len(rings) == 2
    assert _area(rings[0]) > 0.0 > _area(rings[1])


def test_a_region_within_a_cycle_is_bounded_by_it(region: StabilityRegion) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    border = _cycle(0.1 * np.cos(angle), -0.2 * np.sin(angle), around=True)
    (ring,) = outline(replace(_with_cycles(region, border), boundary=()))
    assert _area(ring) == pytest.approx(np.pi * 0.02, rel=5e-3)


def test_the_whole_plane_is_shaded_where_nothing_bounds_a_region(axes: Axes, region: StabilityRegion) -> None:
    draw_region(axes, replace(region, boundary=()), name="region")
    (patch,) = axes.patches
    assert patch.get_label() == "region"
    assert patch.get_extents().height >= axes.bbox.height


def test_a_region_whose_border_winds_without_end_is_not_shaded(axes: Axes, region: StabilityRegion) -> None:
    winding = tuple(replace(branch, ending=CurveEnd.SOURCE) for branch in region.boundary)
    draw_region(axes, replace(region, boundary=winding))
    assert not axes.patches


def test_regions_are_drawn_with_their_sinks_and_saddles(axes: Axes, region: StabilityRegion) -> None:
    frame = Frame(alpha_deg=(-60.0, 60.0), alpha_dot_deg_s=(-180.0, 180.0))
    draw_regions(axes, [region], frame)
    assert axes.get_xlim() == frame.alpha_deg
    assert axes.get_ylim() == frame.alpha_dot_deg_s
    assert axes.get_ylabel() == r"$\dot\alpha$ [deg/s]"
    curves = [line for line in axes.get_lines() if len(data(line)) > 2]
    for line, branch in zip(curves, region.boundary, strict=True):
        assert data(line) == pytest.approx(np.column_stack([branch.alpha_rad, branch.alpha_dot_rad_s]) * DEG)
    assert [line.get_label() for line in curves].count("$\\delta_e$ = 0°") == 1
    (saddles,) = lines(axes, marker="x")
    assert data(saddles)[0] == pytest.approx((-24.5533582793, 0.0), abs=PRINTED)
    (sink,) = lines(axes, marker="o")
    assert data(sink)[0] == pytest.approx((0.2463369416, 0.0), abs=PRINTED)
    assert any(isinstance(patch, PathPatch) for patch in axes.patches)


def test_a_quantity_over_the_elevator(axes: Axes, region: StabilityRegion) -> None:
    draw_over_elevator(axes, [region], np.array([7.0]), label="area [deg²/s]", marks=(-2.0, 3.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"$\delta_e$ [deg]", "area [deg²/s]")
    values, *marks = axes.get_lines()
    assert data(values).tolist() == [[0.0, 7.0]]
    assert [data(mark)[0, 0] for mark in marks] == [-2.0, 3.0]


# --- time histories


def test_histories_show_each_quantity_in_its_unit(axes: Axes, system: LienardSystem) -> None:
    times = np.array([0.0, 1.0, 2.0])
    start = {"alpha_rad": to_si(10.0, "deg"), "alpha_dot_rad_s": 0.0}
    response = respond(system, ElevatorSchedule.held(0.0), time_s=times, **start)
    draw_responses(axes, [("held", response), ("again", response)], "alpha_dot_rad_s")
    first, second = axes.get_lines()
    assert data(first) == pytest.approx(
        np.column_stack([times, [0.0, -5.055375146, 6.086562887]]), abs=PRINTED
    )  # independent reference: Taylor series in 130 bits
    assert (first.get_label(), second.get_label()) == ("held", "again")
    assert first.get_color() != second.get_color()
    assert first.get_linestyle() != second.get_linestyle()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$t$ [s]", r"$\dot\alpha$ [deg/s]")
    assert axes.get_xlim() == (0.0, 2.0)
    draw_rest(axes, [1.5])
    assert data(axes.get_lines()[-1])[:, 1].tolist() == [1.5, 1.5]


def _cycle(alpha: FloatArray, rate: FloatArray, *, around: bool) -> BoundaryCycle:
    return BoundaryCycle(
        alpha_min_rad=float(alpha.min()),
        alpha_max_rad=float(alpha.max()),
        period_s=1.0,
        around=around,
        alpha_rad=alpha,
        alpha_dot_rad_s=rate,
        q_rad_s=rate,
        half_width_rad=np.zeros(alpha.size),
    )


def _with_cycles(region: StabilityRegion, *cycles: BoundaryCycle) -> StabilityRegion:
    return replace(region, cycles=cycles)


def _area(ring: FloatArray) -> float:
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_texts_are_outlines_so_that_symbols_look_the_same_everywhere() -> None:
    def labeled(axes: Axes) -> None:
        axes.set_xlabel(r"$\tilde b_1$")

    svg = draw_sheet("text", [Panel(draw=labeled)]).svg
    assert "<text" not in svg
    assert re.search(r'id="STIX', svg)

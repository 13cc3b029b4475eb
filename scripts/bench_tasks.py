"""The tasks of the benchmarks: Finback's side, its rival's, and what both are judged by."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import bench_reference as reference
import numpy as np
from bench_task import Score, Side, Task
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.branch import branch
from finback.dynamics.connection.loop import Loop, LoopKind, loops, loops_along
from finback.dynamics.connection.search import Connections, connections
from finback.dynamics.cycle.branch import CycleBranch, cycle_branches
from finback.dynamics.diagram.curve import CurveKind, Diagram, PointKind
from finback.dynamics.diagram.diagram import diagram
from finback.dynamics.equilibrium import Kind
from finback.dynamics.family import Family
from finback.dynamics.flow import flow_at, natural_scale, rests
from finback.dynamics.fold import Fold, folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.normal_form.bogdanov_takens import Unfolding
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.reduction import reduce
from finback.dynamics.stability.map import ESCAPES, stability_map
from finback.store import read_model_file
from finback.units import from_si, to_si

if TYPE_CHECKING:
    from types import ModuleType

NAME: Final = "Finback"
CUBIC: Final = Cubic(a1=0.5, a0=0.0, b1=0.5, b0=reference.CYCLE_B0).family()
UNFOLDING: Final = Unfolding(mu1=-0.02, mu2=0.1).family()
ELEVATOR_DEG: Final = (-60.0, 40.0)
PERIOD: Final = 67.6
DIAGRAM_B0: Final = (-2.0, -0.01)
AUTO_FOLD_B0: Final = (-0.45, -0.2511)  # as far as AUTO follows the folds of cycles
MAP_CELLS: Final = 1000
MAP_SAMPLE: Final = 400
MAP_ALPHA_DEG: Final = (-45.0, 55.0)
MAP_RATE_DEG_S: Final = (-200.0, 200.0)
MAP_TIME_S: Final = 60.0


def aircraft() -> LienardSystem:
    """Return the F-8 II as published."""
    return reduce(read_model_file(reference.ROOT / "aircraft" / "f8ii" / "published.toml").model())


def radians(ends: Sequence[float]) -> tuple[float, float]:
    """Convert a range from deg."""
    return to_si(ends[0], "deg"), to_si(ends[1], "deg")


def worst(found: Sequence[float], wanted: Sequence[float]) -> float:
    """Return the largest difference; infinite if something is missing or too much."""
    if len(found) != len(wanted):
        return math.inf
    return max(abs(a - b) for a, b in zip(sorted(found), sorted(wanted), strict=True))


def loop_score(wanted: Sequence[float], found: tuple[tuple[Loop, ...], ...]) -> Score:
    """Compare the homoclinic ones with the reference, in order."""
    lams = [[loop.lam for loop in row if loop.kind is LoopKind.HOMOCLINIC] for row in found]
    error = max(worst(row, [lam]) for row, lam in zip(lams, wanted, strict=True))
    others = sum(map(len, found)) - len(found)
    return Score(points=len(found), error=error, remark=f"and {others} heteroclinic points" if others else "")


def auto() -> ModuleType:
    """Import AUTO's side, which needs the extra `bench`."""
    import bench_auto  # noqa: PLC0415 - the other side runs without it

    return bench_auto


def equilibria_task() -> Task:
    """Return the curve of equilibria with its folds."""
    system = aircraft()
    alphas = np.linspace(*radians((-60.0, 60.0)), 1601)

    def run() -> tuple[Any, tuple[Fold, ...]]:
        return branch(system, alphas), folds(system)

    def score(found: tuple[Any, tuple[Fold, ...]]) -> Score:
        places = [from_si(fold.elevator_rad, "deg") for fold in found[1]]
        return Score(points=found[0].alpha_rad.size, error=worst(places, reference.FOLD_DEG))

    def rival() -> Side:
        other = auto()
        kind = other.auto.PointType.FOLD

        def judge(results: Sequence[Any]) -> Score:
            every = [point for result in results for point in other.points(result)]
            places = [point.all_parameters[0] for point in every if point.point_type is kind]
            return Score(points=len(every), error=worst(places, reference.FOLD_DEG))

        side: Side = other.side(partial(other.branch, 0.37, ELEVATOR_DEG), judge)
        return side

    return Task(
        name="equilibria",
        what="F-8 II: equilibria from -60 to 40 deg of elevator, both folds",
        unit="deg",
        bar_ms=math.inf,
        finback=Side(name=NAME, run=run, score=score),
        rivals=(rival,),
    )


def cycle_task() -> Task:
    """Return the family of cycles from its Hopf point."""

    def score(found: tuple[CycleBranch, ...]) -> Score:
        (one,) = found
        ends = f"begins at a0 = {one.begin_lam:.1g}, longest period {one.period.max():.1f}"
        error = worst([fold.lam for fold in one.folds], [reference.CYCLE_FOLD_A0])
        return Score(points=one.lam.size, error=error, remark=ends)

    def rival() -> Side:
        other = auto()

        def judge(results: Sequence[Any]) -> Score:
            family = other.points(results[1])
            place = other.special(results[1], other.auto.PointType.FOLD).all_parameters[0]
            return Score(points=len(family), error=abs(place - reference.CYCLE_FOLD_A0))

        side: Side = other.side(partial(other.cycles, reference.CYCLE_B0, PERIOD), judge)
        return side

    return Task(
        name="cycles",
        what=f"cubic, b0 = -0.35: Hopf point, cycles to period {PERIOD}, their fold",
        unit="a0",
        bar_ms=100.0,
        finback=Side(name=NAME, run=partial(cycle_branches, CUBIC, reference.CYCLE_B0), score=score),
        rivals=(rival,),
    )


def homoclinic_task() -> Task:
    """Return ten points of a homoclinic curve."""

    def rival() -> Side:
        other = auto()
        begin = reference.CUBIC_B0[0], reference.CUBIC_LOOP_A0[0]
        chain = partial(other.cubic_homoclinic, *begin, nmx=11, ds=-0.2, dsmax=0.5)
        side: Side = other.side(lambda: [chain()], partial(curve_score, other, CUBIC, (1, 0)))
        return side

    return Task(
        name="homoclinic",
        what="cubic: 10 points of the homoclinic curve, b0 from -0.5 to -2",
        unit="a0",
        bar_ms=50.0,
        finback=Side(
            name=NAME,
            run=partial(loops_along, CUBIC, reference.CUBIC_B0),
            score=partial(loop_score, reference.CUBIC_LOOP_A0),
        ),
        rivals=(rival,),
    )


def unfolding_task() -> Task:
    """Return ten points of the homoclinic curve of Bogdanov and Takens."""

    def rival() -> Side:
        other = auto()
        begin = reference.UNFOLDING_MU1[0], reference.UNFOLDING_LOOP_MU2[0]
        chain = partial(other.unfolding_homoclinic, *begin, nmx=11, ds=-0.05, dsmax=0.1)
        side: Side = other.side(lambda: [chain()], partial(curve_score, other, UNFOLDING, (0, 1)))
        return side

    return Task(
        name="bogdanov-takens",
        what="unfolding: 10 points of the homoclinic curve, mu1 from -0.02 to -0.46",
        unit="mu2",
        bar_ms=math.inf,
        finback=Side(
            name=NAME,
            run=partial(loops_along, UNFOLDING, reference.UNFOLDING_MU1),
            score=partial(loop_score, reference.UNFOLDING_LOOP_MU2),
        ),
        rivals=(rival,),
    )


def curve_score(other: ModuleType, family: Family, order: tuple[int, int], results: Sequence[Any]) -> Score:
    """Compare the last point of AUTO's curve with Finback's loop there, which the references vouch for."""
    every = other.points(results[0])
    mu, lam = (every[-1].all_parameters[k] for k in order)
    exact = [loop.lam for loop in loops(family, mu) if loop.kind is LoopKind.HOMOCLINIC]
    return Score(points=len(every) - 1, error=worst([lam], exact), remark="begun from a given orbit")


def heteroclinic_task() -> Task:
    """Return the connections of the F-8 II."""
    system = aircraft()

    def score(found: Connections) -> Score:
        places = [from_si(one.elevator_rad, "deg") for one in found.heteroclinics]
        error = math.inf if found.homoclinics else worst(places, reference.CONNECTION_DEG)
        return Score(points=len(places), error=error, remark="with intervals, and that there are no others")

    def rival() -> Side:
        other = auto()

        def judge(results: Sequence[Any]) -> Score:
            places = [other.points(result)[-1].all_parameters[0] for result in results]
            return Score(
                points=2, error=worst(places, reference.CONNECTION_DEG), remark="begun from given rough orbits"
            )

        # 0.1 deg beside the upper one, and where the paper puts the lower one.
        side: Side = other.side(lambda: [other.heteroclinic(-18.2, 1), other.heteroclinic(-2.16458, -1)], judge)
        return side

    return Task(
        name="heteroclinic",
        what="F-8 II: both heteroclinic connections",
        unit="deg",
        bar_ms=20.0,  # 10 for one
        finback=Side(name=NAME, run=partial(connections, system, radians(ELEVATOR_DEG)), score=score),
        rivals=(rival,),
    )


def edge_score(found: Diagram, wanted: Sequence[float], points: Sequence[tuple[float, float]] = ()) -> Score:
    """Compare the loops and folds of cycles at the right edge of a diagram, and its neutral loop, with references."""
    edge = found.mu_range.item(1)
    kinds = (CurveKind.HOMOCLINIC, CurveKind.CYCLE_FOLD)
    every = [curve for curve in found.curves if curve.exact and curve.kind in kinds and curve.mu[-1] == edge]
    near = [
        min(every, key=lambda curve: abs(curve.lam.item(-1) - a0)).lam.item(-1) if every else math.inf for a0 in wanted
    ]
    errors = [abs(a - b) for a, b in zip(near, wanted, strict=True)]
    neutral = found.points_of_kind(PointKind.NEUTRAL_LOOP)
    for b0, a0 in points:
        errors.append(min((max(abs(p.mu - b0), abs(p.lam - a0)) for p in neutral), default=math.inf))
    many = f"{sum(curve.exact for curve in found.curves)} curves, {len(found.points)} special points"
    notes = f", {len(found.notes)} notes of what was not resolved" if found.notes else ""
    return Score(points=sum(one.mu.size for one in found.curves if one.exact), error=max(errors), remark=many + notes)


def diagram_task() -> Task:
    """Return the whole plane of parameters."""

    def score(found: Diagram) -> Score:
        # Seen from the left: the references stand at the edge b0 = -2.
        mirrored = [curve.lam.item(0) for curve in found.of_kind(CurveKind.HOMOCLINIC) if curve.mu[0] == DIAGRAM_B0[0]]
        plain = edge_score(found, (), (reference.NEUTRAL_LOOP,))
        return replace(plain, error=max(plain.error, worst(mirrored, reference.CUBIC_LOOP_A0[-1:])))

    def rival() -> Side:
        other = auto()

        def chain() -> list[Any]:
            equilibria, family = other.cycles(reference.CYCLE_B0, PERIOD)
            curve = partial(
                other.cubic_homoclinic, reference.CUBIC_B0[0], reference.CUBIC_LOOP_A0[0], dsmax=0.5, nmx=60
            )
            return [
                *(curve(ds=-0.2, rl0=DIAGRAM_B0[0]), curve(ds=0.2, rl1=-0.05)),
                *(equilibria, family, *other.hopf_curve(equilibria, DIAGRAM_B0)),
                *other.cycle_folds(family, AUTO_FOLD_B0),
            ]

        def judge(results: Sequence[Any]) -> Score:
            error = curve_score(other, CUBIC, (1, 0), results[:1]).error
            many = sum(len(other.points(result)) for result in results)
            return Score(points=many, error=error, remark="Hopf, homoclinic, folds of cycles in part; no heteroclinics")

        side: Side = other.side(chain, judge)
        return side

    return Task(
        name="diagram",
        what="cubic (0.5, 0.5): two-parameter diagram, b0 from -2 to -0.01",
        unit="a0",
        bar_ms=1000.0,
        finback=Side(name=NAME, run=partial(diagram, CUBIC, DIAGRAM_B0), score=score),
        rivals=(rival,),
    )


def wells_task(name: str, which: int, low: float, wanted: Sequence[float]) -> Task:
    """Return a plane with two wells, which AUTO has no start for."""
    a1, b1, high = reference.WELLS[which]
    family = Cubic(a1=a1, a0=0.0, b1=b1, b0=high, b2=-1.0).family()
    return Task(
        name=name,
        what=f"two wells ({a1}, {b1}), b2 = -1: two-parameter diagram, b0 from {low} to {high}",
        unit="a0",
        bar_ms=1000.0,
        finback=Side(
            name=NAME, run=partial(diagram, family, (low, high)), score=lambda found: edge_score(found, wanted)
        ),
    )


def map_task() -> Task:
    """Return the grid of states and where each ends."""
    system = aircraft()
    axes = (np.linspace(*radians(ends), MAP_CELLS) for ends in (MAP_ALPHA_DEG, MAP_RATE_DEG_S))
    alpha, rate = np.meshgrid(*axes)
    chosen = np.random.default_rng(1).choice(alpha.size, MAP_SAMPLE, replace=False)
    xs, ys = alpha.ravel()[chosen], rate.ravel()[chosen]
    slow = integrated(system)

    def score(found: FloatArray) -> Score:
        differ = float((found.ravel()[chosen] != np.array([slow(x, y) for x, y in zip(xs, ys, strict=True)])).mean())
        return Score(points=found.size, error=differ, remark=f"compared with scipy at {MAP_SAMPLE} states")

    def rival() -> Side:
        return Side(
            name="scipy DOP853",
            run=lambda: np.array([slow(x, y) for x, y in zip(xs, ys, strict=True)]),
            score=lambda found: Score(points=found.size, error=0.0, remark="the reference; time for all by proportion"),
            share=MAP_SAMPLE / alpha.size,
        )

    return Task(
        name="map",
        what=f"F-8 II, elevator 0: where {MAP_CELLS} x {MAP_CELLS} states end",
        unit="share",
        bar_ms=1500.0,
        finback=Side(name=NAME, run=lambda: stability_map(system, 0.0, alpha, rate), score=score),
        rivals=(rival,),
    )


def integrated(system: LienardSystem) -> Callable[[float, float], int]:
    """Return the same answer by plain integration: away beyond the saddles, or near a sink after a minute."""
    scale, _ = natural_scale(system, 0.0)
    points = rests(flow_at(system, 0.0, scale))
    places = [(point.x * scale.length_rad, point.kind) for point in points]
    sinks = [x for x, kind in places if kind is not Kind.SADDLE]
    edge = 2.0 * max(abs(x) for x, _ in places)
    f, g = system.damping.ascending[::-1].tolist(), system.force.ascending[::-1].tolist()

    def field(_: float, u: FloatArray) -> tuple[float, float]:
        x, y = float(u[0]), float(u[1])
        return y, horner(f, x) * y + horner(g, x)

    def away(_: float, u: FloatArray) -> float:
        return edge - abs(float(u[0]))

    away.terminal = True  # type: ignore[attr-defined]  # scipy asks for it

    def ends(x: float, y: float) -> int:
        if abs(x) >= edge:
            return ESCAPES
        found = solve_ivp(field, (0.0, MAP_TIME_S), (x, y), method="DOP853", rtol=1e-9, atol=1e-10, events=away)
        if found.status == 1:
            return ESCAPES
        return min(range(len(sinks)), key=lambda k: abs(sinks[k] - float(found.y[0, -1])))

    return ends


def horner(row: Sequence[float], x: float) -> float:
    """Evaluate a polynomial by falling power."""
    total = 0.0
    for c in row:
        total = total * x + c
    return total


TASKS: Final[dict[str, Callable[[], Task]]] = {
    "equilibria": equilibria_task,
    "cycles": cycle_task,
    "homoclinic": homoclinic_task,
    "heteroclinic": heteroclinic_task,
    "bogdanov-takens": unfolding_task,
    "diagram": diagram_task,
    "wells": partial(wells_task, "wells", 0, -0.1, (*reference.WELLS_LOOP_A0[0].values(), reference.WELLS_FOLD_A0)),
    "damped-wells": partial(wells_task, "damped-wells", 1, -2.85, (*reference.WELLS_LOOP_A0[1].values(),)),
    "map": map_task,
}

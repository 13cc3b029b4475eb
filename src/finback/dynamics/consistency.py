"""One checker for diagrams, flows and located objects: what must hold for each whatever made it.

It shares nothing with the way a diagram is made but the counting of equilibria and cycles at single places: each place
is counted for itself, and what differs between two places must be what the curves between them say.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, pairwise
from typing import Final

import numpy as np

from finback.dynamics.cycle.flow_cycle import FlowCycle, flow_cycles
from finback.dynamics.diagram.count import Counts, counted
from finback.dynamics.diagram.crossing import Tally, hopf_of, met_at, said_along, said_between, unsaid, vertical_places
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramCurve, DiagramPoint
from finback.dynamics.equilibrium import eigenvalues
from finback.dynamics.flow import Flow, Rest, derivative, horner, rests
from finback.dynamics.located import Located
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_WIDE: Final = 1e-6  # of the range of μ: a point with a wider bracket is not located
_CLOSE: Final = 1e-6  # of the plane: how far the end of a curve may be from the point that it is said to end at
_NEAR: Final = 0.02  # of a strip: the same of the end of a curve and a line that it ends at
_ON_CURVE: Final = 1e-9  # of the rate or size: what may be left of the equations of a Hopf point
_NOTHING: Final = 1e-14  # damping below it is rounding, whatever it was summed from
_TRIES: Final = 20  # random segments drawn for each that is used
_EIGENVALUE: Final = 1e-10  # of the larger eigenvalue: a smaller real part has no sign


def inconsistencies(diagram: Diagram, *, verticals: int = 3, segments: int = 6, seed: int = 0) -> tuple[str, ...]:
    """Return everything in a diagram that cannot be, in words; empty if nothing was found.

    Points lie in their brackets and on their curves; curves end at named points; Hopf curves and lines solve their
    equations; equilibria have the kinds that strips and Hopf curves say; cycles are where Bendixson (1901) and the
    index allow; and their numbers differ between two places as the curves between say, on vertical lines through all
    of them and on random segments.

    Args:
        diagram: the diagram.
        verticals: how many vertical lines in each strip are counted along.
        segments: how many random segments in each strip.
        seed: of the random places.
    """
    random = np.random.default_rng(seed)
    found = [*_names(diagram), *_of_points(diagram), *_of_ends(diagram), *_of_lines(diagram)]
    for curve in diagram.curves:
        found += _of_curve(diagram, curve)
    for cell in range(len(diagram.cells)):
        found += _on_verticals(diagram, cell, verticals, random)
        found += _on_segments(diagram, cell, segments, random)
    return tuple(dict.fromkeys(found))


def inconsistencies_of_flow(flow: Flow) -> tuple[str, ...]:
    """Return everything in the equilibria and limit cycles found of a flow that cannot be; empty if nothing was found.

    Raises:
        RefusedError: two equilibria meet within rounding; the force is zero everywhere.
    """
    return tuple(_of_flow(flow, rests(flow), flow_cycles(flow).cycles))


def inconsistencies_of_located(objects: Iterable[Located]) -> tuple[str, ...]:
    """Return every located object that lies outside its own bracket or interval, or has a value that is no number."""
    found = []
    for one in objects:
        values = {one.parameter.name: one.parameter.value, **{name: at.value for name, at in one.state.items()}}
        if not all(map(math.isfinite, values.values())):
            found.append(f"{one.kind}: a value is not finite: {values}")
        for bracket in one.brackets:
            value = values.get(bracket.name)
            if value is not None and not bracket.low <= value <= bracket.high:
                found.append(f"{one.kind}: {bracket.name} = {value} is not in [{bracket.low}, {bracket.high}]")
        for name, value, interval in (
            (one.parameter.name, one.parameter.value, one.parameter.interval),
            *((name, at.value, at.interval) for name, at in one.state.items()),
        ):
            if interval.size == 2 and not interval[0] <= value <= interval[1]:
                found.append(f"{one.kind}: {name} = {value} is not in its interval {interval.tolist()}")
    return tuple(found)


# points, ends, lines and curves


def _names(diagram: Diagram) -> Iterator[str]:
    names = [*(curve.name for curve in diagram.curves), *(point.name for point in diagram.points)]
    for name in {name for name in names if names.count(name) > 1}:
        yield f"the name {name!r} stands for more than one thing"


def _of_points(diagram: Diagram) -> Iterator[str]:
    low, high = diagram.mu_range.tolist()
    known = {curve.name for curve in diagram.curves}
    for point in diagram.points:
        left, right = point.bracket.tolist()
        if not (left <= point.mu <= right and low <= point.mu <= high):
            yield f"{point.name}: mu = {point.mu} is not in its bracket [{left}, {right}]"
        if point.exact and right - left > _WIDE * (high - low):
            yield f"{point.name}: its bracket [{left}, {right}] is wide"
        for name in set(point.curves) - known:
            yield f"{point.name}: meets {name!r}, which is no curve of the diagram"
        for name in set(point.curves) & known:
            if point.exact and not _passes(diagram, diagram.curve(name), point):
                yield f"{point.name}: does not lie on {name!r}"


def _passes(diagram: Diagram, curve: DiagramCurve, point: DiagramPoint) -> bool:
    if curve.kind.is_line:
        return bool(curve.mu[0] == point.mu)
    height = float(np.ptp(diagram.lam_range))
    nearest = np.argmin(np.abs(curve.mu - point.mu))
    gap = abs(curve.lam[nearest] - point.lam)
    return bool(curve.mu[nearest] == point.mu and gap <= _CLOSE * height)


def _of_ends(diagram: Diagram) -> Iterator[str]:
    for curve in diagram.curves:
        if curve.exact and not curve.kind.is_line:
            for index, name in zip((0, -1), curve.ends, strict=True):
                mu, lam = float(curve.mu[index]), float(curve.lam[index])
                if not _is_at(diagram, curve, name, (mu, lam)):
                    yield f"{curve.name}: ends at ({mu}, {lam}), which is not {name!r}"


def _is_at(diagram: Diagram, curve: DiagramCurve, name: str, end: tuple[float, float]) -> bool:
    """Tell whether the end of a curve is where its name says."""
    points = {point.name: point for point in diagram.points}
    lines = {line.name: line for line in diagram.curves if line.kind.is_line}
    if name in points:
        gap = abs(end[1] - points[name].lam)
        return end[0] == points[name].mu and gap <= _CLOSE * float(np.ptp(diagram.lam_range))
    if name in lines:
        return abs(end[0] - float(lines[name].mu[0])) <= _NEAR * float(np.ptp(diagram.cells[curve.cell].mu))
    if name == "range":
        return end[0] in diagram.mu_range.tolist()
    return name == "unresolved" and bool(diagram.notes)


def _of_lines(diagram: Diagram) -> Iterator[str]:
    lines = [curve for curve in diagram.curves if curve.kind.is_line]
    for left, right in pairwise(diagram.cells):
        mu = float(left.mu[1])
        here = [line for line in lines if mu <= line.mu[0] <= right.mu[0]]
        if not here:
            yield f"two strips meet at mu = {mu}, where no line is"
        lost = {CurveKind.FOLD: 2, CurveKind.PITCHFORK: 2, CurveKind.TRANSCRITICAL: 0, CurveKind.INFINITY: 1}
        most = sum(lost[line.kind] for line in here)
        change = abs(len(left.saddles) - len(right.saddles))
        if change > most or (change - most) % 2:
            yield f"the number of equilibria changes by {change} at mu = {mu}, which no line there says"
    for line in lines:
        if float(line.mu[0]) not in {edge for cell in diagram.cells for edge in cell.mu.tolist()}:
            yield f"{line.name}: no strip ends there"
        flow = diagram.family.at(float(line.mu[0]), 0.0)
        if math.isfinite(line.x[0]) and not _solves(flow.force, float(line.x[0]), flow.force_sizes):
            yield f"{line.name}: no equilibrium lies at x = {line.x[0]}"


def _solves(row: Sequence[float], x: float, sizes: Sequence[float]) -> bool:
    return abs(horner(row, x)) <= _ON_CURVE * horner(tuple(map(abs, sizes)), abs(x))


def _of_curve(diagram: Diagram, curve: DiagramCurve) -> Iterator[str]:
    if curve.kind.is_line:
        return
    low, high = diagram.cells[curve.cell].mu.tolist()
    if not (np.diff(curve.mu) > 0.0).all() or curve.mu[0] < low or curve.mu[-1] > high:
        yield f"{curve.name}: its mu do not rise within its strip"
    if not curve.exact:
        return
    if curve.kind is CurveKind.HOPF:
        for mu, lam, x in zip(curve.mu.tolist(), curve.lam.tolist(), curve.x.tolist(), strict=True):
            flow = diagram.family.at(mu, lam)
            sizes = (abs(diagram.family.damping[0]) + abs(lam), *map(abs, diagram.family.damping[1:]))
            if not (_solves(flow.force, x, flow.force_sizes) and _solves(flow.damping, x, sizes)):
                yield f"{curve.name}: at mu = {mu} no trace is zero at x = {x}"
    elif curve.kind in (CurveKind.HOMOCLINIC, CurveKind.CYCLE_FOLD, CurveKind.SADDLE_CYCLE):
        for mu, lam, x in zip(curve.mu.tolist()[1:-1], curve.lam.tolist()[1:-1], curve.x.tolist()[1:-1], strict=True):
            if not _has_zero(diagram, mu, lam, x):
                yield f"{curve.name}: at mu = {mu} the damping has one sign, and no orbit can close (Bendixson)"


def _has_zero(diagram: Diagram, mu: float, lam: float, x: float) -> bool:
    """Tell whether the damping can change its sign along a closed orbit that turns at x."""
    flow = diagram.family.at(mu, lam)
    if max(map(abs, flow.damping)) <= _EIGENVALUE * (abs(lam) + max(map(abs, diagram.family.damping))) + _NOTHING:
        return True  # no damping at all: a center
    zeros = [root.value for root in real_roots(flow.damping)] if any(flow.damping[1:]) else []
    places = [x, *(point.x for point in rests(flow))]
    reach = max(places) - min(places)
    return any(min(places) - reach <= zero <= max(places) + reach for zero in zeros)


# single places


def _of_flow(flow: Flow, points: Sequence[Rest], cycles: Sequence[FlowCycle]) -> Iterator[str]:
    yield from _of_equilibria(flow, points)
    for cycle in cycles:
        yield from _of_cycle(flow, cycle, points)
    for enclosed, nest in groupby(cycles, key=lambda cycle: cycle.enclosed):
        for inner, outer in pairwise(nest):
            if not (outer.x_min < inner.x_min and inner.x_max < outer.x_max):
                yield f"two cycles around {enclosed} are not nested"
            if inner.stable == outer.stable:
                yield f"two neighboring cycles around {enclosed} are both {'' if inner.stable else 'un'}stable"


def _of_equilibria(flow: Flow, points: Sequence[Rest]) -> Iterator[str]:
    slope = derivative(flow.force)
    for point in points:
        real, imaginary = eigenvalues(horner(flow.damping, point.x), -horner(slope, point.x))
        large = max(map(abs, (*real, *imaginary)))
        if any(abs(value) <= _EIGENVALUE * large for value in real):
            continue
        if point.kind.stable != (max(real) < 0.0) or (point.kind == "saddle") != (real[0] * real[1] < 0.0):
            yield f"the equilibrium at x = {point.x} is called {point.kind}, and its eigenvalues say otherwise"


def _of_cycle(flow: Flow, cycle: FlowCycle, points: Sequence[Rest]) -> Iterator[str]:
    what = f"the cycle from x = {cycle.x_min} to {cycle.x_max}"
    low, high = cycle.bracket.tolist()
    if not low <= cycle.x_max <= high:
        yield f"{what} is not in its bracket"
    if not all(cycle.x_min < x < cycle.x_max for x in cycle.enclosed):
        yield f"{what} does not enclose what it is said to"
    # Two searches know an equilibrium to rounding only.
    inside = [min(points, key=lambda point: abs(point.x - x)) for x in cycle.enclosed]
    around = sum(-1 if point.kind == "saddle" else 1 for point in inside)
    if around != 1:
        yield f"{what} encloses equilibria of index {around}"
    zeros = [root.value for root in real_roots(flow.damping)] if any(flow.damping) else []
    if not any(cycle.x_min < zero < cycle.x_max for zero in zeros):
        yield f"{what} lies where the damping has one sign (Bendixson)"
    if cycle.stable != (cycle.multiplier < 1.0):
        yield f"{what} has the multiplier {cycle.multiplier}, and is said to be {'' if cycle.stable else 'un'}stable"


# numbers


def _tally(place: Counts) -> Tally:
    return {group.enclosed: (sum(group.stable), len(group.stable) - sum(group.stable)) for group in place.cycles}


def _differs(diagram: Diagram, cell: int, before: Counts, after: Counts, said: Tally | None) -> str:
    """Return how the numbers at two places differ from what the curves between say; empty if they do not."""
    if said is None:
        return ""
    one, other = _tally(before), _tally(after)
    silent = unsaid(diagram, cell, before.mu, after.mu)
    for key in sorted({*one, *other, *said} - {*before.unsure, *after.unsure} - silent):
        was, now, change = (part.get(key, (0, 0)) for part in (one, other, said))
        if (now[0] - was[0], now[1] - was[1]) != change:
            numbers = "from {}+{} to {}+{} stable+unstable cycles around {}".format(*was, *now, key)
            return (
                f"{numbers} between ({before.mu:.9g}, {before.lam:.9g}) and ({after.mu:.9g}, {after.lam:.9g}), "
                f"where the curves crossed say {change[0]:+d}{change[1]:+d}"
            )
    return ""


def _counted(diagram: Diagram, cell: int, mu: float, lam: float) -> tuple[Counts | None, list[str]]:
    """Count at one place, and check the place for itself."""
    flow = diagram.family.at(mu, lam)
    points = rests(flow)
    try:
        cycles = flow_cycles(flow)
    except RefusedError:
        return None, []  # nothing can be said there
    here = counted(mu, lam, points, cycles)
    found = list(_of_flow(flow, points, cycles.cycles))
    saddles = tuple(kind == "saddle" for kind in here.equilibria)
    if saddles != diagram.cells[cell].saddles:
        found.append(f"at mu = {mu:.9g} there are other equilibria than in strip {cell}")
    return here, found


def _on_verticals(diagram: Diagram, cell: int, count: int, random: np.random.Generator) -> Iterator[str]:
    low, high = diagram.cells[cell].mu.tolist()
    for share in random.uniform(0.02, 0.98, count):
        mu = low + float(share) * (high - low)
        met = met_at(diagram, cell, mu)
        before: Counts | None = None
        for lam in vertical_places(diagram, met):
            here, faults = _counted(diagram, cell, mu, lam)
            yield from faults
            if here is None:
                continue
            for index, hopf in hopf_of(met):
                if index < len(here.equilibria) and here.equilibria[index].stable != (lam < hopf.lam):
                    yield f"{hopf.curve.name}: at ({mu:.9g}, {lam:.9g}) its equilibrium is {here.equilibria[index]}"
            unstable = {index for index, kind in enumerate(here.equilibria) if "unstable" in kind}
            without = unstable - {index for index, _ in hopf_of(met)}
            if before is not None:
                was = {index for index, kind in enumerate(before.equilibria) if "unstable" in kind}
                if without - was:
                    yield f"at mu = {mu:.9g} an equilibrium loses its stability, and no Hopf curve says so"
                fault = _differs(diagram, cell, before, here, said_between(met, before.lam, lam))
                if fault:
                    yield fault
            before = here


def _on_segments(diagram: Diagram, cell: int, count: int, random: np.random.Generator) -> Iterator[str]:
    low, high = diagram.cells[cell].mu.tolist()
    bottom, top = diagram.lam_range.tolist()
    done = 0
    for _ in range(_TRIES * count):
        if done == count:
            return
        mus = low + random.uniform(0.02, 0.98, 2) * (high - low)
        lams = random.uniform(bottom, top, 2)
        start, end = ((float(mu), float(lam)) for mu, lam in zip(mus, lams, strict=True))
        said = said_along(diagram, cell, start, end)
        if said is None:
            continue
        done += 1
        (before, one), (after, other) = (_counted(diagram, cell, *place) for place in (start, end))
        yield from (*one, *other)
        if before is not None and after is not None:
            fault = _differs(diagram, cell, before, after, said)
            if fault:
                yield fault

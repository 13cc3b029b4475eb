"""The closed orbits of an annulus, as many as tell where λ* has its extrema.

A diagram knows the loops at a μ before it looks for folds of cycles there, so an annulus need not be followed into them
(as ``orbit.annulus`` does, which knows nothing): towards a loop ∮(f + λ) dt runs to ±∞ with the sign of its saddle's
trace, in proportion to the logarithm of the distance, and where it does so already nothing can follow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from finback.dynamics.flow import Flow, derivative, horner
from finback.dynamics.orbit.annulus import NEAREST, Annulus, Pole, Stretch, outermost, reach
from finback.dynamics.orbit.closure import Chart, Closed, Way, closed, closed_at, field_at, newton_in_lam, probe
from finback.dynamics.orbit.taylor_kernel import ON_AXIS, ON_SECTION, ORDER, travel

_BEGIN: Final = (1e-4, 2e-3, 0.02)  # of the size: the orbits beside a focus, where the closed form holds nearly
_STEP: Final = 0.5  # of p: what happens in an annulus happens over a factor of a distance
_SHORTEST: Final = 0.1  # of a step
_LONG_STEP: Final = 1.0  # the same nearer to a saddle than ``_TAIL``, where all is a power of the distance
_TAIL: Final = 1e-3  # of the size
_NEAR: Final = 0.05  # of the size: beside a loop; nearer, the growth is a straight line but for 0.05 log 0.05
_CLEAR: Final = 0.3  # the least growth whose trend is believed there
_STRONG: Final = 15.0  # and the least for which it is believed anywhere: such orbits differ by rounding in λ
_WIDE_STEPS: Final = 3.0  # the longest step where the growth is strong, in steps
_FALLS: Final = 0.5  # of the growth: how much of it a longer step may take, by its trend
_FAR: Final = 10.0  # sizes of the system, beyond which nothing new is expected
_OVERDAMPED: Final = 2.0  # the same where the growth is strong, which grows outward
_MOST_NODES: Final = 400
_MOST_CHARTS: Final = 6  # how often the side that names larger orbits is changed
_NEWTON: Final = 6  # steps of Newton's method before the search with a bracket
_ENOUGH: Final = 1e-2  # of the growth: what an error of λ may change of it; the place of a fold is found from its sign
_CLOSES: Final = 1e-6  # of the size: how near to itself an orbit comes that is taken for closed
_LEANS: Final = 3.0  # the growth beyond which an orbit over a saddle is followed all round the way it is stable
_LARGEST: Final = 700.0  # of the logarithm of a number
_LONGEST: Final = 1e6  # units of time; only a series that is exact for so long meets it
_MOST_PIECES: Final = 4000  # a turn has 10 to 120; one from very near a saddle more
_NO_RECORD: Final = np.empty((0, 4, ORDER + 1))
_GRAIN: Final = 1e-11  # of the rate: a smaller step of Newton's method is the last in any case


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEnd:
    """A loop at which an annulus ends.

    Attributes:
        saddle: the index of its saddle.
        lam: its λ, nearly: closed orbits are begun from there.
        trace: of its saddle.
        mirrored: whether its chart counts to the left.
    """

    saddle: int
    lam: float
    trace: float
    mirrored: bool


def chart_at(
    flow: Flow, places: tuple[float, ...], key: tuple[int, ...], origin: int, way: Way, *, mirrored: bool
) -> Chart:
    """Return the chart of the cycles around a group of equilibria that is counted from one of all equilibria."""
    field_there = field_at(flow, places[origin], mirrored=mirrored)
    low = places[key[0] - 1] if key[0] else -math.inf
    high = places[key[-1] + 1] if key[-1] + 1 < len(places) else math.inf
    cells = (
        sorted((field_there.u_of(low), field_there.u_of(places[key[0]]))),
        sorted((field_there.u_of(places[key[-1]]), field_there.u_of(high))),
    )
    left, right = reversed(cells) if mirrored else cells
    slope = derivative(flow.force)
    rate = math.sqrt(max(abs(horner(slope, places[index])) for index in key))
    return Chart(field_there, way, (left[0], left[1]), (right[0], right[1]), rate)


def annulus_of(
    flow: Flow, places: tuple[float, ...], key: tuple[int, ...], inner: LoopEnd | None, outer: LoopEnd | None
) -> Annulus | None:
    """Follow the closed orbits around a group of equilibria as far towards both ends as anything can happen.

    Args:
        flow: the flow.
        places: all equilibria, by rising x.
        key: those inside.
        inner: the loop at the inner end; None for a focus or node alone.
        outer: the loop at the outer end; None if there is none.

    Returns:
        the orbits; None if there are none.
    """
    return _Walk(flow, places, key, inner, outer).annulus()


@final
@dataclass(slots=True)
class _Walk:
    flow: Flow
    places: tuple[float, ...]
    key: tuple[int, ...]
    inner: LoopEnd | None
    outer: LoopEnd | None
    obstacle: str = ""
    reach: float = field(init=False)

    def __post_init__(self) -> None:
        """Measure the system."""
        self.reach = reach(self.flow, self.places[self.key[0]], self.places[self.key[-1]])

    def annulus(self) -> Annulus | None:
        """Follow the orbits from the inner end to the outer."""
        chart, begin = self._from_loop(self.inner) if self.inner else self._from_focus()
        nodes = [*begin, *self._outward(chart, begin)] if begin else []
        if not nodes:
            return None
        stretches = [Stretch(chart, _telling(nodes))]
        if self.outer is not None:
            at_loop = self._chart(self.outer.saddle, Way.TO_SADDLE, mirrored=self.outer.mirrored)
            rest = self._to_loop(at_loop, nodes[-1], self.outer)
            stretches += [Stretch(at_loop, _telling(rest))] if rest else []
        else:
            stretches += self._farther(nodes, mirrored=not chart.field.mirrored)
            last = stretches[-1].nodes[-1]
            if not self._is_far(stretches[-1].nodes):
                self.obstacle = (
                    f"orbits larger than from x = {last.x_min:.6g} to {last.x_max:.6g} could not be followed"
                )
        saddles = {index for index in self.key if self.inner and (index - self.key[0]) % 2}
        return Annulus(
            enclosed=tuple(Pole(self.places[index], index in saddles) for index in self.key),
            stretches=tuple(stretches),
            inner_saddle=self.places[self.inner.saddle] if self.inner else math.nan,
            outer_saddle=self.places[self.outer.saddle] if self.outer else math.nan,
            obstacle=self.obstacle,
        )

    def _chart(self, origin: int, way: Way, *, mirrored: bool) -> Chart:
        return chart_at(self.flow, self.places, self.key, origin, way, mirrored=mirrored)

    @property
    def _size(self) -> float:
        """How far the saddle of the outer loop is from the group, or how large the system is."""
        first, last = self.places[self.key[0]], self.places[self.key[-1]]
        if self.outer is None:
            return self.reach
        saddle = self.places[self.outer.saddle]
        return first - saddle if self.outer.saddle < self.key[0] else saddle - last

    def _is_far(self, nodes: Sequence[Closed]) -> bool:
        """Tell whether nothing new is expected farther out: by size, or where the damping rules the orbit ever more."""
        last = nodes[-1]
        size = 0.5 * (last.x_max - last.x_min) / self.reach
        if abs(last.growth) <= _STRONG:
            return size > _FAR
        rises = len(nodes) > 2 and abs(nodes[-3].growth) < abs(nodes[-2].growth) < abs(last.growth)
        return size > _OVERDAMPED or (rises and size > 1.0)

    def _from_focus(self) -> tuple[Chart, list[Closed]]:
        mirrored = self.outer is not None and self.outer.mirrored
        chart = self._chart(self.key[0], Way.FROM_FOCUS, mirrored=mirrored)
        nodes: list[Closed] = []
        for share in _BEGIN:
            guess = nodes[-1].lam if nodes else -horner(self.flow.damping, self.places[self.key[0]])
            node = near(chart, math.log(share * self._size), guess)
            if node is not None:
                nodes.append(node)
        return chart, nodes

    def _from_loop(self, end: LoopEnd) -> tuple[Chart, list[Closed]]:
        """Return the orbits over the saddle of the inner loop, outward from where nothing happens nearer to it."""
        chart = self._chart(end.saddle, Way.OVER_SADDLE, mirrored=end.mirrored)
        size = chart.rate * (self.places[self.key[-1]] - self.places[self.key[0]])
        begin = near(chart, math.log(_NEAR * size), end.lam, math.copysign(2.0 * _LEANS, end.trace))
        if begin is None:
            self.obstacle = "no orbit passes near the loop at its inner end"
            return chart, []
        after = near(chart, begin.p + _STEP, begin.lam, begin.growth)
        beside = [begin] if after is None else [after, begin]
        inward = self._inward(chart, beside, end, (math.log(_TAIL * size), math.log(NEAREST * size)))
        return chart, inward[::-1]

    def _inward(self, chart: Chart, nodes: list[Closed], end: LoopEnd, limits: tuple[float, float]) -> list[Closed]:
        """Go on from the last node towards a loop, until it is known what happens up to it.

        Args:
            chart: whose p rises or falls towards the loop.
            nodes: the last orbits, outward or inward.
            end: the loop.
            limits: p where the tail begins, and where to stop.
        """
        way = math.copysign(1.0, limits[1] - nodes[-1].p)
        while (limits[1] - nodes[-1].p) * way > 0.0 and not _settled(nodes, end.trace):
            step = _LONG_STEP if (nodes[-1].p - limits[0]) * way >= 0.0 else _STEP
            p = nodes[-1].p + way * min(step, abs(limits[1] - nodes[-1].p))
            node = near(chart, p, _foreseen(nodes, p), nodes[-1].growth)
            if node is None:
                self.obstacle = "the loop at its end passes another saddle too near to be followed to it"
                break
            nodes.append(node)
        return nodes

    def _to_loop(self, chart: Chart, last: Closed, end: LoopEnd) -> list[Closed]:
        """Return the orbits towards the outer loop."""
        here = near(chart, -math.log(-chart.field.u_of(outermost(last, chart))), last.lam)
        if here is None:
            self.obstacle = "the loop at its outer end passes another saddle too near to be followed to it"
            return []
        beside = near(chart, -math.log(_NEAR * self._size), end.lam)
        nodes = [here]
        while nodes[-1].p < -math.log(_NEAR * self._size) - 1e-9:
            p = min(nodes[-1].p + self._stride(nodes), -math.log(_NEAR * self._size))
            node = (
                beside
                if beside is not None and p == beside.p
                else near(chart, p, _foreseen(nodes, p), nodes[-1].growth)
            )
            if node is None:
                self.obstacle = "the loop at its outer end passes another saddle too near to be followed to it"
                return nodes
            nodes.append(node)
        return self._inward(chart, nodes, end, (-math.log(_TAIL * self._size), -math.log(NEAREST * self._size)))

    def _stride(self, nodes: list[Closed]) -> float:
        """Return the next step of p: longer where the growth is strong and its trend leaves it so."""
        if len(nodes) < 2 or not (abs(nodes[-1].growth) > _STRONG and abs(nodes[-2].growth) > _STRONG):
            return _STEP
        trend = (nodes[-1].growth - nodes[-2].growth) / (nodes[-1].p - nodes[-2].p)
        if trend * nodes[-1].growth > 0.0:
            return _WIDE_STEPS * _STEP
        return max(_STEP, min(_WIDE_STEPS * _STEP, _FALLS * abs(nodes[-1].growth / trend))) if trend else _STEP

    def _outward(self, chart: Chart, begin: list[Closed]) -> Iterator[Closed]:
        """Yield orbits beyond those given, until half of the way to the saddle of the outer end is behind, or far."""
        nodes, share = list(begin), 1.0
        for _ in range(_MOST_NODES):
            last = nodes[-1]
            if self.outer is None and self._is_far(nodes):
                return
            if self.outer is not None and self._halfway(last, self.outer):
                return
            p = last.p + (share * _STEP if share < 1.0 else self._stride(nodes))
            node = near(chart, p, _foreseen(nodes, p), nodes[-1].growth)
            if node is None:
                # Where the damping rules an orbit, λ* grows so fast that a shorter step may still be followed.
                share *= 0.5
                if share < _SHORTEST:
                    return
                continue
            nodes.append(node)
            yield node

    def _halfway(self, node: Closed, end: LoopEnd) -> bool:
        return abs(self.places[end.saddle] - (node.x_min if end.mirrored else node.x_max)) < 0.5 * self._size

    def _farther(self, before: list[Closed], *, mirrored: bool) -> Iterator[Stretch]:
        """Yield what else can be followed outward when orbits are named by where they turn on the other side."""
        failed = 0
        for _ in range(_MOST_CHARTS):
            if failed == 2 or self._is_far(before):
                return
            chart = self._chart(self.key[0 if mirrored else -1], Way.FROM_FOCUS, mirrored=mirrored)
            last = before[-1]
            here = near(chart, math.log(chart.field.u_of(last.x_min if mirrored else last.x_max)), last.lam)
            nodes = [] if here is None else [here, *self._outward(chart, [here])]
            failed = 0 if len(nodes) > 1 else failed + 1
            if not failed:
                yield Stretch(chart, _telling(nodes))
                before = nodes
            mirrored = not mirrored


def _telling(nodes: list[Closed]) -> tuple[Closed, ...]:
    """Leave out orbits between others on which the growth is as strong: what varies there comes nowhere near zero."""
    strong = [math.copysign(1.0, node.growth) if abs(node.growth) > _STRONG else 0.0 for node in nodes]
    inside = range(1, len(nodes) - 1)
    plain = {k for k in inside if strong[k] and strong[k - 1] == strong[k] == strong[k + 1]}
    # The last but one shows the trend towards a loop, as the second does.
    return tuple(node for k, node in enumerate(nodes) if k not in plain - {1, len(nodes) - 2})


def near(chart: Chart, p: float, guess: float, lean: float = 0.0) -> Closed | None:
    """Find the closed orbit named p, its λ as well as the sign of its growth needs it; None if there is none.

    Args:
        chart: the chart.
        p: the name.
        guess: of λ.
        lean: the growth of an orbit nearby: where it is strong, the way all round in which the orbit is stable is used.
    """
    if chart.way is Way.OVER_SADDLE and abs(lean) > _LEANS:
        found = _over_saddle(chart, p, guess, -math.copysign(1.0, lean))
        if found is not None:
            return found
    lam, last = guess, math.inf
    for _ in range(_NEWTON):
        trial = probe(chart, p, lam)
        if not chart.holds(trial):
            break
        change = newton_in_lam(chart, trial)
        if not abs(change) < last:
            break
        period, growth = trial.durations[0] - trial.durations[1], trial.dampings[0] - trial.dampings[1]
        closes = abs(trial.miss) <= _CLOSES * (trial.right - max(trial.ahead, trial.behind))
        if closes and _is_enough(chart, change, period, growth):
            return closed_at(chart, p, lam + change, trial)
        lam, last = lam + change, abs(change)
    return closed(chart, p, lam if math.isfinite(lam) else guess)


def _is_enough(chart: Chart, change: float, period: float, growth: float) -> bool:
    return abs(change) <= _GRAIN * chart.rate or abs(change) * period <= _ENOUGH * abs(growth)


def _over_saddle(chart: Chart, p: float, guess: float, way: float) -> Closed | None:
    """Do the same over a saddle, by the way all round and back below the saddle: forward (1) or backward (-1)."""
    field_here, lam, last = chart.field, guess, math.inf
    begin = -math.exp(p)
    for _ in range(_NEWTON):
        damping = field_here.damping.copy()
        damping[0] += lam
        turns, state = np.empty(2), np.array([0.0, begin, way, 0.0, 0.0, 0.0, 0.0])
        limits = np.array([math.nan, _LONGEST, _MOST_PIECES, 1.0])
        if travel(damping, field_here.force, state, limits, turns, _NO_RECORD) != ON_AXIS:
            return None
        limits[0] = 0.0
        if travel(damping, field_here.force, state, limits, np.empty(1), _NO_RECORD) != ON_SECTION:
            return None
        left, right = sorted(turns.tolist())
        inside = chart.left[0] < left < chart.left[1] and chart.right[0] < right < chart.right[1]
        end, duration, damped, moment = state.item(1), state.item(3), state.item(4), state.item(5)
        if not (inside and moment and damped > -_LARGEST):
            return None
        # The wedge of the flow with a displacement of the start, or of λ (see ``half_turn``).
        by_lam = math.exp(damped) * moment / end
        change = (begin - end) / by_lam
        if not abs(change) < last:
            return None
        if abs(end - begin) <= _CLOSES * -begin and _is_enough(chart, change, abs(duration), damped):
            return Closed(
                p=p,
                lam=lam + change,
                slope=begin * begin * math.expm1(-damped) / moment,
                growth=way * damped,
                x_min=min(field_here.x_of(left), field_here.x_of(right)),
                x_max=max(field_here.x_of(left), field_here.x_of(right)),
                period=abs(duration),
                miss=end - begin,
            )
        lam, last = lam + change, abs(change)
    return None


def _foreseen(nodes: list[Closed], p: float) -> float:
    """Return λ* at p from the last orbits and its slopes there."""
    last = nodes[-1]
    step = p - last.p
    if not math.isfinite(last.slope):
        return last.lam
    bend = 0.0
    if len(nodes) > 1 and math.isfinite(nodes[-2].slope):
        bend = (last.slope - nodes[-2].slope) / (last.p - nodes[-2].p)
    return last.lam + step * (last.slope + 0.5 * step * bend)


def _settled(nodes: list[Closed], trace: float) -> bool:
    """Tell whether between the last orbit and the loop beyond it the growth keeps its sign."""
    if len(nodes) < 2:
        return False
    before, last = nodes[-2].growth, nodes[-1].growth
    clear = abs(last) > _CLEAR
    return clear and last * trace > 0.0 and abs(last) > abs(before) and last * before > 0.0

"""Closed orbits by the rotation parameter: through each position goes one, at one constant λ added to the damping.

y' = (f + λ) y + g turns one way as λ grows (Duff 1953), so the landings of an orbit followed forward and of the same
followed backward pass each other once: λ*(position) is a root of a monotone function. The cycles of a flow are where
λ* is 0, its folds of cycles are the extrema of λ* (Perko, "Global families of limit cycles of planar analytic
systems", Trans. AMS 322, 1990), and the ends of λ* are Hopf points and loops.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from enum import Enum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import Flow, horner, shifted
from finback.dynamics.orbit.taylor_kernel import AT_REST, ESCAPED, ON_AXIS, ON_SECTION, ORDER, travel

_LONGEST: Final = 1e6  # units of time; only a series that is exact for so long meets it
_MOST_PIECES: Final = 4000  # half a turn has 5 to 60; one from very near a saddle more
_NO_RECORD: Final = np.empty((0, 4, ORDER + 1))
_ITERATIONS: Final = 200
_SURE: Final = 1e-10  # of the rate: a step of Newton's method after which the next is one of rounding
_GRAIN: Final = 4e-16  # of the rate: λ is known to no more
_LARGEST: Final = 700.0  # of the logarithm of a number
_JUMP: Final = 1e-6  # of the size of the orbit: a sign change with a larger miss is a jump over a saddle
_STIFF: Final = 15.0  # of ∫f dt: a half that spreads orbits by more is not followed where the whole turn can be


@final
@dataclass(frozen=True, slots=True)
class Field:
    """A flow in the coordinate u = x − origin, or, mirrored, u = origin − x (and y the other way round).

    Attributes:
        damping: f by rising power of u.
        force: g by rising power of u, in the mirror with the other sign; its constant is 0 where the origin is an
            equilibrium, so that a distance from it keeps all its digits.
        origin: the abscissa of u = 0.
        mirrored: whether u counts to the left.
    """

    damping: FloatArray
    force: FloatArray
    origin: float
    mirrored: bool

    def u_of(self, x: float) -> float:
        """Return the coordinate of an abscissa."""
        return self.origin - x if self.mirrored else x - self.origin

    def x_of(self, u: float) -> float:
        """Return the abscissa of a coordinate."""
        return self.origin - u if self.mirrored else self.origin + u


def field_at(flow: Flow, equilibrium: float, *, mirrored: bool) -> Field:
    """Return a flow in the coordinate of one of its equilibria."""
    damping, force = shifted(flow.damping, equilibrium), shifted(flow.force, equilibrium)
    force[0] = 0.0
    if mirrored:
        damping = [c if k % 2 == 0 else -c for k, c in enumerate(damping)]
        force = [-c if k % 2 == 0 else c for k, c in enumerate(force)]
    return Field(np.array(damping), np.array(force), equilibrium, mirrored)


class Way(Enum):
    """How a chart names the position of a closed orbit by a number p that rises outward."""

    FROM_FOCUS = 1
    """it turns at u = e^p, to the right of an equilibrium that is no saddle"""
    TO_SADDLE = 2
    """it turns at u = −e^(−p), to the left of a saddle"""
    OVER_SADDLE = 3
    """it passes below a saddle at y = −e^p"""


@final
@dataclass(frozen=True, slots=True)
class Chart:
    """A stretch of an annulus in which p names each closed orbit.

    Attributes:
        field: the flow, its origin at the equilibrium that p is counted from.
        way: how p names a position.
        left: coordinates between which the orbit turns on its left: neighboring equilibria, or infinite.
        right: the same on its right.
        rate: a typical rate of the flow, by which λ is measured.
    """

    field: Field
    way: Way
    left: tuple[float, float]
    right: tuple[float, float]
    rate: float

    def start(self, p: float) -> tuple[float, float]:
        """Return where the orbit named p begins, in coordinates of the field."""
        if self.way is Way.FROM_FOCUS:
            return math.exp(p), 0.0
        return (-math.exp(-p), 0.0) if self.way is Way.TO_SADDLE else (0.0, -math.exp(p))

    def mirrored(self) -> Chart:
        """Return the chart that names the same orbits by where they turn on the left instead; of a focus only."""
        field = self.field
        signs = (-1.0) ** np.arange(max(field.damping.size, field.force.size))
        seen = Field(
            field.damping * signs[: field.damping.size],
            -field.force * signs[: field.force.size],
            field.origin,
            not field.mirrored,
        )
        left, right = ((-cell[1], -cell[0]) for cell in (self.right, self.left))
        return Chart(seen, self.way, left, right, self.rate)

    def holds(self, found: Probe) -> bool:
        """Tell whether an orbit turns where those of the chart do."""
        left, right = self.left, self.right
        return (
            left[0] < found.ahead < left[1] and left[0] < found.behind < left[1] and right[0] < found.right < right[1]
        )


@final
@dataclass(frozen=True, slots=True)
class Closed:
    """A closed orbit.

    Attributes:
        p: its name in its chart.
        lam: the λ at which it is closed.
        slope: dλ*/dp; nan where the damping rules the orbit beyond double precision.
        growth: ∮(f + λ) dt over a turn: the logarithm of its multiplier.
        x_min: where it turns on the left.
        x_max: where it turns on the right.
        period: the time of a turn.
        miss: by how much the two landings differ, in x, as evaluated.
    """

    p: float
    lam: float
    slope: float
    growth: float
    x_min: float
    x_max: float
    period: float
    miss: float


@final
@dataclass(frozen=True, slots=True)
class Probe:
    """An orbit followed from its start: both ways to where it turns on the left, or one way all round.

    Attributes:
        ahead: where it turns on the left, followed forward; −inf if it goes away, nan if it could not be followed.
        behind: the same backward; of an orbit followed all round, the same place.
        right: where it turns on the right.
        durations: time of the half forward from there, and (negative) of that backward.
        dampings: ∫(f + λ) dt along the two.
        moments: ∫ exp(−∫) y² dt along the two, in the order and direction in which they were followed.
        way: 0 if it was followed both ways, 1 all round forward, −1 all round backward.
        again: where it turns on the right again, if followed all round; else where it did.
    """

    ahead: float
    behind: float
    right: float
    durations: tuple[float, float]
    dampings: tuple[float, float]
    moments: tuple[float, float]
    way: int
    again: float

    @property
    def miss(self) -> float:
        """How far it is from closing: falls as λ grows; nan if both ways go away."""
        return self.way * (self.right - self.again) if self.way else self.ahead - self.behind


def probe(chart: Chart, p: float, lam: float) -> Probe:
    """Follow the orbit named p at one λ.

    Where one half, followed from the right, spreads neighboring orbits by more than e^15 or goes away, and the other
    draws them together as much, the orbit is followed the second way all round: the place where it turns on the left
    is then known to rounding, while the spreading half would show it only between two neighboring numbers.
    """
    field = chart.field
    damping = field.damping.copy()
    damping[0] += lam
    x, y = chart.start(p)
    over = chart.way is Way.OVER_SADDLE
    ahead, one = _landings(damping, field.force, (x, y), 1.0, 1)
    behind, two = _landings(damping, field.force, (x, y), -1.0, 2 if over else 1)
    right = behind[0] if over else x
    durations, dampings, moments = zip(one, two, strict=True)
    found = Probe(ahead[-1], behind[-1], right, durations, dampings, moments, 0, right)
    return found if over else _round(chart, damping, found)


def _round(chart: Chart, damping: FloatArray, halves: Probe) -> Probe:
    """Follow an orbit all round the way in which it is stable, if it is too much so for the other way."""
    (forward, backward), force = halves.dampings, chart.field.force
    if forward < -_STIFF and not backward < _STIFF * math.isfinite(halves.behind):
        way, left, first = 1, halves.ahead, 0
    elif backward < -_STIFF and not forward < _STIFF * math.isfinite(halves.ahead):
        way, left, first = -1, halves.behind, 1
    else:
        return halves
    if not chart.left[0] < left < chart.left[1]:
        return halves
    landings, (duration, damped, moment) = _landings(damping, force, (left, 0.0), float(way), 1)
    if not (chart.right[0] < landings[0] < chart.right[1] and damped < _STIFF):
        return halves
    # The second half in the direction of the first would be, from the right, the other one backward.
    durations, dampings = [-duration, -duration], [-damped, -damped]
    durations[first], dampings[first] = halves.durations[first], halves.dampings[first]
    return Probe(
        ahead=left,
        behind=left,
        right=halves.right,
        durations=(durations[0], durations[1]),
        dampings=(dampings[0], dampings[1]),
        moments=(halves.moments[first], moment),
        way=way,
        again=landings[0],
    )


def _landings(
    damping: FloatArray, force: FloatArray, start: tuple[float, float], way: float, count: int
) -> tuple[list[float], tuple[float, float, float]]:
    state = np.array([*start, way, 0.0, 0.0, 0.0, 0.0])
    landings = np.full(count, np.nan)
    ending = travel(damping, force, state, np.array([math.nan, _LONGEST, _MOST_PIECES, 1.0]), landings, _NO_RECORD)
    places = landings.tolist()
    if ending != ON_AXIS:
        places[-1] = -math.inf if ending == ESCAPED else state.item(0) if ending == AT_REST else math.nan
    return places, (state.item(3), state.item(4), state.item(5))


def speed_at(field: Field, right: float, u: float, *, forward: bool) -> float:
    """Return y of the orbit that turns at ``right`` on the right, where it first passes u; 0 if it turns before."""
    state = np.array([right, 0.0, 1.0 if forward else -1.0, 0.0, 0.0, 0.0, 0.0])
    limits = np.array([u, _LONGEST, _MOST_PIECES, 0.0])
    return (
        state.item(1)
        if travel(field.damping, field.force, state, limits, np.empty(1), _NO_RECORD) == ON_SECTION
        else 0.0
    )


def closed(chart: Chart, p: float, guess: float) -> Closed | None:
    """Find the λ at which the orbit named p is closed; None if there is none in the cells of the chart."""
    low, high, step = -math.inf, math.inf, 0.1 * chart.rate
    lam, last = guess, math.inf
    held = [False, False]  # whether the orbits at the ends of the bracket turn in the cells: then no saddle is jumped
    for _ in range(_ITERATIONS):
        found = probe(chart, p, lam)
        miss = found.miss
        if math.isnan(miss):
            return None
        if miss > 0.0:
            low, held[0] = lam, chart.holds(found)
        elif miss < 0.0:
            high, held[1] = lam, chart.holds(found)
        size = max(chart.rate, abs(lam))
        known = math.isfinite(low + high)
        target = 0.5 * (low + high) if known else lam + math.copysign(step, miss)
        closes = chart.holds(found) and abs(miss) <= _JUMP * (found.right - found.ahead)
        if chart.holds(found):
            change = newton_in_lam(chart, found)
            # The second of two small steps of Newton's method is one of rounding.
            rounded = miss == 0.0 or abs(change) <= _GRAIN * size or max(abs(change), last) <= _SURE * size
            if closes and rounded:
                return closed_at(chart, p, lam + change if miss else lam, found)
            last = abs(change)
            if low < lam + change < high and (closes or last > 0.0):
                target, known = lam + change, True
        step *= 1.0 if known else 2.0
        if high - low <= _GRAIN * size:
            return closed_at(chart, p, lam, found) if closes or all(held) else None
        lam = target
    return None


def newton_in_lam(chart: Chart, found: Probe) -> float:
    """Return −miss/(d miss/dλ), by the Melnikov wedge (see ``half_turn``)."""
    if found.way:
        by_lam, _ = _slopes_round(chart, found)
        return -found.miss / by_lam if by_lam else math.inf
    largest, (one, two) = _growths(chart, found)
    push = one * found.moments[0] - two * found.moments[1]
    return -found.miss / push * math.exp(min(-largest, _LARGEST))


def _slopes_round(chart: Chart, found: Probe) -> tuple[float, float]:
    """Return d(miss)/dλ, nan where the integrals overflow, and d(miss)/dp, of an orbit followed all round."""
    one, two = found.dampings if found.way > 0 else found.dampings[::-1]
    force = chart.field.force.tolist()
    steepness = max(-horner(force, found.again), sys.float_info.min)
    by_lam = math.nan
    if max(abs(one), abs(two)) < _LARGEST:
        by_lam = -math.exp(-two) * (math.exp(one) * found.moments[0] + found.moments[1]) / steepness
    wedge = -horner(force, found.right) * abs(found.right) * math.exp(min(one - two, _LARGEST))
    return found.way * by_lam, found.way * (abs(found.right) - wedge / steepness)


def _growths(chart: Chart, found: Probe) -> tuple[float, tuple[float, float]]:
    """Return exp(∫f) / −g at both landings, where g > 0, without a power of e that is common, and that power."""
    force = chart.field.force.tolist()
    largest = max(found.dampings)
    one, two = (
        math.exp(damped - largest) / -max(horner(force, place), sys.float_info.min)
        for damped, place in zip(found.dampings, (found.ahead, found.behind), strict=True)
    )
    return largest, (one, two)


def miss_by_p(chart: Chart, p: float, found: Probe) -> float:
    """Return d(miss)/dp at a held λ: the wedge of the flow with the start's displacement, grown both ways."""
    if found.way:
        return _slopes_round(chart, found)[1]
    largest, (one, two) = _growths(chart, found)
    return _start_wedge(chart, p) * (one - two) * math.exp(min(largest, _LARGEST))


def newton_in_p(chart: Chart, p: float, found: Probe) -> float:
    """Return −miss/(d miss/dp) at a held λ; inf where the miss does not move."""
    slope = miss_by_p(chart, p, found)
    return -found.miss / slope if slope else math.inf


def _start_wedge(chart: Chart, p: float) -> float:
    if chart.way is Way.OVER_SADDLE:
        return math.exp(2.0 * p)
    x, _ = chart.start(p)
    return -horner(chart.field.force.tolist(), x) * abs(x)


def closed_at(chart: Chart, p: float, lam: float, found: Probe) -> Closed:
    """Return an orbit that closes, all but rounding, as such."""
    forward, backward = found.dampings
    if found.way:
        by_lam, by_p = _slopes_round(chart, found)
        slope = -by_p / by_lam if by_lam else math.nan
    else:
        largest = max(forward, backward)
        weights = math.exp(forward - largest), math.exp(backward - largest)
        # The miss moves by the wedge of the start and by that of λ, both grown by exp(∫f): their ratio is the slope.
        push = weights[0] * found.moments[0] - weights[1] * found.moments[1]
        slope = -_start_wedge(chart, p) * (weights[0] - weights[1]) / push
    ends = sorted((chart.field.x_of(found.ahead), chart.field.x_of(found.right)))
    return Closed(
        p=p,
        lam=lam,
        slope=slope,
        growth=forward - backward,
        x_min=ends[0],
        x_max=ends[1],
        period=found.durations[0] - found.durations[1],
        miss=found.miss,
    )

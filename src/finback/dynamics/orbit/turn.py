"""Turns of a flow around a group of equilibria: where an orbit turns on either side, however strong the damping is.

Orbits of a plane do not cross. So from the right side both the landing of an orbit followed forward and that of the
same followed backward move outward as its start does, and so does the landing after a whole turn: each is monotone,
and where one landing leaves the cells in which a cycle can turn, the side on which it does so says as much as a place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import horner
from finback.dynamics.orbit.closure import Chart, Probe, Way
from finback.dynamics.orbit.passage_kernel import INSIDE, LANDED, LOST, OUTSIDE, passage

FAR: Final = 1e4
"""Units of the flow: an orbit that comes so far, with nothing beyond that turns it, does not come back."""

_MOST_PIECES: Final = 5000  # half a turn has 5 to 300
_GRAIN: Final = 1e-14  # of the size of an orbit: what rounding leaves of a miss, times the growth of a deviation
_GROWN: Final = 40.0  # the logarithm of that growth that is reckoned with at most: then nothing is left
_SPREAD: Final = 32.0  # the same after a decay: nothing is left of where it began
_LARGEST: Final = 700.0  # of the logarithm of a number
_PLACES: Final = {INSIDE: math.inf, OUTSIDE: -math.inf, LOST: math.nan}


@final
@dataclass(frozen=True, slots=True)
class Leg:
    """Half a turn.

    Attributes:
        u: where it turns; to the right of a start on the left, to the left of one on the right. Infinite, on the side
            of the start, where it turns or rests before the cell; infinite on the other side where it goes beyond it;
            nan where it could not be followed.
        duration: its time, negative backward.
        damping: ∫f dt along it.
        growth: the logarithm of the largest growth of a deviation over any stretch of it.
        canard: the same of growth that follows a decay as large: rounding in between counts as much as a start that
            much farther off.
    """

    u: float
    duration: float
    damping: float
    growth: float
    canard: float


@final
@dataclass(frozen=True, slots=True)
class Trial:
    """An orbit followed both ways from its start to where it turns on the left.

    Attributes:
        p: its name in its chart.
        ahead: where it turns on the left, followed forward: +∞ before the cell, −∞ beyond it, nan if it was lost.
        behind: the same backward.
        right: where it turns on the right; ±∞ and nan as above, mirrored.
        durations: time of the half forward from there, and (negative) of that backward.
        dampings: ∫f dt along the two.
        growth: the logarithm of the largest growth of a deviation over any stretch.
        canard: the same of growth that follows a decay as large.
        slope: the derivative by p of the miss over the size; nan where it is not known.
    """

    p: float
    ahead: float
    behind: float
    right: float
    durations: tuple[float, float]
    dampings: tuple[float, float]
    growth: float
    canard: float
    slope: float

    @property
    def lost(self) -> bool:
        """Whether it could not be followed."""
        return math.isnan(self.ahead) or math.isnan(self.behind)

    @property
    def landed(self) -> bool:
        """Whether it turns in the cells, both ways."""
        return math.isfinite(self.ahead) and math.isfinite(self.behind)

    @property
    def inside(self) -> bool:
        """Whether both ways it turns before the cell: it does not go round the group."""
        return self.ahead == self.behind == math.inf

    @property
    def outside(self) -> bool:
        """Whether both ways it goes beyond."""
        return self.ahead == self.behind == -math.inf

    @property
    def miss(self) -> float:
        """By how much it does not close, over its size: positive where the flow leads inward; ±∞, nan as the places."""
        return (self.ahead - self.behind) / (self.right - min(self.ahead, self.behind)) if self.landed else self._sign

    @property
    def _sign(self) -> float:
        if self.lost or self.inside or self.outside:
            return math.nan
        return math.inf if self.ahead > self.behind else -math.inf

    @property
    def sign(self) -> int:
        """Return 1 where the flow leads inward, −1 outward, 0 where rounding decides or nothing is known."""
        miss = self.miss
        if math.isnan(miss) or self.spread or abs(miss) <= _GRAIN * math.exp(min(self.growth, _GROWN)):
            return 0
        return 1 if miss > 0.0 else -1

    @property
    def spread(self) -> bool:
        """Whether it spreads orbits so far that rounding decides where it lands."""
        return self.canard > _SPREAD

    def probe(self) -> Probe:
        """Return it as an orbit of the rotated family at λ = 0, without the integrals by λ."""
        moments = (math.nan, math.nan)
        return Probe(self.ahead, self.behind, self.right, self.durations, self.dampings, moments, 0, self.right)


@final
@dataclass(frozen=True, slots=True)
class Turn:
    """A whole turn, from where it begins on the right or the left.

    Attributes:
        start: where.
        middle: where it turns on the other side.
        end: where it turns again; ±∞ or nan as ``Leg``.
        legs: its halves; the first alone where it does not turn.
        way: 1 forward in time, −1 backward.
    """

    start: float
    middle: float
    end: float
    legs: tuple[Leg, ...]
    way: float

    @property
    def damping(self) -> float:
        """∫f dt along it, with the sign of time: what a deviation grows by is its exponential."""
        return math.fsum(leg.damping for leg in self.legs)


@final
@dataclass(frozen=True, slots=True)
class Stage:
    """A chart, with what is needed to follow orbits around a group in it.

    Attributes:
        chart: the chart.
        rests: all equilibria, in its coordinate.
    """

    chart: Chart
    rests: FloatArray

    def leg(self, start: tuple[float, float], way: float, *, leftward: bool) -> Leg:
        """Follow half a turn, or what is left of it, to one side."""
        field = self.chart.field
        nearer, farther = self.chart.left[::-1] if leftward else self.chart.right
        state = np.array([*start, way, 0.0, 0.0, 0.0, 0.0, 0.0])
        limits = np.array([nearer, farther, FAR, _MOST_PIECES])
        ending = passage(field.damping, field.force, state, limits, self.rests)
        u, _, _, duration, damping, growth, _, canard = state.tolist()
        if ending == LANDED and abs(u - nearer) < abs(farther - u) and not horner(field.force.tolist(), u):
            ending = INSIDE  # within rounding it rests in the equilibrium before the cell
        if ending != LANDED:
            u = _PLACES[ending] * (1.0 if leftward else -1.0)
        return Leg(u, duration, damping, growth, canard)

    def trial(self, p: float) -> Trial:
        """Follow the orbit named p both ways to its left turns."""
        chart = self.chart
        start = chart.start(p)
        ahead = self.leg(start, 1.0, leftward=True)
        if chart.way is not Way.OVER_SADDLE:
            behind = self.leg(start, -1.0, leftward=True)
            right = start[0]
            back_legs = [behind]
        else:
            first = self.leg(start, -1.0, leftward=False)
            right = first.u
            # Where it does not turn on the right, the side on which it fails is that of the whole.
            behind = (
                self.leg((right, 0.0), -1.0, leftward=True)
                if math.isfinite(right)
                else Leg(-right, first.duration, first.damping, first.growth, first.canard)
            )
            back_legs = [first, behind]
        back = math.fsum(leg.damping for leg in back_legs)
        return Trial(
            p=p,
            ahead=ahead.u,
            behind=behind.u,
            right=right,
            durations=(ahead.duration, math.fsum(leg.duration for leg in back_legs)),
            dampings=(ahead.damping, back),
            growth=max(leg.growth for leg in (ahead, *back_legs)),
            canard=max(leg.canard for leg in (ahead, *back_legs)),
            slope=self._slope(p, (ahead.u, behind.u, right), (ahead.damping, back, back_legs[0].damping)),
        )

    def _slope(self, p: float, places: tuple[float, float, float], dampings: tuple[float, float, float]) -> float:
        """Return d(miss/size)/dp, by the Melnikov wedge (see ``half_turn``)."""
        ahead, behind, right = places
        if not all(map(math.isfinite, places)) or max(map(abs, dampings)) > _LARGEST:
            return math.nan
        force = self.chart.field.force.tolist()
        over = self.chart.way is Way.OVER_SADDLE
        # Of a start on y = 0 the wedge is that of its displacement there.
        wedge = math.exp(2.0 * p) if over else -horner(force, right) * abs(self.chart.start(p)[0])
        grown = dampings if over else (*dampings[:2], 0.0)
        pushes = [-horner(force, place) for place in places]
        if not all(pushes):
            return math.nan  # it comes to rest there, within rounding: no displacement moves that
        moves = [wedge * math.exp(damped) / push for push, damped in zip(pushes, grown, strict=True)]
        size = right - min(ahead, behind)
        grows = moves[2] - (moves[0] if ahead < behind else moves[1])
        return (moves[0] - moves[1]) / size - (ahead - behind) * grows / size**2

    def turn(self, start: float, way: float, *, from_right: bool) -> Turn:
        """Follow an orbit all round."""
        there = self.leg((start, 0.0), way, leftward=from_right)
        if not math.isfinite(there.u):
            return Turn(start, there.u, -there.u, (there,), way)
        back = self.leg((there.u, 0.0), way, leftward=not from_right)
        return Turn(start, there.u, back.u, (there, back), way)

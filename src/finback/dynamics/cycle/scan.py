"""The search for changes of sign of the displacement over a turn: where they lie, and where there are none.

Between two orbits at which the flow leads to the same side there is no cycle if the landings of all orbits between them
lie apart: they are monotone, so those of the two say so. Otherwise the interval is halved until that holds, or until
the displacement is so smooth that its cubic through both ends tells what happens between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.dynamics.flow import horner
from finback.dynamics.orbit.turn import Stage, Trial

_HALVINGS: Final = 24
_SMOOTH: Final = 12.0  # ∫f dt of a half beyond which no cubic is trusted
_TRUST: Final = 4.0  # errors of the cubic that its least value must exceed
_SHAPE: Final = 0.05  # of the larger end: an error of the cubic that leaves it its one zero
_EDGE: Final = 1e-10  # of p: how well the edge of the orbits that go round is found
_MOST: Final = 4000


@final
@dataclass(frozen=True, slots=True)
class Change:
    """Two orbits between which the displacement changes its sign, once as far as is seen.

    Attributes:
        stage: where they were followed.
        low: the inner.
        high: the outer.
    """

    stage: Stage
    low: Trial
    high: Trial


@final
@dataclass(slots=True)
class Scan:
    """The search along one stretch of p, outward, and what it met.

    Attributes:
        stage: the chart.
        trials: all orbits followed.
        lost: orbits that could not be.
        undecided: intervals of p between which it was not decided whether there are cycles.
    """

    stage: Stage
    trials: list[Trial] = field(default_factory=list)
    lost: list[Trial] = field(default_factory=list)
    undecided: list[tuple[Trial, Trial]] = field(default_factory=list)

    def at(self, p: float) -> Trial:
        """Follow the orbit named p."""
        trial = self.stage.trial(p)
        (self.lost if trial.lost else self.trials).append(trial)
        return trial

    def changes(self, places: list[float]) -> Iterator[Change]:
        """Yield the changes of sign between the first and the last place, searched in between from all."""
        trials = [self.at(p) for p in places]
        # An orbit that closes within rounding says nothing of its own; one that does not go round does.
        clear = [trial for trial in trials if trial.sign or trial.inside or trial.outside or trial.lost]
        for low, high in pairwise(clear):
            yield from self._between(low, high, _HALVINGS)
        self._ends(trials)
        self._ends(trials[::-1])

    def _ends(self, trials: list[Trial]) -> None:
        """Note orbits at an end of which nothing is known: there are no two to look between."""
        known = next((trial for trial in trials if not trial.spread), trials[-1])
        if trials[0].spread:
            self.undecided.append((known, trials[0]))

    def _between(self, low: Trial, high: Trial, halvings: int) -> Iterator[Change]:
        if low.lost or high.lost:
            self.undecided.append((low, high))
        elif (low.inside and high.inside) or (low.outside and high.outside):
            return
        elif low.inside or high.inside or low.outside or high.outside:
            # Somewhere between is the edge of the orbits that go round: all that lies beyond is left to them.
            if high.p - low.p > _EDGE * max(1.0, abs(low.p)):
                yield from self._halved(low, self.at(0.5 * (low.p + high.p)), high, halvings)
        elif low.sign != high.sign or not _apart(low, high):
            middle = self.at(0.5 * (low.p + high.p))
            told = self._told(low, middle, high)
            if not told and halvings > 0 and len(self.trials) < _MOST:
                yield from self._halved(low, middle, high, halvings - 1)
            elif low.sign != high.sign:
                yield Change(self.stage, low, high)
            elif not told:
                self.undecided.append((low, high))

    def _halved(self, low: Trial, middle: Trial, high: Trial, halvings: int) -> Iterator[Change]:
        if middle.sign or middle.inside or middle.outside or middle.lost:
            yield from self._between(low, middle, halvings)
            yield from self._between(middle, high, halvings)
        elif low.sign * high.sign < 0:
            yield Change(self.stage, low, high)
        elif middle.spread:
            self.undecided.append((low, high))

    def _told(self, low: Trial, middle: Trial, high: Trial) -> bool:
        """Tell whether the cubic through both ends, tried in the middle, decides what is between them."""
        trials = (low, middle, high)
        if not all(trial.landed and max(map(abs, trial.dampings)) <= _SMOOTH for trial in trials):
            return False
        width = high.p - low.p
        ends = np.array([low.miss, high.miss])
        rises = np.array([low.slope, high.slope]) * width
        # By rising power of the share of the way; its extrema are zeros of a square polynomial.
        change = ends[1] - ends[0]
        row = [ends[0], rises[0], 3.0 * change - 2.0 * rises[0] - rises[1], rises.sum() - 2.0 * change]
        bent = math.sqrt(max(0.0, row[2] ** 2 - 3.0 * row[3] * row[1]))
        lowest = -row[2] - math.copysign(bent, row[2])
        turns = [a / b for a, b in ((lowest, 3.0 * row[3]), (row[1], lowest)) if bent and b and 0.0 < a / b < 1.0]
        values = [*ends, *(horner(row, s) for s in turns)]
        error = abs(horner(row, 0.5) - middle.miss)
        error += 0.25 * abs(horner((row[1], 2.0 * row[2], 3.0 * row[3]), 0.5) - middle.slope * width)
        if low.sign == high.sign:
            return bool(min(low.sign * value for value in values) > _TRUST * error)
        return not turns and bool(error <= _SHAPE * max(map(abs, ends)))


def _apart(low: Trial, high: Trial) -> bool:
    """Tell whether no orbit between two closes, as landings are monotone."""
    if low.sign > 0:
        return high.ahead > low.behind
    return high.behind > low.ahead

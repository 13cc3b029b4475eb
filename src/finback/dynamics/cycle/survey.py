"""The search for limit cycles around one group of equilibria: which orbits are followed, and what they tell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.dynamics.cycle.scan import Change, Scan
from finback.dynamics.orbit.annulus import NEAREST, Group
from finback.dynamics.orbit.closure import Field, Way
from finback.dynamics.orbit.turn import Stage, Trial

_TINY: Final = 1e-8  # of the size: an orbit this near to a focus holds the cycles beside a Hopf point
_SMALLEST: Final = 1e-4  # of the same: between the two the closed form of a focus holds
_FARTHEST: Final = 100.0  # sizes of the system: beyond it no cycles are looked for
_STEP: Final = 1.0  # of p
_AWAY: Final = 0.3  # of the rate times the size: an orbit that passes a saddle as fast is named by its turns


@final
@dataclass(frozen=True, slots=True)
class Survey:
    """What was seen around a group.

    Attributes:
        changes: where the displacement changes its sign, outward.
        scans: the stretches searched, outward.
        at_loop: whether the flow closes a loop at an end of the orbits, within rounding.
    """

    changes: tuple[Change, ...]
    scans: tuple[Scan, ...]
    at_loop: bool

    @property
    def trials(self) -> list[Trial]:
        """All orbits that go round, or fail to on one side only."""
        return [trial for scan in self.scans for trial in scan.trials if not (trial.inside or trial.outside)]

    @property
    def obstacles(self) -> list[str]:
        """Where it is not known whether there are cycles, in words."""
        words = []
        for scan in self.scans:
            field = scan.stage.chart.field
            side = "left" if field.mirrored else "right"
            for cause, lost in (("could not be followed", True), ("could not be followed closely enough", False)):
                places = [
                    field.x_of(trial.right)
                    for pair in scan.undecided
                    if any(trial.lost for trial in pair) is lost
                    for trial in pair
                ]
                if places:
                    words.append(
                        f"orbits that turn on the {side} at x = {min(places):.6g} to {max(places):.6g} {cause}"
                    )
        return words

    @property
    def reach(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Where the smallest and the largest orbit turn, x_min and x_max; nan where one does not."""
        turns = [
            _turns(scan.stage.chart.field, trial)
            for scan in self.scans
            for trial in scan.trials
            if not (trial.inside or trial.outside)
        ]
        if not turns:
            return (math.nan, math.nan), (math.nan, math.nan)
        sizes = [high - low for low, high in turns]
        if not any(map(math.isfinite, sizes)):
            return (math.nan, math.nan), (math.nan, math.nan)
        return turns[int(np.nanargmin(sizes))], turns[int(np.nanargmax(sizes))]


def survey(group: Group) -> Survey:
    """Search all orbits around a group whose flow is in units of its own size."""
    scans: list[Scan] = []
    changes: list[Change] = []
    begin = math.nan
    mirrored = _side(group)
    if group.first != group.last:
        over = _over_saddle(group)
        if over is not None:
            scan, places = over
            changes += scan.changes(places)
            scans.append(scan)
            begin = _begin(group, scan, mirrored=mirrored)
    for stage, places in _outward(group, begin, mirrored=mirrored):
        scan = Scan(stage)
        changes += scan.changes(places)
        scans.append(scan)
    return Survey(tuple(changes), tuple(scans), _at_loop(scans))


def _turns(field: Field, trial: Trial) -> tuple[float, float]:
    left = max(place for place in (trial.ahead, trial.behind) if place != math.inf)
    low, high = sorted((field.x_of(left), field.x_of(trial.right)))
    finite = math.isfinite(low) and math.isfinite(high)
    return (low, high) if finite else (math.nan, math.nan)


def _stage(group: Group, way: Way, origin: float, *, mirrored: bool) -> Stage:
    chart = group.chart(way, origin, mirrored=mirrored)
    return Stage(chart, np.array([chart.field.u_of(point.x) for point in group.points]))


def _room(group: Group, *, mirrored: bool) -> float:
    """Return how far the saddle on the naming side is from the group."""
    low, high = group.limits
    return group.points[group.first].x - low if mirrored else high - group.points[group.last].x


def _side(group: Group) -> bool:
    """Tell whether orbits are named by where they turn on the left: where the outer end is a loop at that saddle."""
    finite = [mirrored for mirrored in (False, True) if math.isfinite(_room(group, mirrored=mirrored))]
    for mirrored in finite:
        room = _room(group, mirrored=mirrored)
        stage = _stage(group, Way.TO_SADDLE, group.limits[0 if mirrored else 1], mirrored=mirrored)
        trial = stage.trial(-math.log(NEAREST * room))
        if not trial.lost and -math.inf not in (trial.ahead, trial.behind):
            return mirrored
    return finite == [False]  # the side without a saddle, if there is one


def _over_saddle(group: Group) -> tuple[Scan, list[float]] | None:
    """Return the search from the loop at the inner end, through a saddle of the group; None if none is there."""
    inside = group.enclosed[1::2]
    speed = group.rate * (group.enclosed[-1].x - group.enclosed[0].x)
    low = math.log(NEAREST * speed)
    for point in inside:
        for mirrored in (False, True):
            stage = _stage(group, Way.OVER_SADDLE, point.x, mirrored=mirrored)
            if stage.trial(low).landed:
                return Scan(stage), _places(low, math.log(_AWAY * speed))
    return None


def _begin(group: Group, scan: Scan, *, mirrored: bool) -> float:
    """Return how far from the group the orbits already searched turn, on the naming side."""
    landed = [trial for trial in scan.trials if trial.landed]
    last = max(landed, key=lambda trial: trial.p)
    field = scan.stage.chart.field
    inner = group.points[group.first if mirrored else group.last].x
    same = field.mirrored is mirrored
    turn = last.right if same else max(last.ahead, last.behind)
    return abs(field.x_of(turn) - inner)


def _outward(group: Group, begin: float, *, mirrored: bool) -> Iterator[tuple[Stage, list[float]]]:
    room = _room(group, mirrored=mirrored)
    size = room if math.isfinite(room) else 1.0
    inner = group.points[group.first if mirrored else group.last].x
    focus = _stage(group, Way.FROM_FOCUS, inner, mirrored=mirrored)
    end = math.log(0.5 * room if math.isfinite(room) else _FARTHEST)
    if math.isnan(begin):
        places = [math.log(_TINY * size), *_places(math.log(_SMALLEST * size), end)]
    else:
        places = _places(math.log(begin), end)
    if places:
        yield focus, places
    if math.isfinite(room):
        saddle = _stage(group, Way.TO_SADDLE, group.limits[0 if mirrored else 1], mirrored=mirrored)
        start = -math.log(0.5 * room)
        if not math.isnan(begin) and begin > 0.5 * room:
            start = -math.log(max(room - begin, 2.0 * NEAREST * room))
        yield saddle, _places(start, -math.log(NEAREST * room))


def _places(low: float, high: float) -> list[float]:
    """Return places at equal steps of one or somewhat less; none if there is no room."""
    if not low < high:
        return []
    count = math.ceil((high - low) / _STEP)
    return [low + (high - low) * k / count for k in range(count)] + [high]


def _at_loop(scans: list[Scan]) -> bool:
    """Tell whether an orbit at an end, as near to a saddle as they are followed, closes within rounding."""
    ends = []
    if scans and scans[0].stage.chart.way is Way.OVER_SADDLE:
        ends.append(min(scans[0].trials, key=lambda trial: trial.p))
    if scans and scans[-1].stage.chart.way is Way.TO_SADDLE and scans[-1].trials:
        ends.append(max(scans[-1].trials, key=lambda trial: trial.p))
    return any(end.landed and not end.sign for end in ends)

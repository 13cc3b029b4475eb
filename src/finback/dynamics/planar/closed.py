"""The search for closed orbits of a planar field: those that stand alone, and those that lie beside others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.planar.field import along_line
from finback.dynamics.planar.orbit import Line
from finback.dynamics.planar.return_map import ClosedOrbit, ReturnMap, Tried
from finback.dynamics.planar.setting import PlanarSetting
from finback.dynamics.roots import real_roots

_DIRECTIONS: Final = 24  # of the ray from an equilibrium; the one that the field crosses most plainly is taken
_EVEN: Final = 28  # places on a stretch of the ray that the field crosses in one sense
_NEAR: Final = 12  # more places towards the equilibrium, each so many times nearer:
_RATIO: Final = 0.4
_SECTIONS: Final = 60
_GOLDEN: Final = 0.381966011250105
_NARROW: Final = 1e-7  # relative: nearer to its minimum a miss changes by less than rounding
_PERIOD: Final = 1e-7  # relative: by how much periods of one cycle, found twice, may differ
_BAND: Final = 5  # neighboring places, evenly spread, whose orbits close: no cycle among them stands alone


@final
@dataclass(frozen=True, slots=True, eq=False)
class ClosedBand:
    """Orbits beside each other that are all closed within rounding: around a center, or around a loop about several.

    Attributes:
        ray: a half line from an equilibrium inside it.
        low: where the first of them crosses the ray, as far as it was tried; 0 at a center.
        high: where the last does.
        tried: how many were.
        miss: by how much one of them misses itself at most, relative to ``high``.
        periods: of the first and of the last that were tried.
        inner: whether they begin at the equilibrium.
    """

    ray: Line
    low: float
    high: float
    tried: int
    miss: float
    periods: tuple[float, float]
    inner: bool


@final
@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """The closed orbits of a field in a box: those that stand alone, and those that lie beside others."""

    isolated: tuple[ClosedOrbit, ...]
    bands: tuple[ClosedBand, ...]


def closed_orbits(setting: PlanarSetting, around: float = 1.0) -> Closed:
    """Find the closed orbits in the box, each once, by where they cross a ray from an equilibrium inside them.

    A closed orbit has an equilibrium that is no saddle inside it (Poincaré 1885), and crosses any ray from that. From
    each such equilibrium one ray is searched to the edge of the box: every change of the sign of the miss between 40
    places on each stretch that the field crosses in one sense, and two zeros between neighboring places if the miss
    has a minimum there. Where the orbits of five neighboring places, or of more, close within rounding, all between
    them are taken to be closed.

    Args:
        setting: the field.
        around: more than 1: rays are searched so many times as far, too, and orbits may leave the box.
    """
    found: list[ClosedOrbit] = []
    bands: list[ClosedBand] = []
    for stretch in (stretch for point in _centers(setting) for stretch in _stretches(setting, point, around)):
        places = [stretch.tried(float(along)) for along in _places(stretch)]
        bands += _bands(stretch, places)
        for low, high in _sign_changes(stretch, places):
            if any(stretch.ray == band.ray and low <= band.low and band.high <= high for band in bands):
                continue
            orbit = stretch.closed(low, high)
            if orbit is None or (around == 1.0 and not setting.holds(orbit.orbit.samples(8))):
                continue
            if not any(_same(orbit, other) for other in found):
                found.append(orbit)
    return Closed(tuple(found), tuple(bands))


def _centers(setting: PlanarSetting) -> list[tuple[float, float]]:
    return [
        (float(x), float(y))
        for (x, y), kind in zip(setting.points, setting.kinds, strict=True)
        if kind is not Kind.SADDLE and setting.holds(np.array([x, y]))
    ]


def _stretches(setting: PlanarSetting, point: tuple[float, float], around: float) -> Iterator[ReturnMap]:
    """Cut the best ray from a point where the field does not cross it."""
    _, ray, cuts, edge = min(_rays(setting, point, around), key=lambda item: item[0])
    a, b = ray.normal
    for low, high in pairwise(cuts):
        p, q = setting.field.flow.velocity(*ray.at(0.5 * (low + high)))
        yield ReturnMap(setting, ray, 1 if a * p + b * q > 0.0 else -1, low, high, edge, around)


def _rays(
    setting: PlanarSetting, point: tuple[float, float], around: float
) -> Iterator[tuple[tuple[int, float], Line, list[float], float]]:
    others = np.array([p for p in setting.points if tuple(p) != point]).reshape(-1, 2) - point
    for k in range(_DIRECTIONS):
        angle = 2.0 * math.pi * k / _DIRECTIONS
        direction = (math.cos(angle), math.sin(angle))
        reach = min(
            (side - at) / step if step else math.inf
            for at, step, sides in zip(point, direction, setting.box, strict=True)
            for side in [sides[1] if step > 0.0 else sides[0]]
        )
        ray = Line(point, direction, half=True)
        a, b = ray.normal
        rows = [along_line(table, point, direction) for table in (setting.field.flow.first, setting.field.flow.second)]
        across = a * rows[0] + b * rows[1]
        across[0] = 0.0
        if not across.any():
            continue
        zeros = [root.value for root in real_roots(across.tolist()) if 1e-9 * reach < root.value < around * reach]
        cuts = [0.0, *zeros, around * reach]
        turned = others @ np.array([[direction[0], a], [direction[1], b]])  # along the ray, across it
        clear = np.abs(turned[turned[:, 0] > 0.0, 1]).min(initial=1.0)
        yield (len(cuts), -float(clear)), ray, cuts, reach


def _places(stretch: ReturnMap) -> FloatArray:
    """Return places on a stretch, denser towards its ends, and more towards the equilibrium."""
    low, high, edge = stretch.low, stretch.high, stretch.edge
    shares = 0.5 * (1.0 - np.cos(math.pi * (np.arange(_EVEN) + 0.5) / _EVEN))
    places = low + ((edge if low < edge < high else high) - low) * shares
    if low == 0.0:
        places = np.concatenate([places[0] * _RATIO ** np.arange(_NEAR, 0, -1), places])
    if low < edge < high:  # a cycle may lie right at the edge, on either side
        places = np.concatenate([places, edge + (high - edge) * shares])
    return np.concatenate([places, [edge]]) if edge == high else places


def _bands(stretch: ReturnMap, places: list[Tried]) -> Iterator[ClosedBand]:
    """Yield runs of places whose orbits are closed within rounding.

    Near the equilibrium a weak focus turns in circles, too; but it does not go on so up to where orbits are lost.
    """
    near = _NEAR if stretch.low == 0.0 else 0
    for closed, run in groupby(enumerate(places), key=lambda item: item[1].outward == 0.0):
        members = list(run)
        inner = stretch.low == 0.0 and members[0][0] == 0
        after = members[-1][0] + 1
        lost = inner and after < len(places) and not math.isfinite(places[after].outward)
        if not closed or (len(members) if lost else sum(k >= near for k, _ in members)) < _BAND:
            continue
        first, last = members[0][1], members[-1][1]
        yield ClosedBand(
            stretch.ray,
            0.0 if inner else first.along,
            last.along,
            len(members),
            max(abs(one.miss) * one.along for _, one in members) / last.along,
            (first.period, last.period),
            inner,
        )


def _sign_changes(stretch: ReturnMap, places: list[Tried]) -> Iterator[tuple[float, float]]:
    values = [(one.along, one.outward) for one in places if one.outward]
    for (left, before), (right, after) in pairwise(values):
        if before * after < 0.0:
            yield left, right
    for one, two, three in zip(values, values[1:], values[2:], strict=False):
        signs = {math.copysign(1.0, value) for _, value in (one, two, three)}
        if len(signs) == 1 and abs(two[1]) <= min(abs(one[1]), abs(three[1])) and math.isfinite(two[1]):
            yield from _dip(stretch.outward, one, two, three)


def _dip(
    value: Callable[[float], float], one: tuple[float, float], two: tuple[float, float], three: tuple[float, float]
) -> Iterator[tuple[float, float]]:
    """Look whether the miss reaches the other sign at its smallest between three places."""
    sign = math.copysign(1.0, two[1])
    low, middle, high = one[0], two[0], three[0]
    least = abs(two[1])
    for _ in range(_SECTIONS):  # golden section; values may be infinite, where an orbit is lost
        right = high - middle > middle - low
        trial = middle + _GOLDEN * (high - middle if right else low - middle)
        value_there = sign * value(trial)
        if value_there < 0.0:
            yield one[0], trial
            yield trial, three[0]
            return
        if value_there < least:
            low, high = (middle, high) if right else (low, middle)
            middle, least = trial, value_there
        else:
            low, high = (low, trial) if right else (trial, high)
        if high - low < _NARROW * middle:
            return


def _same(one: ClosedOrbit, other: ClosedOrbit) -> bool:
    """Tell whether orbits found on the rays of two equilibria are one; on one ray they never are."""
    if one.ray == other.ray or one.log_multiplier * other.log_multiplier < 0.0:
        return False
    (low, high), (lower, higher) = ((s.min(axis=0), s.max(axis=0)) for s in (o.orbit.samples(32) for o in (one, other)))
    # The extremes of so many samples lie less than 1e-3 of the size inside the true ones.
    slack = 2e-3 * (high - low)
    if (np.abs(low - lower) > slack).any() or (np.abs(high - higher) > slack).any():
        return False
    period, another = abs(one.orbit.duration), abs(other.orbit.duration)
    return abs(period - another) < _PERIOD * period

"""Limit cycles of a planar system at a held parameter: period, stability, extremes, and how well they are known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.flow import derivative, horner
from finback.dynamics.linearity import intervals
from finback.dynamics.planar.closed import Closed, closed_orbits
from finback.dynamics.planar.orbit import Line, PlanarEnding, PlanarOrbit
from finback.dynamics.planar.return_map import ClosedOrbit, ReturnMap
from finback.dynamics.planar.setting import PlanarSetting, moved_setting, planar_setting
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.wedge import cycle_shift
from finback.errors import RefusedError

_PARTS: Final = 8  # of a piece, between which a state has one extreme at most
_NEWTON: Final = 60
_AROUND: Final = 2.0  # times the box: a cycle followed to other coefficients may leave it
_CLOSES: Final = 1e-9  # of its place on the ray: a cycle that was followed
_SHORTEST: Final = 2.0**-4  # of the way: one that needs shorter steps meets its neighbor nearby
_GREATEST: Final = 700.0  # its exponential is still a number


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCycle:
    """A limit cycle. Names and units of states and parameter are in ``system.variables``; time is in s.

    Attributes:
        parameter: held.
        period: once around.
        log_multiplier: ∫ divergence dt over one period; its exponential is the Floquet multiplier that is not 1.
        multiplier: that exponential; 0 or infinite where it leaves double precision.
        stable: whether it attracts, that is log_multiplier < 0.
        low: least value of each state, shape (2,).
        high: greatest value of each state, shape (2,).
        period_interval: 95 % interval by the delta method, shape (2,); infinite, like the others, where the number is
            not linear in the coefficients as far as their errors reach (``linearity``).
        log_multiplier_interval: the same, shape (2,).
        low_interval: the same for the least values, shape (2, 2), row i for state i.
        high_interval: the same for the greatest values.
        enclosed: the equilibria inside, shape (k, 2).
        bracket: two states between which it passes, whose orbits miss themselves on opposite sides, shape (2, 2).
        residual: by how much it misses itself after one turn, both states, as evaluated, shape (2,).
        orbit: states along it, in the order of time, shape (n, 2); the last is the first again.
        in_domain: whether all of it lies where data supported the system.
    """

    parameter: float
    period: float
    log_multiplier: float
    multiplier: float
    stable: bool
    low: FloatArray
    high: FloatArray
    period_interval: FloatArray
    log_multiplier_interval: FloatArray
    low_interval: FloatArray
    high_interval: FloatArray
    enclosed: FloatArray
    bracket: FloatArray
    residual: FloatArray
    orbit: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        names = ("low", "high", "period_interval", "log_multiplier_interval", "low_interval", "high_interval")
        for name in (*names, "enclosed", "bracket", "residual", "orbit"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def planar_cycles(system: PlanarSystem, parameter: float, box: ArrayLike) -> tuple[PlanarCycle, ...]:
    """Find the limit cycles that lie in a box, by rising period; orbits closed beside others (``center``) are none.

    Every closed orbit encloses an equilibrium that is no saddle and crosses any ray from it. One ray from each in the
    box is searched to the edge of the box, at 40 places on each stretch between tangencies, and at minima of the miss;
    two cycles nearer to each other than that are not seen, nor is a cycle within 2e-5 of the stretch from its center.

    Args:
        system: the system.
        parameter: held.
        box: low and high of both states, in SI, shape (2, 2).

    Raises:
        InputError: the box is none.
        RefusedError: equilibria cannot be found; a cycle cannot be told from its neighbor.
    """
    setting = planar_setting(system, parameter, box)
    return isolated_cycles(setting, closed_orbits(setting))


def isolated_cycles(setting: PlanarSetting, closed: Closed) -> tuple[PlanarCycle, ...]:
    """Measure the closed orbits that stand alone, by rising period."""
    found = [planar_cycle(setting, orbit) for orbit in closed.isolated]
    return tuple(sorted(found, key=lambda cycle: cycle.period))


def planar_cycle(setting: PlanarSetting, closed: ClosedOrbit) -> PlanarCycle:
    """Measure a closed orbit, in the units of the system."""
    system, units, orbit = setting.system, setting.units, closed.orbit
    shift = cycle_shift(setting, orbit)
    lows, highs, low_rows, high_rows = [], [], [], []
    for state in range(2):
        low, high = extremes(orbit, state)
        lows.append(low[2])
        highs.append(high[2])
        low_rows.append(shift.of_extreme(low, state))
        high_rows.append(shift.of_extreme(high, state))

    period, log_multiplier = abs(orbit.duration) * setting.scale.time, closed.log_multiplier
    time = setting.scale.time
    gradients = [shift.period * time, shift.log_multiplier]
    gradients += [row * unit for row, unit in zip((*low_rows, *high_rows), (*units, *units), strict=True)]
    stated = intervals(
        system,
        np.array([period, log_multiplier, *(lows * units), *(highs * units)]),
        np.array(gradients)[:, 1:],
        lambda changes: np.array([_followed(setting, closed, change) for change in changes]),
    )
    states = orbit.samples(_PARTS)[:: 1 if orbit.duration > 0.0 else -1]
    places = [closed.ray.at(along) for along in closed.bracket]
    return PlanarCycle(
        parameter=setting.parameter,
        period=period,
        log_multiplier=log_multiplier,
        multiplier=math.exp(log_multiplier) if log_multiplier < _GREATEST else math.inf,
        stable=log_multiplier < 0.0,
        low=np.array(lows) * units,
        high=np.array(highs) * units,
        period_interval=stated[0],
        log_multiplier_interval=stated[1],
        low_interval=stated[2:4],
        high_interval=stated[4:],
        enclosed=setting.points[[inside(states, point) for point in setting.points]] * units,
        bracket=np.array(places) * units,
        residual=closed.residual * np.array(closed.ray.direction) * units,
        orbit=states * units,
        in_domain=setting.supports(states),
    )


def _followed(setting: PlanarSetting, closed: ClosedOrbit, change: FloatArray) -> FloatArray:
    """Return period, multiplier's logarithm, least and greatest states of a cycle as θ changes; nan if it is lost."""
    along, orbit, share, step = closed.along, closed.orbit, 0.0, 1.0
    while share < 1.0:
        ahead = min(share + step, 1.0)
        try:
            along, orbit = _beside(setting, closed, along, ahead * change)
            share = ahead
        except RefusedError:
            step *= 0.5
            if step < _SHORTEST:
                return np.full(6, np.nan)
    ends = [extremes(orbit, state) for state in range(2)]
    states = np.array([[end[side][2] for end in ends] for side in (0, 1)]) * setting.units
    growth = math.copysign(float(orbit.growth()[-1]), float(orbit.growth()[-1]) * orbit.duration)
    return np.array([abs(orbit.duration) * setting.scale.time, growth, *states.ravel()])


def _beside(setting: PlanarSetting, closed: ClosedOrbit, along: float, change: FloatArray) -> tuple[float, PlanarOrbit]:
    """Return where a cycle near a place crosses its ray, from the moved equilibrium inside it, and the cycle.

    Raises:
        RefusedError: Newton's method does not come to a cycle.
    """
    center = int(np.argmin(np.linalg.norm(setting.points - closed.ray.point, axis=1)))
    there = moved_setting(setting, change, setting.parameter)
    x, y = there.points[center].tolist()
    ray = Line((x, y), closed.ray.direction, half=True)
    turns = ReturnMap(there, ray, closed.sense, 0.0, math.inf, math.inf, _AROUND)
    place, orbit = turns.settled(along, forward=closed.orbit.duration > 0.0)
    if orbit.ending is not PlanarEnding.SECTION or abs(orbit.hits[-1].along - place) > _CLOSES * place:
        raise RefusedError("a cycle could not be followed to other coefficients")
    return place, orbit


def extremes(orbit: PlanarOrbit, state: int) -> tuple[tuple[int, float, float], tuple[int, float, float]]:
    """Return (piece, time since it began, value) where a state is least, and where it is greatest."""
    values = orbit.samples(_PARTS)[:, state]
    return _extreme(orbit, state, int(values.argmin())), _extreme(orbit, state, int(values.argmax()))


def inside(states: FloatArray, point: FloatArray) -> bool:
    """Tell whether a closed curve, given by states along it, winds around a point."""
    x, y = (states - point).T
    turned = np.arctan2(x[:-1] * y[1:] - x[1:] * y[:-1], x[:-1] * x[1:] + y[:-1] * y[1:])
    return bool(abs(float(turned.sum())) > math.pi)


def _extreme(orbit: PlanarOrbit, state: int, index: int) -> tuple[int, float, float]:
    piece, part = divmod(min(index, len(orbit.spans) * _PARTS - 1), _PARTS)
    time = float(orbit.spans[piece]) * part / _PARTS
    # The extreme lies within a sample's distance: in this piece, or in a neighbor if the sample is at its end.
    for _ in range(3):
        series = orbit.series[piece, state].tolist()
        slope = derivative(series)
        bend = derivative(slope)
        for _ in range(_NEWTON):
            step = horner(slope, time) / (horner(bend, time) or math.inf)
            time -= step
            if abs(step) <= math.ulp(float(orbit.spans[piece])):
                break
        if time * orbit.spans[piece] < 0.0:
            piece = (piece - 1) % len(orbit.spans)
            time += float(orbit.spans[piece])
        else:
            break
    return piece, time, horner(series, time)

"""How far a branch that leaves a saddle of a planar field misses one that enters a saddle, on a section."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.orbit.melnikov import powered
from finback.dynamics.planar.manifold import PlanarManifold, SaddleFrame, planar_manifold, saddle_frame
from finback.dynamics.planar.orbit import NODES, PLACES, Hit, Line, PlanarEnding, PlanarOrbit, crossings
from finback.dynamics.planar.setting import PlanarSetting
from finback.dynamics.planar.wedge import pushes

_SHORT: Final = 0.4  # of the way from the saddle to the section: as far as the series of a branch is used
_TO_LEGENDRE: Final = np.linalg.inv(np.polynomial.legendre.legvander(PLACES, NODES - 1))


@final
@dataclass(frozen=True, slots=True)
class Pairing:
    """Which branches are compared, and where.

    Attributes:
        source: index of the saddle that is left.
        target: index of the saddle that is entered.
        around: index of the equilibrium behind which, seen from the source, the section is the half line; -1: the
            section is the perpendicular bisector of source and target.
        leaving: side (-1 or 1) of the unstable manifold.
        entering: side of the stable manifold.
        sense: of the crossing of the section, forward in time.
        turn: which crossing in that sense, counted from the source; for the target it is the last.
    """

    source: int
    target: int
    around: int
    leaving: int
    entering: int
    sense: int
    turn: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A branch of a manifold from the saddle to its crossings of a section.

    Attributes:
        manifold: whose branch.
        reach: s up to which the series serves; its sign tells the side.
        orbit: from there on, backward in time for a stable manifold.
    """

    manifold: PlanarManifold
    reach: float
    orbit: PlanarOrbit

    def hit(self, sense: int, turn: int) -> Hit | None:
        """Return the crossing of that number in that sense (as followed), if there is one."""
        hits = [hit for hit in self.orbit.hits if hit.sense == sense]
        return hits[turn - 1] if len(hits) >= turn else None


def section(setting: PlanarSetting, source: int, target: int, around: int) -> Line:
    """Return the section of a pairing."""
    one, two = setting.points[source], setting.points[around if around >= 0 else target]
    (x, y), length = two - one, math.dist(one, two)
    if around >= 0:
        return Line((float(two[0]), float(two[1])), (float(x / length), float(y / length)), half=True)
    middle = 0.5 * (one + two)
    # Turned so that an orbit from source to target crosses with sense +1.
    return Line((float(middle[0]), float(middle[1])), (float(y / length), float(-x / length)), half=False)


def pairings(setting: PlanarSetting, turns: int) -> tuple[Pairing, ...]:
    """Return all that can be compared: each ordered pair of saddles, each saddle around each other equilibrium."""
    saddles = [k for k, kind in enumerate(setting.kinds) if kind is Kind.SADDLE and setting.holds(setting.points[k])]
    others = [k for k, kind in enumerate(setting.kinds) if kind is not Kind.SADDLE and setting.holds(setting.points[k])]
    sections = [(one, two, -1, 1) for one in saddles for two in saddles if one != two]
    sections += [(one, one, other, sense) for one in saddles for other in others for sense in (-1, 1)]
    return tuple(
        Pairing(source, target, around, leaving, entering, sense, turn)
        for source, target, around, sense in sections
        for leaving in (-1, 1)
        for entering in (-1, 1)
        for turn in range(1, turns + 1)
    )


class Splittings:
    """The branches at one parameter, each followed once for all that are compared with it.

    Args:
        setting: the field.
        frames: vectors that direct the eigenvectors of each saddle, by index of the saddle, shape (2, 2) each.
        turns: how many crossings in one sense are looked at.
    """

    def __init__(self, setting: PlanarSetting, frames: dict[int, FloatArray], turns: int) -> None:
        self.setting = setting
        self._guides = frames
        self._turns = turns
        self._most = 2 * turns - 1
        self._frames: dict[int, SaddleFrame] = {}
        self._manifolds: dict[tuple[int, bool], PlanarManifold] = {}
        self._arms: dict[tuple[int, bool, int, Line], Arm] = {}

    def beside(self, setting: PlanarSetting, frames: dict[int, FloatArray]) -> Splittings:
        """Return the same for another setting of the same equilibria."""
        return Splittings(setting, frames, self._turns)

    def frame(self, saddle: int) -> SaddleFrame:
        """Return the linearization at a saddle."""
        if saddle not in self._frames:
            x, y = self.setting.points[saddle].tolist()
            self._frames[saddle] = saddle_frame(self.setting.field, (x, y), self._guides.get(saddle, np.eye(2)))
        return self._frames[saddle]

    def arms(self, pairing: Pairing) -> tuple[Arm, Arm]:
        """Return the branch that leaves and the one that enters."""
        line = section(self.setting, pairing.source, pairing.target, pairing.around)
        return (
            self._arm(pairing.source, pairing.leaving, line, stable=False),
            self._arm(pairing.target, pairing.entering, line, stable=True),
        )

    def value(self, pairing: Pairing) -> float:
        """Return the place of the one on the section less that of the other; nan where that says nothing."""
        leaving, entering = self.arms(pairing)
        line = section(self.setting, pairing.source, pairing.target, pairing.around)
        places = (_place(leaving, line, pairing.sense, pairing.turn), _place(entering, line, -pairing.sense, 1))
        return math.nan if math.isinf(places[0]) and math.isinf(places[1]) else places[0] - places[1]

    def _arm(self, saddle: int, side: int, line: Line, *, stable: bool) -> Arm:
        key = (saddle, stable, side, line)
        if key not in self._arms:
            if (saddle, stable) not in self._manifolds:
                self._manifolds[saddle, stable] = planar_manifold(self.frame(saddle), stable=stable)
            whole = self._manifolds[saddle, stable]
            reach = side * min(whole.radius, _SHORT * math.dist(whole.saddle, line.point))
            x, y = whole.at(reach)
            limits = self.setting.limits(forward=not stable)
            start = (float(x), float(y))
            orbit = crossings(self.setting.field, start, limits, forward=not stable, line=line, most=self._most)
            self._arms[key] = Arm(whole, reach, orbit)
        return self._arms[key]


def _place(arm: Arm, line: Line, sense: int, turn: int) -> float:
    """Return where a branch crosses; on a half line also 0 if it comes to rest at its end, infinite if it is lost."""
    hit = arm.hit(sense, turn)
    if hit is not None:
        return hit.along
    ending = arm.orbit.ending
    if not line.half or ending in (PlanarEnding.NOWHERE, PlanarEnding.SECTION):
        return math.nan
    if ending is PlanarEnding.TRAP and math.dist(arm.orbit.end, line.point) < 1.0:
        return 0.0
    return math.inf


def parameter_wedge(setting: PlanarSetting, pairing: Pairing, arms: tuple[Arm, Arm]) -> FloatArray:
    """Return how the splitting moves with the parameter and θ, shape (1 + p,), but for a common factor.

    Along a connection it is ∫ exp(−∫ div dt) f ∧ δf dt over all time (``planar_wedge``): on the orbits by
    Gauss-Legendre rules on their pieces; on the series, where f = λ s z'(s), the exponential is s to the power −div/λ
    at the saddle times a smooth function, by a Gauss-Jacobi rule.
    """
    total = np.zeros(1 + setting.system.covariance.shape[0])
    for arm, sign, turn in ((arms[0], 1, pairing.turn), (arms[1], -1, 1)):
        hit = arm.hit(sign * pairing.sense, turn)
        total += sign * (np.nan if hit is None else arm_wedge(setting, arm, arm.orbit.upto(hit)))
    return total


def arm_wedge(setting: PlanarSetting, arm: Arm, orbit: PlanarOrbit) -> FloatArray:
    """Return D of a branch (``planar_wedge``) at the end of an orbit along it that begins where the series ends."""
    with np.errstate(all="ignore"):  # an orbit too slow for double precision gives what is not finite
        weight, x, y, exponent = orbit.nodes()
        growth = orbit.growth()[-1]
        along = _wedge(setting, weight * np.exp(growth - exponent), (x, y), setting.field.velocity(x, y))
        return np.asarray(along + np.exp(growth) * _tail(setting, arm), dtype=np.float64)


def _wedge(
    setting: PlanarSetting,
    weight: FloatArray,
    states: tuple[FloatArray, FloatArray],
    rates: tuple[FloatArray, FloatArray],
) -> FloatArray:
    pushed = pushes(setting.system, setting.parameter, setting.scale, *states)
    wedge = rates[0][..., np.newaxis] * pushed[1] - rates[1][..., np.newaxis] * pushed[0]
    return np.asarray(np.tensordot(weight, wedge, weight.ndim), dtype=np.float64)


def _tail(setting: PlanarSetting, arm: Arm) -> FloatArray:
    whole, reach = arm.manifold, arm.reach
    at_saddle = whole.eigenvalue + whole.other_eigenvalue
    power = -at_saddle / whole.eigenvalue
    # What the divergence adds beyond the saddle's, as a polynomial in the share of the reach, by its values at nodes.
    shares = 0.5 * (PLACES + 1.0)
    excess = (setting.field.divergence(*whole.at(reach * shares)) - at_saddle) / (whole.eigenvalue * shares)
    primitive = np.polynomial.legendre.legint(_TO_LEGENDRE @ excess, lbnd=1.0)
    share, weights = powered(power)
    regular = np.exp(-0.5 * np.polynomial.legendre.legval(2.0 * share - 1.0, primitive))
    slopes = whole.series[1:] * np.arange(1, len(whole.series))[:, np.newaxis]
    dx, dy = np.polynomial.polynomial.polyval(reach * share, slopes)
    x, y = whole.at(reach * share)
    return _wedge(setting, reach * weights * regular, (x, y), (dx, dy))

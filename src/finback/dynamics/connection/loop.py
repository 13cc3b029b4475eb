"""Saddle loops and connections of a family: for each kind of orbit, the one λ at which it exists.

λ is a rotation parameter: as it rises, every unstable branch moves outward wherever it turns and every stable one
inward, so the splitting of each kind of orbit rises, and has one zero at most between the places where it jumps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind, eigenvalues, kind_of
from finback.dynamics.family import Family
from finback.dynamics.flow import Flow, Rest, derivative, horner
from finback.dynamics.orbit.melnikov import moments
from finback.dynamics.orbit.splitting import Field, Route, routes
from finback.dynamics.orbit.splitting_search import Joint, Search
from finback.dynamics.roots import real_roots
from finback.errors import InputError, RefusedError

_NO_GUESSES: Final[Mapping[Route, tuple[float, float]]] = MappingProxyType({})
_STEP: Final = 0.25  # of the fastest eigenvalue: how far apart the first two values of λ are
_TOLERANCE: Final = 1e-15
_ITERATIONS: Final = 200
_LINE: Final = 2  # points of a straight line
_DOUBT: Final = 0.1  # of the last term of an extrapolation: what it may be wrong by
_ROUNDING: Final = 1e-12  # of the size: a miss that rounding makes


class LoopKind(StrEnum):
    """Whether an orbit comes back to the saddle it leaves."""

    HOMOCLINIC = "homoclinic"
    HETEROCLINIC = "heteroclinic"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """An orbit from a saddle to a saddle.

    Attributes:
        kind: whether the two are one.
        route: the kind of orbit: which saddle (counted among all equilibria), to which side, how many turns.
        mu: the parameter at which it was looked for.
        lam: the λ at which it exists.
        from_x: the saddle it leaves.
        to_x: the saddle it enters.
        turns: where it crosses y = 0 on the way, shape (turns,).
        bracket: two λ at which the manifolds miss each other on opposite sides, shape (2,).
        residual: by how much they miss at ``lam``, as evaluated: of x at the last turn, or of y without a turn; of y
            on the last arc, where they come nearest, if that arc first draws orbits together and then spreads them (a
            canard). Infinite where another connection hides the orbit.
        saddle_trace: f + λ at the saddle it leaves. Of a homoclinic orbit: a cycle near it is stable where negative.
        to_trace: the same at the saddle it enters.
        resolved: whether the residual is one of rounding, λ is known to nine digits of the fastest eigenvalue, and it
            lies 1e-12 of that from all other connections of the same branches. Where another is as near, the orbit
            exists, but nearer to it than double precision can say; then ``lam`` and ``turns`` are those of the other.
    """

    kind: LoopKind
    route: Route
    mu: float
    lam: float
    from_x: float
    to_x: float
    turns: FloatArray
    bracket: FloatArray
    residual: float
    saddle_trace: float
    to_trace: float
    resolved: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("turns", "bracket"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LoopGradient:
    """How the λ of a loop moves with the coefficients (the Melnikov integral along the exact orbit).

    Attributes:
        by_damping: derivative by each coefficient of f, by rising power, shape (n_f,).
        by_force: derivative by each coefficient of g, shape (n_g,).
        by_mu: derivative by μ.
    """

    by_damping: FloatArray
    by_force: FloatArray
    by_mu: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("by_damping", "by_force"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSaddleCycle:
    """Two saddles connected both ways at once.

    Attributes:
        parameter: the third parameter, at which it exists.
        mu: the parameter that was held.
        lam: the λ at which it exists.
        left_x: one saddle.
        right_x: the other.
        bracket: two values of the third parameter at which the connections come in opposite order, shape (2,).
        residual: λ of the upper connection minus λ of the lower, as evaluated.
        ratio: product over both saddles of the contracting eigenvalue's size over the expanding one's; the cycle is
            stable from inside where it is above 1 (Cherkas 1968; Reyn 1980).
    """

    parameter: float
    mu: float
    lam: float
    left_x: float
    right_x: float
    bracket: FloatArray
    residual: float
    ratio: float

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket", frozen_array(self.bracket))


def loops(
    family: Family, mu: float, *, most_turns: int = 6, guesses: Mapping[Route, tuple[float, float]] = _NO_GUESSES
) -> tuple[Loop, ...]:
    """Find every saddle loop and connection at a fixed μ, by rising λ.

    With one equilibrium between saddles, or one saddle, these are all there are. With more there can be orbits that
    turn any number of times before they enter a saddle; those of up to ``most_turns`` are found.

    Args:
        family: the family.
        mu: the parameter.
        most_turns: how often an orbit may turn.
        guesses: for routes whose λ is known nearly, from a μ nearby: λ, and by how much it may be wrong. They save time
            and change nothing.

    Raises:
        InputError: ``most_turns`` is negative.
        RefusedError: two equilibria cannot be told apart; a branch could not be followed.
    """
    if most_turns < 0:
        raise InputError(f"most_turns = {most_turns}: a number of turns is 0 or more")
    rig = _Rig.at(family, mu)
    return tuple(rig.loop(joint) for joint in rig.search(guesses).joints(routes(rig.points, most_turns)))


def loops_along(family: Family, mus: Sequence[float], *, most_turns: int = 6) -> tuple[tuple[Loop, ...], ...]:
    """Find the loops at each μ of a row, as ``loops`` does, each search begun from those before it.

    Args:
        family: the family.
        mus: the parameter, in the order of the search; neighbors near each other save most.
        most_turns: how often an orbit may turn.

    Raises:
        InputError: ``most_turns`` is negative.
        RefusedError: two equilibria cannot be told apart; a branch could not be followed.
    """
    rows: list[tuple[Loop, ...]] = []
    for mu in mus:
        guesses = _foreseen(rows[-3:], mu)
        rows.append(loops(family, mu, most_turns=most_turns, guesses=guesses))
    return tuple(rows)


def _foreseen(rows: Sequence[tuple[Loop, ...]], mu: float) -> dict[Route, tuple[float, float]]:
    """Return of each route found at two or three μ what a straight line or parabola says at another, and the doubt."""
    seen: dict[Route, list[Loop]] = {}
    for row in rows:
        for loop in row:
            seen.setdefault(loop.route, []).append(loop)
    guesses = {}
    for route, known in seen.items():
        if len(known) < _LINE or len({loop.mu for loop in known}) < len(known):
            continue
        (last, before), earlier = known[:-3:-1], known[:-2]
        slope = (last.lam - before.lam) / (last.mu - before.mu)
        guess, doubt = last.lam + slope * (mu - last.mu), _DOUBT * abs(last.lam - before.lam)
        for first in earlier:
            bend = (slope - (before.lam - first.lam) / (before.mu - first.mu)) / (last.mu - first.mu)
            correction = bend * (mu - last.mu) * (mu - before.mu)
            guess, doubt = guess + correction, _DOUBT * abs(correction)
        if doubt > 0.0:
            guesses[route] = guess, doubt
    return guesses


def loop_gradient(family: Family, loop: Loop) -> LoopGradient:
    """Return how the λ of a loop of this family moves with every coefficient; nan where the integral overflows."""
    rig = _Rig.at(family, loop.mu)
    field = rig.field(loop.lam * rig.time)
    by_f, by_g = moments(field.flow, field.splitting(loop.route))
    damping = -by_f / by_f[0] * rig.length ** np.arange(by_f.size)
    force = -by_g / by_f[0] * rig.time * rig.length ** (np.arange(by_g.size) - 1.0)
    direction = np.zeros(force.size)
    direction[: len(family.direction)] = family.direction
    return LoopGradient(by_damping=damping, by_force=force, by_mu=float(force @ direction))


def two_saddle_cycle(family: Callable[[float], Family], mu: float, bracket: tuple[float, float]) -> TwoSaddleCycle:
    """Find where two neighboring saddles are connected both ways at one λ: a point in a third parameter.

    Args:
        family: the family at a value of the third parameter.
        mu: the μ held.
        bracket: two values of it between which the upper and the lower connection change their order.

    Raises:
        RefusedError: there are not two saddles with one equilibrium between them.
        InputError: the order is the same at both ends.
    """
    low, high = sorted(bracket)
    ends = [_order(family(end), mu) for end in (low, high)]
    if ends[0] * ends[1] > 0.0:
        raise InputError(
            f"the two connections come in the same order at {low} and {high}", hint="choose a wider bracket"
        )
    found = float(
        brentq(
            lambda p: _order(family(p), mu),
            low,
            high,
            xtol=_TOLERANCE * (high - low),
            rtol=4.0 * math.ulp(1.0),
            maxiter=_ITERATIONS,
        )
    )
    step = 4.0 * max(math.ulp(found), _TOLERANCE * (high - low))
    left, right = found - step, found + step
    while _order(family(left), mu) * _order(family(right), mu) > 0.0 and (left > low or right < high):
        step *= 4.0
        left, right = max(low, found - step), min(high, found + step)
    upper, lower = _connected(family(found), mu)
    rates = [
        eigenvalues(trace, -_slope(family(found), mu, x))[0]
        for trace, x in ((upper.saddle_trace, upper.from_x), (upper.to_trace, upper.to_x))
    ]
    return TwoSaddleCycle(
        parameter=found,
        mu=mu,
        lam=0.5 * (upper.lam + lower.lam),
        left_x=upper.from_x,
        right_x=upper.to_x,
        bracket=frozen_array((left, right)),
        residual=upper.lam - lower.lam,
        ratio=math.prod(-contracting / expanding for expanding, contracting in rates),
    )


def _order(family: Family, mu: float) -> float:
    upper, lower = _connected(family, mu)
    return upper.lam - lower.lam


def _connected(family: Family, mu: float) -> tuple[Loop, Loop]:
    """Return the connection with y > 0 and that with y < 0."""
    straight = loops(family, mu, most_turns=0)
    if len(straight) != 2:
        raise RefusedError(
            f"a two-saddle cycle needs two saddles side by side, and here are {len(straight)} connections"
        )
    upper = straight[0] if straight[0].route.side > 0 else straight[1]
    return upper, straight[1] if upper is straight[0] else straight[0]


def _slope(family: Family, mu: float, x: float) -> float:
    return horner(derivative(family.at(mu, 0.0).force), x)


@final
@dataclass(frozen=True, slots=True)
class _Rig:
    """A family at one μ in units of its own size, with its equilibria, which λ does not move."""

    mu: float
    length: float
    time: float
    flow: Flow
    points: tuple[Rest, ...]
    slopes: tuple[float, ...]

    @classmethod
    def at(cls, family: Family, mu: float) -> _Rig:
        plain = family.at(mu, 0.0)
        roots = real_roots(plain.force, magnitudes=plain.force_sizes)
        if not all(root.resolved for root in roots):
            raise RefusedError(f"at mu = {mu} two equilibria cannot be told apart in double precision")
        slope = derivative(plain.force)
        slopes = [horner(slope, root.value) for root in roots]
        fastest = max(map(abs, slopes), default=0.0)
        length = 0.5 * (roots[-1].value - roots[0].value) if len(roots) > 1 and fastest else 1.0
        time = fastest**-0.5 if len(roots) > 1 and fastest else 1.0
        scaled = plain.in_units(length, time)
        xs = tuple(root.value / length for root in roots)
        points = tuple(_rest(scaled, x, k * time * time) for x, k in zip(xs, slopes, strict=True))
        return cls(mu, length, time, scaled, points, tuple(k * time * time for k in slopes))

    def field(self, lam: float) -> Field:
        flow = Flow(
            damping=(self.flow.damping[0] + lam, *self.flow.damping[1:]),
            force=self.flow.force,
            force_sizes=self.flow.force_sizes,
        )
        points = (_rest(flow, point.x, slope) for point, slope in zip(self.points, self.slopes, strict=True))
        return Field.of(flow, tuple(points))

    def search(self, guesses: Mapping[Route, tuple[float, float]]) -> Search:
        """Begin where the trace vanishes on average."""
        xs = [point.x for point in self.points]
        average = sum(horner(self.flow.damping, x) for x in xs) / max(1, len(xs))
        scaled = {route: (lam * self.time, doubt * self.time) for route, (lam, doubt) in guesses.items()}
        return Search(field=self.field, samples=(-average,), unit=_STEP, wanted=lambda *_: True, guesses=scaled)

    def loop(self, joint: Joint) -> Loop:
        route = joint.route
        field = self.field(joint.parameter)
        source, target = (self.points[index].x for index in (route.source, route.target))
        traces = [horner(field.flow.damping, x) / self.time for x in (source, target)]
        miss, unit = joint.residual, self.length if route.turns else self.length / self.time
        if route.turns and _ROUNDING < abs(miss) < math.inf:
            least = field.least_miss(route)
            if abs(least) <= _ROUNDING:
                miss, unit = least, self.length / self.time
        return Loop(
            kind=LoopKind.HOMOCLINIC if route.source == route.target else LoopKind.HETEROCLINIC,
            route=route,
            mu=self.mu,
            lam=joint.parameter / self.time,
            from_x=source * self.length,
            to_x=target * self.length,
            turns=frozen_array([x * self.length for x in field.turning_points(route)]),
            bracket=frozen_array([end / self.time for end in joint.bracket]),
            residual=miss * unit,
            saddle_trace=traces[0],
            to_trace=traces[1],
            resolved=joint.resolved and abs(miss) <= _ROUNDING,
        )


def _rest(flow: Flow, x: float, slope: float) -> Rest:
    trace = horner(flow.damping, x)
    kind = Kind.SADDLE if slope > 0.0 else kind_of(trace, -slope)
    return Rest(x=x, kind=kind, eigenvalues_real=eigenvalues(trace, -slope)[0])

"""How a cycle moves with the coefficients of its flow: integrals along it, no difference quotients.

With v = (x', y') and δF a change of y', the wedge D = x' δy − y' δx obeys D' = f D + x' δF (Melnikov 1963), and the
cycle that remains is where D is periodic. The time a turn takes changes by −∮a' dt, where a is the displacement along
the orbit: a' = κ D + δF y'/|v|², κ = [(1 + f' x' + g') (x'² − y'²) + 2 f x' y'] / |v|⁴ (the deviation resolved along
and across v). ∮κ D dt is taken with the periodic solution of the adjoint equation ψ' = −f ψ − κ, once for all δF.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.polynomial import legendre, polynomial

from finback.arrays import FloatArray
from finback.dynamics.orbit.closure import Field
from finback.dynamics.orbit.taylor_kernel import ON_AXIS, ORDER, OUT_OF_STEPS, travel
from finback.errors import RefusedError

_COUNT: Final = 20
_RECORDED: Final = 400
_MOST_STRETCHES: Final = 50  # of so many steps, that are kept
_MOST_STRETCHES_AT_ALL: Final = 10_000
_LONGEST: Final = 1e6
_STIFF: Final = 15.0  # of ∫f dt over a turn: of a half that spreads orbits by more the end is better known than the way

_MEETS: Final = 1e-7  # of the size of a cycle: how far apart its halves may end


def _rules() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes and weights on (0, 1), and the matrix that integrates from 0 to each node."""
    nodes, weights = legendre.leggauss(_COUNT)
    basis = legendre.legvander(nodes, _COUNT - 1)
    primitives = np.stack([legendre.legval(nodes, legendre.legint(row, lbnd=-1)) for row in np.eye(_COUNT)], axis=1)
    return 0.5 * (nodes + 1.0), 0.5 * weights, 0.5 * primitives @ np.linalg.inv(basis)


NODES, _WEIGHTS, _INTEGRATE = _rules()
"""Gauss-Legendre nodes within a step, from 0 to 1; their weights; the integral from 0 to each."""
_POWERS: Final = np.vander(NODES, ORDER + 1, increasing=True).T
_PRIMITIVE_POWERS: Final = (_POWERS[:ORDER] * NODES) / np.arange(1, ORDER + 1)[:, np.newaxis]


@final
@dataclass(frozen=True, slots=True)
class HalfOrbit:
    """Half of a cycle from where it turns on the right, at nodes of every step; arrays of shape (pieces, nodes).

    Attributes:
        time: since the turn, negative backward.
        weight: of the nodes for an integral over time, negative backward.
        x: coordinate of the field.
        y: its rate.
        damped: ∫f dt from the turn.
        spans: the duration of each piece, shape (pieces,).
        series: rows x and y by rising power of time over the span, shape (pieces, 2, powers).
        landing: where it turns on the left.
        damping: ∫f dt of the whole half.
    """

    time: FloatArray
    weight: FloatArray
    x: FloatArray
    y: FloatArray
    damped: FloatArray
    spans: FloatArray
    series: FloatArray
    landing: float
    damping: float


def half_orbit(field: Field, right: float, *, forward: bool) -> HalfOrbit:
    """Follow half a turn of a cycle from its right end.

    Raises:
        RefusedError: it takes more steps than are kept.
    """
    stretches = []
    for stretch in half_stretches(field, right, forward=forward):
        stretches.append(stretch)
        if len(stretches) > _MOST_STRETCHES:
            raise RefusedError("a cycle takes too many steps for its intervals")
    if len(stretches) == 1:
        return stretches[0]
    names = ("time", "weight", "x", "y", "damped", "spans", "series")
    rows = {name: np.concatenate([getattr(stretch, name) for stretch in stretches]) for name in names}
    return HalfOrbit(landing=stretches[-1].landing, damping=stretches[-1].damping, **rows)


def half_stretches(field: Field, right: float, *, forward: bool) -> Iterator[HalfOrbit]:
    """Yield half a turn from one end of a cycle in stretches of some hundred steps, however many there are.

    Raises:
        RefusedError: it does not turn.
    """
    state = np.array([right, 0.0, 1.0 if forward else -1.0, 0.0, 0.0, 0.0, 0.0])
    limits = np.array([math.nan, _LONGEST, _RECORDED, 0.0])
    record = np.empty((_RECORDED, 4, ORDER + 1))
    time, damping = 0.0, 0.0
    for _ in range(_MOST_STRETCHES_AT_ALL):
        ending = travel(field.damping, field.force, state, limits, np.empty(1), record)
        count = int(state[6])
        spans = record[:count, 3, 0].copy()
        scaled = record[:count, :3] * spans[:, np.newaxis, np.newaxis] ** np.arange(ORDER + 1)
        values = scaled[:, :2] @ _POWERS
        f = scaled[:, 2, :ORDER]
        before = damping + np.concatenate([[0.0], np.cumsum(spans * (f @ (1.0 / np.arange(1, ORDER + 1))))])
        starts = time + np.concatenate([[0.0], np.cumsum(spans)])
        yield HalfOrbit(
            time=starts[:-1, np.newaxis] + spans[:, np.newaxis] * NODES,
            weight=spans[:, np.newaxis] * _WEIGHTS,
            x=values[:, 0],
            y=values[:, 1],
            damped=before[:-1, np.newaxis] + spans[:, np.newaxis] * (f @ _PRIMITIVE_POWERS),
            spans=spans,
            series=scaled[:, :2],
            landing=state.item(0),
            damping=before.item(-1),
        )
        if ending == ON_AXIS:
            return
        if ending != OUT_OF_STEPS:
            break
        time, damping = starts.item(-1), before.item(-1)
    raise RefusedError("an orbit does not turn where a cycle was found")


def cycle_halves(field: Field, ends: tuple[float, float], growth: float) -> tuple[HalfOrbit, HalfOrbit]:
    """Follow both halves of a cycle from its right end, forward and backward.

    Where the cycle is so strongly stable that backward from the right end nothing keeps near to it, that half is
    followed forward from the left end and turned round; where it is as strongly unstable, so is the other.

    Args:
        field: the flow in the coordinate of a chart.
        ends: where the cycle turns on the left and on the right, in that.
        growth: the logarithm of its multiplier.

    Raises:
        RefusedError: it takes more steps than are kept.
    """
    left, right = ends
    if abs(growth) <= _STIFF:
        with contextlib.suppress(RefusedError):  # along a canard a half does not come to the other end
            halves = half_orbit(field, right, forward=True), half_orbit(field, right, forward=False)
            if abs(halves[0].landing - halves[1].landing) <= _MEETS * (right - left):
                return halves
    stable = growth < 0.0
    easy, other = half_orbit(field, right, forward=stable), _reversed(half_orbit(field, left, forward=stable), left)
    return (easy, other) if stable else (other, easy)


def cycle_stretches(field: Field, ends: tuple[float, float], growth: float) -> Iterator[HalfOrbit]:
    """Yield a whole cycle in stretches, however many steps it takes, in the direction in which it attracts."""
    left, right = ends
    yield from half_stretches(field, right, forward=growth < 0.0)
    yield from half_stretches(field, left, forward=growth < 0.0)


def _reversed(half: HalfOrbit, start: float) -> HalfOrbit:
    """Return the same orbit followed the other way, from its end to its start."""
    duration = float(half.spans.sum())
    powers = half.series.shape[2]
    # (1 − s)^k by rising power of s: the series of a piece from its other end.
    turned = np.array([(polynomial.polypow([1.0, -1.0], k).tolist() + [0.0] * powers)[:powers] for k in range(powers)])
    return HalfOrbit(
        time=(half.time - duration)[::-1, ::-1],
        weight=-half.weight[::-1, ::-1],
        x=half.x[::-1, ::-1],
        y=half.y[::-1, ::-1],
        damped=(half.damped - half.damping)[::-1, ::-1],
        spans=-half.spans[::-1],
        series=half.series[::-1] @ turned,
        landing=start,
        damping=-half.damping,
    )


@final
@dataclass(frozen=True, slots=True)
class Variation:
    """Derivatives by the coefficients of f and g, by rising power, in the coordinate x of the flow.

    Attributes:
        x_min: by those of f, shape (n_f,), and of g, shape (n_g,).
        x_max: the same.
        period: the same.
        closing: of the miss of the orbit from a held start, up to a common positive factor.
    """

    x_min: tuple[FloatArray, FloatArray]
    x_max: tuple[FloatArray, FloatArray]
    period: tuple[FloatArray, FloatArray]
    closing: tuple[FloatArray, FloatArray]


def variation(field: Field, halves: tuple[HalfOrbit, HalfOrbit], right: float, sizes: tuple[int, int]) -> Variation:
    """Return how a cycle moves.

    Args:
        field: the flow in the coordinate of a chart.
        halves: the cycle, forward and backward from its right end.
        right: that end.
        sizes: how many coefficients f and g have.

    Returns:
        the derivatives; not finite where the multiplier leaves the range of double precision, or is 1.
    """
    ahead, behind = halves
    with np.errstate(all="ignore"):  # a multiplier beyond double precision gives what is not finite, as documented
        pushes = [_pushes(field, half, sizes) for half in halves]
        one, two = (half.damping for half in halves)
        weights = np.exp([one - max(one, two), two - max(one, two)])
        # The wedge at the right end and at the left end, periodic: D = exp(∫f) (D(0) + ∫ exp(−∫f) x' δF dt).
        gains = [
            (half.weight * np.exp(-half.damped) * half.y).ravel() @ push
            for half, push in zip(halves, pushes, strict=True)
        ]
        closing = weights[0] * gains[0] - weights[1] * gains[1]
        at_right = -closing / (weights[0] - weights[1])
        at_left = np.exp(one) * (at_right + gains[0])
        sign = -1.0 if field.mirrored else 1.0
        force = polynomial.polyval(np.array([right, ahead.landing]), field.force)
        ends = [-sign * at_right / force[0], -sign * at_left / force[1]]
        low, high = reversed(ends) if not field.mirrored else ends
        period = _period(field, (ahead, behind), pushes)
    cut = sizes[0]
    return Variation(*((row[:cut], row[cut:]) for row in (low, high, period, closing)))


def _pushes(field: Field, half: HalfOrbit, sizes: tuple[int, int]) -> FloatArray:
    """Return δF at the nodes for a unit change of each coefficient, shape (nodes, n_f + n_g)."""
    sign = -1.0 if field.mirrored else 1.0
    x, y = field.origin + sign * half.x.ravel(), half.y.ravel()
    powers = np.vander(x, max(sizes), increasing=True)
    return np.hstack([powers[:, : sizes[0]] * y[:, np.newaxis], sign * powers[:, : sizes[1]]])


def _period(field: Field, halves: tuple[HalfOrbit, HalfOrbit], pushes: list[FloatArray]) -> FloatArray:
    slopes = [polynomial.polyder(row) if row.size > 1 else np.zeros(1) for row in (field.damping, field.force)]
    rates, kappas, primitives, ends = [], [], [], []
    for half in halves:
        f = polynomial.polyval(half.x, field.damping)
        rate = f * half.y + polynomial.polyval(half.x, field.force)
        c = polynomial.polyval(half.x, slopes[0]) * half.y + polynomial.polyval(half.x, slopes[1])
        square = half.y**2 + rate**2
        kappa = ((1.0 + c) * (half.y**2 - rate**2) + 2.0 * f * half.y * rate) / square**2
        grown = np.exp(half.damped) * kappa
        totals = (half.weight * grown).sum(axis=1)
        before = np.concatenate([[0.0], np.cumsum(totals)])
        primitives.append(before[:-1, np.newaxis] + half.spans[:, np.newaxis] * (grown @ _INTEGRATE.T))
        ends.append(before[-1])
        rates.append(rate / square)
        kappas.append(kappa)
    shrunk = np.exp([-half.damping for half in halves])
    start = (shrunk[0] * ends[0] - shrunk[1] * ends[1]) / (shrunk[0] - shrunk[1])
    total = np.zeros(pushes[0].shape[1])
    for sign, half, push, rate, primitive in zip((1.0, -1.0), halves, pushes, rates, primitives, strict=True):
        adjoint = np.exp(-half.damped) * (start - primitive)
        total += sign * ((half.weight * (half.y * adjoint + rate)).ravel() @ push)
    return -total

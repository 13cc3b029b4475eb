"""A neighborhood of a sink from which no orbit escapes, by a quadratic Lyapunov function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, shifted
from finback.dynamics.roots import real_roots

_WEIGHTS: Final = (0.25, 1.0, 4.0)  # of the angle against the rate, about that of the frequency
_WIDEST: Final = 1e3  # units of the flow: where the function falls everywhere
_INSIDE: Final = 0.99  # of the half-width at which the function may cease to fall


@final
@dataclass(frozen=True, slots=True)
class Capture:
    """The ellipse p11 u² + 2 p12 u y + p22 y² < level around a sink, u = x − x_sink.

    Inside it the function falls along every orbit, so all of it belongs to the sink's stability region.
    """

    sink: float
    p11: float
    p12: float
    p22: float
    level: float

    @property
    def right(self) -> float:
        """The greatest x of the ellipse on y = 0."""
        return self.sink + math.sqrt(self.level / self.p11)

    def depth(self, x: FloatArray | float, y: FloatArray | float) -> FloatArray | float:
        """Return the Lyapunov function over its level: below 1 inside."""
        u = x - self.sink
        return (self.p11 * u * u + 2.0 * self.p12 * u * y + self.p22 * y * y) / self.level


def captures(flow: Flow, points: Sequence[Rest], *, forward: bool) -> tuple[Capture, ...]:
    """Return such an ellipse around each equilibrium that attracts forward, or backward, in time.

    Backward in time x' = y, y' = f y + g is x' = z, z' = −f z + g with z = −y: p12 changes its sign.
    """
    if forward:
        return tuple(capture(flow, point) for point in points if point.kind.stable)
    mirrored = replace(flow, damping=tuple(-c for c in flow.damping))
    repelling = [point for point in points if point.kind in (Kind.UNSTABLE_FOCUS, Kind.UNSTABLE_NODE)]
    return tuple(replace(found, p12=-found.p12) for found in (capture(mirrored, point) for point in repelling))


def capture(flow: Flow, sink: Rest) -> Capture:
    """Return the largest such ellipse among those of three shapes.

    P solves A'P + PA = −diag(w, 1) for the linearization A. With f = f(x_sink) + φ(u) and g = g'(x_sink) u + γ(u) the
    function V = (u, y) P (u, y)' falls at the rate −V' = w u² + y² − 2 (p12 u + p22 y) (φ y + γ), which is quadratic
    in y and positive for each u as long as its leading coefficient 1 − 2 p22 φ and its discriminant, over u², are: two
    polynomials in u, whose first root ends the ellipse.
    """
    f, g = shifted(flow.damping, sink.x), shifted(flow.force, sink.x)
    shapes = (_shape(sink.x, f, g, weight * -g[1]) for weight in _WEIGHTS)
    return max(shapes, key=lambda found: found.level / math.sqrt(found.p11 * found.p22 - found.p12 * found.p12))


def _shape(sink: float, f: list[float], g: list[float], weight: float) -> Capture:
    stiffness, damping = -g[1], -f[0]
    p12 = 0.5 * weight / stiffness
    p22 = (0.5 + p12) / damping
    p11 = damping * p12 + stiffness * p22
    bend_f, bend_g = [0.0, *f[1:]], [0.0, *g[2:]]  # φ(u), and γ(u)/u
    leading = _Terms.of(bend_f).times(-2.0 * p22).plus(_Terms.of([1.0]))
    lowest = _Terms.of(bend_g).times(-2.0 * p12).plus(_Terms.of([weight]))
    middle = _Terms.of(bend_f).times(p12).plus(_Terms.of(bend_g).times(p22))
    discriminant = leading.by(lowest).plus(middle.by(middle).times(-1.0))
    half = _INSIDE * min(leading.first_root(), discriminant.first_root(), _WIDEST)
    # The ellipse is as wide as half where p11 u² + 2 p12 u y + p22 y² is least over y.
    return Capture(sink, p11, p12, p22, half * half * (p11 - p12 * p12 / p22))


@final
@dataclass(frozen=True, slots=True)
class _Terms:
    """A polynomial by rising power, with the size of what each coefficient was summed from."""

    values: tuple[float, ...]
    sizes: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> _Terms:
        return cls(tuple(values), tuple(map(abs, values)))

    def times(self, factor: float) -> _Terms:
        return _Terms(tuple(factor * v for v in self.values), tuple(abs(factor) * s for s in self.sizes))

    def plus(self, other: _Terms) -> _Terms:
        length = max(len(self.values), len(other.values))
        return _Terms(
            *(tuple(map(sum, zip(_padded(a, length), _padded(b, length), strict=True))) for a, b in self._with(other))
        )

    def by(self, other: _Terms) -> _Terms:
        return _Terms(*(_product(a, b) for a, b in self._with(other)))

    def _with(self, other: _Terms) -> tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]:
        return (self.values, other.values), (self.sizes, other.sizes)

    def first_root(self) -> float:
        """Return the distance from 0 to where the sign may first change."""
        return min(
            (abs(end) for root in real_roots(self.values, magnitudes=self.sizes) for end in root.bracket),
            default=math.inf,
        )


def _padded(row: tuple[float, ...], length: int) -> tuple[float, ...]:
    return row + (0.0,) * (length - len(row))


def _product(left: tuple[float, ...], right: tuple[float, ...]) -> tuple[float, ...]:
    row = [0.0] * (len(left) + len(right) - 1)
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            row[i + j] += a * b
    return tuple(row)

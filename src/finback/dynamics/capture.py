"""A neighborhood of a sink from which no orbit escapes, by a quadratic Lyapunov function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, horner, shifted

_HALVINGS: Final = 200
_SHRINK: Final = 0.8


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
    """Return such an ellipse: the linear part falls at the rate u² + y², the rest is bounded to half of that.

    P solves A'P + PA = −I for the linearization A; the remainder of y', at most R r for a state of size r, adds
    2 |P e₂| R r², and r is chosen so that this is at most r²/2.
    """
    f, g = shifted(flow.damping, sink.x), shifted(flow.force, sink.x)
    stiffness, damping = -g[1], -f[0]
    p12 = 0.5 / stiffness
    p22 = (0.5 + p12) / damping
    p11 = damping * p12 + stiffness * p22
    push = 2.0 * math.hypot(p12, p22)
    rest_f, rest_g = [0.0, *map(abs, f[1:])], [0.0, *map(abs, g[2:])]
    radius = 1.0
    for _ in range(_HALVINGS):
        if push * (horner(rest_f, radius) + horner(rest_g, radius)) <= 0.5:
            break
        radius *= _SHRINK
    # The smaller eigenvalue of P, by the determinant, which does not cancel.
    larger = 0.5 * (p11 + p22) + math.hypot(0.5 * (p11 - p22), p12)
    return Capture(sink.x, p11, p12, p22, radius * radius * (p11 * p22 - p12 * p12) / larger)

"""Hopf, Bautin and Bogdanov-Takens points of the cubic system, exact in closed form for parameters of any size."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.hopf import Criticality
from finback.dynamics.normal_form.cubic import Cubic, outer_roots
from finback.dynamics.roots import real_roots

_ROUNDINGS: Final = 64.0 * sys.float_info.epsilon
"""An equilibrium, two coefficients moved there and two products: some 30 roundings, doubled."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CubicHopf:
    """An equilibrium that changes its stability as a0 moves.

    With r the amplitude of x the motion near it is r' = ½ (a0 − a0_H) r + first r³ + ….

    Attributes:
        x: the equilibrium.
        a0: the damping at the origin at which its trace vanishes.
        frequency: of the motion around it.
        first: first Lyapunov coefficient (Guckenheimer & Holmes 1983, Eq. 3.4.11), (a2 ω² + a1' b1')/(8 ω²) with a1',
            b1' about the equilibrium: positive is subcritical.
        criticality: its sign, if known.
        second: coefficient of r⁵ where the first vanishes, −5 a2 b2/(48 ω²); elsewhere of no meaning.
    """

    x: float
    a0: float
    frequency: float
    first: float
    criticality: Criticality
    second: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CubicBautin:
    """A Hopf point whose first Lyapunov coefficient vanishes, on the plane of (b0, a0) at given a1 and b1.

    From it a fold of cycles starts: for a positive second coefficient the outer one of two cycles is unstable, the
    inner one stable (b2 = 1: region II); for a negative one the other way round (b2 = −1).

    Attributes:
        x: the equilibrium.
        b0: linear force there.
        a0: damping at the origin there.
        frequency: of the motion around it.
        second: coefficient of r⁵ in the amplitude equation, −5 a2 b2/(48 ω²).
        lienard: A5 = a2 b2/(3 ω⁷), the same in the coordinates of Liénard and Cherkas (the paper's A5).
    """

    x: float
    b0: float
    a0: float
    frequency: float
    second: float
    lienard: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CubicBogdanovTakens:
    """Two equilibria meet and the trace vanishes: on the plane of (b0, a0) at given a1 and b1.

    Attributes:
        x: the equilibrium.
        b0: linear force there.
        a0: damping at the origin there.
        a: coefficient of u² in the force about it.
        b: coefficient of u in the damping about it; with a = 0 or b = 0 it is of higher codimension.
    """

    x: float
    b0: float
    a0: float
    a: float
    b: float

    @property
    def nondegenerate(self) -> bool:
        """Whether the unfolding in (b0, a0) is that of Bogdanov and Takens."""
        return self.a != 0.0 and self.b != 0.0


def cubic_hopf_points(cubic: Cubic) -> tuple[CubicHopf, ...]:
    """Return the Hopf points met as a0 moves, by rising x; the a0 of the system does not matter.

    For b2 = 1, b0 < 0 it is a0 = 0 at the origin: supercritical if and only if b0 < −a1 b1.
    """
    places = {0.0, *outer_roots(cubic)}
    return tuple(_hopf(cubic, x) for x in sorted(places) if cubic.moved(x).b0 < 0.0)


def _hopf(cubic: Cubic, x: float) -> CubicHopf:
    here = cubic.moved(x)
    square = -here.b0
    terms = (here.a2 * square, here.a1 * here.b1)
    size = abs(terms[0]) + (abs(cubic.a1) + 2.0 * abs(cubic.a2 * x)) * (abs(cubic.b1) + 3.0 * abs(cubic.b2 * x))
    excess = sum(terms)
    known = abs(excess) > _ROUNDINGS * size if x else excess != 0.0
    signed = Criticality.SUBCRITICAL if excess > 0.0 else Criticality.SUPERCRITICAL
    return CubicHopf(
        x=x,
        a0=-(cubic.a1 + cubic.a2 * x) * x + 0.0,  # not −0
        frequency=math.sqrt(square),
        first=excess / (8.0 * square),
        criticality=signed if known else Criticality.DEGENERATE,
        second=-5.0 * cubic.a2 * cubic.b2 / (48.0 * square),
    )


def cubic_bautin_points(cubic: Cubic) -> tuple[CubicBautin, ...]:
    """Return the Bautin points met as b0 and a0 move, by rising x; those of the system do not matter.

    At the origin b0 = a1 b1/a2, if that is negative (b0 = −a1 b1 in normal form); elsewhere x solves
    4 a2 b2 x² + (a2 b1 + 3 a1 b2) x + a1 b1 = 0, which is a2 ω² + a1' b1' = 0 with b0 = −(b2 x + b1) x.
    """
    a2, a1, b2, b1 = cubic.a2, cubic.a1, cubic.b2, cubic.b1
    places = []
    if a2 and a1 * b1 / a2 < 0.0:
        places.append((0.0, a1 * b1 / a2))
    condition = (a1 * b1, a2 * b1 + 3.0 * a1 * b2, 4.0 * a2 * b2)
    if any(condition):
        places += [(root.value, -(b2 * root.value + b1) * root.value) for root in real_roots(condition) if root.value]
    found = []
    for x, b0 in sorted(places):
        square = -b0 if x == 0.0 else -(b1 + 2.0 * b2 * x) * x
        if square > 0.0:
            found.append(
                CubicBautin(
                    x=x,
                    b0=b0,
                    a0=-(a1 + a2 * x) * x + 0.0,
                    frequency=math.sqrt(square),
                    second=-5.0 * a2 * b2 / (48.0 * square),
                    lienard=a2 * b2 / (3.0 * square**3.5),
                )
            )
    return tuple(found)


def cubic_bogdanov_takens_points(cubic: Cubic) -> tuple[CubicBogdanovTakens, ...]:
    """Return the Bogdanov-Takens points met as b0 and a0 move, by rising b0; those of the system do not matter.

    One is the origin at b0 = a0 = 0; the other is the double root x = −b1/(2 b2) at b0 = b1²/(4 b2). For b1 = 0 they
    are one point of higher codimension, the pitchfork with zero trace.
    """
    a2, a1, b2, b1 = cubic.a2, cubic.a1, cubic.b2, cubic.b1
    found = [CubicBogdanovTakens(x=0.0, b0=0.0, a0=0.0, a=b1, b=a1)]
    if b1 and b2:
        x = -b1 / (2.0 * b2)
        found.append(
            CubicBogdanovTakens(x=x, b0=b1 * b1 / (4.0 * b2), a0=-(a1 + a2 * x) * x, a=-0.5 * b1, b=a1 + 2.0 * a2 * x)
        )
    return tuple(sorted(found, key=lambda point: point.b0))

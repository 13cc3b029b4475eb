"""Number and nature of the equilibria of the cubic system (Shi & Fan 2013, section 3, and the case it leaves out)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import final

from finback.dynamics.normal_form.cubic import Cubic, outer_roots
from finback.dynamics.normal_form.nature import Nature, nature
from finback.errors import RefusedError


class CubicCase(StrEnum):
    """How the equilibria lie, for b2 > 0 (saddle cases) and b2 < 0 (well cases)."""

    ONE_SADDLE = "one-saddle"
    """b0 > b1²/4b2, or b0 = b1 = 0: the paper's statement 1"""
    SADDLE_AT_ORIGIN_MET = "origin-met"
    """b0 = 0 ≠ b1: the origin has met another equilibrium: statement 2"""
    OUTER_PAIR_MET = "outer-pair-met"
    """b0 = b1²/4b2 ≠ 0: the two others have met: statement 3"""
    BETWEEN_SADDLES = "between-saddles"
    """b0 < 0: the origin is a focus or node between two saddles: statement 4"""
    OUTER_SADDLE = "origin-outer-saddle"
    """0 < b0 < b1²/4b2: the origin is an outer saddle, the focus or node is the root nearer to it; not in the paper"""
    SINGLE_WELL = "single-well"
    """b2 < 0, one equilibrium, not a saddle"""
    WELL_AT_ORIGIN_MET = "well-origin-met"
    """b2 < 0, b0 = 0 ≠ b1: saddle and well have met at the origin"""
    CUSPIDAL = "cuspidal"
    """b2 < 0, b0 = b1²/4b2 ≠ 0: a saddle and a well have met beside the well at the origin"""
    DOUBLE_WELL = "double-well"
    """b2 < 0 < b0: the origin is a saddle between two wells"""
    OUTER_WELL = "origin-outer-well"
    """b2 < 0, b1²/4b2 < b0 < 0: the origin is one of two wells"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CubicEquilibrium:
    """One equilibrium.

    Attributes:
        x: where; y is 0.
        nature: the local phase portrait, degenerate ones included.
        trace: f(x).
        determinant: −g'(x).
    """

    x: float
    nature: Nature
    trace: float
    determinant: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CubicEquilibria:
    """All equilibria.

    Attributes:
        case: how they lie.
        points: by rising x; those that have met stand once.
    """

    case: CubicCase
    points: tuple[CubicEquilibrium, ...]


def cubic_equilibria(cubic: Cubic) -> CubicEquilibria:
    """Return all equilibria and their natures.

    What has met, and whether the trace vanishes there, is decided in rational arithmetic from the given coefficients;
    so is the sign of the trace at the origin. At equilibria that are irrational numbers the trace is as computed.

    Raises:
        RefusedError: b2 is zero.
    """
    if cubic.b2 == 0.0:
        raise RefusedError(
            "b2 is zero: there is no cubic force",
            hint="Quadratic holds it if a2 = 0, too; else rests(cubic.flow()) gives the equilibria",
        )
    case = _case(cubic)
    points = [_at_origin(cubic)]
    if cubic.discriminant == 0 and cubic.b0 != 0.0:
        points.append(_at_double_root(cubic))
    elif cubic.b1 != 0.0 or cubic.b0 != 0.0:
        points += [_simple(cubic, x) for x in outer_roots(cubic) if x != 0.0]
    return CubicEquilibria(case=case, points=tuple(sorted(points, key=lambda point: point.x)))


def _case(cubic: Cubic) -> CubicCase:
    wells = cubic.b2 < 0.0
    if cubic.b0 == 0.0:
        if cubic.b1 == 0.0:
            return CubicCase.SINGLE_WELL if wells else CubicCase.ONE_SADDLE
        return CubicCase.WELL_AT_ORIGIN_MET if wells else CubicCase.SADDLE_AT_ORIGIN_MET
    if cubic.discriminant < 0:
        return CubicCase.SINGLE_WELL if wells else CubicCase.ONE_SADDLE
    if cubic.discriminant == 0:
        return CubicCase.CUSPIDAL if wells else CubicCase.OUTER_PAIR_MET
    if wells:
        return CubicCase.DOUBLE_WELL if cubic.b0 > 0.0 else CubicCase.OUTER_WELL
    return CubicCase.BETWEEN_SADDLES if cubic.b0 < 0.0 else CubicCase.OUTER_SADDLE


def _at_origin(cubic: Cubic) -> CubicEquilibrium:
    return CubicEquilibrium(x=0.0, nature=nature(cubic.damping, cubic.force), trace=cubic.a0, determinant=-cubic.b0)


def _at_double_root(cubic: Cubic) -> CubicEquilibrium:
    a2, a1, a0, b2, b1 = map(Fraction, (cubic.a2, cubic.a1, cubic.a0, cubic.b2, cubic.b1))
    x = -b1 / (2 * b2)
    damping = ((a2 * x + a1) * x + a0, a1 + 2 * a2 * x, a2)
    force = (Fraction(0), Fraction(0), b1 + 3 * b2 * x, b2)
    return CubicEquilibrium(x=float(x), nature=nature(damping, force), trace=float(damping[0]), determinant=0.0)


def _simple(cubic: Cubic, x: float) -> CubicEquilibrium:
    here = cubic.moved(x)
    return CubicEquilibrium(x=x, nature=nature(here.damping, here.force), trace=here.a0, determinant=-here.b0)

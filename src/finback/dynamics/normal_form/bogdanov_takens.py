"""The unfolding of Bogdanov and Takens, Eq. 14 of Shi & Fan 2013: the quadratic system with a1 b2 ≠ 0.

x' = y, y' = μ1 + μ2 y + a x² + b x y about the fold of the equilibria (Guckenheimer & Holmes 1983, section 7.3). The
saddle-node, the Hopf point and where they meet are exact; the homoclinic loop is an estimate here, and exact among the
loops of ``Unfolding.family()``. There is one limit cycle at most (Bogdanov 1975), between the Hopf point and the loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import Final, final

from finback.dynamics.family import Family
from finback.dynamics.first_order.estimate import Estimate, estimate_in_eps
from finback.dynamics.flow import Flow
from finback.dynamics.hopf import Criticality
from finback.dynamics.normal_form.nature import Nature, nature
from finback.dynamics.normal_form.quadratic import Quadratic, QuadraticCase
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.errors import InputError

_FIRST: Final = 10.0 / 7.0
_SECOND: Final = 288.0 / 2401.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class QuadraticHopf:
    """An equilibrium whose trace vanishes at a value of μ2.

    Attributes:
        x: the focus, from the fold.
        mu2: where.
        frequency: of the motion around it.
        first: first Lyapunov coefficient a b/(8 ω²), with r' = first r³ for the amplitude r of x.
        criticality: its sign; never degenerate.
    """

    x: float
    mu2: float
    frequency: float
    first: float
    criticality: Criticality


class BogdanovTakensRegion(StrEnum):
    """What the plane of (μ1, μ2) is divided into; the last two only by the loop, estimated or exact."""

    NO_EQUILIBRIUM = "no-equilibrium"
    SINK = "sink"
    """a saddle and a sink, no cycle"""
    SOURCE = "source"
    """a saddle and a source, no cycle"""
    CYCLE = "cycle"
    """a saddle and one limit cycle, around a sink if it is unstable, around a source if it is stable"""
    BORDER = "border"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Unfolding:
    """x' = y, y' = μ1 + μ2 y + a x² + b x y, numbers without a unit.

    Attributes:
        mu1: constant force.
        mu2: constant damping.
        a: quadratic force, not 0.
        b: slope of the damping, not 0.
    """

    mu1: float
    mu2: float
    a: float = 1.0
    b: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is not finite, and the degenerate cases."""
        if not all(map(math.isfinite, (self.mu1, self.mu2, self.a, self.b))):
            raise InputError(f"the coefficients of an unfolding must be finite: {self}")
        if self.a == 0.0 or self.b == 0.0:
            raise InputError(f"a = {self.a}, b = {self.b}: both must not vanish", hint="see quadratic_center")

    def flow(self) -> Flow:
        """Return the field; ``rests`` gives its equilibria."""
        return self.family().at(self.mu1, self.mu2)

    def family(self) -> Family:
        """Return the systems with these a and b: μ = μ1 and λ = μ2."""
        return Family(damping=(0.0, self.b), force=(0.0, 0.0, self.a), direction=(1.0,))

    def normal(self) -> tuple[Unfolding, Rescaling]:
        """Return the same system with a = b = 1, and the coordinates in which it is so; b/a < 0 reverses time."""
        a, b = self.a, self.b
        scaled = Unfolding(mu1=self.mu1 * b * b / a * (b / a) ** 2, mu2=self.mu2 * b / a)
        return scaled, Rescaling(length=a / b / b, time=b / a)


def unfolding(system: Quadratic) -> tuple[Unfolding, Rescaling]:
    """Return a quadratic system with a1 b2 ≠ 0 about its fold, and the shift that leads there.

    μ1 = b0 − b1²/(4 b2), μ2 = a0 − a1 b1/(2 b2), both without cancellation.

    Raises:
        InputError: a1 or b2 is zero.
    """
    if system.case is not QuadraticCase.BOGDANOV_TAKENS:
        raise InputError(f"a1 = {system.a1}, b2 = {system.b2}: both must not vanish", hint="see quadratic_center")
    x = -Fraction(system.b1) / (2 * Fraction(system.b2))
    mu2, mu1 = map(float, system.at_exactly(x))
    return Unfolding(mu1=mu1, mu2=mu2, a=system.b2, b=system.a1), Rescaling(shift=float(x))


def fold_nature(system: Unfolding) -> Nature:
    """Return what the double equilibrium at μ1 = 0 is: a saddle-node, or for μ2 = 0 the cusp."""
    return nature((system.mu2, system.b), (0.0, 0.0, system.a))


def hopf_point(system: Unfolding) -> QuadraticHopf:
    """Return the Hopf point at the μ1 of a system: μ2 = b sgn(a) √(−μ1/a), whatever its own μ2.

    It is subcritical for a b > 0, the unstable cycle existing for smaller μ2, else supercritical.

    Raises:
        InputError: there are no two equilibria.
    """
    size = _half_distance(system.mu1, system.a)
    square = 2.0 * abs(system.a) * size
    first = system.a * system.b / (8.0 * square)
    x = -math.copysign(size, system.a)
    return QuadraticHopf(
        x=x,
        mu2=-system.b * x,
        frequency=math.sqrt(square),
        first=first,
        criticality=Criticality.SUBCRITICAL if first > 0.0 else Criticality.SUPERCRITICAL,
    )


def homoclinic_estimate(system: Unfolding) -> Estimate:
    """Return the μ2 of the homoclinic loop at the μ1 of a system, to second order.

    For a = b = 1, μ1 = −4 ε⁴ and μ2 = (10/7) ε² + (288/2401) ε⁴ (the first term from Bogdanov 1975; the second
    agrees with Kuznetsov, Meijer, Al-Hdaibat & Govaerts 2014); at μ1 = −0.1 it is off by 2e-5.

    Raises:
        InputError: there are no two equilibria.
    """
    _half_distance(system.mu1, system.a)
    normal, _ = system.normal()
    square = 0.5 * math.sqrt(-normal.mu1)
    value = square * (_FIRST + square * _SECOND)
    return estimate_in_eps(
        value * system.a / system.b,
        eps=math.sqrt(square),
        order="O(eps^6), eps^4 = -mu1/4 with a and b scaled to 1",
    )


def region(system: Unfolding, loop_mu2: float) -> BogdanovTakensRegion:
    """Return what a system has, given the μ2 of the loop at its μ1 (exact, or the value of ``homoclinic_estimate``).

    Where there are no equilibria ``loop_mu2`` is not used.
    """
    if system.mu1 * system.a >= 0.0:
        return BogdanovTakensRegion.BORDER if system.mu1 == 0.0 else BogdanovTakensRegion.NO_EQUILIBRIUM
    hopf = hopf_point(system).mu2
    if system.mu2 in (hopf, loop_mu2):
        return BogdanovTakensRegion.BORDER
    if min(hopf, loop_mu2) < system.mu2 < max(hopf, loop_mu2):
        return BogdanovTakensRegion.CYCLE
    return BogdanovTakensRegion.SOURCE if system.mu2 > hopf else BogdanovTakensRegion.SINK


def _half_distance(mu1: float, a: float) -> float:
    if not mu1 * a < 0.0:
        raise InputError(f"at mu1 = {mu1} and a = {a} there are no two equilibria", hint="mu1 a must be negative")
    return math.sqrt(-mu1 / a)

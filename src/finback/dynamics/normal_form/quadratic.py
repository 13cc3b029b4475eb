"""The quadratic system of the paper (Shi & Fan 2013, Eq. 13-16) and its normal forms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import final

from finback.dynamics.family import Family
from finback.dynamics.flow import Flow
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.errors import InputError


class QuadraticCase(StrEnum):
    """The three cases, by what does not vanish."""

    BOGDANOV_TAKENS = "bogdanov-takens"
    """a1 b2 ≠ 0 (Eq. 14): the only one with limit cycles; see ``bogdanov_takens``"""
    CONSTANT_DIVERGENCE = "constant-divergence"
    """a1 = 0 ≠ b2 (Eq. 15): no limit cycle; see ``quadratic_center``"""
    LINEAR_FORCE = "linear-force"
    """b2 = 0 ≠ a1 (Eq. 16): no limit cycle; see ``quadratic_center``"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Quadratic:
    """x' = y, y' = (a1 x + a0) y + b2 x² + b1 x + b0 (Eq. 13), numbers without a unit.

    Attributes:
        a1: slope of the damping.
        a0: damping at x = 0.
        b2: quadratic force.
        b1: linear force.
        b0: constant force.
    """

    a1: float
    a0: float
    b2: float
    b1: float
    b0: float

    def __post_init__(self) -> None:
        """Refuse what is not finite, and a linear system."""
        if not all(map(math.isfinite, (self.a1, self.a0, self.b2, self.b1, self.b0))):
            raise InputError(f"the coefficients of a quadratic system must be finite: {self}")
        if self.a1 == 0.0 and self.b2 == 0.0:
            raise InputError(
                "a1 and b2 are both zero: the system is linear", hint="its only equilibrium decides: see kind_of"
            )

    @property
    def case(self) -> QuadraticCase:
        """Which of the three cases this is."""
        if self.b2 == 0.0:
            return QuadraticCase.LINEAR_FORCE
        return QuadraticCase.CONSTANT_DIVERGENCE if self.a1 == 0.0 else QuadraticCase.BOGDANOV_TAKENS

    def flow(self) -> Flow:
        """Return the field; ``rests`` gives its equilibria."""
        return self.family().at(self.b0, self.a0)

    def family(self) -> Family:
        """Return the systems with these a1, b2, b1: μ = b0 and λ = a0."""
        return Family(damping=(0.0, self.a1), force=(0.0, self.b1, self.b2), direction=(1.0,))

    def at_exactly(self, x: Fraction) -> tuple[Fraction, Fraction]:
        """Return f(x) and g(x) in rational arithmetic, where rounding must not decide a sign."""
        a1, a0, b2, b1, b0 = map(Fraction, (self.a1, self.a0, self.b2, self.b1, self.b0))
        return a1 * x + a0, (b2 * x + b1) * x + b0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class QuadraticNormalForm:
    """A quadratic system and the coordinates that make it simple.

    Attributes:
        case: which of the three.
        normal: in the new coordinates. Eq. 14: a1 = b2 = 1, b1 = 0, (b0, a0) = (μ1, μ2). Eq. 15: a1 = 0, b2 = 1,
            b1 = 0, (b0, a0) = (μ1, μ2). Eq. 16: a1 = 1, b2 = 0 and b1 = ±1, b0 = 0, a0 = μ/√|b1|; or, without
            linear force, b1 = 0, a0 = 0 and b0 = 1 or 0.
        rescaling: from the given coordinates to the new ones; its time is negative where they reverse it.
    """

    case: QuadraticCase
    normal: Quadratic
    rescaling: Rescaling


def quadratic_normal_form(system: Quadratic) -> QuadraticNormalForm:
    """Return the normal form of any quadratic system; ``rescaling.to_old`` leads back."""
    case = system.case
    if case is QuadraticCase.LINEAR_FORCE:
        rescaling = _linear_force_scale(system)
    else:
        shift = -system.b1 / (2.0 * system.b2)
        if case is QuadraticCase.BOGDANOV_TAKENS:
            a, b = system.b2, system.a1
            rescaling = Rescaling(length=a / b / b, time=b / a, shift=shift)
        else:
            rescaling = Rescaling(length=1.0 / system.b2, time=1.0, shift=shift)
    return QuadraticNormalForm(case=case, normal=_normal(system, case, rescaling), rescaling=rescaling)


def _normal(system: Quadratic, case: QuadraticCase, rescaling: Rescaling) -> Quadratic:
    """Return the new coefficients; those that are 0 or 1 by construction are exactly so."""
    if case is QuadraticCase.LINEAR_FORCE:
        center = -Fraction(system.b0) / Fraction(system.b1) if system.b1 else -Fraction(system.a0) / Fraction(system.a1)
    else:
        center = -Fraction(system.b1) / (2 * Fraction(system.b2))
    # What is left at the new origin may nearly cancel, and its sign decides: it is summed exactly.
    damping, force = system.at_exactly(center)
    a0 = float(damping) * rescaling.time
    b0 = float(force) * rescaling.time * rescaling.time / rescaling.length
    if case is QuadraticCase.BOGDANOV_TAKENS:
        return Quadratic(a1=1.0, a0=a0, b2=1.0, b1=0.0, b0=b0)
    if case is QuadraticCase.CONSTANT_DIVERGENCE:
        return Quadratic(a1=0.0, a0=a0, b2=1.0, b1=0.0, b0=b0)
    if system.b1:
        return Quadratic(a1=1.0, a0=a0, b2=0.0, b1=math.copysign(1.0, system.b1), b0=0.0)
    return Quadratic(a1=1.0, a0=0.0, b2=0.0, b1=0.0, b0=1.0 if system.b0 else 0.0)


def _linear_force_scale(system: Quadratic) -> Rescaling:
    if system.b1:
        rate = math.sqrt(abs(system.b1))
        return Rescaling(length=rate / system.a1, time=1.0 / rate, shift=-system.b0 / system.b1)
    time = 1.0 / math.cbrt(system.a1 * system.b0) if system.b0 else 1.0
    return Rescaling(length=1.0 / (system.a1 * time), time=time, shift=-system.a0 / system.a1)

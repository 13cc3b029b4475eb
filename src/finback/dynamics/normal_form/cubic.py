"""The cubic system of the paper (Shi & Fan 2013, Eq. 17-18), its symmetry, translation and normal form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import final

from finback.dynamics.family import Family
from finback.dynamics.flow import Flow
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.errors import InputError, RefusedError

MIRROR = Rescaling(length=-1.0)
"""(x, y, a1, b1) → −(x, y, a1, b1), which leaves the cubic system as it is."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cubic:
    """x' = y, y' = (a2 x² + a1 x + a0) y + (b2 x² + b1 x + b0) x (Eq. 17), numbers without a unit.

    The origin is an equilibrium with trace a0 and determinant −b0. Eq. 18 is a2 = −1, b2 = 1.

    Attributes:
        a2: quadratic damping.
        a1: linear damping.
        a0: damping at the origin.
        b2: cubic force.
        b1: quadratic force.
        b0: linear force.
    """

    a2: float = -1.0
    a1: float
    a0: float
    b2: float = 1.0
    b1: float
    b0: float

    def __post_init__(self) -> None:
        """Refuse what is not finite."""
        if not all(map(math.isfinite, (self.a2, self.a1, self.a0, self.b2, self.b1, self.b0))):
            raise InputError(f"the coefficients of a cubic system must be finite: {self}")

    @property
    def is_normal(self) -> bool:
        """Whether a2 = −1 and b2 is 1 or −1."""
        return self.a2 == -1.0 and abs(self.b2) == 1.0

    @property
    def damping(self) -> tuple[float, float, float]:
        """Coefficients of f by rising power."""
        return (self.a0, self.a1, self.a2)

    @property
    def force(self) -> tuple[float, float, float, float]:
        """Coefficients of g by rising power."""
        return (0.0, self.b0, self.b1, self.b2)

    @property
    def discriminant(self) -> Fraction:
        """b1² − 4 b2 b0, exactly: positive where there are two equilibria besides the origin."""
        return Fraction(self.b1) ** 2 - 4 * Fraction(self.b2) * Fraction(self.b0)

    def flow(self) -> Flow:
        """Return the field; ``rests`` gives its equilibria."""
        return self.family().at(self.b0, self.a0)

    def family(self) -> Family:
        """Return the systems with these a2, a1, b2, b1: μ = b0 and λ = a0."""
        return Family(damping=(0.0, self.a1, self.a2), force=(0.0, 0.0, self.b1, self.b2), direction=(0.0, 1.0))

    def rescaled(self, length: float, time: float) -> Cubic:
        """Return the system in other units; negative ones mirror the plane and reverse time."""
        return Cubic(
            a2=self.a2 * time * length * length,
            a1=self.a1 * time * length,
            a0=self.a0 * time,
            b2=self.b2 * (time * length) ** 2,
            b1=self.b1 * time * time * length,
            b0=self.b0 * time * time,
        )

    def mirrored(self) -> Cubic:
        """Return the system with x and y replaced by −x and −y."""
        return self.rescaled(-1.0, 1.0)

    def reversed(self) -> Cubic:
        """Return the system with t and y replaced by −t and −y: sinks and sources change places."""
        return self.rescaled(1.0, -1.0)

    def moved(self, x: float) -> Cubic:
        """Return the system with the origin at another equilibrium.

        Args:
            x: where g is zero; what g is there by rounding is dropped.
        """
        return Cubic(
            a2=self.a2,
            a1=self.a1 + 2.0 * self.a2 * x,
            a0=self.a0 + (self.a1 + self.a2 * x) * x,
            b2=self.b2,
            b1=self.b1 + 3.0 * self.b2 * x,
            b0=(self.b1 + 2.0 * self.b2 * x) * x if x else self.b0,  # g'(x), with g(x)/x = 0 taken off: no cancellation
        )


def outer_roots(cubic: Cubic) -> tuple[float, ...]:
    """Return the zeros of b2 x² + b1 x + b0, rising: equilibria besides (or again at) the origin.

    A double one stands once. Which case it is, is decided in rational arithmetic; no root cancels.
    """
    b2, b1, b0 = cubic.b2, cubic.b1, cubic.b0
    discriminant = cubic.discriminant
    if b2 == 0.0:
        return (-b0 / b1,) if b1 else ()
    if discriminant < 0:
        return ()
    if discriminant == 0:
        return (-b1 / (2.0 * b2),)
    sum_ = -b1 - math.copysign(math.sqrt(discriminant), b1)
    return tuple(sorted((sum_ / (2.0 * b2), 2.0 * b0 / sum_)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CubicNormalForm:
    """A cubic system and the coordinates that make it simple.

    Attributes:
        normal: in the new coordinates: a2 = −1, b2 = 1 or −1.
        rescaling: from the given coordinates to the new ones; its time is negative where a2 was positive.
    """

    normal: Cubic
    rescaling: Rescaling


def cubic_normal_form(cubic: Cubic) -> CubicNormalForm:
    """Return the same system with a2 = −1 and b2 = ±1, the origin where it is.

    T = −a2/|b2|, L = √|b2|/|a2|: sign(b2) cannot change, sign(a2) changes with the direction of time.

    Raises:
        RefusedError: a2 or b2 is zero; the hint tells which system this is.
    """
    if cubic.b2 == 0.0:
        raise RefusedError(
            "b2 is zero: there is no cubic force, and no such normal form",
            hint="with a2 = 0 it is a Quadratic" if cubic.a2 == 0.0 else "analyze it as a Family",
        )
    if cubic.a2 == 0.0:
        raise RefusedError(
            "a2 is zero: the damping is linear, and there is no such normal form", hint="analyze it as a Family"
        )
    force = abs(cubic.b2)
    rescaling = Rescaling(length=math.sqrt(force) / abs(cubic.a2), time=-cubic.a2 / force)
    scaled = cubic.rescaled(rescaling.length, rescaling.time)
    normal = Cubic(a2=-1.0, a1=scaled.a1, a0=scaled.a0, b2=math.copysign(1.0, cubic.b2), b1=scaled.b1, b0=scaled.b0)
    return CubicNormalForm(normal=normal, rescaling=rescaling)


def centered(cubic: Cubic) -> CubicNormalForm:
    """Return the normal form with the origin at the middle one of three equilibria.

    That is the focus or node between two saddles for b2 = 1 (which the paper obtains for 0 < b0 < b1²/4 by a
    "suitable translation"), and the saddle between two wells for b2 = −1. With fewer, the origin stays.

    Raises:
        RefusedError: a2 or b2 is zero.
    """
    form = cubic_normal_form(cubic)
    middle = middle_equilibrium(form.normal)
    return CubicNormalForm(normal=form.normal.moved(middle), rescaling=form.rescaling.then(Rescaling(shift=middle)))


def middle_equilibrium(cubic: Cubic) -> float:
    """Return the middle one of three equilibria, or 0 where there are not three."""
    others = outer_roots(cubic)
    if len(others) < 2 or cubic.b0 == 0.0:
        return 0.0
    return sorted((*others, 0.0))[1]

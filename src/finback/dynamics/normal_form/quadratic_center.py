"""The quadratic systems without limit cycles: Eq. 15 (a1 = 0) and Eq. 16 (b2 = 0) of Shi & Fan 2013.

What the paper calls their Hopf and homoclinic bifurcations is a center with a whole annulus of closed orbits at one
value of the parameter, and no closed orbit at any other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.normal_form.quadratic import Quadratic, QuadraticCase
from finback.errors import InputError, RefusedError


class ClosedOrbits(StrEnum):
    """Which closed orbits there are, and why."""

    ANNULUS_TO_LOOP = "annulus-to-loop"
    """Eq. 15, μ2 = 0 > μ1 b2: Hamiltonian; a center, closed orbits all around it, a homoclinic loop as their end"""
    CENTER = "center"
    """Eq. 16, μ = 0 > b1: reversible; a center, with closed orbits all around it"""
    NONE_CONSTANT_DIVERGENCE = "none-constant-divergence"
    """Eq. 15, μ2 ≠ 0: the divergence is the constant μ2 (Bendixson)"""
    NONE_MONOTONE = "none-monotone"
    """Eq. 16, μ ≠ 0: the first integral of μ = 0 changes one way along every orbit"""
    NONE_TO_SURROUND = "none-to-surround"
    """no equilibrium that a closed orbit could surround"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Center:
    """What such a system has.

    Attributes:
        mu1: constant force about the fold of the equilibria (Eq. 15), b0 − b1²/(4 b2); 0 for Eq. 16.
        mu2: damping that decides: a0 (Eq. 15), or μ = a0 − a1 b0/b1, the damping at the equilibrium (Eq. 16); nan for
            Eq. 16 without linear force.
        closed_orbits: which there are.
    """

    mu1: float
    mu2: float
    closed_orbits: ClosedOrbits


def center(system: Quadratic) -> Center:
    """Return what a quadratic system without limit cycles has; the deciding numbers are summed exactly.

    Raises:
        InputError: a1 b2 ≠ 0; that one has limit cycles.
    """
    if system.case is QuadraticCase.CONSTANT_DIVERGENCE:
        fold = -Fraction(system.b1) / (2 * Fraction(system.b2))
        mu1 = float(system.at_exactly(fold)[1])
        if system.a0 != 0.0:
            orbits = ClosedOrbits.NONE_CONSTANT_DIVERGENCE
        elif mu1 * system.b2 < 0.0:
            orbits = ClosedOrbits.ANNULUS_TO_LOOP
        else:
            orbits = ClosedOrbits.NONE_TO_SURROUND
        return Center(mu1=mu1, mu2=system.a0, closed_orbits=orbits)
    _check(system)
    if system.b1 == 0.0:
        return Center(mu1=0.0, mu2=math.nan, closed_orbits=ClosedOrbits.NONE_TO_SURROUND)
    mu = float(system.at_exactly(-Fraction(system.b0) / Fraction(system.b1))[0])
    if system.b1 > 0.0:
        orbits = ClosedOrbits.NONE_TO_SURROUND
    else:
        orbits = ClosedOrbits.CENTER if mu == 0.0 else ClosedOrbits.NONE_MONOTONE
    return Center(mu1=0.0, mu2=mu, closed_orbits=orbits)


def line_of_equilibria(system: Quadratic) -> bool:
    """Return whether every point of y = 0 is an equilibrium: Eq. 16 with b0 = b1 = 0.

    Orbits are then the parabolas y − (a1/2) x² − a0 x = constant.
    """
    return system.b2 == 0.0 and system.b1 == 0.0 and system.b0 == 0.0


def first_integral(system: Quadratic, x: FloatArray | float, y: FloatArray | float) -> FloatArray:
    """Return what is constant along the orbits where there is a center, at states x, y (broadcast).

    Eq. 15: H = y²/2 − b0 x − b1 x²/2 − b2 x³/3, with H' = μ2 y².
    Eq. 16 with linear force: V = u²/2 − ∫ y dy/(a1 y + b1) with u = x + b0/b1, and V' = −μ y²/(a1 y + b1); it is
    infinite on the line a1 y + b1 = 0, which is an orbit for μ = 0.
    Eq. 16 without force: y − (a1/2) x² − a0 x.

    Returns:
        the values, of the shape of x and y broadcast.

    Raises:
        InputError: a1 b2 ≠ 0.
        RefusedError: a constant force alone (b1 = 0 ≠ b0) has none in elementary functions.
    """
    place, speed = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if system.case is QuadraticCase.CONSTANT_DIVERGENCE:
        potential = place * (system.b0 + place * (0.5 * system.b1 + place * system.b2 / 3.0))
        return np.asarray(0.5 * speed * speed - potential)
    _check(system)
    if line_of_equilibria(system):
        return np.asarray(speed - place * (0.5 * system.a1 * place + system.a0))
    if system.b1 == 0.0:
        raise RefusedError("a constant force alone has no first integral in elementary functions")
    from_rest = place + system.b0 / system.b1
    ratio = system.a1 * speed / system.b1
    with np.errstate(divide="ignore"):
        # ∫ y dy/(a1 y + b1) from 0: a logarithm that is 0 at y = 0.
        kinetic = system.b1 / system.a1**2 * (ratio - np.log(np.abs(1.0 + ratio)))
    return np.asarray(0.5 * from_rest * from_rest - kinetic)


def _check(system: Quadratic) -> None:
    if system.case is QuadraticCase.BOGDANOV_TAKENS:
        raise InputError(
            f"a1 = {system.a1}, b2 = {system.b2}: this system has limit cycles", hint="see bogdanov_takens"
        )

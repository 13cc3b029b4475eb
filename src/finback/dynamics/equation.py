"""The reduced equation itself, term by term, in the layout of located objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.located import Estimate
from finback.units import quotient


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """x'' = f(x) x' + g(x) + c₁ δ + c₂ δ', where x is alpha and δ the elevator (Shi & Fan 2013, Eq. 36).

    Attributes:
        damping: coefficients of f by rising power of alpha, in 1/s per power of rad.
        force: coefficients of g by rising power, in rad/s² per power of rad.
        elevator_gain: c₁ in 1/s².
        elevator_rate_gain: c₂ in 1/s: a step of δ by D makes x' jump by c₂ D.
    """

    damping: tuple[Estimate, ...]
    force: tuple[Estimate, ...]
    elevator_gain: Estimate
    elevator_rate_gain: Estimate


def equation(system: LienardSystem) -> Equation:
    """Return the coefficients of a system, each with its 95 % interval."""
    return Equation(
        damping=_coefficients(system, system.damping, "1_s"),
        force=_coefficients(system, system.force, "rad_s2"),
        elevator_gain=Estimate(
            value=system.elevator_gain,
            unit="1_s2",
            interval=system.interval(system.elevator_gain, system.elevator_gain_sensitivity),
        ),
        elevator_rate_gain=Estimate(
            value=system.elevator_rate_gain,
            unit="1_s",
            interval=system.interval(system.elevator_rate_gain, system.elevator_rate_gain_sensitivity),
        ),
    )


def _coefficients(system: LienardSystem, curve: Curve, unit: str) -> tuple[Estimate, ...]:
    """Return the coefficients by rising power; a power without a term has the exact coefficient 0."""
    known = {
        int(power): system.interval(float(value), row)
        for power, value, row in zip(
            curve.polynomial.powers[:, 0], curve.polynomial.coefficients, curve.sensitivity, strict=True
        )
    }
    found = []
    for power, value in enumerate(curve.ascending.tolist()):
        interval = known.get(power, system.interval(0.0, 0.0 * system.elevator_gain_sensitivity))
        found.append(Estimate(value=value, unit=unit, interval=interval))
        unit = quotient(unit, "rad")
    return tuple(found)

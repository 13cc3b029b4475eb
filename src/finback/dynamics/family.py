"""Families of Liénard flows in two parameters, one of which turns the field everywhere the same way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import zip_longest
from typing import final

from finback.dynamics.flow import Flow, Scale
from finback.dynamics.lienard import LienardSystem
from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """x' = y, y' = (f(x) + λ) y + g(x) + μ d(x), numbers without a unit.

    λ leaves the equilibria where they are and turns the field one way at every point off y = 0 (a rotated family,
    Duff 1953): each position belongs to a closed orbit at one λ at most, and each loop exists at one λ.

    Attributes:
        damping: coefficients of f by rising power.
        force: coefficients of g by rising power.
        direction: coefficients of d by rising power.
    """

    damping: tuple[float, ...]
    force: tuple[float, ...]
    direction: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse rows that are empty or not finite."""
        for name in ("damping", "force", "direction"):
            row = getattr(self, name)
            if not row or not all(map(math.isfinite, row)):
                raise InputError(f"the {name} of a family needs one finite coefficient or more, got {row}")

    def at(self, mu: float, lam: float) -> Flow:
        """Return the flow at one place of the plane of parameters."""
        if not (math.isfinite(mu) and math.isfinite(lam)):
            raise InputError(f"a flow needs finite parameters, got mu = {mu}, lam = {lam}")
        rows = tuple(zip_longest(self.force, self.direction, fillvalue=0.0))
        return Flow(
            damping=(self.damping[0] + lam, *self.damping[1:]),
            force=tuple(g + mu * d for g, d in rows),
            force_sizes=tuple(abs(g) + abs(mu * d) for g, d in rows),
        )


def lienard_family(system: LienardSystem, scale: Scale) -> Family:
    """Return the family of a system, in units of ``scale``.

    μ is the elevator in rad; λ is a change of the trace, times ``scale.time_s``.

    Raises:
        RefusedError: the coefficients leave the range of double precision.
    """
    plain = Flow(
        damping=tuple(system.damping.ascending.tolist()),
        force=tuple(system.force.ascending.tolist()),
        force_sizes=tuple(map(abs, system.force.ascending.tolist())),
    )
    scaled = plain.in_units(scale.length_rad, scale.time_s)
    push = Flow(damping=(0.0,), force=(system.elevator_gain,), force_sizes=(abs(system.elevator_gain),))
    direction = push.in_units(scale.length_rad, scale.time_s).force
    return Family(damping=scaled.damping, force=scaled.force, direction=direction)

"""A Liénard system at a held elevator as a cubic system, and as its normal form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.dynamics.equilibrium import Equilibrium, equilibria
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.normal_form.cubic import Cubic, cubic_normal_form
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.errors import RefusedError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class HeldCubic:
    """A system at a held elevator, about one of its equilibria.

    Attributes:
        elevator_rad: the elevator.
        equilibrium: the one that the origin was moved to.
        cubic: in rad and s: x = alpha − alpha of the equilibrium, t in s.
        normal: in normal form, without units.
        rescaling: from (alpha in rad, dα/dt in rad/s, t in s) to the coordinates of ``normal``; where its time is
            negative, sinks of the system are sources of the normal form, and the other way round.
    """

    elevator_rad: float
    equilibrium: Equilibrium
    cubic: Cubic
    normal: Cubic
    rescaling: Rescaling


def held_cubic(system: LienardSystem, elevator_rad: float) -> HeldCubic:
    """Return a system at a held elevator about the middle one of its equilibria, or its only one.

    Raises:
        RefusedError: damping or force is of higher degree than the cubic system, or of lower (a2 or b2 is zero); or
            there are two equilibria, at a fold, where none is the middle one.
    """
    points = equilibria(system, elevator_rad)
    if len(points) not in (1, 3):
        raise RefusedError(
            f"there are {len(points)} distinct equilibria, so that none is the middle one",
            hint="name one: held_cubic_about",
        )
    return held_cubic_about(system, points[len(points) // 2])


def held_cubic_about(system: LienardSystem, equilibrium: Equilibrium) -> HeldCubic:
    """Return a system at a held elevator about one of its equilibria.

    Raises:
        RefusedError: damping or force is of higher degree than the cubic system, or of lower (a2 or b2 is zero).
    """
    damping, force = system.damping.ascending.tolist(), system.force.ascending.tolist()
    if any(damping[3:]) or any(force[4:]):
        raise RefusedError(
            f"damping of degree {len(damping) - 1} and force of degree {len(force) - 1} are more than quadratic and "
            "cubic",
            hint="the general tools (equilibria, connections, cycles) take any degree",
        )
    damping += [0.0] * (3 - len(damping))
    force += [0.0] * (4 - len(force))
    x = equilibrium.alpha_rad
    cubic = Cubic(
        a2=damping[2],
        a1=damping[1] + 2.0 * damping[2] * x,
        a0=(damping[2] * x + damping[1]) * x + damping[0],
        b2=force[3],
        b1=force[2] + 3.0 * force[3] * x,
        b0=(3.0 * force[3] * x + 2.0 * force[2]) * x + force[1],
    )
    form = cubic_normal_form(cubic)
    return HeldCubic(
        elevator_rad=equilibrium.elevator_rad,
        equilibrium=equilibrium,
        cubic=cubic,
        normal=form.normal,
        rescaling=Rescaling(shift=x).then(form.rescaling),
    )

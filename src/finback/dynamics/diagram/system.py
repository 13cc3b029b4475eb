"""The diagram of a Liénard system in physical units: the elevator against the trace (Shi & Fan 2013, Fig. 6)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramCurve, DiagramOptions, DiagramPoint
from finback.dynamics.diagram.diagram import diagram, natural_mu_range
from finback.dynamics.diagram.system_curve import OwnTrace, SystemCurve, SystemDiagram, SystemPoint
from finback.dynamics.family import lienard_family
from finback.dynamics.flow import Scale, natural_scale
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import real_roots
from finback.errors import InputError

_DEFAULT: Final = DiagramOptions()


def system_diagram(
    system: LienardSystem,
    elevator_range_rad: tuple[float, float] | None = None,
    *,
    options: DiagramOptions = _DEFAULT,
) -> SystemDiagram:
    """Find every curve of the plane (elevator, change of the trace), and the place of the system itself in it.

    A constant added to the damping leaves the equilibria where they are and moves all traces alike; the plane may be
    drawn over that constant (``trace_shift_1_s``) or over the trace that an equilibrium then has (``trace_1_s``, the
    a0 of Fig. 6). The system itself is at the shift 0, and its a0(δ) is ``own``.

    Args:
        system: the system.
        elevator_range_rad: low and high; None: around the folds.
        options: how densely.

    Raises:
        InputError: the elevator has no effect; the range is empty or not finite.
    """
    if system.elevator_gain == 0.0:
        raise InputError("the elevator has no effect on this system: there is no such plane")
    unscaled = lienard_family(system, Scale(length_rad=1.0, time_s=1.0))
    span = elevator_range_rad or natural_mu_range(unscaled)
    scale, _ = natural_scale(system, 0.5 * (span[0] + span[1]))
    plain = diagram(lienard_family(system, scale), span, options=options)
    # The system itself, at no shift, belongs into its plane.
    window = min(0.0, plain.lam_range.item(0)) / scale.time_s, max(0.0, plain.lam_range.item(1)) / scale.time_s
    return SystemDiagram(
        system=system,
        elevator_range_rad=frozen_array(span),
        trace_shift_range_1_s=frozen_array(window),
        curves=tuple(_curve(system, plain, curve, scale, window) for curve in plain.curves),
        points=tuple(_point(system, point, scale) for point in plain.points),
        own=tuple(_own(curve, scale) for curve in plain.of_kind(CurveKind.HOPF)),
        notes=plain.notes,
        plain=plain,
    )


def _curve(
    system: LienardSystem, plain: Diagram, curve: DiagramCurve, scale: Scale, window: tuple[float, float]
) -> SystemCurve:
    alpha = curve.x * scale.length_rad
    shift = curve.lam / scale.time_s
    if curve.kind.is_line:
        shift[[0, -1]] = window
    about = alpha if curve.kind.is_line else _about(system, plain, curve)
    return SystemCurve(
        kind=curve.kind,
        name=curve.name,
        elevator_rad=curve.mu,
        trace_shift_1_s=frozen_array(shift),
        trace_1_s=frozen_array(system.damping(about) + shift),
        alpha_rad=frozen_array(alpha),
        resolved=curve.resolved,
        in_domain=system.supports(alpha),
    )


def _about(system: LienardSystem, plain: Diagram, curve: DiagramCurve) -> FloatArray:
    """Return the equilibrium whose trace is drawn: the antisaddle inside the curve, or the middle one."""
    count = len(plain.cells[curve.cell].saddles)
    if len(curve.enclosed) != 1 and count % 2 == 0:
        return np.full(curve.mu.size, math.nan)
    index = curve.enclosed[0] if len(curve.enclosed) == 1 else count // 2
    return np.array([_equilibrium(system, elevator, index, count) for elevator in curve.mu.tolist()])


def _equilibrium(system: LienardSystem, elevator: float, index: int, count: int) -> float:
    """Return an equilibrium by its place among so many; where two have met there are fewer, and they are one."""
    force = system.force.ascending.tolist()
    sizes = [abs(c) for c in force]
    force[0] += system.elevator_gain * elevator
    sizes[0] += abs(system.elevator_gain * elevator)
    roots = real_roots(force, magnitudes=sizes)
    places = [root.value for root in roots for _ in range(1 if root.crossing or len(roots) == count else 2)]
    return places[index] if len(places) == count else math.nan


def _point(system: LienardSystem, point: DiagramPoint, scale: Scale) -> SystemPoint:
    alpha = point.x * scale.length_rad
    return SystemPoint(
        kind=point.kind,
        name=point.name,
        elevator_rad=point.mu,
        trace_shift_1_s=point.lam / scale.time_s,
        alpha_rad=alpha,
        bracket_rad=point.bracket,
        residual=point.residual,
        exact=point.exact,
        resolved=point.resolved,
        in_domain=bool(system.supports(alpha)),
    )


def _own(curve: DiagramCurve, scale: Scale) -> OwnTrace:
    """Return a0(δ): what the Hopf curve takes off the damping to make its trace zero."""
    return OwnTrace(
        elevator_rad=curve.mu,
        alpha_rad=frozen_array(curve.x * scale.length_rad),
        trace_1_s=frozen_array(-curve.lam / scale.time_s),
    )

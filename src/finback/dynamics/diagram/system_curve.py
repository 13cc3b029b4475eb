"""A two-parameter diagram of a Liénard system in physical units: the elevator and the trace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.diagram.curve import CurveKind, Diagram, PointKind
from finback.dynamics.lienard import LienardSystem


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SystemCurve:
    """One curve, by rising elevator; a line of constant elevator by rising shift.

    Attributes:
        kind: what happens on it.
        name: as in the diagram without units.
        elevator_rad: shape (n,).
        trace_shift_1_s: what must be added to the damping f of the system to be on the curve, shape (n,).
        trace_1_s: the trace a0 = f + shift that the equilibrium about which the plane is drawn has there, shape (n,):
            the antisaddle inside the curve, or the middle one; nan where there is none.
        alpha_rad: the place, as ``DiagramCurve.x``, shape (n,).
        resolved: as ``DiagramCurve.resolved``, shape (n,).
        in_domain: whether that angle lies where data supported the model, shape (n,).
    """

    kind: CurveKind
    name: str
    elevator_rad: FloatArray
    trace_shift_1_s: FloatArray
    trace_1_s: FloatArray
    alpha_rad: FloatArray
    resolved: NDArray[np.bool_]
    in_domain: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_rad", "trace_shift_1_s", "trace_1_s", "alpha_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for name in ("resolved", "in_domain"):
            flags = np.array(getattr(self, name), dtype=np.bool_)
            flags.setflags(write=False)
            object.__setattr__(self, name, flags)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SystemPoint:
    """A special point in physical units.

    Attributes:
        kind: what is special.
        name: as in the diagram without units.
        elevator_rad: where.
        trace_shift_1_s: where.
        alpha_rad: the place, as ``DiagramPoint.x``.
        bracket_rad: two elevators between which it lies, shape (2,).
        residual: as in the diagram without units.
        exact: whether it is no estimate.
        resolved: as there.
        in_domain: whether the angle lies where data supported the model.
    """

    kind: PointKind
    name: str
    elevator_rad: float
    trace_shift_1_s: float
    alpha_rad: float
    bracket_rad: FloatArray
    residual: float
    exact: bool
    resolved: bool
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket_rad", frozen_array(self.bracket_rad))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OwnTrace:
    """The trace a0(δ) of the system as it is, at one antisaddle, by rising elevator: the curve of the paper's Fig. 6.

    Attributes:
        elevator_rad: shape (n,).
        alpha_rad: the antisaddle, shape (n,).
        trace_1_s: f there, shape (n,).
    """

    elevator_rad: FloatArray
    alpha_rad: FloatArray
    trace_1_s: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_rad", "alpha_rad", "trace_1_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SystemDiagram:
    """The plane of (elevator, trace) of a Liénard system.

    Attributes:
        system: the system.
        elevator_range_rad: low and high, shape (2,).
        trace_shift_range_1_s: low and high of the window, shape (2,).
        curves: all curves.
        points: all special points.
        own: a0(δ) of the system itself, one for each strip between lines and each antisaddle there.
        notes: as in the diagram without units.
        plain: the diagram without units: μ is the elevator in rad, λ the shift times the unit of time.
    """

    system: LienardSystem
    elevator_range_rad: FloatArray
    trace_shift_range_1_s: FloatArray
    curves: tuple[SystemCurve, ...]
    points: tuple[SystemPoint, ...]
    own: tuple[OwnTrace, ...]
    notes: tuple[str, ...]
    plain: Diagram

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_range_rad", "trace_shift_range_1_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

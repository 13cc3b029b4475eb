"""Equilibria of a Liénard system at a held elevator: where they are, of what kind, how well known."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import final

from finback.arrays import FloatArray, frozen_array


class Kind(StrEnum):
    """What an equilibrium is, by the eigenvalues of its linearization."""

    STABLE_FOCUS = "stable-focus"
    STABLE_NODE = "stable-node"
    UNSTABLE_FOCUS = "unstable-focus"
    UNSTABLE_NODE = "unstable-node"
    SADDLE = "saddle"
    DEGENERATE = "degenerate"
    """an eigenvalue on the imaginary axis, as far as double precision can tell"""

    @property
    def stable(self) -> bool:
        """Whether both eigenvalues have negative real parts."""
        return self in (Kind.STABLE_FOCUS, Kind.STABLE_NODE)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """One equilibrium.

    Attributes:
        elevator_rad: the elevator, held.
        alpha_rad: the angle.
        q_rad_s: the pitch rate (dα/dt = 0, which is not q = 0).
        eigenvalues_real_1_s: real parts, shape (2,), the larger first.
        eigenvalues_imag_1_s: imaginary parts, shape (2,), the positive first.
        kind: by the eigenvalues.
        alpha_interval_rad: 95 % interval by the delta method, shape (2,); infinite at a degenerate equilibrium,
            where the angle moves as a square root.
        residual: g(alpha) + c₁ δ in rad/s², as evaluated.
        in_domain: whether the angle lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    eigenvalues_real_1_s: FloatArray
    eigenvalues_imag_1_s: FloatArray
    kind: Kind
    alpha_interval_rad: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("eigenvalues_real_1_s", "eigenvalues_imag_1_s", "alpha_interval_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

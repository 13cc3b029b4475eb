"""Saddle connections: elevators at which an unstable manifold of a saddle runs into a stable one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.flow import Scale, flow_at
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.melnikov import moments
from finback.dynamics.orbit.splitting import Splitting


class Direction(StrEnum):
    """Which way an orbit leaves."""

    RISING = "rising"
    """to larger angles: dα/dt > 0"""
    FALLING = "falling"
    """to smaller angles: dα/dt < 0"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Heteroclinic:
    """An orbit from one saddle to another.

    Attributes:
        elevator_rad: the elevator at which it exists.
        from_alpha_rad: the saddle that it leaves.
        to_alpha_rad: the saddle that it enters.
        turns_alpha_rad: where dα/dt is 0 on the way, shape (turns,); empty if it runs straight across.
        direction: whether alpha rises or falls as it leaves.
        elevator_interval_rad: 95 % interval by the delta method (Melnikov integral along the orbit), shape (2,).
        bracket_rad: two elevators at which the manifolds miss each other on opposite sides, shape (2,).
        residual_rad_s: by how much dα/dt of the two manifolds differs, halfway between the saddles, as evaluated. Of
            an orbit that turns, by how much alpha differs where it turns last, times the fastest eigenvalue.
        resolved: whether the bracket is narrow, and other connections are so far that their order is known.
        in_domain: whether the whole orbit lies at angles where data supported the model.
    """

    elevator_rad: float
    from_alpha_rad: float
    to_alpha_rad: float
    turns_alpha_rad: FloatArray
    direction: Direction
    elevator_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual_rad_s: float
    resolved: bool
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("turns_alpha_rad", "elevator_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Homoclinic:
    """An orbit that leaves a saddle, turns, and comes back to it.

    Attributes:
        elevator_rad: the elevator at which it exists.
        alpha_rad: the saddle.
        turn_alpha_rad: where it turns first.
        turns_alpha_rad: where it turns, shape (turns,): once around what lies on one side of the saddle, twice around
            all on both sides.
        direction: whether alpha rises or falls as it leaves.
        divergence_1_s: f at the saddle; a cycle inside, near the loop, is stable where it is negative.
        elevator_interval_rad: 95 % interval by the delta method (Melnikov integral along the orbit), shape (2,).
        bracket_rad: two elevators at which the manifolds miss each other on opposite sides, shape (2,).
        residual_rad: by how much the last turning points of the two manifolds differ, as evaluated; of an orbit whose
            last arc first draws others near and then throws them apart (a canard), by how much dα/dt differs where that
            is the least share of it, over the fastest eigenvalue.
        resolved: whether the bracket is narrow, and other connections are so far that their order is known.
        in_domain: whether the whole orbit lies at angles where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    turn_alpha_rad: float
    turns_alpha_rad: FloatArray
    direction: Direction
    divergence_1_s: float
    elevator_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual_rad: float
    resolved: bool
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("turns_alpha_rad", "elevator_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def elevator_gradient(system: LienardSystem, elevator_rad: float, joined: Splitting, scale: Scale) -> FloatArray:
    """Return the derivative by θ of the elevator of a connection, shape (p,): what keeps the splitting at zero.

    Args:
        system: the system.
        elevator_rad: the elevator of the connection.
        joined: its two branches there.
        scale: the units in which they were followed.

    Returns:
        the derivative; nan, not known, where the orbit is too slow for the integral in double precision.
    """
    length, time = scale.length_rad, scale.time_s
    by_f, by_g = moments(flow_at(system, elevator_rad, scale), joined)
    if not (np.isfinite(by_f).all() and np.isfinite(by_g).all()):
        return np.full(system.elevator_gain_sensitivity.shape, np.nan)
    push = by_g[0] * time * time / length
    moved = push * elevator_rad * system.elevator_gain_sensitivity
    for power, row in zip(system.damping.polynomial.powers[:, 0], system.damping.sensitivity, strict=True):
        moved = moved + by_f[power] * time * length**power * row
    for power, row in zip(system.force.polynomial.powers[:, 0], system.force.sensitivity, strict=True):
        moved = moved + by_g[power] * time * time * length ** (power - 1) * row
    return system.root_shift(moved, system.elevator_gain * push)

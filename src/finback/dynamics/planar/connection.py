"""Saddle connections of a planar system: where an orbit that leaves a saddle enters one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.linearity import BENT
from finback.dynamics.planar.setting import moved_setting
from finback.dynamics.planar.splitting import Arm, Pairing, Splittings, parameter_wedge
from finback.errors import RefusedError

_SAMPLES: Final = 8  # states on each piece and on each series


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarHeteroclinic:
    """An orbit from one saddle to another. Names and units are in ``system.variables``.

    Attributes:
        parameter: at which it exists.
        from_state: the saddle that it leaves, shape (2,).
        to_state: the saddle that it enters, shape (2,).
        parameter_interval: 95 % interval by the delta method (Melnikov integral along the orbit), shape (2,); infinite
            where the connection is not linear in the coefficients as far as their errors reach (``linearity``).
        bracket: two parameters at which the manifolds miss each other on opposite sides, shape (2,).
        residual: by how much they miss each other on the section, both states, as evaluated, shape (2,).
        orbit: states along it in the order of time, saddle to saddle, shape (n, 2).
        in_domain: whether all of it lies where data supported the system.
    """

    parameter: float
    from_state: FloatArray
    to_state: FloatArray
    parameter_interval: FloatArray
    bracket: FloatArray
    residual: FloatArray
    orbit: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("from_state", "to_state", "parameter_interval", "bracket", "residual", "orbit"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarHomoclinic:
    """An orbit that leaves a saddle and comes back to it. Names and units are in ``system.variables``.

    Attributes:
        parameter: at which it exists.
        state: the saddle, shape (2,).
        divergence: sum of the saddle's eigenvalues, 1/s; a cycle inside, near the loop, is stable where it is negative.
        parameter_interval: 95 % interval by the delta method (Melnikov integral along the orbit), shape (2,); infinite
            where the connection is not linear in the coefficients as far as their errors reach (``linearity``).
        bracket: two parameters at which the manifolds miss each other on opposite sides, shape (2,).
        residual: by how much they miss each other on the section, both states, as evaluated, shape (2,).
        orbit: states along it in the order of time, saddle to saddle, shape (n, 2).
        in_domain: whether all of it lies where data supported the system.
    """

    parameter: float
    state: FloatArray
    divergence: float
    parameter_interval: FloatArray
    bracket: FloatArray
    residual: FloatArray
    orbit: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "parameter_interval", "bracket", "residual", "orbit"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def planar_connection(
    splittings: Splittings, pairing: Pairing, bracket: tuple[float, float]
) -> PlanarHeteroclinic | PlanarHomoclinic:
    """Describe a connection, in the units of the system.

    Args:
        splittings: the branches at its parameter.
        pairing: which of them meet.
        bracket: two parameters around it.
    """
    setting = splittings.setting
    units, parameter = setting.units, setting.parameter
    arms = splittings.arms(pairing)
    hits = arms[0].hit(pairing.sense, pairing.turn), arms[1].hit(-pairing.sense, 1)
    ends = [arm.orbit.upto(hit).end for arm, hit in zip(arms, hits, strict=True) if hit is not None]
    wedge = parameter_wedge(setting, pairing, arms)
    with np.errstate(divide="ignore", invalid="ignore"):
        gradient = -wedge[1:] / wedge[0]
    states = np.concatenate(
        [_outward(arms[0], pairing.sense, pairing.turn), _outward(arms[1], -pairing.sense, 1)[::-1]]
    )
    source, target = (setting.points[index] * units for index in (pairing.source, pairing.target))
    interval = _interval(splittings, pairing, gradient)
    residual = (np.array(ends[0]) - ends[1]) * units
    supported = setting.supports(states)
    if pairing.source == pairing.target:
        return PlanarHomoclinic(
            parameter=parameter,
            state=source,
            divergence=sum(splittings.frame(pairing.source).eigenvalues) / setting.scale.time,
            parameter_interval=interval,
            bracket=frozen_array(bracket),
            residual=residual,
            orbit=states * units,
            in_domain=supported,
        )
    return PlanarHeteroclinic(
        parameter=parameter,
        from_state=source,
        to_state=target,
        parameter_interval=interval,
        bracket=frozen_array(bracket),
        residual=residual,
        orbit=states * units,
        in_domain=supported,
    )


def _interval(splittings: Splittings, pairing: Pairing, gradient: FloatArray) -> FloatArray:
    """Return the 95 % interval of the parameter; infinite if the connection is not near where the gradient foretells.

    With the coefficients of either end of the interval, the splitting must have opposite signs on both sides of that
    end, a fifth of a half-width away (``BENT``): the connection then lies between.
    """
    setting = splittings.setting
    system, parameter = setting.system, setting.parameter
    interval = system.interval(parameter, gradient)
    half = 0.5 * float(interval[1] - interval[0])
    if not (0.0 < half < np.inf):
        return interval
    change = system.covariance @ gradient * (NORMAL_95**2 / half)
    for sign in (1.0, -1.0):
        sides = []
        for off in (-BENT, BENT):
            try:
                there = moved_setting(setting, sign * change, parameter + (sign + off) * half)
                guides = {k: splittings.frame(k).eigenvectors for k in {pairing.source, pairing.target}}
                sides.append(splittings.beside(there, guides).value(pairing))
            except RefusedError:
                sides.append(np.nan)
        if not sides[0] * sides[1] < 0.0:
            return frozen_array([-np.inf, np.inf])
    return interval


def _outward(arm: Arm, sense: int, turn: int) -> FloatArray:
    series = np.stack(arm.manifold.at(arm.reach * np.arange(_SAMPLES) / _SAMPLES), axis=-1)
    hit = arm.hit(sense, turn)
    return series if hit is None else np.concatenate([series, arm.orbit.upto(hit).samples(_SAMPLES)])

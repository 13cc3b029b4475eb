"""Thrust of a fitted model: the mean of the flights, and whether one number stands for what they flew with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.model import PolynomialModel
from finback.identification.coefficient.model import CoefficientModel
from finback.identification.coefficient.track import SPEED_CHANNEL, STATES, Track
from finback.records import Condition


def mean_thrust_n(used: Sequence[Track]) -> float:
    """Return the mean thrust of all samples, in N: that of the airframe where no flight has its own."""
    thrust = np.concatenate([track.thrust_n for track in used])
    # Rounding of the mean must not touch a thrust that is constant.
    return float(thrust[0]) if (thrust == thrust[0]).all() else float(thrust.mean())


def unsteady_thrust(model: CoefficientModel, used: Sequence[Track]) -> tuple[str, ...]:
    """Warn where thrust varied by more than one number can stand for; empty where not.

    Judged is the reduction at the flights' mean airspeed and density: whether a thrust one standard deviation off the
    mean moves a coefficient out of its 95 % interval. Coefficients without an error of their own are not judged.
    """
    thrust = np.concatenate([track.thrust_n for track in used])
    deviation = float(thrust.std())
    if thrust.min() == thrust.max():
        return ()
    condition = Condition(
        airspeed_m_s=float(np.concatenate([track.states[:, STATES.index(SPEED_CHANNEL)] for track in used]).mean()),
        density_kg_m3=float(np.concatenate([track.density_kg_m3 for track in used]).mean()),
        gravity_m_s2=used[0].gravity_m_s2,
        altitude_m=0.0,
    )

    def at(thrust_n: float) -> PolynomialModel:
        return replace(model, airframe=replace(model.airframe, thrust_n=thrust_n)).reduced(condition)

    here = at(model.airframe.thrust_n)
    there = _labeled(at(model.airframe.thrust_n + deviation))
    errors = np.sqrt(np.diag(here.covariance)).tolist()
    moved = [
        label
        for (label, value), error in zip(_labeled(here).items(), errors, strict=True)
        if error > 0.0 and abs(there.get(label, 0.0) - value) > NORMAL_95 * error
    ]
    if not moved:
        return ()
    text = (
        f"thrust varied, {thrust.min():.5g} to {thrust.max():.5g} N: a reduction takes the mean, {thrust.mean():.5g} "
        f"N; one standard deviation more, {deviation:.4g} N, moves out of its 95 % interval: {', '.join(moved)}"
    )
    return (text,)


def _labeled(model: PolynomialModel) -> dict[str, float]:
    """Return coefficients by what they are called, in the order of the covariance."""
    return {
        f"{label} in {name}": value
        for name, polynomial in (("dα/dt", model.alpha_dot), ("dq/dt", model.q_dot))
        for label, value in zip(polynomial.labels(), polynomial.coefficients.tolist(), strict=True)
    }

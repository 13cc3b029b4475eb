"""How the air moves: gusts of first order, found by their likelihood, and what their uncertainty does to faults.

A record of some correlation times has met few gusts. Their strength and their time are then hardly known, and a bias
of a flow angle, which is told from the mean of the gusts alone, must not be stated as if they were: its error is
averaged over all gusts that are likely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from finback.arrays import FloatArray
from finback.identification.compatibility.fault import FLOW
from finback.identification.compatibility.flight_path import Disturbance
from finback.identification.compatibility.piece import Implied
from finback.identification.compatibility.problem import Guess, Problem

_GAIN: Final = 10.0
"""Of twice the log likelihood, beyond which the air is said to move: 9.2 comes by chance once in 100 (two numbers)."""
_TIMES_S: Final = (0.05, 30.0)
"""Within which a time is looked for: gusts that pass faster are noise at usual rates, slower ones a flight's bias."""
_USUAL: Final = (float(np.log(2.0)), float(np.log(4.0)))
"""Logarithms of the usual speed in m/s and time in s, each with a deviation of 1: two in three are within a factor of
2.7. Light and moderate turbulence have 1.5 and 3 m/s, and scales of 533 m pass in 4 s at 133 m/s (MIL-F-8785C, 3.7)."""
_STEP: Final = float(np.log(2.0))
"""Of the search: the first guess is right to a factor of some two."""
_NEAR: Final = 0.05  # of the logarithms: 5 % of a speed or a time
_LEVEL: Final = 0.2  # of twice the log likelihood: a fiftieth of what decides
_TRIES: Final = 30
"""Most searches are cut short by it, as each try costs a filter of all flights; the next one goes on from there."""
_LEAST_GUST: Final = 1e-3  # m/s
_KNOWN: Final = 0.05
"""Deviation of the logarithm of the time below which an average over it changes no error."""
_LOOK: Final = 0.4  # of the logarithms: how far the curvature of the likelihood is looked for
_LENGTHS: Final = (-2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
"""Deviations of the logarithm of the time at which faults are estimated: slow gusts are likelier than fast ones."""
_STRENGTHS: Final = (-1.2, 0.0, 1.2)
"""The same of the logarithm of the strength: weighed by a normal density, these spread by 0.84 of its deviation."""


def gusts(problem: Problem, at: Guess, seen: Sequence[Implied], noises: Disturbance, least: FloatArray) -> Disturbance:
    """Return the noises with the likeliest gusts, if these raise the likelihood enough.

    The likelihood is the restricted one: the freedom that faults and starts take from the residuals is counted
    (Patterson & Thompson 1971, Biometrika 58, 545), without which slow gusts would come out too small.

    Args:
        problem: pieces and faults.
        at: where its linearization is taken.
        seen: what the pieces should have measured there.
        noises: as they are known.
        least: variances of the white noise that is seen on each output, shape (outputs,): what is more than that may
            be gusts.
    """
    flow = np.isin(problem.pieces[0].outputs, FLOW)
    first_time = noises.gust_m_s == 0.0
    moving = replace(noises, noise=np.where(flow, least, noises.noise)) if first_time else noises

    def level(point: FloatArray) -> float:
        speed, time = _speed_and_time(point)
        if not _TIMES_S[0] <= time <= _TIMES_S[1]:
            return np.inf
        rows = problem.rows(at, seen, replace(moving, gust_m_s=speed, gust_s=time))
        return problem.misfit(rows, at.values) + _unlikely(point)

    still = problem.misfit(problem.rows(at, seen, replace(noises, gust_m_s=0.0)), at.values)
    first = _point(_speed_of_residuals(problem, seen), 1.0) if first_time else _point(noises.gust_m_s, noises.gust_s)
    found = minimize(
        level,
        first,
        method="Nelder-Mead",
        options={
            "initial_simplex": first + np.array([[0.0, 0.0], [_STEP, 0.0], [0.0, _STEP]]),
            "xatol": _NEAR,
            "fatol": _LEVEL,
            "maxfev": _TRIES,
        },
    )
    if still - (float(found.fun) - _unlikely(found.x)) < _GAIN:
        return noises if first_time else replace(noises, gust_m_s=0.0)
    speed, time = _speed_and_time(found.x)
    return replace(moving, gust_m_s=speed, gust_s=time)


def averaged(problem: Problem, at: Guess, seen: Sequence[Implied], noises: Disturbance) -> FloatArray:
    """Return the covariance of the faults over all gusts that are likely, shape (faults, faults).

    Of each pair of speed and time on a lattice the faults, their covariance and the likelihood are taken; the mean of
    the covariances, and the square of how far faults move, weighted by the likelihood, is what is not known of them.

    Args:
        problem: pieces and faults.
        at: the estimate.
        seen: what the pieces should have measured there.
        noises: with the likeliest gusts.
    """

    def tried(point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        speed, time = _speed_and_time(point)
        rows = problem.rows(at, seen, replace(noises, gust_m_s=speed, gust_s=time))
        step, covariance = problem.step(rows, at.values)
        return problem.misfit(rows, at.values) + _unlikely(point), step, covariance

    middle = _point(noises.gust_m_s, noises.gust_s)
    least, step, covariance = tried(middle)
    deviation = np.array(
        [_deviation(least, [tried(middle + sign * _LOOK * axis)[0] for sign in (-1.0, 1.0)]) for axis in np.eye(2)]
    )
    if deviation[1] < _KNOWN:
        return covariance
    found = [tried(middle + deviation * (a, b)) for b in _LENGTHS for a in _STRENGTHS]
    levels = np.array([level for level, _, _ in found])
    weight = np.exp(-0.5 * (levels - levels.min()))
    weight /= weight.sum()
    moved = np.array([one - step for _, one, _ in found])
    return np.asarray(np.tensordot(weight, np.array([one for _, _, one in found]), 1) + (moved.T * weight) @ moved)


def _deviation(middle: float, beside: Sequence[float]) -> float:
    """Return the deviation of a logarithm from minus twice the log likelihood at its estimate and beside; at most 1."""
    curvature = (sum(beside) - 2.0 * middle) / _LOOK**2
    return 1.0 / float(np.sqrt(max(0.5 * curvature, 1.0)))


def _point(speed_m_s: float, time_s: float) -> FloatArray:
    """Return logarithms of the speed of gusts over the root of their time, and of their time.

    The first is what a short record tells: how fast the air's velocity spreads.
    """
    return np.array([np.log(speed_m_s) - 0.5 * np.log(time_s), np.log(time_s)])


def _speed_and_time(point: FloatArray) -> tuple[float, float]:
    rough, time = point.tolist()
    return float(np.exp(rough + 0.5 * time)), float(np.exp(time))


def _unlikely(point: FloatArray) -> float:
    """Return minus twice the logarithm of how usual such gusts are."""
    rough, time = point.tolist()
    return float((rough + 0.5 * time - _USUAL[0]) ** 2 + (time - _USUAL[1]) ** 2)


def _speed_of_residuals(problem: Problem, seen: Sequence[Implied]) -> float:
    """Return the air's velocity that would explain the flow's residuals, about."""
    speeds = []
    for piece, found in zip(problem.pieces, seen, strict=True):
        speed = np.linalg.norm(found.path.velocity_m_s, axis=1)
        for k, name in enumerate(piece.outputs):
            if name in FLOW and np.isfinite(found.residual[:, k]).any():
                left = found.residual[:, k] * (speed if name != "airspeed_m_s" else 1.0)
                speeds.append(float(np.nanstd(left)))
    return max(0.5 * float(np.median(speeds)), _LEAST_GUST)

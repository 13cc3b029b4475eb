"""How the air moves: gusts of first order, found by their likelihood, and what their uncertainty does to faults.

A record of some correlation times has met few gusts. Their strength and their time are then hardly known, and a bias
of a flow angle, which is told from the mean of the gusts alone, must not be stated as if they were: its error is
averaged over all gusts that are likely.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.stats import chi2

from finback.arrays import FloatArray
from finback.identification.compatibility.fault import FLOW
from finback.identification.compatibility.flight_path import Disturbance
from finback.identification.compatibility.piece import Implied
from finback.identification.compatibility.problem import Guess, Problem

AXES: Final[Mapping[str, int]] = MappingProxyType({"airspeed_m_s": 0, "beta_rad": 1, "alpha_rad": 2})
"""Which component of the air's velocity, along body axes, a channel of the flow shows."""
_CHANCE: Final = 0.01
"""Of a gain of likelihood as large in still air, below which the air is said to move."""
_TIMES_S: Final = (0.05, 30.0)
"""Within which a time is looked for: gusts that pass faster are noise at usual rates, slower ones a flight's bias."""
_USUAL: Final = (float(np.log(2.0)), float(np.log(4.0)))
"""Logarithms of the usual speed in m/s and time in s, each with a deviation of 1: two in three are within a factor of
2.7. Light and moderate turbulence have 1.5 and 3 m/s, and scales of 533 m pass in 4 s at 133 m/s (MIL-F-8785C, 3.7)."""
_ALIKE: Final = float(np.log(2.0))
"""Deviation of the logarithm of one component's strength from the mean of all: air of one strength everywhere is usual,
but near the ground it is not, and an airspeed may be filtered until it shows no gusts at all."""
_STEP: Final = float(np.log(2.0))
"""Of the search: the first guess is right to a factor of some two."""
_NEAR: Final = 0.05  # of the logarithms: 5 % of a speed or a time
_LEVEL: Final = 0.2  # of twice the log likelihood: a fiftieth of what decides
_TRIES: Final = 12
"""For each number. Most searches are cut short by it, as each try costs a filter of all flights; the next one goes on
from there."""
_LEAST_GUST: Final = 1e-3  # m/s
_STILL: Final = (0.0, 0.0, 0.0)
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
    first_time = not noises.moves
    moving = replace(noises, noise=np.where(flow, least, noises.noise)) if first_time else noises
    axes = _axes(problem)

    def level(point: FloatArray) -> float:
        if not _TIMES_S[0] <= np.exp(point[-1]) <= _TIMES_S[1]:
            return np.inf
        rows = problem.rows(at, seen, _with_gusts(moving, point, axes))
        return problem.misfit(rows, at.values) + _unlikely(point)

    still = problem.misfit(problem.rows(at, seen, replace(noises, gusts_m_s=_STILL)), at.values)
    first = (
        _point(_speeds_of_residuals(problem, seen), 1.0)
        if first_time
        else _point([noises.gusts_m_s[axis] for axis in axes], noises.gust_s)
    )
    ways = [*_directions(len(axes)), *np.eye(len(first))[1:-1]]
    found = minimize(
        level,
        first,
        method="Nelder-Mead",
        options={
            "initial_simplex": first + _STEP * np.array([np.zeros(len(first)), *ways]),
            "xatol": _NEAR,
            "fatol": _LEVEL,
            "maxfev": _TRIES * len(first),
        },
    )
    if still - (float(found.fun) - _unlikely(found.x)) < chi2.isf(_CHANCE, len(first)):
        return noises if first_time else replace(noises, gusts_m_s=_STILL)
    return _with_gusts(moving, found.x, axes)


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
    axes = _axes(problem)

    def tried(point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        rows = problem.rows(at, seen, _with_gusts(noises, point, axes))
        step, covariance = problem.step(rows, at.values)
        return problem.misfit(rows, at.values) + _unlikely(point), step, covariance

    middle = _point([noises.gusts_m_s[axis] for axis in axes], noises.gust_s)
    stronger, longer = _directions(len(axes))
    least, step, covariance = tried(middle)
    strength, time = (
        _deviation(least, [tried(middle + sign * _LOOK * way)[0] for sign in (-1.0, 1.0)]) for way in (stronger, longer)
    )
    if time < _KNOWN:
        return covariance
    found = [tried(middle + a * strength * stronger + b * time * longer) for b in _LENGTHS for a in _STRENGTHS]
    levels = np.array([level for level, _, _ in found])
    weight = np.exp(-0.5 * (levels - levels.min()))
    weight /= weight.sum()
    moved = np.array([one - step for _, one, _ in found])
    return np.asarray(np.tensordot(weight, np.array([one for _, _, one in found]), 1) + (moved.T * weight) @ moved)


def _deviation(middle: float, beside: Sequence[float]) -> float:
    """Return the deviation of a logarithm from minus twice the log likelihood at its estimate and beside; at most 1."""
    curvature = (sum(beside) - 2.0 * middle) / _LOOK**2
    return 1.0 / float(np.sqrt(max(0.5 * curvature, 1.0)))


def _axes(problem: Problem) -> list[int]:
    """Return the components of the air's velocity that are seen."""
    return [AXES[name] for name in problem.pieces[0].outputs if name in AXES]


def _point(speeds_m_s: Sequence[float], time_s: float) -> FloatArray:
    """Return logarithms of the speed of gusts over the root of their time, of each component, and of their time.

    The first are what a short record tells: how fast the air's velocity spreads.
    """
    return np.array([*(np.log(np.maximum(speeds_m_s, _LEAST_GUST)) - 0.5 * np.log(time_s)), np.log(time_s)])


def _directions(components: int) -> tuple[FloatArray, FloatArray]:
    """Return the ways in which all components become stronger, and in which their time becomes longer."""
    return np.array([*np.ones(components), 0.0]), np.array([*np.zeros(components), 1.0])


def _with_gusts(noises: Disturbance, point: FloatArray, axes: Sequence[int]) -> Disturbance:
    """Return the noises with the gusts of a point; a component that nothing shows is as strong as the mean of all."""
    logarithms = point[:-1] + 0.5 * point[-1]
    speeds = np.full(3, np.exp(logarithms.mean()))
    speeds[list(axes)] = np.exp(logarithms)
    first, second, third = speeds.tolist()
    return replace(noises, gusts_m_s=(first, second, third), gust_s=float(np.exp(point[-1])))


def _unlikely(point: FloatArray) -> float:
    """Return minus twice the logarithm of how usual such gusts are: the strongest component, time, and likeness."""
    rough, time = point[:-1], float(point[-1])
    apart = (rough - rough.mean()) / _ALIKE
    return float((rough.max() + 0.5 * time - _USUAL[0]) ** 2 + (time - _USUAL[1]) ** 2 + apart @ apart)


def _speeds_of_residuals(problem: Problem, seen: Sequence[Implied]) -> list[float]:
    """Return the air's velocity that would explain the residual of each channel of the flow, about."""
    speeds: list[float] = []
    for k, name in enumerate(problem.pieces[0].outputs):
        if name not in AXES:
            continue
        every = []
        for found in seen:
            speed = np.linalg.norm(found.path.velocity_m_s, axis=1)
            left = found.residual[:, k] * (speed if name != "airspeed_m_s" else 1.0)
            every += [float(np.nanstd(left))] if np.isfinite(left).any() else []
        speeds.append(max(0.5 * float(np.median(every)) if every else 0.0, _LEAST_GUST))
    return speeds

"""Free runs of a model: its equations integrated from a state, under a sampled elevator."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.errors import InputError

Value = float | FloatArray
"""One number, or one for each sample."""
Field = Callable[[Value, Value, float], tuple[Value, Value]]

HOLDS: Final = ("foh", "zoh")
"""How the elevator moves between samples: straight from each to the next, or held from each to the next."""


def free_run(  # noqa: PLR0913 - an input (time, elevator, hold), a start (alpha, q) and a step make a run
    model: PolynomialModel,
    *,
    time_s: ArrayLike,
    elevator_rad: ArrayLike,
    hold: str,
    alpha_rad: float,
    q_rad_s: float,
    substeps: int = 4,
) -> FloatArray:
    """Integrate a model by the classical fourth-order Runge-Kutta method.

    Args:
        model: the model.
        time_s: sample times, rising, shape (n,).
        elevator_rad: the elevator at these times, shape (n,).
        hold: ``foh`` (straight between samples) or ``zoh`` (held from each sample to the next).
        alpha_rad: alpha at the first time.
        q_rad_s: q at the first time.
        substeps: equal steps between two samples; the error falls as substeps to the power -4.

    Returns:
        alpha in rad and q in rad/s at the sample times, shape (n, 2); nan from where the solution has left the
        range of double precision (a cubic model can reach infinity in finite time).
    """
    time, elevator = _inputs(time_s, elevator_rad, hold, substeps)
    field = _field(model, [float(c) for c in model.coefficients])
    states = _integrate(field, time, elevator, (hold == "foh", substeps), (float(alpha_rad), float(q_rad_s)))
    return _finite(np.array(states))


def free_run_samples(  # noqa: PLR0913 - as free_run, and the samples
    model: PolynomialModel,
    coefficients: ArrayLike,
    *,
    time_s: ArrayLike,
    elevator_rad: ArrayLike,
    hold: str,
    alpha_rad: float,
    q_rad_s: float,
    substeps: int = 4,
) -> FloatArray:
    """Integrate many models of the same terms at once, to see how their uncertainty spreads.

    Args:
        model: gives the terms.
        coefficients: one row a sample, in the order of ``PolynomialModel.coefficients``, shape (m, p).
        time_s: as in ``free_run``, like all that follow.
        elevator_rad: as in ``free_run``.
        hold: as in ``free_run``.
        alpha_rad: as in ``free_run``.
        q_rad_s: as in ``free_run``.
        substeps: as in ``free_run``.

    Returns:
        As ``free_run``, with the samples in front: shape (m, n, 2).
    """
    time, elevator = _inputs(time_s, elevator_rad, hold, substeps)
    rows = np.asarray(coefficients, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != model.coefficients.size:
        raise InputError(f"coefficients of shape {rows.shape}, expected (samples, {model.coefficients.size})")
    field = _field(model, list(np.ascontiguousarray(rows.T)))
    start = (np.full(len(rows), float(alpha_rad)), np.full(len(rows), float(q_rad_s)))
    with np.errstate(over="ignore", invalid="ignore"):  # a sample that blows up becomes nan, as documented
        states = _integrate(field, time, elevator, (hold == "foh", substeps), start)
    return _finite(np.moveaxis(np.array(states), 2, 0))


def _inputs(time_s: ArrayLike, elevator_rad: ArrayLike, hold: str, substeps: int) -> tuple[FloatArray, FloatArray]:
    time = np.asarray(time_s, dtype=np.float64)
    elevator = np.asarray(elevator_rad, dtype=np.float64)
    if time.ndim != 1 or time.shape != elevator.shape or not time.size:
        raise InputError(
            f"times and elevators have shapes {time.shape} and {elevator.shape}, expected one (n,) for both"
        )
    if not (np.diff(time) > 0.0).all():
        raise InputError("the sample times do not rise")
    if hold not in HOLDS:
        raise InputError(f"hold '{hold}' is unknown", hint=f"use {' or '.join(HOLDS)}")
    if substeps < 1:
        raise InputError(f"{substeps} substeps cannot be taken", hint="use 1 or more")
    return time, elevator


def _field(model: PolynomialModel, coefficients: list[Value]) -> Field:
    """Return the field as a function of numbers (or arrays of samples), each monomial multiplied out once."""
    model.refuse_inputs("free run")
    split = model.alpha_dot.coefficients.size
    rows = [tuple(row) for row in (*model.alpha_dot.powers.tolist(), *model.q_dot.powers.tolist())]
    highest = [max((row[column] for row in rows), default=0) for column in range(3)]
    constant = (0, 0, 0)
    distinct = sorted(set(rows) - {constant})
    factors = [[(column, power) for column, power in enumerate(row) if power] for row in distinct]
    terms = list(zip(rows, coefficients, strict=True))
    equations = [
        (
            next((c for row, c in equation if row == constant), 0.0),
            [(distinct.index(row), c) for row, c in equation if row != constant],
        )
        for equation in (terms[:split], terms[split:])
    ]

    def field(alpha: Value, q: Value, elevator: float) -> tuple[Value, Value]:
        tables = [_powers(value, top) for value, top in zip((alpha, q, elevator), highest, strict=True)]
        monomials = [math.prod(tables[column][power - 1] for column, power in factor) for factor in factors]
        rates = []
        for start, rest in equations:
            rate = start
            for i, coefficient in rest:
                rate = rate + coefficient * monomials[i]
            rates.append(rate)
        return rates[0], rates[1]

    return field


def _powers(value: Value, highest: int) -> list[Value]:
    """Return the powers 1 to ``highest`` by products: Python's float ``**`` raises on overflow, ``*`` gives inf."""
    table = [value]
    for _ in range(highest - 1):
        table.append(table[-1] * value)
    return table


def _integrate(
    field: Field,
    time: FloatArray,
    elevator: FloatArray,
    scheme: tuple[bool, int],
    start: tuple[Value, Value],
) -> list[tuple[Value, Value]]:
    straight, substeps = scheme
    alpha, q = start
    states = [start]
    times, inputs = time.tolist(), elevator.tolist()
    for i in range(len(times) - 1):
        h = (times[i + 1] - times[i]) / substeps
        rise = (inputs[i + 1] - inputs[i]) / substeps if straight else 0.0
        for step in range(substeps):
            u0 = inputs[i] + rise * step
            um, u1 = u0 + 0.5 * rise, u0 + rise
            a1, q1 = field(alpha, q, u0)
            a2, q2 = field(alpha + 0.5 * h * a1, q + 0.5 * h * q1, um)
            a3, q3 = field(alpha + 0.5 * h * a2, q + 0.5 * h * q2, um)
            a4, q4 = field(alpha + h * a3, q + h * q3, u1)
            alpha = alpha + (h / 6.0) * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            q = q + (h / 6.0) * (q1 + 2.0 * q2 + 2.0 * q3 + q4)
        states.append((alpha, q))
    return states


def _finite(states: FloatArray) -> FloatArray:
    """Replace everything from the first non-finite sample on by nan; time is the axis before the last."""
    lost = np.logical_or.accumulate(~np.isfinite(states).all(axis=-1), axis=-1)
    states[lost] = np.nan
    return states

"""The right sides of a form at many points at once, with their derivatives by states, elevator and coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.dynamics.compiled import compiled
from finback.identification.model_form import ModelForm
from finback.identification.term import ALPHA, ALPHA_DOT, Q


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """A form as arrays, one entry for each monomial of each term, those of dα/dt first.

    Attributes:
        owner: index of the coefficient that multiplies it, shape (parts,).
        weight: its fixed factor, shape (parts,).
        exponents: of alpha, q, dα/dt and the inputs, shape (parts, 3 + inputs).
        split: how many belong to dα/dt.
    """

    owner: IntArray
    weight: FloatArray
    exponents: IntArray
    split: int


@lru_cache(maxsize=256)
def layout(form: ModelForm) -> Layout:
    """Return the form as arrays."""
    names = (ALPHA, Q, ALPHA_DOT, *form.inputs)
    rows = [
        (index, part.weight, [dict(part.factors).get(name, 0) for name in names])
        for index, (_, term) in enumerate(form.terms)
        for part in term.monomials
    ]
    return Layout(
        owner=np.array([row[0] for row in rows], dtype=np.int64),
        weight=frozen_array([row[1] for row in rows]),
        exponents=np.array([row[2] for row in rows], dtype=np.int64),
        split=sum(len(term.monomials) for term in form.alpha_dot),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """Rates and their derivatives at n points; dα/dt inside dq/dt counts as the function that it is.

    Attributes:
        rates: (dα/dt, dq/dt), shape (n, 2).
        jacobian: their derivative by (alpha, q), shape (n, 2, 2): [:, rate, variable].
        sensitivity: their derivative by the coefficients, shape (n, 2, p).
        elevator: their derivative by the elevator, shape (n, 2).
        implicit: ∂(dq/dt)/∂(dα/dt), shape (n,); zero for an explicit form.
    """

    rates: FloatArray
    jacobian: FloatArray
    sensitivity: FloatArray
    elevator: FloatArray
    implicit: FloatArray


def field(form: ModelForm, coefficients: FloatArray, state: FloatArray, inputs: FloatArray) -> Field:
    """Evaluate a form.

    Args:
        form: the form.
        coefficients: in SI, shape (p,).
        state: alpha in rad and q in rad/s, shape (n, 2).
        inputs: the elevator and the further inputs, in SI, shape (n, inputs).
    """
    terms = layout(form)
    # Writable, because arrays that are read-only are another type, for which all would be compiled again.
    rates, jacobian, sensitivity, elevator, implicit = _many(
        np.require(state, np.float64, ["C", "W"]),
        np.require(inputs, np.float64, ["C", "W"]),
        np.require(coefficients, np.float64, ["C", "W"]),
        terms.owner,
        terms.weight,
        terms.exponents,
        terms.split,
    )
    return Field(rates=rates, jacobian=jacobian, sensitivity=sensitivity, elevator=elevator, implicit=implicit)


def combined(one: Field, two: Field, first: float, second: float) -> Field:
    """Return first · one + second · two."""
    return Field(
        rates=first * one.rates + second * two.rates,
        jacobian=first * one.jacobian + second * two.jacobian,
        sensitivity=first * one.sensitivity + second * two.sensitivity,
        elevator=first * one.elevator + second * two.elevator,
        implicit=first * one.implicit + second * two.implicit,
    )


@compiled
def product(point: FloatArray, exponents: IntArray, part: int, lowered: int) -> float:
    """Return the product of powers of one monomial, the exponent of variable ``lowered`` less by one."""
    value = 1.0
    for j in range(exponents.shape[1]):
        for _ in range(exponents[part, j] - (1 if j == lowered else 0)):
            value *= point[j]
    return value


@compiled
def evaluate(  # noqa: PLR0913, PLR0917, C901, PLR0912 - one loop, which compiles faster than its parts
    point: FloatArray,
    coefficients: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    split: int,
    rates: FloatArray,
    jacobian: FloatArray,
    sensitivity: FloatArray,
    elevator: FloatArray,
) -> float:
    """Write rates and derivatives at ``point`` (alpha, q, dα/dt, inputs), whose dα/dt is set; return ∂q̇/∂α̇."""
    rates[:] = 0.0
    jacobian[:] = 0.0
    sensitivity[:] = 0.0
    elevator[:] = 0.0
    slope = 0.0
    for part in range(owner.size):
        equation = 0 if part < split else 1
        if part == split:
            point[2] = rates[0]
        value = weight[part]
        for j in range(exponents.shape[1]):
            for _ in range(exponents[part, j]):
                value *= point[j]
        scale = coefficients[owner[part]]
        sensitivity[equation, owner[part]] += value
        rates[equation] += scale * value
        for k in range(4):
            power = exponents[part, k]
            if power > 0:
                if point[k] != 0.0:
                    change = scale * power * value / point[k]
                else:
                    change = scale * weight[part] * power * product(point, exponents, part, k)
                if k < 2:
                    jacobian[equation, k] += change
                elif k == 2:
                    slope += change
                else:
                    elevator[equation] += change
    if slope != 0.0:
        for k in range(2):
            jacobian[1, k] += slope * jacobian[0, k]
        for k in range(coefficients.size):
            sensitivity[1, k] += slope * sensitivity[0, k]
        elevator[1] += slope * elevator[0]
    return slope


@compiled
def _many(  # noqa: PLR0913, PLR0917 - a kernel takes its arrays one by one
    state: FloatArray,
    inputs: FloatArray,
    coefficients: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    split: int,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    count = state.shape[0]
    rates, jacobian = np.empty((count, 2)), np.empty((count, 2, 2))
    sensitivity, elevator = np.empty((count, 2, coefficients.size)), np.empty((count, 2))
    implicit = np.empty(count)
    point = np.empty(3 + inputs.shape[1])
    for i in range(count):
        point[:2] = state[i]
        point[3:] = inputs[i]
        implicit[i] = evaluate(
            point,
            coefficients,
            owner,
            weight,
            exponents,
            split,
            rates[i],
            jacobian[i],
            sensitivity[i],
            elevator[i],
        )
    return rates, jacobian, sensitivity, elevator, implicit

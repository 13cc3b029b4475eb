"""A fitted model in coefficient form, and the dimensional model that it is at one condition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.dual import Dual
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.conversion import (
    COEFFICIENT_VARIABLES,
    LiftCoefficients,
    cosine_series,
    known_rate,
    reduced,
    scales,
    sine_series,
)
from finback.identification.coefficient.form import (
    ALPHA_RATE,
    MOVING,
    PITCH_RATE,
    REFERENCE_PITCH_RATE,
    SPEED,
    Axes,
    CoefficientForm,
)
from finback.identification.term import ALPHA
from finback.records import Condition

_ORDER: Final = 7
"""Of sine and cosine of alpha: relative error 5e-6 at 40 deg."""

_Map = dict[tuple[int, ...], Dual]
"""Exponents of alpha, q c / 2V and the inputs -> coefficient, with its derivative by the numbers of the model."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientModel:
    """Numbers of three coefficients with their covariance.

    Attributes:
        form: the terms.
        airframe: mass, geometry, and the thrust at which ``reduced`` takes it.
        reference_speed_m_s: V₀ of ``speed_ratio_1`` and ``reference_pitch_rate_1``.
        numbers: in the order of the form's terms, SI, shape (p,).
        covariance: of them, shape (p, p); zero rows for what is fixed.
        domain: low and high of ``form.variables`` where data supported the fit, shape (v, 2).
    """

    form: CoefficientForm
    airframe: Airframe
    reference_speed_m_s: float
    numbers: FloatArray
    covariance: FloatArray
    domain: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the arrays."""
        for name in ("numbers", "covariance", "domain"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        size = self.form.size
        if self.numbers.shape != (size,) or self.covariance.shape != (size, size):
            raise InputError(f"a form of {size} terms needs as many numbers and their covariance")
        if self.domain.shape != (len(self.form.variables), 2):
            raise InputError(f"the domain needs a row for each of {', '.join(self.form.variables)}")

    @property
    def standard_errors(self) -> FloatArray:
        """One for each number, shape (p,)."""
        return frozen_array(np.sqrt(np.diag(self.covariance)))

    def number(self, label: str) -> float:
        """Return a number by its label, such as ``alpha^2 in CZ``.

        Raises:
            InputError: there is no such number.
        """
        labels = self.form.labels()
        if label not in labels:
            raise InputError(f"there is no '{label}'", hint=f"there are {', '.join(labels)}")
        return float(self.numbers[labels.index(label)])

    def coefficient(self, name: str, values: Mapping[str, ArrayLike]) -> FloatArray:
        """Return a coefficient (``CX``, ``CZ``, ``CD``, ``CL``, ``Cm``) at values of its variables, in SI."""
        if name not in self.form.names:
            raise InputError(f"there is no {name}", hint=f"there are {', '.join(self.form.names)}")
        total: FloatArray = np.zeros(np.broadcast_shapes(*(np.shape(value) for value in values.values())))
        for number, (owner, term) in zip(self.numbers, self.form.terms, strict=True):
            if owner == name:
                total = total + number * term(values)
        return total

    def lift_coefficients(self, condition: Condition, order: int = _ORDER) -> LiftCoefficients:
        """Return CL and Cm about the center of gravity at one condition, over alpha, q c / 2V and the inputs.

        Airspeed ratios are held; dα/dt in Cm is replaced by its own equation, the covariance carried to first order.

        Args:
            condition: airspeed, density and gravity.
            order: to which sine and cosine of alpha are expanded about 0, where they are needed.
        """
        maps, late = self._maps(condition.airspeed_m_s / self.reference_speed_m_s)
        sine, cosine = sine_series(order), cosine_series(order)
        frame = self.airframe
        if self.form.axes is Axes.BODY:
            axial, normal = maps[0], maps[1]
            lift = _sum((_times(axial, sine), 1.0), (_times(normal, cosine), -1.0))
        else:
            lift = maps[1]
            axial = _sum((_times(lift, sine), 1.0), (_times(maps[0], cosine), -1.0))
            normal = _sum((_times(lift, cosine), -1.0), (_times(maps[0], sine), -1.0))
        parts = [(maps[2], 1.0)]
        if frame.reference_z_m:
            parts.append((axial, frame.reference_z_m / frame.chord_m))
        if frame.reference_x_m:
            parts.append((normal, -frame.reference_x_m / frame.chord_m))
        if late:
            parts.append((_product(late, self._alpha_rate(lift, condition, order)), 1.0))
        pitching = _sum(*parts)
        carry = np.array([dual.gradient for dual in (*lift.values(), *pitching.values())])
        return LiftCoefficients(
            lift=self._polynomial(lift, condition.airspeed_m_s),
            pitching=self._polynomial(pitching, condition.airspeed_m_s),
            covariance=frozen_array(carry @ self.covariance @ carry.T),
        )

    def reduced(self, condition: Condition, order: int = _ORDER) -> PolynomialModel:
        """Return dα/dt and dq/dt in level flight at a condition held constant, with their covariance.

        Args:
            condition: airspeed, density and gravity.
            order: to which sine and cosine of alpha are expanded about 0; the relative error of the forces at α is at
                most |α|^(order + 1) / (order + 1)!.
        """
        return reduced(self.lift_coefficients(condition, order), self.airframe, condition, thrust_order=order)

    def _maps(self, ratio: float) -> tuple[tuple[_Map, _Map, _Map], _Map]:
        """Return CX (or CD), CZ (or CL) and Cm at V / V₀ = ratio; and what multiplies dα/dt c / 2V in Cm."""
        variables = (ALPHA, PITCH_RATE, *self.form.inputs)
        maps: tuple[_Map, _Map, _Map] = ({}, {}, {})
        late: _Map = {}
        for number, gradient, (name, term) in zip(
            self.numbers.tolist(), np.eye(self.form.size), self.form.terms, strict=True
        ):
            for part in term.monomials:
                powers = dict(part.factors)
                slow = powers.pop(REFERENCE_PITCH_RATE, 0)  # q c / 2V₀ = (V / V₀) q c / 2V
                weight = part.weight * ratio ** (powers.pop(SPEED, 0) + slow)
                powers[PITCH_RATE] = powers.get(PITCH_RATE, 0) + slow
                found = late if powers.pop(ALPHA_RATE, 0) else maps[self.form.names.index(name)]
                key = tuple(powers.get(variable, 0) for variable in variables)
                _add(found, key, Dual(number, gradient).times(weight))
        return maps, late

    def _alpha_rate(self, lift: _Map, condition: Condition, order: int) -> _Map:
        """Return dα/dt c / 2V in level flight."""
        force, _, rate = scales(self.airframe, condition)
        found: _Map = {}
        zero = np.zeros(self.form.size)
        rest = (0,) * (len(self.form.inputs) - 1)
        for key, factor in known_rate(self.airframe, condition, order).items():
            _add(found, (*key, *rest), Dual(factor * (1.0 if key[1] else rate), zero))
        for key, dual in lift.items():
            _add(found, key, dual.times(-force * rate))
        return found

    def _polynomial(self, found: _Map, airspeed_m_s: float) -> Polynomial:
        """Return a polynomial over alpha, q c / 2V and the inputs; without a domain at an airspeed outside its own."""
        low, high = self.domain[MOVING.index(SPEED)]
        inside = low <= airspeed_m_s / self.reference_speed_m_s <= high
        rows = [*self.domain[[MOVING.index(ALPHA), MOVING.index(PITCH_RATE)]], *self.domain[len(MOVING) :]]
        return Polynomial(
            variables=(*COEFFICIENT_VARIABLES, *self.form.inputs[1:]),
            powers=np.array(list(found), dtype=np.int64),
            coefficients=np.array([dual.value for dual in found.values()]),
            value_unit="1",
            domain=np.array(rows) if inside else np.tile([np.inf, -np.inf], (len(rows), 1)),
        )


def _add(found: _Map, key: tuple[int, ...], value: Dual) -> None:
    found[key] = found[key] + value if key in found else value


def _times(found: _Map, series: Mapping[int, float]) -> _Map:
    """Return a coefficient times a power series in alpha."""
    return _sum(
        *(({(key[0] + power, *key[1:]): dual for key, dual in found.items()}, f) for power, f in series.items())
    )


def _product(one: _Map, two: _Map) -> _Map:
    """Return the product of two polynomials."""
    total: _Map = {}
    for first, left in one.items():
        for second, right in two.items():
            _add(total, tuple(a + b for a, b in zip(first, second, strict=True)), left * right)
    return total


def _sum(*parts: tuple[_Map, float]) -> _Map:
    """Return a weighted sum of coefficients."""
    total: _Map = {}
    for found, factor in parts:
        for key, dual in found.items():
            _add(total, key, dual.times(factor))
    return total

"""Hopf points of a branch of equilibria of any field, and the neutral saddles that look like them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.event import Located, Observed
from finback.dynamics.continuation.field import FieldError, ScaledField

_SLOPE_STEP: Final = 1e-4  # typical sizes: the Jacobian's rounding of 1e-11 leaves seven digits
_OTHER_STEP: Final = 1.6  # of the differences: the same coefficient again, to see what they are worth
_ON_AXIS: Final = 1e-7  # of the largest eigenvalue: a real part that cannot be told from zero
_CERTAIN: Final = 3.0  # times that difference


Complex = NDArray[np.complex128]


class Criticality(StrEnum):
    """Which side the cycles of a Hopf point lie on."""

    SUPERCRITICAL = "supercritical"
    """first Lyapunov coefficient < 0: the cycles are stable where the equilibrium is not"""
    SUBCRITICAL = "subcritical"
    """> 0: unstable cycles surround the stable equilibrium"""
    UNDECIDED = "undecided"
    """zero within the error of its differences, or the field has a corner here"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class HopfPoint:
    """A pair of complex eigenvalues crosses the imaginary axis.

    Attributes:
        parameter: where, in the user's unit.
        state: the equilibrium, shape (d,).
        frequency: ω > 0 of the pair ±iω, rad / time.
        crossing_speed: derivative of the real part by the parameter, along the branch; > 0: stability is lost upward.
        lyapunov: first Lyapunov coefficient with a critical eigenvector of length 1 in the user's units (Kuznetsov,
            Elements of Applied Bifurcation Theory, 3rd ed. 2004, Eq. 5.62); its sign does not depend on units.
        lyapunov_error: by how much it changes with the step of the differences.
        criticality: by its sign.
        eigenvector_real: of +iω, shape (d,), length 1 in the user's units.
        eigenvector_imag: imaginary part.
        eigenvalues_real: all of the linearized field, shape (d,), 1 / time.
        eigenvalues_imag: imaginary parts, shape (d,).
        corner: the eigenvalues jump here, because the field has a corner (a table's breakpoint).
        bracket_parameter: of the points on either side between which the pair crosses, shape (2,).
        bracket_state: their states, shape (2, d).
        residual: largest rate left, in typical rates.
        test: real part of the pair at the point, 1 / time.
    """

    parameter: float
    state: FloatArray
    frequency: float
    crossing_speed: float
    lyapunov: float
    lyapunov_error: float
    criticality: Criticality
    eigenvector_real: FloatArray
    eigenvector_imag: FloatArray
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    corner: bool
    bracket_parameter: FloatArray
    bracket_state: FloatArray
    residual: float
    test: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "eigenvector_real", "eigenvector_imag", "eigenvalues_real", "eigenvalues_imag"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for name in ("bracket_parameter", "bracket_state"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class NeutralSaddle:
    """Two real eigenvalues are opposite: no bifurcation of equilibria, but where a Hopf curve may lead.

    Attributes:
        parameter: where, in the user's unit.
        state: the equilibrium, shape (d,).
        eigenvalue: the positive one of the two, 1 / time.
        bracket_parameter: of the points on either side, shape (2,).
        bracket_state: their states, shape (2, d).
        residual: largest rate left, in typical rates.
        test: sum of the two, 1 / time.
    """

    parameter: float
    state: FloatArray
    eigenvalue: float
    bracket_parameter: FloatArray
    bracket_state: FloatArray
    residual: float
    test: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "bracket_parameter", "bracket_state"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def critical_pair(eigenvalues: Complex) -> tuple[complex, complex]:
    """Return the two eigenvalues whose sum is nearest to zero, conjugate or real.

    The one of positive imaginary part, or the larger, comes first.
    """
    one, other = np.triu_indices(len(eigenvalues), 1)
    index = int(np.argmin(np.abs(eigenvalues[one] + eigenvalues[other])))
    pair = complex(eigenvalues[one[index]]), complex(eigenvalues[other[index]])
    first, second = sorted(pair, key=lambda value: (value.imag, value.real), reverse=True)
    return first, second


def coincident_hopf_points(scaled: ScaledField, located: Located) -> tuple[HopfPoint, ...]:
    """Return a Hopf point for each complex pair that crosses at one place, by frequency.

    Where two pairs have the same frequency, too, their eigenvectors and what follows from them are any of many.
    """
    values = located.at.eigenvalues
    near = np.abs(values.real) <= _ON_AXIS * float(np.abs(values).max())
    upper = sorted((complex(value) for value in values[near] if value.imag > 0.0), key=lambda value: value.imag)
    return tuple(_hopf(scaled, located, value) for value in upper)


def hopf_or_saddle(scaled: ScaledField, located: Located) -> HopfPoint | NeutralSaddle:
    """Return what a zero sum of two eigenvalues is."""
    first, second = critical_pair(located.at.eigenvalues)
    return _hopf(scaled, located, first) if first.imag > 0.0 else _saddle(scaled, located, first, second)


def _saddle(scaled: ScaledField, located: Located, first: complex, second: complex) -> NeutralSaddle:
    d = scaled.states
    sides = np.array([located.before.point.u, located.after.point.u]) * scaled.scale
    x = located.at.point.u * scaled.scale
    return NeutralSaddle(
        parameter=float(x[d]),
        state=x[:d],
        eigenvalue=max(first.real, second.real),
        bracket_parameter=sides[:, d],
        bracket_state=sides[:, :d],
        residual=located.at.point.residual,
        test=(first + second).real,
    )


def _hopf(scaled: ScaledField, located: Located, value: complex) -> HopfPoint:
    d = scaled.states
    point = located.at.point
    sides = np.array([located.before.point.u, located.after.point.u]) * scaled.scale
    x = point.u * scaled.scale
    q, _ = critical_vectors(scaled, point.jacobian, value)
    lyapunov, error = (math.nan, math.nan) if located.corner else lyapunov_coefficient(scaled, located.at)
    certain = abs(lyapunov) > _CERTAIN * error
    vector = q * scaled.scale[:d]
    return HopfPoint(
        parameter=float(x[d]),
        state=x[:d],
        frequency=value.imag,
        crossing_speed=_crossing_speed(scaled, located),
        lyapunov=lyapunov,
        lyapunov_error=error,
        criticality=(Criticality.SUPERCRITICAL if lyapunov < 0.0 else Criticality.SUBCRITICAL)
        if certain
        else Criticality.UNDECIDED,
        eigenvector_real=vector.real,
        eigenvector_imag=vector.imag,
        eigenvalues_real=located.at.eigenvalues.real,
        eigenvalues_imag=located.at.eigenvalues.imag,
        corner=located.corner,
        bracket_parameter=sides[:, d],
        bracket_state=sides[:, :d],
        residual=point.residual,
        test=value.real,
    )


def _crossing_speed(scaled: ScaledField, located: Located) -> float:
    """Return the real part's slope along the branch over the parameter's, by differences along the tangent."""
    point = located.at.point
    parameter_slope = float(point.tangent[scaled.states] * scaled.scale[scaled.states])
    if located.corner or parameter_slope == 0.0:
        return math.nan
    try:
        ends = [
            critical_pair(scaled.eigenvalues(scaled.jacobian(point.u + step * point.tangent)))[0].real
            for step in (_SLOPE_STEP, -_SLOPE_STEP)
        ]
    except FieldError:
        return math.nan
    return (ends[0] - ends[1]) / (2.0 * _SLOPE_STEP * parameter_slope)


def critical_vectors(scaled: ScaledField, jacobian: FloatArray, value: complex) -> tuple[Complex, Complex]:
    """Return right and left eigenvectors (scaled states) nearest to an eigenvalue.

    The right one has length 1 in the user's units, the left one the product conj(p) · q = 1 with it.
    """
    d = scaled.states
    # d(state/size)/dt = D (scaled rates), D = rate sizes / state sizes
    matrix = jacobian[:, :d] * (scaled.rate_scale / scaled.scale[:d])[:, np.newaxis]
    values, right = np.linalg.eig(matrix)
    q = right[:, int(np.argmin(np.abs(values - value)))].astype(np.complex128)
    q /= np.linalg.norm(q * scaled.scale[:d])
    q *= np.exp(-1j * np.angle(q[int(np.argmax(np.abs(q)))]))
    values, left = np.linalg.eig(matrix.T)
    p = left[:, int(np.argmin(np.abs(values - value)))].conj().astype(np.complex128)
    p /= np.conj(p.conj() @ q)
    return q, p


def lyapunov_coefficient(scaled: ScaledField, seen: Observed) -> tuple[float, float]:
    """Return the first Lyapunov coefficient at a Hopf point, and how much it depends on the differences.

    Kuznetsov (2004), Eq. 5.62: l1 = Re(<p, C(q, q, q̄)> - 2 <p, B(q, A⁻¹ B(q, q̄))> + <p, B(q̄, (2iω - A)⁻¹ B(q, q))>)
    / 2ω. nan where the field fails around the point.
    """
    fine, rough = (lyapunov_by_differences(scaled, seen, stretch) for stretch in (1.0, _OTHER_STEP))
    return fine, abs(fine - rough)


def lyapunov_by_differences(scaled: ScaledField, seen: Observed, stretch: float = 1.0) -> float:
    """Return the first Lyapunov coefficient with one step of the differences; nan where the field fails around."""
    try:
        return _coefficient(scaled, seen, stretch)
    except (FieldError, np.linalg.LinAlgError):
        return math.nan


def _coefficient(scaled: ScaledField, seen: Observed, stretch: float) -> float:
    d = scaled.states
    point = seen.point
    value, _ = critical_pair(seen.eigenvalues)
    omega = value.imag
    q, p = critical_vectors(scaled, point.jacobian, value)
    rates = scaled.rate_scale / scaled.scale[:d]
    matrix = point.jacobian[:, :d] * rates[:, np.newaxis]

    def full(direction: FloatArray) -> FloatArray:
        return np.concatenate((direction, np.zeros(len(point.u) - d)))

    def second(one: FloatArray, other: FloatArray) -> FloatArray:
        sizes = np.linalg.norm(one), np.linalg.norm(other)
        if not min(sizes) > 0.0:  # what is too small to be squared is nothing beside the other part
            return np.zeros(d)
        mixed = scaled.mixed(point.u, full(one / sizes[0]), full(other / sizes[1]), stretch)
        result: FloatArray = rates * mixed * sizes[0] * sizes[1]
        return result

    def bilinear(one: Complex, other: Complex) -> Complex:
        real = second(one.real, other.real) - second(one.imag, other.imag)
        return real + 1j * (second(one.real, other.imag) + second(one.imag, other.real))

    def third(direction: FloatArray) -> FloatArray:
        size = float(np.linalg.norm(direction))
        result: FloatArray = (
            rates * scaled.third(point.u, full(direction / size), stretch) * size**3 if size else 0 * rates
        )
        return result

    a, b = q.real, q.imag
    aaa, bbb, plus, minus = third(a), third(b), third(a + b), third(a - b)
    aab, abb = (plus - minus - 2.0 * bbb) / 6.0, (plus + minus - 2.0 * aaa) / 6.0
    cubic: Complex = aaa + abb + 1j * (aab + bbb)
    mean: Complex = np.linalg.solve(matrix, bilinear(q, q.conj())).astype(np.complex128)
    double: Complex = np.linalg.solve(2j * omega * np.eye(d) - matrix, bilinear(q, q)).astype(np.complex128)
    total = cubic - 2.0 * bilinear(q, mean) + bilinear(q.conj(), double)
    return float((p.conj() @ total).real / (2.0 * omega))

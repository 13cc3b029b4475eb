"""Points of a branch of equilibria that no change of the parameter alone would meet in general, by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.event import Happening, Located, Observed, neutral_throughout
from finback.dynamics.continuation.field import ScaledField

_ZERO: Final = 2e-5  # of the Jacobian: a double eigenvalue is known to the root of its rounding of 1e-11
_SLOW: Final = 1e-2  # of the usual Jacobian: where all of it vanishes it is no measure
_ON_AXIS: Final = 1e-7  # of the Jacobian: the real part of a pair, known to rounding
_BOTH: Final = 2


class Degeneracy(StrEnum):
    """What is degenerate: any change of the field takes it apart."""

    CUSP = "cusp"
    """the parameter stands still and does not turn, or turns twice within rounding"""
    BOGDANOV_TAKENS = "bogdanov-takens"
    """a fold with a second eigenvalue zero"""
    DOUBLE_ZERO = "double-zero"
    """two eigenvalues are zero, each with an eigenvector of its own"""
    ZERO_HOPF = "zero-hopf"
    """an eigenvalue zero and a pair on the imaginary axis"""
    COINCIDENT_PAIRS = "coincident-pairs"
    """two pairs or more cross the imaginary axis together (double Hopf); each is a Hopf point, too"""
    NEUTRAL_THROUGHOUT = "neutral-throughout"
    """two eigenvalues are opposite all along the branch, as in a conservative field: no Hopf point can be told"""
    UNRESOLVED = "unresolved"
    """eigenvalues cross the imaginary axis together in some other way"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DegeneratePoint:
    """A degenerate point of a branch of equilibria.

    Attributes:
        kind: what is degenerate.
        parameter: where, in the user's unit; of what holds throughout, in the middle of the branch.
        state: the equilibrium, shape (d,).
        eigenvalues_real: of the linearized field, shape (d,), 1 / time.
        eigenvalues_imag: imaginary parts, shape (d,).
        residual: largest rate left, in typical rates.
    """

    kind: Degeneracy
    parameter: float
    state: FloatArray
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    residual: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "eigenvalues_real", "eigenvalues_imag"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def degenerate_points(
    scaled: ScaledField, seen: Sequence[Observed], located: Sequence[Located], cusps: Sequence[Observed]
) -> tuple[DegeneratePoint, ...]:
    """Return what is degenerate on a branch: cusps in its order, then what coincides, then what holds throughout."""
    found = [_point(scaled, Degeneracy.CUSP, at) for at in cusps]
    usual = float(np.median([_size(scaled, one) for one in seen]))
    for one in located:
        kind = kind_of(scaled, one, usual)
        if kind is not None:
            point = _point(scaled, kind, one.at)
            if not any(_same(scaled, point, other) for other in found):
                found.append(point)
    if neutral_throughout(list(seen)):
        found.append(_point(scaled, Degeneracy.NEUTRAL_THROUGHOUT, seen[len(seen) // 2]))
    return tuple(found)


def _size(scaled: ScaledField, seen: Observed) -> float:
    return float(np.linalg.norm(scaled.linear(seen.point.jacobian)))


def _same(scaled: ScaledField, one: DegeneratePoint, other: DegeneratePoint) -> bool:
    moved = np.append(one.state - other.state, one.parameter - other.parameter) / scaled.scale
    return one.kind is other.kind and float(np.linalg.norm(moved)) <= _ZERO


def kind_of(scaled: ScaledField, located: Located, usual: float) -> Degeneracy | None:
    """Return what a located point is by its eigenvalues; nothing if it is what it is named for, and no more."""
    if located.kind is Happening.BRANCH_POINT:
        return None
    matrix, values = scaled.linear(located.at.point.jacobian), located.at.eigenvalues
    size = max(_size(scaled, located.at), _SLOW * usual)
    zeros = int((np.abs(values) <= _ZERO * size).sum())
    pairs = int(((values.imag > _ZERO * size) & (np.abs(values.real) <= _ON_AXIS * size)).sum())
    if located.kind is Happening.COINCIDENCE and pairs >= _BOTH:
        return Degeneracy.COINCIDENT_PAIRS
    if located.kind in {Happening.COINCIDENCE, Happening.FOLD} and pairs and zeros:
        return Degeneracy.ZERO_HOPF
    if zeros >= _BOTH:
        singular = np.linalg.svd(matrix)[1]
        return Degeneracy.DOUBLE_ZERO if singular[-_BOTH] <= _ZERO * size else Degeneracy.BOGDANOV_TAKENS
    return Degeneracy.UNRESOLVED if located.kind is Happening.COINCIDENCE else None


def _point(scaled: ScaledField, kind: Degeneracy, seen: Observed) -> DegeneratePoint:
    x = seen.point.u * scaled.scale
    return DegeneratePoint(
        kind=kind,
        parameter=float(x[scaled.states]),
        state=x[: scaled.states],
        eigenvalues_real=seen.eigenvalues.real,
        eigenvalues_imag=seen.eigenvalues.imag,
        residual=seen.point.residual,
    )

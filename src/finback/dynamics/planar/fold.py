"""Folds of a planar field: where two equilibria meet and vanish as the parameter moves, and cusps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.linearity import Changed, intervals
from finback.dynamics.planar.event import Event, bracket, determinant_of, equations
from finback.dynamics.planar.jet import PlanarJet, Point
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.tracked import Mark, MovedField, tracked


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarFold:
    """A saddle-node of equilibria: the determinant changes its sign where the branch turns round in the parameter.

    Along the branch μ = parameter + ½ curvature ξ² + …, state + ξ φ + …, with the null vector φ of unit length in SI.

    Attributes:
        parameter: where.
        state: shape (2,).
        curvature: second derivative of the parameter along the branch; positive where the pair exists above the fold.
        quadratic: coefficient a of the normal form ξ' = … + a ξ², a = ψ·B(φ, φ)/(2 ψ·φ) (Kuznetsov, Elements of
            Applied Bifurcation Theory, 3rd ed. 2004, Eq. 8.3); infinite where the other eigenvalue is zero, too.
        other_eigenvalue: the trace, in 1/s; the fold is of a sink where it is negative.
        parameter_interval: 95 % interval by the delta method, shape (2,); infinite where the fold is not linear in
            the coefficients as far as their errors reach (``linearity``): its parameter is then not determined.
        state_interval: the same for both states, shape (2, 2), row i for state i.
        bracket: two points (first state, second state, parameter) of the branch between which the determinant changes
            its sign beyond rounding, shape (2, 3).
        residual: the determinant in 1/s², as evaluated.
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    curvature: float
    quadratic: float
    other_eigenvalue: float
    parameter_interval: FloatArray
    state_interval: FloatArray
    bracket: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "parameter_interval", "state_interval", "bracket"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCusp:
    """A degenerate equilibrium where the determinant touches zero: three meet, or two folds within rounding.

    No equilibrium is lost or won as the parameter passes, but any change of the coefficients either makes two folds
    of it or removes it, so it has no interval.

    Attributes:
        parameter: where.
        state: shape (2,).
        residual: the determinant in 1/s², as evaluated.
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "state", frozen_array(self.state))


def planar_cusp(jet: PlanarJet, event: Event) -> PlanarCusp:
    """Describe an event where the determinant touches zero."""
    first, second, parameter = jet.to_si(event.at)
    state = np.array([first, second])
    return PlanarCusp(
        parameter=parameter,
        state=state,
        residual=determinant_of(jet).value(event.at),
        in_domain=jet.system.contains(state, parameter),
    )


def planar_fold(jet: PlanarJet, event: Event) -> PlanarFold:
    """Describe an event where the determinant changes its sign."""
    plain = PlanarJet(jet.system, (1.0, 1.0, 1.0))
    at = jet.to_si(event.at)
    state, parameter = np.array(at[:2]), at[2]
    (p, q, by_p), (r, s, by_q), _ = plain.first(at)
    null, left = null_vectors(np.array([[p, q], [r, s]]))
    bent = float(left @ second_order(plain, at, null))
    drift, overlap = float(left @ (by_p, by_q)), float(left @ null)
    stated = intervals(jet.system, np.array(at), shift(plain, at), following(jet.system, at, Mark.FOLD))
    return PlanarFold(
        parameter=parameter,
        state=state,
        curvature=-bent / drift if drift else float("inf"),
        quadratic=bent / (2.0 * overlap) if overlap else float("inf"),
        other_eigenvalue=p + s,
        parameter_interval=stated[2],
        state_interval=stated[:2],
        bracket=bracket(jet, determinant_of(jet), event) * np.array(jet.units),
        residual=determinant_of(plain).value(at),
        in_domain=jet.system.contains(state, parameter),
    )


def following(system: PlanarSystem, at: Point, mark: Mark) -> Changed:
    """Return both states and the parameter of a point that is followed as θ changes, nan where it vanishes."""
    return lambda changes: tracked(MovedField(system, changes), at, mark)


def null_vectors(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return right and left null vector of a singular 2 × 2 matrix, of unit length, first component >= 0."""
    vectors = []
    for matrix in (jacobian, jacobian.T):
        row = matrix[int(np.argmax(np.abs(matrix).max(axis=1)))]
        vector = np.array([row[1], -row[0]])
        size = float(np.linalg.norm(vector)) or 1.0
        vectors.append(vector / (size if vector[0] >= 0.0 else -size))
    return vectors[0], vectors[1]


def second_order(jet: PlanarJet, at: Point, direction: FloatArray) -> FloatArray:
    """Return the second derivative of both rates along a direction of the states, shape (2,)."""
    x, y = direction.tolist()
    return np.array(
        [
            jet.derivative(row, (2, 0, 0), at) * x * x
            + 2.0 * jet.derivative(row, (1, 1, 0), at) * x * y
            + jet.derivative(row, (0, 2, 0), at) * y * y
            for row in (0, 1)
        ]
    )


def shift(jet: PlanarJet, at: Point) -> FloatArray:
    """Return the derivative by θ of states and parameter of a fold, shape (3, p); nan where it has none."""
    system = jet.system
    matrix, _ = equations(jet, determinant_of(jet), at)
    slopes = {
        (row, name): curve.derivative(name).gradient(*at)
        for row, curve in enumerate((system.first, system.second))
        for name in system.variables[:2]
    }
    one, two, _ = system.variables
    (p, q, _), (r, s, _), _ = jet.first(at)
    determinant = p * slopes[1, two] + s * slopes[0, one] - q * slopes[1, one] - r * slopes[0, two]
    right = np.stack([system.first.gradient(*at), system.second.gradient(*at), determinant])
    return solved(matrix, right)


def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Return −matrix⁻¹ right; nan where the matrix is singular."""
    try:
        return np.asarray(-np.linalg.solve(matrix, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.nan)

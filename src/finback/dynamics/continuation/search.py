"""All equilibria in a box, and the complete picture of their branches, disconnected ones included.

A continuation finds what is connected to its start. The rest is searched for: Newton's method from a low-discrepancy
set of starts, each freed of the equilibria already known by deflation (Farrell, Birkisson & Funke 2015, SIAM J. Sci.
Comput. 37, A2026), and from every equilibrium along the curves on which all rates but one vanish, at several
parameters; every new equilibrium is followed, and so is every branch that crosses.
No finite search proves that there is nothing more: what was searched is stated.
"""

from __future__ import annotations

from dataclasses import dataclass, field as field_of
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.branch import (
    EquilibriumBranch,
    equilibrium_near,
    followed,
    other_branch,
    scaled_field,
)
from finback.dynamics.continuation.field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation.fold import LimitPoint
from finback.dynamics.continuation.hopf import HopfPoint
from finback.dynamics.continuation.path import RESIDUAL, ContinuationOptions, PathPoint, correct, point_at
from finback.dynamics.continuation.release import equilibria_along
from finback.errors import InputError, RefusedError

_ITERATIONS: Final = 30
_LONGEST: Final = 0.5  # typical sizes: of a Newton step
_STRAY: Final = 0.5  # typical sizes beyond the box where an iteration is given up
_SAME: Final = 1e-6  # typical sizes: nearer equilibria are one
_TOUCHING: Final = 1e-12  # typical sizes: where deflation would divide by zero


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOptions:
    """How equilibria are searched for.

    Attributes:
        starts: Newton starts at each parameter, a power of two.
        parameters: number of parameters, spread evenly over the range, its ends among them.
        steps: along the curves that lead from one equilibrium to the next.
    """

    starts: int = 32
    parameters: int = 5
    steps: ContinuationOptions = field_of(
        default_factory=lambda: ContinuationOptions(largest_step=0.08, largest_turn_rad=0.4)
    )

    def __post_init__(self) -> None:
        """Check."""
        if self.starts < 1 or self.starts & (self.starts - 1) or self.parameters < 1:
            raise InputError(f"{self.starts} starts at {self.parameters} parameters: not a power of two, or none")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoxEquilibria:
    """The equilibria found in a box at one parameter, n of them, by rising first state.

    Attributes:
        parameter: where.
        state: shape (n, d).
        eigenvalues_real: of the linearized field, shape (n, d), 1 / time.
        eigenvalues_imag: imaginary parts.
        residual: largest rate left, shape (n,), in typical rates.
        starts: Newton starts that were tried.
    """

    parameter: float
    state: FloatArray
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    residual: FloatArray
    starts: int

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "eigenvalues_real", "eigenvalues_imag", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EquilibriumPicture:
    """All branches of equilibria that were found.

    Attributes:
        branches: in the order they were found; branches that cross are two.
        limit_points: of all branches, by rising parameter.
        hopf_points: likewise.
        searched: parameters at which all of the box was searched, shape (m,).
        starts: Newton starts at each.
    """

    branches: tuple[EquilibriumBranch, ...]
    limit_points: tuple[LimitPoint, ...]
    hopf_points: tuple[HopfPoint, ...]
    searched: FloatArray
    starts: int

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "searched", frozen_array(self.searched))


def equilibria_in_box(box: BlackBox, parameter: float, options: SearchOptions | None = None) -> BoxEquilibria:
    """Return the equilibria in the box of states at a parameter that a systematic search finds.

    Raises:
        RefusedError: the field cannot be evaluated anywhere in the box.
    """
    scaled, options = scaled_field(box), options or SearchOptions()
    points = [point_at(scaled, u, _up(scaled)) for u in search(scaled, parameter, options, [])]
    points.sort(key=lambda point: float(point.u[0]))
    d = scaled.states
    values = scaled.eigenvalues(np.array([point.jacobian for point in points]).reshape(-1, d, d + 1))
    return BoxEquilibria(
        parameter=parameter,
        state=np.array([point.u[:d] * scaled.scale[:d] for point in points]).reshape(-1, d),
        eigenvalues_real=values.real,
        eigenvalues_imag=values.imag,
        residual=np.array([point.residual for point in points]),
        starts=options.starts,
    )


def equilibrium_branches(
    box: BlackBox, options: ContinuationOptions | None = None, search_options: SearchOptions | None = None
) -> EquilibriumPicture:
    """Return the complete picture: search at several parameters, continuation of all that is found, crossings followed.

    Args:
        box: a field of one parameter.
        options: steps of the continuation.
        search_options: how thoroughly to search.

    Raises:
        RefusedError: the field cannot be evaluated anywhere in the box.
    """
    scaled = scaled_field(box)
    options, search_options = options or ContinuationOptions(), search_options or SearchOptions()
    branches: list[EquilibriumBranch] = []
    low, high = box.parameter_range[0]
    few = search_options.parameters < 3  # rather inside than at an end
    places = np.linspace(low, high, search_options.parameters + 2 * few)[few : -1 if few else None]
    for parameter in places.tolist():
        known = [state for branch in branches for state in states_at(box, branch, parameter)]
        for u in search(scaled, parameter, search_options, known):
            state = u[:-1] * scaled.scale[:-1]
            if _is_known(scaled, box, branches, state, parameter):
                continue
            start = equilibrium_near(scaled, u)
            if start is None:
                continue
            branch = followed(scaled, start, options)
            if not any(_same(box, branch, known_branch) for known_branch in branches):
                _add(box, branches, branch, options)
    return EquilibriumPicture(
        branches=tuple(branches),
        limit_points=tuple(sorted((p for b in branches for p in b.limit_points), key=lambda point: point.parameter)),
        hopf_points=tuple(sorted((p for b in branches for p in b.hopf_points), key=lambda point: point.parameter)),
        searched=places,
        starts=search_options.starts,
    )


def _add(
    box: BlackBox, branches: list[EquilibriumBranch], branch: EquilibriumBranch, options: ContinuationOptions
) -> None:
    """Add a branch and all that cross it, and those that cross them."""
    waiting = [branch]
    while waiting:
        branch = waiting.pop()
        branches.append(branch)
        for crossing in branch.branch_points:
            try:
                other = other_branch(box, crossing, options)
            except RefusedError:
                continue
            if not any(_same(box, other, known) for known in [*branches, *waiting]):
                waiting.append(other)


def _same(box: BlackBox, one: EquilibriumBranch, other: EquilibriumBranch) -> bool:
    """Tell whether one of three points spread over a branch, not all of which are crossings or turns, is on another."""
    scaled = scaled_field(box)
    places = (np.array([0.23, 0.5, 0.77]) * (len(one.parameter) - 1)).astype(int)
    return any(
        _is_known(scaled, box, [other], one.state[index], float(one.parameter[index])) for index in places.tolist()
    )


def _is_known(
    scaled: ScaledField, box: BlackBox, branches: list[EquilibriumBranch], state: FloatArray, parameter: float
) -> bool:
    sizes = scaled.scale[:-1]
    return any(
        np.abs((known - state) / sizes).max() < _SAME
        for branch in branches
        for known in states_at(box, branch, parameter)
    )


def states_at(box: BlackBox, branch: EquilibriumBranch, parameter: float) -> list[FloatArray]:
    """Return the states, each shape (d,), where a branch passes a parameter, in the order of the branch."""
    scaled = scaled_field(box)
    u = np.column_stack((branch.state, branch.parameter)) / scaled.scale
    offset = branch.parameter - parameter
    states: list[FloatArray] = []
    for index in np.flatnonzero(
        ((offset[:-1] < 0.0) != (offset[1:] < 0.0)) & (offset[1:] != 0.0) | (offset[:-1] == 0.0)
    ).tolist():
        share = offset[index] / (offset[index] - offset[index + 1]) if offset[index] else 0.0
        point = at_parameter(scaled, u[index], u[index + 1], share, parameter / scaled.scale[-1])
        if point is not None:
            states.append(point.u[:-1] * scaled.scale[:-1])
    if offset.size and offset[-1] == 0.0:
        states.append(branch.state[-1].copy())
    return states


def at_parameter(
    scaled: ScaledField, one: FloatArray, other: FloatArray, share: float, parameter: float
) -> PathPoint | None:
    """Return the equilibrium at a scaled parameter between two points, from the chord's guess; nothing if lost."""
    guess = one + share * (other - one)
    row = _up(scaled)
    try:
        found = correct(scaled, guess, row, parameter, scaled.jacobian(guess))
        return None if found is None else point_at(scaled, found, other - one)
    except FieldError:
        return None


def search(scaled: ScaledField, parameter: float, options: SearchOptions, known: list[FloatArray]) -> list[FloatArray]:
    """Return equilibria, scaled unknowns of shape (d + 1,), in the box of states at a parameter; no known one."""
    from scipy.stats import qmc  # noqa: PLC0415 - half a second, which whoever searches no field need not pay

    d = scaled.states
    low, high = scaled.limits[:d].T
    found = _Found(scaled, parameter / scaled.scale[d], options, [state / scaled.scale[:d] for state in known])
    found.spread()
    for share in qmc.Sobol(d, seed=0).random(options.starts):
        try:
            x = _newton(scaled, low + share * (high - low), found.parameter, found.roots)
        except (FieldError, np.linalg.LinAlgError):
            continue
        if x is not None and found.add(x) >= 0:
            found.spread()
    return [np.append(x, found.parameter) for x in found.roots[len(known) :]]


@final
class _Found:
    """Equilibria at one parameter, and which curves through each have been followed."""

    def __init__(self, scaled: ScaledField, parameter: float, options: SearchOptions, roots: list[FloatArray]) -> None:
        self._scaled = scaled
        self._options = options
        self.parameter = parameter
        self.roots = roots
        self._curves: list[set[int]] = [set() for _ in roots]

    def add(self, x: FloatArray) -> int:
        """Return the place of an equilibrium, new or known; -1 if it lies outside the box."""
        low, high = self._scaled.limits[: self._scaled.states].T
        if not ((low <= x) & (x <= high)).all():
            return -1
        for place, root in enumerate(self.roots):
            if np.abs(x - root).max() < _SAME:
                return place
        self.roots.append(x)
        self._curves.append(set())
        return len(self.roots) - 1

    def spread(self) -> None:
        """Follow every curve through every equilibrium, once."""
        rows = range(self._scaled.states)
        while left := [(p, row) for p in range(len(self.roots)) for row in rows if row not in self._curves[p]]:
            place, row = left[0]
            self._curves[place].add(row)
            met = equilibria_along(self._scaled, self.roots[place], self.parameter, row, self._options.steps)
            for other in [self.add(x) for x in met]:
                if other >= 0:
                    self._curves[other].add(row)


def _newton(scaled: ScaledField, x: FloatArray, parameter: float, roots: list[FloatArray]) -> FloatArray | None:
    """Return the equilibrium that deflated Newton's method reaches, or nothing."""
    low, high = scaled.limits[: scaled.states].T
    for _ in range(_ITERATIONS):
        u = np.append(x, parameter)
        residual = scaled(u)
        step = np.linalg.solve(scaled.jacobian(u)[:, :-1], -residual)
        length = float(np.linalg.norm(step))
        if np.abs(residual).max() <= RESIDUAL and length <= _SAME:
            return x + step
        push = 0.0  # of the logarithm of the deflation, the product of 1 + 1/|x - root|² over the roots
        for root in roots:
            away = x - root
            square = float(away @ away)
            if square < _TOUCHING:
                return None
            push += -2.0 * float(away @ step) / (square * (1.0 + square))
        if (slowed := 1.0 - push) == 0.0:
            return None
        step /= slowed
        length /= abs(slowed)
        x = x + step * min(1.0, _LONGEST / length) if length else x
        if ((x < low - _STRAY) | (x > high + _STRAY)).any():
            return None
    return None


def _up(scaled: ScaledField) -> FloatArray:
    row = np.zeros(len(scaled.scale))
    row[scaled.states] = 1.0
    return row

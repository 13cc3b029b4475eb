"""A field x' = f(x, parameters) given only as a function: in what box it is looked at, and its derivatives.

All continuation works in scaled variables, state and parameters divided by their typical sizes, rates by theirs, so
that one tolerance and one difference step serve radians, meters and newtons alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field as field_of
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError

Field = Callable[..., ArrayLike]
"""(state, shape (d,), parameter, ...) -> rates of the state, shape (d,)."""

_EPSILON: Final = float(np.finfo(np.float64).eps)
FIRST_STEP: Final = _EPSILON ** (1 / 3)  # of central differences: rounding and truncation are alike, about 1e-11
_SECOND_STEP: Final = _EPSILON ** (1 / 6)  # of fourth-order second differences, 1e-10
_THIRD_STEP: Final = _EPSILON ** (1 / 7)  # of fourth-order third differences, 1e-9
_PROBES: Final = 8  # states where the typical rates are read off


@final
class FieldError(Exception):
    """The field could not be evaluated; the message says where. Never leaves this package."""


def by_differences(state: FloatArray, *parameters: float) -> FloatArray:  # pragma: no cover - a mark, never called
    """Stand for "no Jacobian is given"."""
    raise NotImplementedError(state, parameters)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BlackBox:
    """A field and the box in which it is looked at.

    Attributes:
        field: (state, parameter, ...) -> rates of the state; autonomous, at least piecewise smooth. A value that is
            not finite, an ArithmeticError, ValueError, InputError or RefusedError means "not defined here".
        state_box: lowest and highest value of each state, shape (d, 2); a branch ends where it leaves the box.
        parameter_range: the same for each parameter, shape (k, 2), or (2,) for a single one.
        state_scale: typical sizes, shape (d,), > 0; default: half the width of the box.
        parameter_scale: the same, shape (k,).
        jacobian: derivatives of the rates by state and parameters, (state, parameter, ...) -> shape (d, d + k);
            by default they are found by central differences of 6e-6 of the typical sizes.

    Raises:
        InputError: shapes that do not fit, a box without an inside, a scale that is not positive.
    """

    field: Field
    state_box: FloatArray
    parameter_range: FloatArray
    state_scale: FloatArray = field_of(default_factory=lambda: frozen_array(()))
    parameter_scale: FloatArray = field_of(default_factory=lambda: frozen_array(()))
    jacobian: Field = by_differences

    def __post_init__(self) -> None:
        """Freeze the arrays, fill in the sizes, check."""
        for box_name, scale_name in (("state_box", "state_scale"), ("parameter_range", "parameter_scale")):
            box = np.atleast_2d(np.asarray(getattr(self, box_name), dtype=np.float64))
            if box.ndim != 2 or box.shape[1] != 2 or not np.isfinite(box).all() or not (box[:, 0] < box[:, 1]).all():
                raise InputError(f"{box_name} must be rows of a finite lowest and highest value, not {box.tolist()}")
            scale = np.asarray(getattr(self, scale_name), dtype=np.float64)
            scale = scale if scale.size else 0.5 * (box[:, 1] - box[:, 0])
            if scale.shape != (len(box),) or not (np.isfinite(scale) & (scale > 0.0)).all():
                raise InputError(f"{scale_name} must be {len(box)} positive numbers, not {scale.tolist()}")
            object.__setattr__(self, box_name, frozen_array(box))
            object.__setattr__(self, scale_name, frozen_array(scale))

    @property
    def states(self) -> int:
        """Number of states, d."""
        return len(self.state_box)

    @property
    def parameters(self) -> int:
        """Number of parameters, k."""
        return len(self.parameter_range)

    def held(self, **parameters: float) -> BlackBox:
        """Return the same field with some parameters held, by place: ``held(second=0.2)`` leaves the first.

        Raises:
            InputError: a place that does not exist, or none is left.
        """
        places = {("first", "second", "third").index(name): value for name, value in parameters.items()}
        left = [index for index in range(self.parameters) if index not in places]
        if not left or max(places, default=0) >= self.parameters:
            raise InputError(f"the field has {self.parameters} parameters; {sorted(parameters)} cannot be held")
        inner, jacobian = self.field, self.jacobian

        def all_of(free: tuple[float, ...]) -> list[float]:
            values = iter(free)
            return [places[index] if index in places else next(values) for index in range(self.parameters)]

        def rates(state: FloatArray, *free: float) -> ArrayLike:
            return inner(state, *all_of(free))

        def derivatives(state: FloatArray, *free: float) -> ArrayLike:
            columns = [*range(self.states), *(self.states + index for index in left)]
            return np.asarray(jacobian(state, *all_of(free)))[:, columns]

        return BlackBox(
            field=rates,
            state_box=self.state_box,
            parameter_range=self.parameter_range[left],
            state_scale=self.state_scale,
            parameter_scale=self.parameter_scale[left],
            jacobian=by_differences if jacobian is by_differences else derivatives,
        )


@final
class ScaledField:
    """The field in scaled variables u = (state / sizes, parameters / sizes).

    Args:
        box: the field.

    Attributes:
        states: number of states, d.
        scale: sizes of the unknowns, shape (d + k,).
        limits: lowest and highest scaled value of each, shape (d + k, 2).
        rate_scale: typical rates, shape (d,): the residual is in their unit.

    Raises:
        RefusedError: the field cannot be evaluated anywhere in the box.
    """

    def __init__(self, box: BlackBox) -> None:
        self.box = box
        self.states = box.states
        self.scale = np.concatenate((box.state_scale, box.parameter_scale))
        self.limits = np.vstack((box.state_box, box.parameter_range)) / self.scale[:, np.newaxis]
        self.rate_scale = np.ones(self.states)
        self.rate_scale = self._typical_rates()

    def _typical_rates(self) -> FloatArray:
        """Return the median over the box of how much each rate changes over the typical sizes."""
        from scipy.stats import qmc  # noqa: PLC0415 - half a second, which whoever follows no field need not pay

        low, high = self.limits.T
        rows = []
        for share in qmc.Sobol(len(low), seed=0).random(_PROBES):
            try:
                rows.append(np.abs(self.jacobian(low + share * (high - low))).sum(axis=1))
            except FieldError as error:
                failure = error
        if not rows:
            raise RefusedError(
                f"the field cannot be evaluated anywhere in the box: {failure}",
                hint="is the box where the field is defined?",
            )
        typical: FloatArray = np.median(rows, axis=0)
        return np.where(typical > 0.0, typical, 1.0)

    def __call__(self, u: FloatArray) -> FloatArray:
        """Return the scaled rates, shape (d,).

        Raises:
            FieldError: they are not defined here.
        """
        x = u * self.scale
        d = self.states
        try:
            rates = np.asarray(self.box.field(x[:d], *x[d:].tolist()), dtype=np.float64)
        except (ArithmeticError, ValueError, InputError, RefusedError) as error:
            raise FieldError(f"at state {_shown(x[:d])}, parameter {_shown(x[d:])}: {error}") from error
        if rates.shape != (d,):
            raise InputError(f"the field returns shape {rates.shape} for {d} states")
        if not math.isfinite(rates.sum()):
            raise FieldError(f"at state {_shown(x[:d])}, parameter {_shown(x[d:])}: {rates.tolist()}")
        scaled: FloatArray = rates / self.rate_scale
        return scaled

    def along(self, points: FloatArray) -> FloatArray:
        """Return the scaled rates at many points, shape (n, d), as a call does at each; ``points``: (n, d + k).

        Raises:
            FieldError: they are not defined at one of them.
        """
        d, field = self.states, self.box.field
        x = points * self.scale
        parameters = x[:, d:].tolist()
        try:
            rates = np.array(
                [field(state, *free) for state, free in zip(x[:, :d], parameters, strict=True)], np.float64
            )
            if rates.shape == (len(x), d) and math.isfinite(rates.sum()):
                return np.asarray(rates / self.rate_scale)
        except (ArithmeticError, ValueError, InputError, RefusedError):
            pass
        return np.array([self(point) for point in points])  # which says where it fails, and how

    def jacobians(self, points: FloatArray) -> FloatArray:
        """Return the Jacobian at many points, shape (n, d, d + k); ``points``: (n, d + k)."""
        if self.box.jacobian is not by_differences:
            return np.array([self.jacobian(point) for point in points])
        steps = FIRST_STEP * np.eye(points.shape[1])
        up, down = points[:, np.newaxis] + steps, points[:, np.newaxis] - steps
        change = self.along(up.reshape(-1, points.shape[1])) - self.along(down.reshape(-1, points.shape[1]))
        width = np.diagonal(up - down, axis1=1, axis2=2)
        slopes: FloatArray = np.swapaxes(change.reshape(*width.shape, self.states) / width[..., np.newaxis], 1, 2)
        return slopes

    def jacobian(self, u: FloatArray, step: float = FIRST_STEP) -> FloatArray:
        """Return the derivatives of the scaled rates by the scaled unknowns, shape (d, d + k)."""
        if self.box.jacobian is not by_differences:
            x = u * self.scale
            given = np.asarray(self.box.jacobian(x[: self.states], *x[self.states :].tolist()), dtype=np.float64)
            if given.shape != (self.states, len(u)):
                raise InputError(f"the Jacobian has shape {given.shape}, not {(self.states, len(u))}")
            return given * self.scale / self.rate_scale[:, np.newaxis]
        return self._differences(u, len(u), step)

    def state_jacobian(self, u: FloatArray) -> FloatArray:
        """Return the derivatives of the scaled rates by the scaled states, shape (d, d)."""
        if self.box.jacobian is not by_differences:
            return self.jacobian(u)[:, : self.states]
        return self._differences(u, self.states, FIRST_STEP)

    def _differences(self, u: FloatArray, columns: int, step: float) -> FloatArray:
        matrix = np.empty((self.states, columns))
        for column in range(columns):
            up, down = u.copy(), u.copy()
            up[column] += step
            down[column] -= step
            matrix[:, column] = (self(up) - self(down)) / (up[column] - down[column])
        return matrix

    def linear(self, jacobian: FloatArray) -> FloatArray:
        """Return the state Jacobian in the user's units (1 / time), up to a change of units of the states.

        Its eigenvalues are those of the linearized field. ``jacobian`` has shape (..., d, d + k).
        """
        matrix: FloatArray = jacobian[..., : self.states] * (self.rate_scale[:, np.newaxis] / self.scale[: self.states])
        return matrix * self.scale[: self.states] / self.scale[: self.states, np.newaxis]

    def eigenvalues(self, jacobian: FloatArray) -> NDArray[np.complex128]:
        """Return the eigenvalues of the linearized field, 1 / time, shape (..., d)."""
        return np.linalg.eigvals(self.linear(jacobian)).astype(np.complex128)

    def second(self, u: FloatArray, direction: FloatArray, stretch: float = 1.0) -> FloatArray:
        """Return the second derivative of the scaled rates along a scaled direction, shape (d,).

        ``stretch`` multiplies the step of the differences.
        """
        size = float(np.linalg.norm(direction))
        if size == 0.0:
            return np.zeros(self.states)
        h = stretch * _SECOND_STEP / size
        near = self(u + h * direction) + self(u - h * direction)
        far = self(u + 2 * h * direction) + self(u - 2 * h * direction)
        value: FloatArray = (16.0 * near - far - 30.0 * self(u)) / (12.0 * h * h)
        return value

    def mixed(self, u: FloatArray, one: FloatArray, other: FloatArray, stretch: float = 1.0) -> FloatArray:
        """Return the mixed second derivative along two scaled directions, shape (d,)."""
        if np.array_equal(one, other):
            return self.second(u, one, stretch)
        if np.array_equal(one, -other):
            return -self.second(u, one, stretch)
        return 0.25 * (self.second(u, one + other, stretch) - self.second(u, one - other, stretch))

    def third(self, u: FloatArray, direction: FloatArray, stretch: float = 1.0) -> FloatArray:
        """Return the third derivative of the scaled rates along a scaled direction, shape (d,)."""
        size = float(np.linalg.norm(direction))
        if size == 0.0:
            return np.zeros(self.states)
        h = stretch * _THIRD_STEP / size
        odd = [self(u + k * h * direction) - self(u - k * h * direction) for k in (1, 2, 3)]
        value: FloatArray = (8.0 * odd[1] - odd[2] - 13.0 * odd[0]) / (8.0 * h**3)
        return value


def _shown(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"

"""The simulator linearized at a state: dx/dt = rates + A (x - x0) + B (u - u0), by central differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError
from finback.units import quotient, unit_of

Rates = Callable[[FloatArray, FloatArray], ArrayLike]
"""(state, inputs) -> rates of the state, all in SI."""

STEPS: Final = {"rad": 1e-6, "rad_s": 1e-6, "m_s": 1e-3, "n": 1.0}
"""Unit -> step of the differences: rounding and bending leave some 1e-9 of a derivative, inside a cell of a table."""

_RATE: Final = {"rad": "rad_s", "rad_s": "rad_s2", "m_s": "m_s2"}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LinearModel:
    """A linear model with names and units.

    Attributes:
        state_names: names of the d states, each ending in its SI unit.
        input_names: names of the m inputs.
        state: where it is linearized, shape (d,).
        inputs: the same, shape (m,).
        rates: of the state there, shape (d,); zero in an equilibrium.
        A: derivatives of the rates by the state, shape (d, d).
        B: derivatives of the rates by the inputs, shape (d, m).
    """

    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    state: FloatArray
    inputs: FloatArray
    rates: FloatArray
    A: FloatArray
    B: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "inputs", "rates", "A", "B"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of A in 1/s, shape (d,), by rising real part."""
        found = np.linalg.eigvals(self.A).astype(np.complex128)
        return found[np.lexsort((found.imag, found.real))]

    def units(self) -> tuple[tuple[tuple[str, ...], ...], tuple[tuple[str, ...], ...]]:
        """Return the units of A and of B, row by row: rate of the row's state by the column's state or input."""
        rates = [_RATE[unit_of(name)] for name in self.state_names]
        return (
            tuple(tuple(quotient(rate, unit_of(name)) for name in self.state_names) for rate in rates),
            tuple(tuple(quotient(rate, unit_of(name)) for name in self.input_names) for rate in rates),
        )


def linear_model(
    rates: Rates,
    *,
    state_names: tuple[str, ...],
    input_names: tuple[str, ...],
    state: ArrayLike,
    inputs: ArrayLike,
) -> LinearModel:
    """Linearize a right-hand side.

    Args:
        rates: the right-hand side.
        state_names: names of the states, with SI units.
        input_names: names of the inputs, with SI units.
        state: where, shape (d,).
        inputs: where, shape (m,).

    Raises:
        InputError: the shapes do not fit the names, or a number is not finite.
    """
    x, u = np.asarray(state, dtype=np.float64), np.asarray(inputs, dtype=np.float64)
    if x.shape != (len(state_names),) or u.shape != (len(input_names),):
        raise InputError(f"{state_names} and {input_names} do not fit shapes {x.shape} and {u.shape}")
    if not (np.isfinite(x).all() and np.isfinite(u).all()):
        raise InputError(f"not a state that can be linearized: {x.tolist()}, inputs {u.tolist()}")
    columns = []
    both, count = np.concatenate((x, u)), len(x)
    for index, name in enumerate((*state_names, *input_names)):
        up, down = both.copy(), both.copy()
        up[index] += STEPS[unit_of(name)]
        down[index] -= STEPS[unit_of(name)]
        change = np.subtract(rates(up[:count], up[count:]), rates(down[:count], down[count:]))
        columns.append(change / (up[index] - down[index]))
    matrix = np.column_stack(columns)
    return LinearModel(
        state_names=state_names,
        input_names=input_names,
        state=frozen_array(x),
        inputs=frozen_array(u),
        rates=frozen_array(rates(x, u)),
        A=frozen_array(matrix[:, :count]),
        B=frozen_array(matrix[:, count:]),
    )

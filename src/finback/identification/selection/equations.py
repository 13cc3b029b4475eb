"""The weak equations of all candidates, linearized about smoothed states and whitened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.identification.model_form import ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.selection.regression import Regression
from finback.identification.smoothing import smooth
from finback.identification.stretch import Stretch
from finback.identification.weak_form import WeakForm, weak_form
from finback.identification.whitening import whitening

_MEMORY: Final = 2.5
"""How long the smoother trusts the model, in half widths, as in the estimate."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equations:
    """Whitened rows of all stretches: the noise of the targets is white with variance 1.

    Attributes:
        regressors: shape (n, p), (dα/dt, dq/dt) per test function.
        target: shape (n,).
        blocks: which block of about a second each row belongs to, shape (n,): the unit of resampling.
    """

    regressors: FloatArray
    target: FloatArray
    blocks: IntArray

    def regression(self) -> Regression:
        """Return all rows as one regression."""
        return Regression.of(self.regressors, self.target)

    def without(self, columns: IntArray) -> Equations:
        """Return what is left when some columns have explained all that they can; they are there no more."""
        if not columns.size:
            return self
        basis = np.linalg.qr(self.regressors[:, columns])[0]
        rest = np.delete(self.regressors, columns, axis=1)
        return Equations(
            regressors=frozen_array(rest - basis @ (basis.T @ rest)),
            target=frozen_array(self.target - basis @ (basis.T @ self.target)),
            blocks=self.blocks,
        )


@final
class Linearization:
    """Weak equations whose point of linearization follows the model that is found.

    Args:
        used: the data.
        form: the candidates.
        options: window and test functions.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
    """

    def __init__(
        self, used: Sequence[Stretch], form: ModelForm, options: IdentificationOptions, noise: FloatArray
    ) -> None:
        self.form = form
        self.noise = noise
        self.coefficients = np.zeros(form.size)
        self._half_width_s = options.half_width_s
        self._weak: tuple[WeakForm, ...] = tuple(weak_form(stretch, form, options) for stretch in used)
        self._states: list[FloatArray] = [stretch.measured for stretch in used]

    @property
    def states(self) -> tuple[FloatArray, ...]:
        """Smoothed (alpha, q) of each stretch, shape (n, 2)."""
        return tuple(self._states)

    def equations(self) -> Equations:
        """Return the equations at the present states and model."""
        sides = [weak.sides(self.coefficients, state) for weak, state in zip(self._weak, self._states, strict=True)]
        white = whitening(self._weak, sides, self.noise)
        regressors = np.concatenate(
            [weak.regressors(side).reshape(-1, self.form.size) for weak, side in zip(self._weak, sides, strict=True)]
        )
        target = np.concatenate(
            [
                weak.target(side, state).ravel()
                for weak, side, state in zip(self._weak, sides, self._states, strict=True)
            ]
        )
        rows = white(np.column_stack([regressors, target]))
        return Equations(regressors=frozen_array(rows[:, :-1]), target=frozen_array(rows[:, -1]), blocks=self._blocks())

    def follow(self, coefficients: FloatArray, *, variance: float) -> None:
        """Smooth the states with a model; one that misses by s deviations of the noise is trusted s times shorter."""
        self.coefficients = coefficients
        memory = _MEMORY * self._half_width_s / np.sqrt(max(1.0, variance))
        self._states = [
            smooth(weak.stretch, self.form, coefficients, noise=self.noise, memory_s=memory, start=state)
            for weak, state in zip(self._weak, self._states, strict=True)
        ]

    def _blocks(self) -> IntArray:
        """Number the blocks: each as long as five half widths, beyond which test functions have nothing in common."""
        numbers, first = [], 0
        for weak in self._weak:
            length = max(1, round(5 * weak.bump.reach / weak.stride))
            own = first + np.arange(weak.starts.size) // length
            numbers.append(np.repeat(own, 2))
            first = int(own[-1]) + 1
        return np.concatenate(numbers)

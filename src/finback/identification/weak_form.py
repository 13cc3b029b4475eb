"""The weak (integral) form of both equations on one stretch of data.

With a bump w that vanishes at both ends of its support, dx/dt = F(x, δ) becomes -∫ w' x dt = ∫ w F(x, δ) dt: no
signal is differentiated. Noise of alpha and q enters the left side through w' and the right side through F. Both
sides are linearized about a smoothed state x̂, so that noise enters linearly, with a covariance that is known, and
the regressors are (nearly) free of it: no bias from alpha², alpha³ is left to be corrected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from finback.arrays import FloatArray, IntArray
from finback.identification.bump import Bump, bump
from finback.identification.correction import corrected, signals_of_extras
from finback.identification.field import Field, combined, field
from finback.identification.model_form import Equation, ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, half_width_samples
from finback.identification.term import Term
from finback.records import Hold

_ELEVATOR: Final = Term.of(elevator_rad=1)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sides:
    """The form's right sides at every sample, just before and just after what jumps there.

    Attributes:
        mean: rates, derivatives: half the sum of both sides.
        jump: the side after less the side before; all zero unless an input is held.
    """

    mean: Field
    jump: Field


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class WeakForm:
    """The weak equations of one stretch: K test functions, two equations each.

    Attributes:
        stretch: the data.
        form: the model's form.
        bump: the test function's weights.
        stride: samples between neighboring test functions.
        starts: first sample of each test function, shape (K,).
        left: -∫ w' x dt of the measured x, shape (K, 2).
        elevator: ∫ w δ dt, shape (K,).
        jumps_rad: how far a held elevator jumps at each sample, shape (n,); zero unless it is held.
    """

    stretch: Stretch
    form: ModelForm
    bump: Bump
    stride: int
    starts: IntArray
    left: FloatArray
    elevator: FloatArray
    jumps_rad: FloatArray

    def integral(self, signal: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the weighted sum of ``signal``, shape (n,), under each test function, shape (K,)."""
        return _windows(signal, self.starts, self.bump) @ weights

    def windows(self, signal: FloatArray) -> FloatArray:
        """Return the samples under each test function, shape (K, 2 m + 1)."""
        return _windows(signal, self.starts, self.bump)

    def sides(self, coefficients: FloatArray, state: FloatArray) -> Sides:
        """Evaluate the form at ``state`` (n, 2), on both sides of what jumps."""
        after = field(self.form, coefficients, state, self.stretch.inputs)
        if not self.stretch.held.any():
            return Sides(mean=after, jump=combined(after, after, 1.0, -1.0))
        before = field(self.form, coefficients, state, self.stretch.inputs_before)
        return Sides(mean=combined(after, before, 0.5, 0.5), jump=combined(after, before, 1.0, -1.0))

    def regressors(self, sides: Sides) -> FloatArray:
        """Return the integrals of the derivatives by the coefficients, shape (K, 2, p)."""
        result = np.zeros((self.starts.size, 2, self.form.size))
        for equation, column in np.argwhere(sides.mean.sensitivity.any(axis=0)).tolist():
            result[:, equation, column] = self._integral_of_jumping(
                sides.mean.sensitivity[:, equation, column], sides.jump.sensitivity[:, equation, column]
            )
        # The elevator itself needs no rule: its integral is exact.
        held = self.stretch.interval_s / 12 * self.integral(self.jumps_rad, self.bump.slope)
        for equation, name in enumerate(Equation):
            if (name, _ELEVATOR) in self.form.terms:
                result[:, equation, self.form.index(name, _ELEVATOR)] = self.elevator + held
        return result

    def target(self, sides: Sides, state: FloatArray) -> FloatArray:
        """Return what the regressors at ``state`` must explain, shape (K, 2).

        It is the left side less the part of the right side that is linear in (measured - state).
        """
        linear = np.einsum("nij,nj->ni", sides.mean.jacobian, self.stretch.measured - state)
        # The trapezoidal rule misses interval²/12 of every jump of the integrand's slope; where a held elevator
        # jumps, so does the slope of x, and with it that of F.
        linear += self.stretch.interval_s / 12 * np.einsum("nij,nj->ni", sides.mean.jacobian, sides.jump.rates)
        if self.form.implicit:  # the regressors hold dα/dt twice, as a value and as a function of the coefficients
            linear[:, 1] -= sides.mean.implicit * sides.mean.rates[:, 0]
        return self.left - np.stack([self.integral(linear[:, i], self.bump.value) for i in range(2)], axis=1)

    def corrected(self, extras: FloatArray) -> WeakForm:
        """Return the equations of the stretch without these biases and this delay, shape (4,)."""
        stretch = corrected(self.stretch, extras)
        return self if stretch is self.stretch else _integrated(stretch, self.form, self.bump, self.stride, self.starts)

    def extras(self, sides: Sides) -> FloatArray:
        """Return how biases and the delay, more than they are, would move the equations, shape (K, 2, 4)."""
        signals = signals_of_extras(self.stretch, sides.mean)
        columns = [self.integral(column, self.bump.value) for column in signals.reshape(len(signals), -1).T]
        return np.stack(columns, axis=1).reshape(-1, *signals.shape[1:])

    def noise_rows(self, sides: Sides, noise: FloatArray) -> FloatArray:
        """Return how unit noise at each sample moves the target, shape (K, 2, 2, 2 m + 1).

        Indices: test function, equation, channel (alpha, q), sample under the test function. ``noise`` holds the
        standard deviations of both channels.
        """
        rows = np.empty((self.starts.size, 2, 2, self.bump.value.size))
        for equation in range(2):
            for channel in range(2):
                rows[:, equation, channel] = -self.bump.value * self.windows(sides.mean.jacobian[:, equation, channel])
            rows[:, equation, equation] -= self.bump.slope
        return rows * noise[:, np.newaxis]

    def _integral_of_jumping(self, mean: FloatArray, jump: FloatArray) -> FloatArray:
        """Integrate a signal that jumps at samples: by the trapezoidal rule, less what it misses at a jump."""
        whole = self.integral(mean, self.bump.value)
        return whole + self.stretch.interval_s / 12 * self.integral(jump, self.bump.slope) if jump.any() else whole


def weak_form(stretch: Stretch, form: ModelForm, options: IdentificationOptions) -> WeakForm:
    """Lay test functions over a stretch and integrate what does not change with the estimate."""
    reach = half_width_samples(options.half_width_s, stretch.interval_s)
    stride = max(1, round(options.spacing_s / stretch.interval_s))
    weights = bump(reach, stretch.interval_s, stretch.hold)
    starts = np.arange(0, len(stretch) - 2 * reach, stride, dtype=np.int64)
    return _integrated(stretch, form, weights, stride, starts)


def _integrated(stretch: Stretch, form: ModelForm, weights: Bump, stride: int, starts: IntArray) -> WeakForm:
    held = stretch.hold is Hold.ZOH
    jumps = np.diff(stretch.elevator_rad, prepend=stretch.elevator_rad[:1]) if held else np.zeros(len(stretch))
    return WeakForm(
        stretch=stretch,
        form=form,
        bump=weights,
        stride=stride,
        starts=starts,
        left=-np.stack([_windows(stretch.measured[:, i], starts, weights) @ weights.slope for i in range(2)], axis=1),
        elevator=_windows(stretch.elevator_rad, starts, weights) @ weights.elevator,
        jumps_rad=jumps,
    )


def _windows(signal: FloatArray, starts: IntArray, weights: Bump) -> FloatArray:
    """Return the samples under each test function, shape (K, 2 m + 1)."""
    windows: FloatArray = sliding_window_view(signal, weights.value.size)[starts]
    return windows

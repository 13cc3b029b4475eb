"""The weak (integral) form of both equations on one stretch of data.

With a bump w that vanishes at both ends of its support, dx/dt = F(x, δ) becomes -∫ w' x dt = ∫ w F(x, δ) dt: no
signal is differentiated. Noise of alpha and q enters the left side through w' and the right side through F. Both
sides are linearized about a smoothed state x̂, so that noise enters linearly, with a covariance that is known, and
the regressors are (nearly) free of it: no bias from alpha², alpha³ is left to be corrected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from finback.arrays import FloatArray, IntArray
from finback.identification.bump import Bump, bump
from finback.identification.form import Form
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, half_width_samples
from finback.records import Hold


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
    form: Form
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

    def regressors(self, state: FloatArray) -> FloatArray:
        """Return the integrals of every term at ``state`` (n, 2), shape (K, 2, p): [:, equation, coefficient]."""
        constant = np.full(self.starts.size, self.bump.value.sum())
        q = self.integral(state[:, 1], self.bump.value)
        alpha = [self.integral(state[:, 0] ** k, self.bump.value) for k in range(1, max(self.form.alpha_order) + 1)]
        # The trapezoidal rule misses interval²/12 of every jump of the integrand's slope; where a held elevator
        # jumps, so does the slope of x, in proportion to the elevator's own coefficient.
        held = self.stretch.interval_s / 12 * self.integral(self.jumps_rad, self.bump.slope)
        split = self.form.sizes[0]
        result = np.zeros((self.starts.size, 2, self.form.size))
        for equation, columns in enumerate((slice(0, split), slice(split, None))):
            terms = [constant, q, *alpha[: self.form.alpha_order[equation]], self.elevator + held]
            result[:, equation, columns] = np.stack(terms, axis=1)
        return result

    def target(self, coefficients: FloatArray, state: FloatArray) -> FloatArray:
        """Return what the regressors at ``state`` must explain, shape (K, 2).

        It is the left side less the part of the right side that is linear in (measured - state).
        """
        jacobian = self.form.jacobian(coefficients, state)
        linear = np.einsum("nij,nj->ni", jacobian, self.stretch.measured - state)
        # Again the jumps of a held elevator, now those of the slope of F itself.
        gains = np.array([part[-1] for part in self.form.split(coefficients)])
        linear += self.stretch.interval_s / 12 * (jacobian @ gains) * self.jumps_rad[:, np.newaxis]
        return self.left - np.stack([self.integral(linear[:, i], self.bump.value) for i in range(2)], axis=1)

    def noise_rows(self, coefficients: FloatArray, state: FloatArray, noise: FloatArray) -> FloatArray:
        """Return how unit noise at each sample moves the target, shape (K, 2, 2, 2 m + 1).

        Indices: test function, equation, channel (alpha, q), sample under the test function. ``noise`` holds the
        standard deviations of both channels.
        """
        jacobian = self.form.jacobian(coefficients, state)
        rows = np.empty((self.starts.size, 2, 2, self.bump.value.size))
        for equation in range(2):
            for channel in range(2):
                rows[:, equation, channel] = -self.bump.value * self.windows(jacobian[:, equation, channel])
            rows[:, equation, equation] -= self.bump.slope
        return rows * noise[:, np.newaxis]


def weak_form(stretch: Stretch, form: Form, options: IdentificationOptions) -> WeakForm:
    """Lay test functions over a stretch and integrate what does not change with the estimate."""
    reach = half_width_samples(options.half_width_s, stretch.interval_s)
    stride = max(1, round(options.spacing_s / stretch.interval_s))
    weights = bump(reach, stretch.interval_s, stretch.hold)
    starts = np.arange(0, len(stretch) - 2 * reach, stride, dtype=np.int64)
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

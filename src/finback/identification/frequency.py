"""Equation error in the frequency domain: finite Fourier transforms of both equations, within a band.

With a window w that vanishes at both ends, dx/dt = F(x, δ) becomes -∫ (w e^{-iωt})' x dt = ∫ w e^{-iωt} F(x, δ) dt
(Shinbrot 1957; Morelli & Grauer 2020, J. Aircraft 57(6)): no signal is differentiated, and what lies outside the band,
drifts below and noise above, does not count. The noise covariance of all transforms of a stretch is known, and used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol, final

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.identification.correction import corrected, signals_of_extras
from finback.identification.elimination import project
from finback.identification.estimate import Estimate, solve_parts
from finback.identification.field import Field, combined, field
from finback.identification.model_form import Equation, ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.smoothing import smooth
from finback.identification.stretch import Stretch
from finback.identification.term import Term

_TAPER: Final = 0.1
"""Share of a stretch over which the window rises, and falls."""
_LONGEST_S: Final = 30.0
"""Longer stretches are cut: their covariance would be a large matrix, and no maneuver is longer."""
_MOST_ITERATIONS: Final = 12
_CONVERGED: Final = 1e-3
"""In standard errors."""
_MEMORY_S: Final = 0.5
"""How long the smoother trusts the model."""
_ELEVATOR: Final = Term.of(elevator_rad=1)


class Sampled(Protocol):
    """Uniform samples."""

    @property
    def interval_s(self) -> float:
        """Time between them, in s."""

    def __len__(self) -> int: ...


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Transform:
    """Test functions w cos ωt and w sin ωt of one stretch, two rows for each frequency.

    Attributes:
        value: weights of the trapezoidal rule for the integral of test function times signal, in s, shape (K, n).
        slope: for that of its derivative, without unit, shape (K, n).
    """

    value: FloatArray
    slope: FloatArray


def transforms(stretch: Sampled, band_1_s: tuple[float, float]) -> tuple[Transform, ...]:
    """Lay test functions over a stretch: frequencies in the band (in Hz), one over the duration apart."""
    pieces = max(1, math.ceil(len(stretch) * stretch.interval_s / _LONGEST_S))
    edges = np.linspace(0, len(stretch) - 1, pieces + 1).round().astype(np.int64)
    found = []
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        time = (np.arange(len(stretch)) - first) * stretch.interval_s
        duration = (last - first) * stretch.interval_s
        lowest = max(math.ceil(band_1_s[0] * duration), 1)
        orders = np.arange(lowest, math.floor(band_1_s[1] * duration) + 1)
        share = np.clip(time / duration, 0.0, 1.0)
        edge = np.minimum(np.minimum(share, 1.0 - share) / _TAPER, 1.0)
        # Three derivatives are continuous where the taper ends, or the trapezoidal rule would miss their jumps.
        window = edge**4 * (35.0 - 84.0 * edge + 70.0 * edge**2 - 20.0 * edge**3)
        rising = np.where(share < 0.5, 1.0, -1.0) / (_TAPER * duration)
        slope = rising * 140.0 * edge**3 * (1.0 - edge) ** 3
        omega = (2.0 * np.pi / duration * orders)[:, np.newaxis]
        cosine, sine = np.cos(omega * time), np.sin(omega * time)
        value = np.stack([window * cosine, window * sine], axis=1).reshape(-1, time.size)
        slopes = np.stack(
            [slope * cosine - omega * window * sine, slope * sine + omega * window * cosine], axis=1
        ).reshape(-1, time.size)
        if orders.size:
            found.append(Transform(value=value * stretch.interval_s, slope=slopes * stretch.interval_s))
    return tuple(found)


def frequency_estimate(
    used: Sequence[Stretch],
    form: ModelForm,
    start: Estimate,
    *,
    noise: FloatArray,
    band_1_s: tuple[float, float],
    nuisances: Nuisances,
) -> Estimate:
    """Fit the transforms of all stretches together.

    Args:
        used: the data.
        form: the model's form.
        start: the estimate of the weak form.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,), both > 0.
        band_1_s: lowest and highest frequency, in Hz.
        nuisances: biases and a delay that are estimated for each stretch.

    Raises:
        RefusedError: the band holds too few frequencies, or the data cannot determine every coefficient.
        InputError: the band is none.
    """
    if not 0 < band_1_s[0] < band_1_s[1] < math.inf:
        raise InputError(f"band_hz is {band_1_s}, expected two frequencies > 0, the lower one first")
    coefficients, states, extras = start.coefficients, list(start.states), np.array(start.extras)
    now = [corrected(stretch, values) for stretch, values in zip(used, extras, strict=True)]
    tests = [transforms(stretch, band_1_s) for stretch in used]
    rows_of_each = [sum(test.value.shape[0] for test in mine) for mine in tests]
    if 2 * sum(rows_of_each) < 2 * form.free.size:
        raise RefusedError(
            f"the band of {band_1_s[0]:g} to {band_1_s[1]:g} Hz holds {sum(rows_of_each) // 2} frequencies of these "
            f"flights, too few for {form.free.size} coefficients",
            hint="widen band_hz, or fly longer or more maneuvers",
        )
    for iteration in range(1, _MOST_ITERATIONS + 1):
        parts = [
            project(
                np.concatenate([_whitened(test, piece, form, coefficients, state, noise) for test in mine]),
                values,
                nuisances,
                piece.flight,
            )
            for mine, piece, state, values in zip(tests, now, states, extras, strict=True)
            if mine
        ]
        solution = solve_parts(parts, form, coefficients)
        moved = np.abs(solution.coefficients - coefficients)
        coefficients = solution.coefficients
        deviations = np.sqrt(max(1.0, solution.variance) * np.diag(solution.covariance))
        converged = iteration > 1 and bool((moved <= _CONVERGED * deviations).all())
        there = [i for i, mine in enumerate(tests) if mine]  # a stretch too short for the band says nothing
        extras[there] += np.stack([part.local(coefficients) for part in parts])
        if converged:
            break
        now = [corrected(stretch, values) for stretch, values in zip(used, extras, strict=True)]
        memory = _MEMORY_S / np.sqrt(max(1.0, solution.variance))
        states = [
            smooth(stretch, form, coefficients, noise=noise, memory_s=memory, start=state)
            for stretch, state in zip(now, states, strict=True)
        ]
    extra_errors = np.zeros_like(extras)
    extra_errors[there] = np.stack([part.local_errors(solution.covariance) for part in parts])
    rows = [part.rows[: 2 * count] for part, count in zip(parts, filter(None, rows_of_each), strict=True)]
    rest = [part.rest[: 2 * count] for part, count in zip(parts, filter(None, rows_of_each), strict=True)]
    return Estimate(
        coefficients=coefficients,
        covariance=solution.covariance,
        variance=solution.variance,
        residuals=tuple((left - mine @ coefficients).reshape(-1, 2) for left, mine in zip(rest, rows, strict=True)),
        states=tuple(states),
        condition_number=solution.condition_number,
        iterations=iteration,
        converged=converged,
        noise=frozen_array(noise),
        influence=tuple(mine.reshape(-1, 2, form.size) for mine in rows),
        extras=frozen_array(extras),
        extra_errors=frozen_array(extra_errors),
    )


def _whitened(
    test: Transform, stretch: Stretch, form: ModelForm, coefficients: FloatArray, state: FloatArray, noise: FloatArray
) -> FloatArray:
    """Return columns of extras, regressors and target, their noise white with variance 1, shape (2 K, 4 + p + 1)."""
    step = stretch.interval_s
    after = field(form, coefficients, state, stretch.inputs)
    before = field(form, coefficients, state, stretch.inputs_before) if stretch.held.any() else after
    mean, jump = combined(after, before, 0.5, 0.5), combined(after, before, 1.0, -1.0)
    regressors = np.einsum("kn,nep->kep", test.value, mean.sensitivity, optimize=True)
    # The trapezoidal rule misses interval²/12 of every jump of the integrand's slope.
    regressors += step / 12 * np.einsum("kn,nep->kep", test.slope, jump.sensitivity, optimize=True)
    if not stretch.held[0]:
        corners = np.zeros(len(stretch))
        corners[1:-1] = np.diff(stretch.elevator_rad, n=2)
        for equation, name in enumerate(Equation):
            if (name, _ELEVATOR) in form.terms:
                regressors[:, equation, form.index(name, _ELEVATOR)] += test.value @ corners / 12
    linear = np.einsum("nij,nj->ni", mean.jacobian, stretch.measured - state)
    linear += step / 12 * np.einsum("nij,nj->ni", mean.jacobian, jump.rates)
    if form.implicit:
        linear[:, 1] -= mean.implicit * mean.rates[:, 0]
    target = -test.slope @ stretch.measured - test.value @ linear
    own = np.einsum("kn,nej->kej", test.value, signals_of_extras(stretch, mean), optimize=True)
    rows = np.concatenate([own, regressors, target[:, :, np.newaxis]], axis=2).reshape(2 * len(target), -1)
    white: FloatArray = solve_triangular(_factor(test, mean, noise), rows, lower=True, check_finite=False)
    return white


def _factor(test: Transform, mean: Field, noise: FloatArray) -> FloatArray:
    """Return the Cholesky factor of the noise covariance of the target, shape (2 K, 2 K), equations innermost."""
    gains = -np.einsum("kn,nec->kenc", test.value, mean.jacobian, optimize=True)
    for equation in range(2):
        gains[:, equation, :, equation] -= test.slope
    flat = (gains * noise).reshape(2 * len(test.value), -1)
    try:
        factor: FloatArray = cholesky(flat @ flat.T, lower=True, check_finite=False)
    except LinAlgError:
        raise RefusedError(
            "the noise covariance of the transforms is singular", hint="narrow band_hz, or fly longer maneuvers"
        ) from None
    return factor

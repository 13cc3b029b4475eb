"""What noise does to an estimate by equation error: errors of the numbers, and how far they are off on average."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.coefficient.doubts import roundings
from finback.identification.coefficient.known_together import known_together
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.regressor_noise import regressor_noise
from finback.identification.coefficient.sandwich import found_sources
from finback.identification.coefficient.sections import sections
from finback.identification.coefficient.track import Track
from finback.identification.coefficient.weak_equations import Equations
from finback.identification.estimate import Estimate
from finback.identification.noise import noise_deviation

_UNSURE: Final = 0.5
"""Of a correction, its standard error: noises are known to a third of their variance, and to second order only."""
_UNRELIABLE: Final = 0.5
"""Share of what a regressor has by itself that is noise, from which on the noise is as large as the motion: a number
comes out half as large, and no correction to second order tells by how much."""
_WIDER: Final = 2.1
"""Times the errors of white noise, from which on more than white noise is said to be there."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseEffects:
    """An estimate without what noise of the regressors makes of it, and its errors.

    Attributes:
        fit: the estimate; its numbers are corrected, all else is as it was.
        covariance: of the numbers, shape (p, p).
        doubts: what a reader must know of it.
    """

    fit: Estimate
    covariance: FloatArray
    doubts: tuple[str, ...]


def noise_effects(
    used: Sequence[Track], options: CoefficientOptions, fit: Estimate, pieces: Sequence[Equations]
) -> NoiseEffects:
    """Find the noises that explain the residuals, and what they do to the numbers.

    Args:
        used: the data.
        options: form, airframe, test functions.
        fit: by equation error.
        pieces: its equations.

    Raises:
        RefusedError: within these noises, nothing of use is known of some numbers by themselves; or noise is all that
            some regressors have for themselves.
    """
    parts = sections(used, pieces, options, fit.coefficients, fit.noise)
    least = np.array([level.deviation for level in roundings(used)])
    white = [noise_deviation([track.measured[:, k] for track in used]) for k in range(least.size)]
    found = found_sources(
        parts,
        fit.covariance,
        half_width_s=options.half_width_s,
        begun=np.maximum(white, least),
        least=least,
    )
    together = known_together(options.form, fit.coefficients, found.covariance)
    noise = regressor_noise(used, parts, options, fit, found.variances, np.maximum(white, least))
    _check_reliable(options, noise.unreliable)
    off = noise.bias
    numbers = np.clip(fit.coefficients - off, *options.form.bounds.T)
    covariance = found.covariance + _UNSURE**2 * np.outer(off, off)
    errors = np.sqrt(np.diag(covariance))
    return NoiseEffects(
        fit=replace(fit, coefficients=frozen_array(numbers)),
        covariance=covariance,
        doubts=(*_wider(np.sqrt(np.diag(found.white)), errors), *_corrected(off, errors, options), *together),
    )


def _check_reliable(options: CoefficientOptions, unreliable: FloatArray) -> None:
    """Raise RefusedError where noise is as large as what a regressor moves by itself, beside all others."""
    if not (unreliable > _UNRELIABLE).any():
        return
    names = ", ".join(np.array(options.form.labels())[unreliable > _UNRELIABLE].tolist())
    raise RefusedError(
        f"noise of the sensors is as large as the motion that tells these numbers from the others: {names}; they would "
        "come out too small by half and more",
        hint="fly maneuvers: steady flights fix such numbers up to a common factor only; or fix what is known, ask for "
        "fewer terms, or choose method output-error",
    )


def _wider(white: FloatArray, errors: FloatArray) -> tuple[str, ...]:
    """Say that there is more than white noise."""
    free = white > 0.0
    ratio = float(np.median(errors[free] / white[free])) if free.any() else 1.0
    if ratio <= _WIDER:
        return ()
    said = (
        f"errors are {ratio:.3g} times those that the white noise of the records gives (median): sensors with noise of "
        "its own color, gusts, or what the model misses; the errors allow for it as far as residuals show it"
    )
    return (said,)


def _corrected(off: FloatArray, errors: FloatArray, options: CoefficientOptions) -> tuple[str, ...]:
    """Name the numbers that were corrected by more than their error, but for that of the correction itself."""
    large = np.abs(off) > np.sqrt(np.maximum(errors**2 - (_UNSURE * off) ** 2, 0.0))
    if not (large & (errors > 0.0)).any():
        return ()
    names = ", ".join(np.array(options.form.labels())[large & (errors > 0.0)].tolist())
    said = (
        f"noise in the regressors moved numbers by more than their errors, and was corrected for: {names}; half of a "
        "correction counts as its standard error"
    )
    return (said,)

"""The estimator that was asked for, on stretches of data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from finback.errors import RefusedError
from finback.identification.estimate import Estimate, estimate
from finback.identification.filter_error import filter_error
from finback.identification.frequency import frequency_estimate
from finback.identification.method import Method
from finback.identification.noise import Noise
from finback.identification.nuisance import NAMES, Nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.output_error import output_error
from finback.identification.stretch import Stretch
from finback.identification.weak_form import weak_form

_SIZES: Final = "give the expected size of each bias instead of inf: coefficients are told from biases by it alone"


def estimated(used: Sequence[Stretch], options: IdentificationOptions, noise: Noise) -> Estimate:
    """Fit all stretches together; every other method starts from the weak form.

    Raises:
        RefusedError: the data cannot determine every coefficient.
    """
    try:
        return _estimated(used, options, noise)
    except RefusedError as refusal:
        unknown = [
            name for name, size in zip(NAMES, options.nuisances.deviations.tolist(), strict=True) if math.isinf(size)
        ]
        if not unknown:
            raise
        said = f"{refusal.message}; nothing is known of the {' and the '.join(unknown)} of any flight"
        raise RefusedError(said, hint=_SIZES) from None


def _estimated(used: Sequence[Stretch], options: IdentificationOptions, noise: Noise) -> Estimate:
    form = options.model_form
    forms = [weak_form(stretch, form, options) for stretch in used]
    # Output and filter error start from where nothing is known of biases; the others estimate them likewise.
    asked = options.nuisances if options.method in {Method.WEAK_FORM, Method.FREQUENCY} else Nuisances()
    first = estimate(forms, form, noise.assumed, half_width_s=options.half_width_s, nuisances=asked)
    match options.method:
        case Method.OUTPUT_ERROR:
            return output_error(used, form, first, least_noise=noise.least, nuisances=options.nuisances)
        case Method.WEAK_FORM:
            return first
        case Method.FREQUENCY:
            return frequency_estimate(
                used, form, first, noise=noise.assumed, band_1_s=options.band_1_s, nuisances=options.nuisances
            )
        case Method.FILTER_ERROR:
            return filter_error(
                used, form, first, noise=noise.assumed, least_noise=noise.least, nuisances=options.nuisances
            )

"""Whether the air moved the aircraft: output error against filter error, and what that leaves of output error.

Output error lays motion that gusts made to its numbers: where process noise is large beside the sensors', these are off
by many of the standard errors that its residuals can give, corrected for their color or not, because the residuals are
what is left after the numbers have followed the gusts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.channels import channel
from finback.errors import RefusedError
from finback.identification.coefficient.disturbed import disturbed
from finback.identification.coefficient.filter_error import filter_error, likelihood_gain, process_told
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.output_error import Fitted
from finback.identification.coefficient.track import STATES, Track
from finback.identification.coloring import SIGNIFICANT
from finback.identification.estimate import Estimate
from finback.units import from_si, quantity_of

_SIGNIFICANT: Final = 12.0
"""Twice a log-likelihood that process noise must promise to be named and allowed for: of three densities that are
nothing, chance makes as much once in 1000."""
_UNJUDGED: Final = (
    "residuals are as if the motion were disturbed, by turbulence or by what the model misses; standard errors do not "
    "allow for it, because it could not be judged"
)
_DISTURBED: Final = (STATES[0], STATES[1], STATES[3])
"""States on whose rates noise is, in order."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Turbulence:
    """Process noise that explains a flight better.

    Attributes:
        found: the estimate by filter error.
        gain: twice the logarithm by which it makes the records more likely than output error's, without process noise.
    """

    found: Estimate
    gain: float

    def widened(self, numbers: FloatArray) -> FloatArray:
        """Return a covariance of output error's numbers (p,) that holds what filter error knows, shape (p, p)."""
        apart = numbers - self.found.coefficients
        covariance: FloatArray = self.found.covariance + np.outer(apart, apart)
        return covariance

    def statements(self, numbers: FloatArray) -> tuple[str, ...]:
        """Say what it does to output error's numbers (p,)."""
        errors = np.sqrt(np.diag(self.found.covariance))
        free = errors > 0.0
        most = float((np.abs(numbers - self.found.coefficients)[free] / errors[free]).max(initial=0.0))
        said = (
            "the motion is disturbed, by turbulence or by what the model misses: process noise makes the records more "
            f"likely by exp({0.5 * self.gain:.0f}). Output error lays it to the model: its numbers are up to "
            f"{most:.3g} standard errors beside those of filter error; standard errors are widened to hold these: "
            "use method filter-error"
        )
        return (said,)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """What is known of the air of all stretches.

    Attributes:
        turbulence: process noise, if there is some.
        unjudged: why nobody can tell, if so.
    """

    turbulence: tuple[Turbulence, ...] = ()
    unjudged: tuple[str, ...] = ()


def process_noise(
    used: Sequence[Track], options: CoefficientOptions, found: Estimate, least_noise: FloatArray
) -> tuple[str, ...]:
    """Say what disturbed the motion, as filter error finds it; empty in calm air.

    Args:
        used: the data.
        options: form, airframe, biases.
        found: the estimate by filter error.
        least_noise: the least standard deviations of the outputs that are believed, in SI, shape (outputs,).
    """
    told = process_told(used, options, found, least_noise)
    sizes = [
        f"{quantity_of(name)} {from_si(float(np.sqrt(density)), channel(name).display_unit):.3g} "
        f"{channel(name).display_unit}"
        for name, density, known in zip(_DISTURBED, found.process, told, strict=True)
        if known
    ]
    if not sizes:
        return ()
    said = (
        f"the motion is disturbed, per square root of a second by: {', '.join(sizes)}; by turbulence, which the errors "
        "allow for, or by what the model misses or noise of a sensor with a color of its own, which they do not"
    )
    return (said,)


def turbulence(
    used: Sequence[Track],
    options: CoefficientOptions,
    start: Estimate,
    calm: Estimate,
    least_noise: FloatArray,
    *,
    stretches: Sequence[Fitted],
) -> Air:
    """Return the turbulence of all stretches together; nothing if the air was calm.

    Args:
        used: the data.
        options: form, airframe, biases.
        start: the estimate by equation error.
        calm: that by output error.
        least_noise: the least standard deviations of the outputs that are believed, in SI, shape (outputs,).
        stretches: the same, linearized.
    """
    if disturbed(used, options, calm, stretches) > SIGNIFICANT:
        return Air()
    if options.noise_correlated:
        return Air(unjudged=(f"{_UNJUDGED}: filter error takes the noise of the outputs for independent",))
    try:
        found = filter_error(used, options, start, least_noise)
    except RefusedError as refusal:
        return Air(unjudged=(f"{_UNJUDGED}: filter error refuses the flights ({str(refusal).splitlines()[0]})",))
    gain = likelihood_gain(used, options, calm, found, least_noise)
    return Air(turbulence=(Turbulence(found=found, gain=gain),) if gain > _SIGNIFICANT else ())

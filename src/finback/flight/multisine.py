"""Multisines: sums of harmonics of one period, with phases that keep the peak low; several are orthogonal if disjoint.

Power spreads evenly over a band, and all of it is used at once: no other input of the same peak says more in the
same time about an aircraft whose modes are not yet known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError

_EXPONENTS: Final = (4, 8, 16, 32, 64, 128)
"""Of the norms whose minimum approaches that of the peak (Guillaume, Schoukens, Pintelon and Kollár 1991)."""
_POINTS: Final = 16
"""Per shortest period: between points the peak then rises by less than 1 - cos(π/16) = 2 %."""
_FINE: Final = 64
"""Per shortest period, where a peak is told: 0.1 %."""
_STARTS: Final = 4
"""Beginnings of the search: Schroeder's phases, and rearranged ones; the best end counts."""
_MOST_HARMONICS: Final = 2000


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Multisine:
    """Sum over k of amplitude_k · cos(2π harmonic_k t / period + phase_k), a pure number that peaks at ±1 (to 0.1 %).

    Attributes:
        period_s: the common period, > 0.
        harmonics: whole numbers >= 1, rising, shape (n,).
        amplitudes: > 0, shape (n,).
        phases_rad: shape (n,); such that the sum rises through zero at t = 0.
    """

    period_s: float
    harmonics: tuple[int, ...]
    amplitudes: FloatArray
    phases_rad: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "amplitudes", frozen_array(self.amplitudes))
        object.__setattr__(self, "phases_rad", frozen_array(self.phases_rad))

    def __call__(self, time_s: ArrayLike) -> FloatArray:
        """Return the value at ``time_s`` (any shape); it repeats after each period."""
        turns = np.asarray(time_s, dtype=np.float64)[..., np.newaxis] * (2 * math.pi / self.period_s)
        result: FloatArray = np.cos(turns * np.array(self.harmonics) + self.phases_rad) @ self.amplitudes
        return result

    @property
    def relative_peak_factor(self) -> float:
        """(max - min) / (2 √2 rms): 1 for a single sine, about 1.1 for good phases (Klein and Morelli 2006, 9.3)."""
        values = self(_grid(self, _FINE))
        rms = math.sqrt(float(np.sum(self.amplitudes**2)) / 2)
        return float(values.max() - values.min()) / (2 * math.sqrt(2) * rms)


@lru_cache(maxsize=64)  # a twentieth of a second, and a campaign flies the same one again and again
def flat_multisine(harmonics: tuple[int, ...], *, period_s: float) -> Multisine:
    """Return the multisine of equal amplitudes whose phases make the relative peak factor small.

    The search begins at Schroeder's phases (1970) and lowers norms of growing exponent. It is local: the same
    harmonics give the same phases, close to the best ones, but nobody proves them best.

    Args:
        harmonics: whole numbers >= 1, rising: the frequencies in units of 1/period.
        period_s: the common period, > 0.

    Raises:
        InputError: the harmonics are none, do not rise, or are too many; the period is not positive.
    """
    if not harmonics or harmonics[0] < 1 or any(b <= a for a, b in pairwise(harmonics)):
        raise InputError(f"harmonics are whole numbers >= 1 that rise, got {harmonics}")
    if len(harmonics) > _MOST_HARMONICS:
        raise InputError(f"{len(harmonics)} harmonics, expected at most {_MOST_HARMONICS}", hint="shorten the period")
    if not 0 < period_s < math.inf:
        raise InputError(f"a multisine needs a positive period, got {period_s} s")
    orders = np.array(harmonics)
    ends = [_flattened(orders, _start(len(harmonics), number)) for number in range(_STARTS)]
    phases = min(ends, key=lambda end: _peak_to_peak(orders, end))
    return _from_zero(orders, phases, period_s)


def orthogonal_multisines(count: int, *, period_s: float, lowest_hz: float, highest_hz: float) -> tuple[Multisine, ...]:
    """Return a multisine for each of several inputs, all of one band, no two with a common harmonic.

    Over whole periods they are orthogonal in the time and in the frequency domain, so they may be flown together. The
    harmonics of the band are dealt out in turn, so that each input reaches over the whole band.

    Args:
        count: number of inputs, >= 1.
        period_s: the common period; two neighboring harmonics of one input are count/period apart.
        lowest_hz: lower end of the band.
        highest_hz: its upper end.

    Raises:
        InputError: the band holds fewer harmonics than there are inputs.
    """
    harmonics = band_harmonics(period_s=period_s, lowest_hz=lowest_hz, highest_hz=highest_hz)
    if not 1 <= count <= len(harmonics):
        raise InputError(
            f"{len(harmonics)} harmonics of {period_s:g} s between {lowest_hz:g} and {highest_hz:g} Hz are too few for "
            f"{count} inputs",
            hint="lengthen the period or widen the band",
        )
    return tuple(flat_multisine(harmonics[first::count], period_s=period_s) for first in range(count))


def band_harmonics(*, period_s: float, lowest_hz: float, highest_hz: float) -> tuple[int, ...]:
    """Return the harmonics of a period inside a band, both ends included (to 1e-9 of a harmonic)."""
    if not (0 < period_s < math.inf and 0 <= lowest_hz <= highest_hz < math.inf):
        raise InputError(
            f"no band from {lowest_hz:g} to {highest_hz:g} Hz in a period of {period_s:g} s",
            hint="give a positive period and 0 <= lowest <= highest",
        )
    first, last = math.ceil(lowest_hz * period_s - 1e-9), math.floor(highest_hz * period_s + 1e-9)
    return tuple(range(max(1, first), last + 1))


def _start(count: int, number: int) -> FloatArray:
    """Return the phases at which a search begins: Schroeder's (number 0), or scattered ones, the same every time."""
    if number == 0:
        k = np.arange(count)
        return frozen_array(-math.pi * k * (k + 1) / count)
    return frozen_array(np.random.default_rng((number, count)).uniform(-math.pi, math.pi, count))


def _flattened(orders: np.ndarray, phases: FloatArray) -> FloatArray:
    """Lower the norms of growing exponent, one after the other, from ``phases``."""
    from scipy.optimize import minimize  # noqa: PLC0415 - a quarter of a second that only multisines need

    size = _POINTS * int(orders[-1])
    for exponent in _EXPONENTS:
        found = minimize(_log_norm, phases, args=(orders, size, exponent), jac=True, method="L-BFGS-B")
        phases = found.x
    return frozen_array(phases)


def _log_norm(phases: FloatArray, orders: np.ndarray, size: int, exponent: int) -> tuple[float, FloatArray]:
    """Return the logarithm of the norm of sum of cos(orders · t + phases) over a period, and its gradient."""
    spectrum = np.zeros(size, dtype=np.complex128)
    spectrum[orders] = np.exp(1j * phases)
    values = np.fft.ifft(spectrum).real * size
    top = float(np.abs(values).max())
    scaled = values / top
    powers = np.abs(scaled) ** exponent
    total = float(powers.sum())
    slope = np.sign(scaled) * np.abs(scaled) ** (exponent - 1) / (total * top)
    # d value / d phase_k = -sin(order_k t + phase_k): the imaginary part of the transform of the slope at order_k.
    gradient = -np.imag(np.exp(1j * phases) * np.conj(np.fft.fft(slope)[orders]))
    return math.log(top) + math.log(total) / exponent, gradient


def _peak_to_peak(orders: np.ndarray, phases: FloatArray) -> float:
    size = _FINE * int(orders[-1])
    spectrum = np.zeros(size, dtype=np.complex128)
    spectrum[orders] = np.exp(1j * phases)
    values = np.fft.ifft(spectrum).real * size
    return float(values.max() - values.min())


def _from_zero(orders: np.ndarray, phases: FloatArray, period_s: float) -> Multisine:
    """Shift the time so that the sum begins by rising through zero, and scale it to a peak of 1."""
    from scipy.optimize import brentq  # noqa: PLC0415 - as above

    even = Multisine(
        period_s=period_s, harmonics=tuple(orders.tolist()), amplitudes=np.ones(orders.size), phases_rad=phases
    )
    time = _grid(even, _FINE)
    values = even(time)
    after = np.roll(values, -1)
    rising = np.flatnonzero((values <= 0) & (after > 0))
    # The gentlest of the crossings, so that the elevator starts slowly.
    first = int(rising[np.argmin((after - values)[rising])])
    step = period_s / time.size
    start = brentq(lambda t: float(even(t)), time[first], time[first] + step, xtol=1e-15 * period_s)
    return Multisine(
        period_s=period_s,
        harmonics=even.harmonics,
        amplitudes=np.full(orders.size, 1.0 / float(np.abs(values).max())),
        phases_rad=np.mod(phases + 2 * math.pi / period_s * orders * start, 2 * math.pi),
    )


def _grid(signal: Multisine, points: int) -> FloatArray:
    size = points * signal.harmonics[-1]
    return frozen_array(np.arange(size) * (signal.period_s / size))

"""How a number varies over the flights of a campaign: fixed, on a grid, or drawn.

Numbers are in SI. A draw is a function of one uniform number of [0, 1), so that each value costs exactly one.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, final

from finback.errors import InputError

_LARGEST: Final = 1.0 - sys.float_info.epsilon / 2  # of [0, 1); the quantiles of 0 and 1 would be infinite


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fixed:
    """The same in every flight.

    Attributes:
        value: in SI.
    """

    value: float

    def __post_init__(self) -> None:
        """Check the number."""
        _check_finite(self.value)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Each value in turn, combined with every value of the other grids.

    Attributes:
        values: at least one, in SI.
    """

    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_some(self.values)
        _check_finite(*self.values)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Uniform:
    """Drawn evenly from an interval.

    Attributes:
        low: its lower end, in SI.
        high: its upper end, not below.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_finite(self.low, self.high)
        if self.low > self.high:
            raise InputError(f"uniform: {self.low:.6g} is above {self.high:.6g}", hint="give the lower end first")

    def at(self, uniform: float) -> float:
        """Return the value for a uniform number of [0, 1)."""
        return self.low + (self.high - self.low) * uniform


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """Drawn from the normal distribution, cut to an interval if that is finite.

    Attributes:
        mean: before cutting, in SI.
        standard_deviation: before cutting, > 0, in SI.
        low: nothing below is drawn; ``-inf`` for no limit.
        high: nothing above is drawn; ``inf`` for no limit.
    """

    mean: float
    standard_deviation: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_finite(self.mean, self.standard_deviation)
        if self.standard_deviation <= 0:
            raise InputError(f"normal: the standard deviation must be positive, got {self.standard_deviation:.6g}")
        if not self.low <= self.mean <= self.high or self.low == self.high:  # a NaN fails this too
            raise InputError(
                f"normal: its limits {self.low:.6g}…{self.high:.6g} must increase and hold the mean {self.mean:.6g}"
            )

    def at(self, uniform: float) -> float:
        """Return the value for a uniform number of [0, 1): the quantile of the cut distribution."""
        normal = NormalDist(self.mean, self.standard_deviation)
        below, above = normal.cdf(self.low), normal.cdf(self.high)
        share = below + (above - below) * uniform
        drawn = normal.inv_cdf(min(max(share, 1.0 - _LARGEST), _LARGEST))
        return min(max(drawn, self.low), self.high)  # a rounding may pass a limit


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Drawn from some values, each as likely.

    Attributes:
        values: at least one, in SI.
    """

    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_some(self.values)
        _check_finite(*self.values)

    def at(self, uniform: float) -> float:
        """Return the value for a uniform number of [0, 1)."""
        return self.values[int(uniform * len(self.values))]


Spread = Fixed | Grid | Uniform | Normal | Choice
"""Any of them."""


def extremes(spread: Spread) -> tuple[float, ...]:
    """Return the values between which all others lie; nothing is drawn beyond 8.2 standard deviations of a normal."""
    match spread:
        case Fixed(value=value):
            return (value,)
        case Grid(values=values) | Choice(values=values):
            return tuple(dict.fromkeys((min(values), max(values))))
        case Uniform(low=low, high=high):
            return tuple(dict.fromkeys((low, high)))
        case Normal(low=low, high=high):
            return (
                low if math.isfinite(low) else spread.at(0.0),
                high if math.isfinite(high) else spread.at(_LARGEST),
            )


def _check_some(values: tuple[float, ...]) -> None:
    if not values:
        raise InputError("needs at least one value")


def _check_finite(*values: float) -> None:
    for value in values:
        if not math.isfinite(value):
            raise InputError(f"must be a finite number, got {value}")

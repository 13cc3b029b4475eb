"""The digits of a number that its uncertainty supports: two of the uncertainty, and none of the number beyond.

Whoever writes for people (terminal, report, LaTeX) asks here; each then sets the text in its own way.
"""

from __future__ import annotations

import math
from typing import Final

NOT_DETERMINED: Final = "not determined"
"""What is written of a number of which nothing is known: not even its first digit is supported."""
_PLAIN: Final = 4  # powers of ten up to which numbers are written out
_FINEST: Final = 320  # decimals: of the smallest double
_TWO_DIGITS: Final = 99.5  # from here on, a number rounds to three


def decimals(uncertainty: float) -> int:
    """Return how many decimals show two digits of an uncertainty > 0 as rounded; negative where tens are too fine."""
    places = 1 - math.floor(math.log10(uncertainty))
    return places - 1 if uncertainty * 10.0**places >= _TWO_DIGITS else places


def exponent(value: float, uncertainty: float) -> int:
    """Return the power of ten in which the larger of both is from 1 to 10; 0 for two zeros."""
    largest = max(abs(value), uncertainty)
    return math.floor(math.log10(largest)) if largest > 0.0 else 0


def supported(value: float, uncertainty: float, *, power: int = 0, most: int = _FINEST) -> tuple[str, str]:
    """Write a number and its uncertainty, both over a power of ten, with two digits of the uncertainty.

    What rounds to zero has no sign. Digits in front of the point that are not supported are zeros: 1230 and 250.

    Args:
        value: finite.
        uncertainty: finite and > 0, in the unit of the value.
        power: what is written is the number over ten to this power.
        most: decimals at most, where fewer than are supported will do.

    Returns:
        Both texts, such as ``-12.3456`` and ``0.0021``.
    """
    # Decimal powers beyond those of a double are split, so that neither half overflows.
    half, rest = divmod(power, 2)
    scaled = [number / 10.0**half / 10.0 ** (half + rest) for number in (value, uncertainty)]
    places = min(most, decimals(scaled[1])) if scaled[1] > 0.0 else most
    first, second = (f"{round(number, places) + 0.0:z.{max(0, places)}f}" for number in scaled)
    return first, second


def interval(low: float, high: float) -> tuple[str, str]:
    """Write the ends of a 95 % interval with two digits of its half-width; words where they are not finite."""
    half = 0.5 * (high - low)
    if not math.isfinite(half):
        return NOT_DETERMINED, NOT_DETERMINED
    if half <= 0.0:
        return f"{low:.10g}", f"{high:.10g}"
    power = exponent(max(abs(low), abs(high)), half)
    power = 0 if -_PLAIN <= power <= _PLAIN else power
    ends = [supported(end, half, power=power)[0] for end in (low, high)]
    return (ends[0], ends[1]) if not power else (f"{ends[0]}e{power:+03d}", f"{ends[1]}e{power:+03d}")

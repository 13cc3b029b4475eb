"""The zero of a function between two places, as a value also where there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from scipy.optimize import brentq

_MOST: Final = 1000
_ROUNDING: Final = 4.0 * math.ulp(1.0)  # the least that Brent's method allows


def zero_between(
    value: Callable[[float], float], low: float, high: float, *, xtol: float = 1e-300, rtol: float = _ROUNDING
) -> float:
    """Return where a function vanishes between two places (Brent 1973); nan where it does not change its sign there.

    A zero at an end is one. What is not finite on the way counts as the sign that it has; nan gives nan. Where the
    steps allowed do not suffice, as for a function that is flat to all digits, the best place so far is returned.
    """
    known = {place: value(place) for place in (low, high)}
    for place, there in known.items():
        if there == 0.0:
            return place
    if any(math.isnan(there) for there in known.values()) or (known[low] < 0.0) == (known[high] < 0.0):
        return math.nan

    def again(place: float) -> float:
        return known[place] if place in known else value(place)

    try:
        found, _ = brentq(again, low, high, xtol=xtol, rtol=rtol, maxiter=_MOST, full_output=True, disp=False)
    except ValueError:  # nan between the ends, or another value there than a moment ago
        return math.nan
    return float(found)

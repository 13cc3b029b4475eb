"""Numbers for people: degrees, with their uncertainty, and no more digits than it leaves meaning to."""

from __future__ import annotations

import math
from typing import Final

from finback.digits import NOT_DETERMINED, decimals as places_of, exponent, supported
from finback.units import from_si

_DISPLAY: Final = {"rad": "deg", "rad_s": "deg_s", "rad_s2": "deg_s2"}
_POWERS: Final = str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹")
_SYMBOLS: Final = {
    "n": "N",
    "kn": "kN",
    "nm": "N m",
    "ftlbf": "ft lbf",
    "pa": "Pa",
    "hpa": "hPa",
    "kpa": "kPa",
    "k": "K",
    "degr": "°R",
    "hz": "Hz",
}
"""Of units whose suffix, all in small letters, is not their symbol."""
_DIGITS: Final = 5  # of a number of which nothing says how well it is known
_MOST: Final = 9  # decimals at most
_PLAIN: Final = 3  # powers of ten up to which a coefficient is written out


def display_unit(unit: str) -> str:
    """Return the unit in which people read an SI unit (``rad_s`` -> ``deg_s``)."""
    return _DISPLAY.get(unit, unit)


def written(unit: str) -> str:
    """Return how a unit suffix is written: ``deg_s2`` -> ``deg/s²``, ``pa`` -> ``Pa``, nothing for ``1``.

    Several divisors stand in parentheses: ``1_s_rad2`` -> ``1/(s rad²)``.
    """
    first, *divisors = (_SYMBOLS.get(part, part) for part in unit.translate(_POWERS).split("_"))
    if not divisors:
        return "" if first == "1" else first
    below = " ".join(divisors)
    return f"{first}/({below})" if len(divisors) > 1 else f"{first}/{below}"


def head(name: str, unit: str) -> str:
    """Write a name with its unit, as a column's head."""
    words, unit = name.replace("_", " "), written(display_unit(unit))
    return f"{words} [{unit}]" if unit else words


def shown(value: float, unit: str) -> float:
    """Return an SI value in the unit in which people read it."""
    return from_si(value, _DISPLAY[unit]) if unit in _DISPLAY else value


def measured(value: float, uncertainty: float) -> str:
    """Write ``value ± uncertainty`` with two digits of the uncertainty: ``-12.3456 ± 0.0021``.

    An uncertainty that is not finite leaves no digit; one of zero leaves all.
    """
    if not math.isfinite(value):
        return _word(value)
    if not math.isfinite(uncertainty):
        return NOT_DETERMINED
    if uncertainty <= 0:
        return plain(value)
    return " ± ".join(supported(value, uncertainty, most=_MOST))


def coefficient(value: float, error: float) -> str:
    """Write a coefficient of any size with two digits of its standard error: ``-0.131400 ± 0.000021``.

    Where both are small or large, each has a power of ten of its own, with one digit before the point.
    """
    if not math.isfinite(error):
        return NOT_DETERMINED
    if error <= 0:
        return f"{value:.10g}"
    if abs(exponent(value, error)) <= _PLAIN:
        return " ± ".join(supported(value, error))
    power = exponent(value, error)
    number = float(f"{supported(value, error, power=power)[0]}e{power}")
    if number == 0.0:
        return f"0 ± {error:.1e}"
    power = exponent(number, 0.0)
    return f"{supported(value, error, power=power)[0]}e{power:+03d} ± {error:.1e}"


def plain(value: float) -> str:
    """Write a number with five digits."""
    return f"{value:.{_DIGITS}g}" if math.isfinite(value) else _word(value)


def to_places(value: float, places: int) -> str:
    """Write a number with that many decimals; what they round to zero has no sign."""
    return f"{value:z.{places}f}" if math.isfinite(value) else _word(value)


def decimals(scale: float) -> int:
    """Return how many decimals show two digits of ``scale`` > 0."""
    return min(_MOST, max(0, places_of(scale)))


def _word(value: float) -> str:
    """Write what is no finite number."""
    return "–" if math.isnan(value) else "∞" if value > 0 else "-∞"

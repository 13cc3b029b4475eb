"""How quantities and units are written for people: ``deg_s`` is deg/s, ``alpha_rad`` is α [deg]."""

from __future__ import annotations

import math
import re
from typing import Final

from finback.arrays import FloatArray
from finback.channels import channel
from finback.digits import NOT_DETERMINED, decimals, exponent, supported
from finback.units import from_si, si_factor

EXTRAPOLATED: Final = "extrapolated: outside the fitted domain"
"""What is said of whatever lies where no data supported the model."""

_POWERS: Final = str.maketrans("23", "²³")
_SIGN: Final = re.compile(r"(?<!\w)-(?=[\d.∞])")
_NO_SIGN: Final = re.compile(r"(?<!\w)-(0(?:\.0+)?)(?![\d.])")
_SUPERSCRIPTS: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MOST_PLACES: Final = 6  # with more, small numbers are written with a power of ten
_PLAIN: Final = (1e-3, 1e4)  # magnitudes that are written without a power of ten
_SHOWN: Final = {"rad": "deg", "rad_s": "deg_s", "rad_s2": "deg_s2"}


def unit_text(unit: str) -> str:
    """Return a unit suffix as people write it; nothing for a pure number."""
    si_factor(unit)
    first, *divisors = unit.split("_")
    if first == "1" and not divisors:
        return ""
    return "/".join([first, *(divisor.translate(_POWERS) for divisor in divisors)])


def axis_label(column: str) -> str:
    """Return symbol and display unit of a channel, as an axis shows them."""
    found = channel(column)
    return f"{found.label} [{unit_text(found.display_unit)}]"


def displayed(values: FloatArray, column: str) -> FloatArray:
    """Return values of a channel (SI) in the unit that plots show."""
    return from_si(values, channel(column).display_unit)


def display_unit(unit: str) -> str:
    """Return the unit in which a quantity of SI unit ``unit`` is shown: angles in degrees, the rest as it is."""
    return _SHOWN.get(unit, unit)


def with_error(value: float, error: float) -> str:
    """Write ``value ± error`` with two digits of the error, and no digit of the value that it does not support."""
    if not math.isfinite(value):
        return "–"
    if not math.isfinite(error):
        return NOT_DETERMINED
    if error <= 0.0:
        return f"{minus(f'{value:.6g}')} ± 0"
    power = exponent(value, error)
    if decimals(error) <= _MOST_PLACES or power >= 0:
        return minus(" ± ".join(supported(value, error)))
    text = minus(" ± ".join(supported(value, error, power=power)))
    return f"({text})×10{str(power).translate(_SUPERSCRIPTS)}"


def angle(value_rad: float, interval_rad: FloatArray) -> str:
    """Write an angle in degrees with half of its 95 % interval, shape (2,)."""
    return with_error(from_si(value_rad, "deg"), 0.5 * float(from_si(interval_rad[1] - interval_rad[0], "deg")))


def minus(text: str) -> str:
    """Write the sign of numbers as it is printed, and none before zero; hyphens in names stay."""
    return _SIGN.sub("−", _NO_SIGN.sub(r"\1", text))


def short(value: float) -> str:
    """Write a number with two significant digits, small and large ones with a power of ten."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "–"
    if value == 0.0 or _PLAIN[0] <= abs(value) < _PLAIN[1]:
        return minus(f"{value:#.2g}".removesuffix("."))
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{minus(mantissa)}×10{str(int(exponent)).translate(_SUPERSCRIPTS)}"

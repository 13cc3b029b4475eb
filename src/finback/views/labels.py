"""How quantities and units are written for people: ``deg_s`` is deg/s, ``alpha_rad`` is α [deg]."""

from __future__ import annotations

from typing import Final

from finback.arrays import FloatArray
from finback.channels import channel
from finback.units import from_si, si_factor

_POWERS: Final = str.maketrans("23", "²³")


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

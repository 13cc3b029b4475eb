"""Sizes of faults in words: in degrees, with two digits of their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from finback.digits import NOT_DETERMINED, supported
from finback.units import from_si, to_si

_READ: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "1": ("1", ""),
        "rad": ("deg", "deg"),
        "rad_s": ("deg_s", "deg/s"),
        "m_s": ("m_s", "m/s"),
        "m_s2": ("m_s2", "m/s²"),
    }
)
"""SI unit of a fault -> the unit in which people read it, and how that is written."""


def with_error(value: float, half: float, unit: str) -> str:
    """Write ``1.25 ± 0.17 deg`` from two numbers in SI.

    Args:
        value: in SI.
        half: its uncertainty, in SI.
        unit: SI unit suffix of both.
    """
    read, text = _READ.get(unit, (unit, unit))
    shown, error = from_si(value, read), from_si(half, read)
    if not (math.isfinite(shown) and math.isfinite(error)):
        return NOT_DETERMINED
    number = " ± ".join(supported(shown, error)) if error > 0.0 else f"{shown:.6g}"
    return f"{number} {text}".rstrip()


def weight_read(weight: float, unit: str, of: str) -> float:
    """Return the weight of a number of unit ``of`` in a sum of ``unit``, both SI, for the units people read."""
    (sum_unit, _), (own, _) = _READ.get(unit, (unit, unit)), _READ.get(of, (of, of))
    return weight * to_si(1.0, own) / to_si(1.0, sum_unit)

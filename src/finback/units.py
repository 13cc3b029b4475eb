"""The one conversion table: exact factors to SI, and nothing else.

A unit is written as the suffix of a name: ``alpha_deg``, ``airspeed_m_s``. In a suffix every part after the
first divides (``deg_s2`` is deg/s²); ``1`` is a pure number.
"""

from __future__ import annotations

import math
from difflib import get_close_matches
from typing import TYPE_CHECKING, Final, TypeVar

from finback.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Quantity = TypeVar("Quantity", float, NDArray[np.float64])
else:
    Quantity = TypeVar("Quantity")

_FOOT: Final = 0.3048  # m, exact (international foot, 1959)
_POUND: Final = 0.45359237  # kg, exact (international pound, 1959)
STANDARD_GRAVITY_M_S2: Final = 9.80665
"""Exact (3rd CGPM, 1901)."""
_POUND_FORCE: Final = _POUND * STANDARD_GRAVITY_M_S2  # N
_SLUG: Final = _POUND_FORCE / _FOOT  # kg
_DEGREE: Final = math.pi / 180.0  # rad
_NAUTICAL_MILE: Final = 1852.0  # m, exact (International Hydrographic Conference, 1929)
_HOUR: Final = 3600.0  # s
_RANKINE: Final = 5.0 / 9.0  # K

SI_FACTORS: Final[dict[str, tuple[str, float]]] = {
    "1": ("1", 1.0),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "1_s": ("1_s", 1.0),
    "hz": ("1_s", 1.0),
    "1_s2": ("1_s2", 1.0),
    "rad": ("rad", 1.0),
    "deg": ("rad", _DEGREE),
    "rad_s": ("rad_s", 1.0),
    "deg_s": ("rad_s", _DEGREE),
    "deg_min": ("rad_s", _DEGREE / 60.0),
    "rpm": ("rad_s", 2.0 * math.pi / 60.0),
    "rad_s2": ("rad_s2", 1.0),
    "deg_s2": ("rad_s2", _DEGREE),
    "m": ("m", 1.0),
    "ft": ("m", _FOOT),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "km": ("m", 1000.0),
    "nmi": ("m", _NAUTICAL_MILE),
    "m_s": ("m_s", 1.0),
    "km_h": ("m_s", 1000.0 / _HOUR),
    "kt": ("m_s", _NAUTICAL_MILE / _HOUR),
    "nmi_h": ("m_s", _NAUTICAL_MILE / _HOUR),
    "mi_h": ("m_s", 5280.0 * _FOOT / _HOUR),
    "m_min": ("m_s", 1.0 / 60.0),
    "km_s": ("m_s", 1000.0),
    "ft_min": ("m_s", _FOOT / 60.0),
    "ft_s": ("m_s", _FOOT),
    "m_s2": ("m_s2", 1.0),
    "ft_s2": ("m_s2", _FOOT),
    "g": ("m_s2", STANDARD_GRAVITY_M_S2),
    "m2": ("m2", 1.0),
    "ft2": ("m2", _FOOT**2),
    "kg": ("kg", 1.0),
    "lb": ("kg", _POUND),
    "slug": ("kg", _SLUG),
    "kg_m3": ("kg_m3", 1.0),
    "slug_ft3": ("kg_m3", _SLUG / _FOOT**3),
    "lb_ft3": ("kg_m3", _POUND / _FOOT**3),
    "kg_m2": ("kg_m2", 1.0),
    "slug_ft2": ("kg_m2", _SLUG * _FOOT**2),
    "n": ("n", 1.0),
    "kn": ("n", 1000.0),
    "lbf": ("n", _POUND_FORCE),
    "nm": ("nm", 1.0),
    "ftlbf": ("nm", _POUND_FORCE * _FOOT),
    "pa": ("pa", 1.0),
    "hpa": ("pa", 100.0),
    "kpa": ("pa", 1000.0),
    "psf": ("pa", _POUND_FORCE / _FOOT**2),
    "lbf_ft2": ("pa", _POUND_FORCE / _FOOT**2),
    "psi": ("pa", _POUND_FORCE / (_FOOT / 12.0) ** 2),
    "n_m2": ("pa", 1.0),
    "bar": ("pa", 1e5),
    "atm": ("pa", 101325.0),
    "k": ("k", 1.0),
    "degr": ("k", _RANKINE),
}
"""Unit suffix -> (its SI suffix, exact factor to SI)."""

_SPELLED: Final = {
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "minute": "min",
    "hr": "h",
    "hour": "h",
    "°": "deg",
    "degs": "deg",
    "degree": "deg",
    "degrees": "deg",
    "rads": "rad",
    "radian": "rad",
    "radians": "rad",
    "feet": "ft",
    "foot": "ft",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "mile": "mi",
    "slugs": "slug",
    "kts": "kt",
    "knot": "kt",
    "knots": "kt",
    "rankine": "degr",
    "dgr": "degr",
    "°r": "degr",
    "kelvin": "k",
    "fps": "ft_s",
    "fps2": "ft_s2",
    "fpm": "ft_min",
    "mps": "m_s",
    "mph": "mi_h",
    "kph": "km_h",
    "dps": "deg_s",
    "rps": "rad_s",
    "lbfft": "ftlbf",
    "slugft2": "slug_ft2",
    "kgm2": "kg_m2",
    "r": "degr",
    "nondim": "1",
    "none": "1",
    "-": "1",
    "": "1",
}
_RAISED: Final = str.maketrans("²³", "23")


def unit_named(text: str) -> str:
    """Return the suffix of a unit as people and files write it: ``slug/ft^3``, ``dgR``, ``nmi/h``, ``ft-lbf``.

    Capitals do not count, nor does what stands for a product.

    Raises:
        InputError: no unit is written so; the message tells what to do about zeros that are not absolute.
    """
    if text in SI_FACTORS:
        return text
    written = text.strip().casefold().translate(_RAISED)
    parts = [_part(part) for part in written.replace(" per ", "/").replace("ft_lbf", "ftlbf").split("/")]
    while len(parts) > 2 and parts[-1] == parts[-2]:  # ft/s/s
        parts[-2:] = [f"{parts[-1]}2"]
    found = "_".join(parts)
    found = _SPELLED.get(found, found)
    if found in SI_FACTORS:
        return found
    zeros = {"c": ("k", 273.15), "f": ("degr", 459.67)}
    if (scale := found.removeprefix("deg").removeprefix("°")) in zeros:
        unit, zero = zeros[scale]
        raise InputError(f"'{text}' counts from another zero", hint=f"in a map: unit = '{unit}', offset = {zero}")
    near = get_close_matches(found, SI_FACTORS, n=2, cutoff=0.6)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known units: {', '.join(sorted(SI_FACTORS))}"
    raise InputError(f"unknown unit '{text}'", hint=hint)


def _part(part: str) -> str:
    """Return one factor of a unit as a suffix has it: ``sec^2`` -> ``s2``, ``ft-lbf`` -> ``ftlbf``."""
    bare = part.strip()
    if bare in _SPELLED:
        return _SPELLED[bare]
    for sign in ("**", "^", "*", "·", "-", " ", "."):
        bare = bare.replace(sign, "")
    letters = bare.rstrip("0123456789")
    return _SPELLED.get(letters, letters) + bare[len(letters) :] if letters else bare


def si_factor(unit: str) -> float:
    """Return the exact factor that takes a value in ``unit`` to SI."""
    try:
        return SI_FACTORS[unit][1]
    except KeyError:
        raise InputError(f"unknown unit '{unit}'", hint=f"known units: {', '.join(sorted(SI_FACTORS))}") from None


def si_unit(unit: str) -> str:
    """Return the SI suffix of the dimension that ``unit`` measures (``deg_s`` -> ``rad_s``)."""
    si_factor(unit)
    return SI_FACTORS[unit][0]


def to_si(value: Quantity, unit: str) -> Quantity:
    """Convert a value (number or array) given in ``unit`` to SI."""
    return value * si_factor(unit)


def from_si(value: Quantity, unit: str) -> Quantity:
    """Convert a value (number or array) from SI to ``unit``."""
    return value / si_factor(unit)


def unit_of(name: str) -> str:
    """Return the unit suffix of a textual name: the longest known one, so ``q_deg_s`` gives ``deg_s``.

    Raises:
        InputError: the name ends in no known unit.
    """
    parts = name.split("_")
    for start in range(1, len(parts)):
        suffix = "_".join(parts[start:])
        if suffix in SI_FACTORS:
            return suffix
    raise InputError(f"'{name}' names no unit", hint="end the name with a unit, as in 'alpha_deg' or 'airspeed_m_s'")


def quantity_of(name: str) -> str:
    """Return what a textual name measures, without its unit: ``q_deg_s`` -> ``q``."""
    return name.removesuffix(f"_{unit_of(name)}")


def si_name(name: str) -> str:
    """Return a textual name with its unit in SI: ``alpha_deg`` -> ``alpha_rad``."""
    return f"{quantity_of(name)}_{si_unit(unit_of(name))}"


def quotient(unit: str, divisor: str) -> str:
    """Return the suffix of one unit divided by another: ``1_s`` by ``rad`` is ``1_s_rad``, by ``rad_s`` is ``1_rad``.

    The result may be no unit of the table: it says what a number is measured in, and is converted by nobody.
    """
    exponents = _exponents(unit)
    for base, power in _exponents(divisor).items():
        exponents[base] = exponents.get(base, 0) - power
    above = [f"{base}{power if power > 1 else ''}" for base, power in exponents.items() if power > 0]
    below = [f"{base}{-power if power < -1 else ''}" for base, power in exponents.items() if power < 0]
    return "_".join(["".join(above) or "1", *below])


def _exponents(unit: str) -> dict[str, int]:
    """Return base unit -> exponent: ``rad_s2`` is rad¹ s⁻²."""
    first, *divisors = unit.split("_")
    exponents: dict[str, int] = {}
    for part, sign in ((first, 1), *((divisor, -1) for divisor in divisors)):
        base = part.rstrip("0123456789")
        if base:
            exponents[base] = exponents.get(base, 0) + sign * int(part[len(base) :] or 1)
    return exponents

"""How a case begins: names and units of ours for JSBSim's initial conditions."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Final

from finback.errors import InputError
from finback.units import from_si, quantity_of, si_unit, to_si, unit_of

# In the order in which they are written: JSBSim keeps what was given before, so place comes before speed, speed before
# direction (a Mach number and an airspeed depend on the altitude, the path angles on both).
_STARTS: Final = {
    "terrain": ("ic/terrain-elevation-ft", "ft"),
    "latitude": ("ic/lat-geod-rad", "rad"),
    "geocentric_latitude": ("ic/lat-gc-rad", "rad"),
    "longitude": ("ic/long-gc-rad", "rad"),
    "altitude": ("ic/h-sl-ft", "ft"),
    "height": ("ic/h-agl-ft", "ft"),
    "phi": ("ic/phi-rad", "rad"),
    "theta": ("ic/theta-rad", "rad"),
    "psi": ("ic/psi-true-rad", "rad"),
    "airspeed": ("ic/vt-fps", "ft_s"),
    "mach": ("ic/mach", "1"),
    "u": ("ic/u-fps", "ft_s"),
    "v": ("ic/v-fps", "ft_s"),
    "w": ("ic/w-fps", "ft_s"),
    "velocity_north": ("ic/vn-fps", "ft_s"),
    "velocity_east": ("ic/ve-fps", "ft_s"),
    "velocity_down": ("ic/vd-fps", "ft_s"),
    "alpha": ("ic/alpha-rad", "rad"),
    "beta": ("ic/beta-rad", "rad"),
    "gamma": ("ic/gamma-rad", "rad"),
    "p": ("ic/p-rad_sec", "rad_s"),
    "q": ("ic/q-rad_sec", "rad_s"),
    "r": ("ic/r-rad_sec", "rad_s"),
}


def start_settings(given: Iterable[tuple[str, float]]) -> tuple[tuple[str, float], ...]:
    """Return initial conditions as properties of JSBSim with values in its units, in the order to write them.

    Args:
        given: ``alpha_deg``, ``airspeed_kt``, ``altitude_ft`` … -> value; a name with a slash is a property of JSBSim
            in its own unit, and is written last.

    Raises:
        InputError: a name is unknown, has no unit or one of another quantity, or is given twice.
    """
    known: dict[str, tuple[str, float]] = {}
    properties: dict[str, float] = {}
    for name, value in given:
        if "/" in name:
            if name in properties:
                raise InputError(f"'{name}' is given twice")
            properties[name] = value
            continue
        quantity = quantity_of(name)
        if quantity not in _STARTS:
            near = get_close_matches(quantity, _STARTS, n=1, cutoff=0.5)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(_STARTS)}"
            raise InputError(f"no initial condition is called '{quantity}'", hint=hint)
        if quantity in known:
            raise InputError(f"'{quantity}' is given twice")
        place, unit = _STARTS[quantity]
        if si_unit(unit_of(name)) != si_unit(unit):
            raise InputError(
                f"'{name}': '{unit_of(name)}' does not measure {quantity}", hint=f"as in '{quantity}_{unit}'"
            )
        known[quantity] = (place, from_si(to_si(value, unit_of(name)), unit))
    return (*(known[quantity] for quantity in _STARTS if quantity in known), *properties.items())

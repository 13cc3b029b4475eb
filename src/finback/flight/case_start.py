"""How a case begins: names and units of ours for JSBSim's initial conditions."""

from __future__ import annotations

import math
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
    "wind_north": ("ic/vw-mag-fps", "ft_s"),
    "wind_east": ("ic/vw-dir-deg", "ft_s"),
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


_TO_AIR: Final = ("airspeed", "mach", "alpha", "beta", "gamma")
_WINDS: Final = ("wind_north", "wind_east")


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
    if any(name in known for name in _WINDS):
        if mixed := [name for name in _TO_AIR if name in known]:  # JSBSim's start would take the wind twice
            raise InputError(
                f"a wind with {', '.join(mixed)}, which would depend on it",
                hint="give velocities over the ground: u, v, w",
            )
        # JSBSim's start has its size and where it blows to
        north, east = (known.get(name, ("", 0.0))[1] for name in _WINDS)
        known["wind_north"] = (_STARTS["wind_north"][0], math.hypot(north, east))
        known["wind_east"] = (_STARTS["wind_east"][0], from_si(math.atan2(east, north), "deg"))
    return (*(known[quantity] for quantity in _STARTS if quantity in known), *properties.items())

"""What is moved while a case is flown: commands, surfaces, winds, any property of JSBSim, over time."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError
from finback.records import Hold
from finback.units import SI_FACTORS, from_si, quantity_of, si_unit, to_si, unit_of

_COMMANDS: Final = {
    "elevator": "fcs/elevator-cmd-norm",
    "aileron": "fcs/aileron-cmd-norm",
    "rudder": "fcs/rudder-cmd-norm",
    "throttle": "fcs/throttle-cmd-norm",
    "mixture": "fcs/mixture-cmd-norm",
    "flaps": "fcs/flap-cmd-norm",
    "speedbrake": "fcs/speedbrake-cmd-norm",
    "gear": "gear/gear-cmd-norm",
    "pitch_trim": "fcs/pitch-trim-cmd-norm",
    "roll_trim": "fcs/roll-trim-cmd-norm",
    "yaw_trim": "fcs/yaw-trim-cmd-norm",
}
_OF_EVERY_ENGINE: Final = ("throttle", "mixture")
_MEASURED: Final = {
    "elevator": ("fcs/elevator-pos-rad", "rad"),
    "aileron": ("fcs/left-aileron-pos-rad", "rad"),
    "rudder": ("fcs/rudder-pos-rad", "rad"),
    "wind_north": ("atmosphere/wind-north-fps", "ft_s"),
    "wind_east": ("atmosphere/wind-east-fps", "ft_s"),
    "wind_down": ("atmosphere/wind-down-fps", "ft_s"),
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A property that is written over time; its first value holds before the first point, its last after the last.

    Attributes:
        jsbsim_property: what is written.
        time_s: times, not decreasing, shape (n,); two alike are a jump.
        values: in the property's own unit, shape (n,).
        hold: ``foh`` for straight lines between the points, ``zoh`` for values that last until the next point.
        every_engine: write it for every engine that the aircraft has.
        owned: the model may not write it as well: if it does, the schedule would be none.
    """

    jsbsim_property: str
    time_s: FloatArray
    values: FloatArray
    hold: Hold = Hold.FOH
    every_engine: bool = False
    owned: bool = False

    def __post_init__(self) -> None:
        """Freeze and check the points."""
        object.__setattr__(self, "time_s", frozen_array(self.time_s))
        object.__setattr__(self, "values", frozen_array(self.values))
        place = f"schedule of '{self.jsbsim_property}'"
        if self.time_s.ndim != 1 or not self.time_s.size or self.time_s.shape != self.values.shape:
            raise InputError(f"{place}: needs as many times as values, got {self.time_s.shape} and {self.values.shape}")
        if not (np.isfinite(self.time_s).all() and np.isfinite(self.values).all()):
            raise InputError(f"{place}: holds only finite numbers")
        if (np.diff(self.time_s) < 0.0).any():
            raise InputError(f"{place}: times must not decrease")
        if self.hold not in {Hold.FOH, Hold.ZOH}:
            raise InputError(f"{place}: is held '{self.hold}'", hint="one of: foh, zoh")

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the values at times of shape (n,); at a jump the mean of both sides.

        The mean keeps a multistep integrator from acting half a step early (``Schedule.drive``).
        """
        sides = [self._beside(np.nextafter(time_s, side)) for side in (-np.inf, np.inf)]
        mean: FloatArray = 0.5 * (sides[0] + sides[1])
        return mean

    def _beside(self, time_s: FloatArray) -> FloatArray:
        if self.hold is Hold.ZOH:
            return self.values[np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, None)]
        return np.interp(time_s, self.time_s, self.values)

    def jumps_s(self) -> FloatArray:
        """Return the times at which the value jumps, shape (n,)."""
        changed = np.diff(self.values) != 0.0
        if self.hold is Hold.FOH:
            changed &= np.diff(self.time_s) == 0.0
        jumps: FloatArray = self.time_s[1:][changed]
        return jumps

    def told(self) -> str:
        """Return the schedule in a line: how it is held, and its points if they are few."""
        if self.time_s.size > _TOLD_POINTS:
            return f"{self.hold.value}: {self.time_s.size} points from {self.time_s[0]:.9g} to {self.time_s[-1]:.9g} s"
        points = ", ".join(f"{time:.9g}:{value:.9g}" for time, value in zip(self.time_s, self.values, strict=True))
        return f"{self.hold.value}: {points}"


_TOLD_POINTS: Final = 20


def named_drive(name: str, time_s: FloatArray, values: FloatArray, hold: Hold) -> Drive:
    """Return the schedule of what is called ``name``.

    Args:
        name: ``elevator``, ``throttle`` … for a command, a pure number as JSBSim's ``…-cmd-norm``; ``elevator_deg`` …
            for the position of a surface, ``wind_east_ft_s`` … for a wind, where it blows to; a name with a slash is a
            property of JSBSim in its own unit.
        time_s: times of the points, shape (n,).
        values: in the unit of the name, shape (n,).
        hold: what is between them.

    Raises:
        InputError: nothing is called so, its unit measures something else, or the points are faulty.
    """
    if "/" in name:
        return Drive(jsbsim_property=name, time_s=time_s, values=values, hold=hold)
    bare = name.removesuffix("_1")
    if bare in _COMMANDS:
        return Drive(
            jsbsim_property=_COMMANDS[bare],
            time_s=time_s,
            values=values,
            hold=hold,
            every_engine=bare in _OF_EVERY_ENGINE,
        )
    if any(name.endswith(f"_{unit}") for unit in SI_FACTORS):
        quantity, unit = quantity_of(name), unit_of(name)
        if quantity in _MEASURED:
            place, own = _MEASURED[quantity]
            if si_unit(unit) != si_unit(own):
                raise InputError(f"'{name}': '{unit}' does not measure {quantity}", hint=f"as in '{quantity}_{own}'")
            converted = from_si(to_si(frozen_array(values), unit), own)
            return Drive(jsbsim_property=place, time_s=time_s, values=converted, hold=hold, owned=True)
    known = [*_COMMANDS, *(f"{quantity}_{unit}" for quantity, (_, unit) in _MEASURED.items())]
    near = get_close_matches(name, known, n=2, cutoff=0.6)
    raise InputError(
        f"nothing that can be scheduled is called '{name}'",
        hint=f"did you mean {' or '.join(near)}?"
        if near
        else f"known: {', '.join(known)}; or a property of JSBSim: fcs/…",
    )

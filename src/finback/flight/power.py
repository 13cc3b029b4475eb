"""What drives an aircraft: nothing, a constant thrust, or its engines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.errors import InputError

POWER: Final = "power"
"""Key in a flight's provenance: what drove it; left out where nothing did."""
THRUST: Final = "thrust_n"
"""Key in a flight's provenance: its thrust, where it was a fixed one."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EnginesOff:
    """No thrust. The only choice on the rig, whose airspeed needs none."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FixedThrust:
    """A constant force along body x through the center of gravity; the engines are off.

    Attributes:
        thrust_n: the force, forward > 0.
    """

    thrust_n: float

    def __post_init__(self) -> None:
        """Check the number."""
        if not math.isfinite(self.thrust_n):
            raise InputError(f"the fixed thrust must be a finite number, got {self.thrust_n} N")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Throttle:
    """The aircraft's own engines, all at one setting, in steady state at the start; no fuel is burnt.

    Attributes:
        setting: the pilot's command, 0 to 1.
    """

    setting: float

    def __post_init__(self) -> None:
        """Check the number."""
        if not 0.0 <= self.setting <= 1.0:
            raise InputError(f"the throttle must lie in 0…1, got {self.setting}")


Power = EnginesOff | FixedThrust | Throttle
"""Any of them."""

ENGINES_OFF: Final = EnginesOff()
"""No thrust."""


def power_told(power: Power) -> dict[str, str]:
    """Return what the provenance of a flight says of what drives it."""
    if power == ENGINES_OFF:
        return {}
    thrust = {THRUST: repr(float(power.thrust_n))} if isinstance(power, FixedThrust) else {}
    return {POWER: str(power), **thrust}

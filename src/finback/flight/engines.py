"""The power of a flight made so in the simulator: off, a fixed force, or engines at a throttle."""

from __future__ import annotations

from typing import Final, final

from finback.errors import AircraftError
from finback.flight.aircraft import Aircraft
from finback.flight.derived_model import THRUST
from finback.flight.power import EnginesOff, FixedThrust, Power, Throttle
from finback.flight.simulator import Simulator
from finback.records import Condition
from finback.units import from_si

_MODEL: Final = "simulation/models/FGPropulsion/enabled"
_MOST_ENGINES: Final = 32
_STEP_S: Final = 0.01


@final
class Engines:
    """The engines of an aircraft.

    Args:
        aircraft: the aircraft.
        condition: where its flight control is asked what a throttle command means.
        direct: the flight control is dropped; engines then get what it would have given them, settled.
    """

    def __init__(self, aircraft: Aircraft, condition: Condition, *, direct: bool) -> None:
        self._aircraft = aircraft
        self._condition = condition
        self._direct = direct
        self._positions: dict[float, tuple[float, ...]] = {}

    def use(self, simulator: Simulator, power: Power) -> None:
        """Make it so; between reset and start of a simulator, its initial condition written.

        An engine that is off is out of the simulation: JSBSim's turbines give thrust at the instant of a start,
        running or not.

        Raises:
            AircraftError: the aircraft has no engines to throttle.
        """
        thrust = from_si(power.thrust_n, "lbf") if isinstance(power, FixedThrust) else 0.0
        simulator.write({_MODEL: 1.0 if isinstance(power, Throttle) else 0.0, THRUST: thrust})
        match power:
            case Throttle(setting=setting):
                count = throttles(simulator)
                if not count:
                    raise AircraftError(f"{self._aircraft.path}: it has no engine to throttle")
                commands = self._settled(setting, count) if self._direct else (setting,) * count
                simulator.start_engines({_command(index): value for index, value in enumerate(commands)})
            case EnginesOff() | FixedThrust():
                pass

    def _settled(self, setting: float, count: int) -> tuple[float, ...]:
        """Return the throttle positions that the aircraft's own flight control makes of a command."""
        if setting not in self._positions:
            original = Simulator(self._aircraft.path, step_s=_STEP_S, freeze_position=True)
            original.write(
                {
                    "ic/h-sl-ft": from_si(self._condition.altitude_m, "ft"),
                    "ic/u-fps": from_si(self._condition.airspeed_m_s, "ft_s"),
                }
            )
            original.write({_command(index): setting for index in range(count)})
            original.start_steadily()
            read = original.read(f"fcs/throttle-pos-norm[{index}]" for index in range(count))
            self._positions[setting] = tuple(read.values())
        return self._positions[setting]


def throttles(simulator: Simulator) -> int:
    """Return how many engines can be throttled."""
    return next(index for index in range(_MOST_ENGINES) if not simulator.has(_command(index)))


def _command(index: int) -> str:
    return f"fcs/throttle-cmd-norm[{index}]"

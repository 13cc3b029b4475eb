"""The engines of a case: started before the flight, and whether any runs while it is flown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, final

import jsbsim

from finback.errors import AircraftError
from finback.flight.case import Case, CaseEngine
from finback.flight.case_load import Loaded

START: Final = "propulsion/set-running"
"""JSBSim's property that starts engines when it is written; it cannot be read, and -1 is every engine."""
_THROTTLE: Final = "fcs/throttle-cmd-norm"
_MIXTURE: Final = "fcs/mixture-cmd-norm"
_FREEZE: Final = "propulsion/fuel_freeze"
_WANTING: Final = "fuel, mixture or electricity is wanting; a script of the aircraft shows how it is started"
_STARTED: Final = ("map-pa", "n1")
"""What only engines have that must be started: pistons, and turbines with or without a propeller."""


@final
class CaseEngines:
    """The engines of one loaded case.

    Args:
        case: what is flown.
        loaded: JSBSim with it.
    """

    def __init__(self, case: Case, loaded: Loaded) -> None:
        self._case = case
        self._loaded = loaded
        engines = [f"propulsion/engine[{index}]" for index in range(loaded.fdm.get_propulsion().get_num_engines())]
        self.count = len(engines)
        startable = [engine for engine in engines if any(loaded.has(f"{engine}/{name}") for name in _STARTED)]
        self._running = [loaded.node(f"{engine}/set-running").get_double_value for engine in startable]
        # An engine of another kind (rocket, electric) gives thrust without having been started.
        self._mute = len(startable) < len(engines) or not engines
        self._ran = False

    def start(self, command: Callable[[], None]) -> None:
        """Start every engine and let it turn steadily at its commands; fuel stays as it is, no time passes.

        A mixture that nobody commands is rich. Lags and actuators of the flight control come to rest where they are
        commanded, as in JSBSim's own trim; without that a turbine would begin at full thrust. Engines that
        JSBSim's search for a steady state stalls begin as it starts them, which is told.

        Args:
            command: writes what is scheduled at the start.

        Raises:
            AircraftError: the aircraft has no engine, or none of those that must be started runs.
        """
        loaded, fdm = self._loaded, self._loaded.fdm
        if not self.count:
            raise AircraftError(f"{self._case.source}: it has no engine to start")
        written = [name for name, _ in self._case.settings] + [drive.jsbsim_property for drive in self._case.drives]
        if not any(name.startswith(_MIXTURE) for name in written):
            for index in range(self.count):
                if loaded.has(f"{_MIXTURE}[{index}]"):
                    loaded.write(f"{_MIXTURE}[{index}]", 1.0)
        frozen = float(fdm[_FREEZE])
        fdm[_FREEZE] = 1.0  # JSBSim cannot tell that it can be written
        loaded.write(START, -1.0)
        command()
        fdm.set_trim_status(True)
        try:
            loaded.evaluate()
            fdm.get_propulsion().get_steady_state()
        except jsbsim.BaseError as error:
            loaded.fail("JSBSim cannot start its engines", str(error))
        finally:
            fdm.set_trim_status(False)
        fdm[_FREEZE] = frozen
        if not all(get() > 0.0 for get in self._running):  # JSBSim's search for steadiness has stalled them
            loaded.write(START, -1.0)
            command()
            loaded.notes.append("the engines begin as JSBSim starts them: it finds no steady state at their throttles")
        if self._running and not self._any():
            raise AircraftError(f"{self._case.source}: JSBSim does not start its engines", hint=_WANTING)

    def watch(self) -> None:
        """See whether an engine runs; call it at rows of the flight."""
        self._ran = self._ran or self._any()

    def _any(self) -> bool:
        return any(get() > 0.0 for get in self._running)

    def notes(self) -> list[str]:
        """Return what is to be told of a flight whose throttle was moved while no engine ran."""
        if self._mute or self._ran:
            return []
        if self._case.engines is CaseEngine.RUNNING:
            return [f"the engines were started and stop at once: {_WANTING}"]
        given: Mapping[str, bool] = {
            "a throttle is commanded": any(value > 0.0 for value in self._commands(_THROTTLE)),
            f"'{START}' is set": bool(self._commands(START)),
        }
        said = next((what for what, true in given.items() if true), "")
        return [f"{said}, and no engine runs: --engines running starts them all"] if said else []

    def _commands(self, name: str) -> list[float]:
        case = self._case
        return [
            *(value for place, value in case.settings if place.startswith(name)),
            *(
                float(value)
                for drive in case.drives
                if drive.jsbsim_property.startswith(name)
                for value in drive.values
            ),
        ]

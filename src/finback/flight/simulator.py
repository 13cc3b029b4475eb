"""JSBSim, with its traps closed: one object, one model, checked names, checked returns, a kept log.

What is guarded against: the step is set before the model is loaded (JSBSim freezes it at load); all four
integrators are chosen, again after every reset (a reset restores first-order ones); a start is made twice (in its
first pass some values are still those before the reset); a name that JSBSim does not know is an error (JSBSim would
create the property, or read 0), and so is a read-only one (JSBSim would ignore the write); warnings and errors of
the log count (JSBSim returns False, or nothing, for many faults); NaN is found by the airspeed (JSBSim reads alpha
as 0.0 then); there is no wind, not even the rounding of one; no file and no socket is opened that the aircraft
names; threads are refused (JSBSim's logger ends the interpreter in them).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final, NoReturn, final

import jsbsim

from finback.errors import AircraftError, InputError, RefusedError
from finback.flight.jsbsim_log import Log, keep_alive, one_line, refuse_threads
from finback.flight.quiet_copy import quiet_aircraft

Getter = Callable[[], float]
Setter = Callable[[float], bool]

INTEGRATOR: Final = "AB4"
_ADAMS_BASHFORTH_4: Final = 5  # JSBSim's number for it
_FROZEN: Final = 0
_INTEGRATORS: Final = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
_NO_RESET_OUTPUT: Final = 2  # reset mode: do not run the initial conditions by itself
_REPEATS: Final = 200  # five to ten are usual; one that shrinks by a sixth each time settles in as many
_SETTLED: Final = 1e-15  # relative, of numbers that never repeat to the last bit


@final
class Simulator:
    """One JSBSim object with one model.

    Args:
        path: the model's XML file.
        step_s: the integration step, > 0.
        freeze_position: keep the vehicle where it is (gravity, density and the local frame stay constant).
        debug_level: how much JSBSim says about the file; 1 finds more faults, 0 is fast in a loop.

    Attributes:
        run: advances by one step. Set the inputs of the time it goes to before calling it. Unchecked; use ``check``.

    Raises:
        AircraftError: the model does not load without a warning; the message has JSBSim's own words.
    """

    def __init__(self, path: Path, *, step_s: float, freeze_position: bool, debug_level: int = 0) -> None:
        refuse_threads()
        self.path = path
        self.step_s = step_s
        self._freeze_position = freeze_position
        self._copied = str(path.parent)
        self._log = Log()
        jsbsim.set_logger(self._log)
        jsbsim.FGJSBBase().debug_lvl = debug_level  # type: ignore[no-untyped-call] # jsbsim leaves it untyped
        self._fdm = jsbsim.FGFDMExec(None)
        self._fdm.set_dt(step_s)  # before load_model: filters and actuators keep the step they are loaded with
        self._load()
        self._properties = self._fdm.get_property_manager()
        self._integrators = tuple(self.setter(f"simulation/integrator/{name}") for name in _INTEGRATORS)
        self._airspeed = self.getter("velocities/vtrue-fps")
        self._late: dict[str, Getter] = {}
        self._choose_integrators()
        # Converting initial conditions leaves a wind of rounding size in them, which grows from flight to flight.
        self.write({"simulation/models/FGWinds/enabled": 0.0})
        self.run: Callable[[], bool] = self._fdm.run

    def _load(self) -> None:
        root = self.path.parent.parent.parent
        for folder, choose in (("engine", self._fdm.set_engine_path), ("systems", self._fdm.set_systems_path)):
            if (root / folder).is_dir():
                choose(str(root / folder))
        try:
            with quiet_aircraft(self.path) as quiet:
                self._copied = str(quiet.path.parent)
                self._fdm.set_aircraft_path(str(quiet.path.parent))
                loaded = self._fdm.load_model(
                    quiet.path.stem, False
                )  # False: the file lies in the aircraft path itself
        except jsbsim.BaseError as error:
            self._fail("JSBSim does not load it", str(error))
        if not loaded or self._log.faults:
            self._fail("JSBSim does not load it cleanly")
        self._fdm.disable_output()

    def _fail(self, what: str, *words: str) -> NoReturn:
        keep_alive(self._fdm)
        said = dict.fromkeys([*(one_line(word) for word in words if word.strip()), *self._log.faults])
        # An exception says again what the log has said, without file and line.
        told = [text for text in said if not any(text in other for other in said if other != text)]
        message = "; ".join(told).replace(self._copied, str(self.path.parent))
        raise AircraftError(f"{self.path}: {what}: {message or 'it gives no reason'}")

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        node = self._properties.get_node(name)
        if node is None:
            raise AircraftError(f"{self.path}: the model has no property '{name}'")
        return node

    def has(self, name: str) -> bool:
        """Return whether the model has a property, without creating it."""
        return self._properties.get_node(name) is not None

    def writable(self, name: str) -> bool:
        """Return whether a property can be written; AircraftError if there is none."""
        return bool(self._node(name).get_attribute(jsbsim.Attribute.WRITE))

    def getter(self, name: str) -> Getter:
        """Return a function that reads a property, in JSBSim's unit; AircraftError if there is none."""
        get: Getter = self._node(name).get_double_value
        return get

    def setter(self, name: str) -> Setter:
        """Return a function that writes a property; AircraftError if there is none or it is read-only."""
        if not self.writable(name):
            raise AircraftError(f"{self.path}: property '{name}' is read-only")
        put: Setter = self._node(name).set_double_value
        return put

    def read(self, names: Iterable[str]) -> dict[str, float]:
        """Return properties by name, in JSBSim's units."""
        return {name: self.getter(name)() for name in names}

    def write(self, values: Mapping[str, float]) -> None:
        """Write properties in the order given, in JSBSim's units.

        Raises:
            AircraftError: no such property, or read-only.
            InputError: a value is not finite (JSBSim would fly on with NaN and say nothing).
        """
        for name, value in values.items():
            if not math.isfinite(value):
                raise InputError(f"{self.path}: '{name}' would become {value}", hint="give a finite number")
            if not self.setter(name)(value):
                raise AircraftError(f"{self.path}: property '{name}' does not take {value}")

    def override_density(self, density_slug_ft3: float) -> None:
        """Hold the air density. JSBSim has the property only once it is written; resets keep it."""
        if not (math.isfinite(density_slug_ft3) and density_slug_ft3 > 0):
            raise InputError(f"{self.path}: no air of {density_slug_ft3} slug/ft³ can be held")
        self._fdm["atmosphere/override/density"] = density_slug_ft3

    def reset(self) -> None:
        """Clear controls, time and memory; what was set as initial condition stays. Call ``start`` next."""
        self._fdm.reset_to_initial_conditions(_NO_RESET_OUTPUT)
        self._choose_integrators()

    def start(self, *, passes: int = 2) -> None:
        """Make the initial condition the state.

        Args:
            passes: in the first, some values are still those before the reset (``aero/ci2vel`` is 0), and the
                integrators would remember its derivatives; one is enough to see whether a model starts, and all that
                one with sockets or output files of its own can do.

        Raises:
            AircraftError: JSBSim refuses, or the state is not finite.
        """
        for _ in range(passes):
            try:
                started = self._fdm.run_ic()
            except jsbsim.BaseError as error:
                self._fail("JSBSim cannot start it", str(error))
            if not started:
                self._fail("JSBSim cannot start it")
        if not self.finite():
            self._fail("its state at the start is not finite")

    def start_steadily(self) -> None:
        """Start as ``start`` does, actuators and lags of the flight control at rest where their input wants them.

        JSBSim's own trim does this; for turbines it means steady rotation.
        """
        self._fdm.set_trim_status(True)
        try:
            self.start()
        finally:
            self._fdm.set_trim_status(False)

    def evaluate_steadily(self) -> None:
        """Evaluate as ``evaluate`` does, actuators and lags of the flight control at rest. Unchecked.

        Raises:
            RefusedError: as of ``evaluate``.
        """
        self._fdm.set_trim_status(True)
        try:
            self.evaluate()
        finally:
            self._fdm.set_trim_status(False)

    def start_engines(self, throttles: Mapping[str, float]) -> None:
        """Start all engines and let them turn steadily at throttle commands; fuel stays as it is.

        The initial condition becomes the state on the way.
        """
        self.write({"propulsion/set-running": -1.0})
        self._fdm["propulsion/fuel_freeze"] = 1.0  # JSBSim cannot tell that it can be written
        self.write(throttles)
        self.start_steadily()
        self._fdm.get_propulsion().get_steady_state()
        self.write(throttles)

    @property
    def evaluate(self) -> Callable[[], bool]:
        """Make the initial condition the state and evaluate its derivatives; no time passes. Unchecked, fast.

        What is told late (``settle``) is repeated until it is that of the state itself; RefusedError if it never is.
        """
        run_ic: Callable[[], bool] = self._fdm.run_ic
        return self._evaluate_settled if self._late else run_ic

    def settle(self, late: Iterable[str]) -> None:
        """Say which properties JSBSim gives a frame late, as they depend on what the frame before evaluated.

        From now on an evaluation repeats until they no longer change: it does not depend on the one before it.
        """
        self._late = {name: self.getter(name) for name in late}

    def _evaluate_settled(self) -> bool:
        gets = tuple(self._late.values())
        done: bool = self._fdm.run_ic()
        before = tuple(get() for get in gets)
        for _ in range(_REPEATS):
            done = self._fdm.run_ic()
            now = tuple(get() for get in gets)
            # What is not finite stays so, and is the caller's to see, as without anything late.
            if now == before or not all(map(math.isfinite, now)):
                return done
            before, last = now, before
        for name, new, old in zip(self._late, before, last, strict=True):
            if not abs(new - old) <= _SETTLED * max(1.0, abs(new)):
                raise RefusedError(
                    f"{self.path.stem}: '{name}' does not settle: JSBSim tells it a frame late, and at a state that"
                    f" is held it still goes from {old:.6g} to {new:.6g} after {_REPEATS} frames",
                    hint="the aircraft's forces feed on it too strongly; there are no rates of that state alone",
                )
        return done

    def finite(self) -> bool:
        """Return whether the state is finite; alpha cannot tell, JSBSim reads it as 0.0 when it is NaN."""
        return math.isfinite(self._airspeed())

    @property
    def faults(self) -> tuple[str, ...]:
        """Warnings and errors of the log so far."""
        return tuple(self._log.faults)

    def _choose_integrators(self) -> None:
        for choose in self._integrators:
            choose(_ADAMS_BASHFORTH_4)
        if self._freeze_position:
            self._integrators[-1](_FROZEN)


def native_properties(names: Iterable[str]) -> frozenset[str]:
    """Return which of the properties JSBSim itself has, before any model is loaded."""
    jsbsim.FGJSBBase().debug_lvl = 0  # type: ignore[no-untyped-call] # as above
    properties = jsbsim.FGFDMExec(None).get_property_manager()
    return frozenset(name for name in names if properties.get_node(name) is not None)


def jsbsim_version() -> str:
    """Return the version of JSBSim."""
    return str(jsbsim.__version__)

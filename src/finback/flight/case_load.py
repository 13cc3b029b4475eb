"""JSBSim with a case loaded: the files of an aircraft or a script, and no others."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path
from typing import Final, NoReturn, final

import jsbsim

from finback.errors import AircraftError
from finback.flight.aircraft import find_aircraft
from finback.flight.case import Case, is_script
from finback.flight.case_script import Script, read_script
from finback.flight.jsbsim_log import Log, keep_alive, one_line, refuse_threads
from finback.flight.quiet_copy import quiet_aircraft

_STAND_IN: Final = '<output name="left-out-{}.csv" type="CSV" rate="1"/>'
"""In the temporary output folder. A script may set an output's rate, a property that only outputs have."""
# fmt: off
_INITIAL: Final = frozenset(
    {
        "ubody", "vbody", "wbody", "vnorth", "veast", "vdown", "vt", "vc", "vg", "vground", "mach", "alpha", "beta",
        "gamma", "roc", "phi", "theta", "psi", "latitude", "longitude", "altitude", "altitudeAGL", "altitudeMSL",
        "elevation", "terrain_elevation", "winddir", "vwind", "hwind", "xwind", "crosswind", "headwind",
        "targetNlf", "running", "trim", "position", "orientation", "velocity", "attitude_rate", "p", "q", "r",
        "earth_position_angle", "epoch", "documentation", "description", "author", "date", "license", "limitation",
        "note",
    }
)
# fmt: on
_PLANET: Final = frozenset(
    {
        "semimajor_axis",
        "semiminor_axis",
        "rotation_rate",
        "GM",
        "J2",
        "atmosphere",
        "description",
    }
)


@final
class Loaded:
    """One JSBSim object with one case.

    Args:
        case: what is loaded.
        elsewhere: an existing folder for what JSBSim writes by itself.

    Attributes:
        case: what was loaded.
        fdm: JSBSim.
        words: what it says.
        notes: what else is to be told.
        scripts: the script, if the case is one.

    Raises:
        AircraftError: it does not load; with JSBSim's words.
    """

    def __init__(self, case: Case, elsewhere: str) -> None:
        refuse_threads()
        self.case = case
        self.scripts: tuple[Script, ...] = (
            (read_script(case.source, stand_in=_STAND_IN),) if is_script(case.source) else ()
        )
        self.words = Log()
        self.notes: list[str] = []
        self._copied = ("\0", "\0")  # where JSBSim is given the aircraft, and where it is
        jsbsim.set_logger(self.words)
        jsbsim.FGJSBBase().debug_lvl = 0  # type: ignore[no-untyped-call] # jsbsim leaves it untyped
        self.fdm = jsbsim.FGFDMExec(None)
        self.fdm.set_output_path(elsewhere)
        try:
            self._load()
        except jsbsim.BaseError as error:
            self.fail("JSBSim does not load it", str(error))
        if self.words.worse:
            self.fail("JSBSim does not load it cleanly")
        self.fdm.disable_output()
        self._properties = self.fdm.get_property_manager()

    def _load(self) -> None:
        case = self.case
        if case.step_s:
            self.fdm.set_dt(case.step_s)  # before a model is loaded: filters keep the step they are loaded with
        if case.planet_file:
            self._read(case.planet_file, "planet", _PLANET)
            if not self.fdm.load_planet(str(Path(case.planet_file).resolve()), False):
                self.fail(f"JSBSim does not load the planet {case.planet_file}")
        if case.initial_file:
            self._read(case.initial_file, "initialize", _INITIAL)
        path = case.source
        if self.scripts:
            path = find_aircraft(self.scripts[0].aircraft, near=case.source).path
        root = path.resolve().parent.parent.parent
        for folder, choose in (("engine", self.fdm.set_engine_path), ("systems", self.fdm.set_systems_path)):
            if (root / folder).is_dir():
                choose(str(root / folder))
        with quiet_aircraft(path, stand_in=_STAND_IN) as quiet:
            self._copied = (str(quiet.path.parent), str(path.parent))
            left_out = [*(said for script in self.scripts for said in script.left_out), *quiet.left_out]
            self.notes += [f"left out: {said}; only what was asked for is written or sent" for said in left_out]
            if self.scripts:
                self._load_script(self.scripts[0], quiet.path)
            else:
                self._load_aircraft(quiet.path)

    def _load_script(self, script: Script, aircraft: Path) -> None:
        case = self.case
        self.fdm.set_aircraft_path(str(aircraft.parent.parent))
        initial = str(Path(case.initial_file).resolve()) if case.initial_file else ""
        with tempfile.TemporaryDirectory(prefix="finback-script-") as folder:
            copy = Path(folder) / case.source.name
            copy.write_bytes(script.content)
            if not self.fdm.load_script(str(copy), case.step_s, initial):
                self.fail("JSBSim does not load it")

    def _load_aircraft(self, aircraft: Path) -> None:
        case = self.case
        self.fdm.set_aircraft_path(str(aircraft.parent))
        if not self.fdm.load_model(aircraft.stem, False):
            self.fail("JSBSim does not load it")
        if case.initial_file and not self.fdm.load_ic(str(Path(case.initial_file).resolve()), False):
            self.fail(f"JSBSim does not load the initial condition {case.initial_file}")

    def _read(self, file: str, tag: str, known: frozenset[str]) -> None:
        """Check that a file is XML with the right root, and say which of its elements JSBSim passes over."""
        try:
            root = ET.parse(file).getroot()  # noqa: S314 - JSBSim itself will read the file
        except (OSError, ET.ParseError) as error:
            raise AircraftError(f"{file}: cannot be read as XML: {error}") from None
        if root.tag != tag:
            raise AircraftError(f"{file}: begins with <{root.tag}>", hint=f"JSBSim's file begins with <{tag}>")
        for child in root:
            if child.tag not in known:
                self.notes.append(f"{file}: JSBSim knows no <{child.tag}> there, and passes over it")

    def fail(self, what: str, *words: str) -> NoReturn:
        """Raise AircraftError with JSBSim's words."""
        keep_alive(self.fdm)
        said = [*(one_line(word) for word in words if word.strip()), *self.words.texts]
        message = "; ".join(dict.fromkeys(said)).replace(*self._copied)
        raise AircraftError(f"{self.case.source}: {what}: {message or 'it gives no reason'}")

    def has(self, name: str) -> bool:
        """Return whether there is such a property."""
        return self._properties.get_node(name) is not None

    def node(self, name: str) -> jsbsim.FGPropertyNode:
        """Return a property; AircraftError with the nearest name if there is none."""
        node = self._properties.get_node(name)
        if node is None:
            known = [entry.split(" ")[0] for entry in self.fdm.get_property_catalog()]
            near = get_close_matches(name, known, n=1, cutoff=0.5)
            raise AircraftError(
                f"{self.case.source}: the model has no property '{name}'",
                hint=f"did you mean '{near[0]}'?" if near else "",
            )
        return node

    def read(self, name: str) -> float:
        """Return a property's value in JSBSim's unit."""
        return float(self.node(name).get_double_value())

    def readable(self, name: str) -> bool:
        """Return whether a property can be read; one that cannot acts when it is written, and keeps nothing."""
        return bool(self.node(name).get_attribute(jsbsim.Attribute.READ))

    def setter(self, name: str) -> Callable[[float], bool]:
        """Return what writes a property; AircraftError if there is none, or if it is read-only."""
        node = self.node(name)
        if not node.get_attribute(jsbsim.Attribute.WRITE):
            raise AircraftError(f"{self.case.source}: property '{name}' is read-only")
        put: Callable[[float], bool] = node.set_double_value
        return put

    def write(self, name: str, value: float) -> None:
        """Write a property in JSBSim's unit."""
        self.setter(name)(value)

    def evaluate(self) -> None:
        """Make the initial condition the state; AircraftError if JSBSim refuses."""
        try:
            started = self.fdm.run_ic()
        except jsbsim.BaseError as error:
            self.fail("JSBSim cannot start it", str(error))
        if not started:
            self.fail("JSBSim cannot start it")

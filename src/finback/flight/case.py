"""One flight of an aircraft as it is, or of a script of JSBSim: nothing derived, nothing replaced.

This is how a check case of another simulator is flown. What is guarded against in ``simulator`` is guarded here too;
a script keeps the initial condition, the step and the events that it has, but not JSBSim's first-order integrators.
"""

from __future__ import annotations

import importlib.util
import math
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum
from operator import call
from pathlib import Path
from types import MappingProxyType
from typing import Final, NoReturn, final

import jsbsim
import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import AircraftError, InputError
from finback.flight.case_column import CASE_COLUMNS, CaseColumn
from finback.flight.jsbsim_log import Log, keep_alive, one_line, refuse_threads
from finback.flight.plan import whole_steps
from finback.flight.recorder import Recorder
from finback.flight.simulator import jsbsim_version
from finback.records import Outcome

_RATES: Final = ("rate/rotational", "rate/translational", "position/translational")
_ATTITUDE: Final = "position/rotational"
_ADAMS_BASHFORTH_4: Final = 5  # JSBSim's number for it
_POSITIVE: Final = ("inertia/mass-slugs", *(f"inertia/i{axis}-slugs_ft2" for axis in ("xx", "yy", "zz")))
_MOST_ROWS: Final = 10_000_000


class Attitude(StrEnum):
    """How the attitude is integrated."""

    BUSS2 = "buss2"
    """second order on the rotation group; keeps a tumbling body's quaternion a rotation (Buss 2000)"""
    AB4 = "ab4"


_ATTITUDE_NUMBERS: Final = {Attitude.BUSS2: 7, Attitude.AB4: _ADAMS_BASHFORTH_4}


class _Ending(StrEnum):
    """Why a flight ended, as its note says it."""

    DURATION = "flown to its end"
    SCRIPT = "the script ended"
    NOT_FINITE = "no longer finite"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A property that is written over time: straight lines between the points, held before and after them.

    Attributes:
        jsbsim_property: what is written.
        time_s: times, not decreasing, shape (n,); two alike are a jump.
        values: in the property's own unit, shape (n,).
    """

    jsbsim_property: str
    time_s: FloatArray
    values: FloatArray

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

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the values at times of shape (n,); at a jump the mean of both sides.

        The mean keeps a multistep integrator from acting half a step early (``Schedule.drive``).
        """
        before = np.interp(np.nextafter(time_s, -np.inf), self.time_s, self.values)
        after = np.interp(np.nextafter(time_s, np.inf), self.time_s, self.values)
        return 0.5 * (before + after)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What is flown, and how.

    Attributes:
        source: XML of an aircraft, or of a script.
        settings: property -> value in JSBSim's unit, written before the start, in this order.
        initial_file: JSBSim's initialization file; empty for the script's own or none.
        planet_file: JSBSim's planet file; empty for the Earth of WGS 84.
        drives: properties that are written over time.
        duration_s: > 0, taken to the nearest whole number of steps; 0 flies a script to its own end.
        step_s: > 0; 0 takes a script's own.
        sample_interval_s: a whole number of steps; 0 for every step.
        attitude: how it is integrated.
        columns: what is recorded besides ``CASE_COLUMNS``.
    """

    source: Path
    settings: tuple[tuple[str, float], ...] = ()
    initial_file: str = ""
    planet_file: str = ""
    drives: tuple[Drive, ...] = ()
    duration_s: float = 0.0
    step_s: float = 0.0
    sample_interval_s: float = 0.0
    attitude: Attitude = Attitude.BUSS2
    columns: tuple[CaseColumn, ...] = ()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlownCase:
    """What a case gave.

    Attributes:
        name: of the file that was flown.
        columns: name with SI unit -> values, shape (n,), ``time_s`` first.
        outcome: completed, or diverged where a number was no longer finite (rows end before it).
        note: the outcome in a sentence.
        warnings: what JSBSim said on loading and flying.
        provenance: text facts.
    """

    name: str
    columns: Mapping[str, FloatArray]
    outcome: Outcome
    note: str
    warnings: tuple[str, ...]
    provenance: Mapping[str, str]

    def __post_init__(self) -> None:
        """Freeze the columns."""
        object.__setattr__(
            self, "columns", MappingProxyType({name: frozen_array(values) for name, values in self.columns.items()})
        )
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))


def is_script(path: Path) -> bool:
    """Return whether an XML file is a script of JSBSim.

    Raises:
        AircraftError: it cannot be read as XML.
    """
    try:
        return ET.parse(path).getroot().tag == "runscript"  # noqa: S314 - JSBSim itself will read the file
    except (OSError, ET.ParseError) as error:
        raise AircraftError(f"{path}: cannot be read as XML: {error}") from None


def fly_case(case: Case) -> FlownCase:
    """Fly a case from start to end and return what was recorded.

    Raises:
        AircraftError: JSBSim does not load or start it, or a property is unknown or read-only; with JSBSim's words.
        InputError: the step, the duration or the sample interval do not fit together.
    """
    refuse_threads()
    with tempfile.TemporaryDirectory(prefix="finback-case-") as elsewhere:
        return _Flight(case, elsewhere).fly()


@final
class _Flight:
    """One JSBSim object with one case."""

    def __init__(self, case: Case, elsewhere: str) -> None:
        self.case = case
        self.script = is_script(case.source)
        self.words = Log()
        jsbsim.set_logger(self.words)
        jsbsim.FGJSBBase().debug_lvl = 0  # type: ignore[no-untyped-call] # jsbsim leaves it untyped
        self.fdm = jsbsim.FGFDMExec(None)
        self.fdm.set_output_path(elsewhere)  # a model may open output files of its own on loading
        try:
            self._load()
        except jsbsim.BaseError as error:
            self._fail("JSBSim does not load it", str(error))
        if self.words.worse:
            self._fail("JSBSim does not load it cleanly")
        self.fdm.disable_output()
        self.properties = self.fdm.get_property_manager()

    def _load(self) -> None:
        case = self.case
        if case.step_s:
            self.fdm.set_dt(case.step_s)  # before a model is loaded: filters keep the step they are loaded with
        if case.planet_file and not self.fdm.load_planet(str(Path(case.planet_file).resolve()), False):
            self._fail(f"JSBSim does not load the planet {case.planet_file}")
        root = _root_of(case.source, script=self.script)
        for folder, choose in (
            ("aircraft", self.fdm.set_aircraft_path),
            ("engine", self.fdm.set_engine_path),
            ("systems", self.fdm.set_systems_path),
        ):
            if (root / folder).is_dir():
                choose(str(root / folder))
        if self.script:
            initial = str(Path(case.initial_file).resolve()) if case.initial_file else ""
            if not self.fdm.load_script(str(case.source.resolve()), case.step_s, initial):
                self._fail("JSBSim does not load it")
            return
        self.fdm.set_aircraft_path(str(case.source.resolve().parent))
        if not self.fdm.load_model(case.source.stem, False):
            self._fail("JSBSim does not load it")
        if case.initial_file and not self.fdm.load_ic(str(Path(case.initial_file).resolve()), False):
            self._fail(f"JSBSim does not load the initial condition {case.initial_file}")

    def _fail(self, what: str, *words: str) -> NoReturn:
        keep_alive(self.fdm)
        said = [*(one_line(word) for word in words if word.strip()), *self.words.texts]
        raise AircraftError(f"{self.case.source}: {what}: {'; '.join(dict.fromkeys(said)) or 'it gives no reason'}")

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        node = self.properties.get_node(name)
        if node is None:
            known = [entry.split(" ")[0] for entry in self.fdm.get_property_catalog()]
            near = get_close_matches(name, known, n=1, cutoff=0.5)
            raise AircraftError(
                f"{self.case.source}: the model has no property '{name}'",
                hint=f"did you mean '{near[0]}'?" if near else "",
            )
        return node

    def _setter(self, name: str) -> Callable[[float], bool]:
        node = self._node(name)
        if not node.get_attribute(jsbsim.Attribute.WRITE):
            raise AircraftError(f"{self.case.source}: property '{name}' is read-only")
        put: Callable[[float], bool] = node.set_double_value
        return put

    def _start(self) -> None:
        for name in _RATES:
            self._setter(f"simulation/integrator/{name}")(_ADAMS_BASHFORTH_4)
        self._setter(f"simulation/integrator/{_ATTITUDE}")(_ATTITUDE_NUMBERS[self.case.attitude])
        taken: list[tuple[str, float]] = []  # settings that can be read back
        for name, value in self.case.settings:
            if not math.isfinite(value):
                raise InputError(f"'{name}' would become {value}", hint="give a finite number")
            self._setter(name)(value)
            if not name.startswith("ic/") and self._node(name).get_double_value() == value:
                taken.append((name, value))
        for drive in self.case.drives:
            self._setter(drive.jsbsim_property)(float(drive.at(np.zeros(1))[0]))
        try:
            started = self.fdm.run_ic()
        except jsbsim.BaseError as error:
            self._fail("JSBSim cannot start it", str(error))
        if not started:
            self._fail("JSBSim cannot start it")
        self._check_start(taken)

    def _check_start(self, taken: list[tuple[str, float]]) -> None:
        """Fail without mass, and say which settings the start has set again."""
        for name in _POSITIVE:
            if not (found := float(self._node(name).get_double_value())) > 0.0:
                self._fail(f"'{name}' is {found:.6g}", "nothing flies without mass and moments of inertia")
        for name, value in taken:
            if (now := float(self._node(name).get_double_value())) != value:
                self.words.texts.append(
                    f"the start has made '{name}' {now:.6g} again, not {value:.6g}; a wind is --ic wind_east_m_s=…, "
                    f"anything else a schedule: --schedule {name}=0:{value:.6g}"
                )

    def fly(self) -> FlownCase:
        """Start, step, record."""
        self._start()
        step = float(self.fdm.get_delta_t())
        steps, every = self._lengths(step)
        names, recorder = self._recorder()
        ending = self._record(steps, every, step, recorder)
        table = recorder.table()
        return FlownCase(
            name=self.case.source.stem,
            columns={"time_s": table[:, 0], **{name: table[:, k + 1] for k, name in enumerate(names)}},
            outcome=Outcome.DIVERGED if ending is _Ending.NOT_FINITE else Outcome.COMPLETED,
            note=f"{ending.value} at {table[-1, 0]:.9g} s",
            warnings=tuple(dict.fromkeys(self.words.texts)),
            provenance={
                "source": str(self.case.source),
                "step_s": repr(step),
                "integrators": f"AB4, attitude {self.case.attitude.value}",
                "jsbsim": jsbsim_version(),
            },
        )

    def _lengths(self, step: float) -> tuple[int, int]:
        """Return the steps to fly, and after how many a row is kept."""
        case = self.case
        if not step > 0.0:
            raise InputError(f"{case.source}: its step is {step} s", hint="mend dt in the script, or give --step-hz")
        if not case.duration_s and (not self.script or case.drives):
            what = "a schedule" if self.script else "an aircraft without a script"
            raise InputError(f"{what} needs a duration", hint="give --duration in s")
        every = whole_steps(case.sample_interval_s, step, what="the sample interval") if case.sample_interval_s else 1
        steps = round(case.duration_s / step) if case.duration_s else every * _MOST_ROWS
        if every < 1 or steps < 1 or steps // every > _MOST_ROWS:
            raise InputError(f"{steps} steps with a row after every {every} fit in no record")
        return steps, every

    def _recorder(self) -> tuple[list[str], Recorder]:
        """Return the names of the columns after the time, and what records them all."""
        found: dict[str, tuple[jsbsim.FGPropertyNode, str]] = {}
        for column in CASE_COLUMNS:
            node = self.properties.get_node(column.jsbsim_property)
            if node is not None and column.name not in {extra.name for extra in self.case.columns}:
                found[column.name] = (node, column.jsbsim_unit)
        for column in self.case.columns:
            found[column.name] = (self._node(column.jsbsim_property), column.jsbsim_unit)
        readers = [self.fdm.get_sim_time, *(node.get_double_value for node, _ in found.values())]
        return list(found), Recorder(readers, ["s", *(unit for _, unit in found.values())])

    def _record(self, steps: int, every: int, step: float, recorder: Recorder) -> _Ending:
        """Fly, and say how the rows end."""
        times = frozen_array(np.arange(steps + 1 if self.case.drives else 0) * step)
        drives = [(self._setter(drive.jsbsim_property), drive.at(times).tolist()) for drive in self.case.drives]
        airspeed = self._node("velocities/vtrue-fps").get_double_value  # alpha would read 0 where it is NaN
        run, isfinite = self.fdm.run, math.isfinite
        columns, pack, keep = recorder.columns, recorder.pack, recorder.keep
        recorder.take()
        for number in range(1, steps + 1):
            for put, values in drives:
                put(values[number])  # of the time that the step goes to
            try:
                running = run()
            except jsbsim.BaseError as error:
                self._fail(f"JSBSim stops at {float(self.fdm.get_sim_time()):.9g} s", str(error))
            if not isfinite(airspeed()):
                return _Ending.NOT_FINITE
            if number % every == 0:
                keep(pack(*map(call, columns)))
            if not running:
                return _Ending.SCRIPT
        return _Ending.DURATION


def _root_of(source: Path, *, script: bool) -> Path:
    """Return the folder with ``aircraft``, ``engine`` and ``systems`` that a file belongs to, or JSBSim's own."""
    own = source.resolve().parents
    if not script:
        return own[2] if len(own) > 2 else own[0]  # <root>/aircraft/<name>/<name>.xml
    used = ET.parse(source).getroot().find("use")  # noqa: S314 - JSBSim itself will read the file
    name = "" if used is None else used.get("aircraft", "")
    for folder in own:
        if (folder / "aircraft" / name / f"{name}.xml").is_file():
            return folder
    package = importlib.util.find_spec("jsbsim")
    places = package.submodule_search_locations if package is not None else None
    return Path(next(iter(places))) if places else own[0]

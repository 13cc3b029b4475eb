"""A case from its start to its end: what is flown of it, and what is recorded."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from operator import call
from typing import Final, final

import jsbsim
import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError
from finback.flight.case import Attitude, Case, CaseEngine, FlownCase
from finback.flight.case_column import CASE_COLUMNS
from finback.flight.case_drive import Drive
from finback.flight.case_engines import CaseEngines
from finback.flight.case_load import Loaded
from finback.flight.case_start import Access
from finback.flight.plan import whole_steps
from finback.flight.recorder import Recorder
from finback.flight.simulator import jsbsim_version
from finback.records import Outcome
from finback.units import to_si

_RATES: Final = ("rate/rotational", "rate/translational", "position/translational")
_ATTITUDE: Final = "position/rotational"
_ADAMS_BASHFORTH_4: Final = 5  # JSBSim's number for it
_ATTITUDE_NUMBERS: Final = {Attitude.BUSS2: 7, Attitude.AB4: _ADAMS_BASHFORTH_4}
_POSITIVE: Final = ("inertia/mass-slugs", *(f"inertia/i{axis}-slugs_ft2" for axis in ("xx", "yy", "zz")))
_WINDS: Final = {"wind_north": "atmosphere/wind-north-fps", "wind_east": "atmosphere/wind-east-fps"}
_MOST_NUMBERS: Final = 200_000_000
"""In one record: 1.6 GB, and as much again while it is converted."""
_ON_STEP: Final = 1e-6  # of a step: what rounding of decimal times may leave
_PRINTED: Final = 5e-5  # of a script's dt: what printing it with four digits may leave
_MOST_OFF: Final = 0.1  # of a step: however many of them an interval has
_OFF_CLOCK: Final = 0.5  # of a step: JSBSim adds its steps up, to 1e-9 of one after an hour
_STILL_FT_S: Final = 1e-3
_ON_GEAR: Final = "gear/wow"
_KEPT: Final = 1e-9  # of a scheduled value: what a model that takes it may add in rounding


@final
class _Ending(StrEnum):
    """Why a flight ended, as its note says it."""

    DURATION = "flown to its end"
    SCRIPT = "the script ended"
    NOT_FINITE = "no longer finite"
    TIME = "ended because the script or the model stops or sets its clock"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Written:
    """A property that a drive writes.

    Attributes:
        name: of the property.
        put: writes it.
        get: reads it.
        values: for each step, the start included.
        drive: what it belongs to.
        trigger: it acts when it is written and cannot be read (engines are started so): written only where the value
            changes.
    """

    name: str
    put: Callable[[float], bool]
    get: Callable[[], float]
    values: list[float]
    drive: Drive
    trigger: bool

    def writer(self) -> Callable[[float], object]:
        """Return what writes the values of one step after another, the start's being written."""
        if not self.trigger:
            return self.put
        last = self.values[0]

        def write(value: float) -> None:
            nonlocal last
            if value != last:
                last = value
                self.put(value)

        return write

    def kept(self, number: int) -> bool:
        """Return whether the model has kept the value of a step; a trigger keeps none."""
        if self.trigger:
            return True
        wanted = self.values[number]
        return abs(self.get() - wanted) <= _KEPT * max(1.0, abs(wanted))


def fly_case(case: Case) -> FlownCase:
    """Fly a case from start to end and return what was recorded.

    JSBSim may end the interpreter over a faulty file; ``fly_apart`` flies it in a process of its own.

    Raises:
        AircraftError: JSBSim does not load or start it, or a property is unknown or read-only; with JSBSim's words.
        InputError: the step, the duration or the sample interval do not fit together, or the start is none that JSBSim
            can make.
    """
    with tempfile.TemporaryDirectory(prefix="finback-case-") as elsewhere:
        return _Flight(case, elsewhere).fly()


@final
class _Flight:
    """One flight of a case."""

    def __init__(self, case: Case, elsewhere: str) -> None:
        self.case = case
        self.loaded = Loaded(case, elsewhere)
        self.engines = CaseEngines(case, self.loaded)
        self.profile = [profile.native() for profile in case.wind]

    def fly(self) -> FlownCase:
        """Start, step, record."""
        self._start()
        step = float(self.loaded.fdm.get_delta_t())
        names, recorder = self._recorder()
        steps, every = self._lengths(step, len(names) + 1)
        ending = self._record(steps, every, step, recorder)
        self._tell_depth()
        table = recorder.table()
        return FlownCase(
            name=self.case.source.stem,
            columns={"time_s": table[:, 0], **{name: table[:, k + 1] for k, name in enumerate(names)}},
            outcome=Outcome.DIVERGED if ending is _Ending.NOT_FINITE else Outcome.COMPLETED,
            note=f"{ending.value} at {table[-1, 0]:.9g} s",
            warnings=tuple(dict.fromkeys([*self.loaded.words.texts, *self.loaded.notes])),
            provenance={
                "source": str(self.case.source),
                "step_s": repr(step),
                "integrators": f"AB4, attitude {self.case.attitude.value}",
                "jsbsim": jsbsim_version(),
                **{f"schedule {drive.jsbsim_property}": drive.told() for drive in self.case.drives},
            },
        )

    def _start(self) -> None:
        for name, number in self._integrators().items():
            self.loaded.setter(name)(number)
        taken: list[tuple[str, float]] = []  # settings that can be read back
        for name, value in self.case.settings:
            if not math.isfinite(value):
                raise InputError(f"'{name}' would become {value}", hint="give a finite number")
            if not name.startswith("ic/"):
                self.loaded.write(name, value)
                if self.loaded.read(name) == value:
                    taken.append((name, value))
        access = Access(read=self.loaded.read, write=self.loaded.write, evaluate=self.loaded.evaluate)
        self.case.start.put(access, self._wind_at_start)
        for name, value in self.case.settings:  # raw initial conditions have the last word
            if name.startswith("ic/"):
                self.loaded.write(name, value)
        driven = [one for drive in self.case.drives for one in self._written(drive, frozen_array([self._begin_s()]))]
        _put_first([one for one in driven if not one.trigger])
        self.loaded.evaluate()
        self._check_start([one for one in taken if one[0] not in {other.name for other in driven}])
        if self.case.engines is CaseEngine.RUNNING:
            self.engines.start(lambda: _put_first([one for one in driven if not one.trigger]))
        _put_first(driven)  # the start may have set it again

    def _tell_depth(self) -> None:
        """Say so if it has ended below the ground, which no gear of it has held."""
        depth = -to_si(self.loaded.read("position/h-agl-ft"), "ft")
        if depth > 0.0:
            self.loaded.notes.append(
                f"it ends {depth:.6g} m below the ground: the contact points of its <ground_reactions>, if it has any, "
                "did not hold it"
            )

    def _integrators(self) -> dict[str, float]:
        numbers = {f"simulation/integrator/{name}": float(_ADAMS_BASHFORTH_4) for name in _RATES}
        return {**numbers, f"simulation/integrator/{_ATTITUDE}": float(_ATTITUDE_NUMBERS[self.case.attitude])}

    def _begin_s(self) -> float:
        return next((script.start_s for script in self.loaded.scripts), 0.0)

    def _wind_at_start(self, altitude_ft: float) -> dict[str, float]:
        """Return the winds at the start that schedules and the profile have, in m/s."""
        winds: dict[str, float] = {}
        for profile in self.profile:
            winds |= zip(_WINDS, profile(altitude_ft), strict=True)
        for drive in self.case.drives:
            for name, place in _WINDS.items():
                if drive.jsbsim_property == place:
                    winds[name] = float(drive.at(frozen_array([self._begin_s()]))[0])
        return {name: to_si(value, "ft_s") for name, value in winds.items()}

    def _written(self, drive: Drive, times: FloatArray) -> list[_Written]:
        """Return the properties that a drive writes, with the values of these times."""
        names = [drive.jsbsim_property]
        while drive.every_engine and self.loaded.has(another := f"{drive.jsbsim_property}[{len(names)}]"):
            names.append(another)
        if drive.jsbsim_property.startswith("ic/"):
            raise InputError(
                f"a schedule of '{drive.jsbsim_property}', which JSBSim reads before the flight only",
                hint="an initial condition is --ic NAME=VALUE",
            )
        values = drive.at(times).tolist()
        return [
            _Written(
                name=name,
                put=self.loaded.setter(name),
                get=self.loaded.node(name).get_double_value,
                values=values,
                drive=drive,
                trigger=not self.loaded.readable(name),
            )
            for name in names
        ]

    def _check_start(self, taken: list[tuple[str, float]]) -> None:
        """Fail without mass or with another start than asked for; say which settings the start has set again."""
        for name in _POSITIVE:
            if not (found := self.loaded.read(name)) > 0.0:
                self.loaded.fail(f"'{name}' is {found:.6g}", "nothing flies without mass and moments of inertia")
        raw = any(name.startswith("ic/") for name, _ in self.case.settings)
        if not raw and (missed := self.case.start.missed(self.loaded.read)):
            raise InputError(
                f"{self.case.source}: JSBSim's start is not the one asked for: {'; '.join(missed)}",
                hint="give fewer of them: speed and flow angles, or velocities; two of theta, alpha and gamma",
            )
        self._tell_rest(raw=raw)
        for name, value in taken:
            if (now := self.loaded.read(name)) != value:
                instead = f"a wind is --ic wind_east_m_s=…, anything else a schedule: --schedule {name}=0:{value:.6g}"
                if name.endswith("/set-running"):
                    instead = "engines are started by --engines running"
                self.loaded.notes.append(f"the start has made '{name}' {now:.6g} again, not {value:.6g}; {instead}")

    def _tell_rest(self, *, raw: bool) -> None:
        """Say what begins without an airspeed that nobody asked for, and what begins on its gear."""
        case, notes = self.case, self.loaded.notes
        said = raw or case.start.moves or case.initial_file or self.loaded.scripts
        if not said and self.loaded.read("velocities/vtrue-fps") < _STILL_FT_S:
            notes.append("it begins without airspeed, where alpha and beta mean nothing: --ic airspeed_kt=… gives one")
        if self.loaded.has(_ON_GEAR) and self.loaded.read(_ON_GEAR):
            notes.append(
                "it begins with its gear on or in the ground: integrators of fourth order shake what rests there, "
                "and alpha means nothing while it is slow"
            )

    def _lengths(self, step: float, columns: int) -> tuple[int, int]:
        """Return the steps to fly, and after how many a row is kept."""
        case, scripts = self.case, self.loaded.scripts
        if not step > 0.0:
            raise InputError(f"{case.source}: its step is {step} s", hint="mend dt in the script, or give --step-hz")
        duration = case.duration_s or sum(script.end_s - script.start_s for script in scripts)
        if not 0.0 < duration < math.inf:
            what = "a script without an end" if scripts else "an aircraft without a script"
            raise InputError(f"{what} needs a duration", hint="give --duration in s")
        every = self._every(step) if case.sample_interval_s else 1
        steps = max(1, round(duration / step))
        if every < 1 or (steps // every) * columns > _MOST_NUMBERS:
            raise InputError(
                f"{duration:.6g} s in steps of {step:.6g} s give {steps // max(1, every)} rows of {columns} numbers, "
                f"more than the {_MOST_NUMBERS} that one record holds",
                hint="fewer rows a second: --sample-hz; or a shorter flight: --duration",
            )
        return steps, every

    def _every(self, step: float) -> int:
        """Return after how many steps a row is kept.

        A script prints its dt with a few digits (0.008333 for 1/120 s): the nearest number of steps is meant, and the
        rows have the times that those steps make.
        """
        interval = self.case.sample_interval_s
        steps = max(1, round(interval / step))
        if self.loaded.scripts and abs(interval - steps * step) <= min(_PRINTED * interval, _MOST_OFF * step):
            return steps
        return whole_steps(interval, step, what="the sample interval")

    def _recorder(self) -> tuple[list[str], Recorder]:
        """Return the names of the columns after the time, and what records them all."""
        found: dict[str, tuple[jsbsim.FGPropertyNode, str]] = {}
        asked = {extra.name for extra in self.case.columns}
        for column in CASE_COLUMNS:
            if column.name not in asked and self.loaded.has(column.jsbsim_property):
                found[column.name] = (self.loaded.node(column.jsbsim_property), column.jsbsim_unit)
        for column in self.case.columns:
            found[column.name] = (self.loaded.node(column.jsbsim_property), column.jsbsim_unit)
        readers = [self.loaded.fdm.get_sim_time, *(node.get_double_value for node, _ in found.values())]
        return list(found), Recorder(readers, ["s", *(unit for _, unit in found.values())])

    def _record(self, steps: int, every: int, step: float, recorder: Recorder) -> _Ending:
        """Fly, and say how the rows end."""
        times = frozen_array(self._begin_s() + np.arange(steps + 1 if self.case.drives else 0) * step)
        self._tell_jumps(steps, step)
        driven = [one for drive in self.case.drives for one in self._written(drive, times)]
        writers = [(one.writer(), one.values) for one in driven]
        blowers = [self._blower(profile, step) for profile in self.profile]
        airspeed = self.loaded.node("velocities/vtrue-fps").get_double_value  # alpha would read 0 where it is NaN
        fdm, isfinite = self.loaded.fdm, math.isfinite
        run, clock = fdm.run, fdm.get_sim_time
        columns, pack, keep, watch = recorder.columns, recorder.pack, recorder.keep, self.engines.watch
        overwritten: set[str] = set()
        recorder.take()
        begin, wrong = clock(), _OFF_CLOCK * step
        for number in range(1, steps + 1):
            for put, values in writers:
                put(values[number])  # of the time that the step goes to
            for blow in blowers:
                blow()
            try:
                running = run()
            except jsbsim.BaseError as error:
                self.loaded.fail(f"JSBSim stops at {clock():.9g} s", str(error))
            if not isfinite(airspeed()):
                return _Ending.NOT_FINITE
            if number % every == 0:
                row = tuple(map(call, columns))
                if not -wrong < row[0] - begin - number * step < wrong:
                    self.loaded.notes.append(f"{_Ending.TIME.value}: rows end before that")
                    return _Ending.TIME
                keep(pack(*row))
                watch()
                if driven:
                    overwritten.update(one.name for one in driven if not one.kept(number))
            if not running:
                break
        self._check_flown(driven, overwritten)
        return _Ending.DURATION if running and self.case.duration_s else _Ending.SCRIPT

    def _tell_jumps(self, steps: int, step: float) -> None:
        """Say which jumps of schedules fall between two steps, where no step can make them."""
        for drive in self.case.drives:
            at = (drive.jumps_s() - self._begin_s()) / step
            between = at[(np.abs(at - np.round(at)) > _ON_STEP) & (at > 0.0) & (at < steps)]
            if between.size:
                when = self._begin_s() + step * between[0]
                self.loaded.notes.append(
                    f"'{drive.jsbsim_property}' jumps at {when:.9g} s, between two steps of {step:.6g} s: "
                    "it is flown up to a step late"
                )

    def _blower(self, profile: Callable[[float], tuple[float, float]], step: float) -> Callable[[], None]:
        """Return what sets the wind of the altitude that the next step goes to."""
        altitude = self.loaded.node("position/h-sl-ft").get_double_value
        climb = self.loaded.node("velocities/h-dot-fps").get_double_value
        north, east = (self.loaded.setter(place) for place in _WINDS.values())

        def blow() -> None:
            to_north, to_east = profile(altitude() + step * climb())
            north(to_north)
            east(to_east)

        return blow

    def _check_flown(self, driven: list[_Written], overwritten: set[str]) -> None:
        """Say what the model or the script has taken from the flight: schedules, integrators, engines."""
        self.loaded.notes += self.engines.notes()
        for one in driven:
            if one.name not in overwritten:
                continue
            what = f"{self.case.source}: the model sets '{one.name}' itself, and the schedule of it is not flown"
            if one.drive.owned:
                raise InputError(what, hint="schedule the command: elevator, aileron, rudder … or a property")
            self.loaded.notes.append(what)
        for name, number in self._integrators().items():
            if self.loaded.read(name) != number:
                self.loaded.notes.append(f"'{name}' has become {self.loaded.read(name):g} in flight, by an event")


def _put_first(driven: list[_Written]) -> None:
    for one in driven:
        one.put(one.values[0])

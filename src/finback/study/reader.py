"""Study files: TOML in degrees and hertz, read into plans in SI, or one error that names every fault.

Every key of the file names its unit; that suffix alone decides the conversion, by the table of ``finback.units``. Any
number of a maneuver may be a list: one flight is made for each combination.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar, final

from pydantic import ValidationError

from finback.errors import FinbackError, StudyError
from finback.flight.aircraft import Aircraft, find_aircraft
from finback.flight.campaign.plan import Campaign
from finback.flight.excitation import Doublet, Hold, Maneuver, Ramp, Release, Step, ThreeTwoOneOne, schedule
from finback.flight.oscillation import LinearSweep, LogSweep, MultisineInput
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.identification.options import IdentificationOptions
from finback.records import Condition
from finback.study.campaign import Surroundings, read_campaign
from finback.study.faults import dotted, explain, nearest, read_toml, show
from finback.study.flight import read_flight, read_sensors
from finback.study.identification import read_identification
from finback.study.stand_ins import STAND_INS
from finback.study.study import Study, StudyPart
from finback.study.tables import (
    KINDS,
    TABLES,
    AnalysisTable,
    ConditionTable,
    HeadTable,
    Table,
    in_si,
)
from finback.study.validation import read_validation
from finback.units import from_si, to_si
from finback.validation.options import ValidationOptions

if TYPE_CHECKING:
    from finback.dynamics.analysis import AnalysisOptions

MAXIMUM_FLIGHTS: Final = 10_000
"""More combinations than this in one table are taken for a mistake."""
MAXIMUM_STEPS: Final = 10_000_000
"""Integration steps of one flight: seven hours at 400 Hz. More are taken for a mistake."""
MAXIMUM_SAMPLES: Final = 10_000_000
"""Samples of all flights of one list: 28 hours at 100 Hz. More are taken for a mistake, and fit in no memory."""
MAXIMUM_POINTS: Final = 10_000
"""Elevators at which an analysis lists the equilibria. More are taken for a mistake."""

_STAGES: Final = ("identification", "analysis")
"""Sections of what is asked of a model, in order."""

T = TypeVar("T", bound=Table)
V = TypeVar("V")


def read_study(path: Path, *, aircraft: str = "") -> Study:
    """Read a study file.

    Args:
        path: the file.
        aircraft: name or path of the aircraft to take in place of the file's, if not empty.

    Raises:
        StudyError: with every fault of the file, a missing or broken aircraft included.
    """
    study, _, faults = inspect_study(path, aircraft=aircraft)
    if study is None:
        raise StudyError(str(path), faults)
    return study


def read_study_part(path: Path, *needed: str, aircraft: str = "") -> StudyPart:
    """Read what a study asks of a model: sections of other stages may be missing, and are checked where they are.

    Args:
        path: the file.
        needed: ``identification``, ``analysis``: sections that must be there.
        aircraft: name or path of the aircraft to take in place of the file's, if not empty.

    Raises:
        StudyError: with every fault of the file, a missing or broken aircraft included.
    """
    faults: list[str] = []
    _, table = read_toml(path, faults)
    if faults:
        raise StudyError(str(path), tuple(faults))
    reader = StudyReader(table, faults)
    found = reader.aircraft(path.resolve().parent, aircraft)
    flight = read_flight(reader, reader.seed)
    read_sensors(reader, flight)
    reader.table(ConditionTable, "condition")
    maneuvers = reader.maneuvers(reader.root["sweep"], "sweep", flight) if "sweep" in reader.root else ()
    part = reader.part(flight, maneuvers, needed)
    if "validation" in reader.root:
        reader.validation(flight, maneuvers)
    if faults or found is None:
        raise StudyError(str(path), tuple(dict.fromkeys(faults)))
    identification, analysis = part
    return StudyPart(
        aircraft=found,
        identification=() if identification is None else (identification,),
        analysis=() if analysis is None else (analysis,),
    )


def inspect_study(path: Path, *, aircraft: str = "") -> tuple[Study | None, Aircraft | None, tuple[str, ...]]:
    """Return the study if its file has no fault, its aircraft if that was found, and every fault."""
    faults: list[str] = []
    text, table = read_toml(path, faults)
    if faults:
        return None, None, tuple(faults)
    reader = StudyReader(table, faults)
    found = reader.aircraft(path.resolve().parent, aircraft)
    study = reader.study(path, text, found)
    return (None if faults else study), found, tuple(dict.fromkeys(faults))


@final
class StudyReader:
    """One pass over a parsed file: every method adds the faults it finds, and returns what can still be read.

    A study with faults is never given to anybody; what is returned beside a fault serves to find further ones.
    """

    def __init__(self, root: dict[str, Any], faults: list[str]) -> None:
        self.faults = faults
        self.broken: set[str] = set()
        self.root = root
        self.head = self.parse(HeadTable, {key: root[key] for key in root if key not in TABLES}, "", others=TABLES)

    @property
    def seed(self) -> int:
        """The study's seed."""
        return self.head.seed if self.head is not None else 0

    def fault(self, place: str, message: str) -> None:
        """Add a fault."""
        self.faults.append(f"{place}: {message}")

    # tables

    def parse(self, kind: type[T], value: object, place: str, others: tuple[str, ...] = ()) -> T | None:
        """Read one table, or add its faults; ``others`` are keys that are allowed here but read elsewhere."""
        if not isinstance(value, dict):
            self.fault(place, f"must be a table [{place}], got {show(value)}")
            return None
        try:
            return kind.model_validate(value)
        except ValidationError as error:
            keys = [*(field.alias or name for name, field in kind.model_fields.items()), *others]
            for fault in error.errors():
                self.fault(dotted(place, fault["loc"], value), explain(dict(fault), keys))
            return self.repaired(kind, value, place, {str(fault["loc"][0]) for fault in error.errors()})

    def repaired(self, kind: type[T], value: dict[str, Any], place: str, faulty: set[str]) -> T | None:
        """Read a table with stand-ins for its faulty keys, so that the rest of it is checked, too."""
        self.broken |= {f"{place}.{key}".removeprefix(".") for key in faulty}
        keys = {field.alias or name for name, field in kind.model_fields.items()}
        stand_ins = {key: STAND_INS[key] for key in faulty & keys & STAND_INS.keys()}
        try:
            return kind.model_validate({**{key: value[key] for key in value if key not in faulty}, **stand_ins})
        except ValidationError:  # a key that nothing stands in for
            return None

    def sound(self, *places: str) -> bool:
        """Tell whether all these keys are as they stand in the file."""
        return self.broken.isdisjoint(places)

    def table(self, kind: type[T], name: str) -> T | None:
        """Read the table called ``name`` of the root."""
        if name not in self.root:
            self.fault(name, f"missing; add a table [{name}]")
            return None
        return self.parse(kind, self.root[name], name)

    def make(self, place: str, build: Callable[[], V]) -> V | None:
        """Build a value whose own checks may find what the checks here did not."""
        try:
            return build()
        except FinbackError as error:
            self.fault(place, str(error).replace("\n  ", "; "))
            return None

    # the whole

    def aircraft(self, near: Path, instead: str) -> Aircraft | None:
        """Find the aircraft, also in a study with other faults."""
        name = instead or self.root.get("aircraft")
        if not isinstance(name, str) or not name:
            return None
        return self.make("aircraft", lambda: find_aircraft(name, near=near))

    def study(self, path: Path, text: str, aircraft: Aircraft | None) -> Study | None:
        """Read everything else."""
        condition = self.table(ConditionTable, "condition")
        flight = read_flight(self, self.seed)
        sensors = read_sensors(self, flight)
        if "campaign" in self.root:
            maneuvers: tuple[Maneuver, ...] = ()
            self.campaign(aircraft, condition, sensors, flight)
        else:
            maneuvers = self.maneuvers(self.root.get("sweep"), "sweep", flight)
        identification, analysis = self.part(flight, maneuvers, _STAGES)
        validation = self.validation(flight, maneuvers)
        if (
            self.faults
            or self.head is None
            or aircraft is None
            or condition is None
            or sensors is None
            or flight is None
            or identification is None
            or analysis is None
            or validation is None
        ):
            return None
        return Study(
            name=self.head.name,
            path=path,
            text=text,
            seed=self.head.seed,
            aircraft=aircraft,
            condition=Condition(**in_si(condition)),
            flight=flight,
            sensors=sensors,
            maneuvers=maneuvers,
            identification=identification,
            analysis=analysis,
            validation=validation,
        )

    def part(
        self, flight: FlightOptions | None, maneuvers: tuple[Maneuver, ...], needed: Iterable[str]
    ) -> tuple[IdentificationOptions | None, AnalysisOptions | None]:
        """Read ``[identification]`` and ``[analysis]`` where they stand or are needed."""
        there = {name for name in _STAGES if name in self.root} | set(needed)
        identification = self.identification(flight, maneuvers) if "identification" in there else None
        analysis = self.analysis(identification) if "analysis" in there else None
        return identification, analysis

    def campaign(
        self,
        aircraft: Aircraft | None,
        condition: ConditionTable | None,
        sensors: Sensors | None,
        flight: FlightOptions | None,
    ) -> Campaign | None:
        """Read the section of a campaign."""
        if "sweep" in self.root:
            self.fault("campaign", "a study has maneuvers [[sweep]] or a [campaign], not both")
        around = None
        if self.head is not None and aircraft is not None and condition is not None and sensors is not None:
            around = Surroundings(
                study=self.head.name,
                aircraft=aircraft,
                condition=Condition(**in_si(condition)),
                sensors=sensors,
                seed=self.head.seed,
            )
        return read_campaign(self, self.root.get("campaign"), flight, around)

    def maneuvers(self, tables: object, place: str, flight: FlightOptions | None) -> tuple[Maneuver, ...]:
        """Read an array of maneuver tables, each expanded to its combinations."""
        if not isinstance(tables, list) or not tables:
            self.fault(place, f"needs at least one maneuver: add a table [[{place}]]")
            return ()
        found: list[Maneuver] = []
        for index, table in enumerate(tables):
            found += self.combinations(table, f"{place}[{index}]", flight)
        if flight is not None:
            samples = sum(maneuver.duration_s / flight.sample_interval_s for maneuver in found)
            if samples > MAXIMUM_SAMPLES:
                self.fault(place, f"its flights have {samples:.3g} samples, more than {MAXIMUM_SAMPLES}")
        return tuple(found)

    def combinations(self, table: object, place: str, flight: FlightOptions | None) -> list[Maneuver]:
        """Read one maneuver, expanded to the combinations of its lists; each is checked against the flight's limits."""
        if not isinstance(table, dict):
            self.fault(place, f"must be a table, got {show(table)}")
            return []
        kind = table.get("kind")
        if not isinstance(kind, str) or kind not in KINDS:
            given = "missing" if kind is None else f"unknown kind {show(kind)}"
            self.fault(f"{place}.kind", f"{given}{nearest(kind, list(KINDS))}")
            self.broken.add(f"{place}.kind")
        likely = get_close_matches(str(kind), list(KINDS), n=1, cutoff=0.5)  # kind itself, if it is one
        if not likely:
            return []
        form, build = KINDS[likely[0]]
        rest = {key: value for key, value in table.items() if key != "kind"}
        read = self.parse(form, rest, place, others=("kind",))
        if read is None or not self.sound(f"{place}.kind"):
            self.reached(form, rest, place, flight)
            return []
        values = in_si(read)
        if math.prod(len(options) for options in values.values()) > MAXIMUM_FLIGHTS:
            self.fault(place, f"its lists combine to more than {MAXIMUM_FLIGHTS} flights")
            return []
        made = [
            self.make(place, partial(build, **dict(zip(values, one, strict=True))))
            for one in itertools.product(*values.values())
        ]
        maneuvers = [maneuver for maneuver in made if maneuver is not None]
        if flight is not None:
            for maneuver in maneuvers:
                self.fits(maneuver, place, flight)
        return maneuvers

    def reached(self, form: type[Table], rest: dict[str, Any], place: str, flight: FlightOptions | None) -> None:
        """Check of a maneuver with faults what can be checked key by key: angles and durations as they stand."""
        if flight is None:
            return
        limits = {
            "elevator_deg": (flight.elevator_limits_rad, "flight.elevator_limits_deg"),
            "to_elevator_deg": (flight.elevator_limits_rad, "flight.elevator_limits_deg"),
            "alpha_deg": (flight.alpha_limits_rad, "flight.alpha_limits_deg"),
        }
        for key in form.model_fields.keys() & rest.keys():
            if self.sound(f"{place}.{key}") and key in limits:
                self.inside(
                    f"{place}.{key}", [to_si(float(angle), "deg") for angle in _listed(rest[key])], *limits[key]
                )
            elif self.sound(f"{place}.{key}") and key == "duration_s":
                for duration in _listed(rest[key]):
                    self.affordable(f"{place}.{key}", float(duration), flight)

    def fits(self, maneuver: Maneuver, place: str, flight: FlightOptions) -> None:
        """Check one maneuver against the flight's limits."""
        before = len(self.faults)
        reached = [maneuver.elevator_rad]
        match maneuver:
            case Step():
                reached.append(maneuver.elevator_rad + maneuver.amplitude_rad)
            case Doublet() | ThreeTwoOneOne() | LinearSweep() | LogSweep() | MultisineInput():
                reached += [maneuver.elevator_rad + sign * maneuver.amplitude_rad for sign in (1, -1)]
            case Ramp():
                reached.append(maneuver.to_elevator_rad)
            case Release():
                self.inside(
                    f"{place}.alpha_deg", (maneuver.alpha_rad,), flight.alpha_limits_rad, "flight.alpha_limits_deg"
                )
            case Hold():
                pass
        self.inside(f"{place}.elevator_deg", reached, flight.elevator_limits_rad, "flight.elevator_limits_deg")
        self.affordable(f"{place}.duration_s", maneuver.duration_s, flight)
        if maneuver.duration_s < flight.sample_interval_s:
            self.fault(f"{place}.duration_s", f"{maneuver.duration_s:g} s is shorter than one sample interval")
        wrong = len(self.faults) > before  # then the movement itself is checked without limits
        self.make(
            place,
            lambda: schedule(
                maneuver,
                rate_limit_rad_s=flight.elevator_rate_rad_s,
                limits_rad=(-math.inf, math.inf) if wrong else flight.elevator_limits_rad,
                grid_s=flight.sample_interval_s,
            ),
        )

    def affordable(self, place: str, duration_s: float, flight: FlightOptions) -> None:
        """Check that a flight so long does not take more steps than anybody waits for."""
        if not self.sound(place, place.rpartition("[")[0], "flight.step_hz"):
            return
        steps = duration_s / flight.step_s
        if steps > MAXIMUM_STEPS:
            self.fault(
                place,
                f"makes a flight of {duration_s:.6g} s: {steps:.3g} steps of flight.step_hz, more than {MAXIMUM_STEPS}",
            )

    def inside(self, place: str, angles_rad: Iterable[float], limits_rad: tuple[float, float], name: str) -> None:
        """Check that angles lie inside limits that stand elsewhere in the file under ``name``."""
        if not self.sound(place, name):
            return
        low, high = limits_rad
        for angle in angles_rad:
            if not low <= angle <= high:
                self.fault(
                    place,
                    f"reaches {from_si(angle, 'deg'):.6g} deg, outside {name} = "
                    f"[{from_si(low, 'deg'):.6g}, {from_si(high, 'deg'):.6g}]",
                )

    def identification(
        self, flight: FlightOptions | None, maneuvers: tuple[Maneuver, ...] = ()
    ) -> IdentificationOptions | None:
        """Read ``[identification]``."""
        return read_identification(self, flight, maneuvers)

    def analysis(self, identification: IdentificationOptions | None) -> AnalysisOptions | None:
        """Read ``[analysis]``; it must hold the window of the identification."""
        from finback.dynamics.analysis import AnalysisOptions  # noqa: PLC0415 - a second that a campaign does not need

        table = self.table(AnalysisTable, "analysis")
        if table is None:
            return None
        if identification is not None:  # or a fold that the data support would be missing from the analysis
            window, range_rad = identification.alpha_window_rad, in_si(table)["alpha_range_rad"]
            self.inside("identification.alpha_window_deg", window, range_rad, "analysis.alpha_range_deg")
        low, high = table.elevator_range_deg
        points = (high - low) / table.elevator_step_deg
        if points > MAXIMUM_POINTS and self.sound("analysis.elevator_range_deg", "analysis.elevator_step_deg"):
            self.fault(
                "analysis.elevator_step_deg",
                f"divides elevator_range_deg into {points:.3g} steps, more than {MAXIMUM_POINTS}",
            )
            return None
        return self.make("analysis", lambda: AnalysisOptions(**in_si(table)))

    def validation(
        self, flight: FlightOptions | None, maneuvers: tuple[Maneuver, ...] = ()
    ) -> ValidationOptions | None:
        """Read ``[validation]``; none of the sweep's maneuvers may be held out."""
        return read_validation(self, flight, maneuvers, self.seed)


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]

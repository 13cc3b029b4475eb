"""Study files: TOML in degrees and hertz, read into plans in SI, or one error that names every fault.

Every key of the file names its unit; that suffix alone decides the conversion, by the table of ``finback.units``. Any
number of a maneuver may be a list: one flight is made for each combination.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar, final

from pydantic import ValidationError

from finback.dynamics.analysis import AnalysisOptions
from finback.errors import FinbackError, StudyError
from finback.flight.aircraft import Aircraft, find_aircraft
from finback.flight.excitation import Doublet, Hold, Maneuver, Ramp, Release, Step, ThreeTwoOneOne, schedule
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.identification.options import IdentificationOptions
from finback.records import Condition
from finback.study.study import Study
from finback.study.tables import (
    KINDS,
    TABLES,
    AnalysisTable,
    ConditionTable,
    FlightTable,
    FoldTable,
    HeadTable,
    IdentificationTable,
    SensorsTable,
    Table,
    TolerancesTable,
    ToleranceTable,
    ValidationTable,
    in_si,
)
from finback.units import from_si, quantity_of, to_si, unit_of
from finback.validation.metric import Tolerance
from finback.validation.options import MINIMUM_RATES, FoldOptions, Tolerances, ValidationOptions

MAXIMUM_FLIGHTS: Final = 10_000
"""More combinations than this in one table are taken for a mistake."""

_SHOWN: Final = 60  # characters of a wrong value that a message repeats

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


def inspect_study(path: Path, *, aircraft: str = "") -> tuple[Study | None, Aircraft | None, tuple[str, ...]]:
    """Return the study if its file has no fault, its aircraft if that was found, and every fault."""
    faults: list[str] = []
    text, table = _read_toml(path, faults)
    if faults:
        return None, None, tuple(faults)
    reader = _Reader(table, faults)
    found = reader.aircraft(path.resolve().parent, aircraft)
    study = reader.study(path, text, found)
    return (None if faults else study), found, tuple(dict.fromkeys(faults))


@final
class _Reader:
    """One pass over a parsed file: every method returns None where it had to add a fault."""

    def __init__(self, root: dict[str, Any], faults: list[str]) -> None:
        self.faults = faults
        self.root = root
        self.head = self.parse(HeadTable, {key: root[key] for key in root if key not in TABLES}, "", others=TABLES)

    def fault(self, place: str, message: str) -> None:
        self.faults.append(f"{place}: {message}")

    # tables

    def parse(self, kind: type[T], value: object, place: str, others: tuple[str, ...] = ()) -> T | None:
        """Read one table, or add its faults; ``others`` are keys that are allowed here but read elsewhere."""
        if not isinstance(value, dict):
            self.fault(place, f"must be a table [{place}], got {_show(value)}")
            return None
        try:
            return kind.model_validate(value)
        except ValidationError as error:
            keys = [*(field.alias or name for name, field in kind.model_fields.items()), *others]
            for fault in error.errors():
                self.fault(_dotted(place, fault["loc"], value), _explain(dict(fault), keys))
            return None

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
        if not isinstance(name, str) or not name or "\0" in name:
            return None
        return self.make("aircraft", lambda: find_aircraft(name, near=near))

    def study(self, path: Path, text: str, aircraft: Aircraft | None) -> Study | None:
        """Read everything else."""
        condition, sensors = self.table(ConditionTable, "condition"), self.table(SensorsTable, "sensors")
        flight = self.flight()
        maneuvers = self.maneuvers(self.root.get("sweep"), "sweep", flight)
        identification, analysis = self.identification(flight), self.analysis()
        validation = self.validation(flight)
        for again in sorted(set(maneuvers) & set(validation.holdout if validation else ()), key=repr):
            self.fault(
                "validation.holdout", f"a {again.kind} of the sweep stands here too; hold-outs are never in the fit"
            )
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
            sensors=Sensors(**in_si(sensors)),
            maneuvers=maneuvers,
            identification=identification,
            analysis=analysis,
            validation=validation,
        )

    def flight(self) -> FlightOptions | None:
        table = self.table(FlightTable, "flight")
        if table is None:
            return None
        ratio = table.step_hz / table.sample_hz
        if ratio < 1 or not ratio.is_integer():
            self.fault(
                "flight.sample_hz",
                f"step_hz ({table.step_hz:g}) must be a whole multiple of it, got {table.sample_hz:g}",
            )
            return None
        values = in_si(table)
        rates = {
            f"{name}_s": 1.0 / values.pop(f"{key}_1_s")
            for name, key in (("step", "step"), ("sample_interval", "sample"))
        }
        return self.make("flight", lambda: FlightOptions(**values, **rates))

    def maneuvers(self, tables: object, place: str, flight: FlightOptions | None) -> tuple[Maneuver, ...]:
        """Read an array of maneuver tables, each expanded to its combinations."""
        if not isinstance(tables, list) or not tables:
            self.fault(place, f"needs at least one maneuver: add a table [[{place}]]")
            return ()
        found: list[Maneuver] = []
        for index, table in enumerate(tables):
            found += self.combinations(table, f"{place}[{index}]", flight)
        return tuple(found)

    def combinations(self, table: object, place: str, flight: FlightOptions | None) -> list[Maneuver]:
        if not isinstance(table, dict):
            self.fault(place, f"must be a table, got {_show(table)}")
            return []
        kind = table.get("kind")
        if not isinstance(kind, str) or kind not in KINDS:
            given = "missing" if kind is None else f"unknown kind {_show(kind)}"
            self.fault(f"{place}.kind", f"{given}{_nearest(kind, list(KINDS))}")
            return []
        form, build = KINDS[kind]
        rest = {key: value for key, value in table.items() if key != "kind"}
        read = self.parse(form, rest, place, others=("kind",))
        if read is None:
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

    def fits(self, maneuver: Maneuver, place: str, flight: FlightOptions) -> None:
        """Check one maneuver against the flight's limits."""
        before = len(self.faults)
        reached = [maneuver.elevator_rad]
        match maneuver:
            case Step():
                reached.append(maneuver.elevator_rad + maneuver.amplitude_rad)
            case Doublet() | ThreeTwoOneOne():
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
        if len(self.faults) == before:
            self.make(
                place,
                lambda: schedule(
                    maneuver,
                    rate_limit_rad_s=flight.elevator_rate_rad_s,
                    limits_rad=flight.elevator_limits_rad,
                    grid_s=flight.sample_interval_s,
                ),
            )

    def inside(self, place: str, angles_rad: Iterable[float], limits_rad: tuple[float, float], name: str) -> None:
        """Check that angles lie inside limits that stand elsewhere in the file under ``name``."""
        low, high = limits_rad
        for angle in angles_rad:
            if not low <= angle <= high:
                self.fault(
                    place,
                    f"reaches {from_si(angle, 'deg'):.6g} deg, outside {name} = "
                    f"[{from_si(low, 'deg'):.6g}, {from_si(high, 'deg'):.6g}]",
                )

    def identification(self, flight: FlightOptions | None) -> IdentificationOptions | None:
        table = self.table(IdentificationTable, "identification")
        if table is None:
            return None
        values = in_si(table)
        if table.spacing_s > table.half_width_s:
            self.fault(
                "identification.spacing_s",
                f"must not exceed half_width_s ({table.half_width_s:g}), got {table.spacing_s:g}",
            )
            return None
        if flight is not None:
            self.inside(
                "identification.alpha_window_deg",
                values["alpha_window_rad"],
                flight.alpha_limits_rad,
                "flight.alpha_limits_deg",
            )
        orders = (values.pop("alpha_dot_order"), values.pop("q_dot_order"))
        return self.make("identification", lambda: IdentificationOptions(alpha_order=orders, **values))

    def analysis(self) -> AnalysisOptions | None:
        table = self.table(AnalysisTable, "analysis")
        return None if table is None else self.make("analysis", lambda: AnalysisOptions(**in_si(table)))

    def validation(self, flight: FlightOptions | None) -> ValidationOptions | None:
        root = self.root.get("validation")
        if not isinstance(root, dict):
            self.table(ValidationTable, "validation")
            return None
        parts = ("holdout", "fold", "tolerance")
        rest = {key: value for key, value in root.items() if key not in parts}
        table = self.parse(ValidationTable, rest, "validation", others=parts)
        holdout = self.maneuvers(root.get("holdout"), "validation.holdout", flight)
        fold = self.fold(root.get("fold", {}))
        tolerances = self.tolerances(root.get("tolerance", {}))
        if table is None or fold is None or tolerances is None or self.head is None:
            return None
        elevators = in_si(table)["equilibrium_elevator_rad"]
        if flight is not None:
            place = "validation.equilibrium_elevator_deg"
            self.inside(place, elevators, flight.elevator_limits_rad, "flight.elevator_limits_deg")
        seed = self.head.seed
        return self.make(
            "validation",
            lambda: ValidationOptions(
                holdout=holdout, equilibrium_elevators_rad=elevators, fold=fold, tolerances=tolerances, seed=seed
            ),
        )

    def fold(self, value: object) -> FoldOptions | None:
        place = "validation.fold"
        table = self.parse(FoldTable, value, place)
        if table is None:
            return None
        rates = len(set(table.ramp_rate_deg_s))
        if rates < MINIMUM_RATES:
            self.fault(f"{place}.ramp_rate_deg_s", f"needs at least {MINIMUM_RATES} different rates, got {rates}")
            return None
        if table.resolution_deg >= table.start_offset_deg:
            self.fault(f"{place}.resolution_deg", f"must be smaller than start_offset_deg ({table.start_offset_deg:g})")
            return None
        values = in_si(table)
        ramps = values.pop("ramp_rate_rad_s")
        return self.make(place, lambda: FoldOptions(ramp_rates_rad_s=ramps, **values))

    def tolerances(self, value: object) -> Tolerances | None:
        place = "validation.tolerance"
        table = self.parse(TolerancesTable, value, place)
        if table is None:
            return None
        read: dict[str, Tolerance] = {}
        for key, item in table:
            one = self.parse(ToleranceTable, item, f"{place}.{key}")
            if one is None:
                continue
            unit = "1" if key == "theil" else unit_of(key)
            name = key if key == "theil" else quantity_of(key)
            read[name] = Tolerance(value=to_si(one.value, unit), source=one.source)
        if len(read) < len(TolerancesTable.model_fields):
            return None
        return Tolerances(**read)


def _read_toml(path: Path, faults: list[str]) -> tuple[str, dict[str, Any]]:
    """Return the text and its table; what keeps it from being read is added to the faults."""
    try:
        text = path.read_bytes().decode("utf-8")
    except (FileNotFoundError, NotADirectoryError):
        near = get_close_matches(path.name, [other.name for other in path.parent.glob("*.toml")], n=1)
        faults.append(f"file: not found{f'; did you mean {path.parent / near[0]}?' if near else ''}")
    except UnicodeDecodeError as error:
        faults.append(f"file: is not UTF-8 text (byte {error.start})")
    except OSError as error:
        faults.append(f"file: cannot be read ({error.strerror})")
    else:
        try:
            return text, tomllib.loads(text)
        except RecursionError:
            faults.append("syntax: nested too deeply")
        except ValueError as error:  # of the syntax, with line and column, or of an integer with 5000 digits
            faults.append(f"syntax: {error}")
    return "", {}


def _dotted(place: str, location: tuple[int | str, ...], value: dict[str, Any]) -> str:
    """Write pydantic's location as a path: ``sweep[2].elevator_deg[1]``."""
    # A lone number is read as a list of one: its index stands in no file.
    if len(location) > 1 and not isinstance(value.get(str(location[0])), list):
        location = location[:1]
    for part in location:
        place += f"[{part}]" if isinstance(part, int) else f".{part}"
    return place.removeprefix(".")


def _explain(fault: Mapping[str, Any], keys: list[str]) -> str:
    """Say what rule is broken, by what value, and what may have been meant."""
    if fault["type"] == "missing":
        return "missing"
    if fault["type"] == "extra_forbidden":
        return f"unknown key{_nearest(fault['loc'][-1], keys)}"
    rule = str(fault["msg"]).removeprefix("Value error, ").replace("Input should be", "must be")
    return f"{rule[0].lower()}{rule[1:]}, got {_show(fault['input'])}"


def _nearest(word: object, known: list[str]) -> str:
    near = get_close_matches(str(word), known, n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else f"; expected one of: {', '.join(known)}"


def _show(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"

"""Studies of recorded flights: how tables are read and prepared, and what is asked of a model then (TOML)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, final

from pydantic import AfterValidator, Field

from finback.channels import CHANNELS
from finback.errors import FinbackError, StudyError
from finback.formats.text_table import TextFormat
from finback.identification.compatibility.fault import ALL, CompatibilityOptions
from finback.identification.options import IdentificationOptions
from finback.identification.outlier import OutlierOptions
from finback.identification.position import SensorPlaces
from finback.identification.preparation import PreparationOptions
from finback.records import Condition, Hold
from finback.study.faults import nearest, read_toml
from finback.study.layout import LayoutTable
from finback.study.reader import StudyReader
from finback.study.tables import ConditionTable, Table, in_si
from finback.units import quantity_of, si_name, si_unit, to_si, unit_of

if TYPE_CHECKING:
    from finback.dynamics.analysis import AnalysisOptions

SECTIONS: Final = ("condition", "table", "columns", "factors", "places", "prepare", "instruments")
"""What stands below the head of such a study, beside what is asked of a model."""
_STAGES: Final = ("identification", "analysis")
_HEAD: Final = ("schema", "name")
_NEEDED: Final = ("time_s", "elevator_rad")
_WHOLE: Final = [-180.0, 180.0]
"""A window of alpha in deg that leaves nothing out."""
_ORDER: Final = 3
_USUAL: Final = IdentificationOptions(alpha_window_rad=(-math.pi, math.pi))


def _known_hold(word: str) -> str:
    if word not in set(Hold):
        raise ValueError(f"must be one of: {', '.join(Hold)}")
    return word


Place = Annotated[list[Annotated[float, Field(ge=-100.0, le=100.0)]], Field(min_length=3, max_length=3)]
Time = Annotated[float, Field(ge=0.0, le=14_400.0)]


class _RecordedTable(LayoutTable):
    hold: Annotated[str, AfterValidator(_known_hold)]


class _PlacesTable(Table):
    vane_m: Place = Field(default=[0.0, 0.0, 0.0])
    vane_upwash: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    beta_vane_m: Place = Field(default=[0.0, 0.0, 0.0])
    beta_vane_sidewash: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    beta_vane_flank: bool = False
    accelerometer_m: Place = Field(default=[0.0, 0.0, 0.0])


class _PrepareTable(Table):
    interval_s: Time = 0.0
    longest_gap_s: Time = 0.0
    outlier_threshold: Annotated[float, Field(ge=2.0, le=1e6)] = OutlierOptions().threshold
    outlier_samples: Annotated[int, Field(ge=1, le=100)] = OutlierOptions().half_width
    same_instruments: bool = False
    correct_instruments: bool = False


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedStudy:
    """What is done with recorded flights.

    Attributes:
        name: folder-safe name.
        path: the file it was read from.
        text: that file's content.
        layout: how text tables are written.
        columns: a table's name -> ours with the table's unit; empty: the names that are ours already.
        factors: quantity -> number by which it is multiplied.
        condition: the reference flight.
        hold: how the elevator moved between samples.
        preparation: what is done before a model is fitted.
        identification: what ``identify`` is asked; or empty.
        left_out: keys of ``[identification]`` that are not there: what they say follows from the flights.
        analysis: what ``analyze`` is asked; or empty.
    """

    name: str
    path: Path
    text: str
    layout: TextFormat
    columns: Mapping[str, str]
    factors: Mapping[str, float]
    condition: Condition
    hold: Hold
    preparation: PreparationOptions
    identification: tuple[IdentificationOptions, ...]
    left_out: frozenset[str]
    analysis: tuple[AnalysisOptions, ...]

    def __post_init__(self) -> None:
        """Freeze the maps."""
        object.__setattr__(self, "columns", MappingProxyType(dict(self.columns)))
        object.__setattr__(self, "factors", MappingProxyType(dict(self.factors)))


def read_recorded_study(path: Path) -> RecordedStudy:
    """Read a study of recorded flights (docs/data.md).

    Raises:
        StudyError: with every fault of the file.
    """
    faults: list[str] = []
    text, root = read_toml(path, faults)
    if faults:
        raise StudyError(str(path), tuple(faults))
    unknown = [key for key in root if key not in (*_HEAD, *SECTIONS, *_STAGES)]
    faults += [f"{key}: unknown key{nearest(key, [*_HEAD, *SECTIONS, *_STAGES])}" for key in unknown]
    # No aircraft is flown and no number drawn: what a study needs for that is not asked for.
    head = {key: root[key] for key in root if key not in (*unknown, *SECTIONS)} | {"aircraft": "-", "seed": 0}
    reader = StudyReader(head, faults)
    reader.root = root
    left_out = _fill(root)
    condition = reader.table(ConditionTable, "condition")
    layout = reader.table(_RecordedTable, "table")
    preparation = _preparation(reader)
    columns = _columns(reader)
    factors = _words(reader, "factors", float)
    identification, analysis = reader.part(None, (), ())
    if faults or reader.head is None or condition is None or layout is None or preparation is None:
        raise StudyError(str(path), tuple(dict.fromkeys(faults)))
    return RecordedStudy(
        name=reader.head.name,
        path=path,
        text=text,
        layout=layout.text_format,
        columns=columns,
        factors=factors,
        condition=Condition(**in_si(condition)),
        hold=Hold(layout.hold),
        preparation=preparation,
        identification=() if identification is None else (identification,),
        left_out=left_out,
        analysis=() if analysis is None else (analysis,),
    )


def _fill(root: dict[str, Any]) -> frozenset[str]:
    """Put what need not be given into ``[identification]``; return the keys that were not there."""
    given = root.get("identification")
    if not isinstance(given, dict):
        return frozenset()
    analysis = root.get("analysis")
    window = analysis.get("alpha_range_deg", _WHOLE) if isinstance(analysis, dict) else _WHOLE
    width = given.get("half_width_s", _USUAL.half_width_s)
    spacing = width / 4.0 if isinstance(width, float) else _USUAL.spacing_s
    filled = {
        "alpha_window_deg": window,
        "half_width_s": width,
        "spacing_s": spacing,
        "minimum_duration_s": _USUAL.minimum_duration_s,
    }
    if not any(key in given for key in ("alpha_dot_terms", "q_dot_terms", "select")):
        filled |= {"alpha_dot_order": _ORDER, "q_dot_order": _ORDER}
    left_out = frozenset(filled) - set(given)
    root["identification"] = filled | given
    return left_out


def read_columns(path: Path) -> tuple[Mapping[str, str], tuple[TextFormat, ...]]:
    """Return what a study with faults still says of its tables: names of columns, and the layout if it has no fault."""
    _, root = read_toml(path, [])
    columns = root.get("columns", {})
    reader = StudyReader({}, [])
    reader.root = root
    layout = reader.table(_RecordedTable, "table")
    items = columns.items() if isinstance(columns, dict) else ()
    names = {theirs: ours for theirs, ours in items if isinstance(ours, str)}
    return names, () if layout is None else (layout.text_format,)


def _preparation(reader: StudyReader) -> PreparationOptions | None:
    places = reader.parse(_PlacesTable, reader.root.get("places", {}), "places")
    asked = reader.parse(_PrepareTable, reader.root.get("prepare", {}), "prepare")
    sizes = _sizes(reader)
    if places is None or asked is None:
        return None
    return reader.make(
        "prepare",
        lambda: PreparationOptions(
            outliers=OutlierOptions(half_width=asked.outlier_samples, threshold=asked.outlier_threshold),
            interval_s=asked.interval_s,
            longest_gap_s=asked.longest_gap_s,
            places=SensorPlaces(
                vane_m=_triple(places.vane_m),
                vane_upwash=places.vane_upwash,
                beta_vane_m=_triple(places.beta_vane_m),
                beta_vane_sidewash=places.beta_vane_sidewash,
                beta_vane_flank=places.beta_vane_flank,
                accelerometer_m=_triple(places.accelerometer_m),
            ),
            correct_instruments=asked.correct_instruments,
            same_instruments=asked.same_instruments,
            compatibility=CompatibilityOptions(sizes=sizes),
        ),
    )


def _sizes(reader: StudyReader) -> dict[str, float]:
    """Read ``[instruments]``: ``theta_bias_deg = 0.1`` is how large that fault usually is; 0 says there is none."""
    units = {fault.name: fault.unit for fault in ALL}
    found: dict[str, float] = {}
    for key, value in _words(reader, "instruments", float).items():
        try:
            unit = unit_of(key)
            name = quantity_of(key).replace("_", " ")
        except FinbackError as error:
            reader.fault(f"instruments.{key}", error.message)
            continue
        if name not in units:
            reader.fault(f"instruments.{key}", f"no instrument has a fault '{name}'{nearest(name, list(units))}")
        elif si_unit(unit) != units[name]:
            reader.fault(f"instruments.{key}", f"'{unit}' does not measure it; its SI unit is '{units[name]}'")
        elif value < 0.0:
            reader.fault(f"instruments.{key}", f"must be at least 0, got {value:g}")
        else:
            found[name] = to_si(value, unit)
    return found


def _columns(reader: StudyReader) -> dict[str, str]:
    """Read ``[columns]``: every name of ours must be a channel with a unit that measures it, once."""
    columns: dict[str, str] = _words(reader, "columns", str)
    taken: dict[str, str] = {}
    for theirs, ours in columns.items():
        try:
            channel = si_name(ours)
        except FinbackError as error:
            reader.fault(f"columns.{theirs}", error.message)
            continue
        if channel not in CHANNELS:
            reader.fault(f"columns.{theirs}", f"'{ours}' is no channel{nearest(channel, list(CHANNELS))}")
        elif channel in taken:
            reader.fault(f"columns.{theirs}", f"'{channel}' is what '{taken[channel]}' is already")
        else:
            taken[channel] = theirs
    if columns and len(taken) == len(columns):
        for needed in _NEEDED:
            if needed not in taken:
                reader.fault("columns", f"no column is '{needed}', or the same in another unit")
    return columns


def _words(reader: StudyReader, section: str, kind: type[Any]) -> dict[str, Any]:
    """Read a table of texts, or of finite numbers."""
    table = reader.root.get(section, {})
    if not isinstance(table, dict):
        reader.fault(section, f"must be a table [{section}]")
        return {}
    found: dict[str, Any] = {}
    for key, value in table.items():
        if kind is float and isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            found[key] = float(value)
        elif kind is str and isinstance(value, str) and value:
            found[key] = value
        else:
            expected = "a finite number" if kind is float else "a channel with its unit, such as 'alpha_deg'"
            reader.fault(f"{section}.{key}", f"must be {expected}, got {value!r}")
    return found


def _triple(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z

"""What ``finback coefficients`` is asked: airframe, terms, method and how tables are read, in TOML."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar, final

from finback.errors import FaultyFileError, InputError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm, names_in
from finback.identification.coefficient.options import Biases, CoefficientMethod, CoefficientOptions, FlightAirframe
from finback.records import Condition, Hold
from finback.store.model_table import Table
from finback.study.faults import nearest, read_toml, show
from finback.units import SI_FACTORS, STANDARD_GRAVITY_M_S2, quantity_of, si_name, to_si, unit_of

SCHEMA: Final = "finback/coefficient-setup/1"

T = TypeVar("T")

_TABLES: Final = ("airframe", "flights", "condition", "form", "fixed", "bounded", "fit", "biases", "records")
_HEAD: Final = ("schema", "name", "source", *_TABLES)
_AIRFRAME: Final = tuple(field.name for field in fields(Airframe))
_AIRFRAME_NEEDED: Final = _AIRFRAME[:4]
_CONDITION: Final = tuple(field.name for field in fields(Condition))
_BIASES: Final = tuple(field.name for field in fields(Biases))
_FIT: Final = ("method", "outputs", "noise_correlated", "band_hz", "half_width_s", "spacing_s", "minimum_duration_s")
_FLIGHTS: Final = ("mass_kg", "pitch_inertia_kg_m2", "thrust_n", "thrust_arm_m", "reference_x_m", "reference_z_m")
"""What may differ from flight to flight."""
_RECORDS: Final = ("hold", "airspeed", "columns", "factors")
_OF_CONDITION: Final = "condition"
_USUAL: Final = ("lb", "ft2", "ft", "slug_ft2", "kt", "slug_ft3")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientSetup:
    """What a setup file says.

    Attributes:
        path: the file.
        sha256: of what it held.
        options: airframe, form and method.
        condition: of flights that are tables, and at which the model is reduced.
        hold: how the elevator of tables moved between samples.
        columns: a table's name -> ours with the table's unit; empty: names that are ours already.
        factors: quantity -> number by which it is multiplied.
        still: whether the airspeed of tables is that of the condition, as none was recorded.
    """

    path: Path
    sha256: str
    options: CoefficientOptions
    condition: Condition
    hold: Hold
    columns: Mapping[str, str]
    factors: Mapping[str, float]
    still: bool = False


def read_coefficient_setup(path: Path) -> CoefficientSetup:
    """Read a setup.

    Raises:
        FaultyFileError: the file has faults, each with its place.
    """
    faults: list[str] = []
    text, root = read_toml(path, faults)
    found = None if faults else _setup(path, text, Table(root=root, faults=faults))
    if found is None or faults:
        raise FaultyFileError(str(path), tuple(dict.fromkeys(faults)))
    return found


def _setup(path: Path, text: str, table: Table) -> CoefficientSetup | None:
    if table.root.get("schema") != SCHEMA:
        said = show(table.root["schema"]) if "schema" in table.root else "missing"
        table.fault("schema", f"{said}; write schema = '{SCHEMA}'")
    table.keys("", table.root, list(_HEAD))
    airframe = _quantities(table, "airframe", table.table("airframe"), _AIRFRAME, needed=_AIRFRAME_NEEDED)
    flights = _flights(table)
    condition = _quantities(
        table, "condition", table.table("condition"), _CONDITION, needed=("airspeed_m_s", "density_kg_m3")
    )
    biases = _quantities(table, "biases", table.table("biases"), _BIASES)
    form = _form(table)
    speed = _speed(table, condition.get("airspeed_m_s", math.nan))
    fit = _fit(table)
    hold, columns, factors = _records(table)
    still = _still(table, columns)
    frame = _made(table, "airframe", lambda: Airframe(**airframe))
    expected = _made(table, "biases", lambda: Biases(**biases))
    if table.faults or form is None or frame is None or expected is None:
        return None
    own = {name: _made(table, f"flights.{name}", partial(replace, frame, **values)) for name, values in flights.items()}
    options = _made(
        table,
        "fit",
        lambda: CoefficientOptions(
            airframe=frame,
            form=form,
            reference_speed_m_s=speed,
            biases=expected,
            flights=tuple(FlightAirframe(flight=name, airframe=item) for name, item in own.items() if item),
            **fit,
        ),
    )
    if options is None:
        return None
    return CoefficientSetup(
        path=path,
        sha256=hashlib.sha256(text.encode()).hexdigest(),
        options=options,
        condition=Condition(**{"gravity_m_s2": STANDARD_GRAVITY_M_S2, "altitude_m": 0.0, **condition}),
        hold=hold,
        columns=columns,
        factors=factors,
        still=still,
    )


def _made(table: Table, place: str, build: Callable[[], T]) -> T | None:
    """Build a value; what its own checks find is a fault."""
    if table.faults:
        return None
    try:
        return build()
    except InputError as error:
        table.fault(place, error.message)
        return None


def _flights(table: Table) -> dict[str, dict[str, float]]:
    """Return what single flights had otherwise, by their names."""
    found: dict[str, dict[str, float]] = {}
    for name, given in table.table("flights").items():
        if isinstance(given, dict):
            found[name] = _quantities(table, f"flights.{name}", given, _FLIGHTS)
        else:
            table.fault(f"flights.{name}", f"must be a table [flights.{name}], got {show(given)}")
    return found


def _quantities(
    table: Table, name: str, given: Mapping[str, Any], known: tuple[str, ...], *, needed: tuple[str, ...] = ()
) -> dict[str, float]:
    """Return a table of numbers in SI, by names in SI; keys name their own units."""
    found: dict[str, float] = {}
    for key, value in given.items():
        place = f"{name}.{key}"
        try:
            ours = si_name(key)
        except InputError:
            ours = ""
        if ours not in known:
            same = [item for item in known if quantity_of(item) == key]
            table.fault(place, f"unknown key{nearest(key, same or list(known))}")
        elif ours in found:
            table.fault(place, f"{ours} is given twice")
        elif isinstance(value, float) and value == math.inf and name == "biases":
            found[ours] = value
        else:
            found[ours] = to_si(table.number(place, value), unit_of(key))
    for item in needed:
        if item not in found:
            table.fault(f"{name}.{item}", f"missing; write {item} = a number, or in another unit{_like(item)}")
    return found


def _like(item: str) -> str:
    """Return the same key in another unit, as an example."""
    unit = unit_of(item)
    other = next((word for word, (si, _) in SI_FACTORS.items() if si == unit and word in _USUAL), "")
    return f", such as {quantity_of(item)}_{other}" if other else ""


def _speed(table: Table, otherwise: float) -> float:
    """Return V₀ in m/s: ``reference_speed`` of the form in any unit, or the airspeed of the condition."""
    for key, value in table.table("form").items():
        if key.startswith("reference_speed"):
            try:
                if si_name(key) == "reference_speed_m_s":
                    return to_si(table.number(f"form.{key}", value), unit_of(key))
            except InputError:
                pass
            table.fault(f"form.{key}", "unknown key; did you mean 'reference_speed_m_s'?")
    return otherwise


def _form(table: Table) -> CoefficientForm | None:
    """Return the terms, what of them is fixed, and what is bounded."""
    given = table.table("form")
    word = given.get("axes", Axes.BODY if "CX" in given else Axes.WIND)
    if word not in list(Axes):
        table.fault("form.axes", f"must be one of {', '.join(Axes)}, got {show(word)}")
        return None
    axes = Axes(word)
    names = names_in(axes)
    rest = {key: value for key, value in given.items() if not key.startswith("reference_speed")}
    table.keys("form", rest, ["axes", *names])
    texts = [_texts(table, f"form.{name}", given.get(name)) for name in names]
    before = len(table.faults)
    try:
        form = CoefficientForm.parse(axes, *texts)
    except InputError as error:
        table.fault("form", error.message)
        return None
    for place, add in (("fixed", _fixed), ("bounded", _bounded)):
        for key, value in table.table(place).items():
            name, _, term = key.partition(":")
            try:
                form = add(table, form, f"{place}.{key}", name.strip(), term.strip(), value)
            except InputError as error:
                table.fault(f"{place}.{key}", f'{error.message}; write "{names[2]}: alpha"')
    return form if len(table.faults) == before else None


def _fixed(table: Table, form: CoefficientForm, place: str, name: str, term: str, value: object) -> CoefficientForm:
    return form.fix(name, term, table.number(place, value))


def _bounded(table: Table, form: CoefficientForm, place: str, name: str, term: str, value: object) -> CoefficientForm:
    if not isinstance(value, list) or len(value) != 2 or not all(isinstance(end, int | float) for end in value):
        table.fault(place, f"must be [low, high], got {show(value)}")
        return form
    return form.bound(name, term, float(value[0]), float(value[1]))


def _texts(table: Table, place: str, value: object) -> list[str]:
    if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
        table.fault(place, "missing" if value is None else f"must be a list of terms, got {show(value)}")
        return ["1"]
    return value


def _fit(table: Table) -> dict[str, Any]:
    given = table.table("fit")
    table.keys("fit", given, list(_FIT))
    found: dict[str, Any] = {}
    for key in ("half_width_s", "spacing_s", "minimum_duration_s"):
        if key in given:
            found[key] = table.number(f"fit.{key}", given[key])
    if "band_hz" in given:
        ends = given["band_hz"]
        if isinstance(ends, list) and len(ends) == 2:
            low, high = (table.number(f"fit.band_hz[{i}]", end) for i, end in enumerate(ends))
            found["band_1_s"] = (low, high)
        else:
            table.fault("fit.band_hz", f"must be [low, high], got {show(ends)}")
    if "method" in given:
        if given["method"] in list(CoefficientMethod):
            found["method"] = CoefficientMethod(given["method"])
        else:
            table.fault("fit.method", f"must be one of {', '.join(CoefficientMethod)}, got {show(given['method'])}")
    if "outputs" in given:
        found["outputs"] = tuple(_texts(table, "fit.outputs", given["outputs"]))
    if "noise_correlated" in given:
        if not isinstance(given["noise_correlated"], bool):
            table.fault("fit.noise_correlated", f"must be true or false, got {show(given['noise_correlated'])}")
        found["noise_correlated"] = given["noise_correlated"]
    return found


def _still(table: Table, columns: Mapping[str, str]) -> bool:
    """Return whether the condition's airspeed stands for one that was not recorded."""
    given = table.table("records").get("airspeed", "")
    if given not in {"", _OF_CONDITION}:
        table.fault("records.airspeed", f"must be '{_OF_CONDITION}', got {show(given)}")
    elif given and any(quantity_of(item) == "airspeed" for item in columns.values()):
        table.fault("records.airspeed", "the tables have a column of the airspeed; leave one of both out")
    return bool(given)


def _records(table: Table) -> tuple[Hold, dict[str, str], dict[str, float]]:
    given = table.table("records")
    table.keys("records", given, list(_RECORDS))
    hold = given.get("hold", Hold.FOH)
    if hold not in list(Hold):
        table.fault("records.hold", f"must be one of {', '.join(Hold)}, got {show(hold)}")
        hold = Hold.FOH
    columns, factors = given.get("columns", {}), given.get("factors", {})
    if not isinstance(columns, dict) or not all(isinstance(item, str) for item in columns.values()):
        table.fault(
            "records.columns", "must be a table of a file's name = ours with its unit, such as AoA = 'alpha_deg'"
        )
        columns = {}
    if not isinstance(factors, dict):
        table.fault("records.factors", "must be a table of quantity = number, such as elevator = -1.0")
        factors = {}
    return Hold(hold), columns, {key: table.number(f"records.factors.{key}", v) for key, v in factors.items()}

"""Coefficients on disk: ``coefficients.json``, the model reduced to a condition as TOML, and flights from tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from finback.dynamics.model import PolynomialModel
from finback.errors import InputError
from finback.files import write_text
from finback.formats.text_table import PLAIN
from finback.identification.coefficient.identify import CoefficientIdentification
from finback.identification.coefficient.track import SPEED_CHANNEL
from finback.records import Condition, FlightRecord, Sweep
from finback.store.coefficient_setup import CoefficientSetup
from finback.store.envelope import IDENTIFY, Stage, read_result, write_alone
from finback.store.flight_table import check_columns, read_flight_table
from finback.store.flown import as_flown
from finback.store.polynomial_file import SCHEMA as POLYNOMIALS
from finback.store.sweep import load_sweep

COEFFICIENTS: Final = Stage(verb="coefficients", file="coefficients.json", kind="coefficients", inputs=(), version=2)
"""It belongs to no run: it may be made from flights of any origin."""
NEEDED: Final = ("time_s", "airspeed_m_s", "alpha_rad", "q_rad_s", "elevator_rad")
"""What coefficients cannot do without."""
_NO_AIRSPEED: Final = (
    "where no airspeed was recorded and it hardly moved, write airspeed = 'condition' into [records], and fit by "
    "method equation-error or frequency"
)


def save_coefficients(found: CoefficientIdentification, path: Path, *, inputs: Mapping[str, str]) -> None:
    """Write a fitted model; ``inputs`` names the files that it was made from, with their SHA-256."""
    write_alone(path, COEFFICIENTS, found, inputs=inputs, sections={})


def read_coefficients(path: Path) -> CoefficientIdentification:
    """Read what ``save_coefficients`` wrote.

    Raises:
        InputError: it cannot be read, is damaged, or holds no coefficients.
    """
    return read_result(path, COEFFICIENTS, CoefficientIdentification)[0]


def coefficients_file(path: Path) -> tuple[Path, ...]:
    """Return the file of coefficients that a path names: itself, or what a folder holds that has no other model.

    Returns:
        One file, or none: the path is something else.
    """
    if path.is_dir():
        return (path / COEFFICIENTS.file,) if _only_coefficients(path) else ()
    if path.suffix != ".json":
        return ()
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return ()  # whoever reads it as a model says what is wrong with it
    schema = document.get("schema") if isinstance(document, dict) else None
    return (path,) if str(schema).startswith(f"finback/{COEFFICIENTS.kind}/") else ()


def _only_coefficients(folder: Path) -> bool:
    return (folder / COEFFICIENTS.file).is_file() and not (folder / IDENTIFY.file).is_file()


def read_flights(sources: Sequence[Path], setup: CoefficientSetup) -> Sweep:
    """Read flights: of runs, or of tables (``.csv``, or ``.parquet`` with names in SI) as the setup says.

    Raises:
        InputError: a source cannot be read, or lacks what a flight needs.
    """
    records: list[FlightRecord] = []
    for source in sources:
        if source.is_dir():
            records += [
                as_flown(record, setup.options.airframe_of(record.name)) for record in load_sweep(source).records
            ]
        else:
            records.append(_of_table(source, setup))
    return Sweep(study=sources[0].stem, records=tuple(records))


def _of_table(path: Path, setup: CoefficientSetup) -> FlightRecord:
    from finback.formats.frame import record_from_frame  # noqa: PLC0415 - pandas: half a second that runs do not need

    needed = tuple(name for name in NEEDED if not setup.still or name != SPEED_CHANNEL)
    try:
        check_columns(path, PLAIN, setup.columns, needed=needed, place=f"[records.columns] of {setup.path.name}")
    except InputError as error:
        if SPEED_CHANNEL in needed and SPEED_CHANNEL in error.message:
            hint = f"{error.hint}; {_NO_AIRSPEED}" if error.hint else _NO_AIRSPEED
            raise InputError(error.message, hint=hint) from error
        raise
    frame = read_flight_table(path, PLAIN, setup.columns)
    columns = dict(setup.columns) or {name: name for name in map(str, frame.columns)}
    record = record_from_frame(
        frame, name=path.stem, condition=setup.condition, hold=setup.hold, columns=columns, factors=setup.factors
    )
    if not setup.still:
        return record
    if setup.options.method.of_likelihood:
        raise InputError(
            f"{path}: {setup.options.method} takes an airspeed that was not recorded for one that did not move",
            hint="choose method equation-error or frequency",
        )
    return record.with_columns(**{SPEED_CHANNEL: np.full(len(record), setup.condition.airspeed_m_s)})


def write_reduced(model: PolynomialModel, path: Path, *, name: str, condition: Condition, thrust_n: float) -> None:
    """Write a dimensional model as polynomials by hand (docs/model.md), which ``finback analyze`` reads."""
    write_text(path, reduced_text(model, name=name, condition=condition, thrust_n=thrust_n))


def reduced_text(model: PolynomialModel, *, name: str, condition: Condition, thrust_n: float) -> str:
    """Return a dimensional model as polynomials by hand; what is zero and known to be (no error) is no term."""
    variables = model.alpha_dot.variables
    held = f"{condition.airspeed_m_s:.6g} m/s, {condition.density_kg_m3:.6g} kg/m3, {thrust_n:.6g} N"
    lines = [
        f'schema = "{POLYNOMIALS}"',
        f"name = {_quoted(name)}",
        f"source = {_quoted(f'reduced at {held}')}",
        'state = ["alpha_rad", "q_rad_s"]',
        'parameter = "elevator_rad"',
    ]
    if variables[3:]:
        lines.append(f"inputs = [{', '.join(_quoted(item) for item in variables[3:])}]")
    errors = iter(np.diag(model.covariance).tolist())
    for table, polynomial in (("alpha_dot_rad_s", model.alpha_dot), ("q_dot_rad_s2", model.q_dot)):
        terms = [
            f"{_quoted('constant' if label == '1' else label)} = {value!r}"
            for label, value in zip(polynomial.labels(), polynomial.coefficients.tolist(), strict=True)
            if next(errors) > 0.0 or value
        ]
        lines += ["", f"[{table}]", *(terms or ['"constant" = 0.0'])]
    if variables[3:]:
        lines += ["", "[held]", *(f"{item} = 0.0" for item in variables[3:])]
    lines += ["", "[domain]"]
    for item, (low, high) in zip(variables, model.alpha_dot.domain.tolist(), strict=True):
        if np.isfinite([low, high]).all() and low < high:
            lines.append(f"{item} = [{low!r}, {high!r}]")
    return "\n".join([*lines, *_covariance(model), ""])


def _covariance(model: PolynomialModel) -> list[str]:
    known = np.flatnonzero(np.diag(model.covariance) > 0.0)
    if not known.size:
        return []
    terms = [
        f"{name}: {'constant' if label == '1' else label}"
        for name, polynomial in (("alpha_dot", model.alpha_dot), ("q_dot", model.q_dot))
        for label in polynomial.labels()
    ]
    rows = model.covariance[np.ix_(known, known)].tolist()
    return [
        "",
        "[covariance]",
        f"terms = [{', '.join(_quoted(terms[index]) for index in known.tolist())}]",
        "matrix = [",
        *(f"  [{', '.join(repr(value) for value in row)}]," for row in rows),
        "]",
    ]


def _quoted(text: str) -> str:
    """Return a text as TOML writes it: as JSON does, but that DEL is no character of a text either."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")

"""A model from wherever it stands: the folder of a run, its model.json, or a TOML file of polynomials."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import VARIABLES, PolynomialModel, substituted
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import from_paper, reduce
from finback.errors import InputError, ModelFileError, RefusedError
from finback.identification.identify import Identification
from finback.store import paper_file, polynomial_file
from finback.store.envelope import IDENTIFY, read_result
from finback.store.model_table import Range, Table, box, in_si
from finback.study.faults import nearest, read_toml, show
from finback.units import quantity_of, si_name, to_si, unit_of

_SCHEMAS: Final = (polynomial_file.SCHEMA, paper_file.SCHEMA)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFile:
    """A planar polynomial model as a file states it, in SI.

    Attributes:
        path: the file.
        sha256: of what it held.
        written: variables as the file names them: first state, second state, parameter, further inputs.
        first: rate of the first state, over the same variables in SI.
        second: rate of the second state.
        covariance: of all coefficients, those of ``first`` first, shape (n, n).
        held: input, by its name in SI -> value at which it is held, in SI.
        ranges: variable, by its name in SI -> where the file wants it analyzed, in SI.
    """

    path: Path
    sha256: str
    written: tuple[str, ...]
    first: Polynomial
    second: Polynomial
    covariance: FloatArray
    held: Mapping[str, float]
    ranges: Mapping[str, Range]

    def __post_init__(self) -> None:
        """Freeze the covariance."""
        object.__setattr__(self, "covariance", frozen_array(self.covariance))

    @property
    def in_pitch(self) -> bool:
        """Whether the states are alpha and q and the parameter is the elevator."""
        return self.first.variables[: len(VARIABLES)] == VARIABLES

    def model(self) -> PolynomialModel:
        """Return the model in (alpha, q, elevator), its further inputs free.

        Raises:
            InputError: it has other variables.
        """
        if not self.in_pitch:
            raise InputError(
                f"{self.path}: a model of {', '.join(self.written[:2])} over {self.written[2]} is none of the "
                "longitudinal motion",
                hint="that has the states alpha and q and the parameter elevator",
            )
        return PolynomialModel(alpha_dot=self.first, q_dot=self.second, covariance=self.covariance)

    def holding(self, values: Mapping[str, float]) -> ModelFile:
        """Return the same with inputs held elsewhere.

        Args:
            values: input, as the file names it or with another unit of its kind -> value in that unit.

        Raises:
            InputError: no such input.
        """
        inputs = self.written[3:]
        held = dict(self.held)
        for name, value in values.items():
            try:
                key = si_name(name)
            except InputError:  # no unit, perhaps only forgotten
                key = ""
            if key not in self.held:
                same = [other for other in inputs if quantity_of(other) == name]
                meant = nearest(name, same or list(inputs)) if inputs else ""
                raise InputError(
                    f"{self.path}: no input '{name}' can be held{meant}",
                    hint="" if inputs else "the model has no inputs beside its parameter",
                )
            held[key] = to_si(value, unit_of(name))
        return replace(self, held=held)

    def system(self) -> LienardSystem | PlanarSystem:
        """Return what is analyzed: the Liénard system where one holds every term, the planar field elsewhere."""
        first, second, covariance = substituted(self.first, self.second, self.covariance, self.held)
        if not self.why_planar():
            return reduce(PolynomialModel(alpha_dot=first, q_dot=second, covariance=covariance))
        return PlanarSystem.from_polynomials(first, second, covariance=covariance)

    def why_planar(self) -> str:
        """Return why the model has no Liénard form, in words; empty if it has one."""
        if not self.in_pitch:
            return "the states are not alpha and q over the elevator"
        try:
            reduce(self.model().held(**self.held))
        except RefusedError as refusal:
            return refusal.message
        return ""


def read_model_file(path: Path) -> ModelFile:
    """Read a model.

    Args:
        path: the folder of a run, a ``model.json``, or a TOML file of either form (docs/model.md).

    Raises:
        ModelFileError: the file has faults, each with its place.
        InputError: it cannot be read, or is no model.
    """
    file = path / IDENTIFY.file if path.is_dir() else path
    return _from_result(file) if file.suffix == ".json" else _from_toml(file)


def _from_result(path: Path) -> ModelFile:
    from finback.store.coefficients import coefficients_file  # noqa: PLC0415 - its own model, which few verbs need

    if path.is_file() and coefficients_file(path):
        raise InputError(
            f"{path} holds coefficients of any airspeed, no model of one",
            hint=f"reduce it first: finback export {path} --condition V RHO G H --to toml --output model.toml",
        )
    model = read_result(path, IDENTIFY, Identification)[0].model
    return ModelFile(
        path=path,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        written=model.alpha_dot.variables,
        first=model.alpha_dot,
        second=model.q_dot,
        covariance=model.covariance,
        held={},
        ranges={},
    )


def _from_toml(path: Path) -> ModelFile:
    faults: list[str] = []
    text, root = read_toml(path, faults)
    found = None if faults else _parse(path, text, Table(root=root, faults=faults))
    if found is None or faults:
        raise ModelFileError(str(path), tuple(dict.fromkeys(faults)))
    return found


def _parse(path: Path, text: str, table: Table) -> ModelFile | None:
    """Read a file by the schema it names; the paper's form may leave it out.

    With a wrong schema the file is read as what it looks like, so that its other faults are said at once, too.
    """
    is_paper_form = {paper_file.RATE, paper_file.MOMENT} & set(table.root) and "state" not in table.root
    likely = paper_file.SCHEMA if is_paper_form else polynomial_file.SCHEMA
    schema = table.root.get("schema", likely if is_paper_form else None)
    if schema not in _SCHEMAS:
        said = "missing" if schema is None else f"{show(schema)} is none that this version reads"
        table.fault("schema", f"{said}{nearest(schema, list(_SCHEMAS)) if schema else f'; write schema = {_quoted()}'}")
        if _looks_like_a_model(table):
            schema = likely
        else:
            return None
    digest = hashlib.sha256(text.encode()).hexdigest()
    return (_paper if schema == paper_file.SCHEMA else _polynomials)(path, digest, table)


def _looks_like_a_model(table: Table) -> bool:
    """Tell whether any key is one of a model; of a study file, every key would be called a fault."""
    return any(key in {"state", "parameter"} or "_dot_" in key for key in table.root)


def _quoted() -> str:
    return f"'{polynomial_file.SCHEMA}'"


def _polynomials(path: Path, digest: str, table: Table) -> ModelFile | None:
    draft = polynomial_file.read_polynomials(table)
    if draft is None:
        return None
    return ModelFile(
        path=path,
        sha256=digest,
        written=draft.variables,
        first=draft.first.to_si(),
        second=draft.second.to_si(),
        covariance=draft.si_covariance(),
        held=draft.si_held(),
        ranges=in_si(draft.ranges),
    )


def _paper(path: Path, digest: str, table: Table) -> ModelFile | None:
    form = paper_file.read_paper_form(table)
    names = (*paper_file.VARIABLES, *paper_file.INPUTS)
    held, domain = table.numbers("held", paper_file.INPUTS), table.ranges("domain", names)
    ranges = table.ranges("range", paper_file.VARIABLES)
    if form is None or table.faults:
        return None
    model = from_paper(form)
    written = tuple(name for name in names if si_name(name) in model.alpha_dot.variables)
    for name in sorted(set(held) - set(written)):
        table.fault(f"held.{name}", "the model does not depend on it")
    if table.faults:
        return None
    limits = box(model.alpha_dot.variables, in_si(domain))
    first, second = (replace(polynomial, domain=limits) for polynomial in (model.alpha_dot, model.q_dot))
    return ModelFile(
        path=path,
        sha256=digest,
        written=written,
        first=first,
        second=second,
        covariance=model.covariance,
        held={si_name(name): to_si(held.get(name, 0.0), unit_of(name)) for name in written[3:]},
        ranges=in_si(ranges),
    )

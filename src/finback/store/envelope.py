"""The stages' files: what each is made from, who made it, and whether it still stands.

Every JSON file is ``{"schema": "finback/<kind>/<version>", "provenance": {...}, "content": {...}}``. The provenance
holds the SHA-256 of every input file; a result whose inputs have changed is refused, with the command that renews it.
Some have sections that say in another way what the content says; nothing is read back from them.
"""

from __future__ import annotations

import hashlib
import json
import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NoReturn, TypeVar, final

from finback import __version__
from finback.errors import InputError, MissingResultError
from finback.files import sha256, write_text
from finback.store.codec import from_tree, to_json, to_tree

T = TypeVar("T")

STUDY_FILE: Final = "study.toml"

ORIGIN: Final = "origin"
"""Key in a sweep's provenance: where the flights come from."""
RECORDED: Final = "recorded"
"""That origin, where the flights were not flown here: their tables are ``file`` in the flights' provenance."""
OPTIONS: Final = "options"
"""Key in a sweep's provenance: how ``finback prepare`` was asked to do more than its map says."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """One stage of a run.

    Attributes:
        verb: the command that makes its result.
        file: the result's name in the folder of a run.
        kind: what the result is; its schema is ``finback/<kind>/<version>``.
        inputs: files of the run that the result is made from; none if it belongs to no run.
        asks: tables of the study that this stage is the first to read; empty for the sweep, which reads all others.
        version: of the file's format: another one wherever ``content`` has other keys or meanings.
        sections: keys beside schema, provenance and content.
        also: further schemas that the file may have: other contents that stand for the same stage.
    """

    verb: str
    file: str
    kind: str
    inputs: tuple[str, ...]
    asks: tuple[str, ...] = ()
    version: int = 1
    sections: tuple[str, ...] = ()
    also: tuple[str, ...] = ()

    @property
    def schema(self) -> str:
        """Name and version of the file's format."""
        return f"finback/{self.kind}/{self.version}"


CAMPAIGN: Final = Stage(verb="sweep", file="sweep.json", kind="campaign", inputs=(STUDY_FILE,))
"""A sweep of so many flights that it is a folder of partitions."""
SWEEP: Final = Stage(verb="sweep", file="sweep.json", kind="sweep", inputs=(STUDY_FILE,), also=(CAMPAIGN.schema,))
IDENTIFY: Final = Stage(
    verb="identify",
    file="model.json",
    kind="model",
    inputs=(STUDY_FILE, SWEEP.file),
    asks=("identification",),
    version=2,
)
ANALYZE_PLANAR: Final = Stage(
    verb="analyze",
    file="analysis.json",
    kind="planar-analysis",
    inputs=(STUDY_FILE, IDENTIFY.file),
    asks=("analysis",),
    version=3,
    sections=("located",),
)
"""The analysis of a model that is no Liénard system."""
ANALYZE: Final = replace(ANALYZE_PLANAR, kind="analysis", also=(ANALYZE_PLANAR.schema,))
VALIDATE: Final = Stage(
    verb="validate",
    file="validation.json",
    kind="validation",
    inputs=(STUDY_FILE, SWEEP.file, IDENTIFY.file, ANALYZE.file),
    asks=("validation",),
)
STAGES: Final = (SWEEP, IDENTIFY, ANALYZE, VALIDATE)
"""All stages that leave a result, in order."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Where a result comes from.

    Attributes:
        finback: version of the program.
        created_at: time of writing, ISO 8601, UTC.
        inputs: file of the run -> SHA-256 of what it held.
        study_sha256: of the run's study file; empty if the run has none.
        aircraft_sha256: fingerprint of the aircraft that was flown; empty if nobody said.
    """

    finback: str
    created_at: str
    inputs: Mapping[str, str]
    study_sha256: str
    aircraft_sha256: str


def write_result(
    run: Path, stage: Stage, content: object, *, aircraft_sha256: str, sections: Mapping[str, object] | None = None
) -> None:
    """Write a stage's JSON file, with the hashes of the inputs that stand in the run now.

    A file that says the same but for its time of making is left alone, so that what was made from it stays fresh.

    Args:
        run: the folder.
        stage: what the content is.
        content: a value of the stage's class.
        aircraft_sha256: fingerprint of the aircraft, empty if there is none.
        sections: what the stage's further sections hold.

    Raises:
        MissingResultError: an input is not there.
    """
    for name in stage.inputs:
        if not (run / name).is_file():
            raise MissingResultError(
                f"{run / stage.file} cannot be written: {name}, which it is made from, is missing",
                hint=f"put {name} into {run}",
            )
    study = run / STUDY_FILE
    provenance = _new_provenance(
        {name: _digest(run, name, stage) for name in stage.inputs},
        study_sha256=sha256(study) if study.is_file() else "",
        aircraft_sha256=aircraft_sha256,
    )
    text = _document(stage, content, provenance, sections or {})
    if not _says_the_same(run / stage.file, text):
        write_text(run / stage.file, text)


def write_alone(
    path: Path, stage: Stage, content: object, *, inputs: Mapping[str, str], sections: Mapping[str, object]
) -> None:
    """Write a result that belongs to no run.

    Args:
        path: the file.
        stage: what the content is.
        content: a value of the stage's class.
        inputs: file that it was made from -> SHA-256 of what it held.
        sections: what the stage's further sections hold.
    """
    provenance = _new_provenance(inputs, study_sha256="", aircraft_sha256="")
    write_text(path, _document(stage, content, provenance, sections))


def _new_provenance(inputs: Mapping[str, str], *, study_sha256: str, aircraft_sha256: str) -> Provenance:
    return Provenance(
        finback=__version__,
        created_at=datetime.now(UTC).isoformat(timespec="seconds"),
        inputs=inputs,
        study_sha256=study_sha256,
        aircraft_sha256=aircraft_sha256,
    )


def _document(stage: Stage, content: object, provenance: Provenance, sections: Mapping[str, object]) -> str:
    derived = {name: to_tree(sections[name]) for name in stage.sections}
    return to_json({"schema": stage.schema, "provenance": to_tree(provenance), **derived, "content": to_tree(content)})


def _says_the_same(path: Path, text: str) -> bool:
    """Tell whether a file holds this JSON already, but for the time of its making."""
    try:
        old, new = json.loads(path.read_text(encoding="utf-8")), json.loads(text)
        old["provenance"]["created_at"] = new["provenance"]["created_at"]
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return bool(old == new)


def read_result(path: Path, stage: Stage, kind: type[T]) -> tuple[T, Provenance]:
    """Read a stage's JSON file, whether its inputs have changed or not.

    Raises:
        InputError: the file cannot be read, is damaged, or is no such result.
    """
    tree = _read_json(path, stage)
    try:
        return from_tree(tree["content"], kind), from_tree(tree["provenance"], Provenance)
    except ValueError as error:
        lines = str(error).replace("\n", "\n  ")
        raise InputError(f"{path} is damaged:\n  {lines}", hint=_again(path, stage)) from error


def schema_of(path: Path) -> str:
    """Return the schema that a JSON file names; empty if it names none or cannot be read."""
    try:
        tree = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return ""
    found = tree.get("schema") if isinstance(tree, dict) else None
    return found if isinstance(found, str) else ""


def check_fresh(run: Path, stage: Stage) -> None:
    """Check that a stage's result is there and that nothing it was made from has changed since, however far back.

    Raises:
        MissingResultError: the result, or one before it, is missing or stale; the hint is the command that makes it.
        InputError: a result on the way cannot be read, or does not say what it was made from.
    """
    path = run / stage.file
    if not path.is_file():
        _refuse_missing(run, stage)
    recorded = _provenance(path, stage)
    if set(recorded.inputs) != set(stage.inputs):
        raise InputError(
            f"{path} is damaged: its provenance names the inputs {sorted(recorded.inputs)}, "
            f"expected {sorted(stage.inputs)}",
            hint=_again(path, stage),
        )
    for earlier in STAGES:
        if earlier.file in recorded.inputs:
            check_fresh(run, earlier)
    for name, digest in recorded.inputs.items():
        if not (run / name).is_file() or _digest(run, name, stage) != digest:
            raise MissingResultError(
                f"{path} is stale: {name} has changed since it was made", hint=f"renew it with: {command(run, stage)}"
            )


def _digest(run: Path, name: str, stage: Stage) -> str:
    """Return the fingerprint of an input: of a study only the tables that the stage reads, and no earlier one did.

    So what is asked of a model may be written, or changed, after the flights: they are not flown again for it.
    """
    if name != STUDY_FILE:
        return sha256(run / name)
    try:
        study = tomllib.loads((run / name).read_text("utf-8"))
    except ValueError:  # neither text nor TOML: whoever reads it will say so
        return sha256(run / name)
    later = {table for each in STAGES for table in each.asks}
    read = set(stage.asks) if stage.asks else study.keys() - later
    tables = {table: study[table] for table in sorted(read & study.keys())}
    return hashlib.sha256(json.dumps(tables, sort_keys=True, default=str).encode()).hexdigest()


def _refuse_missing(run: Path, stage: Stage) -> NoReturn:
    """Say what to make where a result is missing: the first that is, not the last that was looked for."""
    if not run.is_dir():
        raise MissingResultError(f"there is no run {run}", hint="make one with: finback run STUDY")
    if not any((run / name).is_file() for name in (STUDY_FILE, SWEEP.file)):
        raise MissingResultError(
            f"{run} is no run: it holds neither a study nor a sweep", hint="make one with: finback run STUDY"
        )
    for earlier in STAGES:
        if earlier.file in stage.inputs:
            check_fresh(run, earlier)
    raise MissingResultError(f"{run / stage.file} is missing", hint=f"make it with: {command(run, stage)}")


def command(run: Path, stage: Stage) -> str:
    """Return the command that makes a stage's result in a run; a sweep always begins a new run.

    A sweep is flown from the study file that it was flown from: beside the run's copy of that, the aircraft may not be
    found. Only where nobody knows that file, or it is gone, the copy is named. Recorded flights are prepared again,
    from their tables and map.
    """
    if stage != SWEEP:
        return f"finback {stage.verb} {shlex.quote(str(run))}"
    content = _content(run)
    study = next((path for path in (_study_path(run, content), run / STUDY_FILE) if path.is_file()), None)
    said = shlex.quote(str(study)) if study else ""
    if _text(content, "provenance", ORIGIN) == RECORDED:
        tables = " ".join(map(shlex.quote, _tables(content))) or "FLIGHT..."
        return f"finback prepare {tables} --map {said or 'MAP'} {_text(content, 'provenance', OPTIONS)}".rstrip()
    return f"finback {stage.verb} {said or 'STUDY'}"


def aircraft_of(run: Path) -> str:
    """Return the fingerprint of the aircraft that the run's sweep flew; empty if there is no sweep."""
    path = run / SWEEP.file
    return _provenance(path, SWEEP).aircraft_sha256 if path.is_file() else ""


def _again(path: Path, stage: Stage) -> str:
    """Say how a file is made again: what belongs to no run, from the files that it says it was made from."""
    if stage.inputs:
        return f"make it again with: {command(path.parent, stage)}"
    provenance = _section(path, "provenance")
    inputs = provenance.get("inputs") if isinstance(provenance, dict) else None
    made_of = " ".join(map(shlex.quote, inputs)) if isinstance(inputs, dict) else ""
    return f"make it again with: finback {stage.verb} {made_of or 'FILE...'} --output {shlex.quote(str(path))}"


def _content(run: Path) -> object:
    """Return what the run's sweep says, whatever its form; None if it cannot be read."""
    return _section(run / SWEEP.file, "content")


def _section(path: Path, name: str) -> object:
    """Return what stands under a key of a file, whatever its form; None if it cannot be read."""
    try:
        tree: Any = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return tree.get(name) if isinstance(tree, dict) else None


def _text(tree: object, *keys: str) -> str:
    """Return the text at a place; empty if there is none. One with a null byte is no text: no path holds it."""
    for key in keys:
        tree = tree.get(key) if isinstance(tree, dict) else None
    return tree if isinstance(tree, str) and "\0" not in tree else ""


def _study_path(run: Path, content: object) -> Path:
    """Return the study file that the run's sweep says it was flown from, or the run's copy if that cannot be read."""
    study = _text(content, "provenance", "study_path")
    return Path(study) if study else run / STUDY_FILE


def _tables(content: object) -> list[str]:
    """Return the files of a sweep's recorded flights, as far as it names them."""
    flights = content.get("flights") if isinstance(content, dict) else None
    files = [_text(flight, "provenance", "file") for flight in flights] if isinstance(flights, list) else []
    return [file for file in files if file]


def _provenance(path: Path, stage: Stage) -> Provenance:
    try:
        return from_tree(_read_json(path, stage)["provenance"], Provenance)
    except ValueError as error:
        raise InputError(f"{path} is damaged: its provenance: {error}", hint=_again(path, stage)) from error


def _read_json(path: Path, stage: Stage) -> dict[str, Any]:
    try:
        tree: Any = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}", hint="is it the right file?") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {error}", hint=_again(path, stage)) from error
    found = tree.get("schema") if isinstance(tree, dict) else None
    if found not in (stage.schema, *stage.also):
        raise InputError(
            f"{path} is no {stage.kind} that this version can read: its schema is {found!r}, expected '{stage.schema}'",
            hint=_again(path, stage),
        )
    if set(tree) != {"schema", "provenance", "content", *stage.sections}:
        raise InputError(f"{path} is damaged: it holds {', '.join(tree)}", hint=_again(path, stage))
    return dict(tree)

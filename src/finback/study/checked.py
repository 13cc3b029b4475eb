"""A TOML file checked by a model of its tables: the model, or every fault of the file with its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from finback.errors import FaultyFileError
from finback.study.faults import explain, read_toml

M = TypeVar("M", bound=BaseModel)


def read_checked(
    path: Path,
    model: type[M],
    tables: Mapping[str, type[BaseModel]],
    say: Callable[[Mapping[str, Any], list[str]], str] = explain,
) -> M:
    """Read a file.

    Args:
        path: the file.
        model: of its top level.
        tables: of the tables below, by their names.
        say: the words for a fault, from pydantic's description and the keys that its table may have.

    Raises:
        FaultyFileError: with every fault of the file.
    """
    faults: list[str] = []
    _, root = read_toml(path, faults)
    if faults:
        raise FaultyFileError(str(path), tuple(faults))
    try:
        return model.model_validate(root)
    except ValidationError as error:
        said = tuple(_fault(dict(fault), model, tables, say) for fault in error.errors())
        raise FaultyFileError(str(path), said) from None


def _fault(
    fault: dict[str, Any],
    model: type[BaseModel],
    tables: Mapping[str, type[BaseModel]],
    say: Callable[[Mapping[str, Any], list[str]], str],
) -> str:
    kind = model
    for part in fault["loc"][:-1]:
        kind = tables.get(str(part), kind)
    keys = [field.alias or name for name, field in kind.model_fields.items()]
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"])
    return f"{place.removeprefix('.')}: {say(fault, keys)}"

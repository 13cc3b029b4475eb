"""Read the sources of the F-8 II: TOML values and CSV tables, with errors that name the place."""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, final

from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """A TOML file that says which key is wrong."""

    path: Path
    tree: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path) -> Settings:
        """Read the file."""
        try:
            return cls(path=path, tree=tomllib.loads(path.read_text(encoding="utf-8")))
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror}") from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: {error}") from error

    def value(self, key: str) -> Any:
        """Return what stands under a dotted key."""
        value: Any = self.tree
        for part in key.split("."):
            if not isinstance(value, Mapping) or part not in value:
                raise InputError(f"{self.path}: '{key}' is missing")
            value = value[part]
        return value

    def number(self, key: str) -> float:
        """Return the finite number under a dotted key."""
        return self._finite(key, self.value(key))

    def positive(self, key: str) -> float:
        """Return the number above 0 under a dotted key."""
        number = self.number(key)
        if number <= 0:
            raise InputError(f"{self.path}: '{key}' must be above 0, is {number!r}")
        return number

    def interval(self, key: str) -> tuple[float, float]:
        """Return the two rising numbers under a dotted key."""
        value = self.value(key)
        if not isinstance(value, list) or len(value) != 2:
            raise InputError(f"{self.path}: '{key}' must be two numbers, low and high")
        low, high = (self._finite(key, part) for part in value)
        if not low < high:
            raise InputError(f"{self.path}: '{key}' must rise, is {value}")
        return low, high

    def coefficients(self, section: str, names: Sequence[str]) -> tuple[float, ...]:
        """Return the numbers of a section that holds these keys and no other."""
        found = self.value(section)
        if not isinstance(found, Mapping):
            raise InputError(f"{self.path}: '{section}' must be a section with the keys {', '.join(names)}")
        if unknown := set(found) - set(names):
            raise InputError(f"{self.path}: '{section}.{min(unknown)}' is no term; the terms are {', '.join(names)}")
        return tuple(self.number(f"{section}.{name}") for name in names)

    def _finite(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{self.path}: '{key}' must be a finite number, is {value!r}")
        return float(value)


def read_columns(path: Path, *names: str) -> dict[str, list[float]]:
    """Read a CSV table with ``#`` comments: the named columns (all, if none is named), the first one rising."""
    header, *rows = _lines(path)
    missing = [name for name in names if name not in header]
    if missing or not rows:
        raise InputError(f"{path}: no column {', '.join(missing)}" if missing else f"{path}: no rows")
    columns: dict[str, list[float]] = {name: [] for name in header}
    for index, row in enumerate(rows, start=1):
        if len(row) != len(header):
            raise InputError(f"{path}: row {index} has {len(row)} values, the header has {len(header)}")
        for name, text in zip(header, row, strict=True):
            columns[name].append(_number(text, f"{path}: row {index}, column {name}"))
    for before, after in pairwise(columns[header[0]]):
        if not before < after:
            raise InputError(f"{path}: {header[0]} must rise, but {after!r} follows {before!r}")
    return {name: columns[name] for name in names or header}


def _lines(path: Path) -> list[list[str]]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: {error}") from error
    return list(csv.reader(line for line in text.splitlines() if not line.startswith("#"))) or [[]]


def _number(text: str, place: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise InputError(f"{place}: '{text}' is no number") from None
    if not math.isfinite(number):
        raise InputError(f"{place}: {text} is not finite")
    return number

"""Faults of a study file in words: where, which rule, by what value, and what may have been meant."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

_SHOWN: Final = 60  # characters of a wrong value that a message repeats


def read_toml(path: Path, faults: list[str]) -> tuple[str, dict[str, Any]]:
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


def dotted(place: str, location: tuple[int | str, ...], value: dict[str, Any]) -> str:
    """Write pydantic's location as a path: ``sweep[2].elevator_deg[1]``."""
    # A lone number is read as a list of one: its index stands in no file.
    if len(location) > 1 and not isinstance(value.get(str(location[0])), list):
        location = location[:1]
    for part in location:
        place += f"[{part}]" if isinstance(part, int) else f".{part}"
    return place.removeprefix(".")


def explain(fault: Mapping[str, Any], keys: list[str]) -> str:
    """Say what rule is broken, by what value, and what may have been meant."""
    if fault["type"] == "missing":
        return "missing"
    if fault["type"] == "extra_forbidden":
        return f"unknown key{nearest(fault['loc'][-1], keys)}"
    rule = str(fault["msg"]).removeprefix("Value error, ").replace("Input should be", "must be")
    return f"{rule[0].lower()}{rule[1:]}, got {show(fault['input'])}"


def nearest(word: object, known: list[str]) -> str:
    """Return the end of a message: the known word that may have been meant, or all of them."""
    near = get_close_matches(str(word), known, n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else f"; expected one of: {', '.join(known)}"


def show(value: object) -> str:
    """Return a value as text, cut to a length that fits in a message."""
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"

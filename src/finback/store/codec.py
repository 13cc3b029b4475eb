"""Typed values as JSON, bit for bit.

Floats are written with ``repr``, which round-trips; JSON has no other than finite numbers, so ``nan``, ``inf`` and
``-inf`` are written as text. Arrays are lists; the type of the field decides how they are read. A value of a union
carries its class name as ``type``.
"""

from __future__ import annotations

import json
import math
import types
from collections.abc import Callable
from dataclasses import is_dataclass
from enum import StrEnum
from typing import Any, Final, TypeVar, Union, get_args, get_origin

import cattrs
import numpy as np

T = TypeVar("T")

_TAG: Final = "type"
_LINE: Final = 110  # characters
_WORDS: Final = ("nan", "inf", "-inf")


def to_tree(value: object) -> Any:
    """Return a value as dictionaries, lists, strings, finite numbers and booleans."""
    return _CONVERTER.unstructure(value)


def from_tree(tree: object, kind: type[T]) -> T:
    """Return the value of class ``kind`` that ``to_tree`` made ``tree`` from.

    Raises:
        ValueError: the tree is none of ``kind``; the message has one line for each place that does not fit.
    """
    try:
        return _CONVERTER.structure(tree, kind)
    except Exception as error:
        raise ValueError("\n".join(cattrs.transform_error(error, format_exception=_explain))) from error


def to_json(tree: object) -> str:
    """Write a tree as JSON: indented, but for lists of numbers and for dictionaries that fit on one line."""
    return f"{_write(tree, '')}\n"


def _write(tree: object, indent: str) -> str:
    deeper = f"{indent}  "
    if isinstance(tree, dict) and tree:
        if not any(isinstance(item, dict) for item in tree.values()):
            line = json.dumps(tree, ensure_ascii=False, allow_nan=False)
            if len(line) <= _LINE:
                return line
        items = [f"{deeper}{json.dumps(key, ensure_ascii=False)}: {_write(item, deeper)}" for key, item in tree.items()]
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(tree, (list, tuple)) and any(isinstance(item, (dict, list, tuple, str)) for item in tree):
        return "[\n" + ",\n".join(f"{deeper}{_write(item, deeper)}" for item in tree) + f"\n{indent}]"
    return json.dumps(tree, ensure_ascii=False, allow_nan=False)


def _explain(error: BaseException, _: type[Any] | None) -> str:
    return "missing" if isinstance(error, KeyError) else str(error)


# floats and plain values


def _float_to_tree(value: float) -> float | str:
    number = float(value)
    return number if math.isfinite(number) else str(number)


def _float_from_tree(tree: object, _: object = None) -> float:
    if isinstance(tree, bool) or not (isinstance(tree, (int, float)) or tree in _WORDS):
        raise ValueError(f"expected a number, got {tree!r}")
    return float(tree)


def _plain(kind: type) -> Callable[[object, object], object]:
    def structure(tree: object, _: object) -> object:
        if type(tree) is not kind:
            raise ValueError(f"expected {kind.__name__}, got {tree!r}")
        return tree

    return structure


def _word_from_tree(tree: object, kind: Callable[[object], StrEnum]) -> StrEnum:
    return kind(tree)


# arrays


def _is_array(kind: object) -> bool:
    return kind is np.ndarray or get_origin(kind) is np.ndarray


def _array_to_tree(array: np.ndarray[Any, Any]) -> Any:
    if array.size == 0 and array.ndim > 1:
        return {"shape": list(array.shape)}  # nested lists forget that (0, 2) had two columns
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        return _nested(array.tolist(), _float_to_tree)
    return array.tolist()


def _array_from_tree(tree: Any, kind: Any) -> np.ndarray[Any, Any]:
    dtype = np.dtype(get_args(get_args(kind)[1])[0]) if get_args(kind) else np.dtype(np.float64)
    if isinstance(tree, dict):
        array = np.empty(tuple(tree["shape"]), dtype)
    elif isinstance(tree, list):
        read = {"f": _float_from_tree, "b": lambda item: _plain(bool)(item, None)}
        array = np.array(_nested(tree, read.get(dtype.kind, lambda item: _plain(int)(item, None))), dtype)
    else:
        raise TypeError(f"expected a list of numbers, got {tree!r}")
    array.setflags(write=False)
    return array


def _nested(tree: Any, convert: Callable[[Any], Any]) -> Any:
    return [_nested(item, convert) for item in tree] if isinstance(tree, list) else convert(tree)


# unions of dataclasses


def _is_union(kind: object) -> bool:
    return get_origin(kind) in (types.UnionType, Union) and all(is_dataclass(member) for member in get_args(kind))


def _union_to_tree(value: object) -> dict[str, Any]:
    return {_TAG: type(value).__name__, **_CONVERTER.unstructure(value)}


def _union_from_tree(tree: Any, kind: object) -> Any:
    members = {member.__name__: member for member in get_args(kind)}
    if not isinstance(tree, dict) or tree.get(_TAG) not in members:
        raise ValueError(f"expected a value whose '{_TAG}' is one of {', '.join(members)}")
    rest = {key: item for key, item in tree.items() if key != _TAG}
    return _CONVERTER.structure(rest, members[tree[_TAG]])


def _make_converter() -> cattrs.Converter:
    converter = cattrs.Converter(forbid_extra_keys=True)
    converter.register_unstructure_hook(float, _float_to_tree)
    converter.register_unstructure_hook(bool, bool)
    converter.register_unstructure_hook(int, int)
    converter.register_structure_hook(float, _float_from_tree)
    for kind in (bool, int, str):
        converter.register_structure_hook(kind, _plain(kind))
    # A StrEnum is a str too; its own hooks come first and keep it an enumeration.
    converter.register_unstructure_hook(StrEnum, str)
    converter.register_structure_hook(StrEnum, _word_from_tree)
    converter.register_unstructure_hook_func(_is_array, _array_to_tree)
    converter.register_structure_hook_func(_is_array, _array_from_tree)
    converter.register_unstructure_hook_func(_is_union, _union_to_tree)
    converter.register_structure_hook_func(_is_union, _union_from_tree)
    return converter


_CONVERTER: Final = _make_converter()

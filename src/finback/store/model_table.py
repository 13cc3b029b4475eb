"""What the two TOML forms of a model have in common: numbers, ranges, and every fault with its place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.polynomial import Polynomial
from finback.study.faults import nearest, show
from finback.units import si_name, to_si, unit_of

Range = tuple[float, float]


@final
@dataclass(slots=True)
class Table:
    """A table of a file that is being read, and the faults found so far; what cannot be read is left out.

    Attributes:
        root: the parsed file.
        faults: one line each, beginning with the path of the key; shared by everybody who reads.
    """

    root: Mapping[str, Any]
    faults: list[str] = field(default_factory=list)

    def fault(self, place: str, message: str) -> None:
        """Add a fault."""
        self.faults.append(f"{place}: {message}")

    def keys(self, place: str, table: Mapping[str, Any], known: list[str]) -> None:
        """Add a fault for every key that is not known."""
        for key in table:
            if key not in known:
                self.fault(f"{place}.{key}" if place else key, f"unknown key{nearest(key, known)}")

    def table(self, name: str) -> Mapping[str, Any]:
        """Return a table of the root, empty if there is none."""
        value = self.root.get(name, {})
        if isinstance(value, dict):
            return value
        self.fault(name, f"must be a table [{name}], got {show(value)}")
        return {}

    def number(self, place: str, value: object) -> float:
        """Return a finite number; nan, and a fault, if it is none."""
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.fault(place, f"must be a number, got {show(value)}")
            return math.nan
        if not math.isfinite(number := _float(value)):
            self.fault(place, f"must be a finite number, got {show(value)}")
            return math.nan
        return number

    def text(self, name: str) -> str:
        """Return a text of the root, empty if there is none."""
        value = self.root.get(name, "")
        if isinstance(value, str):
            return value
        self.fault(name, f"must be a text, got {show(value)}")
        return ""

    def numbers(self, name: str, known: tuple[str, ...]) -> dict[str, float]:
        """Return a table of variable = number."""
        table = self.table(name)
        self.keys(name, table, list(known))
        return {key: self.number(f"{name}.{key}", table[key]) for key in known if key in table}

    def ranges(self, name: str, known: tuple[str, ...]) -> dict[str, Range]:
        """Return a table of variable = [low, high]."""
        table = self.table(name)
        self.keys(name, table, list(known))
        found = {}
        for key in known:
            if key not in table:
                continue
            place, value = f"{name}.{key}", table[key]
            if not isinstance(value, list) or len(value) != 2:
                self.fault(place, f"must be [low, high], got {show(value)}")
                continue
            low, high = (self.number(f"{place}[{i}]", end) for i, end in enumerate(value))
            if low >= high:
                self.fault(place, f"the lower end must come first and be smaller, got {show(value)}")
            elif low < high:
                found[key] = (low, high)
        return found


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # an integer of 400 digits
        return math.inf


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A model as read from a file, in the file's units.

    Attributes:
        variables: first state, second state, parameter, further inputs; names with unit.
        first: rate of the first state over the variables.
        second: rate of the second state.
        covariance: of all coefficients, those of ``first`` first, shape (n, n).
        held: input -> value to be held at.
        ranges: variable -> where it is to be analyzed.
    """

    variables: tuple[str, ...]
    first: Polynomial
    second: Polynomial
    covariance: FloatArray
    held: Mapping[str, float]
    ranges: Mapping[str, Range]

    def si_covariance(self) -> FloatArray:
        """Return the covariance of the coefficients in SI."""
        factors = []
        for polynomial in (self.first, self.second):
            ones = Polynomial(
                variables=polynomial.variables,
                powers=polynomial.powers,
                coefficients=np.ones(polynomial.coefficients.size),
                value_unit=polynomial.value_unit,
                domain=polynomial.domain,
            )
            factors.append(ones.to_si().coefficients)
        scale = np.concatenate(factors)
        return frozen_array(scale[:, np.newaxis] * self.covariance * scale)

    def si_held(self) -> dict[str, float]:
        """Return the held values in SI, by names in SI."""
        return {si_name(name): to_si(value, unit_of(name)) for name, value in self.held.items()}


def in_si(ranges: Mapping[str, Range]) -> dict[str, Range]:
    """Return ranges in SI, by names in SI."""
    return {
        si_name(name): (to_si(low, unit_of(name)), to_si(high, unit_of(name))) for name, (low, high) in ranges.items()
    }


def box(variables: tuple[str, ...], domain: Mapping[str, Range]) -> FloatArray:
    """Return low and high of each variable, shape (v, 2); infinite where nothing is said."""
    return frozen_array([domain.get(name, (-np.inf, np.inf)) for name in variables])

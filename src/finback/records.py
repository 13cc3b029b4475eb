"""What a flight leaves behind: its columns, how it ended, and everything needed to fly it again.

All types are values: frozen, with read-only float64 arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.channels import channel
from finback.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


def _rebuilt(value: Schedule | FlightRecord | Sweep) -> tuple[Any, ...]:
    """Return what pickle needs to call the constructor again; a mapping proxy cannot be pickled, its content can."""
    given = {part.name: getattr(value, part.name) for part in fields(value)}
    plain = {name: dict(item) if isinstance(item, MappingProxyType) else item for name, item in given.items()}
    return partial(type(value), **plain), ()  # type: ignore[arg-type] # the very arguments it was made of


@final
class Outcome(StrEnum):
    """How a flight ended."""

    COMPLETED = "completed"
    DEPARTED = "departed"
    DIVERGED = "diverged"


@final
class Hold(StrEnum):
    """How the elevator moved between two samples of a record."""

    ZOH = "zoh"
    """held from each sample to the next"""
    FOH = "foh"
    """straight from each sample to the next"""
    ACTUATOR = "actuator"
    """as the actuator moved it; the samples are its output"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """The reference flight at which a fidelity freezes what it freezes.

    Attributes:
        airspeed_m_s: true airspeed V, > 0.
        density_kg_m3: air density, > 0.
        gravity_m_s2: gravity g of the term g/V, >= 0.
        altitude_m: geometric altitude (for attitude-independent things such as Mach number).
    """

    airspeed_m_s: float
    density_kg_m3: float
    gravity_m_s2: float
    altitude_m: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """The elevator over time: straight lines between breakpoints, held after the last.

    Two breakpoints at one time are a jump. At a jump ``value`` gives the new side.

    Attributes:
        time_s: breakpoints, shape (n,), not decreasing, at most two alike.
        elevator_rad: the elevator at them, shape (n,), trailing edge down > 0.
    """

    time_s: FloatArray
    elevator_rad: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the arrays."""
        object.__setattr__(self, "time_s", frozen_array(self.time_s))
        object.__setattr__(self, "elevator_rad", frozen_array(self.elevator_rad))
        time = self.time_s
        if time.ndim != 1 or not time.size or time.shape != self.elevator_rad.shape:
            raise InputError(
                f"a schedule needs as many times as elevator values, got {time.shape} and {self.elevator_rad.shape}"
            )
        if not (np.isfinite(time).all() and np.isfinite(self.elevator_rad).all()):
            raise InputError("a schedule holds only finite numbers")
        if (np.diff(time) < 0).any() or (time[2:] == time[:-2]).any():
            raise InputError("schedule times must not decrease, and at most two may be alike (a jump)")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the constructor: what arrives in another process is checked and read-only too."""
        return _rebuilt(self)

    def value(self, time_s: ArrayLike) -> FloatArray:
        """Return the elevator in rad at ``time_s`` (any shape); at a jump, the value after it."""
        return self._interpolate(np.asarray(time_s, dtype=np.float64), side="right")

    def drive(self, time_s: ArrayLike) -> FloatArray:
        """Return what a multistep integrator must be given at ``time_s``: at a jump, the mean of both sides.

        The mean keeps an Adams-Bashforth integrator from acting half a step early (measured: 0.022 deg -> 4e-4 deg
        in alpha at 400 Hz).
        """
        time = np.asarray(time_s, dtype=np.float64)
        return 0.5 * (self._interpolate(time, side="left") + self._interpolate(time, side="right"))

    def _interpolate(self, time: FloatArray, *, side: str) -> FloatArray:
        knots, values = self.time_s, self.elevator_rad
        after = np.searchsorted(knots, time, side="right" if side == "right" else "left")
        high = np.clip(after, 0, knots.size - 1)
        low = np.clip(after - 1, 0, knots.size - 1)
        width = knots[high] - knots[low]
        share = np.where(width > 0, (time - knots[low]) / np.where(width > 0, width, 1.0), 0.0)
        return values[low] + np.clip(share, 0.0, 1.0) * (values[high] - values[low])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRecord:
    """One flight: columns by channel name, in SI, and what is needed to understand and repeat it.

    Attributes:
        name: unique within a sweep, such as ``release-03``.
        columns: channel name -> values, shape (n,), read-only float64; ``time_s`` is always there and increases.
        outcome: how the flight ended.
        note: the outcome in a sentence, with numbers and units.
        condition: the reference flight.
        schedule: the elevator that was asked for.
        hold: how the elevator moved between samples.
        provenance: text facts (aircraft, fidelity, step, seed, noise, versions); keys name their units.
    """

    name: str
    columns: Mapping[str, FloatArray]
    outcome: Outcome
    note: str
    condition: Condition
    schedule: Schedule
    hold: Hold
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Freeze and check the columns."""
        columns = {name: frozen_array(values) for name, values in self.columns.items()}
        for name, values in columns.items():
            channel(name)
            if values.ndim != 1:
                raise InputError(f"flight '{self.name}': column '{name}' has shape {values.shape}, expected (n,)")
        if "time_s" not in columns:
            raise InputError(f"flight '{self.name}' has no column 'time_s'", hint="give the time of each sample")
        lengths = {name: values.size for name, values in columns.items()}
        if len(set(lengths.values())) > 1:
            raise InputError(f"flight '{self.name}': columns of different lengths: {lengths}")
        time = columns["time_s"]
        if not (np.isfinite(time).all() and (time[1:] > time[:-1]).all()):
            raise InputError(f"flight '{self.name}': 'time_s' must increase from row to row and be finite")
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the constructor: what arrives in another process is checked and read-only too."""
        return _rebuilt(self)

    def __getitem__(self, name: str) -> FloatArray:
        try:
            return self.columns[name]
        except KeyError:
            channel(name)
            raise InputError(
                f"flight '{self.name}' has no column '{name}'", hint=f"it has: {', '.join(self.columns)}"
            ) from None

    def __len__(self) -> int:
        return int(self.columns["time_s"].size)

    def or_zero(self, name: str) -> FloatArray:
        """Return a column, or zeros where the flight has none of that name, shape (n,)."""
        return self.columns.get(name, np.zeros(len(self)))

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last, in s."""
        time = self.columns["time_s"]
        return float(time[-1] - time[0]) if time.size else 0.0

    def with_columns(self, **columns: ArrayLike) -> FlightRecord:
        """Return the same flight with some columns replaced or added (channel name -> values, SI)."""
        frozen = {name: frozen_array(values) for name, values in columns.items()}
        return replace(self, columns={**self.columns, **frozen})

    def frame(self) -> pd.DataFrame:
        """Return the columns as a DataFrame, one row a sample."""
        import pandas as pd  # noqa: PLC0415 - half a second that only callers of this method need

        return pd.DataFrame(dict(self.columns))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Many flights of one aircraft.

    Attributes:
        study: the study's name.
        records: the flights, in the order of the study; names are unique.
        provenance: text facts about the whole sweep.
    """

    study: str
    records: tuple[FlightRecord, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that names are unique."""
        names = [record.name for record in self.records]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"sweep '{self.study}' has flights of the same name: {', '.join(twice)}")
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the constructor: what arrives in another process is checked and read-only too."""
        return _rebuilt(self)

    def __getitem__(self, name: str) -> FlightRecord:
        for record in self.records:
            if record.name == name:
                return record
        raise InputError(
            f"no flight '{name}' in sweep '{self.study}'",
            hint=f"flights: {', '.join(record.name for record in self.records)}",
        )

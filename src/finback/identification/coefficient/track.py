"""What an estimator of coefficients sees of a record: outputs, inputs, air and thrust at uniform times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from finback.arrays import FloatArray, frozen_array
from finback.channels import SURFACES
from finback.errors import InputError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.atmosphere import density_ratio
from finback.identification.stretch import split_at_gaps, uniform_interval
from finback.identification.term import ALPHA, ELEVATOR, Q
from finback.records import FlightRecord, Hold
from finback.units import quantity_of

SPEED_CHANNEL: Final = "airspeed_m_s"
THETA: Final = "theta_rad"
STATES: Final = (SPEED_CHANNEL, ALPHA, THETA, Q)
"""The order of the states everywhere: V in m/s, α in rad, θ in rad, q in rad/s."""
OUTPUTS: Final = (*STATES, "q_dot_rad_s2", "ax_m_s2", "az_m_s2")
"""What may be measured of the motion, in order."""
_NEEDED: Final = (SPEED_CHANNEL, ALPHA, Q, ELEVATOR)
_FEWEST: Final = 20
"""Samples of a stretch."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """Uniform samples without a gap.

    Attributes:
        flight: the record's name.
        start_s: time of the first sample, in s.
        interval_s: time between samples, in s.
        outputs: which of ``OUTPUTS`` are measured, in that order.
        measured: these, in SI, shape (n, outputs).
        states: V, α, θ and q as measured, shape (n, 4); θ from q where it is not measured, level at the start.
        input_names: the elevator, then further inputs.
        inputs: these at the samples, in SI, shape (n, inputs).
        hold: how surfaces moved between samples.
        density_kg_m3: of the air, shape (n,).
        thrust_n: along its line, shape (n,).
        gravity_m_s2: g.
    """

    flight: str
    start_s: float
    interval_s: float
    outputs: tuple[str, ...]
    measured: FloatArray
    states: FloatArray
    input_names: tuple[str, ...]
    inputs: FloatArray
    hold: Hold
    density_kg_m3: FloatArray
    thrust_n: FloatArray
    gravity_m_s2: float

    def __len__(self) -> int:
        return int(self.density_kg_m3.size)

    @property
    def end_s(self) -> float:
        """Time of the last sample, in s."""
        return self.start_s + (len(self) - 1) * self.interval_s

    @property
    def held(self) -> NDArray[np.bool_]:
        """Whether each input is held from each sample to the next, shape (inputs,)."""
        return np.array([self.hold is Hold.ZOH and name in SURFACES for name in self.input_names])

    @property
    def inputs_before(self) -> FloatArray:
        """The inputs just before each sample: where one is held, its value at the sample before."""
        before = np.vstack([self.inputs[:1], self.inputs[:-1]])
        return np.where(self.held, before, self.inputs)

    def column(self, name: str) -> FloatArray:
        """Return one of the measured outputs, shape (n,)."""
        column: FloatArray = self.measured[:, self.outputs.index(name)]
        return column


def common_outputs(records: Sequence[FlightRecord]) -> tuple[str, ...]:
    """Return which outputs all records hold, as far as they hold numbers."""
    return tuple(
        name
        for name in OUTPUTS
        if all(name in record.columns and np.isfinite(record[name]).any() for record in records)
    )


def tracks(
    record: FlightRecord,
    airframe: Airframe,
    *,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    shortest_s: float,
) -> tuple[Track, ...]:
    """Return the stretches of a record without a gap, at least so long; none if there are none.

    Samples with a value that is not finite count as missing. Air density is the column ``density_kg_m3``; without it
    that of the condition, which follows ``altitude_m`` as the standard atmosphere does. Thrust is ``thrust_n``, or that
    of the airframe.

    Raises:
        InputError: a column that is needed is not there, samples are not uniform in time, or the airspeed is not > 0.
    """
    missing = [name for name in (*_NEEDED, *outputs, *inputs) if name not in record.columns]
    if missing:
        raise InputError(
            f"flight '{record.name}' has no {', '.join(dict.fromkeys(missing))}",
            hint="coefficients need airspeed, alpha, q and the elevator; leave out other outputs and inputs",
        )
    names = tuple(dict.fromkeys(("time_s", *_NEEDED, *outputs, *inputs, *_known(record))))
    rows = np.column_stack([record[name] for name in names])
    rows = rows[np.isfinite(rows).all(axis=1)]
    found = []
    for run in split_at_gaps(rows):
        if len(run) < _FEWEST or run[-1, 0] - run[0, 0] < shortest_s:
            continue
        interval = uniform_interval(record.name, run[:, 0])
        columns = dict(zip(names, run.T, strict=True))
        _check_values(record.name, columns)
        found.append(_track(record, airframe, columns, interval, outputs, inputs))
    return tuple(found)


def _known(record: FlightRecord) -> tuple[str, ...]:
    return tuple(name for name in (THETA, "density_kg_m3", "altitude_m", "thrust_n") if name in record.columns)


def _check_values(flight: str, columns: dict[str, FloatArray]) -> None:
    if not columns[SPEED_CHANNEL].min() > 0.0:
        raise InputError(
            f"flight '{flight}': the airspeed falls to {columns[SPEED_CHANNEL].min():.4g} m/s",
            hint="coefficients need a true airspeed > 0 throughout; leave out what stands on the ground",
        )
    for name in (ALPHA, THETA):
        if name in columns and np.abs(columns[name]).max() > math.pi:
            raise InputError(f"flight '{flight}': {quantity_of(name)} leaves ±180 deg", hint="is it in radians?")


def _track(
    record: FlightRecord,
    airframe: Airframe,
    columns: dict[str, FloatArray],
    interval: float,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
) -> Track:
    time, condition = columns["time_s"], record.condition
    if THETA in columns:
        theta = columns[THETA]
    else:
        theta = columns[ALPHA][0] + cumulative_simpson(columns[Q], dx=interval, initial=0.0)
    if "density_kg_m3" in columns:
        density = columns["density_kg_m3"]
    elif "altitude_m" in columns:
        density = condition.density_kg_m3 * density_ratio(columns["altitude_m"], condition.altitude_m)
    else:
        density = np.full(time.size, condition.density_kg_m3)
    return Track(
        flight=record.name,
        start_s=float(time[0]),
        interval_s=interval,
        outputs=outputs,
        measured=frozen_array(np.column_stack([columns[name] for name in outputs])),
        states=frozen_array(np.column_stack([columns[SPEED_CHANNEL], columns[ALPHA], theta, columns[Q]])),
        input_names=inputs,
        inputs=frozen_array(np.column_stack([columns[name] for name in inputs])),
        hold=record.hold,
        density_kg_m3=frozen_array(density),
        thrust_n=frozen_array(columns.get("thrust_n", np.full(time.size, airframe.thrust_n))),
        gravity_m_s2=condition.gravity_m_s2,
    )

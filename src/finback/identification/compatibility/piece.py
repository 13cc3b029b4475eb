"""One uniform piece of a record as the flight path sees it: what drives the motion, what is compared, what is noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from finback.arrays import FloatArray, IntArray
from finback.identification.compatibility.fault import FLOW, FORCES, RATES, Fault, Kind
from finback.identification.compatibility.flight_path import (
    STATES,
    FlightPath,
    Sideward,
    carried,
    flight_path,
    seen_late,
)
from finback.identification.noise import noise_deviation
from finback.records import FlightRecord

_DRIVES: Final = (*RATES, *FORCES)
_TURNING: Final = ("alpha_rad", "beta_rad", "phi_rad", "psi_rad")
"""Angles that come back after a full turn."""
_SLOPE_SAMPLES: Final = 7
"""Of the parabola that gives the derivative of a measured input: that of its noise would bend its delay."""
_FIRST: Final = 5
"""Samples whose median begins the motion."""
_STEEP_RAD: Final = 1.45
"""Beyond this pitch angle (83 deg) roll angle and heading turn fast and mean little."""
_START_SIZES: Final = (1.0, 1.0, 10.0, 100.0, 100.0, 100.0, 1e4, 3.0)
"""How far, in SI, a start may be from the first samples: rotation, velocity, height; and how fast the air rises."""
START: Final = len(_START_SIZES)
_STILL: Final = 1e-7
"""Noise that is taken where there is none, of the largest value: rounding of a step of the integration."""


_LEAST: Final = 1e-9  # SI, of a column that is zero throughout


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Uniform samples without a gap.

    Attributes:
        record: the samples, by channel; inputs have no missing ones, outputs may.
        interval_s: between samples.
        outputs: channels that are compared.
        translation: whether velocities are; else attitudes alone.
        sideward: whether the sideward velocity is integrated; else that of the measured sideslip, or 0, is taken.
        guess: phi, theta, psi, u, v, w at the start, shape (6,).
        process: variance of the noise of each input at a sample, shape (6,).
    """

    record: FlightRecord
    interval_s: float
    outputs: tuple[str, ...]
    translation: bool
    sideward: bool
    guess: FloatArray
    process: FloatArray

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples, shape (n,)."""
        return self.record["time_s"]

    @property
    def start_sizes(self) -> FloatArray:
        """How far each unknown of the start may be from the guess, 0 for what is no unknown, shape (8,)."""
        rolls = "phi_rad" in self.outputs or all(name in self.record.columns for name in ("p_rad_s", "r_rad_s"))
        height = "altitude_m" in self.outputs
        free = [rolls, True, "psi_rad" in self.outputs, self.translation, self.sideward, self.translation]
        return np.where([*free, height, height], _START_SIZES, 0.0)

    def output_noise(self) -> FloatArray:
        """Return the variance of the white part of each output's noise, shape (outputs,)."""
        return np.array([column_noise(self.record, name) ** 2 for name in self.outputs])


def input_noise(record: FlightRecord, *, translation: bool) -> FloatArray:
    """Return the variance of the noise of each input at a sample, shape (6,).

    What an instrument that is m times slower than the record got wrong stays so for m samples: integrated, that is as
    much as noise of m times its variance at every sample.

    Args:
        record: of which a slow instrument has NaN between its own samples.
        translation: whether forces are used.
    """
    names = _DRIVES if translation else RATES
    found = np.zeros(len(_DRIVES))
    for k, name in enumerate(names):
        if name in record.columns:
            found[k] = column_noise(record, name) ** 2 * own_rows(record[name])
    return found


def own_rows(values: FloatArray) -> int:
    """Return at which of how many rows a column has a sample of its own, mostly."""
    known = np.flatnonzero(np.isfinite(values))
    return int(np.median(np.diff(known))) if known.size > 1 else 1


def without_holes(record: FlightRecord) -> FlightRecord:
    """Return the record with the inputs of slow instruments interpolated between their own samples, not across gaps."""
    columns: dict[str, FloatArray] = {}
    for name in _DRIVES:
        if name not in record.columns or (every := own_rows(record[name])) < 2:
            continue
        time, values = record["time_s"], record[name]
        known = np.flatnonzero(np.isfinite(values))
        rows = np.arange(values.size)
        after = np.clip(np.searchsorted(known, rows), 0, known.size - 1)
        before = np.clip(np.searchsorted(known, rows, side="right") - 1, 0, known.size - 1)
        inside = (rows >= known[0]) & (rows <= known[-1]) & (known[after] - known[before] < 2 * every)
        columns[name] = np.where(inside, CubicSpline(time[known], values[known])(time), np.nan)
    return record.with_columns(**columns)


def column_noise(record: FlightRecord, name: str) -> float:
    """Return the deviation of the white noise of a column, at least that of its last digit; 0 if there is none."""
    if name not in record.columns:
        return 0.0
    values = record[name][np.isfinite(record[name])]
    if not values.size:
        return _LEAST
    if name in _TURNING:
        values = np.unwrap(values)
    changes = np.abs(np.diff(values))
    largest = float(np.abs(values).max())
    real = changes[changes > 1e-12 * max(largest, 1e-300)]
    digit = float(real.min()) if real.size else 0.0
    # The smallest change of smooth noise is next to nothing; that of rounded values is their digit.
    return max(noise_deviation([values]), digit / math.sqrt(12.0), _STILL * largest, _LEAST)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Implied:
    """What a piece should have measured.

    Attributes:
        path: the motion.
        residual: measured less implied, NaN where either is missing, shape (n, outputs); for the ends see ``compared``.
        slopes: derivative of the implied by the faults, then by the start, shape (n, outputs, faults + 8).
        output: derivative of the outputs by the errors of the motion, then by the velocity of the air along body axes,
            shape (n, outputs, 10).
    """

    path: FlightPath
    residual: FloatArray
    slopes: FloatArray
    output: FloatArray


def implied(piece: Piece, faults: tuple[Fault, ...], values: FloatArray, start: FloatArray) -> Implied:
    """Integrate the inputs without their faults, and put the faults of the outputs on.

    Args:
        piece: the samples.
        faults: what is estimated.
        values: their sizes in SI, shape (faults,).
        start: what is added to the guess, and how fast the air rises, shape (8,).
    """
    size = dict(zip(faults, values.tolist(), strict=True))
    middle = piece.time_s[:-1] + 0.5 * piece.interval_s
    drives = [_drive(piece, name, size) for name in _DRIVES]
    path = flight_path(
        np.column_stack([drive(piece.time_s) for drive in drives]),
        np.column_stack([drive(middle) for drive in drives]),
        interval_s=piece.interval_s,
        gravity_m_s2=piece.record.condition.gravity_m_s2,
        start=piece.guess + start[:6],
        sideward=_sideward(piece, middle),
    )
    drive, owner = _changes(piece, faults, size)
    errors = carried(path.transition, path.gain, drive, owner)
    own = [k for k, fault in enumerate(faults) if fault.channel in _DRIVES]
    residual = np.empty((len(piece.record), len(piece.outputs)))
    slopes = np.zeros((*residual.shape, len(faults) + START))
    output = np.zeros((*residual.shape, STATES))
    clock = piece.time_s - piece.time_s[0]
    for j, name in enumerate(piece.outputs):
        value, output[:, j] = _output(path, name)
        if name == "altitude_m":
            value += start[6] + start[7] * clock + _first(piece.record, name)
        slopes[:, j, own] = (output[:, j, np.newaxis] @ errors[:, :, : len(own)])[:, 0]
        slopes[:, j, len(faults) : -1] = (output[:, j, np.newaxis] @ _started(path, errors[:, :, len(own) :]))[:, 0]
        slopes[:, j, -1] = clock if name == "altitude_m" else 0.0
        residual[:, j] = _measured_less(piece, name, faults, size, value, slopes[:, j])
        output[:, j] = _when_written(piece, path, output[:, j], name, size)
    air = np.where(np.isin(piece.outputs, FLOW)[:, np.newaxis], output[:, :, 3:6], 0.0)
    return Implied(path=path, residual=residual, slopes=slopes, output=np.concatenate([output, air], axis=2))


def _started(path: FlightPath, errors: FloatArray) -> FloatArray:
    """Turn derivatives by a rotation about the body axes at the start into such by phi, theta, psi there."""
    phi, theta = path.attitude_rad[0, :2]
    turn = np.array(
        [
            [1.0, 0.0, -np.sin(theta)],
            [0.0, np.cos(phi), np.sin(phi) * np.cos(theta)],
            [0.0, -np.sin(phi), np.cos(phi) * np.cos(theta)],
        ]
    )
    return np.concatenate([errors[:, :, :3] @ turn, errors[:, :, 3:]], axis=2)


def _drive(piece: Piece, name: str, size: dict[Fault, float]) -> CubicSpline:
    """Return an input without its faults, as a function of time, held at the ends."""
    if name not in piece.record.columns or (name in FORCES and not piece.translation):
        return CubicSpline(piece.time_s[[0, -1]], np.zeros(2))
    bias, scale, delay = (size.get(Fault(channel=name, kind=kind), 0.0) for kind in Kind)
    late = np.clip(piece.time_s + delay, piece.time_s[0], piece.time_s[-1])
    values = piece.record[name] if delay == 0.0 else CubicSpline(piece.time_s, piece.record[name])(late)
    return CubicSpline(piece.time_s, (values - bias) / (1.0 + scale))


def _changes(piece: Piece, faults: tuple[Fault, ...], size: dict[Fault, float]) -> tuple[FloatArray, IntArray]:
    """Return how the inputs change with their faults, shape (n, faults of inputs), and which input each changes."""
    columns, owner = [], []
    for fault in faults:
        if fault.channel not in _DRIVES:
            continue
        scale = 1.0 + size.get(Fault(channel=fault.channel, kind=Kind.SCALE), 0.0)
        if fault.kind is Kind.BIAS:
            change = np.full(len(piece.record), -1.0 / scale)
        elif fault.kind is Kind.SCALE:
            change = -_drive(piece, fault.channel, size)(piece.time_s) / scale
        else:
            values = _drive(piece, fault.channel, size)(piece.time_s)
            change = savgol_filter(values, _SLOPE_SAMPLES, 2, deriv=1, delta=piece.interval_s)
        columns.append(change)
        owner.append(_DRIVES.index(fault.channel))
    drive = np.column_stack(columns) if columns else np.zeros((len(piece.record), 0))
    return np.ascontiguousarray(drive), np.array(owner, dtype=np.int64)


def _sideward(piece: Piece, middle: FloatArray) -> Sideward:
    """Return the sideward velocity: integrated, or that of the measured sideslip."""
    beta, speed = piece.record.or_zero("beta_rad"), piece.record.or_zero("airspeed_m_s")
    known = np.isfinite(beta) & np.isfinite(speed)
    if not piece.translation or not known.any():
        values = np.zeros(len(piece.record))
    else:
        values = np.interp(piece.time_s, piece.time_s[known], (speed * np.sin(beta))[known])
    return Sideward(free=piece.sideward, velocity_m_s=values, middles_m_s=np.interp(middle, piece.time_s, values))


def _output(path: FlightPath, name: str) -> tuple[FloatArray, FloatArray]:
    """Return an output of the motion, shape (n,), and its derivative by the errors, shape (n, 7)."""
    slope = np.zeros((len(path.height_m), STATES))
    u, v, w = path.velocity_m_s.T
    speed = np.sqrt(u * u + v * v + w * w)
    if name == "airspeed_m_s":
        slope[:, 3:6] = path.velocity_m_s / speed[:, np.newaxis]
        return speed, slope
    if name == "alpha_rad":
        slope[:, 3], slope[:, 5] = -w / (u * u + w * w), u / (u * u + w * w)
        return np.unwrap(np.arctan2(w, u)), slope
    if name == "beta_rad":
        sine = v / speed
        slope[:, 3:6] = -sine[:, np.newaxis] * path.velocity_m_s / speed[:, np.newaxis]
        slope[:, 4] += 1.0
        slope[:, 3:6] /= (speed * np.sqrt(1.0 - sine**2))[:, np.newaxis]
        return np.arcsin(sine), slope
    if name == "altitude_m":
        slope[:, 6] = 1.0
        return path.height_m.copy(), slope
    return _attitude(path, name), _attitude_slope(path, name, slope)


def _attitude(path: FlightPath, name: str) -> FloatArray:
    phi, theta, psi = path.attitude_rad.T
    if name == "theta_rad":
        return np.asarray(theta)
    return np.where(np.abs(theta) > _STEEP_RAD, np.nan, phi if name == "phi_rad" else psi)


def _attitude_slope(path: FlightPath, name: str, slope: FloatArray) -> FloatArray:
    """Fill in the derivative by a rotation about the body axes."""
    phi, theta, _ = path.attitude_rad.T
    across = np.column_stack([np.sin(phi), np.cos(phi)])
    if name == "theta_rad":
        slope[:, 1], slope[:, 2] = np.cos(phi), -np.sin(phi)
    elif name == "phi_rad":
        slope[:, 0] = 1.0
        slope[:, 1:3] = across * np.tan(theta)[:, np.newaxis]
    else:
        slope[:, 1:3] = across / np.cos(theta)[:, np.newaxis]
    return slope


def _measured_less(
    piece: Piece, name: str, faults: tuple[Fault, ...], size: dict[Fault, float], value: FloatArray, slopes: FloatArray
) -> FloatArray:
    """Return measured less implied, shape (n,), and let the slopes know of the output's own faults (in place)."""
    bias, scale, delay = (size.get(Fault(channel=name, kind=kind), 0.0) for kind in Kind)
    time = piece.time_s
    then = np.clip(time - delay, time[0], time[-1])
    known = np.isfinite(value)
    if known.sum() < _FIRST:
        return np.full(value.size, np.nan)
    spline = CubicSpline(time[known], value[known])
    late = np.where(np.interp(then, time, known.astype(np.float64)) < 1.0, np.nan, spline(then))
    if delay != 0.0:
        place = (then - time[0]) / piece.interval_s
        before = np.minimum(place.astype(np.int64), time.size - 2)
        share = (place - before)[:, np.newaxis]
        slopes[:] = (1.0 - share) * slopes[before] + share * slopes[before + 1]
    slopes *= 1.0 + scale
    for k, fault in enumerate(faults):
        if fault.channel == name:
            own = {Kind.BIAS: np.ones(1), Kind.SCALE: late, Kind.DELAY: -(1.0 + scale) * spline(then, 1)}[fault.kind]
            slopes[:, k] += own
    residual: FloatArray = piece.record[name] - ((1.0 + scale) * late + bias)
    return np.remainder(residual + np.pi, 2.0 * np.pi) - np.pi if name in _TURNING else residual


def _when_written(
    piece: Piece, path: FlightPath, output: FloatArray, name: str, size: dict[Fault, float]
) -> FloatArray:
    """Return the derivative of what is measured by the errors of the motion at the sample, shape (n, 7)."""
    scale, delay = (size.get(Fault(channel=name, kind=kind), 0.0) for kind in (Kind.SCALE, Kind.DELAY))
    if delay == 0.0:
        return np.asarray((1.0 + scale) * output)
    gravity = piece.record.condition.gravity_m_s2
    return (1.0 + scale) * seen_late(path, output, delay, interval_s=piece.interval_s, gravity=gravity)


def compared(piece: Piece, seen: Implied, edges_s: tuple[float, float]) -> FloatArray:
    """Return the residual, missing where less time has passed since the start, or is left, than some delay needs."""
    clock, slack = piece.time_s - piece.time_s[0], 0.5 * piece.interval_s
    inside = (clock >= edges_s[0] - slack) & (clock <= clock[-1] - edges_s[1] + slack)
    return np.where(inside[:, np.newaxis], seen.residual, np.nan)


def edges(faults: tuple[Fault, ...], values: FloatArray) -> tuple[float, float]:
    """Return how long after the start, and before the end, some delay asks for what is not in the record, in s."""
    delays = [(fault.channel in _DRIVES, value) for fault, value in zip(faults, values.tolist(), strict=True)
              if fault.kind is Kind.DELAY]  # fmt: skip
    # An output looks back by its delay; an input is looked up later by its own, and earlier by a negative one: what it
    # was before the record, the free start stands for from there on.
    after_start = max([0.0, *(-value if drives else value for drives, value in delays)])
    before_end = max([0.0, *(value if drives else -value for drives, value in delays)])
    return after_start, before_end


def _first(record: FlightRecord, name: str) -> float:
    """Return the median of the first few finite samples of a column; 0 if there is none."""
    values = record.or_zero(name)
    values = values[np.isfinite(values)][:_FIRST]
    return float(np.median(values)) if values.size else 0.0


def start_guess(record: FlightRecord, *, translation: bool) -> FloatArray:
    """Return phi, theta, psi in rad and u, v, w in m/s from the first samples, shape (6,).

    A pitch angle that is not recorded is that of steady flight: its gravity is what the accelerometer feels.
    """
    phi, theta, psi, alpha, beta = (
        _first(record, name) for name in ("phi_rad", "theta_rad", "psi_rad", "alpha_rad", "beta_rad")
    )
    if not translation:
        return np.array([phi, theta, psi, 0.0, 0.0, 0.0])
    gravity = record.condition.gravity_m_s2
    if "theta_rad" not in record.columns and gravity > 0.0:
        theta = float(np.arcsin(np.clip(_first(record, "ax_m_s2") / gravity, -0.99, 0.99)))
    speed = _first(record, "airspeed_m_s") or record.condition.airspeed_m_s
    along = speed * np.cos(beta)
    return np.array([phi, theta, psi, along * np.cos(alpha), speed * np.sin(beta), along * np.sin(alpha)])

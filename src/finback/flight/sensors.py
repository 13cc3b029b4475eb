"""What sensors make of a flight: position, lag, scale, bias, noise, sampling and quantization, seeded for each flight.

In that order: a vane ahead of the center of gravity feels the pitch rate; a first-order lag; scale and bias; at the
sensor's own samples noise is added, the value quantized and held until its next one. An angle that a record folds at
a turn passes a sensor unfolded, and is folded again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.channels import channel
from finback.errors import InputError
from finback.flight.plan import whole_steps
from finback.records import FlightRecord

_UNSENSED: Final = ("time_s", "alpha_dot_rad_s", "q_dot_rad_s2")  # no sensor gives the accelerations
_DROPPED: Final = _UNSENSED[1:]
_ALPHA: Final = "alpha_rad"
_TURN: Final = 2.0 * math.pi
_FOLDED: Final = {
    "psi_rad": (0.0, _TURN),
    "phi_rad": (-math.pi, math.pi),
    _ALPHA: (-math.pi, math.pi),
}
"""Angles that go around -> the turn that a record has of them."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Instrument:
    """The sensor of one channel; in the channel's SI unit.

    Attributes:
        channel: name of the channel, such as ``alpha_rad``.
        noise: standard deviation of white Gaussian noise, >= 0.
        bias: what it shows too much.
        scale: what it shows for one, apart from the bias.
        lag_s: time constant of a first-order lag, >= 0; 0 is none. It starts at rest.
        sample_interval_s: time between its own samples, a whole multiple of the record's; 0 for those of the record.
            It shows each until the next.
        resolution: its values are whole multiples of this; 0 is exact.
    """

    channel: str
    noise: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    lag_s: float = 0.0
    sample_interval_s: float = 0.0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        channel(self.channel)
        if self.channel in _UNSENSED:
            raise InputError(f"no sensor gives '{self.channel}'")
        for part in fields(self)[1:]:
            value = getattr(self, part.name)
            if not math.isfinite(value) or (part.name not in ("bias", "scale") and value < 0):
                raise InputError(f"sensor of '{self.channel}': {part.name} must be a number >= 0, got {value}")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """The sensors of a flight.

    Attributes:
        alpha_noise_rad: standard deviation of the white Gaussian noise of alpha, >= 0.
        q_noise_rad_s: the same for the pitch rate.
        instruments: what else is wrong with the sensor of a channel, one for a channel; noise of alpha and q stands
            above.
        vane_forward_m: how far ahead of the center of gravity alpha is measured.
    """

    alpha_noise_rad: float
    q_noise_rad_s: float
    instruments: tuple[Instrument, ...] = ()
    vane_forward_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse negative or non-finite noise, and two sensors of one channel."""
        for name, value in (("alpha_noise_rad", self.alpha_noise_rad), ("q_noise_rad_s", self.q_noise_rad_s)):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"sensors: {name} must be a number >= 0, got {value}")
        if not math.isfinite(self.vane_forward_m):
            raise InputError(f"sensors: vane_forward_m must be a finite number, got {self.vane_forward_m}")
        names = [instrument.channel for instrument in self.instruments]
        for name in {name for name in names if names.count(name) > 1}:
            raise InputError(f"sensors: '{name}' has two sensors")
        for instrument in self.instruments:
            if instrument.channel in self.noise and instrument.noise:
                raise InputError(f"sensors: the noise of '{instrument.channel}' is given twice")

    @property
    def noise(self) -> dict[str, float]:
        """Channels with noise of their own -> its standard deviation."""
        return {_ALPHA: self.alpha_noise_rad, "q_rad_s": self.q_noise_rad_s}


def measure(record: FlightRecord, sensors: Sensors, *, seed: int, index: int) -> FlightRecord:
    """Return what the sensors saw of a flight.

    Each sensor has noise of its own; the accelerations, which no sensor gives, are dropped.

    Args:
        record: a noise-free flight.
        sensors: what they do to it.
        seed: the study's seed, >= 0.
        index: the flight's number in its sweep, >= 0: same seed and index, same bits, whatever else was flown.

    Raises:
        InputError: a sensor samples at no multiple of the record's interval, or of a channel that was not recorded.
    """
    if seed < 0 or index < 0:
        raise InputError(f"seed and index must not be negative, got {seed} and {index}")
    random = np.random.default_rng(np.random.SeedSequence([seed, index]))
    rows = len(record)
    noise = {name: deviation * random.standard_normal(rows) for name, deviation in sensors.noise.items()}
    columns = {name: values for name, values in record.columns.items() if name not in _DROPPED}
    if sensors.vane_forward_m:
        columns[_ALPHA] = _at_vane(record, sensors.vane_forward_m)
    for instrument in sensors.instruments:
        name = instrument.channel
        if name not in columns:
            raise InputError(f"flight '{record.name}' has no '{name}' for its sensor to show")
        own = noise.pop(name) if name in noise else instrument.noise * _noise(seed, index, name, rows)
        columns[name] = _shown(instrument, columns[name], own, record)
    for name, added in noise.items():
        if name in columns:
            columns[name] = _folded(name, columns[name], columns[name] + added)
    provenance = {
        **record.provenance,
        "seed": str(seed),
        "index": str(index),
        "alpha_noise_rad": repr(float(sensors.alpha_noise_rad)),
        "q_noise_rad_s": repr(float(sensors.q_noise_rad_s)),
        **({"vane_forward_m": repr(float(sensors.vane_forward_m))} if sensors.vane_forward_m else {}),
        **{f"sensor_{instrument.channel}": str(instrument) for instrument in sensors.instruments},
    }
    return replace(record, columns=columns, provenance=provenance)


def _noise(seed: int, index: int, name: str, rows: int) -> FloatArray:
    """Return noise of a channel that no other channel's sensor changes."""
    return np.random.default_rng(np.random.SeedSequence([seed, index, *name.encode()])).standard_normal(rows)


def _at_vane(record: FlightRecord, forward_m: float) -> FloatArray:
    """Return alpha of the air that meets a point ahead of the center of gravity, which pitching moves up."""
    alpha = record[_ALPHA]
    speed = record.columns.get("airspeed_m_s", np.full(len(record), record.condition.airspeed_m_s))
    level = np.cos(record.columns.get("beta_rad", np.zeros(len(record))))
    down = np.sin(alpha) - record["q_rad_s"] * forward_m / (speed * level)
    return np.asarray(np.arctan2(down, np.cos(alpha)), dtype=np.float64)


def _shown(instrument: Instrument, values: FloatArray, noise: FloatArray, record: FlightRecord) -> FloatArray:
    time = record["time_s"]
    interval = float(time[1] - time[0]) if len(time) > 1 else 0.0
    recorded = values
    if instrument.lag_s and interval:
        goes_round = _is_folded(instrument.channel, values)
        values = _lagged(np.unwrap(values) if goes_round else values, instrument.lag_s, interval)
    values = _folded(instrument.channel, recorded, instrument.scale * values + instrument.bias + noise)
    if instrument.resolution:
        for _ in range(2):  # what is rounded up to a whole turn is nothing
            values = instrument.resolution * np.round(values / instrument.resolution)
            values = _folded(instrument.channel, recorded, values)
    if not instrument.sample_interval_s or not interval:
        return values
    what = f"flight '{record.name}': the sample interval of the sensor of '{instrument.channel}'"
    stride = whole_steps(instrument.sample_interval_s, interval, what=what)
    return values[np.arange(len(values)) // max(stride, 1) * max(stride, 1)]


def _is_folded(name: str, recorded: FloatArray) -> bool:
    """Return whether a record has an angle folded at a turn: none of it lies outside."""
    low, high = _FOLDED.get(name, (math.inf, -math.inf))
    return bool(((recorded >= low) & (recorded <= high)).all())


def _folded(name: str, recorded: FloatArray, values: FloatArray) -> FloatArray:
    """Return what a sensor shows of an angle, in the turn that the record has of it; inside, not a bit is changed."""
    if not _is_folded(name, recorded):
        return values
    low, high = _FOLDED[name]
    above, below = np.maximum(values - high, 0.0), np.minimum(values - low, 0.0)
    return np.asarray(values - _TURN * (np.ceil(above / _TURN) + np.floor(below / _TURN)), dtype=np.float64)


def _lagged(values: FloatArray, lag_s: float, interval_s: float) -> FloatArray:
    """Return the response of dy/dt = (x - y) / lag to straight lines between the samples, exact at them."""
    from scipy.signal import lfilter  # noqa: PLC0415 - most sensors have no lag, and it takes a while to import

    stays = math.exp(-interval_s / lag_s)
    mean = (1.0 - stays) * lag_s / interval_s
    # y[k+1] = stays y[k] + (mean - stays) x[k] + (1 - mean) x[k+1], from rest
    before = np.array([values[0] - (1.0 - mean) * values[0]])
    found = lfilter([1.0 - mean, mean - stays], [1.0, -stays], values, zi=before)[0]
    return np.asarray(found, dtype=np.float64)

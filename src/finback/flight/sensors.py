"""What sensors make of a flight: white noise, seeded for each flight apart."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.errors import InputError
from finback.records import FlightRecord

_UNSENSED: Final = ("alpha_dot_rad_s", "q_dot_rad_s2")  # no sensor gives them


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """The sensors of a flight.

    Attributes:
        alpha_noise_rad: standard deviation of the white Gaussian noise of alpha, >= 0.
        q_noise_rad_s: the same for the pitch rate.
    """

    alpha_noise_rad: float
    q_noise_rad_s: float

    def __post_init__(self) -> None:
        """Refuse negative or non-finite noise."""
        for name, value in (("alpha_noise_rad", self.alpha_noise_rad), ("q_noise_rad_s", self.q_noise_rad_s)):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"sensors: {name} must be a number >= 0, got {value}")


def measure(record: FlightRecord, sensors: Sensors, *, seed: int, index: int) -> FlightRecord:
    """Return what the sensors saw of a flight.

    Alpha and q get noise of their own; the accelerations, which no sensor gives, are dropped.

    Args:
        record: a noise-free flight.
        sensors: standard deviations.
        seed: the study's seed, >= 0.
        index: the flight's number in its sweep, >= 0: same seed and index, same bits, whatever else was flown.
    """
    if seed < 0 or index < 0:
        raise InputError(f"seed and index must not be negative, got {seed} and {index}")
    random = np.random.default_rng(np.random.SeedSequence([seed, index]))
    rows = len(record)
    noise = {
        "alpha_rad": sensors.alpha_noise_rad * random.standard_normal(rows),
        "q_rad_s": sensors.q_noise_rad_s * random.standard_normal(rows),
    }
    columns = {
        name: values + noise[name] if name in noise else values
        for name, values in record.columns.items()
        if name not in _UNSENSED
    }
    provenance = {
        **record.provenance,
        "seed": str(seed),
        "index": str(index),
        "alpha_noise_rad": repr(float(sensors.alpha_noise_rad)),
        "q_noise_rad_s": repr(float(sensors.q_noise_rad_s)),
    }
    return replace(record, columns=columns, provenance=provenance)

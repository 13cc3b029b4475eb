"""The plan of a campaign: what varies, what is kept, and every flight's values as a function of its number."""

from __future__ import annotations

import hashlib
import math
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final, get_args

import numpy as np

from finback.channels import channel
from finback.errors import InputError
from finback.flight.aircraft import Aircraft
from finback.flight.campaign.fidelity import MANEUVERS, check_numbers, check_recorded
from finback.flight.campaign.spread import Fixed, Grid, Spread, extremes
from finback.flight.oscillation import Oscillation
from finback.flight.pilot import ON_GRID
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.records import Condition

DEFAULT_CHANNELS: Final = (
    "alpha_rad",
    "q_rad_s",
    "elevator_rad",
    "theta_rad",
    "airspeed_m_s",
    "altitude_m",
    "alpha_dot_rad_s",
    "q_dot_rad_s2",
)
"""What a history holds beside the time, if the study does not say."""
DEFAULT_DEPARTURES: Final = 1000
"""Departed flights beyond the sample whose histories are kept, at most, if the study does not say."""
DEFAULT_RECORDINGS: Final = 50
"""Flights of which a recording is made, at most, if the study does not say."""
DEFAULT_PARTITION: Final = 1000
"""Flights of a partition, if the study does not say."""
MAXIMUM_FLIGHTS: Final = 10_000_000
"""More flights than this are taken for a mistake: half a year of one core at 0.7 s each."""

_CHUNK_STEPS: Final = 60_000  # integration steps that a worker flies between two answers: a fifth of a second or so
_LARGEST_CHUNK: Final = 50  # flights
_CORNERS: Final = 11  # of the elevator of a maneuver that does not oscillate: one, and two for each movement


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """Which time histories a campaign keeps.

    Attributes:
        channels: the columns beside ``time_s``.
        every: of the flights, the sample: the first and each ``every``-th after it; 0 for no sample.
        departures: of the flights beyond the sample that departed or diverged, so many at most, the first ones.
        recordings: of the flights whose history is kept, so many at most leave a recording for the viewer; departures
            come before the sample.
    """

    channels: tuple[str, ...] = DEFAULT_CHANNELS
    every: int = 1
    departures: int = 0
    recordings: int = 0

    def __post_init__(self) -> None:
        """Check the names."""
        for name in self.channels:
            channel(name)
        if "time_s" in self.channels or len(set(self.channels)) < len(self.channels) or not self.channels:
            raise InputError(
                f"history: each channel once, and without time_s, which is always there; got {', '.join(self.channels)}"
            )
        if self.every < 0:
            raise InputError(f"history: every must be a number of flights or 0, got {self.every}")
        if self.departures < 0 or self.recordings < 0:
            raise InputError(
                f"history: departures and recordings must not be negative, got {self.departures} and {self.recordings}"
            )

    def keeps(self, index: int) -> bool:
        """Return whether a flight is of the sample: its history is kept however it ends."""
        return bool(self.every) and index % self.every == 0

    def sample(self, flights: int) -> int:
        """Return how many of so many flights are of the sample."""
        return -(-flights // self.every) if self.every else 0

    def departed(self, flights: int) -> int:
        """Return how many of so many flights beyond the sample leave a history at most, because they departed."""
        return min(self.departures, flights - self.sample(flights))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Varied:
    """A number of a flight, and how it varies.

    Attributes:
        name: a field of the maneuver, such as ``elevator_rad``, or what else the fidelity has (``fidelity``); it
            tells the unit, an SI one.
        spread: how it varies.
    """

    name: str
    spread: Spread


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What distinguishes one flight of a campaign.

    Attributes:
        index: its number, from 0.
        name: kind and number.
        fidelity: what moves.
        values: of ``Campaign.varied``, in its order.
    """

    index: int
    name: str
    fidelity: str
    values: tuple[float, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Very many flights: everything that any of them depends on.

    The flights run over all combinations of the grids (the fidelities vary fastest, then the last grid), again for
    each draw of the other numbers: a draw is the same at every place of the grids, so that these can be compared.

    Attributes:
        study: the study's name.
        aircraft: what is flown.
        condition: the reference flight.
        options: steps, samples and limits; its fidelity is not used.
        sensors: noise of what histories hold.
        seed: of all draws and noise, >= 0.
        kind: of the maneuver.
        varied: every number of the maneuver, in the order of its fields, then any others.
        fidelities: one, or several as a grid.
        draws: how often the grids are run through, > 0.
        partition_flights: flights that are written, and announced as written, together.
        history: what is kept beside the summaries.
    """

    study: str
    aircraft: Aircraft
    condition: Condition
    options: FlightOptions
    sensors: Sensors
    seed: int
    kind: str
    varied: tuple[Varied, ...]
    fidelities: tuple[str, ...] = ("rig",)
    draws: int = 1
    partition_flights: int = DEFAULT_PARTITION
    history: History = History()

    def __post_init__(self) -> None:
        """Check that every flight has all it needs."""
        check_numbers(self.kind, self.names, self.fidelities)
        if not self.fidelities or len(set(self.fidelities)) < len(self.fidelities):
            raise InputError("campaign: each fidelity once, and at least one")
        check_recorded(self.history.channels, self.fidelities)
        for fidelity in self.fidelities:  # each has all sensors
            check_recorded([instrument.channel for instrument in self.sensors.instruments], (fidelity,))
        if self.seed < 0 or self.draws < 1 or self.partition_flights < 1:
            raise InputError("campaign: seed must not be negative, draws and partition_flights must be positive")
        if self.flights > MAXIMUM_FLIGHTS:
            raise InputError(f"campaign: it has {self.flights:.3g} flights, more than {MAXIMUM_FLIGHTS}")

    @property
    def _grid(self) -> int:
        sizes = (len(item.spread.values) for item in self.varied if isinstance(item.spread, Grid))
        return len(self.fidelities) * math.prod(sizes)

    @property
    def flights(self) -> int:
        """How many flights there are."""
        return self._grid * self.draws

    @property
    def names(self) -> tuple[str, ...]:
        """The names of a sample's values."""
        return tuple(item.name for item in self.varied)

    def sample(self, index: int) -> Sample:
        """Return what flight ``index`` (from 0) is given; the same whoever asks, and whatever flew before."""
        if not 0 <= index < self.flights:
            raise InputError(f"campaign: there is no flight {index} of {self.flights}")
        draw, place = divmod(index, self._grid)
        place, chosen = divmod(place, len(self.fidelities))
        values: list[float] = []
        for item in reversed(self.varied):
            match item.spread:
                case Fixed(value=value):
                    values.append(value)
                case Grid(values=options):
                    place, option = divmod(place, len(options))
                    values.append(options[option])
                case drawn:
                    values.append(drawn.at(self._uniform(item.name, draw)))
        return Sample(
            index=index,
            name=f"{self.kind}-{index:07d}",
            fidelity=self.fidelities[chosen],
            values=tuple(reversed(values)),
        )

    def _uniform(self, name: str, draw: int) -> float:
        """Return the uniform number of a draw; each name has a stream of its own, so more names change no other."""
        sequence = np.random.SeedSequence([self.seed, draw, zlib.crc32(name.encode())])
        return float(np.random.default_rng(sequence).random())

    @property
    def longest_s(self) -> float:
        """The duration of the longest flight, in s."""
        return max(limit for item in self.varied if item.name == "duration_s" for limit in extremes(item.spread))

    @property
    def chunk_flights(self) -> int:
        """Flights that a worker flies between two answers; chunks end where partitions end."""
        steps = max(1.0, self.longest_s / self.options.step_s)
        return max(1, min(_LARGEST_CHUNK, self.partition_flights, int(_CHUNK_STEPS / steps)))

    @property
    def partitions(self) -> int:
        """How many partitions there are."""
        return -(-self.flights // self.partition_flights)

    @property
    def histories(self) -> int:
        """How many flights leave a time history at most."""
        return self.history.sample(self.flights) + self.history.departed(self.flights)

    @property
    def most_rows(self) -> int:
        """Rows of the longest time history."""
        return math.floor(self.longest_s / self.options.sample_interval_s + ON_GRID) + 1

    @property
    def most_corners(self) -> int:
        """Corners of an elevator's schedule, at most; one that oscillates has a corner at every sample, and a lead."""
        return self.most_rows + 2 if MANEUVERS[self.kind] in get_args(Oscillation) else _CORNERS

    @property
    def sha256(self) -> str:
        """Fingerprint of the plan: all of it but the place where the aircraft lies."""
        placeless = replace(self, aircraft=replace(self.aircraft, path=Path()))
        return hashlib.sha256(repr(placeless).encode()).hexdigest()

"""One process's part of a campaign: a vehicle for each fidelity, kept between flights, and what a flight leaves."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Final, Self, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import AircraftError, FinbackError
from finback.flight.aircraft import fingerprint
from finback.flight.campaign.assignment import maneuver_of, plan_of, schedule_of
from finback.flight.campaign.plan import Campaign, Sample
from finback.flight.excitation import Maneuver, Release
from finback.flight.plan import FlightPlan
from finback.flight.sensors import measure
from finback.flight.vehicle import Vehicle, make_vehicle
from finback.records import FlightRecord, Hold, Outcome, Schedule

REFUSED: Final = "refused"
"""Outcome of a flight that could not begin, or that the simulator refused; its note says why."""
MEASURES: Final = (
    "duration_s",
    "alpha_start_rad",
    "q_start_rad_s",
    "alpha_end_rad",
    "q_end_rad_s",
    "alpha_min_rad",
    "alpha_max_rad",
    "q_min_rad_s",
    "q_max_rad_s",
)
"""What a summary says of a flight, without sensor noise; start and end are its first and last sample."""
NOTE_BYTES: Final = 240
"""Of a note, in UTF-8; a longer one is cut."""

_TRIMS: Final = 4096  # remembered; a campaign with more elevators finds some again
_NOTHING: Final = Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What a flight of a campaign leaves.

    Attributes:
        sample: what it was given.
        outcome: how it ended: a word of ``Outcome``, or ``refused``.
        note: the same in a sentence.
        measures: of ``MEASURES``, in its order; all NaN if it was refused.
        schedule: the elevator that was asked for.
        hold: how the elevator moved between the samples of a history; ``foh`` if it was refused.
        history: channel name -> values, ``time_s`` among them; empty if none may be kept.
    """

    sample: Sample
    outcome: str
    note: str
    measures: tuple[float, ...]
    schedule: Schedule
    hold: Hold = Hold.FOH
    history: Mapping[str, FloatArray] = field(default_factory=dict)


@final
class Crew:
    """Flies a campaign's flights in this process; a context manager.

    A vehicle that JSBSim failed in is made anew, so that no flight depends on those before it.

    Args:
        campaign: the plan.

    Raises:
        AircraftError: the aircraft does not load, or is not the campaign's.
    """

    def __init__(self, campaign: Campaign) -> None:
        found = fingerprint(campaign.aircraft.path.parent)
        if found != campaign.aircraft.sha256:
            raise AircraftError(
                f"{campaign.aircraft.path} is not the campaign's aircraft: its files have changed",
                hint="put the files back, or begin a new campaign",
            )
        self.campaign = campaign
        self._vehicles: dict[str, tuple[ExitStack, Vehicle]] = {}
        self._trims: OrderedDict[tuple[str, float], tuple[float, float] | FinbackError] = OrderedDict()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for fidelity in tuple(self._vehicles):
            self.retire(fidelity)

    @property
    def provenance(self) -> dict[str, dict[str, str]]:
        """Fidelity -> what is flown in it; makes all vehicles."""
        return {fidelity: dict(self.vehicle(fidelity).provenance) for fidelity in self.campaign.fidelities}

    def fly(self, index: int) -> Flown:
        """Fly one flight; whatever becomes of it is data."""
        sample = self.campaign.sample(index)
        schedule = _NOTHING
        try:
            maneuver = maneuver_of(self.campaign, sample)
            schedule = schedule_of(self.campaign, maneuver)
            record = self.vehicle(sample.fidelity).fly(self._plan(sample, maneuver, schedule))
        except FinbackError as error:
            if isinstance(error, AircraftError):  # JSBSim's object is of no further use
                self.retire(sample.fidelity)
            note = _placeless(error)
            return Flown(
                sample=sample, outcome=REFUSED, note=note, measures=(math.nan,) * len(MEASURES), schedule=schedule
            )
        return Flown(
            sample=sample,
            outcome=record.outcome.value,
            note=_cut(record.note),
            measures=_measures(record),
            schedule=schedule,
            hold=record.hold,
            history=self._history(record, index) if self._wanted(record, index) else {},
        )

    def _wanted(self, record: FlightRecord, index: int) -> bool:
        """Return whether a flight's history goes to the owner, who counts the departures and keeps the first ones."""
        history = self.campaign.history
        return history.keeps(index) or (history.departures > 0 and record.outcome is not Outcome.COMPLETED)

    def plan(self, index: int) -> FlightPlan:
        """Return the plan of a flight.

        Raises:
            FinbackError: it cannot be flown; ``fly`` makes that data.
        """
        sample = self.campaign.sample(index)
        maneuver = maneuver_of(self.campaign, sample)
        return self._plan(sample, maneuver, schedule_of(self.campaign, maneuver))

    def _plan(self, sample: Sample, maneuver: Maneuver, schedule: Schedule) -> FlightPlan:
        alpha, q = self._start(maneuver, sample.fidelity, self.vehicle(sample.fidelity))
        return plan_of(self.campaign, sample, maneuver, schedule, alpha_rad=alpha, q_rad_s=q)

    def vehicle(self, fidelity: str) -> Vehicle:
        """Return the open vehicle of a fidelity; it is made once."""
        if fidelity not in self._vehicles:
            stack = ExitStack()
            options = replace(self.campaign.options, fidelity=fidelity)
            made = make_vehicle(self.campaign.aircraft, self.campaign.condition, options)
            self._vehicles[fidelity] = (stack, stack.enter_context(made))
        return self._vehicles[fidelity][1]

    def retire(self, fidelity: str) -> None:
        """Close the vehicle of a fidelity, if there is one; the next flight makes another."""
        if fidelity in self._vehicles:
            self._vehicles.pop(fidelity)[0].close()

    def _start(self, maneuver: Maneuver, fidelity: str, vehicle: Vehicle) -> tuple[float, float]:
        """Return alpha and q of the start."""
        if isinstance(maneuver, Release):
            return maneuver.alpha_rad, maneuver.q_rad_s
        return self._trim(fidelity, maneuver.elevator_rad, vehicle.derivatives)

    def _trim(
        self, fidelity: str, elevator_rad: float, derivatives: Callable[[float, float, float], tuple[float, float]]
    ) -> tuple[float, float]:
        """Return (alpha, q) of the trim, found once; the oldest ones are forgotten, so that memory stays flat."""
        from finback.flight.equilibrium import trim  # noqa: PLC0415 - half a second that releases do not need

        key = (fidelity, elevator_rad)
        if key not in self._trims:
            found: tuple[float, float] | FinbackError
            try:
                point = trim(
                    derivatives, elevator_rad=elevator_rad, alpha_limits_rad=self.campaign.options.alpha_limits_rad
                )
                found = (point.alpha_rad, point.q_rad_s)
            except FinbackError as error:
                found = error
            self._trims[key] = found
            if len(self._trims) > _TRIMS:
                self._trims.popitem(last=False)
        known = self._trims[key]
        if isinstance(known, FinbackError):
            raise known
        return known

    def record(self, index: int) -> FlightRecord:
        """Return a flight with all its columns, as its history has those that are kept.

        Raises:
            FinbackError: it cannot be flown; ``fly`` makes that data.
        """
        sample = self.campaign.sample(index)
        return self._seen(self.vehicle(sample.fidelity).fly(self.plan(index)), index)

    def _seen(self, record: FlightRecord, index: int) -> FlightRecord:
        """Return what the sensors saw; accelerations, which no sensor gives, as they were."""
        seen = measure(record, self.campaign.sensors, seed=self.campaign.seed, index=index)
        return seen.with_columns(
            **{name: values for name, values in record.columns.items() if name not in seen.columns}
        )

    def _history(self, record: FlightRecord, index: int) -> dict[str, FloatArray]:
        """Return the channels kept, those that the flight has."""
        columns = self._seen(record, index).columns
        return {name: columns[name] for name in ("time_s", *self.campaign.history.channels) if name in columns}


def _measures(record: FlightRecord) -> tuple[float, ...]:
    alpha, q = record["alpha_rad"], record["q_rad_s"]
    ends = (alpha[0], q[0], alpha[-1], q[-1], alpha.min(), alpha.max(), q.min(), q.max())
    return (record.duration_s, *(float(value) for value in ends))


def _placeless(error: FinbackError) -> str:
    """Return the error in one line, without the folder of the moment: the same flight leaves the same bytes."""
    text = error.message.replace("\n", " ")
    words = [word.rsplit("/", maxsplit=1)[-1] if word.startswith("/") else word for word in text.split(" ")]
    return _cut(" ".join(words))


def _cut(note: str) -> str:
    """Return a note that is not longer than is promised."""
    content = note.encode()
    if len(content) <= NOTE_BYTES:
        return note
    return content[: NOTE_BYTES - len("…".encode())].decode(errors="ignore") + "…"

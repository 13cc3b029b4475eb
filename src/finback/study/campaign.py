"""The section ``[campaign]`` of a study: which numbers of very many flights vary, and how.

Wherever a maneuver takes a number, a campaign takes a number, a list (a grid), or a table that says how to draw it:
``{ uniform = [low, high] }``, ``{ normal = [mean, deviation], limits = [low, high] }``, ``{ choice = [...] }``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Final, Protocol, TypeVar, final

from finback.errors import FinbackError, InputError
from finback.flight.aircraft import Aircraft
from finback.flight.campaign.plan import (
    MANEUVERS,
    Campaign,
    History,
    Varied,
)
from finback.flight.campaign.spread import Choice, Fixed, Grid, Normal, Spread, Uniform, extremes
from finback.flight.excitation import Maneuver
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.records import Condition
from finback.study.campaign_tables import OTHERS, CampaignTable, HistoryTable
from finback.study.faults import nearest, show
from finback.study.tables import Table, known_fidelity
from finback.units import si_name, to_si, unit_of

T = TypeVar("T", bound=Table)
V = TypeVar("V")

_DRAWN: Final = ("uniform", "normal", "choice")
_PARTS: Final = ("maneuver", "loading", "start", "power", "air", "history")


class Reader(Protocol):
    """What reading a campaign needs of the study's reader: every method adds a fault where it gives none."""

    def fault(self, place: str, message: str) -> None:
        """Add a fault."""

    def parse(self, kind: type[T], value: object, place: str, others: tuple[str, ...] = ()) -> T | None:
        """Read one table."""

    def make(self, place: str, build: Callable[[], V]) -> V | None:
        """Build a value whose own checks may find what the checks here did not."""

    def combinations(self, table: object, place: str, flight: FlightOptions | None) -> list[Maneuver]:
        """Read a maneuver whose numbers are lists."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What a campaign takes of the rest of its study.

    Attributes:
        study: its name.
        aircraft: what is flown.
        condition: the reference flight.
        sensors: noise.
        seed: of all random numbers.
    """

    study: str
    aircraft: Aircraft
    condition: Condition
    sensors: Sensors
    seed: int


def read_campaign(
    reader: Reader, value: object, flight: FlightOptions | None, around: Surroundings | None
) -> Campaign | None:
    """Read the section ``[campaign]``, or add its faults.

    Args:
        reader: of the whole file.
        value: what stands there.
        flight: steps, samples and limits; None if these have faults.
        around: everything else; None if that has faults.
    """
    place = "campaign"
    if not isinstance(value, dict):
        reader.fault(place, f"must be a table [{place}], got {show(value)}")
        return None
    rest = {key: item for key, item in value.items() if key not in _PARTS}
    head = reader.parse(CampaignTable, rest, place, others=_PARTS)
    history, sampled = _history(reader, value.get("history", {}), flight)
    varied = _maneuver(reader, value.get("maneuver"), f"{place}.maneuver", sampled)
    for part, form in OTHERS.items():
        varied += _varied(reader, value.get(part, {}), f"{place}.{part}", form)
    fidelities = _fidelities(reader, head.fidelity if head else [], f"{place}.fidelity")
    if head is None or history is None or sampled is None or around is None or not varied:
        return None
    return reader.make(
        place,
        lambda: Campaign(
            study=around.study,
            aircraft=around.aircraft,
            condition=around.condition,
            options=sampled,
            sensors=around.sensors,
            seed=around.seed,
            kind=value["maneuver"]["kind"],
            varied=varied,
            fidelities=fidelities or (sampled.fidelity,),
            draws=head.draws,
            partition_flights=head.partition_flights,
            history=history,
        ),
    )


def _fidelities(reader: Reader, names: list[str], place: str) -> tuple[str, ...]:
    for number, name in enumerate(names):
        try:
            known_fidelity(name)
        except ValueError as error:
            reader.fault(f"{place}[{number}]", f"{error}, got {show(name)}")
    return tuple(names)


def _history(
    reader: Reader, value: object, flight: FlightOptions | None
) -> tuple[History | None, FlightOptions | None]:
    """Return what is kept, and the flight's options with its rate."""
    place = "campaign.history"
    table = reader.parse(HistoryTable, value, place)
    if table is None:
        return None, flight
    history = reader.make(
        f"{place}.channels",
        lambda: History(
            channels=tuple(table.channels),
            every=table.every,
            departures=table.departures,
            recordings=table.recordings,
        ),
    )
    if flight is None or not table.sample_hz:
        return history, flight
    interval = 1.0 / table.sample_hz[0]
    return history, reader.make(f"{place}.sample_hz", lambda: replace(flight, sample_interval_s=interval))


def _maneuver(reader: Reader, value: object, place: str, flight: FlightOptions | None) -> tuple[Varied, ...]:
    """Return the maneuver's numbers in the order of its fields; every corner of their ranges is tried."""
    if not isinstance(value, dict):
        reader.fault(
            place, f"missing; add a table [{place}]" if value is None else f"must be a table, got {show(value)}"
        )
        return ()
    spreads = _spreads(reader, {key: item for key, item in value.items() if key != "kind"}, place)
    if spreads is None:
        return ()
    corners = {key: list(extremes(spread)) for key, spread in spreads.items()}
    if not reader.combinations({"kind": value.get("kind"), **corners}, place, flight):
        return ()
    named = {_name_in_si(key): _in_si(spread, key) for key, spread in spreads.items()}
    return tuple(Varied(name=part.name, spread=named[part.name]) for part in fields(MANEUVERS[value["kind"]]))


def _varied(reader: Reader, value: object, place: str, form: type[Table]) -> tuple[Varied, ...]:
    """Return the numbers of an optional table, in its own order."""
    if not isinstance(value, dict):
        reader.fault(place, f"must be a table [{place}], got {show(value)}")
        return ()
    spreads = _spreads(reader, value, place)
    if (
        spreads is None
        or reader.parse(form, {key: list(extremes(item)) for key, item in spreads.items()}, place) is None
    ):
        return ()
    return tuple(Varied(name=_name_in_si(key), spread=_in_si(item, key)) for key, item in spreads.items())


def _spreads(reader: Reader, table: Mapping[str, object], place: str) -> dict[str, Spread] | None:
    """Return how each number of a table varies, in the units of the file."""
    found: dict[str, Spread] = {}
    for key, value in table.items():
        spread = _spread(reader, value, f"{place}.{key}")
        if spread is not None:
            found[key] = spread
    return found if len(found) == len(table) else None


def _spread(reader: Reader, value: object, place: str) -> Spread | None:
    if isinstance(value, dict):
        kinds = [key for key in value if key in _DRAWN]
        unknown = [key for key in value if key not in (*_DRAWN, "limits")]
        if unknown:
            reader.fault(f"{place}.{unknown[0]}", f"unknown key{nearest(unknown[0], [*_DRAWN, 'limits'])}")
            return None
        if len(kinds) != 1 or ("limits" in value and kinds != ["normal"]):
            reader.fault(place, "must have one of: uniform, normal (with limits, if any), choice")
            return None
        numbers = _numbers(reader, value[kinds[0]], f"{place}.{kinds[0]}")
        limits = _numbers(reader, value.get("limits", []), f"{place}.limits")
        if numbers is None or limits is None:
            return None
        return reader.make(place, partial(_drawn, kinds[0], numbers, limits))
    numbers = _numbers(reader, value if isinstance(value, list) else [value], place)
    if numbers is None:
        return None
    return reader.make(place, lambda: Grid(values=numbers) if isinstance(value, list) else Fixed(value=numbers[0]))


def _numbers(reader: Reader, value: object, place: str) -> tuple[float, ...] | None:
    if not isinstance(value, list):
        reader.fault(place, f"must be a list of numbers, got {show(value)}")
        return None
    for item in value:
        if isinstance(item, bool) or not isinstance(item, (int, float)):
            reader.fault(place, f"must be a number, got {show(item)}")
            return None
    return tuple(float(item) for item in value)


def _drawn(kind: str, numbers: tuple[float, ...], limits: tuple[float, ...]) -> Spread:
    """Build what is drawn, in the units of the file.

    Raises:
        InputError: the numbers are not as many as it needs, or out of order.
    """
    if kind == "choice":
        return Choice(values=numbers)
    pair = "[low, high]" if kind == "uniform" else "[mean, standard deviation]"
    if len(numbers) != 2 or len(limits) not in (0, 2):
        raise InputError(f"{kind}: needs {pair}, and limits, if any, [low, high]")
    if kind == "uniform":
        return Uniform(low=numbers[0], high=numbers[1])
    cut = {"low": limits[0], "high": limits[1]} if limits else {}
    return Normal(mean=numbers[0], standard_deviation=numbers[1], **cut)


def _name_in_si(key: str) -> str:
    """Return the key with its unit in SI; a ratio has none."""
    try:
        return si_name(key)
    except FinbackError:
        return key


def _in_si(spread: Spread, key: str) -> Spread:
    """Return a spread of the file in SI; every unit of the file is a factor, so that all its numbers scale alike."""
    try:
        unit = unit_of(key)
    except FinbackError:
        return spread
    match spread:
        case Fixed(value=value):
            return Fixed(value=to_si(value, unit))
        case Grid(values=values):
            return Grid(values=tuple(to_si(value, unit) for value in values))
        case Choice(values=values):
            return Choice(values=tuple(to_si(value, unit) for value in values))
        case Uniform(low=low, high=high):
            return Uniform(low=to_si(low, unit), high=to_si(high, unit))
        case Normal(mean=mean, standard_deviation=deviation, low=low, high=high):
            return Normal(
                mean=to_si(mean, unit),
                standard_deviation=to_si(deviation, unit),
                low=to_si(low, unit),
                high=to_si(high, unit),
            )

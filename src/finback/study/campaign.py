"""The section ``[campaign]`` of a study: which numbers of very many flights vary, and how (``spreads``)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import chain
from typing import Final, TypeVar, final

from finback.channels import CHANNELS, channel
from finback.errors import FinbackError
from finback.flight.aircraft import Aircraft
from finback.flight.campaign.fidelity import MANEUVERS, check_numbers, check_recorded
from finback.flight.campaign.plan import Campaign, History, Varied
from finback.flight.campaign.spread import Spread, extremes
from finback.flight.ending import RATE_LIMIT_RAD_S
from finback.flight.plan import FIDELITIES, FlightOptions
from finback.flight.sensors import Sensors
from finback.records import Condition
from finback.study.campaign_tables import OTHERS, CampaignTable, HistoryTable
from finback.study.faults import nearest, show
from finback.study.reading import Reader
from finback.study.spreads import in_range, name_in_si, read_spreads, spread_in_si, way_out
from finback.study.tables import KINDS, Table, as_list
from finback.units import from_si, quantity_of, to_si, unit_of

V = TypeVar("V")

_PARTS: Final = ("maneuver", "loading", "start", "power", "air", "history")


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
    """Read the section ``[campaign]``, or add all its faults.

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
    fidelities = _fidelities(reader, rest.get("fidelity", []), f"{place}.fidelity")
    if not fidelities and flight is not None:
        fidelities = (flight.fidelity,)
    varied = _maneuver(reader, value.get("maneuver"), f"{place}.maneuver", sampled)
    others = tuple(_varied(reader, value.get(part, {}), f"{place}.{part}", form) for part, form in OTHERS.items())
    if varied and _fit(reader, value["maneuver"]["kind"], (*varied, *chain.from_iterable(others)), fidelities):
        varied += tuple(chain.from_iterable(others))
    _recorded(reader, value.get("history"), fidelities, f"{place}.history")
    for instrument in around.sensors.instruments if around is not None else ():
        for fidelity in fidelities:
            known = partial(check_recorded, [instrument.channel], (fidelity,))
            reader.make(f"sensors.{quantity_of(instrument.channel)}", known)
    if reader.faults or head is None or history is None or sampled is None or around is None:
        return None
    return _make(
        reader,
        lambda: Campaign(
            study=around.study,
            aircraft=around.aircraft,
            condition=around.condition,
            options=sampled,
            sensors=around.sensors,
            seed=around.seed,
            kind=value["maneuver"]["kind"],
            varied=varied,
            fidelities=fidelities,
            draws=head.draws,
            partition_flights=head.partition_flights,
            history=history,
        ),
    )


def _make(reader: Reader, build: Callable[[], V]) -> V | None:
    """Build a part of the campaign, whose own errors name it already."""
    try:
        return build()
    except FinbackError as error:
        reader.fault("campaign", str(error).removeprefix("campaign: ").replace("\n  ", "; "))
        return None


def _fidelities(reader: Reader, value: object, place: str) -> tuple[str, ...]:
    """Return the known ones; what is no text was told before."""
    listed = as_list(value)
    found: list[str] = []
    for number, name in enumerate(listed if isinstance(listed, list) else []):
        if name in FIDELITIES:
            found.append(name)
        elif isinstance(name, str):
            where = f"{place}[{number}]" if isinstance(value, list) else place
            reader.fault(where, f"unknown fidelity{nearest(name, list(FIDELITIES))}")
    return tuple(found)


def _fit(reader: Reader, kind: str, varied: Sequence[Varied], fidelities: Sequence[str]) -> bool:
    """Check that the fidelities have these numbers."""

    def check() -> bool:
        check_numbers(kind, [item.name for item in varied], fidelities)
        return True

    return bool(_make(reader, check))


def _recorded(reader: Reader, table: object, fidelities: Sequence[str], place: str) -> None:
    """Check the channels of the histories one by one, also where the rest of their table has faults."""
    channels = table.get("channels") if isinstance(table, dict) else None

    def check(name: str) -> None:
        channel(name)
        check_recorded([name], fidelities)

    for number, name in enumerate(channels if isinstance(channels, list) else []):
        if isinstance(name, str):
            reader.make(f"{place}.channels[{number}]", partial(check, name))


def _history(
    reader: Reader, value: object, flight: FlightOptions | None
) -> tuple[History | None, FlightOptions | None]:
    """Return what is kept, and the flight's options with its rate."""
    place = "campaign.history"
    table = reader.parse(HistoryTable, value, place)
    if table is None:
        return None, flight
    if any(name not in CHANNELS for name in table.channels):  # told one by one
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
    kind = value.get("kind")
    given = {key: item for key, item in value.items() if key != "kind"}
    spreads = read_spreads(reader, given, place)
    if not isinstance(kind, str) or kind not in MANEUVERS:
        said = "missing" if kind is None else f"unknown kind {show(kind)}"
        reader.fault(f"{place}.kind", f"{said}{nearest(kind, list(MANEUVERS))}")
        return ()
    faulty = tuple(key for key in given if key not in spreads)
    good = in_range(reader, spreads, KINDS[kind][0], place, faulty=faulty)
    good = _inside(reader, spreads, place, flight) and good
    if faulty or not good:
        return ()
    corners = {key: list(extremes(spread)) for key, spread in spreads.items()}
    if not reader.combinations({"kind": kind, **corners}, place, flight):
        return ()
    named = {name_in_si(key): spread_in_si(spread, key) for key, spread in spreads.items()}
    return tuple(Varied(name=part.name, spread=named[part.name]) for part in fields(MANEUVERS[kind]))


def _inside(reader: Reader, spreads: Mapping[str, Spread], place: str, flight: FlightOptions | None) -> bool:
    """Check numbers against limits that stand elsewhere in the study; a flight that starts at them has left them."""
    if flight is None:
        return True
    turning = (-RATE_LIMIT_RAD_S, RATE_LIMIT_RAD_S)
    limits = {
        "alpha_deg": (flight.alpha_limits_rad, "flight.alpha_limits_deg"),
        "q_deg_s": (turning, "what counts as flying"),
        "elevator_deg": (flight.elevator_limits_rad, "flight.elevator_limits_deg"),
        "to_elevator_deg": (flight.elevator_limits_rad, "flight.elevator_limits_deg"),
    }
    good = True
    for key, ((low, high), name) in limits.items():
        if key not in spreads:
            continue
        unit, spread = unit_of(key), spreads[key]
        strict = not key.endswith("elevator_deg")
        for number in extremes(spread):
            angle = to_si(number, unit)
            if (low < angle < high) if strict else (low <= angle <= high):
                continue
            good = False
            shown = f"[{from_si(low, unit):.6g}, {from_si(high, unit):.6g}]"
            reader.fault(
                f"{place}.{key}",
                f"reaches {number:.6g} {unit.replace('_', '/')}, outside {name} = {shown}{way_out(spread)}",
            )
    return good


def _varied(reader: Reader, value: object, place: str, form: type[Table]) -> tuple[Varied, ...]:
    """Return the numbers of an optional table, in its own order."""
    if not isinstance(value, dict):
        reader.fault(place, f"must be a table [{place}], got {show(value)}")
        return ()
    spreads = read_spreads(reader, value, place)
    faulty = tuple(key for key in value if key not in spreads)
    if not in_range(reader, spreads, form, place, faulty=faulty) or faulty:
        return ()
    return tuple(Varied(name=name_in_si(key), spread=spread_in_si(item, key)) for key, item in spreads.items())

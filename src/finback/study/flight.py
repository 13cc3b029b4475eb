"""How flights are flown and measured: ``[flight]`` with drive, thrust and properties, ``[turbulence]``, ``[sensors]``.

Every table beyond the first keys is optional, and everything in it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field

from finback.channels import CHANNELS
from finback.flight.air import CALM, Air, DrydenAir
from finback.flight.plan import Drive, FlightOptions
from finback.flight.power import ENGINES_OFF, FixedThrust, Power, Throttle
from finback.flight.sensors import Instrument, Sensors
from finback.study.faults import nearest, show
from finback.study.reading import Reader
from finback.study.tables import FlightTable, Frequency, SensorsTable, Table, in_si
from finback.units import quantity_of, to_si, unit_of

_SENSED: Final = {
    quantity_of(name): name for name in CHANNELS if name not in ("time_s", "alpha_dot_rad_s", "q_dot_rad_s2")
}
"""Name of a sensor's table -> channel."""

_IN_FILE: Final = {"rad": "deg", "rad_s": "deg_s"}
"""SI unit of a channel -> the unit of its sensor's keys; others are as they are."""


def _known_drive(word: str) -> str:
    if word not in set(Drive):
        raise ValueError(f"must be one of: {', '.join(Drive)}")
    return word


class PowerTable(Table):
    """What drives the aircraft, in ``[flight]``: at most one of the two."""

    thrust_kn: Annotated[float, Field(ge=-1e4, le=1e4)] = 0.0
    throttle: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0


class DriveTable(Table):
    """What moves the surfaces, in ``[flight]``."""

    drive: Annotated[str, AfterValidator(_known_drive)] = str(Drive.OWN)


class TurbulenceTable(Table):
    """``[turbulence]``: Dryden gusts."""

    intensity_m_s: Annotated[float, Field(ge=0.0, le=100.0)]
    length_m: Annotated[float, Field(ge=1.0, le=1e5)]


class InstrumentTable(Table):
    """``[sensors.CHANNEL]`` without the keys whose unit is the channel's."""

    scale: Annotated[float, Field(ge=-100.0, le=100.0)] = 1.0
    lag_s: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    sample_hz: Frequency | None = None


class AmountTable(Table):
    """The keys of ``[sensors.CHANNEL]`` in the channel's unit, without it."""

    noise: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    bias: Annotated[float, Field(ge=-1e6, le=1e6)] = 0.0
    resolution: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0


def read_flight(reader: Reader, seed: int) -> FlightOptions | None:
    """Read ``[flight]`` and ``[turbulence]``; ``seed`` is the study's."""
    value = reader.root.get("flight")
    if not isinstance(value, dict):
        reader.table(FlightTable, "flight")
        return None
    own = (*PowerTable.model_fields, *DriveTable.model_fields, "properties")
    table = reader.parse(FlightTable, {key: value[key] for key in value if key not in own}, "flight", others=own)
    power = _power(reader, value)
    drive = reader.parse(DriveTable, _only(value, DriveTable), "flight")
    properties = _properties(reader, value.get("properties", {}))
    air = _air(reader, seed)
    if table is None or power is None or drive is None or air is None:
        return None
    if table.fidelity == "rig" and "campaign" not in reader.root:
        for key in (*PowerTable.model_fields, "properties"):
            if key in value:
                reader.fault(f"flight.{key}", "the rig has neither engines nor flight control; choose another fidelity")
    if table.fidelity != "free" and air != CALM:
        reader.fault("turbulence", f"needs flight.fidelity 'free', not '{table.fidelity}'")
    ratio = table.step_hz / table.sample_hz
    values = in_si(table)
    if ratio < 1 or not ratio.is_integer():
        if reader.sound("flight.step_hz", "flight.sample_hz"):
            place, rule = "flight.sample_hz", f"step_hz ({table.step_hz:g}) must be a whole multiple of it"
            reader.fault(place, f"{rule}, got {table.sample_hz:g}")
        values["sample_1_s"] = values["step_1_s"]  # for what else is checked
    rates = {
        f"{name}_s": 1.0 / values.pop(f"{key}_1_s") for name, key in (("step", "step"), ("sample_interval", "sample"))
    }
    own_way = Drive(drive.drive)
    return reader.make(
        "flight",
        lambda: FlightOptions(**values, **rates, drive=own_way, power=power, properties=properties, air=air),
    )


def read_sensors(reader: Reader, flight: FlightOptions | None) -> Sensors | None:
    """Read ``[sensors]`` and a table for each channel with a sensor of its own; sampling must fit the flight's."""
    value = reader.root.get("sensors")
    if not isinstance(value, dict):
        reader.table(SensorsTable, "sensors")
        return None
    channels = {key: item for key, item in value.items() if isinstance(item, dict)}
    rest = {key: item for key, item in value.items() if key not in channels}
    table = reader.parse(SensorsTable, rest, "sensors", others=tuple(_SENSED))
    found = [_instrument(reader, key, item, flight) for key, item in channels.items()]
    instruments = tuple(instrument for instrument in found if instrument is not None)
    if table is None:
        return None
    return reader.make("sensors", lambda: Sensors(**in_si(table), instruments=instruments))


def _only(value: Mapping[str, Any], table: type[Table]) -> dict[str, Any]:
    return {key: value[key] for key in table.model_fields if key in value}


def _power(reader: Reader, value: Mapping[str, Any]) -> Power | None:
    given = _only(value, PowerTable)
    table = reader.parse(PowerTable, given, "flight")
    if table is None:
        return None
    if len(given) > 1:
        reader.fault("flight.thrust_kn", "a fixed thrust and a throttle stand here; give one of them")
    if "thrust_kn" in given:
        return FixedThrust(thrust_n=to_si(table.thrust_kn, "kn"))
    return Throttle(setting=table.throttle) if "throttle" in given else ENGINES_OFF


def _properties(reader: Reader, value: object) -> tuple[tuple[str, float], ...]:
    """Read ``[flight.properties]``: JSBSim's own names, in its own units."""
    if not isinstance(value, dict):
        reader.fault("flight.properties", f"must be a table [flight.properties], got {show(value)}")
        return ()
    for name, number in value.items():
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) <= 1e12:
            reader.fault(f"flight.properties.'{name}'", f"must be a finite number, got {show(number)}")
            return ()
    return tuple((name, float(number)) for name, number in value.items())


def _air(reader: Reader, seed: int) -> Air | None:
    if "turbulence" not in reader.root:
        return CALM
    table = reader.table(TurbulenceTable, "turbulence")
    return None if table is None else DrydenAir(**in_si(table), seed=seed)


def _instrument(reader: Reader, key: str, value: dict[str, Any], flight: FlightOptions | None) -> Instrument | None:
    place = f"sensors.{key}"
    if key not in _SENSED:
        reader.fault(place, f"no sensor gives '{key}'{nearest(key, list(_SENSED))}")
        return None
    channel = _SENSED[key]
    unit = _IN_FILE.get(unit_of(channel), unit_of(channel))
    suffix = "" if unit == "1" else f"_{unit}"
    names = {f"{name}{suffix}": name for name in AmountTable.model_fields}
    amounts = reader.parse(
        AmountTable,
        {name: value[key] for key, name in names.items() if key in value},
        place,
    )
    rest = {key: item for key, item in value.items() if key not in names}
    table = reader.parse(InstrumentTable, rest, place, others=tuple(names))
    if amounts is None or table is None:
        return None
    interval = 0.0 if table.sample_hz is None else 1.0 / table.sample_hz
    if flight is not None and interval:
        ratio = interval / flight.sample_interval_s
        if abs(ratio - round(ratio)) > 1e-6 or ratio < 1 - 1e-6:
            reader.fault(
                f"{place}.sample_hz", f"flight.sample_hz must be a whole multiple of it, got {table.sample_hz:g}"
            )
            return None
    si = {name: to_si(amount, unit) for name, amount in amounts}
    return reader.make(
        place,
        lambda: Instrument(channel=channel, scale=table.scale, lag_s=table.lag_s, sample_interval_s=interval, **si),
    )

"""A flight in words, for the viewer's text panel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from finback.arrays import FloatArray
from finback.records import FlightRecord
from finback.units import from_si
from finback.views.drawable import drawable
from finback.views.labels import displayed, minus

_NOTE: Final = (
    "Angles are shown in degrees; `/state` holds the record itself, in SI. "
    "The position is integrated from airspeed and flight path, for the eye only."
)


def describe(record: FlightRecord, study: str) -> str:
    """Return outcome, maneuver, condition and provenance of a flight as Markdown."""
    condition = record.condition
    maneuver = {
        "flight": record.name,
        "study": study,
        "elevator": _elevator(from_si(record.schedule.elevator_rad, "deg")),
        "start": _start(record),
        "duration": f"{record.duration_s:.2f} s, {len(record)} samples",
    }
    reference = {
        "airspeed": f"{condition.airspeed_m_s:g} m/s",
        "density": f"{condition.density_kg_m3:g} kg/m³",
        "gravity": f"{condition.gravity_m_s2:g} m/s²",
        "altitude": f"{condition.altitude_m:g} m",
    }
    parts = [
        f"## {record.outcome.value}",
        minus(record.note),
        _table("maneuver", maneuver),
        _table("condition", reference),
        _table("provenance", record.provenance) if record.provenance else "",
        _NOTE,
    ]
    return "\n\n".join(part for part in parts if part)


def _elevator(asked_deg: FloatArray) -> str:
    first, low, high = asked_deg[0], asked_deg.min(), asked_deg.max()
    text = f"held at {first:.2f}°" if low == high else f"from {first:.2f}°, within {low:.2f}…{high:.2f}°"
    return minus(text)


def _start(record: FlightRecord) -> str:
    if not {"alpha_rad", "q_rad_s"} <= record.columns.keys():
        return "not recorded"
    if not drawable(record, "alpha_rad", "q_rad_s")[0]:
        return "not a number"
    alpha, q = (displayed(record[name][:1], name)[0] for name in ("alpha_rad", "q_rad_s"))
    return minus(f"α {alpha:.2f}°, q {q:.2f}°/s")


def _table(title: str, facts: Mapping[str, str]) -> str:
    rows = "\n".join(f"| {key} | {_cell(value)} |" for key, value in facts.items())
    return f"| {title} | |\n|---|---|\n{rows}"


def _cell(text: str) -> str:
    """Keep a value in its cell, whatever it holds."""
    return str(text).replace("|", "\\|").replace("\n", " ")

"""Flights of the harness with what the equations of coefficients need beside what was recorded."""

from __future__ import annotations

import numpy as np

from finback.errors import InputError
from finback.flight.flat_earth import over_flat_earth
from finback.flight.power import POWER, THRUST
from finback.identification.coefficient.airframe import Airframe
from finback.records import FlightRecord


def as_flown(record: FlightRecord, airframe: Airframe) -> FlightRecord:
    """Return a flight of a run as over a flat Earth, with its thrust as a column where the setup states none.

    Raises:
        InputError: it was flown on the rig, or under a thrust that nobody states.
    """
    facts = record.provenance
    if facts.get("fidelity") == "rig":
        raise InputError(
            f"flight '{record.name}' was flown on the rig, which holds the airspeed by a force of its own",
            hint="fly it with fidelity 'symmetric' or 'free'; 'finback identify' reads flights of the rig",
        )
    flown = over_flat_earth(record)
    if airframe.thrust_n != 0.0 or "thrust_n" in record.columns or POWER not in facts:  # engines off go without say
        return flown
    if THRUST not in facts:
        raise InputError(
            f"flight '{record.name}' was flown with {facts[POWER]}, and nothing says what thrust that was",
            hint="write thrust_n into [airframe], or fly again with thrust_kn in the study's [flight]",
        )
    return flown.with_columns(thrust_n=np.full(len(record), float(facts[THRUST])))

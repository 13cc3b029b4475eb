"""A flown case as a record, for whoever draws or keeps records."""

from __future__ import annotations

import numpy as np

from finback.channels import CHANNELS
from finback.flight.case import FlownCase
from finback.records import Condition, FlightRecord, Hold, Schedule


def case_record(flown: FlownCase) -> FlightRecord:
    """Return the channels among the columns as a record.

    The condition is that of the start; the schedule is the elevator as the aircraft moved it (``actuator``), or none
    at all (one point at 0) for what has no elevator.
    """
    columns = {name: values for name, values in flown.columns.items() if name in CHANNELS}
    time = flown.columns["time_s"]
    elevator = columns.get("elevator_rad", np.zeros(time.size))
    return FlightRecord(
        name=flown.name,
        columns=columns,
        outcome=flown.outcome,
        note=flown.note,
        condition=Condition(
            airspeed_m_s=float(flown.columns["airspeed_m_s"][0]),
            density_kg_m3=float(flown.columns["density_kg_m3"][0]),
            gravity_m_s2=float(flown.columns["gravity_m_s2"][0]),
            altitude_m=float(flown.columns["altitude_m"][0]),
        ),
        schedule=Schedule(time_s=time, elevator_rad=elevator),
        hold=Hold.ACTUATOR,
        provenance=flown.provenance,
    )

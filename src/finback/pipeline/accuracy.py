"""What a sweep knows of its own error: made when it is flown, read back by whoever shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from finback.flight.accuracy import SweepAccuracy, chosen, sweep_accuracy
from finback.flight.plan import FlightPlan
from finback.flight.vehicle import Vehicle, make_vehicle
from finback.pipeline.progress import Progress
from finback.records import FlightRecord
from finback.study import Study

_FLOWN_AGAIN: Final = 5  # flights, or as many as there are kinds


def accuracy_of(
    study: Study, vehicle: Vehicle, plans: Sequence[FlightPlan], records: Sequence[FlightRecord], progress: Progress
) -> SweepAccuracy:
    """Fly a sample of a sweep again, and return how well the study's step resolves it.

    Args:
        study: the study.
        vehicle: its aircraft, open.
        plans: of the sweep.
        records: what was flown of each.
        progress: who wants to know.
    """
    turning = [float(np.abs(record["q_rad_s"]).max()) for record in records]
    sample, words = chosen(plans, turning, most=_FLOWN_AGAIN)
    progress.begin("half the step", 0)
    return sweep_accuracy(vehicle, lambda: _at_half_step(study), sample, step_s=study.flight.step_s, sample=words)


def _at_half_step(study: Study) -> Vehicle:
    options = replace(study.flight, step_s=0.5 * study.flight.step_s)
    return make_vehicle(study.aircraft, study.condition, options)

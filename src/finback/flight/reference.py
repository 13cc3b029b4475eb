"""A flight again by DOP853 on the suspended simulator's own right-hand side: what its steps have added to it.

The elevator's schedule is crossed at none of its corners: the integration ends there and begins anew. At the corners
of tables it goes on, with a loss of order that its own step control repairs; how well is measured by a second
integration, a hundred times as tight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.flight.motion import Incomplete, Motion
from finback.records import FlightRecord, Schedule

_LOOSE: Final = 1e-8  # relative; over corners of tables this leaves some 1e-7 rad of alpha in 10 s
_TIGHT: Final = 1e-10
_ABSOLUTE: Final = 0.1  # of the relative tolerance: rates and angles are of order one
_LONGEST_S: Final = 0.1  # of a step: no pulse of the motion is stepped over


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A flight's difference to DOP853 on the same right-hand side.

    Attributes:
        alpha_error_rad: largest difference of alpha at the rows of the flight.
        q_error_rad_s: the same of the pitch rate.
        uncertainty_rad: largest difference of alpha between two integrations of the reference, one a hundred times
            as tight as the other.
        corners: property that tables are looked up by -> how many of their breakpoints the flight passes; empty for a
            smooth flight.
    """

    alpha_error_rad: float
    q_error_rad_s: float
    uncertainty_rad: float
    corners: Mapping[str, int]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class NoReference:
    """A flight that cannot be had by another integrator.

    Attributes:
        reason: why, in words.
    """

    reason: str


def reference(motion: Motion | Incomplete, record: FlightRecord) -> Reference | NoReference:
    """Integrate a flight by DOP853 and compare, as far as the record goes.

    Args:
        motion: of the flight.
        record: what the simulator made of it.
    """
    if isinstance(motion, Incomplete):
        return NoReference(reason=motion.reason)
    loose, tight = (_states(motion, record, tolerance) for tolerance in (_LOOSE, _TIGHT))
    if not tight.size or not loose.size:
        return NoReference(reason="DOP853 does not come through: the right-hand side is not finite on the way")
    alpha, q = tight[:, motion.alpha], tight[:, motion.q]
    return Reference(
        alpha_error_rad=float(np.abs(record["alpha_rad"] - alpha).max()),
        q_error_rad_s=float(np.abs(record["q_rad_s"] - q).max()),
        uncertainty_rad=float(np.abs(loose[:, motion.alpha] - alpha).max()),
        corners=_corners(motion, record, tight),
    )


def _states(motion: Motion, record: FlightRecord, tolerance: float) -> FloatArray:
    """Return the states at the rows of the record, shape (rows, n); of no rows if the integration fails."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - it takes a while to import, and few flights need it

    time = record["time_s"]
    schedule, end = record.schedule, float(time[-1])
    states = np.empty((time.size, motion.start.size))
    states[0] = state = motion.start
    knots = schedule.time_s[(schedule.time_s > 0.0) & (schedule.time_s < end)]
    for begin, until in pairwise(dict.fromkeys((0.0, *knots.tolist(), end))):
        elevator = _line(schedule, begin, until)

        def rates(time_s: float, state: FloatArray, elevator: Callable[[float], float] = elevator) -> FloatArray:
            return motion.rates(state, elevator(time_s))

        rows = np.flatnonzero((time > begin) & (time <= until))
        found = solve_ivp(
            rates, (begin, until), state, method="DOP853", t_eval=np.unique(np.append(time[rows], until)),
            rtol=tolerance, atol=_ABSOLUTE * tolerance, max_step=_LONGEST_S,
        )  # fmt: skip
        if not found.success or not np.isfinite(found.y).all():
            return np.empty((0, motion.start.size))
        states[rows] = found.y.T[: rows.size]
        state = found.y[:, -1]
    return states


def _line(schedule: Schedule, begin_s: float, end_s: float) -> Callable[[float], float]:
    """Return the elevator between two neighboring corners: a straight line, also where it jumps at one of them."""
    first, last = float(schedule.value(begin_s)), float(2.0 * schedule.drive(end_s) - schedule.value(end_s))
    slope = (last - first) / (end_s - begin_s)
    return lambda time_s: first + slope * (time_s - begin_s)


def _corners(motion: Motion, record: FlightRecord, states: FloatArray) -> dict[str, int]:
    """Return how many breakpoints of tables lie between the rows, by the property that passes them."""
    seen = []
    for state, elevator in zip(states, record.schedule.value(record["time_s"]).tolist(), strict=True):
        motion.rates(state, elevator)
        seen.append(motion.look())
    columns = np.array(seen).reshape(len(states), len(motion.axes)).T
    passed = {axis.name: axis.passed(values) for axis, values in zip(motion.axes, columns, strict=True)}
    return {name: count for name, count in passed.items() if count}

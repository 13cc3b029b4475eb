"""How a flight ends before its time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.flight.simulator import Simulator
from finback.records import Outcome
from finback.units import from_si

RATE_LIMIT_RAD_S: Final = 20.0
"""A flight whose |q| passes this has diverged: three revolutions a second is no motion of an aircraft."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Escape:
    """How a flight ended of which nothing was recorded.

    Attributes:
        outcome: ``departed`` if alpha left its limits.
        time_s: time of the step that ended it.
        alpha_rad: angle of attack there.
    """

    outcome: Outcome
    time_s: float
    alpha_rad: float


def ending(
    simulator: Simulator, alpha_rad: float, q_rad_s: float, time_s: float, alpha_limits_rad: tuple[float, float]
) -> tuple[Outcome, str]:
    """Return outcome and note of a flight that a step has ended, by its state there."""
    if not (simulator.finite() and math.isfinite(q_rad_s)):
        return Outcome.DIVERGED, f"the state was no longer finite at {time_s:.4f} s"
    state = f"alpha {from_si(alpha_rad, 'deg'):.3f} deg, q {from_si(q_rad_s, 'deg_s'):.3f} deg/s"
    if abs(q_rad_s) >= RATE_LIMIT_RAD_S:
        return (
            Outcome.DIVERGED,
            f"q passed {from_si(RATE_LIMIT_RAD_S, 'deg_s'):.0f} deg/s at {time_s:.4f} s: {state}",
        )
    low, high = (from_si(limit, "deg") for limit in alpha_limits_rad)
    return Outcome.DEPARTED, f"alpha left {low:.3f}…{high:.3f} deg at {time_s:.4f} s: {state}"

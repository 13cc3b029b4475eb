"""One check of the residuals and what it found."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

VISIBLE: Final = 25.0
"""Square, in units of the noise, of what a fault of usual size would do: with less, a record says nothing of it."""
VISIBLE_LAG_S: Final = 0.3
"""Usual size of a lag of lift and moment behind alpha, in a part of its range."""
STRAIGHT: Final = 0.6
"""Of its largest slope: a lift that keeps more of it at higher alpha is of attached flow. Flights of F-16 and F-8 II
through a stall that lags keep up to 0.45, attached ones on the rig whose damping looks like a lag 0.8 or more."""


@final
class Suspect(StrEnum):
    """What may be wrong with a record or a form."""

    TURBULENCE = "turbulence"
    HYSTERESIS = "hysteresis"
    INPUT = "input"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Suspicion:
    """One check.

    Attributes:
        suspect: what is looked for.
        judged: whether the data could be judged.
        raised: whether the alarm is raised.
        probability: that chance alone gives as much.
        size: standard deviation of the gusts of alpha over that of its sensor's noise (turbulence); share of the
            residuals explained (the others).
        statement: the finding in a sentence.
    """

    suspect: Suspect
    judged: bool
    raised: bool
    probability: float
    size: float
    statement: str


def unjudged(suspect: Suspect, statement: str) -> Suspicion:
    """Return a check that could not be made, and why."""
    return Suspicion(suspect=suspect, judged=False, raised=False, probability=1.0, size=0.0, statement=statement)

"""Half a turn of an orbit: from one zero of y to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import Flow
from finback.dynamics.orbit.taylor import ENDINGS, Ending
from finback.dynamics.orbit.taylor_kernel import ON_AXIS, ORDER, travel

_LONGEST: Final = 1e6  # units of time; only a series that is exact for so long meets it
_MOST_PIECES: Final = 2000  # half a turn has 5 to 60
_NO_RECORD: Final = np.empty((0, 4, ORDER + 1))


@final
@dataclass(frozen=True, slots=True)
class HalfTurn:
    """The orbit from (x, 0) to where y is 0 again, or as far as it went.

    The Melnikov wedge (see ``melnikov``) gives the landing place's derivatives, with g and E = exp(damping) there:
    d(landing)/d(start) = E g(start)/g(landing), and d(landing)/dλ = −E moment/g(landing) for a constant λ added to f.

    Attributes:
        landed: whether y became 0.
        ending: ``AXIS`` if it landed, else how it ended: ``AWAY``, ``REST``, or ``NOWHERE`` (too many steps).
        x: where it ended.
        duration: the time it took, negative backward.
        damping: ∫f dt along it, with that sign of time.
        moment: ∫ exp(−∫f dt) y² dt along it, the inner integral from the start; with that sign of time.
    """

    landed: bool
    ending: Ending
    x: float
    duration: float
    damping: float
    moment: float


def half_turn(flow: Flow, x: float, *, forward: bool) -> HalfTurn:
    """Follow the orbit from (x, 0) to the next zero of y.

    Args:
        flow: the flow; its units are taken as they are.
        x: where it starts; an equilibrium is at rest.
        forward: in time, or backward.
    """
    return half_turn_of(np.array(flow.damping), np.array(flow.force), x, forward=forward)


def half_turn_of(damping: FloatArray, force: FloatArray, x: float, *, forward: bool) -> HalfTurn:
    """Do the same for rows of coefficients, by rising power, in arrays: for those who take many half turns."""
    state = np.array([x, 0.0, 1.0 if forward else -1.0, 0.0, 0.0, 0.0, 0.0])
    limits = np.array([math.nan, _LONGEST, _MOST_PIECES, 1.0])
    ending = travel(damping, force, state, limits, np.empty(1), _NO_RECORD)
    x, _, _, duration, damped, moment, _ = state.tolist()
    return HalfTurn(ending == ON_AXIS, ENDINGS[ending], x, duration, damped, moment)

"""A flight as a system of first order, for an integrator that is not JSBSim's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from finback.arrays import FloatArray
from finback.flight.table_axis import TableAxis


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A flight whose state is complete: state and elevator give its rates, nothing is remembered.

    It is bound to the vehicle that gave it, and good until that flies or evaluates something else.

    Attributes:
        start: the state at the start, in SI, shape (n,).
        alpha: index of alpha in the state.
        q: index of the pitch rate.
        rates: (state, elevator in rad) -> its rates, shape (n,); no time passes.
        axes: what the tables of its aerodynamics are looked up by.
        look: reads the properties of ``axes`` where the rates were evaluated last.
    """

    start: FloatArray
    alpha: int
    q: int
    rates: Callable[[FloatArray, float], FloatArray]
    axes: tuple[TableAxis, ...]
    look: Callable[[], tuple[float, ...]]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Incomplete:
    """A flight that has more of a state than its right-hand side knows.

    Attributes:
        reason: what remembers, in words.
    """

    reason: str

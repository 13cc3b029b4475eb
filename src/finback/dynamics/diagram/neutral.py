"""Neutral loops: homoclinic orbits of a saddle with zero trace, at which a curve of folds of cycles ends, flat."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.connection.loop import Loop, LoopKind, loops
from finback.dynamics.diagram.cell import lines
from finback.dynamics.diagram.knot import spaced
from finback.dynamics.family import Family
from finback.dynamics.orbit.splitting import Route
from finback.errors import InputError

_NODES: Final = 13
_FEWEST: Final = 2
_MOST_TURNS: Final = 2  # limit cycles are bounded by loops of two turns at most
_TOLERANCE: Final = 1e-15  # of the range of μ
_DOUBT: Final = 0.02  # of the difference of λ at the ends of a bracket: what a chord may be wrong by
_DOUBLINGS: Final = 60


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class NeutralLoop:
    """A homoclinic orbit of a saddle with zero trace.

    Attributes:
        mu: the parameter at which it exists.
        lam: the λ at which it exists.
        loop: the orbit there.
        bracket: two μ around it at which the trace has opposite signs, shape (2,).
        residual: the trace at ``mu``, as evaluated.
    """

    mu: float
    lam: float
    loop: Loop
    bracket: FloatArray
    residual: float

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket", frozen_array(self.bracket))


def neutral_loops(family: Family, mu_range: tuple[float, float], *, nodes: int = _NODES) -> tuple[NeutralLoop, ...]:
    """Find the neutral loops of a family between two μ, without the rest of the diagram; each loop by shooting.

    Of each kind of loop the trace of its saddle is followed over every strip between lines on which equilibria meet;
    two zeros between neighboring nodes are missed.

    Args:
        family: the family.
        mu_range: low and high, finite.
        nodes: at how many μ of each strip all loops are looked for, 2 or more.

    Returns:
        the loops, by rising μ.

    Raises:
        InputError: the range is empty or not finite, or there are fewer than two nodes.
        RefusedError: a branch of a saddle could not be followed; μ has no effect; the force vanishes everywhere.
    """
    low, high = mu_range
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"mu from {low} to {high} is no range", hint="give low < high, both finite")
    if nodes < _FEWEST:
        raise InputError(f"nodes = {nodes}: a change of sign needs two")
    marks = {line.mu for line in lines(family) if low <= line.mu <= high}
    found: list[NeutralLoop] = []
    for left, right in pairwise(sorted({low, *marks, high})):
        places = spaced(left, right, nodes, singular=(left in marks, right in marks))
        rows = [_homoclinic(family, mu, {}) for mu in places]
        for span, here, there in zip(pairwise(places), rows, rows[1:], strict=False):
            for route in here.keys() & there.keys():
                ends = here[route], there[route]
                if ends[0].saddle_trace * ends[1].saddle_trace < 0.0:
                    found += _located(family, ends, span, (high - low) * _TOLERANCE)
    return tuple(sorted(found, key=lambda one: one.mu))


def _homoclinic(family: Family, mu: float, guesses: dict[Route, tuple[float, float]]) -> dict[Route, Loop]:
    every = loops(family, mu, most_turns=_MOST_TURNS, guesses=guesses)
    return {loop.route: loop for loop in every if loop.kind is LoopKind.HOMOCLINIC}


def _located(
    family: Family, ends: tuple[Loop, Loop], bracket: tuple[float, float], tiny: float
) -> tuple[NeutralLoop, ...]:
    """Return the neutral loop between two of its kind; none where the kind does not exist all the way."""
    known = {loop.mu: loop for loop in ends}
    route = ends[0].route
    doubt = _DOUBT * abs(ends[1].lam - ends[0].lam)

    def trace(mu: float) -> float:
        if mu not in known:
            share = (mu - bracket[0]) / (bracket[1] - bracket[0])
            chord = ends[0].lam + share * (ends[1].lam - ends[0].lam)
            here = _homoclinic(family, mu, {route: (chord, doubt)} if doubt else {})
            if route not in here:
                raise ArithmeticError
            known[mu] = here[route]
        return known[mu].saddle_trace

    try:
        place = float(brentq(trace, *bracket, xtol=tiny, rtol=4.0 * math.ulp(1.0)))
        step = 4.0 * max(tiny, math.ulp(place))
        for _ in range(_DOUBLINGS):
            sides = max(bracket[0], place - step), min(bracket[1], place + step)
            if trace(sides[0]) * trace(sides[1]) < 0.0 or sides == bracket:
                break
            step *= 4.0
    except ArithmeticError:
        return ()
    loop = known[place]
    return (NeutralLoop(mu=place, lam=loop.lam, loop=loop, bracket=frozen_array(sides), residual=loop.saddle_trace),)

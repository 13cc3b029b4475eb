"""Flow that lags behind alpha (stall hysteresis), and an elevator that acts late: added-variable tests."""

from __future__ import annotations

from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.model_form import Equation
from finback.identification.suspicions.finding import STRAIGHT, VISIBLE, VISIBLE_LAG_S, Suspect, Suspicion, unjudged
from finback.identification.suspicions.residuals import OF_SLOW, Residuals, stacked
from finback.identification.suspicions.signals import (
    LAGS_S,
    SPEED,
    UNSTEADY_NODES,
    alpha_nodes,
    flight_signals,
    hats,
    late_signals,
    speed_range,
    speed_signals,
    static_signals,
    together,
    unsteady_signals,
)
from finback.identification.term import Term

_SIGNIFICANT: Final = 1e-3
_SHARE: Final = 0.04
"""Of the residuals' squares that a signal must explain: with 1000 equations and 20 signals chance explains 0.02."""
_OF_EXCESS: Final = 0.3
"""Of what the residuals have more than the sensors' noise, likewise: a signal that explains less is not their cause."""
_LEAST_EXCESS: Final = 0.01
_ALPHA_BINS: Final = 6  # over the range of alpha, in which the slope of the lift is taken
_FEWEST: Final = 0.02  # of all samples: a bin with less is not looked at
_HIGH_BINS: Final = 2  # those that a stall is in
_REMAINS: Final = 0.5
"""Of what noise does not explain: what is suspected must leave less to be believed where much is wrong."""
_OF_CALM: Final = 0.08
"""Of what airspeed and the flights' own coefficients explain: products of them, which none has, were seen to leave 0.06
to signals that did nothing."""
_ALONE: Final = 0.15
"""Of the residuals: with more, a signal is believed all the same; chance and such products gave up to 0.11."""
_MOVES: Final = 0.03
"""Range of the airspeed over its least, below which nothing changes slowly with it."""
_WIDE: Final = 1.0
"""Range of the airspeed over its least, beyond which Mach number, thrust and trim change too much with it."""
_VISIBLE_DELAY_S: Final = 0.1  # of the elevator, that should be seen
_ELEVATOR: Final = Term.of(elevator_rad=1)
_NOISE_ALONE: Final = 1.15  # mean square of residuals that hold no more than noise, with what chance adds


def hysteresis_and_input(found: Residuals, least: Residuals) -> tuple[Suspicion, Suspicion]:
    """Look for dα/dt at the same alpha, and for the elevator of some time ago, each without what the other explains.

    Args:
        found: the residuals of the fit.
        least: what of the residuals is left when a calm flight has explained all it may.
    """
    lagging = found.columns(unsteady_signals(found.states, found.sides))
    late = found.columns(late_signals(found.forms))
    left, rivaled, excluded = _explained_calmly(found, np.hstack([lagging, late]), least)
    # Slow changes are what the airspeed does, and no delay is slow; a stall is, so that its lag may hide in them.
    slowly = found.speed_known and (rivaled or speed_range(found.beside) > _MOVES)
    calm = least if slowly else left
    return (
        _finding(
            Suspect.HYSTERESIS,
            left.without(late),
            lagging,
            "the lag of the flow behind alpha",
            "damping over alpha that the form does not have; the lift curve is straight, so the flow is attached"
            if (straight := lift_is_straight(found))
            else "stall hysteresis, unsteady flow, or damping over alpha that the form does not have",
            possible=not straight,
            visible=_visible(left, _lags(found)),
            told=not rivaled and (left is not least or (found.speed_known and speed_range(found.beside) < _WIDE)),
        ),
        _finding(
            Suspect.INPUT,
            calm.without(lagging),
            late,
            f"the elevator of up to {LAGS_S[-1]:g} s ago",
            "a delay, an actuator, or dynamics that are not in the form",
            possible=True,
            visible=_visible(calm, _delay(found)),
            told=excluded and _more_than_products(found, calm.without(lagging), late),
        ),
    )


def _explained_calmly(found: Residuals, suspected: FloatArray, least: Residuals) -> tuple[Residuals, bool, bool]:
    """Return what is left when a calm and attached flight has explained what it may, in no more ways than needed.

    The more a flight may, the less is left of what is suspected. So it is first given biases, static curves and
    coefficients of each flight's own density and mass; then what the airspeed does, if it is known, and at once where
    it moves; then slow changes of everything. The first of these is taken with which, and with what is suspected, only
    noise is left; the second also where that explains most of what noise does not, or where it explains as much as what
    is suspected. Slow changes of everything may rival what is suspected where the airspeed moves, or is not known.

    Returns:
        The residuals; whether all that a calm flight may hold would explain as much as what is suspected; whether what
        the airspeed does is excluded, because it is known or because without it nothing but noise is left.
    """
    static = static_signals(found.forms, found.states, found.states)
    own = together(static, flight_signals(found.forms, found.states))
    steady = found.without_biases().without(found.columns(own))
    rest = steady.without(suspected).excess
    chosen = steady if rest.max() < _NOISE_ALONE else least
    if found.speed_known:
        at_speed = steady.without(found.columns(speed_signals(found.forms, found.states, found.beside)))
        if chosen is steady:
            moving = speed_range(found.beside) > _MOVES
            chosen = steady if not moving and at_speed.excess.mean() > rest.mean() else at_speed
        else:
            rest = at_speed.without(suspected).excess
            most = rest.mean() - 1.0 < _REMAINS * (at_speed.excess.mean() - 1.0)
            if rest.max() < _NOISE_ALONE or most:
                chosen = at_speed
    moves = not found.speed_known or speed_range(found.beside) > _MOVES
    if moves and chosen is not least and least.excess.mean() <= chosen.without(suspected).excess.mean():
        return chosen, True, found.speed_known
    if chosen is not least or found.speed_known:
        return chosen, False, True
    explained = least.excess.mean() - least.without(suspected).excess.mean()
    return least, bool(explained < OF_SLOW * (steady.excess.mean() - least.excess.mean())), False


def _more_than_products(found: Residuals, left: Residuals, columns: FloatArray) -> bool:
    """Return whether columns explain more than may be left of what a calm flight explains to first order."""
    mean, share = float(left.excess.mean()), left.explained(columns)[1]
    return share > _ALONE or share * mean > _OF_CALM * (float(found.excess.mean()) - mean)


def _visible(left: Residuals, effects: FloatArray) -> bool:
    """Return whether a fault of usual size, one of those that move the equations by ``effects`` (2 K, m), is seen."""
    free = effects - left.basis @ (left.basis.T @ effects)
    return float(np.sum(free**2, axis=0).max()) > VISIBLE * max(1.0, float(left.excess.mean()))


def _lags(found: Residuals) -> FloatArray:
    """Return what a lag of lift and moment behind alpha, in each part of its range, would do, whitened, (2 K, m)."""
    nodes = alpha_nodes(found.states, UNSTEADY_NODES)
    signals = tuple(
        np.column_stack(
            [
                VISIBLE_LAG_S * hats(state[:, 0], nodes) * (side.mean.jacobian[:, [i], 0] * side.mean.rates[:, :1])
                for i in (0, 1)
            ]
        )
        for state, side in zip(found.states, found.sides, strict=True)
    )
    columns, count = stacked(found.forms, signals), UNSTEADY_NODES
    return found.white(columns[:, :count] + columns[:, 3 * count :])


def _delay(found: Residuals) -> FloatArray:
    """Return what a delay of the elevator would do, whitened, shape (2 K, 1)."""
    own = np.zeros(2)
    for equation, name in enumerate(Equation):
        if (name, _ELEVATOR) in found.forms[0].form.terms:
            own[equation] = found.coefficients[found.forms[0].form.index(name, _ELEVATOR)]
    late = tuple(
        signal[:, [LAGS_S.index(_VISIBLE_DELAY_S)]] - weak.stretch.elevator_rad[:, np.newaxis]
        for signal, weak in zip(late_signals(found.forms), found.forms, strict=True)
    )
    return found.white(stacked(found.forms, late) @ own[:, np.newaxis])


def lift_is_straight(found: Residuals) -> bool:
    """Return whether the lift keeps its slope over all alpha of the data: then no flow has separated.

    Damping that changes with alpha looks like a lag of the flow. What tells them apart is that a stall breaks the lift.
    The slope is that of the fitted dα/dt, and in proportion to the airspeed where that is known.
    """
    alpha = np.concatenate([state[:, 0] for state in found.states])
    slope = -np.concatenate([side.mean.jacobian[:, 0, 0] for side in found.sides])
    if found.speed_known:
        speed = np.concatenate([channels[SPEED] for channels in found.beside])
        slope = slope * speed.mean() / speed
    edges = np.linspace(alpha.min(), alpha.max(), _ALPHA_BINS + 1)
    place = np.clip(np.searchsorted(edges, alpha, side="right") - 1, 0, _ALPHA_BINS - 1)
    counts = np.bincount(place, minlength=_ALPHA_BINS)
    means = np.bincount(place, weights=slope, minlength=_ALPHA_BINS) / np.maximum(counts, 1)
    high = np.arange(_ALPHA_BINS) >= _ALPHA_BINS - _HIGH_BINS
    below = means[~high & (counts > _FEWEST * alpha.size)]
    return not below.size or bool(np.average(means[high], weights=counts[high]) > STRAIGHT * below.max())


def _finding(  # noqa: PLR0913 - what is looked for, in what, with what, and its words
    suspect: Suspect,
    left: Residuals,
    columns: FloatArray,
    what: str,
    meaning: str,
    *,
    possible: bool,
    visible: bool,
    told: bool,
) -> Suspicion:
    """Judge what columns explain: whether it can be a fault at all, and whether it is told from slow changes."""
    probability, share = left.explained(columns)
    mean = float(left.excess.mean())
    of_excess = share * mean / max(mean - 1.0, _LEAST_EXCESS)
    seen = probability < _SIGNIFICANT and share > _SHARE and of_excess > _OF_EXCESS
    if not (seen or visible):
        return unjudged(suspect, f"the record moves too little, or is too short, for {what} to be seen")
    if seen and possible and not told:
        said = (
            f"{what} explains {100 * share:.2g} % of the residuals, but coefficients that change with airspeed may, too"
        )
        return unjudged(suspect, said)
    said = f"{what} explains {100 * share:.2g} % of the residuals" + (f": {meaning}" if seen else "")
    return Suspicion(
        suspect=suspect,
        judged=True,
        raised=seen and possible,
        probability=probability,
        size=share,
        statement=said,
    )

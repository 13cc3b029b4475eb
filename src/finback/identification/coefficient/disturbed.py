"""Whether residuals of output error ask for noise on the motion itself: kicks of airspeed, alpha and pitch rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.linalg import expm

from finback.arrays import FloatArray, IntArray
from finback.identification.coefficient.directions import directions, score_of
from finback.identification.coefficient.motion import layout
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.output_error import RATE_OF, Fitted, motion_of
from finback.identification.coefficient.shooting import OWN
from finback.identification.coefficient.track import STATES, Track
from finback.identification.estimate import Estimate

_KICKED: Final = (0, 1, 3)
"""States that are kicked: V, α, q."""
_KICKS: Final = 480
"""Of all stretches together, of each state: what they cost grows with their square."""
_FEWEST: Final = 8
"""Of a stretch."""
_LARGEST: Final = 2e7
"""Numbers of the response to all kicks of a stretch, of one state."""


def disturbed(used: Sequence[Track], options: CoefficientOptions, fit: Estimate, stretches: Sequence[Fitted]) -> float:
    """Return the probability that calm air leaves residuals that ask for kicks as much: of the clearest of V, α and q.

    Kicks are spaced evenly over each stretch. Judged is the restricted score of their variance, so that what the
    numbers and the starts have followed is not counted as calm (Patterson & Thompson 1971).

    Args:
        used: the data.
        options: form, airframe.
        fit: the estimate by output error.
        stretches: the same, linearized.
    """
    least = 1.0
    for state in _KICKED:
        found = [
            directions(
                _responses(track, options, fit, one, states, state, len(used)),
                one.columns(one.unknown),
                influence.reshape(-1, fit.coefficients.size),
                residual.reshape(-1),
            )
            for track, one, states, influence, residual in zip(
                used, stretches, fit.states, fit.influence, fit.residuals, strict=True
            )
        ]
        least = min(least, score_of(found, fit.covariance).of_noise)
    return min(1.0, len(_KICKED) * least)


def _responses(  # noqa: PLR0913, PLR0917 - a stretch, its fit, and what is kicked
    track: Track,
    options: CoefficientOptions,
    fit: Estimate,
    one: Fitted,
    states: FloatArray,
    state: int,
    stretches: int,
) -> FloatArray:
    """Return the whitened outputs after a kick of a state at each of some samples, shape (m, kicks)."""
    count, outputs = len(track), len(track.outputs)
    terms = layout(options.form, options.airframe_of(track.flight), options.reference_speed_m_s)
    at = motion_of(track, terms, fit.coefficients, states, track.inputs).jacobian
    steps = expm(0.5 * track.interval_s * (at[:-1, :OWN] + at[1:, :OWN]))
    many = int(min(_KICKS / stretches, _LARGEST / (count * outputs)))
    kicks: IntArray = np.unique(np.linspace(0, count - 1, min(max(many, _FEWEST), count) + 1)[1:-1].astype(np.int64))
    places = dict(zip(kicks.tolist(), range(kicks.size), strict=True))
    moved, response = np.zeros((OWN, kicks.size)), np.empty((count, OWN, kicks.size))
    for i in range(count):
        if i:
            moved = steps[i - 1] @ moved
        if i in one.fresh:
            moved[:] = 0.0
        if i in places:
            moved[state, places[i]] = 1.0
        response[i] = moved
    slopes = np.zeros((count, outputs, OWN))
    for k, name in enumerate(track.outputs):
        if name in STATES:
            slopes[:, k, STATES.index(name)] = 1.0
        else:
            slopes[:, k] = at[:, RATE_OF[name]]
    columns: FloatArray = (one.white @ slopes) @ response
    return columns.reshape(-1, kicks.size)

"""Whether the elevator acts later or earlier than recorded, where no delay was asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.special import chdtrc

from finback.identification.coefficient.directions import Directions, directions, score_of
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.output_error import Fitted
from finback.identification.coefficient.track import Track
from finback.identification.estimate import Estimate

_CHANCE: Final = 1e-4
"""Probability below which no elevator that is in time gives such residuals."""
_CLEAR: Final = 3.0
"""Standard errors from which on a flight is counted."""
_KNOWN: Final = 1e-6
"""Share of a delay's information that the numbers must leave for it to be judged."""


def of_fitted(fit: Estimate, stretches: Sequence[Fitted]) -> list[Directions]:
    """Return how a delay would move each stretch that output error has fitted."""
    found = []
    for one, influence, residual in zip(stretches, fit.influence, fit.residuals, strict=True):
        which = np.zeros(one.unknown.size, dtype=np.bool_)
        which[-1] = True
        found.append(
            directions(
                one.columns(which),
                one.columns(one.unknown),
                influence.reshape(-1, fit.coefficients.size),
                residual.reshape(-1),
            )
        )
    return found


def late_elevator(
    used: Sequence[Track],
    options: CoefficientOptions,
    fit: Estimate,
    stretches: Sequence[Directions],
    *,
    coloring: float,
) -> tuple[str, ...]:
    """Say how much later the elevator acts than recorded, by a score test; nothing where chance does as much.

    Args:
        used: the data.
        options: biases that were asked for.
        fit: the estimate.
        stretches: how a delay would move each stretch.
        coloring: how much larger the color of the residuals makes errors.
    """
    if options.biases.elevator_delay_s > 0.0:
        return ()
    score = score_of(stretches, fit.covariance)
    own = np.diag(score.information)
    known = own > _KNOWN * np.array([float(one.own[0, 0]) for one in stretches])
    if not known.any():
        return ()
    asked, information = score.score[known], score.information[np.ix_(known, known)]
    inverse = np.linalg.pinv(information, rcond=_KNOWN, hermitian=True)
    worth = float(asked @ inverse @ asked) / max(coloring, 1.0) ** 2
    if chdtrc(asked.size, max(worth, 0.0)) > _CHANCE:
        return ()
    names = [track.flight for track, told in zip(used, known.tolist(), strict=True) if told]
    delays, errors = inverse @ asked, max(coloring, 1.0) * np.sqrt(np.diag(inverse))
    clear = np.abs(delays) > _CLEAR * errors
    worst = int(np.argmax(np.abs(delays) / errors))
    which = f"flight '{names[worst]}'" + (f" and {clear.sum() - 1} more" if clear.sum() > 1 else "")
    way = "later" if delays[worst] > 0.0 else "earlier"
    said = (
        f"{which}: the elevator acts {1e3 * abs(delays[worst]):.2g} ± {1e3 * errors[worst]:.1g} ms {way} than recorded "
        f"({np.sqrt(worth):.2g} standard deviations), moves between samples otherwise than hold '{used[0].hold.value}' "
        "says, or the model misses what acts alike; numbers may be wrong by it: give [biases] elevator_delay_s = "
        f"{_expected(float(np.abs(delays).max())):g}"
    )
    return (said,)


def _expected(delay_s: float) -> float:
    """Return twice a delay, to one digit upward: a standard deviation to expect of it."""
    digit = 10.0 ** np.floor(np.log10(2.0 * delay_s))
    return float(np.ceil(2.0 * delay_s / digit) * digit)

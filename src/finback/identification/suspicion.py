"""What residuals give away that no coefficient can mend: turbulence, stall hysteresis, dynamics that the input shows.

All checks are added-variable tests on the weak equations: a candidate signal is integrated like every regressor,
whitened like every equation, freed of all that the model's own terms can do, and set against the residuals. Its
significance is that of a Wald test whose covariance allows for colored residuals (Newey & West 1987, Econometrica 55,
703), so one fault does not raise the alarm of another; and it must explain a share of the residuals that matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from finback.arrays import FloatArray
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch
from finback.identification.weak_form import Sides, WeakForm, weak_form
from finback.identification.whitening import Whitening, whitening

_SIGNIFICANT: Final = 1e-3
_SHARE: Final = 0.02
"""Of the residuals' squares that a signal must explain: with 1000 equations and 5 signals chance explains 0.005."""
_DISTURBED: Final = 1.5
"""Ratio of the residuals where the controls are still to the noise of the records, from which a record is disturbed."""
_AS_IN_MANEUVERS: Final = 0.25
"""Of the residuals in maneuvers: what a model misses is less than this about an equilibrium, gusts are more."""
_STILL: Final = 0.02  # of the elevator's whole travel: less movement under a test function is none
_SETTLED_S: Final = 5.0  # since the controls moved: several periods of a short period mode
_NARROW: Final = 0.2  # of the range of alpha in all data: where a record is judged quiet
_FEWEST_QUIET: Final = 10  # test functions with still controls: fewer say nothing
_LOCAL: Final = 3  # constants of a straight function of alpha and q
_ALPHA_NODES: Final = 5  # over the range of alpha: a stall is a fifth of it
_LAGS_S: Final = (0.1, 0.2, 0.4)  # of the elevator: actuators, delays and downwash lag less
_MEMORY: Final = 8  # neighbors whose correlation the test allows for: two half widths of the usual test function
_COLLINEAR: Final = 1e-6  # of its length is left of a signal that the model has already


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
        size: ratio of still residuals to noise (turbulence), share of the residuals explained (the others).
        statement: the finding in a sentence.
    """

    suspect: Suspect
    judged: bool
    raised: bool
    probability: float
    size: float
    statement: str


def suspicions(
    used: Sequence[Stretch],
    options: IdentificationOptions,
    *,
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
) -> tuple[Suspicion, ...]:
    """Check the residuals of a fitted model for turbulence, hysteresis, and what the input still explains.

    Args:
        used: the data of the fit.
        options: of the fit: form and test functions.
        coefficients: of the fitted model, in SI, shape (p,).
        states: smoothed (alpha, q) of each stretch, shape (n, 2).
        noise: standard deviations of alpha in rad and q in rad/s as the records show them, shape (2,).
    """
    data = _Residuals.of(used, options, coefficients, states, noise)
    air = _turbulence(data)
    if not air.raised:
        return (air, _hysteresis(data), _input(data))
    # Gusts move alpha and the elevator answers nothing: what is left of a signal says nothing of the aircraft.
    others = (Suspect.HYSTERESIS, Suspect.INPUT)
    return (air, *(_unjudged(suspect, "the air was not calm: it would hide and feign this") for suspect in others))


def _unjudged(suspect: Suspect, statement: str) -> Suspicion:
    return Suspicion(suspect=suspect, judged=False, raised=False, probability=1.0, size=0.0, statement=statement)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Residuals:
    """Whitened residuals of every weak equation, free of the regressors, and what is needed to add a signal."""

    forms: tuple[WeakForm, ...]
    sides: tuple[Sides, ...]
    states: tuple[FloatArray, ...]
    white: Whitening
    basis: FloatArray  # orthonormal, of the whitened regressors, shape (2 K, p)
    values: FloatArray  # shape (2 K,)

    @classmethod
    def of(
        cls,
        used: Sequence[Stretch],
        options: IdentificationOptions,
        coefficients: FloatArray,
        states: Sequence[FloatArray],
        noise: FloatArray,
    ) -> _Residuals:
        form = options.model_form
        forms = tuple(weak_form(stretch, form, options) for stretch in used)
        sides = tuple(weak.sides(coefficients, state) for weak, state in zip(forms, states, strict=True))
        white = whitening(forms, sides, noise)
        rows = [weak.regressors(side).reshape(-1, form.size) for weak, side in zip(forms, sides, strict=True)]
        target = [weak.target(side, state).ravel() for weak, side, state in zip(forms, sides, states, strict=True)]
        whitened = white(np.column_stack([np.concatenate(rows), np.concatenate(target)]))
        basis, _ = np.linalg.qr(whitened[:, :-1])
        left = whitened[:, -1] - whitened[:, :-1] @ coefficients
        return cls(
            forms=forms,
            sides=sides,
            states=tuple(states),
            white=white,
            basis=basis,
            values=left - basis @ (basis.T @ left),
        )

    def added(self, signals: Sequence[FloatArray]) -> FloatArray:
        """Return signals as new columns in both equations, free of the model's own, shape (2 K, 2 · signals).

        Args:
            signals: of each stretch, shape (n, signals).
        """
        columns = []
        for weak, signal in zip(self.forms, signals, strict=True):
            integrals = np.stack([weak.integral(column, weak.bump.value) for column in signal.T], axis=1)
            rows = np.zeros((integrals.shape[0], 2, 2 * integrals.shape[1]))
            rows[:, 0, : integrals.shape[1]] = integrals
            rows[:, 1, integrals.shape[1] :] = integrals
            columns.append(rows.reshape(-1, rows.shape[2]))
        whole = self.white(np.concatenate(columns))
        free = whole - self.basis @ (self.basis.T @ whole)
        kept = np.linalg.norm(free, axis=0) > _COLLINEAR * np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        return free[:, kept]

    def explained(self, signals: Sequence[FloatArray]) -> tuple[float, float]:
        """Return the probability that chance explains as much as the signals do, and the share they explain."""
        columns = self.added(signals)
        if not columns.shape[1] or not self.values.any():
            return 1.0, 0.0
        basis, singular, _ = np.linalg.svd(columns, full_matrices=False)
        basis = basis[:, singular > _COLLINEAR * singular[0]]
        weights = basis.T @ self.values
        left = self.values - basis @ weights
        moments = basis * left[:, np.newaxis]
        spread = moments.T @ moments
        for lag in range(1, 2 * _MEMORY + 1):  # two equations a test function
            product = moments[lag:].T @ moments[:-lag]
            spread += (1.0 - lag / (2 * _MEMORY + 1)) * (product + product.T)
        # Never less than white residuals of this size have: a short record's own estimate may be.
        variance = float(left @ left) / left.size
        values, vectors = np.linalg.eigh(spread)
        turned = vectors.T @ weights
        wald = float(np.sum(turned**2 / np.maximum(values, variance)))
        return float(chdtrc(basis.shape[1], wald)), float(weights @ weights / (self.values @ self.values))


def _turbulence(data: _Residuals) -> Suspicion:
    """Compare the residuals where the controls are still with the noise of the sensors."""
    travel = float(np.ptp(np.concatenate([weak.stretch.elevator_rad for weak in data.forms])))
    ends = np.cumsum([weak.starts.size for weak in data.forms])[:-1]
    reach = _NARROW * float(np.ptp(np.concatenate([state[:, 0] for state in data.states])))
    quiet = [_still(weak, state, _STILL * travel, reach) for weak, state in zip(data.forms, data.states, strict=True)]
    pieces = np.split(data.values.reshape(-1, 2), ends)
    # About one equilibrium what a model misses is a straight function of the state; gusts are none.
    left = [
        _unexplained(piece[still], weak, state, still)
        for piece, still, weak, state in zip(pieces, quiet, data.forms, data.states, strict=True)
        if still.sum() >= _FEWEST_QUIET
    ]
    if not left:
        said = "the controls are never still: turbulence cannot be told from what the model misses"
        return _unjudged(Suspect.TURBULENCE, said)
    count = sum(len(piece) - _LOCAL for piece in left)
    squares = sum(np.sum(piece**2, axis=0) for piece in left) / count
    moving = np.concatenate([piece[~still] for piece, still in zip(pieces, quiet, strict=True)])
    probability = float(min(1.0, 2.0 * chdtrc(count, count * squares.max())))
    size = float(np.sqrt(squares.max()))
    active = float(np.sqrt(np.mean(moving**2))) if moving.size else size
    # What a model misses grows with the maneuver; air does not know of it.
    raised = probability < _SIGNIFICANT and size > _DISTURBED and size > _AS_IN_MANEUVERS * active
    said = (
        f"with still controls the residuals are {size:.2g} times the sensors' noise ({active:.2g} in maneuvers): "
        + ("the air was not calm; estimates are biased as if the controls had moved it" if raised else "calm air")
    )  # fmt: skip
    return Suspicion(
        suspect=Suspect.TURBULENCE, judged=True, raised=raised, probability=probability, size=size, statement=said
    )


def _unexplained(values: FloatArray, weak: WeakForm, state: FloatArray, still: NDArray[np.bool_]) -> FloatArray:
    """Return what a straight function of the state leaves of residuals of one stretch, shape (quiet, 2)."""
    middle = state[weak.starts[still] + weak.bump.reach]
    columns = np.column_stack([np.ones(len(middle)), middle - middle.mean(axis=0)])
    basis, _ = np.linalg.qr(columns)
    return np.asarray(values - basis @ (basis.T @ values))


def _still(weak: WeakForm, state: FloatArray, most_rad: float, reach_rad: float) -> NDArray[np.bool_]:
    """Return under which test functions the controls are still, have been for long, and alpha stays near one value."""
    moved = np.ptp(weak.windows(weak.stretch.elevator_rad), axis=1) > most_rad
    memory = round(_SETTLED_S / (weak.stride * weak.stretch.interval_s))
    still = np.array([not moved[max(0, k - memory) : k + 1].any() for k in range(moved.size)], dtype=bool)
    if still.any():
        middle = state[weak.starts + weak.bump.reach, 0]
        still &= np.abs(middle - np.median(middle[still])) <= 0.5 * reach_rad
    return still


def _hysteresis(data: _Residuals) -> Suspicion:
    """Look for a dependence on dα/dt at the same alpha: dα/dt times hat functions over the range of alpha."""
    alpha = np.concatenate([state[:, 0] for state in data.states])
    nodes = np.linspace(alpha.min(), alpha.max(), _ALPHA_NODES)
    signals = [
        np.stack([side.mean.rates[:, 0] * np.interp(state[:, 0], nodes, hat) for hat in np.eye(_ALPHA_NODES)], axis=1)
        for state, side in zip(data.states, data.sides, strict=True)
    ]
    probability, share = data.explained(signals)
    raised = probability < _SIGNIFICANT and share > _SHARE
    said = (
        f"dα/dt at the same alpha explains {100 * share:.2g} % of the residuals"
        + (": stall hysteresis, unsteady flow, or damping over alpha that the form does not have" if raised else "")
    )  # fmt: skip
    return Suspicion(
        suspect=Suspect.HYSTERESIS, judged=True, raised=raised, probability=probability, size=share, statement=said
    )


def _input(data: _Residuals) -> Suspicion:
    """Look for what the elevator of some time ago still explains."""
    signals = []
    for weak in data.forms:
        stretch = weak.stretch
        time = np.arange(len(stretch)) * stretch.interval_s
        signals.append(np.stack([np.interp(time - lag, time, stretch.elevator_rad) for lag in _LAGS_S], axis=1))
    probability, share = data.explained(signals)
    raised = probability < _SIGNIFICANT and share > _SHARE
    said = f"the elevator of up to {_LAGS_S[-1]:g} s ago explains {100 * share:.2g} % of the residuals" + (
        ": a delay, an actuator, or dynamics that are not in the form" if raised else ""
    )
    return Suspicion(
        suspect=Suspect.INPUT, judged=True, raised=raised, probability=probability, size=share, statement=said
    )

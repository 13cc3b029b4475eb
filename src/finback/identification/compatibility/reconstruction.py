"""The faults that make all pieces of flight agree best, by maximum likelihood with what is usual as prior knowledge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from scipy.optimize import minimize

from finback.arrays import FloatArray
from finback.identification.coloring import corrected_covariance, whiteness
from finback.identification.compatibility.fault import FLOW, Fault, Kind
from finback.identification.compatibility.flight_path import Disturbance, whitened
from finback.identification.compatibility.piece import START, Implied, Piece, compared, edges, implied

_STEPS: Final = 40
_CONVERGED: Final = 0.05  # standard errors
_FARTHEST: Final = 2.0  # usual sizes in one step: delays and attitudes are linear no further
_NOISE_CHANGE: Final = 4.0  # of a variance in one step
_NEAR: Final = 0.5  # standard errors: close enough to ask how the air moves
_SHARES: Final = (1.0, 0.5, 0.25, 0.1, 0.02)  # of a step, tried in turn
_STEADY: Final = 1.05  # of a variance from step to step
_COLORED: Final = 0.01  # probability below which innovations hang together
_GUST_STEPS: Final = 3  # how often the air's motion is estimated anew
_GUST_GAIN: Final = 10.0
"""Of twice the log likelihood, beyond which the air is said to move: 9.2 comes by chance once in 100 (two numbers)."""
_GUST_TIMES_S: Final = (0.05, 30.0)
_GUST_STEP: Final = float(np.log(2.0))
"""Of the search for logarithms of gusts' speed and time: their first guess is right to a factor of some two."""
_GUST_NEAR: Final = 0.05  # of these logarithms: 5 % of a speed or a time
_GUST_LEVEL: Final = 0.2  # of twice the log likelihood: a fiftieth of what decides
_GUST_TRIES: Final = (
    30  # most are cut short by it, as each costs a filter of all flights; the next search goes on from there
)
_LEAST_SCALE: Final = -0.99
_LEAST_GUST: Final = 1e-3  # m/s


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Reconstruction:
    """Faults of instruments with their covariance.

    Attributes:
        faults: what was estimated.
        values: in SI, shape (faults,).
        covariance: prior knowledge and colored residuals allowed for, shape (faults, faults).
        pieces: what was used.
        residuals: of each piece, measured less implied, NaN where nothing was compared, shape (n, outputs).
        disturbance: the noises of outputs, and the gusts, that were found; process noise is that of the first piece.
        converged: whether the last step was below half of a standard error; usually it is below a twentieth.
    """

    faults: tuple[Fault, ...]
    values: FloatArray
    covariance: FloatArray
    pieces: tuple[Piece, ...]
    residuals: tuple[FloatArray, ...]
    disturbance: Disturbance
    converged: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Guess:
    """Faults and starts in SI, shapes (faults,) and (8,) for each piece."""

    values: FloatArray
    starts: tuple[FloatArray, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """One piece in whitened rows, the start of its own projected out."""

    influence: FloatArray
    residual: FloatArray
    back: FloatArray
    start_step: FloatArray
    squares: FloatArray
    counts: FloatArray
    log_determinant: float


def reconstruct(pieces: Sequence[Piece], faults: tuple[Fault, ...], sizes: FloatArray) -> Reconstruction:
    """Estimate faults that all pieces share, and a start of each.

    Steps of Gauss and Newton on the innovations of a Kalman filter whose process noise is the noise of the inputs, as
    measured on them, and whose measurement noise is estimated: the filter form of flight-path reconstruction (Klein &
    Morelli 2006, section 10.3; Jategaonkar 2015, chapter 10). Each fault is held by its usual size. Where the
    likelihood asks for them, gusts of first order are part of the model.

    Args:
        pieces: all with the same outputs.
        faults: what to estimate.
        sizes: their usual sizes, > 0, shape (faults,).
    """
    problem = _Problem(pieces, faults, sizes)
    at = _Guess(values=np.zeros(len(faults)), starts=tuple(np.zeros(START) for _ in pieces))
    least = np.mean([piece.output_noise() for piece in pieces], axis=0)
    noises = Disturbance(process=pieces[0].input_noise(), noise=least)
    seen = problem.implied(at)
    asked_of_air, converged, length = 0, False, np.inf
    for _ in range(_STEPS):
        rows = problem.rows(at, seen, noises)
        step, covariance = problem.step(rows, at.values)
        length = float((np.abs(step) / np.sqrt(np.diag(covariance))).max())
        before = at
        at, seen = problem.moved(at, seen, rows, step, noises)
        # No part of the step helps: the slopes, which leave out the noise of the inputs, tell the minimum no closer.
        there = length < _CONVERGED or (at is before and length < _NEAR)
        noise = _renewed(noises.noise, least, rows)
        steady = bool((np.maximum(noise / noises.noise, noises.noise / noise) < _STEADY).all())
        noises = replace(noises, noise=noise)
        if problem.feels_gusts and asked_of_air < _GUST_STEPS and length < _NEAR:
            asked_of_air += 1
            if noises.gust_m_s > 0.0 or problem.flow_is_colored(rows):
                noises = problem.gusts(at, seen, noises)
        elif steady and there:
            converged = True
            break
    converged |= length < _NEAR  # noises that go round by a few percent change no verdict
    rows = problem.rows(at, seen, noises)
    bound = problem.step(rows, at.values)[1]
    color = corrected_covariance(bound, [item.influence for item in rows], [item.residual for item in rows])
    return Reconstruction(
        faults=faults,
        values=at.values,
        covariance=_bounded_below(bound, color + bound @ problem.held @ bound),
        pieces=tuple(pieces),
        residuals=problem.compared(at, seen),
        disturbance=noises,
        converged=converged,
    )


@final
class _Problem:
    """Pieces and faults, and the least-squares problem that they make for given noises."""

    def __init__(self, pieces: Sequence[Piece], faults: tuple[Fault, ...], sizes: FloatArray) -> None:
        self.pieces, self.faults = tuple(pieces), faults
        self.held = np.diag(1.0 / sizes**2)
        self.sizes = sizes
        # No instrument shows next to nothing of what it measures, or the contrary.
        self.least = np.array([_LEAST_SCALE if fault.kind is Kind.SCALE else -np.inf for fault in faults])
        self.process = [piece.input_noise() for piece in pieces]
        self.feels_gusts = any(name in FLOW for name in pieces[0].outputs)

    def implied(self, at: _Guess) -> list[Implied]:
        return [
            implied(piece, self.faults, at.values, start) for piece, start in zip(self.pieces, at.starts, strict=True)
        ]

    def compared(self, at: _Guess, seen: Sequence[Implied]) -> tuple[FloatArray, ...]:
        edges_s = edges(self.faults, at.values)
        return tuple(compared(piece, found, edges_s) for piece, found in zip(self.pieces, seen, strict=True))

    def rows(self, at: _Guess, seen: Sequence[Implied], noises: Disturbance) -> list[_Rows]:
        return [
            _rows(piece, found, residual, start, replace(noises, process=process))
            for piece, found, residual, start, process in zip(
                self.pieces, seen, self.compared(at, seen), at.starts, self.process, strict=True
            )
        ]

    def moved(
        self, at: _Guess, seen: Sequence[Implied], rows: Sequence[_Rows], step: FloatArray, noises: Disturbance
    ) -> tuple[_Guess, list[Implied]]:
        """Go along a step, as far as it makes the misfit smaller, as the filter of this place measures it."""
        directions = [item.start_step - item.back @ step for item in rows]
        edges_s = edges(self.faults, at.values)  # what is compared stays the same along the step
        before = self._height(at, seen, seen, noises, edges_s)
        for share in _SHARES:
            starts = tuple(start + share * way for start, way in zip(at.starts, directions, strict=True))
            trial = _Guess(values=np.maximum(at.values + share * step, self.least), starts=starts)
            there = self.implied(trial)
            if self._height(trial, there, seen, noises, edges_s) < before:
                return trial, there
        return at, list(seen)

    def _height(
        self,
        at: _Guess,
        seen: Sequence[Implied],
        filtered_by: Sequence[Implied],
        noises: Disturbance,
        edges_s: tuple[float, float],
    ) -> float:
        """Return the sum of squares of the innovations and of what holds faults and starts."""
        total = float(at.values @ self.held @ at.values)
        for piece, found, ours, start, process in zip(
            self.pieces, seen, filtered_by, at.starts, self.process, strict=True
        ):
            white, _ = whitened(
                ours.path,
                ours.output,
                compared(piece, found, edges_s)[:, :, np.newaxis],
                interval_s=piece.interval_s,
                disturbance=replace(noises, process=process),
            )
            total += float((white**2).sum()) + _pull(piece, start)
        return total

    def flow_is_colored(self, rows: Sequence[_Rows]) -> bool:
        """Tell whether innovations of the flow hang together in time, as chance makes them once in 100."""
        outputs = self.pieces[0].outputs
        return any(
            whiteness([item.residual[:, k] for item in rows]) < _COLORED
            for k, name in enumerate(outputs)
            if name in FLOW
        )

    def step(self, rows: Sequence[_Rows], values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the step of the faults, no farther than is linear, and their covariance for white innovations."""
        information = sum((_square(item.influence) for item in rows), self.held)
        target = sum((_product(item.influence, item.residual) for item in rows), -self.held @ values)
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        step = np.asarray(covariance @ target)
        return step * min(1.0, _FARTHEST / max(float(np.abs(step / self.sizes).max()), 1e-300)), covariance

    def gusts(self, at: _Guess, seen: Sequence[Implied], noises: Disturbance) -> Disturbance:
        """Return the noises with the gusts of the highest restricted likelihood, if they raise it enough.

        Restricted: the freedom that faults and starts take from the residuals is counted (Patterson & Thompson 1971,
        Biometrika 58, 545), without which slow gusts would come out too small.
        """

        def misfit(logarithms: FloatArray) -> float:
            gust, time = np.exp(logarithms).tolist()
            if not _GUST_TIMES_S[0] <= time <= _GUST_TIMES_S[1]:
                return np.inf
            return self._misfit(self.rows(at, seen, replace(noises, gust_m_s=gust, gust_s=time)), at.values)

        still = self._misfit(self.rows(at, seen, replace(noises, gust_m_s=0.0)), at.values)
        first = (noises.gust_m_s, noises.gust_s) if noises.gust_m_s > 0.0 else (self._speed_of_residuals(seen), 1.0)
        simplex = np.log(first) + np.array([[0.0, 0.0], [_GUST_STEP, 0.0], [0.0, _GUST_STEP]])
        found = minimize(
            misfit,
            np.log(first),
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "xatol": _GUST_NEAR, "fatol": _GUST_LEVEL, "maxfev": _GUST_TRIES},
        )
        if still - float(found.fun) < _GUST_GAIN:
            return noises if noises.gust_m_s == 0.0 else replace(noises, gust_m_s=0.0)
        gust, time = np.exp(found.x).tolist()
        return replace(noises, gust_m_s=gust, gust_s=time)

    def _speed_of_residuals(self, seen: Sequence[Implied]) -> float:
        """Return the air's velocity that would explain the flow's residuals, about."""
        speeds = []
        for piece, found in zip(self.pieces, seen, strict=True):
            speed = np.linalg.norm(found.path.velocity_m_s, axis=1)
            for k, name in enumerate(piece.outputs):
                if name in FLOW:
                    left = found.residual[:, k] * (speed if name != "airspeed_m_s" else 1.0)
                    speeds.append(float(np.nanstd(left)))
        return max(0.5 * float(np.median(speeds)), _LEAST_GUST)

    def _misfit(self, rows: Sequence[_Rows], values: FloatArray) -> float:
        """Return minus twice the restricted log likelihood, at the faults that are best for these noises."""
        information = sum((_square(item.influence) for item in rows), self.held)
        target = sum((_product(item.influence, item.residual) for item in rows), -self.held @ values)
        squares = sum(float((item.residual**2).sum()) for item in rows) + float(values @ self.held @ values)
        explained = float(target @ np.linalg.solve(information, target))
        determinants = sum(item.log_determinant for item in rows) + float(np.linalg.slogdet(information)[1])
        return squares - explained + determinants


def _rows(piece: Piece, found: Implied, residual: FloatArray, start: FloatArray, noises: Disturbance) -> _Rows:
    faults = found.slopes.shape[2] - START
    together = np.concatenate([residual[:, :, np.newaxis], found.slopes], axis=2)
    white, log_determinant = whitened(
        found.path, found.output, together, interval_s=piece.interval_s, disturbance=noises
    )
    squares = (white[:, :, 0] ** 2).sum(axis=0)
    sizes = piece.start_sizes
    free = sizes > 0.0
    own = white[:, :, 1 + faults :].reshape(-1, START)[:, free]
    of_faults = white[:, :, 1 : 1 + faults].reshape(-1, faults)
    innovation = white[:, :, 0].ravel()
    # The start is held, loosely, by the first samples; what holds it counts like rows below the others.
    information = own.T @ own + np.diag(1.0 / sizes[free] ** 2)
    scale = np.sqrt(np.diag(information))
    scaled = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    back, step = np.zeros((START, faults)), np.zeros(START)
    back[free] = scaled @ (own.T @ of_faults)
    step[free] = scaled @ (own.T @ innovation - start[free] / sizes[free] ** 2)
    shape = white.shape[:2]
    return _Rows(
        influence=(of_faults - own @ back[free]).reshape(*shape, faults),
        residual=(innovation - own @ step[free]).reshape(shape),
        back=back,
        start_step=step,
        squares=squares,
        counts=np.isfinite(residual).sum(axis=0).astype(np.float64),
        log_determinant=log_determinant + float(np.linalg.slogdet(information)[1]),
    )


def _pull(piece: Piece, start: FloatArray) -> float:
    free = piece.start_sizes > 0.0
    return float(((start[free] / piece.start_sizes[free]) ** 2).sum())


def _renewed(noise: FloatArray, least: FloatArray, rows: Sequence[_Rows]) -> FloatArray:
    """Return variances of the outputs' noise by which their innovations are as large as they should be."""
    count = np.sum([item.counts for item in rows], axis=0)
    squares = np.sum([item.squares for item in rows], axis=0)
    ratio = np.where(count > 0, squares / np.maximum(count, 1.0), 1.0)
    return np.asarray(np.maximum(noise * np.clip(ratio, 1.0 / _NOISE_CHANGE, _NOISE_CHANGE), least))


def _square(influence: FloatArray) -> FloatArray:
    flat = influence.reshape(-1, influence.shape[-1])
    return np.asarray(flat.T @ flat)


def _product(influence: FloatArray, residual: FloatArray) -> FloatArray:
    return np.asarray(influence.reshape(-1, influence.shape[-1]).T @ residual.ravel())


def _bounded_below(bound: FloatArray, found: FloatArray) -> FloatArray:
    """Return a covariance with no variance, of whatever combination, below that of the bound.

    Along the eigenvectors of one by the other each variance is taken from whichever says more.
    """
    root = np.linalg.cholesky(bound)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(0.5 * inverse @ (found + found.T) @ inverse.T)
    shape = root @ vectors
    return np.asarray((shape * np.maximum(values, 1.0)) @ shape.T)

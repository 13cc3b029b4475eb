"""The least-squares problem that pieces of flight and faults of instruments make for given noises."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.coloring import whiteness
from finback.identification.compatibility.fault import FLOW, Fault, Kind
from finback.identification.compatibility.flight_path import Disturbance, whitened
from finback.identification.compatibility.piece import START, Implied, Piece, compared, edges, implied

_FARTHEST: Final = 2.0  # usual sizes in one step: delays and attitudes are linear no further
_SHARES: Final = (1.0, 0.5, 0.25, 0.1, 0.02)  # of a step, tried in turn
_COLORED: Final = 0.01  # probability below which innovations hang together
_LEAST_SCALE: Final = -0.99


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """Faults and starts in SI, shapes (faults,) and (8,) for each piece."""

    values: FloatArray
    starts: tuple[FloatArray, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """One piece in whitened rows, the start of its own projected out."""

    influence: FloatArray
    residual: FloatArray
    back: FloatArray
    start_step: FloatArray
    squares: FloatArray
    counts: FloatArray
    log_determinant: float


@final
class Problem:
    """Pieces and faults, and the least-squares problem that they make for given noises."""

    def __init__(self, pieces: Sequence[Piece], faults: tuple[Fault, ...], sizes: FloatArray) -> None:
        self.pieces, self.faults = tuple(pieces), faults
        self.held = np.diag(1.0 / sizes**2)
        self.sizes = sizes
        # No instrument shows next to nothing of what it measures, or the contrary.
        self.least = np.array([_LEAST_SCALE if fault.kind is Kind.SCALE else -np.inf for fault in faults])
        self.process = [piece.process for piece in pieces]
        self.feels_gusts = any(name in FLOW for name in pieces[0].outputs)

    def implied(self, at: Guess) -> list[Implied]:
        """Return what each piece should have measured."""
        return [
            implied(piece, self.faults, at.values, start) for piece, start in zip(self.pieces, at.starts, strict=True)
        ]

    def compared(self, at: Guess, seen: Sequence[Implied]) -> tuple[FloatArray, ...]:
        """Return measured less implied of each piece, NaN where nothing is compared, shape (n, outputs)."""
        edges_s = edges(self.faults, at.values)
        return tuple(compared(piece, found, edges_s) for piece, found in zip(self.pieces, seen, strict=True))

    def rows(self, at: Guess, seen: Sequence[Implied], noises: Disturbance) -> list[Rows]:
        """Return each piece in rows in which all noise is white."""
        return [
            _rows(piece, found, residual, start, replace(noises, process=process))
            for piece, found, residual, start, process in zip(
                self.pieces, seen, self.compared(at, seen), at.starts, self.process, strict=True
            )
        ]

    def moved(
        self,
        at: Guess,
        seen: Sequence[Implied],
        rows: Sequence[Rows],
        step: FloatArray,
        noises: Disturbance,
        *,
        near: bool,
    ) -> tuple[Guess, list[Implied]]:
        """Go along a step, as far as it leads on.

        Slopes are those of smoothed inputs, so that noise bends no delay; the misfit is that of noisy ones, and has its
        minimum elsewhere. From afar a step is gone as far as the misfit becomes smaller, as the filter of this place
        measures it; near the end, and where no part of it makes the misfit smaller, as far as the step that would be
        left, measured by the errors of this place, does: the natural level of Deuflhard (2004, Newton Methods for
        Nonlinear Problems, section 3.2).
        """
        directions = [item.start_step - item.back @ step for item in rows]

        def trials() -> Iterator[tuple[Guess, list[Implied]]]:
            for share in _SHARES:
                starts = tuple(start + share * way for start, way in zip(at.starts, directions, strict=True))
                trial = Guess(values=np.maximum(at.values + share * step, self.least), starts=starts)
                yield trial, self.implied(trial)

        if not near:
            edges_s = edges(self.faults, at.values)  # what is compared stays the same along the step
            before = self._height(at, seen, seen, noises, edges_s)
            for trial, there in trials():
                if self._height(trial, there, seen, noises, edges_s) < before:
                    return trial, there
        information, target = self._normal(rows, at.values)
        level = _level(information, target)
        for trial, there in trials():
            if _level(information, self._normal(self.rows(trial, there, noises), trial.values)[1]) < level:
                return trial, there
        return at, list(seen)

    def _height(
        self,
        at: Guess,
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

    def flow_is_colored(self, rows: Sequence[Rows]) -> bool:
        """Tell whether innovations of the flow hang together in time, as chance makes them once in 100."""
        outputs = self.pieces[0].outputs
        return any(
            whiteness([item.residual[:, k] for item in rows]) < _COLORED
            for k, name in enumerate(outputs)
            if name in FLOW
        )

    def step(self, rows: Sequence[Rows], values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the step of the faults, no farther than is linear, and their covariance for white innovations."""
        information, target = self._normal(rows, values)
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        step = np.asarray(covariance @ target)
        return step * min(1.0, _FARTHEST / max(float(np.abs(step / self.sizes).max()), 1e-300)), covariance

    def _normal(self, rows: Sequence[Rows], values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the matrix and the right-hand side of the normal equations of a step."""
        information = sum((_square(item.influence) for item in rows), self.held)
        return information, sum((_product(item.influence, item.residual) for item in rows), -self.held @ values)

    def misfit(self, rows: Sequence[Rows], values: FloatArray) -> float:
        """Return minus twice the restricted log likelihood, at the faults that are best for these noises."""
        information, target = self._normal(rows, values)
        squares = sum(float((item.residual**2).sum()) for item in rows) + float(values @ self.held @ values)
        explained = _level(information, target)
        determinants = sum(item.log_determinant for item in rows) + float(np.linalg.slogdet(information)[1])
        return squares - explained + determinants


def _rows(piece: Piece, found: Implied, residual: FloatArray, start: FloatArray, noises: Disturbance) -> Rows:
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
    return Rows(
        influence=(of_faults - own @ back[free]).reshape(*shape, faults),
        residual=(innovation - own @ step[free]).reshape(shape),
        back=back,
        start_step=step,
        squares=squares,
        counts=np.isfinite(residual).sum(axis=0).astype(np.float64),
        log_determinant=log_determinant + float(np.linalg.slogdet(information)[1]),
    )


def _level(information: FloatArray, target: FloatArray) -> float:
    """Return the square of the step that is left, measured by its errors."""
    return float(target @ np.linalg.solve(information, target))


def _pull(piece: Piece, start: FloatArray) -> float:
    free = piece.start_sizes > 0.0
    return float(((start[free] / piece.start_sizes[free]) ** 2).sum())


def _square(influence: FloatArray) -> FloatArray:
    flat = influence.reshape(-1, influence.shape[-1])
    return np.asarray(flat.T @ flat)


def _product(influence: FloatArray, residual: FloatArray) -> FloatArray:
    return np.asarray(influence.reshape(-1, influence.shape[-1]).T @ residual.ravel())

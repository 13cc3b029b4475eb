"""One stretch of data as output error sees it: a solution of the model through nodes, and what is measured of it.

Multiple shooting (Bock 1983): the solution starts anew at nodes, about a second apart, so that an unstable model
cannot carry a wrong start away. The jumps at the nodes are closed to first order in each step of the estimate
(condensing), so that nodes are no unknowns; at convergence there is no jump left, and the estimate is that of single
shooting. Where a start is lost to double precision (an unstable flight, long), a new one begins, and stays unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.identification.field import field, layout
from finback.identification.model_form import ModelForm
from finback.identification.shooting import OWN, shoot
from finback.identification.stretch import Stretch

_NODE_S: Final = 1.0
_STEP: Final = 0.1
"""Largest product of a Runge-Kutta step and an eigenvalue: its error is then some 1e-7 of a state per radian."""
_MOST_SUBSTEPS: Final = 20
_GROWTH: Final = 1e3
"""Where an error of the start has grown this much, a new start begins: the old one says no more about what follows, and
a model with small faults would be bent by it."""
EXTRAS: Final = 4
"""Biases of alpha, q and the elevator, and the delay."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Maneuver:
    """One stretch with its nodes.

    Attributes:
        stretch: the data.
        ends: first sample of each piece, and the last sample of all, shape (M + 1,).
        fresh: for each piece, which unknown start it begins with; -1 if it goes on from the piece before, shape (M,).
        substeps: integration steps in a sample interval.
    """

    stretch: Stretch
    ends: IntArray
    fresh: IntArray
    substeps: int

    @property
    def starts(self) -> int:
        """Number of unknown starts."""
        return int(self.fresh.max()) + 1

    @property
    def local(self) -> int:
        """Number of unknowns that belong to this stretch alone: the starts, then the extras."""
        return OWN * self.starts + EXTRAS


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """Where the solution starts and what the sensors add.

    Attributes:
        nodes: alpha and q at the start of each piece, shape (M, 2).
        extras: biases of alpha, q and the elevator, and the delay, in SI, shape (4,).
    """

    nodes: FloatArray
    extras: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Linearization:
    """The predicted measurements and how they move.

    Attributes:
        states: of the pieces, shape (n, 2).
        measured_less_states: as they are, biases taken off, shape (n, 2).
        residual: measured less predicted, the jumps at the nodes closed to first order, shape (n, 2).
        derivative: of the prediction by the local unknowns, then the coefficients, shape (n, 2, local + p).
        node_gain: of the nodes likewise, shape (M, 2, local + p).
        node_shift: what closes the jumps, shape (M, 2).
        jumps: at the end of each piece but the last, the end less the next start; zero before a fresh start, (M-1, 2).
    """

    states: FloatArray
    measured_less_states: FloatArray
    residual: FloatArray
    derivative: FloatArray
    node_gain: FloatArray
    node_shift: FloatArray
    jumps: FloatArray


def maneuver(stretch: Stretch, form: ModelForm, coefficients: FloatArray, state: FloatArray) -> tuple[Maneuver, Guess]:
    """Lay nodes over a stretch, with a first guess from smoothed states (n, 2)."""
    inputs, last = stretch.inputs, len(stretch) - 1
    pieces = max(1, round(last * stretch.interval_s / _NODE_S))
    ends = np.unique(np.linspace(0, last, pieces + 1).round().astype(np.int64))
    eigenvalues = np.linalg.eigvals(field(form, coefficients, state, inputs).jacobian)
    fastest = float(np.abs(eigenvalues).max())
    growth = np.maximum(eigenvalues.real.max(axis=1), 0.0) * stretch.interval_s
    fresh, lost = np.full(ends.size - 1, -1, dtype=np.int64), np.inf
    for piece, (first, after) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
        lost += float(growth[first:after].sum())
        if lost > np.log(_GROWTH):
            fresh[piece], lost = fresh.max() + 1, 0.0
    substeps = int(np.clip(np.ceil(fastest * stretch.interval_s / _STEP), 1, _MOST_SUBSTEPS))
    return (
        Maneuver(stretch=stretch, ends=ends, fresh=fresh, substeps=substeps),
        Guess(nodes=state[ends[:-1]].copy(), extras=np.zeros(EXTRAS)),
    )


def linearize(maneuver: Maneuver, form: ModelForm, coefficients: FloatArray, guess: Guess) -> Linearization:
    """Integrate all pieces and chain their derivatives."""
    stretch, ends = maneuver.stretch, maneuver.ends
    inputs = stretch.inputs.copy()
    inputs[:, 0] -= guess.extras[2]
    held = stretch.held.astype(np.float64)
    columns, pieces, size = maneuver.local + form.size, len(guess.nodes), form.size
    states, derivative = np.empty((len(stretch), 2)), np.empty((len(stretch), 2, columns))
    residual = np.array(stretch.measured)
    gain, shift = np.zeros((pieces, 2, columns)), np.zeros((pieces, 2))
    jumps = np.zeros((pieces - 1, 2))
    # Where the columns of a piece's own derivative belong: coefficients, elevator bias, delay.
    places = np.concatenate([maneuver.local + np.arange(size), [maneuver.local - 2, maneuver.local - 1]])
    for piece in range(pieces):
        first, after = int(ends[piece]), int(ends[piece + 1])
        if maneuver.fresh[piece] >= 0:
            column = OWN * int(maneuver.fresh[piece])
            gain[piece], shift[piece] = 0.0, 0.0
            gain[piece, :, column : column + OWN] = np.eye(2)
            if piece:
                jumps[piece - 1] = 0.0
        solution = shoot(
            layout(form),
            coefficients,
            guess.nodes[piece],
            inputs,
            held=held,
            samples=(first, after),
            interval_s=stretch.interval_s,
            delay_s=float(guess.extras[3]),
            substeps=maneuver.substeps,
        )
        own, direct = solution.sensitivity[:, :, :OWN], solution.sensitivity[:, :, OWN:]
        whole = own @ gain[piece]
        whole[:, :, places] += direct
        moved = own @ shift[piece]
        if piece + 1 < pieces:
            jumps[piece] = solution.states[-1] - guess.nodes[piece + 1]
            gain[piece + 1], shift[piece + 1] = whole[-1], moved[-1] + jumps[piece]
        upto = after if piece + 1 < pieces else after + 1
        states[first:upto] = solution.states[: upto - first]
        derivative[first:upto] = whole[: upto - first]
        residual[first:upto] -= solution.states[: upto - first] + moved[: upto - first]
    derivative[:, 0, maneuver.local - EXTRAS] += 1.0
    derivative[:, 1, maneuver.local - EXTRAS + 1] += 1.0
    residual -= guess.extras[:2]
    return Linearization(
        states=states,
        measured_less_states=stretch.measured - states - guess.extras[:2],
        residual=residual,
        derivative=derivative,
        node_gain=gain,
        node_shift=shift,
        jumps=jumps,
    )


def moved(guess: Guess, found: Linearization, local: FloatArray, change: FloatArray, share: float) -> Guess:
    """Take a share of a step of the local unknowns (local,) and of the coefficients (p,)."""
    step = found.node_gain @ np.concatenate([local, change]) + found.node_shift
    return replace(guess, nodes=guess.nodes + share * step, extras=guess.extras + share * local[-EXTRAS:])

"""A solution through nodes, piece by piece, and its derivative as if it were one: multiple shooting (Bock 1983).

The solution starts anew at nodes, about a second apart, so that an unstable model cannot carry a wrong start away. The
jumps at the nodes are closed to first order in each step of the estimate (condensing), so that nodes are no unknowns;
at convergence there is no jump left, and the estimate is that of single shooting. Where a start is lost to double
precision (an unstable flight, long), a new one begins, and stays unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray

_NODE_S: Final = 1.0
_GROWTH: Final = 1e3
"""Where an error of the start has grown this much, a new start begins: the old one says no more about what follows, and
a model with small faults would be bent by it."""

Shot = Callable[[int, int, FloatArray], tuple[FloatArray, FloatArray]]
"""Integrates from one sample to another, from a state (s,): states (n + 1, s), and their derivative by the state at the
start and by all that is no start, shape (n + 1, s, s + rest)."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """Where pieces of a stretch begin.

    Attributes:
        ends: first sample of each piece, and the last sample of all, shape (M + 1,).
        fresh: for each piece, which unknown start it begins with; -1 if it goes on from the piece before, shape (M,).
    """

    ends: IntArray
    fresh: IntArray

    @property
    def starts(self) -> int:
        """Number of unknown starts."""
        return int(self.fresh.max()) + 1


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """Where the solution starts and what the sensors add.

    Attributes:
        nodes: the state at the start of each piece, shape (M, s).
        extras: biases and delay of the stretch, in SI, shape (e,).
    """

    nodes: FloatArray
    extras: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Linearization:
    """The predicted measurements and how they move.

    Unknowns are those of the stretch alone (its starts, then its extras) and then the p coefficients.

    Attributes:
        states: of the pieces, shape (n, s).
        open_residual: measured less predicted as the pieces are, biases taken off, shape (n, outputs).
        residual: measured less predicted, the jumps at the nodes closed to first order, shape (n, outputs).
        derivative: of the prediction by the local unknowns, then the coefficients, shape (n, outputs, local + p).
        node_gain: of the nodes likewise, shape (M, s, local + p).
        node_shift: what closes the jumps, shape (M, s).
        jumps: at the end of each piece but the last, what is predicted there less what the next start predicts; zero
            before a fresh start, shape (M - 1, outputs).
    """

    states: FloatArray
    open_residual: FloatArray
    residual: FloatArray
    derivative: FloatArray
    node_gain: FloatArray
    node_shift: FloatArray
    jumps: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """A solution through nodes.

    Attributes:
        states: of the pieces, shape (n, s).
        derivative: of the whole solution, shape (n, s, local + p).
        shift: what closing the jumps to first order adds to the states, shape (n, s).
        ahead: the state that each piece but the last ends in, shape (M - 1, s); before a fresh start, that start.
        node_gain: as in ``Linearization``.
        node_shift: as in ``Linearization``.
    """

    states: FloatArray
    derivative: FloatArray
    shift: FloatArray
    ahead: FloatArray
    node_gain: FloatArray
    node_shift: FloatArray


def nodes_of(samples: int, interval_s: float, growth_1_s: FloatArray) -> Nodes:
    """Lay nodes over a stretch.

    Args:
        samples: of the stretch.
        interval_s: between them, in s.
        growth_1_s: how fast an error of the state grows at each sample, in 1/s, shape (n,).
    """
    last = samples - 1
    pieces = max(1, round(last * interval_s / _NODE_S))
    ends = np.unique(np.linspace(0, last, pieces + 1).round().astype(np.int64))
    growth = np.maximum(growth_1_s, 0.0) * interval_s
    fresh, lost = np.full(ends.size - 1, -1, dtype=np.int64), np.inf
    for piece, (first, after) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
        lost += float(growth[first:after].sum())
        if lost > np.log(_GROWTH):
            fresh[piece], lost = fresh.max() + 1, 0.0
    return Nodes(ends=ends, fresh=fresh)


def chained(nodes: Nodes, guess: Guess, shot: Shot, places: IntArray, columns: int) -> Chain:
    """Integrate all pieces and chain their derivatives.

    Args:
        nodes: where they begin.
        guess: from which states.
        shot: the integration of a piece.
        places: to which unknown each column of a piece's derivative belongs that is no start, shape (rest,).
        columns: number of all unknowns, the starts first.
    """
    pieces, size = guess.nodes.shape
    ends = nodes.ends
    count = int(ends[-1]) + 1
    states, derivative = np.empty((count, size)), np.empty((count, size, columns))
    shift = np.empty((count, size))
    gain, node_shift = np.zeros((pieces, size, columns)), np.zeros((pieces, size))
    ahead = guess.nodes[1:].copy()
    for piece in range(pieces):
        first, after = int(ends[piece]), int(ends[piece + 1])
        if nodes.fresh[piece] >= 0:
            column = size * int(nodes.fresh[piece])
            gain[piece], node_shift[piece] = 0.0, 0.0
            gain[piece, :, column : column + size] = np.eye(size)
            if piece:
                ahead[piece - 1] = guess.nodes[piece]
        found, sensitivity = shot(first, after, guess.nodes[piece])
        own, direct = sensitivity[:, :, :size], sensitivity[:, :, size:]
        whole = own @ gain[piece]
        whole[:, :, places] += direct
        moves = own @ node_shift[piece]
        if piece + 1 < pieces:
            ahead[piece] = found[-1]
            gain[piece + 1] = whole[-1]
            node_shift[piece + 1] = moves[-1] + found[-1] - guess.nodes[piece + 1]
        upto = after if piece + 1 < pieces else after + 1
        states[first:upto] = found[: upto - first]
        derivative[first:upto] = whole[: upto - first]
        shift[first:upto] = moves[: upto - first]
    return Chain(states=states, derivative=derivative, shift=shift, ahead=ahead, node_gain=gain, node_shift=node_shift)


def moved(guess: Guess, found: Linearization, local: FloatArray, change: FloatArray, share: float) -> Guess:
    """Take a share of a step of the local unknowns (local,) and of the coefficients (p,)."""
    step = found.node_gain @ np.concatenate([local, change]) + found.node_shift
    extras = guess.extras + share * local[local.size - guess.extras.size :]
    return replace(guess, nodes=guess.nodes + share * step, extras=extras)

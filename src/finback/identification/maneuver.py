"""One stretch of data as output error sees it: a solution of the model through nodes, and what is measured of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.chain import Guess, Linearization, Nodes, chained, nodes_of
from finback.identification.field import field, layout
from finback.identification.model_form import ModelForm
from finback.identification.shooting import OWN, shoot
from finback.identification.stretch import Stretch

_STEP: Final = 0.1
"""Largest product of a Runge-Kutta step and an eigenvalue: its error is then some 1e-7 of a state per radian."""
_MOST_SUBSTEPS: Final = 20
EXTRAS: Final = 4
"""Biases of alpha, q and the elevator, and the delay."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Maneuver:
    """One stretch with its nodes.

    Attributes:
        stretch: the data.
        nodes: where pieces of its solution begin.
        substeps: integration steps in a sample interval.
    """

    stretch: Stretch
    nodes: Nodes
    substeps: int

    @property
    def local(self) -> int:
        """Number of unknowns that belong to this stretch alone: the starts, then the extras."""
        return OWN * self.nodes.starts + EXTRAS


def maneuver(stretch: Stretch, form: ModelForm, coefficients: FloatArray, state: FloatArray) -> tuple[Maneuver, Guess]:
    """Lay nodes over a stretch, with a first guess from smoothed states (n, 2)."""
    eigenvalues = np.linalg.eigvals(field(form, coefficients, state, stretch.inputs).jacobian)
    fastest = float(np.abs(eigenvalues).max())
    nodes = nodes_of(len(stretch), stretch.interval_s, eigenvalues.real.max(axis=1))
    substeps = int(np.clip(np.ceil(fastest * stretch.interval_s / _STEP), 1, _MOST_SUBSTEPS))
    return (
        Maneuver(stretch=stretch, nodes=nodes, substeps=substeps),
        Guess(nodes=state[nodes.ends[:-1]].copy(), extras=np.zeros(EXTRAS)),
    )


def linearize(maneuver: Maneuver, form: ModelForm, coefficients: FloatArray, guess: Guess) -> Linearization:
    """Integrate all pieces and chain their derivatives."""
    stretch = maneuver.stretch
    inputs = stretch.inputs.copy()
    inputs[:, 0] -= guess.extras[2]
    held = stretch.held.astype(np.float64)

    def shot(first: int, after: int, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        solution = shoot(
            layout(form),
            coefficients,
            start,
            inputs,
            held=held,
            samples=(first, after),
            interval_s=stretch.interval_s,
            delay_s=float(guess.extras[3]),
            substeps=maneuver.substeps,
        )
        return solution.states, solution.sensitivity

    # Where the columns of a piece's own derivative belong: coefficients, elevator bias, delay.
    places = np.concatenate([maneuver.local + np.arange(form.size), [maneuver.local - 2, maneuver.local - 1]])
    found = chained(maneuver.nodes, guess, shot, places, maneuver.local + form.size)
    derivative = found.derivative
    derivative[:, 0, maneuver.local - EXTRAS] += 1.0
    derivative[:, 1, maneuver.local - EXTRAS + 1] += 1.0
    missed = stretch.measured - found.states - guess.extras[:2]
    return Linearization(
        states=found.states,
        open_residual=missed,
        residual=missed - found.shift,
        derivative=derivative,
        node_gain=found.node_gain,
        node_shift=found.node_shift,
        jumps=found.ahead - guess.nodes[1:],
    )

"""Output error in coefficient form: the numbers under which everything that was measured is most likely.

Outputs are any of V, α, θ, q, dq/dt, ax and az. Each stretch has its own start and, if asked, biases and a delay of the
elevator (Maine & Iliff 1985; Jategaonkar 2006, chapter 4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.identification.chain import Guess, Linearization, Nodes, chained, nodes_of
from finback.identification.coefficient.motion import Layout, Motion, layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.shooting import AFTER, OWN, delayed, shoot
from finback.identification.coefficient.track import STATES, Track
from finback.identification.estimate import Estimate
from finback.identification.gauss_newton import Problem, fitted

_STEP: Final = 0.1
"""Largest product of a Runge-Kutta step and an eigenvalue: its error is then some 1e-7 of a state per radian."""
_MOST_SUBSTEPS: Final = 20
RATE_OF: Final = {"q_dot_rad_s2": 3, "ax_m_s2": 4, "az_m_s2": 5}
"""Outputs that are no states -> their place among the rates."""


def output_error(
    used: Sequence[Track], options: CoefficientOptions, start: Estimate, least_noise: FloatArray
) -> Estimate:
    """Fit all stretches together.

    Args:
        used: the data.
        options: form, airframe, biases.
        start: the estimate by equation error.
        least_noise: the least standard deviations of the outputs that are believed, in SI, shape (outputs,).

    Returns:
        The estimate; its residuals are measured less predicted, whitened by the noise found.

    Raises:
        RefusedError: the data cannot determine every number, or the first estimate is of no use.
    """
    expected = options.biases.of(used[0].outputs)
    every = layouts(used, options)
    begun = [
        _begin(track, terms, start.coefficients, expected.deviations.size)
        for track, terms in zip(used, every, strict=True)
    ]
    problem = Problem(
        flights=tuple(track.flight for track in used),
        predictions=tuple(
            _prediction(track, terms, nodes, substeps)
            for track, terms, (nodes, substeps, _) in zip(used, every, begun, strict=True)
        ),
        form=options.form,
        expected=expected,
        least_noise=least_noise,
        correlated=options.noise_correlated,
        judged=True,
        begun_by="the equation error",
    )
    return fitted(problem, start.coefficients, [guess for _, _, guess in begun])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """One stretch as output error left it.

    Attributes:
        found: its linearization.
        white: what makes the noise of the outputs white with variance 1, shape (outputs, outputs).
        unknown: which of the stretch's own unknowns were estimated, shape (local,).
        fresh: samples at which a new unknown start begins, the first one too.
    """

    found: Linearization
    white: FloatArray
    unknown: NDArray[np.bool_]
    fresh: tuple[int, ...]

    def columns(self, which: NDArray[np.bool_]) -> FloatArray:
        """Return the derivative of the whitened prediction by some of the stretch's own unknowns, shape (m, k)."""
        columns: FloatArray = self.white @ self.found.derivative[:, :, : which.size][:, :, which]
        return columns.reshape(-1, columns.shape[2])


def fitted_stretches(
    used: Sequence[Track], options: CoefficientOptions, start: Estimate, fit: Estimate
) -> tuple[Fitted, ...]:
    """Return every stretch at the estimate ``fit``, which began at the estimate ``start``."""
    expected = options.biases.of(used[0].outputs)
    stretches = []
    for track, states, residual, extras in zip(used, fit.states, fit.residuals, fit.extras, strict=True):
        (terms,) = layouts([track], options)
        nodes, substeps, _ = _begin(track, terms, start.coefficients, extras.size)
        there = Guess(nodes=states[nodes.ends[:-1]], extras=extras)
        found = _linearize(track, terms, nodes, substeps, fit.coefficients, there)
        local = found.derivative.shape[2] - fit.coefficients.size
        white = frozen_array(np.diag(1.0 / fit.noise))
        if options.noise_correlated:
            white = frozen_array(np.linalg.lstsq(found.residual, residual, rcond=None)[0].T)
        begun = np.unique(nodes.fresh, return_index=True)[1]
        stretches.append(
            Fitted(
                found=found,
                white=white,
                unknown=np.concatenate([np.ones(local - extras.size, dtype=np.bool_), expected.deviations > 0.0]),
                fresh=tuple(nodes.ends[[m for m in begun.tolist() if nodes.fresh[m] >= 0]].tolist()),
            )
        )
    return tuple(stretches)


def layouts(used: Sequence[Track], options: CoefficientOptions) -> tuple[Layout, ...]:
    """Return form and airframe of each stretch as arrays."""
    return tuple(layout(options.form, options.airframe_of(track.flight), options.reference_speed_m_s) for track in used)


def _begin(track: Track, terms: Layout, numbers: FloatArray, extras: int) -> tuple[Nodes, int, Guess]:
    """Lay nodes over a stretch; also return the steps in a sample interval and the first guess."""
    jacobian = motion_of(track, terms, numbers, track.states, track.inputs).jacobian[:, :OWN]
    eigenvalues = np.linalg.eigvals(jacobian)
    nodes = nodes_of(len(track), track.interval_s, eigenvalues.real.max(axis=1))
    guess = Guess(nodes=track.states[nodes.ends[:-1]].copy(), extras=np.zeros(extras))
    return nodes, _steps(np.abs(eigenvalues), track.interval_s), guess


def steps_within(track: Track, terms: Layout, numbers: FloatArray) -> int:
    """Return how many Runge-Kutta steps a sample interval needs."""
    jacobian = motion_of(track, terms, numbers, track.states, track.inputs).jacobian[:, :OWN]
    return _steps(np.abs(np.linalg.eigvals(jacobian)), track.interval_s)


def _steps(speeds: FloatArray, interval_s: float) -> int:
    fastest = float(speeds.max())
    return int(np.clip(np.ceil(fastest * interval_s / _STEP), 1, _MOST_SUBSTEPS))


def motion_of(track: Track, terms: Layout, numbers: FloatArray, states: FloatArray, inputs: FloatArray) -> Motion:
    """Evaluate at all samples of a stretch."""
    return motion(terms, numbers, states, inputs, track.density_kg_m3, track.thrust_n, track.gravity_m_s2)


def _prediction(
    track: Track, terms: Layout, nodes: Nodes, substeps: int
) -> Callable[[FloatArray, Guess], Linearization]:
    """Return the linearization of a stretch as a function of the numbers and of a guess."""
    return lambda numbers, guess: _linearize(track, terms, nodes, substeps, numbers, guess)


def _linearize(
    track: Track, terms: Layout, nodes: Nodes, substeps: int, numbers: FloatArray, guess: Guess
) -> Linearization:
    """Integrate all pieces, chain their derivatives, and predict what was measured."""
    bias, delay = guess.extras[-2], guess.extras[-1]
    local, size, outputs = OWN * nodes.starts + guess.extras.size, numbers.size, len(track.outputs)

    def shot(first: int, after: int, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        return shoot(
            terms, numbers, start, track, samples=(first, after), bias_rad=bias, delay_s=delay, substeps=substeps
        )

    places = np.concatenate([local + np.arange(size), [local - AFTER, local - 1]])
    found = chained(nodes, guess, shot, places, local + size)
    inputs, slope = delayed(track, bias, delay)
    at = motion_of(track, terms, numbers, found.states, inputs)
    # What each output is: a state, or a rate that depends on state, numbers and elevator.
    values, by_state = np.empty((len(track), outputs)), np.zeros((len(track), outputs, OWN))
    derivative = np.zeros((len(track), outputs, local + size))
    for k, name in enumerate(track.outputs):
        if name in STATES:
            values[:, k] = found.states[:, STATES.index(name)]
            by_state[:, k, STATES.index(name)] = 1.0
            continue
        rate = RATE_OF[name]
        values[:, k] = at.rates[:, rate]
        by_state[:, k] = at.jacobian[:, rate]
        derivative[:, k, local:] = at.direct[:, rate]
        derivative[:, k, local - AFTER] = -at.elevator[:, rate]
        derivative[:, k, local - 1] = -at.elevator[:, rate] * slope
    derivative += by_state @ found.derivative
    for k in range(outputs):
        derivative[:, k, local - guess.extras.size + k] += 1.0
    missed = track.measured - values - guess.extras[:outputs]
    return Linearization(
        states=found.states,
        open_residual=missed,
        residual=missed - np.einsum("nos,ns->no", by_state, found.shift),
        derivative=derivative,
        node_gain=found.node_gain,
        node_shift=found.node_shift,
        jumps=np.einsum("nos,ns->no", by_state[nodes.ends[1:-1]], found.ahead - guess.nodes[1:]),
    )

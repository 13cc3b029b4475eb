"""Filter error in coefficient form: the numbers under which the innovations of a Kalman filter are most likely.

Output error takes all that the model does not say for noise of the sensors. In turbulence the motion itself is
disturbed: here white noise on dV/dt, dα/dt and dq/dt and white noise of every output are estimated together with the
numbers (Maine & Iliff 1981, SIAM J. Appl. Math. 41(3); Jategaonkar 2006, chapter 5). Gauss-Newton steps for the numbers
and the biases, and scoring steps for the logarithms of the densities, take turns. The derivative of the innovations is
that for the filter's gains as they are: innovations of the past say nothing of those to come, so what is left out moves
no estimate on average. In calm air the process noise goes to nothing, and the result to that of output error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.bounded import solve_within
from finback.identification.coefficient.directions import Directions, directions
from finback.identification.coefficient.innovations import Innovations, Noises, innovations
from finback.identification.coefficient.motion import Layout
from finback.identification.coefficient.options import CoefficientOptions, ExpectedBiases
from finback.identification.coefficient.output_error import layouts, steps_within
from finback.identification.coefficient.track import STATES, THETA, Track
from finback.identification.collinearity import Solution
from finback.identification.elimination import Elimination, project
from finback.identification.estimate import Estimate
from finback.identification.noise import noise_deviation

_TURNS: Final = 60
_CONVERGED: Final = 1e-2
"""In standard errors, from one turn to the next."""
_GAIN: Final = 1e-2
"""Twice a log-likelihood: densities that promise less stay."""
_DIFFERENCE: Final = 0.02
"""Step of the differences, of the logarithm of a density."""
_LONGEST: Final = 3.0
"""Step of the logarithm of a density."""
_LEAST_PROCESS: Final = 1e-8
"""Of the variance that the sensor noise gives a rate over a second: less is no process noise."""
_HALVINGS: Final = 8
_PITCH_RAD: Final = 0.3
"""How well the pitch angle at the start is known where it is not measured."""
_TOLD: Final = 0.5
_DAMPING: Final = 1e-6
_RATES: Final = (0, 1, 3)
"""States whose rates are disturbed."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """Where the iteration stands.

    Attributes:
        numbers: of the coefficients, shape (p,).
        densities: logarithms of the densities of the process (3) and the variances of the sensors (outputs).
        extras: biases and delay of each stretch, shape (stretches, outputs + 2).
    """

    numbers: FloatArray
    densities: FloatArray
    extras: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """What is fitted.

    Attributes:
        used: the data.
        options: form, airframe.
        terms: the same as arrays, of each stretch.
        expected: what is known beforehand of the biases.
        substeps: Runge-Kutta steps in a sample interval, of each stretch.
        start: variances of the states at the start, as far as they are no outputs, shape (4,).
        floor: lowest logarithms of the densities.
    """

    used: tuple[Track, ...]
    options: CoefficientOptions
    terms: tuple[Layout, ...]
    expected: ExpectedBiases
    substeps: tuple[int, ...]
    start: FloatArray
    floor: FloatArray

    def filtered(self, point: _Point, *, derived: bool = False, scored: bool = False) -> tuple[Innovations, ...]:
        """Filter all stretches."""
        values = np.exp(point.densities)
        noises = Noises(process=values[:3], sensors=values[3:], start=self.start)
        with np.errstate(all="ignore"):  # a filter that diverges is infinitely unlikely
            return tuple(
                innovations(
                    track, terms, point.numbers, extras, noises, substeps=substeps, derived=derived, scored=scored
                )
                for track, terms, extras, substeps in zip(
                    self.used, self.terms, point.extras, self.substeps, strict=True
                )
            )

    def cost(self, point: _Point) -> float:
        """Return twice the negative logarithm of the likelihood, but for a constant; inf where the filter diverged."""
        return self._total(self.filtered(point), point)

    def restricted(self, point: _Point) -> tuple[float, float]:
        """Return the cost, and what comes to it as numbers follow the data (Patterson & Thompson 1971).

        The second is the logarithm of the determinant of the numbers' information. Without it, slow disturbances are
        laid to the numbers: densities come out too small, at worst as nothing.
        """
        found, parts = self.eliminated(point)
        total = self._total(found, point)
        if not np.isfinite(total):
            return np.inf, np.inf
        free = self.options.form.free
        gram = sum((part.rows[:, free].T @ part.rows[:, free] for part in parts), np.zeros((free.size, free.size)))
        scale = np.sqrt(np.maximum(np.diag(gram), np.finfo(np.float64).tiny))
        # What no data tell apart does not move with the densities.
        scaled = gram / np.outer(scale, scale) + _DAMPING**2 * np.eye(free.size)
        return total, float(np.linalg.slogdet(scaled)[1] + 2.0 * np.log(scale).sum())

    def _total(self, found: Sequence[Innovations], point: _Point) -> float:
        total = sum(item.cost for item in found)
        deviations = self.expected.deviations
        known = (deviations > 0.0) & np.isfinite(deviations)
        total += float(((point.extras[:, known] / deviations[known]) ** 2).sum())
        return total if np.isfinite(total) else np.inf

    def eliminated(self, point: _Point) -> tuple[tuple[Innovations, ...], tuple[Elimination, ...]]:
        """Return the innovations, and their linearization with the extras of each stretch eliminated."""
        found = self.filtered(point, derived=True)
        size, own = self.options.form.size, point.extras.shape[1]
        parts = []
        for item, extras, track in zip(found, point.extras, self.used, strict=True):
            rows = np.concatenate(
                [item.derivative[:, :, size:], item.derivative[:, :, :size], item.whitened[:, :, np.newaxis]], axis=2
            )
            parts.append(project(rows.reshape(-1, own + size + 1), extras, self.expected, track.flight))
        return found, tuple(parts)

    def solve(self, parts: Sequence[Elimination], point: _Point, *, judged: bool) -> Solution:
        """Solve for the numbers that the linearized innovations ask for."""
        rows = np.concatenate([part.rows for part in parts])
        target = np.concatenate([part.rest for part in parts]) + rows @ point.numbers
        every = np.arange(self.options.form.size)
        return solve_within(rows, target, self.options.form, point.numbers, every, judged=judged)


def filter_error(
    used: Sequence[Track], options: CoefficientOptions, start: Estimate, least_noise: FloatArray
) -> Estimate:
    """Fit all stretches together.

    Args:
        used: the data.
        options: form, airframe, biases.
        start: the estimate by equation error.
        least_noise: the least standard deviations of the outputs that are believed, in SI, shape (outputs,).

    Returns:
        The estimate; its residuals are whitened innovations, its states filtered, its process noise that on dV/dt,
        dα/dt and dq/dt.

    Raises:
        RefusedError: the data cannot determine every number, or the first estimate is of no use.
    """
    problem, point = _begun(used, options, start, least_noise)
    if not np.isfinite(problem.cost(point)):
        raise RefusedError(
            "the model of the equation error leaves the range of double precision within a sample",
            hint="fly more maneuvers, or ask for fewer terms: the data say too little for a first estimate",
        )
    converged, turn = False, 0
    while not converged and turn < _TURNS:
        turn += 1
        before = point
        point, promised = _more_likely_densities(problem, point)
        _, parts = problem.eliminated(point)
        solution = problem.solve(parts, point, judged=False)
        point = _stepped(problem, point, solution, parts)
        moved = np.abs(point.numbers - before.numbers)
        small = (moved <= _CONVERGED * np.sqrt(np.diag(solution.covariance))).all()
        converged = bool(small) and promised <= _GAIN
    return _result(problem, point, turn, converged=converged)


def likelihood_gain(
    used: Sequence[Track], options: CoefficientOptions, calm: Estimate, found: Estimate, least_noise: FloatArray
) -> float:
    """Return twice the logarithm by which an estimate with process noise is more likely than one without.

    Args:
        used: the data.
        options: form, airframe, biases.
        calm: the estimate by output error.
        found: that by filter error.
        least_noise: as for ``filter_error``.
    """
    problem, _ = _begun(used, options, found, least_noise)
    none = np.concatenate([problem.floor[:3], 2.0 * np.log(calm.noise)])
    with_noise = np.log(np.concatenate([found.process, found.noise**2]))
    one = problem.restricted(_Point(numbers=calm.coefficients, densities=none, extras=calm.extras))
    two = problem.restricted(_Point(numbers=found.coefficients, densities=with_noise, extras=found.extras))
    return sum(one) - sum(two)


def late_directions(
    used: Sequence[Track], options: CoefficientOptions, found: Estimate, least_noise: FloatArray
) -> list[Directions]:
    """Return how a delay of the elevator, which was not estimated, would move the innovations of each stretch.

    Args:
        used: the data.
        options: form, airframe, biases.
        found: the estimate by filter error.
        least_noise: as for ``filter_error``.
    """
    problem, _ = _begun(used, options, found, least_noise)
    densities = np.log(np.concatenate([found.process, found.noise**2]))
    point = _Point(numbers=found.coefficients, densities=densities, extras=found.extras)
    stretches = []
    for item, influence in zip(problem.filtered(point, derived=True), found.influence, strict=True):
        own = item.derivative[:, :, options.form.size :].reshape(item.values.size, -1)
        unknown = own[:, problem.expected.deviations > 0.0]
        rows = influence.reshape(-1, options.form.size)
        stretches.append(directions(own[:, -1:], unknown, rows, item.whitened.reshape(-1)))
    return stretches


def process_told(
    used: Sequence[Track], options: CoefficientOptions, found: Estimate, least_noise: FloatArray
) -> NDArray[np.bool_]:
    """Return which process noise is told from none: the logarithm of its density has an error below 1/2, shape (3,).

    Args:
        used: the data.
        options: form, airframe, biases.
        found: the estimate by filter error.
        least_noise: as for ``filter_error``.
    """
    problem, _ = _begun(used, options, found, least_noise)
    densities = np.log(np.concatenate([found.process, found.noise**2]))
    point = _Point(numbers=found.coefficients, densities=densities, extras=found.extras)
    _, information = _scores(problem, point)
    damped = information + _DAMPING * np.trace(information) * np.eye(len(information))
    errors = np.sqrt(np.diag(np.linalg.inv(0.5 * damped)))[:3]
    told: NDArray[np.bool_] = errors < _TOLD
    return told


def _begun(
    used: Sequence[Track], options: CoefficientOptions, start: Estimate, least_noise: FloatArray
) -> tuple[_Problem, _Point]:
    """Return what is fitted, and where the iteration begins."""
    outputs = used[0].outputs
    terms, expected = layouts(used, options), options.biases.of(outputs)
    noise = np.array([noise_deviation([track.measured[:, k] for track in used]) for k in range(len(outputs))])
    sensors = np.maximum(noise, least_noise) ** 2
    states = np.array([noise_deviation([track.states[:, k] for track in used]) for k in range(len(STATES))]) ** 2
    for k, name in enumerate(outputs):
        if name in STATES:
            states[STATES.index(name)] = max(states[STATES.index(name)], sensors[k])
    if THETA not in outputs:
        states[STATES.index(THETA)] = _PITCH_RAD**2
    process = np.maximum(states[list(_RATES)], np.finfo(np.float64).tiny)
    problem = _Problem(
        used=tuple(used),
        options=options,
        terms=terms,
        expected=expected,
        substeps=tuple(steps_within(track, own, start.coefficients) for track, own in zip(used, terms, strict=True)),
        start=states,
        floor=np.log(np.concatenate([_LEAST_PROCESS * process, least_noise**2])),
    )
    point = _Point(
        numbers=start.coefficients,
        # Half of the noise's variance over a second as a first guess of the process.
        densities=np.maximum(np.log(np.concatenate([0.5 * process, sensors])), problem.floor),
        extras=np.zeros((len(used), expected.deviations.size)),
    )
    return problem, point


def _result(problem: _Problem, point: _Point, turns: int, *, converged: bool) -> Estimate:
    found, parts = problem.eliminated(point)
    solution = problem.solve(parts, point, judged=True)
    residuals = tuple(item.whitened for item in found)
    squares = sum(float((item**2).sum()) for item in residuals)
    size = problem.options.form.size
    unknown = problem.options.form.free.size + len(parts) * int((problem.expected.deviations > 0.0).sum())
    return Estimate(
        coefficients=point.numbers,
        covariance=solution.covariance,
        variance=squares / max(sum(item.size for item in residuals) - unknown, 1),
        residuals=residuals,
        states=tuple(item.states for item in found),
        condition_number=solution.condition_number,
        iterations=turns,
        converged=converged,
        noise=frozen_array(np.exp(0.5 * point.densities[3:])),
        influence=tuple(
            part.rows[: item.size].reshape(*item.shape, size) for part, item in zip(parts, residuals, strict=True)
        ),
        extras=frozen_array(point.extras),
        extra_errors=frozen_array(np.stack([part.local_errors(solution.covariance) for part in parts])),
        process=frozen_array(np.exp(point.densities[:3])),
    )


def _more_likely_densities(problem: _Problem, point: _Point) -> tuple[_Point, float]:
    """Take a scoring step of the logarithms of the densities; also return what it promised."""
    climbs, information = _scores(problem, point)
    least, known = problem.restricted(point)
    for k, step in enumerate(_DIFFERENCE * np.eye(climbs.size)[:3]):
        after = problem.restricted(replace(point, densities=point.densities + step))[1]
        climbs[k] += (after - known) / _DIFFERENCE
    free = (point.densities > problem.floor) | (climbs < 0.0)
    step = np.zeros(climbs.size)
    scale = np.maximum(np.sqrt(np.diag(information)[free]), np.finfo(np.float64).tiny)
    scaled = information[np.ix_(free, free)] / np.outer(scale, scale) + _DAMPING * np.eye(scale.size)
    step[free] = -np.linalg.solve(scaled, climbs[free] / scale) / scale
    within = np.maximum(point.densities + np.clip(step, -_LONGEST, _LONGEST), problem.floor) - point.densities
    # A density near nothing has little to gain nearby, however much it would by growing a thousandfold.
    promised = float(-0.5 * climbs @ np.where(step > 0.0, step, within))
    share = 1.0
    for _ in range(_HALVINGS):
        tried = replace(point, densities=point.densities + share * within)
        if sum(problem.restricted(tried)) <= least + known + _GAIN:
            return tried, promised
        share *= 0.5
    return point, promised


def _scores(problem: _Problem, point: _Point) -> tuple[FloatArray, FloatArray]:
    """Return the first and the expected second derivative of twice the negative log-likelihood by the log-densities.

    That of innovations that are independent is Σ d(ln s) d(ln s) + 2 dν dν / s.
    """
    here, size = problem.filtered(point, scored=True), point.densities.size
    whitened = np.concatenate([item.whitened for item in here]).reshape(-1, 1)
    spread, moved = (np.concatenate([item.scores[k] for item in here]).reshape(-1, size) for k in range(2))
    climbs = (spread * (1.0 - whitened**2) + 2.0 * whitened * moved).sum(axis=0)
    return climbs, spread.T @ spread + 2.0 * moved.T @ moved


def _stepped(problem: _Problem, point: _Point, solution: Solution, parts: Sequence[Elimination]) -> _Point:
    """Move numbers and extras as far as the innovations get more likely."""
    change = solution.coefficients - point.numbers
    local = np.stack([part.local(change) for part in parts])
    after = replace(point, numbers=solution.coefficients, extras=point.extras + local)
    return _shortened(problem, point, after)


def _shortened(problem: _Problem, before: _Point, after: _Point) -> _Point:
    """Halve a step until the innovations are more likely; stay if none makes them so."""
    least, share = problem.cost(before), 1.0
    for _ in range(_HALVINGS):
        tried = replace(
            before,
            numbers=before.numbers + share * (after.numbers - before.numbers),
            densities=before.densities + share * (after.densities - before.densities),
            extras=before.extras + share * (after.extras - before.extras),
        )
        if problem.cost(tried) <= least + _GAIN:
            return tried
        share *= 0.5
    return before

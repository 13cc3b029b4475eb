"""The equations of motion of a stretch, averaged under test functions, and what noise makes of them.

Where accelerometers are, the forces are theirs; elsewhere they come from dV/dt and dα/dt, as the moment does from
dq/dt, in weak form: -∫ w' x dt = ∫ w dx/dt dt, so no signal is differentiated (Klein & Morelli 2006, chapter 5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.coefficient.averages import TestFunctions, functions_of
from finback.identification.coefficient.motion import RATES, Motion, layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.track import STATES, Track

EQUATIONS: Final = 3
"""Along, across and in pitch."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equations:
    """The weak equations of one stretch, along, across and in pitch: weighted means under K test functions.

    Attributes:
        rows: regressors, shape (K, 3, p).
        target: what they must explain, shape (K, 3).
        functions: the test functions.
        places: of each equation, the place of its rate or force among the rates.
        left: of each equation, the output whose noise is in its target; -1 if it is not measured.
    """

    rows: FloatArray
    target: FloatArray
    functions: TestFunctions
    places: tuple[int, int, int]
    left: tuple[int, int, int]

    def felt(self, equation: int) -> bool:
        """Return whether an equation's target is a specific force, not a rate."""
        return self.places[equation] >= RATES - 2


def equations(track: Track, options: CoefficientOptions, numbers: FloatArray) -> Equations:
    """Average the equations of a stretch; dα/dt in Cm is that of the numbers given."""
    functions = functions_of(track, options)
    at_samples, through = _sides(track, options, numbers)
    rows, targets, places, lefts = [], [], [], []
    for force, state in (("ax_m_s2", 0), ("az_m_s2", 1), ("", 3)):
        if force in track.outputs:
            place, output = ("ax_m_s2", "az_m_s2").index(force) + RATES - 2, track.outputs.index(force)
            row, known = functions.mean(at_samples[0][:, place]), functions.mean(at_samples[1][:, place])
            left = functions.mean(track.measured[:, output])
        else:
            place, output = state, track.outputs.index(STATES[state]) if STATES[state] in track.outputs else -1
            row, known = (
                _through(functions, middle[:, place], jump[:, place], track.interval_s)
                for middle, jump in zip(through[:2], through[2:], strict=True)
            )
            left = functions.rate(track.states[:, state])
        rows.append(row)
        targets.append(left - known)
        places.append(place)
        lefts.append(output)
    return Equations(
        rows=np.stack(rows, axis=1),
        target=np.stack(targets, axis=1),
        functions=functions,
        places=(places[0], places[1], places[2]),
        left=(lefts[0], lefts[1], lefts[2]),
    )


def _through(functions: TestFunctions, middle: FloatArray, jump: FloatArray, interval_s: float) -> FloatArray:
    """Average what jumps at samples; the trapezoidal rule misses interval²/12 of every jump of a slope.

    A test function's slope comes multiplied by the interval.
    """
    whole = functions.mean(middle)
    return whole - interval_s / 12.0 * functions.rate(jump) if jump.any() else whole


def _sides(
    track: Track, options: CoefficientOptions, numbers: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Return how rates depend on the numbers (n, 6, p) and what is known of them (n, 6), at the measured states.

    First at the samples, after what jumps there. Then as integrals see them: the mean of both sides of a jump, the same
    for what is known, and both jumps. An input that goes straight has corners at samples; a second difference of it
    stands for what the trapezoidal rule misses at these.
    """
    terms = layout(options.form, options.airframe_of(track.flight), options.reference_speed_m_s)

    def at(inputs: FloatArray) -> Motion:
        found = motion(terms, numbers, track.states, inputs, track.density_kg_m3, track.thrust_n, track.gravity_m_s2)
        return replace(found, rates=found.rates - found.direct @ numbers)

    corners = np.zeros_like(track.inputs)
    corners[1:-1] = np.diff(track.inputs, n=2, axis=0) / 12.0
    corners[:, track.held] = 0.0
    here, after, before = at(track.inputs), at(track.inputs + corners), at(track.inputs_before + corners)
    return (here.direct, here.rates), (
        0.5 * (after.direct + before.direct),
        0.5 * (after.rates + before.rates),
        after.direct - before.direct,
        after.rates - before.rates,
    )

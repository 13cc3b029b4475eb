"""How noise reaches equation error: gains from every source of noise to the equations of motion.

Sources are the sensors, whose noise is in the targets and in the states that the regressors are taken at; gusts, which
move V and α as measured but are no acceleration of the aircraft, where forces are not measured; and forces and a moment
that the model does not know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.identification.coefficient.averages import Bumps, TestFunctions
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.track import STATES, Track
from finback.identification.coefficient.weak_equations import EQUATIONS, Equations

_LONGEST_S: Final = 20.0
"""Longer stretches are cut. Noise that remembers 2 s then has errors too small by 5 % at most."""
_LINES: Final = 30
"""Cosine transforms of a section, closer at low frequencies."""
_HIGHEST: Final = 1.0
"""Cosines of how many half periods in a half width are the last: beyond, a bump leaves little."""
GUSTS: Final = 2
"""Sources after the sensors: gusts along and across; then the three equations' own."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a stretch, with its equations in units of their residuals.

    Attributes:
        outputs: what is measured, the first sources.
        interval_s: between samples.
        functions: K test functions over n samples.
        rows: whitened regressors, shape (K, 3, p).
        residual: whitened, shape (K, 3).
        weight: size of the residuals of each equation, shape (3,).
        slopes: of the rates by V, α, θ and q, shape (n, 6, 4).
        samples: these, of the stretch.
        stretch: which stretch.
        places: as of ``Equations``.
        left: as of ``Equations``.
    """

    outputs: tuple[str, ...]
    interval_s: float
    functions: TestFunctions
    rows: FloatArray
    residual: FloatArray
    weight: FloatArray
    slopes: FloatArray
    samples: slice
    stretch: int
    places: tuple[int, int, int]
    left: tuple[int, int, int]

    @property
    def sources(self) -> int:
        """How many there are."""
        return len(self.outputs) + GUSTS + EQUATIONS

    def felt(self, equation: int) -> bool:
        """Return whether the force is measured."""
        return self.places[equation] >= len(STATES)

    def direct(self, equation: int) -> list[int]:
        """Return the sources that an equation's target holds as they are."""
        own = [len(self.outputs) + GUSTS + equation]
        return [*own, self.left[equation]] if self.felt(equation) and self.left[equation] >= 0 else own

    def rated(self, equation: int) -> list[int]:
        """Return the sources whose rate an equation's target holds."""
        if self.felt(equation):
            return []
        gust = [len(self.outputs) + equation] if equation < GUSTS else []
        return [*gust, self.left[equation]] if self.left[equation] >= 0 else gust

    def through(self, equation: int) -> list[tuple[int, FloatArray]]:
        """Return the sensors of states, with what an equation's right side makes of their noise, shape (n,)."""
        return [
            (source, self.slopes[:, self.places[equation], STATES.index(name)])
            for source, name in enumerate(self.outputs)
            if name in STATES
        ]

    def gains(self, columns: FloatArray) -> FloatArray:
        """Return what sums of whitened equations, shape (K, 3, c), make of every source, shape (sources, n, 3, c)."""
        count = len(self.slopes)
        found = np.zeros((self.sources, count, EQUATIONS, columns.shape[2]))
        for equation in range(EQUATIONS):
            scaled = columns[:, equation] / self.weight[equation]
            mean = self.functions.spread(scaled)
            for source in self.direct(equation):
                found[source, :, equation] += mean
            if rated := self.rated(equation):
                rate = self.functions.spread_rate(scaled)
                for source in rated:
                    found[source, :, equation] += rate
            for source, slope in self.through(equation):
                found[source, :, equation] -= slope[:, np.newaxis] * mean
        return found

    def lines(self, half_width_s: float) -> FloatArray:
        """Return cosine transforms along the equations of bumps, or some of the waves, shape (m, K)."""
        count = len(self.residual)
        if not isinstance(self.functions, Bumps):
            chosen: FloatArray = np.eye(count)[_spaced(count)]
            return chosen
        spacing = self.interval_s * (float(np.diff(self.functions.starts).mean()) if count > 1 else 1.0)
        last = min(count, max(1, int(_HIGHEST * count * spacing / half_width_s)))
        order = _spaced(last)[:, np.newaxis]
        found: FloatArray = np.sqrt(2.0 / count) * np.cos(np.pi * order * (np.arange(count) + 0.5) / count)
        return found


def _spaced(count: int) -> IntArray:
    """Return some of 0 … count - 1: all up to a third of ``_LINES``, the rest ever further apart."""
    if count <= _LINES:
        return np.arange(count, dtype=np.int64)
    near = _LINES // 3
    far = np.geomspace(near, count - 1, _LINES - near).round()
    return np.unique(np.concatenate([np.arange(near), far])).astype(np.int64)


def sections(
    used: Sequence[Track],
    pieces: Sequence[Equations],
    options: CoefficientOptions,
    numbers: FloatArray,
    weight: FloatArray,
) -> list[Section]:
    """Cut the equations of all stretches, linearized about the measured states and the numbers found."""
    found = []
    for index, (track, piece) in enumerate(zip(used, pieces, strict=True)):
        terms = layout(options.form, options.airframe_of(track.flight), options.reference_speed_m_s)
        at = motion(terms, numbers, track.states, track.inputs, track.density_kg_m3, track.thrust_n, track.gravity_m_s2)
        missed = piece.target - piece.rows @ numbers
        for chosen, seen, functions in piece.functions.sections(round(_LONGEST_S / track.interval_s)):
            found.append(
                Section(
                    outputs=track.outputs,
                    interval_s=track.interval_s,
                    functions=functions,
                    rows=piece.rows[chosen] / weight[:, np.newaxis],
                    residual=missed[chosen] / weight,
                    weight=weight,
                    slopes=at.jacobian[seen],
                    samples=seen,
                    stretch=index,
                    places=piece.places,
                    left=piece.left,
                )
            )
    return found

"""Stability, period, damping and pitch rate at the equilibria: what folds and alpha alone do not show.

A model whose damping has the wrong sign, or whose time runs ten times too fast, can have every fold and every
equilibrium angle right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.flight.equilibrium import Field, SimulatedEquilibrium
from finback.units import from_si, to_si
from finback.validation.metric import Metric, Tolerance, worst
from finback.validation.prediction import PredictedEquilibrium

Pair = tuple[SimulatedEquilibrium, PredictedEquilibrium]
"""One equilibrium of the simulator and the predicted one that was paired with it."""

_STEP_RAD: Final = to_si(0.5, "deg")  # several corners of a fine table, so that a chord is not taken for the slope
_STEP_RAD_S: Final = to_si(0.5, "deg_s")
_STABILITY: Final = Tolerance(value=0.5, source="definition: the stability of an equilibrium is right or wrong")
_PERIOD_SHARE: Final = 0.10
_PERIOD_SOURCE: Final = "14 CFR 60, App. A, Table A2A, 2.c.9 (phugoid), taken over for the short period: period ±10 %"
_DAMPING: Final = Tolerance(
    value=0.02,
    source="14 CFR 60, App. A, Table A2A, 2.c.9 (phugoid), taken over for the short period: damping ratio ±0.02",
)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Mode:
    """Undamped period in s and damping ratio of an oscillation with this trace and determinant > 0."""

    period_s: float
    damping_ratio: float

    @classmethod
    def of(cls, trace: float, determinant: float) -> _Mode:
        frequency = math.sqrt(determinant)
        return cls(period_s=2.0 * math.pi / frequency, damping_ratio=-0.5 * trace / frequency)


def linear_metrics(pairs: Sequence[Pair], field: Field, pitch_rate: Tolerance) -> tuple[Metric, ...]:
    """Return how the equilibria behave: stability of all pairs, worst pitch rate, worst period and damping ratio.

    Period (undamped) and damping ratio are those of the simulator's stable equilibria, its Jacobian by central
    differences over ±0.5 deg and ±0.5 deg/s; a wrong one that the model calls a saddle is found by the stability.

    Args:
        pairs: equilibria in the fitted domain.
        field: (alpha, q, elevator) -> (dα/dt, dq/dt), the simulator's.
        pitch_rate: tolerance of q in rad/s.
    """
    if not pairs:
        return ()
    mistaken = [(ours, theirs) for ours, theirs in pairs if ours.stable != theirs.kind.stable]
    wrong = [ours for ours, _ in mistaken]
    metrics = [
        Metric(
            name="equilibria: stability predicted wrongly",
            unit="1",
            simulated=0.0,
            predicted=float(len(wrong)),
            uncertainty=float(sum(_may_be_either(theirs) for _, theirs in mistaken)),
            tolerance=_STABILITY.value,
            source=_STABILITY.source,
            note=f"of {len(pairs)}" + (f", first {_place(wrong[0])}" if wrong else ""),
        ),
        worst([_pitch_rate(ours, theirs, pitch_rate) for ours, theirs in pairs]),
    ]
    modes = [rows for ours, theirs in pairs if (rows := _modes(ours, theirs, field))]
    if modes:
        metrics += [worst([rows[0] for rows in modes]), worst([rows[1] for rows in modes])]
    return tuple(metrics)


def _may_be_either(theirs: PredictedEquilibrium) -> bool:
    """Tell whether the 95 % interval of the trace or of the determinant holds zero: its sign is then not known."""
    return abs(theirs.trace_1_s) <= theirs.half_width(trace=1.0) or abs(theirs.determinant_1_s2) <= theirs.half_width(
        determinant=1.0
    )


def _pitch_rate(ours: SimulatedEquilibrium, theirs: PredictedEquilibrium, tolerance: Tolerance) -> Metric:
    return Metric(
        name="equilibria: pitch rate",
        unit="rad_s",
        simulated=ours.q_rad_s,
        predicted=theirs.q_rad_s,
        uncertainty=theirs.half_width(q=1.0),
        tolerance=tolerance.value,
        source=tolerance.source,
        note=_place(ours),
    )


def _modes(ours: SimulatedEquilibrium, theirs: PredictedEquilibrium, field: Field) -> tuple[Metric, Metric] | None:
    """Return period and damping ratio where both sides have them."""
    trace, determinant = theirs.trace_1_s, theirs.determinant_1_s2
    simulated_trace, simulated_determinant = _invariants(field, ours)
    if not (ours.stable and simulated_determinant > 0.0 and determinant > 0.0):
        return None
    simulated, predicted = _Mode.of(simulated_trace, simulated_determinant), _Mode.of(trace, determinant)
    period = Metric(
        name="equilibria: undamped period",
        unit="s",
        simulated=simulated.period_s,
        predicted=predicted.period_s,
        uncertainty=theirs.half_width(determinant=-0.5 * predicted.period_s / determinant),
        tolerance=_PERIOD_SHARE * simulated.period_s,
        source=_PERIOD_SOURCE,
        note=_place(ours),
    )
    damping = Metric(
        name="equilibria: damping ratio",
        unit="1",
        simulated=simulated.damping_ratio,
        predicted=predicted.damping_ratio,
        uncertainty=theirs.half_width(
            trace=-0.5 / math.sqrt(determinant), determinant=-0.5 * predicted.damping_ratio / determinant
        ),
        tolerance=_DAMPING.value,
        source=_DAMPING.source,
        note=_place(ours),
    )
    return period, damping


def _invariants(field: Field, point: SimulatedEquilibrium) -> tuple[float, float]:
    """Return trace and determinant of the simulator's Jacobian; they do not depend on the coordinates."""

    def column(rates: Callable[[float], tuple[float, float]], step: float) -> FloatArray:
        difference: FloatArray = np.subtract(rates(step), rates(-step)) / (2.0 * step)
        return difference

    by_alpha = column(lambda step: field(point.alpha_rad + step, point.q_rad_s, point.elevator_rad), _STEP_RAD)
    by_q = column(lambda step: field(point.alpha_rad, point.q_rad_s + step, point.elevator_rad), _STEP_RAD_S)
    return float(by_alpha[0] + by_q[1]), float(by_alpha[0] * by_q[1] - by_q[0] * by_alpha[1])


def _place(point: SimulatedEquilibrium) -> str:
    elevator, alpha = from_si(point.elevator_rad, "deg"), from_si(point.alpha_rad, "deg")
    return f"at elevator {elevator:z.2f} deg, alpha {alpha:z.1f} deg"

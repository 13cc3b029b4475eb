"""The report's tables as rows of text: results in the units that people read, with the digits they support."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.digits import decimals
from finback.identification.identify import Identification
from finback.records import FlightRecord, Sweep
from finback.units import from_si
from finback.validation.metric import Judgement, Metric
from finback.validation.prediction import PredictedFold
from finback.validation.validate import Validation
from finback.views.fold_figure import FoldCase
from finback.views.labels import EXTRAPOLATED, angle, display_unit, minus, short, unit_text, with_error

_MOST_DECIMALS: Final = 7


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MetricRow:
    """One metric, ready to be read.

    Attributes:
        name: what is compared.
        unit: of the numbers.
        simulated: the simulator's value.
        predicted: the model's value.
        error: simulated less predicted.
        uncertainty: U95.
        tolerance: what is allowed.
        judgement: agrees, disagrees or inconclusive.
        counted: whether the verdict counts it.
        source: number of the tolerance's source in the list of sources, from 1.
        note: what a reader must know.
    """

    name: str
    unit: str
    simulated: str
    predicted: str
    error: str
    uncertainty: str
    tolerance: str
    judgement: str
    counted: bool
    source: int
    note: str


def metric_row(metric: Metric, sources: Sequence[str]) -> MetricRow:
    """Return a metric as text; its four numbers have the digits that uncertainty and tolerance support."""
    unit = display_unit(metric.unit)
    numbers = (metric.simulated, metric.predicted, metric.error, metric.uncertainty)
    tolerance = from_si(metric.tolerance, unit)
    known = [value for value in (from_si(metric.uncertainty, unit), tolerance) if math.isfinite(value) and value > 0]
    places = min(max(0, decimals(min(known))), _MOST_DECIMALS)
    if all(float(value).is_integer() for value in numbers if math.isfinite(value)) and metric.unit == "1":
        places = 0
    texts = [_fixed(from_si(value, unit), places) for value in numbers]
    return MetricRow(
        name=minus(metric.name),
        unit=unit_text(unit) or "–",
        simulated=texts[0],
        predicted=texts[1],
        error=texts[2],
        uncertainty=texts[3],
        tolerance=minus(f"{tolerance:.4g}"),
        judgement=metric.judgement.value,
        counted=metric.counted,
        source=sources.index(metric.source) + 1,
        note=minus(metric.note),
    )


def tolerance_sources(validation: Validation) -> tuple[str, ...]:
    """Return where the tolerances come from, each source once, in the order of the metrics."""
    return tuple(dict.fromkeys(metric.source for metric in validation.metrics))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldRow:
    """One fold, ready to be read; elevators and alphas in degrees.

    Attributes:
        name: which fold.
        predicted: elevator with 95 % interval.
        predicted_alpha: alpha with 95 % interval.
        hold: by hold bisection, with 95 % uncertainty.
        bracket: of the hold bisection.
        ramps: extrapolated from ramps, with 95 % uncertainty.
        curve: of the simulator's own equilibrium curve.
        remark: that it is extrapolated, or not predicted.
    """

    name: str
    predicted: str
    predicted_alpha: str
    hold: str
    bracket: str
    ramps: str
    curve: str
    remark: str


def fold_row(case: FoldCase) -> FoldRow:
    """Return a fold as text."""
    hold, ramp = case.hold, case.ramp
    low, high = (from_si(limit, "deg") for limit in hold.bracket_rad)
    predicted = [_fold_texts(fold) for fold in case.predicted] or [("–", "–", "not predicted")]
    elevator, alpha, remark = predicted[0]
    return FoldRow(
        name=minus(f"α {from_si(hold.table_alpha_rad, 'deg'):z.2f}°"),
        predicted=elevator,
        predicted_alpha=alpha,
        hold=with_error(from_si(hold.elevator_rad, "deg"), from_si(hold.uncertainty_rad, "deg")),
        bracket=minus(f"{low:.5f} … {high:.5f}"),
        ramps=with_error(from_si(ramp.elevator_rad, "deg"), from_si(ramp.uncertainty_rad, "deg")),
        curve=minus(f"{from_si(hold.table_elevator_rad, 'deg'):.6f}"),
        remark=remark,
    )


def _fold_texts(fold: PredictedFold) -> tuple[str, str, str]:
    elevator = angle(fold.elevator_rad, fold.elevator_interval_rad)
    return elevator, angle(fold.alpha_rad, fold.alpha_interval_rad), "" if fold.in_domain else EXTRAPOLATED


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRow:
    """One flight of the sweep, ready to be read.

    Attributes:
        name: the flight's name.
        outcome: how it ended.
        note: the same in a sentence.
        duration: in s.
        elevator: lowest and highest, in deg.
        alpha: lowest and highest, in deg.
        used: what the fit used of it.
    """

    name: str
    outcome: str
    note: str
    duration: str
    elevator: str
    alpha: str
    used: str


def flight_rows(sweep: Sweep, identification: Identification) -> tuple[FlightRow, ...]:
    """Return the flights of the sweep as text."""
    return tuple(
        FlightRow(
            name=record.name,
            outcome=record.outcome.value,
            note=minus(record.note),
            duration=f"{record.duration_s:.2f}",
            elevator=_range(record, "elevator_rad"),
            alpha=_range(record, "alpha_rad"),
            used=_used(record, identification),
        )
        for record in sweep.records
    )


def fit_rows(identification: Identification) -> tuple[tuple[str, str], ...]:
    """Return what the identification rests on: name and text."""
    options, diagnostics = identification.options, identification.diagnostics
    window = from_si(np.array(options.alpha_window_rad), "deg")
    alpha_noise = from_si(identification.alpha_noise_rad, "deg")
    q_noise = from_si(identification.q_noise_rad_s, "deg_s")
    return (
        ("window of α", minus(f"{window[0]:g} … {window[1]:g} deg")),
        ("noise found (1σ)", f"α {short(alpha_noise)} deg, q {short(q_noise)} deg/s"),
        ("test functions", f"half width {options.half_width_s:g} s, every {options.spacing_s:g} s"),
        ("equations of each kind", f"{diagnostics.equations}"),
        ("samples used", f"{100.0 * diagnostics.used_fraction:.1f} %, {len(identification.segments)} stretches"),
        ("condition number", short(diagnostics.condition_number)),
        ("mean square residual (1 if all is explained)", _pair(diagnostics.chi_square)),
        ("correlation of neighboring residuals (0 if all is explained)", _pair(diagnostics.lag1_correlation)),
    )


def summary(validation: Validation) -> dict[str, int]:
    """Return how many counted metrics say what, and how many are not counted."""
    counted = [metric.judgement for metric in validation.metrics if metric.counted]
    found = {judgement.value: counted.count(judgement) for judgement in Judgement}
    return {**found, "counted": len(counted), "not_counted": len(validation.metrics) - len(counted)}


def _pair(values: tuple[float, float]) -> str:
    return minus(f"dα/dt {values[0]:.3f}, dq/dt {values[1]:.3f}")


def _range(record: FlightRecord, name: str) -> str:
    values = record.columns.get(name)
    finite = values[np.isfinite(values)] if values is not None else np.empty(0)
    if not finite.size:
        return "–"
    low, high = from_si(np.array([finite.min(), finite.max()]), "deg")
    return minus(f"{low:.1f} … {high:.1f}")


def _used(record: FlightRecord, identification: Identification) -> str:
    mine = [segment for segment in identification.segments if segment.flight == record.name]
    return ", ".join(f"{segment.start_s:.2f} … {segment.end_s:.2f} s" for segment in mine) or "nothing"


def _fixed(value: float, places: int) -> str:
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return minus("∞" if value > 0 else "-∞")
    return minus(f"{value + 0.0:.{places}f}")

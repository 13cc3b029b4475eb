"""One fold from near: the predicted curve, the slow ramps, and how far the answers lie apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from matplotlib.axes import Axes

from finback.arrays import FloatArray
from finback.dynamics.any_form import AnyAnalysis
from finback.units import from_si, to_si
from finback.validation.bifurcation import HoldFold, RampFold
from finback.validation.prediction import PredictedFold, prediction
from finback.validation.validate import Validation
from finback.views import style
from finback.views.bifurcation_figure import KINDS, draw_branches
from finback.views.labels import axis_label, minus, with_error
from finback.views.picture import picture_of
from finback.views.style import Drawing

_WINDOW: Final = to_si(0.3, "deg")  # rad of elevator to either side of the fold
_REACH: Final = to_si(10.0, "deg")  # rad of alpha to either side of the fold
_FAR: Final = to_si(0.5, "deg")  # answers that lie farther apart are shown in whole degrees
_TWO_THIRDS: Final = 2.0 / 3.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldCase:
    """One fold of the simulator with all that is known of it.

    Attributes:
        number: its place in the list, from 1.
        hold: by hold bisection.
        ramp: by ramps.
        predicted: the model's folds that were matched to it: one or none.
        tolerance_rad: what the verdict allows between hold bisection and prediction.
    """

    number: int
    hold: HoldFold
    ramp: RampFold
    predicted: tuple[PredictedFold, ...]
    tolerance_rad: float


def fold_cases(analysis: AnyAnalysis, validation: Validation) -> tuple[FoldCase, ...]:
    """Return the folds that were flown, each with the predicted one that the validation paired with it."""
    known = prediction(analysis).folds
    flown = [(fold, witness) for fold in validation.folds for witness in fold.flown]
    return tuple(
        FoldCase(
            number=number,
            hold=witness.hold,
            ramp=witness.ramp,
            predicted=tuple(known[index] for index in fold.predicted),
            tolerance_rad=validation.options.tolerances.fold_elevator.value,
        )
        for number, (fold, witness) in enumerate(flown, start=1)
    )


def fold_close_up(case: FoldCase, analysis: AnyAnalysis, validation: Validation) -> Drawing:
    """Draw a fold: the curve near it, the ramps over rate^(2/3), and all answers on one scale."""
    name = f"fold-{case.number}"
    with style.styled(name):
        figure = style.new_figure(5.2)
        parts: Any = figure.subfigures(2, 1, height_ratios=(2.6, 1.25))
        upper, lower = parts
        near, ramps = upper.subplots(1, 2)
        _draw_near(near, case, analysis, validation)
        _draw_ramps(ramps, case)
        _draw_answers(lower.subplots(), case)
        picture = style.svg(figure)
    alpha = from_si(case.hold.table_alpha_rad, "deg")
    return Drawing(
        name=name,
        title=minus(f"Fold at α = {alpha:z.1f}°"),
        caption=(
            "Left: the predicted branch (line) and the simulator's own equilibria (points; open where unstable). "
            "Right: where ramps of different rate pass the fold's alpha by the margin, and the fit "
            "a + b·r^(2/3) + c·r to rate zero. Below: every answer relative to the fold of the simulator's "
            "equilibrium curve, with 95 % uncertainties; the band is the tolerance around the hold bisection, into "
            "which the prediction must fall."
        ),
        alt=_words(case),
        svg=picture,
    )


def _draw_near(axes: Axes, case: FoldCase, analysis: AnyAnalysis, validation: Validation) -> None:
    center, curve, branches = case.hold.table_elevator_rad, validation.curve, picture_of(analysis).branches
    draw_branches(axes, branches, [from_si(branch.alpha_rad, "deg") for branch in branches])
    for line in axes.get_lines():
        line.set_label("predicted" if line.get_label() == KINDS[0][0] else "")
    near = np.abs(curve.elevator_rad - center) < _WINDOW
    for stable in (True, False):
        rows = np.flatnonzero(near & (curve.stable == stable))
        look: dict[str, Any] = {"markerfacecolor": style.SIMULATED if stable else style.PAPER, "zorder": 4}
        axes.plot(
            from_si(curve.elevator_rad[rows], "deg"),
            from_si(curve.alpha_rad[rows], "deg"),
            color=style.SIMULATED,
            linestyle="none",
            marker="o",
            markersize=4.0,
            label="simulated" if stable else None,
            **look,
        )
    for fold in case.predicted:
        place = from_si(fold.elevator_rad, "deg"), from_si(fold.alpha_rad, "deg")
        axes.plot(*place, color=style.PREDICTED, marker="D", linestyle="none", zorder=5)
    axes.set_xlim(from_si(center - _WINDOW, "deg"), from_si(center + _WINDOW, "deg"))
    _limit_alpha(axes, np.concatenate([curve.alpha_rad[near], [case.hold.table_alpha_rad]]), case)
    axes.set_title("Near the fold")
    axes.set_xlabel(axis_label("elevator_rad"))
    axes.set_ylabel(axis_label("alpha_rad"))
    style.legend(axes, loc="center right" if case.hold.outward > 0 else "center left")


def _limit_alpha(axes: Axes, alpha_rad: FloatArray, case: FoldCase) -> None:
    """Show the branches that meet in the fold, and no third one that passes far away."""
    around = from_si(alpha_rad[np.abs(alpha_rad - case.hold.table_alpha_rad) < _REACH], "deg")
    margin = 0.05 * max(float(np.ptp(around)), 0.5)
    axes.set_ylim(float(around.min()) - margin, float(around.max()) + margin)


def _draw_ramps(axes: Axes, case: FoldCase) -> None:
    ramp = case.ramp
    rates = from_si(ramp.rates_rad_s, "deg_s")
    axes.axhline(
        from_si(case.hold.elevator_rad, "deg"), color=style.FLOWN, linewidth=style.THIN, label="hold bisection"
    )
    if rates.size:
        fine = np.linspace(0.0, float(ramp.rates_rad_s.max()) * 1.05, 200)
        fit = from_si(ramp.elevator_at(fine), "deg")
        if np.isfinite(fit).all():
            axes.plot(
                from_si(fine, "deg_s") ** _TWO_THIRDS,
                fit,
                color=style.SIMULATED,
                linewidth=style.THIN,
                label="a + b·r^(2/3) + c·r",
            )
        axes.plot(
            rates**_TWO_THIRDS,
            from_si(ramp.crossing_elevator_rad, "deg"),
            color=style.SIMULATED,
            marker="s",
            markersize=4.5,
            linestyle="none",
            label="ramps",
        )
    if math.isfinite(ramp.elevator_rad) and math.isfinite(ramp.uncertainty_rad):
        axes.errorbar(
            0.0,
            from_si(ramp.elevator_rad, "deg"),
            yerr=from_si(ramp.uncertainty_rad, "deg"),
            color=style.SIMULATED,
            marker="o",
            markerfacecolor=style.PAPER,
            capsize=3.0,
            label="at rate 0",
        )
    axes.set_title("Slow ramps")
    axes.set_xlabel("r^(2/3), r the rate [(deg/s)^(2/3)]")
    axes.set_ylabel("δe at the crossing [deg]")
    axes.ticklabel_format(axis="y", useOffset=False)
    style.legend(axes, loc="best")


def _draw_answers(axes: Axes, case: FoldCase) -> None:
    """Draw each answer's distance from the fold of the equilibrium curve."""
    reference = case.hold.table_elevator_rad
    names = ["simulator, ramps", "simulator, hold bisection", *("predicted" for _ in case.predicted)]
    looks = [(style.SIMULATED, "o"), (style.FLOWN, "s"), (style.PREDICTED, "D")]
    answers = [(case.ramp.elevator_rad, case.ramp.uncertainty_rad), (case.hold.elevator_rad, case.hold.uncertainty_rad)]
    answers += [(fold.elevator_rad, _half_width(fold)) for fold in case.predicted]
    far = max((abs(value - reference) for value, _ in answers if math.isfinite(value)), default=0.0) > _FAR
    scale, unit = (1.0, "deg") if far else (1000.0, "0.001 deg")
    for height, ((value, error), (color, marker)) in enumerate(zip(answers, looks, strict=False)):
        place, reach = scale * from_si(value - reference, "deg"), scale * from_si(error, "deg")
        axes.errorbar(
            [place],
            [height],
            xerr=[[reach], [reach]] if math.isfinite(reach) else None,
            color=color,
            marker=marker,
            capsize=3.0,
            linestyle="none",
            zorder=3,
        )
    middle = scale * from_si(case.hold.elevator_rad - reference, "deg")
    allowed = scale * from_si(case.tolerance_rad, "deg")
    axes.axvspan(middle - allowed, middle + allowed, color=style.BAND, alpha=0.16, linewidth=0.0, zorder=0)
    axes.axvline(0.0, color=style.MUTED, linewidth=style.THIN, zorder=1)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.grid(visible=False, axis="y")
    axes.set_title("All answers, and the tolerance")
    axes.set_xlabel(f"δe − δe of the simulator's equilibrium curve [{unit}]")


def _words(case: FoldCase) -> str:
    hold = with_error(from_si(case.hold.elevator_rad, "deg"), from_si(case.hold.uncertainty_rad, "deg"))
    ramp = with_error(from_si(case.ramp.elevator_rad, "deg"), from_si(case.ramp.uncertainty_rad, "deg"))
    said = [with_error(from_si(fold.elevator_rad, "deg"), from_si(_half_width(fold), "deg")) for fold in case.predicted]
    predicted = said[0] if said else "none"
    return f"Elevator of the fold in degrees: hold bisection {hold}, ramps {ramp}, predicted {predicted}."


def _half_width(fold: PredictedFold) -> float:
    return 0.5 * float(fold.elevator_interval_rad[1] - fold.elevator_interval_rad[0])

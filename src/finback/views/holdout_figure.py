"""A hold-out flight beside its prediction: time histories, their difference, and the kind of the difference."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes

from finback.channels import channel
from finback.units import from_si
from finback.validation.trajectory import Holdout
from finback.views import style
from finback.views.labels import axis_label, displayed, short, unit_text
from finback.views.style import Drawing

_ABSURD: Final = 5.0  # spans of the simulated history, beyond which a prediction is not followed


def holdout_history(holdout: Holdout) -> Drawing:
    """Draw alpha, pitch rate and elevator over time, simulated and predicted, with the differences below."""
    record = holdout.record
    with style.styled(record.name):
        figure = style.new_figure(4.9)
        grid = figure.add_gridspec(3, 2, height_ratios=(3.0, 1.5, 1.3))
        for column, name in enumerate(("alpha_rad", "q_rad_s")):
            above = figure.add_subplot(grid[0, column])
            below = figure.add_subplot(grid[1, column], sharex=above)
            _draw_history(above, holdout, name, column)
            _draw_difference(below, holdout, name, column)
            above.tick_params(labelbottom=False)
        elevator = figure.add_subplot(grid[2, 0])
        elevator.plot(
            record["time_s"], displayed(record["elevator_rad"], "elevator_rad"), color=style.INK, linewidth=1.2
        )
        elevator.set_ylabel(axis_label("elevator_rad"))
        elevator.set_xlabel(axis_label("time_s"))
        _draw_shares(figure.add_subplot(grid[2, 1]), holdout)
        picture = style.svg(figure)
    alpha, q = (_error_text(holdout, name) for name in ("alpha_rad", "q_rad_s"))
    extrapolated = "" if holdout.in_domain else " The flight leaves the fitted domain at once: an extrapolation."
    return Drawing(
        name=record.name,
        title=f"Hold-out flight {record.name}",
        caption=(
            f"Simulated (line) and predicted from the same initial state and elevator (dashed); RMSE {alpha} and {q}, "
            f"compared over {holdout.compared_s:.2f} s of {record.duration_s:.2f} s. Below: the difference, simulated "
            "less predicted, and Theil's split of its mean square into bias, variance and covariance "
            f"(U = {short(holdout.alpha_theil.coefficient)} for α, {short(holdout.q_theil.coefficient)} for q)."
            f"{extrapolated}"
        ),
        alt=f"Alpha, pitch rate and elevator over {record.duration_s:.1f} s. Root mean square errors: {alpha}, {q}.",
        svg=picture,
    )


def _draw_history(axes: Axes, holdout: Holdout, name: str, column: int) -> None:
    record = holdout.record
    simulated = displayed(record[name], name)
    predicted = _followed(displayed(holdout.predicted[:, column], name), simulated)
    axes.plot(record["time_s"], simulated, color=style.SIMULATED, linewidth=2.2, alpha=0.75, label="simulated")
    axes.plot(
        record["time_s"], predicted, color=style.PREDICTED, linestyle=style.DASHED, linewidth=1.3, label="predicted"
    )
    _mark_end(axes, holdout)
    axes.set_ylabel(axis_label(name))
    if column == 0:
        style.legend(axes, loc="best")


def _draw_difference(axes: Axes, holdout: Holdout, name: str, column: int) -> None:
    record = holdout.record
    simulated = displayed(record[name], name)
    predicted = _followed(displayed(holdout.predicted[:, column], name), simulated)
    axes.axhline(0.0, color=style.MUTED, linewidth=style.THIN)
    axes.plot(record["time_s"], simulated - predicted, color=style.INK, linewidth=1.1)
    _mark_end(axes, holdout)
    found = channel(name)
    axes.ticklabel_format(axis="y", scilimits=(-2, 4), useMathText=True)
    axes.set_ylabel(f"Δ{found.label} [{unit_text(found.display_unit)}]")
    axes.set_xlabel(axis_label("time_s"))


def _draw_shares(axes: Axes, holdout: Holdout) -> None:
    """Draw Theil's three shares of the mean square error, one bar a quantity."""
    rows = (("q", holdout.q_theil), ("α", holdout.alpha_theil))
    parts = (("bias", style.BAND), ("variance", style.FLOWN), ("covariance", style.UNUSED))
    for height, (_, theil) in enumerate(rows):
        start = 0.0
        for part, color in parts:
            share = float(getattr(theil, part))
            if np.isfinite(share):
                axes.barh(height, share, left=start, color=color, height=0.55, label=part if height == 0 else None)
                start += share
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(-0.6, 2.4)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("share of the mean square error")
    style.legend(axes, loc="upper center", ncols=3, frameon=False, columnspacing=1.2)


def _mark_end(axes: Axes, holdout: Holdout) -> None:
    """Mark where the flight leaves the fitted domain and the comparison ends."""
    time = holdout.record["time_s"]
    if holdout.compared < time.size:
        axes.axvspan(float(time[holdout.compared - 1]), float(time[-1]), color=style.UNUSED, alpha=0.18, linewidth=0.0)


def _followed(predicted: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """Return the prediction as far as it stays near; after a blow-up NaN, which is not drawn."""
    low, high = float(simulated.min()), float(simulated.max())
    reach = _ABSURD * max(high - low, 1.0)
    near = (predicted >= low - reach) & (predicted <= high + reach)
    return np.where(near, predicted, np.nan)


def _error_text(holdout: Holdout, name: str) -> str:
    value = holdout.alpha_rmse_rad if name == "alpha_rad" else holdout.q_rmse_rad_s
    found = channel(name)
    return f"{found.label} {short(from_si(value, found.display_unit))} {unit_text(found.display_unit)}"

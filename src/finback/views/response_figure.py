"""Time histories of a Liénard system, several in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from matplotlib.axes import Axes

from finback.dynamics.response import Response
from finback.units import from_si
from finback.views import style

QUANTITIES: Final = {
    "alpha_rad": (r"$\alpha$ [deg]", "deg"),
    "alpha_dot_rad_s": (r"$\dot\alpha$ [deg/s]", "deg_s"),
    "q_rad_s": (r"$q$ [deg/s]", "deg_s"),
}
"""Field of a response -> symbol with unit, and that unit."""

_LOOKS: Final = (
    (style.PREDICTED, style.SOLID),
    (style.SIMULATED, style.DASHED),
    (style.FLOWN, (0, (6, 1.6, 1, 1.6))),
    (style.PURPLE, style.DOTTED),
)


def draw_responses(axes: Axes, responses: Sequence[tuple[str, Response]], quantity: str) -> None:
    """Draw one quantity of several responses over time, each under its name."""
    label, unit = QUANTITIES[quantity]
    for number, (name, response) in enumerate(responses):
        color, dash = _LOOKS[number % len(_LOOKS)]
        values = from_si(getattr(response, quantity), unit)
        axes.plot(response.time_s, values, color=color, linestyle=dash, label=name, zorder=3)
    first = responses[0][1].time_s
    axes.set_xlim(float(first[0]), float(first[-1]))
    axes.set_xlabel("$t$ [s]")
    axes.set_ylabel(label)


def draw_rest(axes: Axes, values: Sequence[float]) -> None:
    """Draw thin lines at the values, as they are shown, that responses tend to."""
    for value in values:
        axes.axhline(value, color=style.MUTED, linewidth=0.5, zorder=1)

"""The nature of equilibria, degenerate ones included."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.dynamics.normal_form.nature import Nature, nature
from finback.errors import RefusedError

_CASES = [
    ((0.0,), (0.0, 1.0), Nature.SADDLE),
    ((-1.0,), (0.0, -1.0), Nature.SINK),
    ((1.0,), (0.0, -1.0), Nature.SOURCE),
    ((0.0, 3.0), (0.0, -1.0), Nature.WEAK_FOCUS),
    ((1.0,), (0.0, 0.0, 1.0), Nature.SADDLE_NODE),
    ((0.0, 1.0), (0.0, 0.0, 1.0), Nature.CUSP),
    ((0.0,), (0.0, 0.0, 1.0), Nature.CUSP),
    ((0.0, 1.0), (0.0, 0.0, 0.0, 0.0, 1.0), Nature.SADDLE_NODE),  # n = 1 < m/2 = 2
    ((-1.0,), (0.0, 0.0, 0.0, 1.0), Nature.TOPOLOGICAL_SADDLE),
    ((1.0,), (0.0, 0.0, 0.0, 1.0), Nature.TOPOLOGICAL_SADDLE),
    ((0.0, 1.0, -1.0), (0.0, 0.0, 0.0, 1.0), Nature.TOPOLOGICAL_SADDLE),
    ((-1.0,), (0.0, 0.0, 0.0, -1.0), Nature.TOPOLOGICAL_SINK),
    ((1.0,), (0.0, 0.0, 0.0, -1.0), Nature.TOPOLOGICAL_SOURCE),
    ((0.0, 2.0, -1.0), (0.0, 0.0, 0.0, -1.0), Nature.NILPOTENT_FOCUS),  # 2² < 8
    ((0.0, 3.0, -1.0), (0.0, 0.0, 0.0, -1.0), Nature.ELLIPTIC),
    ((0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0), Nature.TOPOLOGICAL_SINK),
    ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0), Nature.TOPOLOGICAL_SOURCE),
]


@pytest.mark.parametrize(("damping", "force", "expected"), _CASES)
def test_known_equilibria(damping: tuple[float, ...], force: tuple[float, ...], expected: Nature) -> None:
    """Dumortier, Llibre & Artés, Qualitative Theory of Planar Differential Systems (2006), theorems 2.19 and 3.5."""
    assert nature(damping, force) is expected


def _radius_after(
    damping: tuple[float, ...], force: tuple[float, ...], start: tuple[float, float], span: float
) -> float:
    """Return how far an orbit is after some time, or 1 if it gets that far."""

    def field(_: float, s: np.ndarray) -> list[float]:
        return [s[1], float(np.polyval(damping[::-1], s[0]) * s[1] + np.polyval(force[::-1], s[0]))]

    def gone(_: float, s: np.ndarray) -> float:
        return float(np.hypot(*s)) - 1.0

    gone.terminal = True  # type: ignore[attr-defined]
    end = solve_ivp(field, (0.0, span), start, events=gone, rtol=1e-6, atol=1e-9)
    return float(np.hypot(*end.y[:, -1]))


@pytest.mark.parametrize(
    ("damping", "force", "expected"),
    [case for case in _CASES if case[2].startswith("topological") and len(case[1]) == 4],
)
def test_orbits_do_what_the_name_says(damping: tuple[float, ...], force: tuple[float, ...], expected: Nature) -> None:
    starts = [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.3)]
    ahead = [_radius_after(damping, force, start, 60.0) for start in starts]
    back = [_radius_after(damping, force, start, -60.0) for start in starts]
    if expected is Nature.TOPOLOGICAL_SINK:
        assert max(ahead) < 0.3
    elif expected is Nature.TOPOLOGICAL_SOURCE:
        assert max(back) < 0.3
    else:
        assert max(ahead[0], ahead[1]) >= 1.0 - 1e-6
        assert max(back[0], back[1]) >= 1.0 - 1e-6


@pytest.mark.parametrize(("b", "turns"), [(2.0, True), (3.0, False)])
def test_a_nilpotent_focus_turns_and_an_elliptic_sector_does_not(b: float, turns: bool) -> None:  # noqa: FBT001 - a case
    """With y' = b x y − x³ the curves y = c x², 2 c² = b c − 1, are invariant: real for b² ≥ 8, they stop turning."""

    def crosses(_: float, s: np.ndarray) -> float:
        return float(s[1])

    crosses.direction = -1.0  # type: ignore[attr-defined]
    end = solve_ivp(
        lambda _, s: [s[1], b * s[0] * s[1] - s[0] ** 3],
        (0.0, 300.0),
        (-0.3, 0.0),
        events=crosses,
        rtol=1e-8,
        atol=1e-12,
    )
    assert (end.t_events[0] > 1e-6).any() == turns
    assert (nature((0.0, b), (0.0, 0.0, 0.0, -1.0)) is Nature.NILPOTENT_FOCUS) == turns


def test_a_force_that_is_zero_everywhere_is_refused() -> None:
    with pytest.raises(RefusedError, match="every x is an equilibrium"):
        nature((1.0,), (0.0, 0.0))

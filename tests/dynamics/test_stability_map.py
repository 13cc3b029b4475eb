"""The grid map: against another integrator and known basins, several sinks, escapes, and what never ends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.dynamics.flow import Flow, rests
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.capture import capture
from finback.dynamics.stability.map import CIRCLES, ESCAPES, UNDECIDED, stability_map
from finback.errors import InputError, RefusedError
from finback.units import to_si

Build = Callable[..., LienardSystem]


def _grid(alpha: float, rate: float, points: int = 21) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.meshgrid(np.linspace(-alpha, alpha, points), np.linspace(-rate, rate, points)))


def test_another_integrator_gives_the_same_map(printed_system: LienardSystem) -> None:
    """DOP853 to 1e-9, the sink and the far field recognized by distance alone."""
    generator = np.random.default_rng(7)
    alpha = generator.uniform(to_si(-45.0, "deg"), to_si(55.0, "deg"), 60)
    rate = generator.uniform(to_si(-200.0, "deg"), to_si(200.0, "deg"), 60)
    elevator = to_si(-3.0, "deg")
    mapped = stability_map(printed_system, elevator, alpha, rate)
    f, g = printed_system.damping.ascending, printed_system.force.ascending.copy()
    g[0] += printed_system.elevator_gain * elevator

    def field(_: float, state: np.ndarray) -> tuple[float, float]:
        x, y = state
        return y, np.polynomial.polynomial.polyval(x, f) * y + np.polynomial.polynomial.polyval(x, g)

    def away(_: float, state: np.ndarray) -> float:
        return 3.0 - abs(state[0])

    away.terminal = True  # type: ignore[attr-defined]
    for start, label in zip(zip(alpha, rate, strict=True), mapped, strict=True):
        end = solve_ivp(field, (0.0, 30.0), start, method="DOP853", rtol=1e-9, atol=1e-12, events=away)
        assert (label == 0) == (end.status == 0)
        assert label in (0, ESCAPES)
    assert {0, ESCAPES} == set(mapped.tolist())


def test_each_well_has_its_states(build_system: Build) -> None:
    """A damped double well: the energy says which well holds a state that cannot pass the hill."""
    system = build_system((-0.2,), (0.0, 1.0, 0.0, -1.0))
    alpha, rate = _grid(1.6, 1.0)
    mapped = stability_map(system, 0.0, alpha, rate)
    trapped = 0.5 * rate**2 - 0.5 * alpha**2 + 0.25 * alpha**4 < 0.0
    assert (mapped[trapped] == (alpha[trapped] > 0.0)).all()
    # The system is odd; the state at the hilltop stays there for ever.
    middle = mapped.shape[0] // 2
    assert mapped[middle, middle] == UNDECIDED
    assert (mapped == UNDECIDED).sum() == 1
    mirrored = mapped[::-1, ::-1]
    assert ((mapped + mirrored == 1) | (mapped == UNDECIDED)).all()


def test_what_circles_is_told_from_what_escapes(build_system: Build) -> None:
    """Reversed van der Pol: outside its unstable cycle (radius about 2) states blow up, which no saddle announces."""
    system = build_system((-1.0, 0.0, 1.0), (0.0, -1.0))
    mapped = stability_map(system, 0.0, np.array([1.9, 2.1, 0.0, 30.0]), np.array([0.0, 0.0, 2.0, -1000.0]))
    assert mapped.tolist() == [0, ESCAPES, 0, ESCAPES]
    # Two cycles: states outside the unstable one run to the stable one around it.
    rings = build_system((-0.1, 0.0, 0.1, 0.0, -0.005), (0.0, -1.0))
    assert stability_map(rings, 0.0, np.array([1.0, 4.0, 9.0]), np.zeros(3)).tolist() == [0, CIRCLES, CIRCLES]
    # A center: nothing is decided, and that is said.
    center = build_system((0.0, -1.0, 0.0), (0.0, -1.0, 0.0, 0.1))
    with pytest.raises(RefusedError, match="no equilibrium is stable"):
        stability_map(center, 0.0, np.array([0.1]), np.array([0.1]))


def test_stiff_far_fields_are_followed(build_system: Build) -> None:
    """Everything falls to the only equilibrium, from however far: f = −1 − x² is −10⁴ there."""
    system = build_system((-1.0, 0.0, -1.0), (0.0, -1.0, 0.0, -1.0))
    alpha, rate = _grid(100.0, 1e4, 5)
    assert (stability_map(system, 0.0, alpha, rate) == 0).all()


def test_the_ellipse_holds_what_it_promises(printed_system: LienardSystem) -> None:
    """On its edge the Lyapunov function falls; blown up by a third, somewhere it does not: it is no trifle."""
    flow = Flow(damping=(-1.0, 0.3, 2.0), force=(0.0, -1.0, 0.5, 1.0), force_sizes=(0.0, 1.0, 0.5, 1.0))
    sink = next(point for point in rests(flow) if point.kind.stable)
    found = capture(flow, sink)
    matrix = np.array([[found.p11, found.p12], [found.p12, found.p22]])
    angle = np.linspace(0.0, 2.0 * np.pi, 2001)
    edge = np.linalg.cholesky(np.linalg.inv(matrix)) @ np.array([np.cos(angle), np.sin(angle)])

    def fall(share: float) -> np.ndarray:
        u, y = share * np.sqrt(found.level) * edge
        x = sink.x + u
        v = np.array([y, np.polyval(flow.damping[::-1], x) * y + np.polyval(flow.force[::-1], x)])
        return 2.0 * ((matrix @ np.array([u, y])) * v).sum(axis=0)

    for share in (0.01, 0.3, 0.7, 1.0):
        assert (fall(share) < 0.0).all()
    assert (fall(1.35) > 0.0).any()
    assert printed_system.damping.ascending.size == 3


def test_refusals(printed_system: LienardSystem) -> None:
    with pytest.raises(RefusedError, match="no equilibrium is stable"):
        stability_map(printed_system, to_si(16.0, "deg"), np.zeros(1), np.zeros(1))
    with pytest.raises(InputError, match="no states"):
        stability_map(printed_system, 0.0, np.zeros(2), np.zeros(3))

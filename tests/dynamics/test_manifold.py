"""Manifolds of saddles by their power series: closed forms, and the orbit that starts near the saddle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, derivative, horner, rests, shifted
from finback.dynamics.orbit.manifold import branch_to, manifold
from finback.dynamics.orbit.taylor import Ending


def _flow(damping: list[float], force: list[float]) -> Flow:
    return Flow(damping=tuple(damping), force=tuple(force), force_sizes=tuple(map(abs, force)))


@pytest.mark.parametrize("stable", [False, True])
def test_a_conservative_saddle_has_the_manifold_of_its_energy(*, stable: bool) -> None:
    """The saddle at 0 of x'' = x − x³ has y² = x² − x⁴/2 on both manifolds."""
    flow = _flow([0.0], [0.0, 1.0, 0.0, -1.0])
    saddle = rests(flow)[1]
    whole = manifold(flow, saddle, stable=stable)
    sign = -1.0 if stable else 1.0
    for u in np.linspace(-whole.radius, whole.radius, 9):
        assert horner(whole.series, u) == pytest.approx(sign * u * math.sqrt(1.0 - 0.5 * u * u), abs=1e-15)
    turned = branch_to(flow, rests(flow), whole, 2.0)
    assert turned.path.ending is Ending.AXIS
    assert turned.path.x == pytest.approx(math.sqrt(2.0), abs=1e-14)


_number = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))


@settings(deadline=None, max_examples=25)
@given(damping=st.lists(_number, min_size=1, max_size=3), bend=_number, stable=st.booleans())
def test_the_series_is_the_orbit_that_starts_near_the_saddle(
    damping: list[float], bend: float, *, stable: bool
) -> None:
    """DOP853 from 1e-3 away, where two terms of the series are already exact to 1e-9, to the edge of the series."""
    flow = _flow(damping, [0.0, -1.0, bend, 1.0])
    saddle = rests(flow)[-1]
    assert saddle.kind is Kind.SADDLE
    whole = manifold(flow, saddle, stable=stable)
    assert whole.series[1] == saddle.eigenvalues_real[1 if stable else 0]
    near, far = 1e-3 * whole.radius, whole.radius
    orbit = solve_ivp(  # along x, where the manifold attracts as it is followed away from the saddle
        lambda x, y: horner(flow.damping, x) + horner(flow.force, x) / y,
        (saddle.x + near, saddle.x + far),
        [horner(whole.series, near)],
        method="DOP853",
        rtol=1e-12,
        atol=1e-15,
    )
    assert orbit.y[0, -1] == pytest.approx(horner(whole.series, far), rel=1e-9)
    # And the series begins as the invariance equation says.
    f, g = shifted(flow.damping, saddle.x), shifted(flow.force, saddle.x)
    value = whole.series[1]
    second = ((f[1] if len(f) > 1 else 0.0) * value + g[2]) / (3.0 * value - f[0])
    assert whole.series[2] == pytest.approx(second, rel=1e-10, abs=1e-13)


def test_a_branch_that_ends_in_a_node_is_said_to() -> None:
    """Overdamped: the unstable manifold of the saddle is the slow way into the node."""
    flow = _flow([-10.0], [0.0, -1.0, 0.0, 1.0])
    points = rests(flow)
    assert [point.kind for point in points] == [Kind.SADDLE, Kind.STABLE_NODE, Kind.SADDLE]
    branch = branch_to(flow, points, manifold(flow, points[0], stable=False), 0.5)
    assert branch.path.ending is Ending.REST
    assert branch.path.x == pytest.approx(0.0, abs=0.2)


def test_near_a_fold_the_series_is_still_exact() -> None:
    """Saddle and node 2e-4 apart: the graph goes through the node."""
    flow = _flow([-1.0], [-1e-8, 0.0, 1.0])
    points = rests(flow)
    saddle, node = points[-1], points[0]
    whole = manifold(flow, saddle, stable=False)
    assert abs(horner(whole.series, node.x - saddle.x)) < 1e-6 * abs(horner(whole.series, 0.5 * (node.x - saddle.x)))
    slopes = derivative(whole.series)
    u = 0.9 * whole.radius
    h = horner(whole.series, u)
    terms = (h * horner(slopes, u), -h, horner(flow.force, saddle.x + u))
    assert abs(terms[0] - terms[1] - terms[2]) < 1e-13 * max(map(abs, terms))

"""Orbits of planar fields: an unrelated integrator, closed forms, time reversal, and certain ellipses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.planar.capture import planar_capture
from finback.dynamics.planar.field import PlanarField, along_line
from finback.dynamics.planar.orbit import Limits, Line, PlanarEnding, PlanarOrbit, crossings, fate, winding
from finback.dynamics.planar.system import PlanarFlow, PlanarScale

_NO_TRAPS = np.zeros((0, 5))
_LIMITS = Limits(_NO_TRAPS, 1e3)
# DOP853 at rtol 1e-13 leaves some 1e-12 in a unit of time; the Taylor road some roundings a piece.
_INTEGRATION = 2e-11


def _field(first: FloatArray, second: FloatArray) -> PlanarField:
    flow = PlanarFlow(
        first=first,
        second=second,
        first_sizes=np.abs(first),
        second_sizes=np.abs(second),
        scale=PlanarScale(),
    )
    return PlanarField.of(flow)


def _van_der_pol(mu: float = 1.0) -> PlanarField:
    first, second = np.zeros((3, 2)), np.zeros((3, 2))
    first[0, 1], second[1, 0], second[0, 1], second[2, 1] = 1.0, -1.0, mu, -mu
    return _field(first, second)


def _random(seed: int, degree: int) -> PlanarField:
    rng = np.random.default_rng(seed)
    i, j = np.indices((degree + 1, degree + 1))
    tables = [np.where(i + j <= degree, rng.normal(size=i.shape), 0.0) for _ in range(2)]
    tables[0][degree, 0], tables[1][0, degree] = -1.0, -1.0
    return _field(*tables)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), degree=st.integers(1, 6))
def test_any_field_goes_where_an_unrelated_integrator_goes(seed: int, degree: int) -> None:
    """DOP853 with the divergence as a third equation, over the time the orbit takes to leave a box."""
    field = _random(seed, degree)
    orbit = fate(field, (0.3, -0.2), Limits(_NO_TRAPS, 3.0), forward=True)
    spans = orbit.spans[:12]
    duration = float(spans.sum())

    def rates(_: float, s: FloatArray) -> list[float]:
        p, q = field.flow.velocity(float(s[0]), float(s[1]))
        return [p, q, float(field.divergence(np.array(s[0]), np.array(s[1])))]

    found = solve_ivp(rates, (0.0, duration), [0.3, -0.2, 0.0], method="DOP853", rtol=1e-13, atol=1e-15)
    stretch = PlanarOrbit(orbit.series[:12], spans, PlanarEnding.NOWHERE, -1, (), orbit.end)
    end = [np.polynomial.polynomial.polyval(spans[-1], orbit.series[len(spans) - 1, row]) for row in range(2)]
    sensitivity = 1.0 + np.exp(np.abs(found.y[2]).max())  # errors grow at least as areas do
    assert np.abs(found.y[:2, -1] - end).max() < _INTEGRATION * sensitivity
    assert abs(found.y[2, -1] - stretch.growth()[-1]) < 10.0 * _INTEGRATION * sensitivity


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), degree=st.integers(1, 5))
def test_products_give_the_polynomials_and_their_divergence(seed: int, degree: int) -> None:
    field = _random(seed, degree)
    x, y = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 7))
    p, q = field.velocity(x, y)
    for k in range(7):
        np.testing.assert_allclose([p[k], q[k]], field.flow.velocity(x[k], y[k]), rtol=0, atol=1e-13)
        slope = field.jacobian(float(x[k]), float(y[k]))
        assert field.divergence(x, y)[k] == pytest.approx(np.trace(slope), abs=1e-12)
        step = 1e-6
        moved = np.array(field.flow.velocity(x[k] + step, y[k])) - field.flow.velocity(x[k] - step, y[k])
        np.testing.assert_allclose(moved / (2.0 * step), slope[:, 0], rtol=0, atol=1e-7)


def test_a_line_through_a_field_gives_its_values() -> None:
    field = _random(3, 4)
    row = along_line(field.flow.first, (0.3, -0.4), (0.6, 0.8))
    for r in (-0.7, 0.0, 1.1):
        expected = field.flow.velocity(0.3 + 0.6 * r, -0.4 + 0.8 * r)[0]
        assert np.polynomial.polynomial.polyval(r, row) == pytest.approx(expected, abs=1e-12)


def test_van_der_pol_winds_once_in_its_period() -> None:
    """Period and amplitude at mu = 1: Amore, Boyd & Fernandez (2018), 6.6632868593231301896996820305 and 2.0086."""
    field, ray = _van_der_pol(), Line((0.0, 0.0), (1.0, 0.0), half=True)
    along = 2.0
    for _ in range(10):
        orbit = winding(field, along, _LIMITS, forward=True, line=ray, sense=-1)
        assert orbit.ending is PlanarEnding.SECTION
        along = orbit.hits[-1].along
    assert orbit.duration == pytest.approx(6.6632868593231302, abs=1e-13)
    assert along == pytest.approx(2.008619860875, abs=1e-11)
    back = winding(field, along, _LIMITS, forward=False, line=ray, sense=1)
    assert back.duration == pytest.approx(-orbit.duration, abs=1e-11)
    assert back.growth()[-1] == pytest.approx(
        -orbit.growth()[-1], abs=1e-10
    )  # the cycle repels backward: e^7 roundings


def test_nodes_integrate_the_series() -> None:
    field = _van_der_pol()
    orbit = fate(field, (0.5, 0.0), Limits(_NO_TRAPS, 1.9), forward=True)
    weight, x, y, exponent = orbit.nodes()
    assert weight.sum() == pytest.approx(orbit.duration, rel=1e-14)
    p, q = field.velocity(x, y)
    np.testing.assert_allclose([(weight * p).sum(), (weight * q).sum()], np.array(orbit.end) - [0.5, 0.0], atol=1e-13)
    growth = (weight * field.divergence(x, y)).sum()
    assert growth == pytest.approx(orbit.growth()[-1], abs=1e-13)
    assert exponent[-1, -1] == pytest.approx(growth, rel=1e-2)  # the last node lies just before the end
    states = orbit.samples(6)
    assert states.shape == (6 * len(orbit.spans) + 1, 2)
    np.testing.assert_allclose(np.hypot(*np.diff(states, axis=0).T).max(), 0.0, atol=0.5)


def test_crossings_of_a_line_alternate() -> None:
    """A circle about the origin crosses the line y = 1/2 up on the right and down on the left."""
    first, second = np.zeros((2, 2)), np.zeros((2, 2))
    first[0, 1], second[1, 0] = -1.0, 1.0
    field = _field(first, second)
    line = Line((0.0, 0.5), (1.0, 0.0), half=False)
    orbit = crossings(field, (1.0, 0.0), _LIMITS, forward=True, line=line, most=5)
    root = math.sqrt(0.75)
    assert [hit.sense for hit in orbit.hits] == [1, -1, 1, -1, 1]
    np.testing.assert_allclose([hit.along for hit in orbit.hits], [root, -root, root, -root, root], atol=1e-14)
    assert orbit.duration == pytest.approx(4.0 * math.pi + math.pi / 6.0, abs=1e-13)
    backward = crossings(field, (1.0, 0.0), _LIMITS, forward=False, line=line, most=2)
    assert [hit.sense for hit in backward.hits] == [1, -1]
    assert backward.hits[0].along == pytest.approx(-root, abs=1e-14)
    assert backward.upto(backward.hits[0]).duration == pytest.approx(-7.0 * math.pi / 6.0, abs=1e-14)


def test_an_orbit_that_blows_up_is_far() -> None:
    first, second = np.zeros((3, 2)), np.zeros((3, 2))
    first[2, 0], second[0, 1] = 1.0, -1.0
    orbit = fate(_field(first, second), (0.5, 1.0), _LIMITS, forward=True)
    assert orbit.ending is PlanarEnding.FAR
    assert orbit.duration == pytest.approx(2.0, abs=2e-3)  # x = 1/(2 − t) is 1000 at 1.999


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_no_orbit_leaves_a_certain_ellipse(seed: int) -> None:
    """Along the ellipse, and inside it, the quadratic function falls; backward in time for a source."""
    rng = np.random.default_rng(seed)
    field = _random(seed, int(rng.integers(1, 5)))
    tables = [np.array(field.flow.first), np.array(field.flow.second)]
    tables[0][0, 0] = tables[1][0, 0] = 0.0
    linear = rng.normal(size=(2, 2))
    linear -= (np.linalg.eigvals(linear).real.max() + rng.uniform(0.05, 1.0)) * np.eye(2)
    for table, row in zip(tables, linear, strict=True):
        table[1, 0], table[0, 1] = row
    for forward, sign in ((True, 1.0), (False, -1.0)):
        sunk = _field(sign * tables[0], sign * tables[1])
        x, y, a, b, c = planar_capture(sunk, (0.0, 0.0), forward=forward)
        assert (x, y) == (0.0, 0.0)
        matrix = np.array([[a, b], [b, c]])
        assert np.linalg.eigvalsh(matrix)[0] >= 1.0 - 1e-9  # it lies within the unit circle
        angle = rng.uniform(0.0, 2.0 * np.pi, 400)
        root = np.linalg.inv(np.linalg.cholesky(matrix).T)
        u, v = root @ (np.sqrt(rng.uniform(0.0, 1.0, 400)) * np.array([np.cos(angle), np.sin(angle)]))
        p, q = sunk.velocity(u, v)
        assert (sign * (u * (a * p + b * q) + v * (b * p + c * q)) < 0.0).all()

"""Flight by coefficients: its equations against body axes, its derivatives, its shooting, its air."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.atmosphere import density_ratio
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.motion import Layout, Motion, layout, motion
from finback.identification.coefficient.shooting import shoot
from finback.identification.coefficient.track import Track
from finback.records import Hold

FRAME = Airframe(
    mass_kg=9000.0,
    wing_area_m2=30.0,
    chord_m=3.0,
    pitch_inertia_kg_m2=7e4,
    thrust_angle_rad=0.05,
    thrust_arm_m=0.3,
    reference_x_m=-0.2,
    reference_z_m=0.1,
)
ALONG = ["1", "alpha", "alpha^2", "speed_ratio", "elevator", "canard"]
ACROSS = ["1", "alpha", "alpha*pitch_rate", "elevator^2", "speed_ratio^2"]
PITCH = [
    "pitch_rate+alpha_rate",
    "alpha*alpha_rate",
    "1",
    "alpha",
    "reference_pitch_rate",
    "pitch_rate*alpha",
    "elevator",
    "alpha*elevator",
    "speed_ratio*alpha",
]
SPEED = 120.0  # m/s, the reference
GRAVITY = 9.8

ROUNDING = 1e-12
# Central differences of step 1e-6 in double precision.
SLOPE = 1e-7
# Runge and Kutta's rule at 20 ms and a short period of 3 rad/s, against DOP853: measured 2e-8 of a state.
RULE = 1e-6


def _form(axes: Axes) -> CoefficientForm:
    return CoefficientForm.parse(axes, ALONG, ACROSS, PITCH)


def _numbers(axes: Axes, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).normal(size=_form(axes).size)


def _at(terms: Layout, numbers: FloatArray, state: FloatArray, inputs: FloatArray) -> Motion:
    air = np.array([1.1]), np.array([2e4])
    return motion(terms, numbers, state[np.newaxis], inputs[np.newaxis], *air, GRAVITY)


@settings(max_examples=25, deadline=None)
@given(
    axes=st.sampled_from(list(Axes)),
    speed=st.floats(40.0, 300.0),
    alpha=st.floats(-1.2, 1.2),
    theta=st.floats(-1.4, 1.4),
    q=st.floats(-2.0, 2.0),
    seed=st.integers(0, 100),
)
def test_the_equations_are_newtons_in_body_axes(
    axes: Axes, speed: float, alpha: float, theta: float, q: float, seed: int
) -> None:
    form, numbers = _form(axes), _numbers(axes, seed)
    inputs = np.array([0.07, -0.03])
    found = _at(layout(form, FRAME, SPEED), numbers, np.array([speed, alpha, theta, q]), inputs).rates[0]
    values = {
        "alpha_rad": alpha,
        "pitch_rate_1": q * 3.0 / (2 * speed),
        "reference_pitch_rate_1": q * 3.0 / (2 * SPEED),
        "speed_ratio_1": speed / SPEED,
        "elevator_rad": inputs[0],
        "canard_rad": inputs[1],
    }
    names = form.names
    one, two = (
        sum(n * float(term(values)) for n, (name, term) in zip(numbers, form.terms, strict=True) if name == which)
        for which in names[:2]
    )
    cx, cz = one, two
    if axes is Axes.WIND:  # drag against the motion, lift at a right angle to it
        cx, cz = two * np.sin(alpha) - one * np.cos(alpha), -two * np.cos(alpha) - one * np.sin(alpha)
    load = 0.5 * 1.1 * speed**2 * 30.0
    x, z = load * cx + 2e4 * np.cos(0.05), load * cz - 2e4 * np.sin(0.05)
    u, w = speed * np.cos(alpha), speed * np.sin(alpha)
    u_dot = x / 9000.0 - q * w - GRAVITY * np.sin(theta)
    w_dot = z / 9000.0 + q * u + GRAVITY * np.cos(theta)
    values["alpha_rate_1"] = (u * w_dot - w * u_dot) / speed**2 * 3.0 / (2 * speed)
    terms = np.array([float(term(values)) for _, term in form.terms]) * numbers
    three = float(terms[form.ends()[1] :].sum())
    moment = load * 3.0 * three + 2e4 * 0.3
    # The aerodynamic force acts at a point 0.2 m aft of and 0.1 m below the center of gravity.
    moment += 0.1 * load * cx - (-0.2) * load * cz
    scale = 1.0 + abs(load) / 9000.0 * (1.0 + np.abs(terms).sum())
    expected = [(u * u_dot + w * w_dot) / speed, (u * w_dot - w * u_dot) / speed**2, q, moment / 7e4]
    np.testing.assert_allclose(found[:4], expected, atol=ROUNDING * scale)
    np.testing.assert_allclose(found[4:], [x / 9000.0, z / 9000.0], atol=ROUNDING * scale)


@pytest.mark.parametrize("axes", list(Axes))
@pytest.mark.parametrize("alpha", [0.2, 0.0])
def test_the_derivatives_are_derivatives(axes: Axes, alpha: float) -> None:
    terms, numbers = layout(_form(axes), FRAME, SPEED), _numbers(axes)
    state, inputs = np.array([130.0, alpha, 0.3, 0.1]), np.array([0.07, 0.02])
    found = _at(terms, numbers, state, inputs)
    for k, step in enumerate(1e-6 * np.maximum(1.0, np.abs(state))):
        ends = [_at(terms, numbers, state + side * step * np.eye(4)[k], inputs).rates[0] for side in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(found.jacobian[0, :, k] - slope).max() <= SLOPE * max(np.abs(slope).max(), 1.0)
    ends = [_at(terms, numbers, state, inputs + side * np.array([1e-6, 0.0])).rates[0] for side in (1.0, -1.0)]
    np.testing.assert_allclose(found.elevator[0], (ends[0] - ends[1]) / 2e-6, atol=SLOPE * 100)
    for j, row in enumerate(np.eye(numbers.size)):
        change = _at(terms, numbers + row, state, inputs).rates[0] - found.rates[0]  # linear in the numbers
        np.testing.assert_allclose(found.direct[0, :, j], change, atol=ROUNDING * 1e3)


def _track(elevator: FloatArray, hold: Hold) -> Track:
    count = elevator.size
    inputs = np.column_stack([elevator, 0.05 * np.sin(np.arange(count) / 9.0)])
    return Track(
        flight="one",
        start_s=0.0,
        interval_s=0.02,
        outputs=(),
        measured=np.empty((count, 0)),
        states=np.empty((count, 4)),
        input_names=("elevator_rad", "canard_rad"),
        inputs=inputs,
        hold=hold,
        density_kg_m3=np.linspace(1.0, 0.9, count),
        thrust_n=np.linspace(2e4, 3e4, count),
        gravity_m_s2=GRAVITY,
    )


STABLE = CoefficientForm.parse(
    Axes.WIND,
    ["1", "alpha", "speed_ratio"],
    ["1", "alpha", "elevator", "canard"],
    ["1", "alpha", "pitch_rate", "elevator"],
)
STABLE_NUMBERS = np.array([0.03, 0.3, 0.01, 0.3, 4.0, 0.4, 0.1, 0.02, -0.6, -15.0, -1.0])
START = np.array([120.0, 0.06, 0.05, 0.0])


def _elevator() -> FloatArray:
    return np.repeat(np.random.default_rng(3).normal(scale=0.03, size=6), 25)


def _shot(
    hold: Hold, numbers: FloatArray = STABLE_NUMBERS, start: FloatArray = START, bias: float = 0.0, delay: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    terms = layout(STABLE, FRAME, SPEED)
    track = _track(_elevator(), hold)
    return shoot(terms, numbers, start, track, samples=(0, 149), bias_rad=bias, delay_s=delay, substeps=1)


@pytest.mark.parametrize("hold", [Hold.ZOH, Hold.FOH])
@pytest.mark.parametrize("delay", [0.0, 0.013, -0.027])
def test_shooting_is_the_flight_of_another_integrator(hold: Hold, delay: float) -> None:
    terms, track = layout(STABLE, FRAME, SPEED), _track(_elevator(), hold)
    samples = 0.02 * np.arange(150)

    def inputs(time: float) -> FloatArray:
        late = (time - delay) / 0.02
        held = track.inputs[int(np.clip(np.floor(late), 0, 149)), 0]
        elevator = held if hold is Hold.ZOH else np.interp(late, np.arange(150), track.inputs[:, 0])
        here = time / 0.02
        canard = (
            track.inputs[int(np.floor(here)), 1] if hold is Hold.ZOH else np.interp(time, samples, track.inputs[:, 1])
        )
        return np.array([elevator, canard])

    def rates(time: float, state: FloatArray, inside: float) -> FloatArray:
        # ``inside`` keeps a held input on its own side of a jump.
        air = (np.interp([time], samples, x) for x in (track.density_kg_m3, track.thrust_n))
        return motion(terms, STABLE_NUMBERS, state[np.newaxis], inputs(inside)[np.newaxis], *air, GRAVITY).rates[0, :4]

    corners = np.unique(np.concatenate([samples, samples[:-1] + delay % 0.02]).round(12))
    state, states = START, [START]
    for first, last in pairwise(corners.tolist()):
        middle = 0.5 * (first + last)

        def held(time: float, x: FloatArray, middle: float = middle) -> FloatArray:
            return rates(time, x, middle if hold is Hold.ZOH else time)

        state = solve_ivp(held, (first, last), state, method="DOP853", rtol=1e-9, atol=1e-10).y[:, -1]
        if np.abs(samples - last).min() < 1e-9:
            states.append(state)
    found = _shot(hold, delay=delay)[0]
    np.testing.assert_allclose(found, np.array(states), atol=RULE, rtol=RULE)


@pytest.mark.parametrize("hold", [Hold.ZOH, Hold.FOH])
def test_the_sensitivities_of_a_flight_are_derivatives(hold: Hold) -> None:
    unknowns = np.concatenate([START, STABLE_NUMBERS, [0.001, 0.013]])

    def states(values: FloatArray) -> FloatArray:
        return _shot(hold, values[4:-2], values[:4], values[-2], values[-1])[0]

    found = _shot(hold, unknowns[4:-2], START, 0.001, 0.013)[1]
    for column, row in enumerate(np.eye(unknowns.size)):
        step = 1e-6 * max(1.0, abs(unknowns[column]))
        slope = (states(unknowns + step * row) - states(unknowns - step * row)) / (2 * step)
        off = np.abs(found[:, :, column] - slope).max(axis=0)
        assert (off <= 1e-4 * np.maximum(np.abs(slope).max(axis=0), 1e-3)).all(), column


PRINTED = 5e-5  # half a unit of the fifth printed digit, at worst
# US Standard Atmosphere 1976, table 1: geometric altitude in m, density in kg/m³.
TABLE = ((0.0, 1.2250), (5000.0, 0.73643), (10000.0, 0.41351), (15000.0, 0.19476), (20000.0, 0.088910))


def test_the_density_is_that_of_the_standard_atmosphere() -> None:
    heights = np.array([height for height, _ in TABLE])
    printed = np.array([density for _, density in TABLE])
    np.testing.assert_allclose(density_ratio(heights, 0.0) * 1.225, printed, rtol=PRINTED)
    np.testing.assert_allclose(density_ratio(heights, 10000.0) * printed[2], printed, rtol=2 * PRINTED)

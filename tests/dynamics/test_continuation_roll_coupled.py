"""A fighter in roll-coupled maneuvers, five states, as test data.

Equations and coefficients as printed with the test problems of Rheinboldt's continuation program PITCON (W. C.
Rheinboldt, Numerical Analysis of Parametrized Nonlinear Equations, 1986), after Mehra, Kessel & Carroll, Global
stability and control analysis of aircraft at high angles of attack, ONR CR-215-248-1 (1977), in the form of Young,
Schy & Johnson, J. Guidance and Control 1 (1978) 26-31. States p, q, r in rad/s, alpha and beta in rad.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from finback.arrays import FloatArray
from finback.dynamics.continuation.branch import EquilibriumBranch, equilibrium_branch
from finback.dynamics.continuation.field import BlackBox
from finback.dynamics.continuation.path import RESIDUAL
from finback.dynamics.continuation.search import equilibria_in_box, equilibrium_branches

PRINTED = 1e-4
"""One unit in the last digit of a roll rate, the coarsest column; the two lists themselves differ by 1e-5 in others."""

_LINEAR = np.array(
    [  # p, q, r, alpha, beta, elevator, aileron, rudder
        [-3.933, 0.107, 0.126, 0.0, -9.99, 0.0, -45.83, -7.64],
        [0.0, -0.987, 0.0, -22.95, 0.0, -28.37, 0.0, 0.0],
        [0.002, 0.0, -0.235, 0.0, 5.67, 0.0, -0.921, -6.51],
        [0.0, 1.0, 0.0, -1.0, 0.0, -0.168, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0, -0.196, 0.0, -0.0071, 0.0],
    ]
)


def rates(state: FloatArray, aileron: float, elevator: float, rudder: float = 0.0) -> FloatArray:
    """Return the rates, shape (5,) or (5, n), as the state."""
    p, q, r, alpha, beta = state
    linear = (_LINEAR[:, :5] @ state).T + _LINEAR[:, 5:] @ np.array([elevator, aileron, rudder])
    return linear.T + np.array(
        [
            -0.727 * q * r + 8.39 * r * alpha - 684.4 * alpha * beta + 63.5 * alpha * aileron,
            0.949 * p * r + 0.173 * p * beta,
            -0.716 * p * q - 1.578 * p * alpha + 1.132 * alpha * aileron,
            -p * beta,
            p * alpha,
        ]
    )


def rolling_moment(p: FloatArray | float, aileron: float, elevator: float) -> tuple[FloatArray, FloatArray]:
    """Return p_dot with the other four rates zero, and the state: at a given p and aileron those are linear.

    Shapes () and (5,), or (n,) and (5, n), as p.
    """
    unit = np.eye(5).reshape(5, 5, *[1] * np.ndim(p))

    def rest(state: FloatArray) -> FloatArray:
        return rates(state, aileron, elevator)[1:]

    at = p * unit[0]
    columns = np.array([rest(at + unit[k]) - rest(at) for k in range(1, 5)])  # (column, row, ...)
    others = np.linalg.solve(columns.T, -rest(at).T[..., np.newaxis])
    state = np.concatenate((at[:1], others[..., 0].T))
    return rates(state, aileron, elevator)[0], state


# elevator -> rows of p, q, r, alpha, beta, aileron: the 16 limit points in the aileron that are listed there, eight
# by R. Melhem and eight by Rheinboldt, in their order.
PUBLISHED = {
    -0.05: [
        (-2.9691, 0.83074, -0.072748, 0.41029, -0.26880, 0.50919),
        (2.9648, 0.82556, 0.07366, 0.041309, 0.26734, -0.050481),
    ],
    -0.008: [
        (-2.8158, -0.17481, -0.089469, 0.026319, 0.070951, 0.20442),
        (-3.7571, -0.64911, -0.39350, 0.091810, 0.19685, -0.0038238),
        (-4.1637, 0.092284, -0.092610, 0.022402, -0.017106, 0.37823),
        (2.8173, -0.17628, 0.08992, 0.026429, -0.07147, -0.204973),
        (3.7579, -0.65541, 0.38658, 0.092520, -0.19867, 0.006200),
        (4.1638, 0.08913, 0.09480, 0.022888, 0.16232, -0.377660),
    ],
    0.0: [
        (-2.5839, -0.22128, -0.054079, 0.013524, 0.090871, 0.18608),
        (-3.9007, -1.1421, -0.57863, 0.13284, 0.32685, -0.50703),
        (2.5873, -0.22354, 0.05468, 0.013676, -0.09168, -0.186908),
        (3.9005, -1.14815, 0.58156, 0.133516, -0.32858, 0.510158),
    ],
    0.05: [
        (-2.3610, -0.72360, 0.032739, -0.039108, 0.29347, 0.29272),
        (2.3639, -0.72974, -0.31604, -0.038785, -0.29583, -0.295772),
    ],
    0.1: [
        (-2.2982, 1.4033, 0.063244, -0.079383, 0.58336, 0.58336),
        (2.2992, -1.41023, -0.06184, -0.079009, -0.58629, -0.689717),
    ],
}
# Seven of the 96 printed numbers contradict the equations they belong to by far more than the printed digits: a lost
# zero or sign, a wrong digit, one column copied into the next. (elevator, row, column) -> what solves the equations.
MISPRINTED = {
    (-0.05, 0, 3): 0.041029,
    (-0.05, 1, 5): -0.50481,
    (-0.008, 1, 2): -0.38350,
    (-0.008, 5, 4): 0.016232,
    (0.05, 1, 2): -0.031604,
    (0.1, 0, 1): -1.4033,
    (0.1, 0, 5): 0.68380,
}


def fighter(elevator: float) -> BlackBox:
    return BlackBox(
        field=lambda state, aileron: rates(state, aileron, elevator),
        state_box=np.array([[-10.0, 10.0], [-4.0, 4.0], [-3.0, 3.0], [-1.0, 1.0], [-2.0, 2.0]]),
        parameter_range=np.array([-1.5, 1.5]),
    )


@pytest.fixture(scope="module")
def branches() -> dict[float, EquilibriumBranch]:
    """The branch through level flight with all controls but the elevator at zero."""
    return {elevator: equilibrium_branch(fighter(elevator), state=np.zeros(5), parameter=0.0) for elevator in PUBLISHED}


def printed() -> list[tuple[float, int]]:
    return [(elevator, row) for elevator, rows in PUBLISHED.items() for row in range(len(rows))]


@pytest.mark.parametrize(("elevator", "row"), printed())
def test_every_published_limit_point_is_found(
    branches: dict[float, EquilibriumBranch], elevator: float, row: int
) -> None:
    numbers = np.array([MISPRINTED.get((elevator, row, k), x) for k, x in enumerate(PUBLISHED[elevator][row])])
    found = np.array([[*point.state, point.parameter] for point in branches[elevator].limit_points])
    away = np.abs(found - numbers).max(axis=1)
    assert np.sort(away)[0] <= PRINTED
    assert (np.sort(away)[1:] > 0.1).all()  # it is this one and no other


def test_there_are_no_others_on_these_branches(branches: dict[float, EquilibriumBranch]) -> None:
    assert {elevator: len(branch.limit_points) for elevator, branch in branches.items()} == {
        elevator: len(rows) for elevator, rows in PUBLISHED.items()
    }


@pytest.mark.parametrize("elevator", list(PUBLISHED))
def test_the_limit_points_are_extrema_of_the_eliminated_equation(
    branches: dict[float, EquilibriumBranch], elevator: float
) -> None:
    """A second road without continuation: the aileron as a function of the roll rate, one equation in one unknown."""
    for point in branches[elevator].limit_points:

        def aileron(p: float, near: float = point.parameter) -> float:
            width = 1e-3
            return brentq(lambda a: rolling_moment(p, a, elevator)[0], near - width, near + width, xtol=1e-15)

        p = float(point.state[0])
        extremum = minimize_scalar(
            lambda p, sign=point.opens: sign * aileron(p),
            bounds=(p - 0.01, p + 0.01),
            method="bounded",
            options={"xatol": 1e-9},
        )
        assert point.opens * extremum.fun == pytest.approx(point.parameter, abs=1e-11)
        assert extremum.x == pytest.approx(p, abs=1e-6)  # comparing values finds it to the root of rounding
        np.testing.assert_allclose(rolling_moment(p, point.parameter, elevator)[1], point.state, atol=1e-9)
        assert point.residual <= RESIDUAL
        assert abs(point.test) < 1e-9
        assert not point.corner
        low, high = np.sort(point.bracket_state[:, 0])
        assert low <= p <= high


def test_the_search_finds_what_the_branch_through_level_flight_does_not(
    branches: dict[float, EquilibriumBranch],
) -> None:
    """At elevator 0 two more limit points lie on branches that are not connected to it; elimination confirms them."""
    picture = equilibrium_branches(fighter(0.0))
    known = [point.parameter for point in branches[0.0].limit_points]
    new = [p for p in picture.limit_points if min(abs(p.parameter - k) for k in known) > 1e-9]
    assert len(picture.limit_points) == len(known) + len(new)
    assert len(new) == 2
    for point in new:
        moment, state = rolling_moment(float(point.state[0]), point.parameter, 0.0)
        assert moment == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(state, point.state, atol=1e-9)


def test_a_grid_of_eliminations_counts_the_same_equilibria() -> None:
    """Sign changes of the eliminated equation over the roll rate, against the search in five dimensions."""
    box = fighter(-0.008)
    for aileron in (-0.3, -0.1, 0.1, 0.3):
        grid = np.linspace(-10.0, 10.0, 8001)
        moments, states = rolling_moment(grid, aileron, -0.008)
        inside = ((box.state_box[:, :1] < states) & (states < box.state_box[:, 1:])).all(axis=0)
        changes = (moments[:-1] * moments[1:] < 0.0) & inside[:-1] & inside[1:]
        assert len(equilibria_in_box(box, aileron).state) == int(changes.sum())

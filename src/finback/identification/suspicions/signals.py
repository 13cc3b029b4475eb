"""Signals beside a model's own terms: what a calm, attached flight may hold, and what it may not.

Each function returns for every stretch an array (n, signals); a signal stands for a term that both equations may have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.weak_form import Sides, WeakForm

Signals = tuple[FloatArray, ...]

_STATIC_NODES: Final = 9  # over the range of alpha, for what the form misses of its curves
_SLOWEST_HZ: Final = 0.1
"""Below this frequency everything may change: airspeed, air density, thrust, and with them all coefficients."""
_MOST_OF_EQUATIONS: Final = 0.15  # of which slow changes may be fitted: beyond, they would hide what is looked for
_LINEAR: Final = 4  # 1, alpha, q, elevator
UNSTEADY_NODES: Final = 5  # over the range of alpha: a stall is a fifth of it
_SMALL_RANGE: Final = 0.3
"""Of the airspeed, over which what it does is of second order in it."""
LAGS_S: Final = (0.05, 0.1, 0.2, 0.4)
"""Of the elevator: actuators, delays and downwash lag less than the last."""
SPEED: Final = "airspeed_m_s"
_PITCH: Final = "theta_rad"
BESIDE: Final = (SPEED, _PITCH)
"""Channels that are of use here beside those of the fit."""


def attached_signals(
    forms: Sequence[WeakForm],
    states: Sequence[FloatArray],
    beside: Sequence[Mapping[str, FloatArray]],
    about: Sequence[FloatArray] | None = None,
) -> Signals:
    """Return all that a calm and attached flight may hold beside the model: static curves, damping, slow changes.

    Args:
        forms: the weak equations of every stretch.
        states: where the signals are taken, shape (n, 2) each.
        beside: further channels of every stretch; where all have the airspeed, what it does is added.
        about: states that lay the nodes and centers; those above if left out.
    """
    about = states if about is None else about
    damping = tuple(np.column_stack([state[:, 0] * state[:, 1], state[:, 0] ** 2 * state[:, 1]]) for state in states)
    static, slow = static_signals(forms, states, about), _slow(forms, states, about)
    return together(static, damping, slow, speed_signals(forms, states, beside, about))


def static_signals(forms: Sequence[WeakForm], states: Sequence[FloatArray], about: Sequence[FloatArray]) -> Signals:
    """Return what a form may miss of the curves over alpha and the elevator: a broken line over alpha, products."""
    nodes = alpha_nodes(about, _STATIC_NODES)
    found = []
    for weak, state in zip(forms, states, strict=True):
        alpha, elevator = state[:, 0], weak.stretch.elevator_rad
        products = [alpha * elevator, elevator**2, alpha**2 * elevator]
        found.append(np.column_stack([hats(alpha, nodes), *products]))
    return tuple(found)


def flight_signals(forms: Sequence[WeakForm], states: Sequence[FloatArray]) -> Signals:
    """Return what another density, mass or moment of inertia does to each flight: every coefficient times a factor.

    Nothing is returned of one flight alone, of which the model's own terms hold it.
    """
    flights = tuple(dict.fromkeys(weak.stretch.flight for weak in forms))
    found = []
    for weak, state in zip(forms, states, strict=True):
        whole = np.zeros((len(state), _LINEAR * (len(flights) - 1)))
        place = _LINEAR * flights.index(weak.stretch.flight)
        if place < whole.shape[1]:
            linear = np.column_stack([np.ones(len(state)), state, weak.stretch.elevator_rad])
            whole[:, place : place + _LINEAR] = linear
        found.append(whole)
    return tuple(found)


def _slow(forms: Sequence[WeakForm], states: Sequence[FloatArray], about: Sequence[FloatArray]) -> Signals:
    """Return a straight function of alpha, q and the elevator for each stretch, which changes slowly in time.

    It holds constant biases of the stretch to first order, and what airspeed and density do to every coefficient,
    recorded or not.
    """
    counts = [_slow_count(weak) for weak in forms]
    ends = np.cumsum([_LINEAR * count for count in counts])
    found = []
    for weak, state, middle, count, end in zip(forms, states, about, counts, ends, strict=True):
        elevator = weak.stretch.elevator_rad
        linear = np.column_stack(
            [np.ones(len(state)), state - middle.mean(axis=0), elevator - elevator.mean()],
        )
        phase = np.linspace(0.0, np.pi, len(state))
        changing = np.cos(phase[:, np.newaxis] * np.arange(count))
        whole = np.zeros((len(state), int(ends[-1])))
        whole[:, end - _LINEAR * count : end] = (linear[:, :, np.newaxis] * changing[:, np.newaxis]).reshape(
            len(state), -1
        )
        found.append(whole)
    return tuple(found)


def speed_signals(
    forms: Sequence[WeakForm],
    states: Sequence[FloatArray],
    beside: Sequence[Mapping[str, FloatArray]],
    about: Sequence[FloatArray] | None = None,
) -> Signals:
    """Return what the airspeed does to every term, to second order, and gravity along a path that is not level.

    Where it changes by more than 30 %, the curves over alpha change with it in every shape that they may have.

    Args:
        forms: the weak equations of every stretch.
        states: smoothed alpha in rad and q in rad/s, shape (n, 2) each.
        beside: further channels of every stretch; nothing is returned unless all have the airspeed.
        about: states that lay the nodes; those above if left out.
    """
    if not all(SPEED in channels for channels in beside):
        return tuple(np.empty((len(state), 0)) for state in states)
    middle = float(np.mean(np.concatenate([channels[SPEED] for channels in beside])))
    nodes = alpha_nodes(states if about is None else about, _STATIC_NODES)
    found = []
    for weak, state, channels in zip(forms, states, beside, strict=True):
        alpha, q = state[:, 0], state[:, 1]
        terms = np.column_stack([np.ones_like(alpha), q, alpha, alpha**2, alpha**3, weak.stretch.elevator_rad])
        faster = (channels[SPEED] / middle - 1.0)[:, np.newaxis]
        parts = [terms * faster, terms * faster**2]
        if speed_range(beside) > _SMALL_RANGE:
            curve = hats(alpha, nodes)
            parts += [curve / (1.0 + faster), curve * faster, curve * faster**2, terms[:, [1, 5]] * faster**3]
        if all(_PITCH in other for other in beside):
            climb = (channels[_PITCH] - alpha)[:, np.newaxis]
            parts.append((np.cos(climb) - 1.0) / (1.0 + faster))
        found.append(np.concatenate(parts, axis=1))
    return tuple(found)


def speed_range(beside: Sequence[Mapping[str, FloatArray]]) -> float:
    """Return the largest airspeed over the smallest, less 1; all of ``beside`` have it."""
    speed = np.concatenate([channels[SPEED] for channels in beside])
    return float(speed.max() / speed.min() - 1.0)


def late_signals(forms: Sequence[WeakForm]) -> Signals:
    """Return the elevator of some time ago."""
    found = []
    for weak in forms:
        time = np.arange(len(weak.stretch)) * weak.stretch.interval_s
        found.append(np.stack([np.interp(time - lag, time, weak.stretch.elevator_rad) for lag in LAGS_S], axis=1))
    return tuple(found)


def unsteady_signals(states: Sequence[FloatArray], sides: Sequence[Sides]) -> Signals:
    """Return what a flow that lags behind alpha adds: dα/dt, and dq/dt for d²α/dt², times hats over alpha."""
    nodes = alpha_nodes(states, UNSTEADY_NODES)
    found = []
    for state, side in zip(states, sides, strict=True):
        local = hats(state[:, 0], nodes)
        found.append(np.column_stack([local * side.mean.rates[:, :1], local * side.mean.rates[:, 1:]]))
    return tuple(found)


def together(*groups: Signals) -> Signals:
    """Return the signals of all groups side by side."""
    return tuple(np.concatenate(parts, axis=1) for parts in zip(*groups, strict=True))


def hats(alpha_rad: FloatArray, nodes: FloatArray) -> FloatArray:
    """Return hat functions over the nodes, which sum to 1, at ``alpha_rad``, shape (n, nodes)."""
    return np.stack([np.interp(alpha_rad, nodes, hat) for hat in np.eye(nodes.size)], axis=1)


def alpha_nodes(states: Sequence[FloatArray], count: int) -> FloatArray:
    """Return nodes over the range of alpha in all stretches."""
    alpha = np.concatenate([state[:, 0] for state in states])
    return np.linspace(alpha.min(), alpha.max(), count)


def _slow_count(weak: WeakForm) -> int:
    """Return how many cosines hold everything below the slowest frequency; fewer if the stretch is short."""
    duration = (len(weak.stretch) - 1) * weak.stretch.interval_s
    wanted = int(np.ceil(2.0 * _SLOWEST_HZ * duration)) + 1
    return max(1, min(wanted, int(_MOST_OF_EQUATIONS * weak.starts.size / _LINEAR)))

"""The motion that measured rates and specific forces imply, and how small errors of them move it.

A rigid body over a flat Earth in uniform air: attitude as a quaternion (body from north-east-down), velocity relative
to the air in body axes, height. No aerodynamics is in it. The errors (rotation about the body axes, velocity, height)
obey

    δφ' = −ω×δφ + δω,   δv' = −ω×δv + g×δφ + v×δω + δf,   δh' = −d·δv − (v×d)·δφ,

g and d gravity and the direction down in body axes (Titterton & Weston 2004, Strapdown Inertial Navigation Technology,
section 12.3, written in body axes). Uniform air that moves changes nothing but the height, if it rises.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled

STATES: Final = 7
"""Errors: rotation about x, y, z in rad, velocity along x, y, z in m/s, height in m."""
INPUTS: Final = 6
"""p, q, r in rad/s, then specific forces along x, y, z in m/s²."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPath:
    """A motion and its linear errors.

    Attributes:
        attitude_rad: phi, theta, psi, each without jumps, shape (n, 3).
        velocity_m_s: along body axes, shape (n, 3).
        height_m: above the start, shape (n,).
        transition: of the errors from each sample to the next, shape (n - 1, 7, 7).
        gain: of errors of the inputs, held over the step, shape (n - 1, 7, 6).
        down: the direction down in body axes, shape (n, 3).
    """

    attitude_rad: FloatArray
    velocity_m_s: FloatArray
    height_m: FloatArray
    transition: FloatArray
    gain: FloatArray
    down: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sideward:
    """Where the sideward velocity v comes from.

    Attributes:
        free: whether it is integrated; else it is what is given.
        velocity_m_s: given at the samples, shape (n,).
        middles_m_s: given halfway between, shape (n - 1,).
    """

    free: bool
    velocity_m_s: FloatArray
    middles_m_s: FloatArray


def flight_path(
    inputs: FloatArray,
    middles: FloatArray,
    *,
    interval_s: float,
    gravity_m_s2: float,
    start: FloatArray,
    sideward: Sideward,
) -> FlightPath:
    """Integrate by Runge and Kutta's fourth-order rule, a step a sample.

    Args:
        inputs: p, q, r, ax, ay, az at the samples, shape (n, 6).
        middles: the same halfway between, shape (n - 1, 6).
        interval_s: between samples.
        gravity_m_s2: taken as constant.
        start: phi, theta, psi in rad, then u, v, w in m/s, shape (6,).
        sideward: where v comes from.
    """
    states, transition, gain, down = _flown(
        np.ascontiguousarray(inputs),
        np.ascontiguousarray(middles),
        interval_s,
        gravity_m_s2,
        start,
        sideward.velocity_m_s,
        sideward.middles_m_s,
        float(sideward.free),
    )
    e0, e1, e2, e3 = states[:, :4].T
    attitude = np.column_stack(
        [
            np.unwrap(np.arctan2(2.0 * (e0 * e1 + e2 * e3), 1.0 - 2.0 * (e1 * e1 + e2 * e2))),
            np.arcsin(np.clip(2.0 * (e0 * e2 - e3 * e1), -1.0, 1.0)),
            np.unwrap(np.arctan2(2.0 * (e0 * e3 + e1 * e2), 1.0 - 2.0 * (e2 * e2 + e3 * e3))),
        ]
    )
    return FlightPath(
        attitude_rad=attitude,
        velocity_m_s=states[:, 4:7],
        height_m=states[:, 7],
        transition=transition,
        gain=gain,
        down=down,
    )


def seen_late(path: FlightPath, output: FloatArray, delay_s: float, *, interval_s: float, gravity: float) -> FloatArray:
    """Return the derivative of a delayed output by the errors of the motion when it is written, shape (n, 7).

    Seen from the Earth, errors of the motion stay what they were but for gravity and for the height that velocity
    makes; in body axes they turn with the body. A filter that took those of now for those of then would see, in what is
    only that turn, a contradiction that grows with the errors, and take it for knowledge.

    Args:
        path: the motion.
        output: derivative by the errors of the same time, shape (n, 7).
        delay_s: of the output; negative if it is ahead.
        interval_s: between samples.
        gravity: in m/s².
    """
    turn = _body_from_earth(path.attitude_rad)
    earth = output.copy()
    for part in (slice(0, 3), slice(3, 6)):
        earth[:, part] = np.einsum("ni,nij->nj", output[:, part], turn)
    count = len(output)
    place = np.clip(np.arange(count) - delay_s / interval_s, 0.0, count - 1.0)
    before = np.minimum(place.astype(np.int64), count - 2)
    share = (place - before)[:, np.newaxis]
    earth = (1.0 - share) * earth[before] + share * earth[before + 1]
    speed = np.einsum("nij,ni->nj", turn, path.velocity_m_s)
    # Then: velocity less g × rotation times the delay; height more by the way that these errors make.
    velocity, height = earth[:, 3:6].copy(), earth[:, 6].copy()
    earth[:, 0] -= delay_s * gravity * velocity[:, 1]
    earth[:, 1] += delay_s * gravity * velocity[:, 0]
    earth[:, 0] += delay_s * height * speed[:, 1]
    earth[:, 1] -= delay_s * height * speed[:, 0]
    earth[:, 5] += delay_s * height
    found: FloatArray = earth.copy()
    for part in (slice(0, 3), slice(3, 6)):
        found[:, part] = np.einsum("ni,nji->nj", earth[:, part], turn)
    return found


def _body_from_earth(attitude_rad: FloatArray) -> FloatArray:
    """Return the rotation from north-east-down to body axes, shape (n, 3, 3)."""
    (sp, st, sy), (cp, ct, cy) = np.sin(attitude_rad).T, np.cos(attitude_rad).T
    rows = [
        [ct * cy, ct * sy, -st],
        [sp * st * cy - cp * sy, sp * st * sy + cp * cy, sp * ct],
        [cp * st * cy + sp * sy, cp * st * sy - sp * cy, cp * ct],
    ]
    turn: FloatArray = np.moveaxis(np.array(rows), 2, 0)
    return turn


@compiled
def _rates(
    state: FloatArray, given: FloatArray, gravity: float, sideward: float, free: float, rates: FloatArray
) -> None:
    e0, e1, e2, e3 = state[0], state[1], state[2], state[3]
    p, q, r = given[0], given[1], given[2]
    u, w = state[4], state[6]
    v = state[5] if free > 0.0 else sideward
    rates[0] = -0.5 * (e1 * p + e2 * q + e3 * r)
    rates[1] = 0.5 * (e0 * p + e2 * r - e3 * q)
    rates[2] = 0.5 * (e0 * q + e3 * p - e1 * r)
    rates[3] = 0.5 * (e0 * r + e1 * q - e2 * p)
    # The last row of the rotation from body to Earth: down in body axes.
    dx, dy, dz = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), 1.0 - 2.0 * (e1 * e1 + e2 * e2)
    rates[4] = r * v - q * w + gravity * dx + given[3]
    rates[5] = p * w - r * u + gravity * dy + given[4] if free > 0.0 else 0.0
    rates[6] = q * u - p * v + gravity * dz + given[5]
    rates[7] = -(dx * u + dy * v + dz * w)


@compiled
def _flown(  # noqa: PLR0913, PLR0917, C901, PLR0912 - a kernel takes its arrays one by one; one loop compiles fastest
    inputs: FloatArray,
    middles: FloatArray,
    interval: float,
    gravity: float,
    start: FloatArray,
    sideward: FloatArray,
    sideward_middles: FloatArray,
    free: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    count = inputs.shape[0]
    states, down = np.empty((count, 8)), np.empty((count, 3))
    transition, gain = np.zeros((count - 1, 7, 7)), np.zeros((count - 1, 7, 6))
    state, point, rates, total = np.zeros(8), np.zeros(8), np.zeros(8), np.zeros(8)
    c, s = np.cos(0.5 * start[:3]), np.sin(0.5 * start[:3])
    state[0] = c[0] * c[1] * c[2] + s[0] * s[1] * s[2]
    state[1] = s[0] * c[1] * c[2] - c[0] * s[1] * s[2]
    state[2] = c[0] * s[1] * c[2] + s[0] * c[1] * s[2]
    state[3] = c[0] * c[1] * s[2] - s[0] * s[1] * c[2]
    state[4:7] = start[3:6]
    a, b = np.zeros((7, 7)), np.zeros((7, 6))
    for i in range(count):
        if free == 0.0:
            state[5] = sideward[i]
        states[i] = state
        e0, e1, e2, e3 = state[0], state[1], state[2], state[3]
        down[i, 0], down[i, 1] = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1)
        down[i, 2] = 1.0 - 2.0 * (e1 * e1 + e2 * e2)
        if i == count - 1:
            break
        total[:] = 0.0
        for stage in range(4):
            node = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
            weight = 1.0 if stage in (0, 3) else 2.0
            given = inputs[i] if stage == 0 else inputs[i + 1] if stage == 3 else middles[i]
            aside = sideward[i] if stage == 0 else sideward[i + 1] if stage == 3 else sideward_middles[i]
            for k in range(8):
                point[k] = state[k] + node * interval * rates[k] if stage > 0 else state[k]
            if stage == 2:  # the middle of the step
                _linear(point, given, gravity, free, a, b)
            _rates(point, given, gravity, aside, free, rates)
            for k in range(8):
                total[k] += weight * rates[k]
        length = 0.0
        for k in range(8):
            state[k] += interval / 6.0 * total[k]
            if k < 4:
                length += state[k] * state[k]
        for k in range(4):
            state[k] /= np.sqrt(length)
        # I + A h + (A h)²/2, and (I + A h/2) B h.
        for k in range(7):
            for m in range(7):
                square = 0.0
                for n in range(7):
                    square += a[k, n] * a[n, m]
                transition[i, k, m] = interval * a[k, m] + 0.5 * interval * interval * square
            transition[i, k, k] += 1.0
            for m in range(6):
                product = 0.0
                for n in range(7):
                    product += a[k, n] * b[n, m]
                gain[i, k, m] = interval * b[k, m] + 0.5 * interval * interval * product
    return states, transition, gain, down


@compiled
def _linear(state: FloatArray, given: FloatArray, gravity: float, free: float, a: FloatArray, b: FloatArray) -> None:
    e0, e1, e2, e3 = state[0], state[1], state[2], state[3]
    p, q, r = given[0], given[1], given[2]
    u, v, w = state[4], state[5], state[6]
    x, y, z = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), 1.0 - 2.0 * (e1 * e1 + e2 * e2)
    a[0, 1], a[0, 2], a[1, 0], a[1, 2], a[2, 0], a[2, 1] = r, -q, -r, p, q, -p
    a[3, 4], a[3, 5], a[4, 3], a[4, 5], a[5, 3], a[5, 4] = r, -q, -r, p, q, -p
    a[3, 1], a[3, 2] = -gravity * z, gravity * y
    a[4, 0], a[4, 2] = gravity * z, -gravity * x
    a[5, 0], a[5, 1] = -gravity * y, gravity * x
    a[6, 0], a[6, 1], a[6, 2] = w * y - v * z, u * z - w * x, v * x - u * y
    a[6, 3], a[6, 4], a[6, 5] = -x, -y, -z
    b[0, 0], b[1, 1], b[2, 2] = 1.0, 1.0, 1.0
    b[3, 1], b[3, 2], b[4, 0], b[4, 2], b[5, 0], b[5, 1] = -w, v, w, -u, -v, u
    b[3, 3], b[4, 4], b[5, 5] = 1.0, 1.0, 1.0
    if free == 0.0:  # v is what it is: its error is none
        a[4, :] = 0.0
        a[:, 4] = 0.0
        b[4, :] = 0.0


@compiled
def carried(transition: FloatArray, gain: FloatArray, drive: FloatArray, owner: IntArray) -> FloatArray:
    """Return the errors that drives of the inputs and unit errors of the start make, shape (n, 7, columns + 7).

    Args:
        transition: of a flight path.
        gain: of a flight path.
        drive: change of an input at the samples, one column each, shape (n, columns).
        owner: which input each column changes, shape (columns,).
    """
    count, columns = drive.shape
    found = np.zeros((count, 7, columns + 7))
    for k in range(7):
        found[0, k, columns + k] = 1.0
    for i in range(count - 1):
        for k in range(7):
            for n in range(7):
                factor = transition[i, k, n]
                if factor != 0.0:
                    for m in range(columns + 7):
                        found[i + 1, k, m] += factor * found[i, n, m]
            for m in range(columns):
                found[i + 1, k, m] += gain[i, k, owner[m]] * 0.5 * (drive[i, m] + drive[i + 1, m])
    return found


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """What is random in the comparison of a motion with measurements.

    Attributes:
        process: variance of the noise of each input at a sample, shape (6,).
        noise: variance of the noise of each output at a sample, shape (outputs,).
        gusts_m_s: standard deviation of the air's velocity along each body axis, all 0 for still air.
        gust_s: correlation time of it: dw/dt = −w/τ + white noise, the longitudinal form of Dryden.
    """

    process: FloatArray
    noise: FloatArray
    gusts_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust_s: float = 1.0

    @property
    def moves(self) -> bool:
        """Whether there are gusts."""
        return max(self.gusts_m_s) > 0.0


def whitened(
    path: FlightPath, output: FloatArray, rows: FloatArray, *, interval_s: float, disturbance: Disturbance
) -> tuple[FloatArray, float]:
    """Return rows such that all noise is white in them, of variance 1, and the logarithm of the determinant of it.

    A Kalman filter whose gains come from the noises alone passes over all columns alike: the innovations of the first,
    if it is measured less implied, are white where the model is right, and the others are their derivatives
    (Jategaonkar 2015, section 5.3). A row that is not finite is not used, and comes back as 0.

    Args:
        path: the motion.
        output: derivative of each output by the errors of the motion, then by the velocity of the air, shape
            (n, outputs, 10).
        rows: shape (n, outputs, columns).
        interval_s: between samples.
        disturbance: the noises.
    """
    size = STATES + 3 if disturbance.moves else STATES
    return _whitened(
        path.transition,
        path.gain,
        output,
        disturbance.process,
        disturbance.noise,
        np.ascontiguousarray(rows),
        size,
        np.array(disturbance.gusts_m_s) ** 2,
        float(np.exp(-interval_s / disturbance.gust_s)),
    )


@compiled
def _whitened(  # noqa: PLR0913, PLR0917, C901, PLR0912 - a kernel takes its arrays one by one; one loop compiles fastest
    transition: FloatArray,
    gain: FloatArray,
    output: FloatArray,
    process: FloatArray,
    noise: FloatArray,
    rows: FloatArray,
    size: int,
    gust: FloatArray,
    memory: float,
) -> tuple[FloatArray, float]:
    count, outputs, columns = rows.shape
    found, log_determinant = np.zeros(rows.shape), 0.0
    mean, moved = np.zeros((size, columns)), np.zeros((size, columns))
    p, t, h = np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
    for k in range(7, size):
        p[k, k] = gust[k - 7]
    for i in range(count):
        if i > 0:
            moved[:] = 0.0
            for k in range(7):
                for n in range(7):
                    factor = transition[i - 1, k, n]
                    if factor != 0.0:
                        for m in range(columns):
                            moved[k, m] += factor * mean[n, m]
            for k in range(7, size):
                for m in range(columns):
                    moved[k, m] = memory * mean[k, m]
            mean[:] = moved
            for k in range(size):
                for m in range(size):
                    t[k, m] = 0.0
                    if k < 7:
                        for n in range(7):
                            t[k, m] += transition[i - 1, k, n] * p[n, m]
                    else:
                        t[k, m] = memory * p[k, m]
            for k in range(size):
                for m in range(k + 1):
                    value = 0.0
                    if m < 7:
                        for n in range(7):
                            value += t[k, n] * transition[i - 1, m, n]
                    else:
                        value = memory * t[k, m]
                    if k < 7:
                        for n in range(6):
                            value += gain[i - 1, k, n] * process[n] * gain[i - 1, m, n]
                    elif k == m:
                        value += gust[k - 7] * (1.0 - memory * memory)
                    p[k, m] = value
                    p[m, k] = value
        for j in range(outputs):
            if not np.isfinite(rows[i, j, 0]):
                continue
            variance = noise[j]
            for k in range(size):
                h[k] = 0.0
                for n in range(size):
                    h[k] += p[k, n] * output[i, j, n]
                variance += h[k] * output[i, j, k]
            scale = np.sqrt(variance)
            log_determinant += np.log(variance)
            for m in range(columns):
                value = rows[i, j, m]
                for k in range(size):
                    value -= output[i, j, k] * mean[k, m]
                found[i, j, m] = value / scale
                for k in range(size):
                    mean[k, m] += h[k] * value / variance
            for k in range(size):
                for m in range(size):
                    p[k, m] -= h[k] * h[m] / variance
    return found, log_determinant

"""Longitudinal flight by coefficients: rates of V, α, θ and q and the specific forces, with all their derivatives.

Over a flat Earth, wings level, with thrust T at the angle ε above the body x-axis (Klein & Morelli 2006, section 3.5):

    m ax = q̄ S CX + T cos ε,    m az = q̄ S CZ - T sin ε,    q̄ = ρ V² / 2,
    dV/dt = ax cos α + az sin α - g sin(θ - α),    dα/dt = q + (az cos α - ax sin α + g cos(θ - α)) / V,
    dθ/dt = q,    Iy dq/dt = q̄ S (c Cm + z CX - x CZ) + T arm,

with CX = CL sin α - CD cos α and CZ = -CL cos α - CD sin α, and the point that Cm is about x forward of and z below the
center of gravity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm

RATES: Final = 6
"""dV/dt, dα/dt, dθ/dt, dq/dt, ax, az: the order of every table of them."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """A form and an airframe as arrays, one entry for each monomial of each term.

    Attributes:
        owner: index of the number that multiplies it, shape (parts,).
        weight: its fixed factor, shape (parts,).
        exponents: of the moving variables and the inputs, shape (parts, 5 + inputs).
        ends: index after the last number of each of the three coefficients, shape (3,).
        frame: mass, S, c, Iy, cos ε, sin ε, arm, x and z of the reference point, reference speed V₀, shape (10,).
        body: whether the first two coefficients are CX and CZ; else CD and CL.
    """

    owner: IntArray
    weight: FloatArray
    exponents: IntArray
    ends: IntArray
    frame: FloatArray
    body: bool


@lru_cache(maxsize=64)
def layout(form: CoefficientForm, airframe: Airframe, reference_speed_m_s: float) -> Layout:
    """Return form and airframe as arrays."""
    rows = [
        (index, part.weight, [dict(part.factors).get(name, 0) for name in form.variables])
        for index, (_, term) in enumerate(form.terms)
        for part in term.monomials
    ]
    frame = (
        airframe.mass_kg,
        airframe.wing_area_m2,
        airframe.chord_m,
        airframe.pitch_inertia_kg_m2,
        math.cos(airframe.thrust_angle_rad),
        math.sin(airframe.thrust_angle_rad),
        airframe.thrust_arm_m,
        airframe.reference_x_m,
        airframe.reference_z_m,
        reference_speed_m_s,
    )
    return Layout(
        owner=np.array([row[0] for row in rows], dtype=np.int64),
        weight=np.array([row[1] for row in rows]),
        exponents=np.array([row[2] for row in rows], dtype=np.int64),
        ends=np.array(form.ends(), dtype=np.int64),
        frame=np.array(frame),
        body=form.axes is Axes.BODY,
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Rates and specific forces at n points, in the order of ``RATES``.

    Attributes:
        rates: shape (n, 6).
        jacobian: by V, α, θ, q, shape (n, 6, 4).
        direct: by the numbers of the coefficients, shape (n, 6, p).
        elevator: by the elevator, shape (n, 6).
    """

    rates: FloatArray
    jacobian: FloatArray
    direct: FloatArray
    elevator: FloatArray


def motion(  # noqa: PLR0913, PLR0917 - a model, its numbers, and where it is evaluated
    terms: Layout,
    numbers: FloatArray,
    states: FloatArray,
    inputs: FloatArray,
    density_kg_m3: FloatArray,
    thrust_n: FloatArray,
    gravity_m_s2: float,
) -> Motion:
    """Evaluate at n points.

    Args:
        terms: form and airframe.
        numbers: of the coefficients, shape (p,).
        states: V, α, θ, q in SI, shape (n, 4).
        inputs: in SI, shape (n, inputs).
        density_kg_m3: shape (n,).
        thrust_n: shape (n,).
        gravity_m_s2: g.
    """
    rates, jacobian, direct, elevator = _many(
        _writable(states),
        _writable(inputs),
        _writable(np.column_stack([density_kg_m3, thrust_n])),
        gravity_m_s2,
        _writable(numbers),
        terms.owner,
        terms.weight,
        terms.exponents,
        terms.ends,
        terms.frame,
        terms.body,
    )
    return Motion(rates=rates, jacobian=jacobian, direct=direct, elevator=elevator)


def _writable(array: FloatArray) -> FloatArray:
    """Return an array of the one type that kernels are compiled for."""
    return np.require(array, np.float64, ["C", "W"])


@compiled
def evaluate(  # noqa: PLR0913, PLR0915, PLR0917, C901, PLR0912 - one formula, faster compiled in one piece
    state: FloatArray,
    inputs: FloatArray,
    density: float,
    thrust: float,
    gravity: float,
    numbers: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    ends: IntArray,
    frame: FloatArray,
    body: bool,  # noqa: FBT001 - a kernel takes its values one by one
    point: FloatArray,
    basis: FloatArray,
    rates: FloatArray,
    jacobian: FloatArray,
    direct: FloatArray,
    elevator: FloatArray,
) -> None:
    """Write rates and derivatives at one point; ``point`` (5 + inputs) and ``basis`` (p,) are scratch."""
    speed, alpha, theta, q = state[0], state[1], state[2], state[3]
    mass, area, chord, inertia = frame[0], frame[1], frame[2], frame[3]
    rx, rz, reference = frame[7], frame[8], frame[9]
    sine, cosine = math.sin(alpha), math.cos(alpha)
    point[0], point[1], point[2] = alpha, q * chord / (2.0 * speed), q * chord / (2.0 * reference)
    point[3], point[4] = speed / reference, 0.0
    point[5:] = inputs
    value, slope, moves = np.zeros(3), np.zeros((3, 6)), np.zeros((3, 5))
    basis[:] = 0.0
    load = 0.5 * density * speed * speed * area
    path = theta - alpha
    down, back = gravity * math.cos(path), gravity * math.sin(path)
    cx, cz, normal = 0.0, 0.0, 0.0
    forces = True
    jacobian[:] = 0.0
    for part in range(owner.size + 1):
        if forces and (part == owner.size or owner[part] >= ends[1]):
            # All of both forces is known: so is dα/dt, which Cm may hold.
            forces = False
            _moved(slope, moves, 0, 2, point, chord, speed, reference)
            cx, cz = value[0], value[1]
            if not body:
                drag, lift = value[0], value[1]
                cx, cz = lift * sine - drag * cosine, -lift * cosine - drag * sine
                for k in range(5):
                    drag_k, lift_k = moves[0, k], moves[1, k]
                    moves[0, k], moves[1, k] = lift_k * sine - drag_k * cosine, -lift_k * cosine - drag_k * sine
                moves[0, 1] -= cz
                moves[1, 1] += cx
            rates[4] = (load * cx + thrust * frame[4]) / mass
            rates[5] = (load * cz - thrust * frame[5]) / mass
            normal = rates[5] * cosine - rates[4] * sine + down
            rates[0], rates[1], rates[2] = rates[4] * cosine + rates[5] * sine - back, q + normal / speed, q
            _slopes_of_forces(
                moves, cx, cz, load, mass, speed, cosine, sine, down, back, normal, rates, jacobian, elevator
            )
            point[4] = rates[1] * chord / (2.0 * speed)
        if part == owner.size:
            break
        which = 0 if owner[part] < ends[0] else 1 if owner[part] < ends[1] else 2
        product = weight[part]
        for j in range(exponents.shape[1]):
            for _ in range(exponents[part, j]):
                product *= point[j]
        scale = numbers[owner[part]]
        basis[owner[part]] += product
        value[which] += scale * product
        for k in range(6):
            power = exponents[part, k]
            if power > 0:
                if point[k] != 0.0:
                    slope[which, k] += scale * power * product / point[k]
                else:
                    rest = weight[part] * power
                    for j in range(exponents.shape[1]):
                        for _ in range(exponents[part, j] - (1 if j == k else 0)):
                            rest *= point[j]
                    slope[which, k] += scale * rest
    _moved(slope, moves, 2, 3, point, chord, speed, reference)
    late = slope[2, 4] * chord / (2.0 * speed)  # of Cm by dα/dt
    for k in range(4):
        moves[2, k] += late * jacobian[1, k]
    moves[2, 0] -= slope[2, 4] * point[4] / speed
    moves[2, 4] += late * elevator[1]
    turning = chord * value[2] + rz * cx - rx * cz
    rates[3] = (load * turning + thrust * frame[6]) / inertia
    for k in range(5):
        turn_k = load * (chord * moves[2, k] + rz * moves[0, k] - rx * moves[1, k])
        if k == 0:
            turn_k += 2.0 * load * turning / speed
        if k == 4:
            elevator[3] = turn_k / inertia
        else:
            jacobian[3, k] = turn_k / inertia
    for j in range(numbers.size):
        one = basis[j] * load
        x, z, turn = 0.0, 0.0, 0.0
        if j >= ends[1]:
            turn = chord * one
        elif body:
            if j < ends[0]:
                x = one
            else:
                z = one
        elif j < ends[0]:
            x, z = -cosine * one, -sine * one
        else:
            x, z = sine * one, -cosine * one
        turn += rz * x - rx * z
        x, z = x / mass, z / mass
        direct[0, j], direct[1, j] = x * cosine + z * sine, (z * cosine - x * sine) / speed
        direct[2, j], direct[3, j] = 0.0, (turn + load * chord * late * direct[1, j]) / inertia
        direct[4, j], direct[5, j] = x, z


@compiled
def _moved(  # noqa: PLR0913, PLR0917 - a kernel takes its values one by one
    slope: FloatArray,
    moves: FloatArray,
    first: int,
    last: int,
    point: FloatArray,
    chord: float,
    speed: float,
    reference: float,
) -> None:
    """Write derivatives of some coefficients by V, α, θ, q and the elevator; dα/dt is taken as it is."""
    for i in range(first, last):
        moves[i, 0] = slope[i, 3] / reference - slope[i, 1] * point[1] / speed
        moves[i, 1] = slope[i, 0]
        moves[i, 3] = 0.5 * chord * (slope[i, 1] / speed + slope[i, 2] / reference)
        moves[i, 4] = slope[i, 5]


@compiled
def _slopes_of_forces(  # noqa: PLR0913, PLR0917 - a kernel takes its values one by one
    moves: FloatArray,
    cx: float,
    cz: float,
    load: float,
    mass: float,
    speed: float,
    cosine: float,
    sine: float,
    down: float,
    back: float,
    normal: float,
    rates: FloatArray,
    jacobian: FloatArray,
    elevator: FloatArray,
) -> None:
    """Write the derivatives of dV/dt, dα/dt, dθ/dt, ax and az."""
    ax, az = rates[4], rates[5]
    for k in range(5):
        ax_k, az_k = load * moves[0, k] / mass, load * moves[1, k] / mass
        if k == 0:
            ax_k += 2.0 * load * cx / (speed * mass)
            az_k += 2.0 * load * cz / (speed * mass)
        along, across = ax_k * cosine + az_k * sine, (az_k * cosine - ax_k * sine) / speed
        if k == 4:
            elevator[0], elevator[1], elevator[2] = along, across, 0.0
            elevator[4], elevator[5] = ax_k, az_k
        else:
            jacobian[0, k], jacobian[1, k] = along, across
            jacobian[4, k], jacobian[5, k] = ax_k, az_k
    jacobian[0, 1] += az * cosine - ax * sine + down
    jacobian[0, 2] -= down
    jacobian[1, 0] -= normal / (speed * speed)
    jacobian[1, 1] += (back - az * sine - ax * cosine) / speed
    jacobian[1, 2] -= back / speed
    jacobian[1, 3] += 1.0
    jacobian[2, 3] = 1.0


@compiled
def _many(  # noqa: PLR0913, PLR0917 - a kernel takes its arrays one by one
    states: FloatArray,
    inputs: FloatArray,
    air: FloatArray,
    gravity: float,
    numbers: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    ends: IntArray,
    frame: FloatArray,
    body: bool,  # noqa: FBT001 - a kernel takes its values one by one
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    count = states.shape[0]
    rates, jacobian = np.empty((count, 6)), np.empty((count, 6, 4))
    direct, elevator = np.empty((count, 6, numbers.size)), np.empty((count, 6))
    point, basis = np.empty(5 + inputs.shape[1]), np.empty(numbers.size)
    for i in range(count):
        evaluate(
            states[i],
            inputs[i],
            air[i, 0],
            air[i, 1],
            gravity,
            numbers,
            owner,
            weight,
            exponents,
            ends,
            frame,
            body,
            point,
            basis,
            rates[i],
            jacobian[i],
            direct[i],
            elevator[i],
        )
    return rates, jacobian, direct, elevator

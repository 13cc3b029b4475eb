"""Where the trace vanishes on a branch of a planar field: Hopf points, neutral saddles, Bogdanov-Takens points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.dynamics.hopf import Criticality
from finback.dynamics.linearity import intervals
from finback.dynamics.planar.event import Event, bracket, determinant_of, equations, trace_of
from finback.dynamics.planar.fold import following, solved
from finback.dynamics.planar.jet import PlanarJet, Point
from finback.dynamics.planar.path import dot
from finback.dynamics.planar.tracked import Mark, MovedField, tracked

_FIRST: Final = ((1, 0, 0), (0, 1, 0))
_SECOND: Final = ((2, 0, 0), (1, 1, 0), (0, 2, 0))
_THIRD: Final = ((3, 0, 0), (2, 1, 0), (1, 2, 0), (0, 3, 0))
_ORDERS: Final = tuple((row, order) for row in (0, 1) for order in (*_FIRST, *_SECOND, *_THIRD))
_STEP: Final = 1e-5  # relative; the Lyapunov coefficient is quadratic in what its derivative is not exact for
_NAMES: Final = ("state", "parameter_interval", "state_interval", "bracket")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarHopf:
    """A pair of eigenvalues crosses the imaginary axis: a cycle is born.

    Attributes:
        parameter: where.
        state: shape (2,).
        frequency: imaginary part of the eigenvalues, in rad/s; > 0.
        lyapunov: first Lyapunov coefficient a, where r' = a r³ for the amplitude r of the *first* state (Kuznetsov,
            Elements of Applied Bifurcation Theory, 3rd ed. 2004, Eq. 3.18, with an eigenvector whose first component
            is 1, so that a = Re c₁/4; the same as Guckenheimer & Holmes 1983, Eq. 3.4.11, in such coordinates).
        criticality: its sign, or that rounding hides it.
        crossing_speed: derivative of the real part of the eigenvalues by the parameter along the branch.
        parameter_interval: 95 % interval by the delta method, shape (2,); infinite where the point is not linear in the
            coefficients as far as their errors reach (``linearity``); frequency and coefficient then have none, too.
        state_interval: the same for both states, shape (2, 2).
        frequency_interval: the same for the frequency, shape (2,).
        lyapunov_interval: the same for the first Lyapunov coefficient, shape (2,).
        bracket: two points (first state, second state, parameter) of the branch between which the trace changes its
            sign beyond rounding, shape (2, 3).
        residual: the trace in 1/s, as evaluated.
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    frequency: float
    lyapunov: float
    criticality: Criticality
    crossing_speed: float
    parameter_interval: FloatArray
    state_interval: FloatArray
    frequency_interval: FloatArray
    lyapunov_interval: FloatArray
    bracket: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in (*_NAMES, "frequency_interval", "lyapunov_interval"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarNeutralSaddle:
    """A saddle whose eigenvalues are opposite: no bifurcation of equilibria.

    Attributes:
        parameter: where.
        state: shape (2,).
        eigenvalue: the positive one, in 1/s.
        parameter_interval: 95 % interval by the delta method, shape (2,); infinite where the point is not linear in the
            coefficients as far as their errors reach (``linearity``).
        state_interval: the same for both states, shape (2, 2).
        bracket: two points of the branch between which the trace changes its sign beyond rounding, shape (2, 3).
        residual: the trace in 1/s, as evaluated.
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    eigenvalue: float
    parameter_interval: FloatArray
    state_interval: FloatArray
    bracket: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in _NAMES:
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarBogdanovTakens:
    """Trace and determinant vanish together, as far as double precision can tell; the fold is listed, too.

    Two parameters are needed to meet such a point in general: a change of the coefficients parts trace zero and fold,
    so it has no interval of its own.

    Attributes:
        parameter: where.
        state: shape (2,).
        residual: trace and determinant as evaluated, shape (2,).
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    residual: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def planar_trace_zero(jet: PlanarJet, event: Event) -> PlanarHopf | PlanarNeutralSaddle | PlanarBogdanovTakens:
    """Describe an event where the trace changes its sign."""
    plain = PlanarJet(jet.system, (1.0, 1.0, 1.0))
    at = jet.to_si(event.at)
    system, state, parameter = jet.system, np.array(at[:2]), at[2]
    determinant, trace = determinant_of(plain).value(at), trace_of(plain).value(at)
    gradient = jet.determinant_gradient(event.at)
    in_domain = system.contains(state, parameter)
    if abs(determinant) <= jet.determinant_noise(event.at) + sum(map(abs, gradient)) * event.error:
        return PlanarBogdanovTakens(
            parameter=parameter, state=state, residual=np.array([trace, determinant]), in_domain=in_domain
        )
    moved = _shift(plain, at)
    ends = bracket(jet, trace_of(jet), event) * np.array(jet.units)
    stated = intervals(system, np.array(at), moved, following(system, at, Mark.TRACE))
    if determinant < 0.0:
        return PlanarNeutralSaddle(
            parameter=parameter,
            state=state,
            eigenvalue=(-determinant) ** 0.5,
            parameter_interval=stated[2],
            state_interval=stated[:2],
            bracket=ends,
            residual=trace,
            in_domain=in_domain,
        )
    values = _values(plain, at)
    turned = _rates_of_values(plain, at, moved)
    frequency = determinant**0.5
    by_values = _gradient(values)
    lyapunov = first_lyapunov(values)
    known = abs(lyapunov) > _rounding(plain, at, by_values, event.error * np.array(jet.units))
    known_place = np.isfinite(stated).all()  # of a point without one, nobody knows what these would be numbers of
    own = intervals(
        system,
        np.array([frequency, lyapunov]),
        np.stack([_determinant_rate(values, turned) / (2.0 * frequency), by_values @ turned])
        * (1.0 if known_place else np.nan),
        lambda changes: followed_hopf(MovedField(system, changes), at)[:, 3:],
    )
    return PlanarHopf(
        parameter=parameter,
        state=state,
        frequency=frequency,
        lyapunov=lyapunov,
        criticality=_criticality(lyapunov if known else 0.0),
        crossing_speed=_crossing_speed(plain, at),
        parameter_interval=stated[2],
        state_interval=stated[:2],
        frequency_interval=own[0],
        lyapunov_interval=own[1],
        bracket=ends,
        residual=trace,
        in_domain=in_domain,
    )


def followed_hopf(field: MovedField, at: Point) -> FloatArray:
    """Follow a Hopf point to all changes of a field.

    Returns:
        States, parameter, frequency and first Lyapunov coefficient with each change, shape (n, 5); nan where the point
        vanishes or becomes a neutral saddle.
    """
    points = tracked(field, at, Mark.TRACE)
    there = np.flatnonzero(np.isfinite(points).all(axis=1))
    found = np.full((len(points), 5), np.nan)
    found[there] = np.hstack([points[there], hopf_numbers(field, points[there], there)])
    found[np.isnan(found).any(axis=1)] = np.nan
    return found


def hopf_numbers(field: MovedField, at: FloatArray, which: IntArray) -> FloatArray:
    """Return frequency and first Lyapunov coefficient at zeros of the trace, shape (k, 2); nan at neutral saddles.

    Args:
        field: the field and its changes.
        at: states and parameter, shape (k, 3).
        which: of the changes, shape (k,).
    """
    whole, powers = np.ones(which.size), field.powers(at)
    values = np.stack([field.derivative(row, order, powers, whole, which)[0] for row, order in _ORDERS], axis=-1)
    squares = values[:, 0] * values[:, 10] - values[:, 1] * values[:, 9]
    pairs = [
        (square**0.5, first_lyapunov(row)) if square > 0.0 else (np.nan, np.nan)
        for square, row in zip(squares.tolist(), values, strict=True)
    ]
    return np.array(pairs).reshape(-1, 2)


def first_lyapunov(values: FloatArray) -> float:
    """Return a in r' = a r³, r the amplitude of the first state, at a Hopf point.

    Args:
        values: derivatives of the first rate, then of the second: by x, y; xx, xy, yy; xxx, xxy, xyy, yyy; shape (18,).
    """
    (p, q, *p_more), (r, s, *q_more) = values.reshape(2, 9).tolist()
    frequency = (p * s - q * r) ** 0.5
    turning = 1j * frequency
    vector = (1.0 + 0.0j, (turning - p) / q)
    left = (complex(r), turning - p)
    overlap = left[0] * vector[0] + left[1] * vector[1]
    conjugate = (1.0 + 0.0j, vector[1].conjugate())

    def twice(u: tuple[complex, complex], v: tuple[complex, complex]) -> complex:
        forms = [
            xx * u[0] * v[0] + xy * (u[0] * v[1] + u[1] * v[0]) + yy * u[1] * v[1]
            for xx, xy, yy in (p_more[:3], q_more[:3])
        ]
        return complex((left[0] * forms[0] + left[1] * forms[1]) / overlap)

    def thrice() -> complex:
        u, w = vector[1], conjugate[1]
        forms = [
            xxx + xxy * (2.0 * u + w) + xyy * (u * u + 2.0 * u * w) + yyy * u * u * w
            for xxx, xxy, xyy, yyy in (p_more[3:], q_more[3:])
        ]
        return complex((left[0] * forms[0] + left[1] * forms[1]) / overlap)

    g20, g11, g02 = twice(vector, vector), twice(vector, conjugate), twice(conjugate, conjugate)
    quadratic = g20 * g11 - 2.0 * abs(g11) ** 2 - abs(g02) ** 2 / 3.0
    resonant = 0.5j / frequency * quadratic + 0.5 * thrice()
    return float(resonant.real) / 4.0


def _criticality(lyapunov: float) -> Criticality:
    if lyapunov == 0.0:
        return Criticality.DEGENERATE
    return Criticality.SUPERCRITICAL if lyapunov < 0.0 else Criticality.SUBCRITICAL


def _values(jet: PlanarJet, at: Point) -> FloatArray:
    return np.array([jet.derivative(row, order, at) for row, order in _ORDERS])


def _gradient(values: FloatArray) -> FloatArray:
    """Return the derivative of the first Lyapunov coefficient by the 18 derivatives, by central differences."""
    result = np.zeros(values.size)
    groups = values.reshape(2, 9)
    sizes = [float(np.abs(groups[:, part]).max()) or 1.0 for part in (slice(0, 2), slice(2, 5), slice(5, 9))]
    steps = np.tile(np.repeat([_STEP * sizes[0], sizes[1], sizes[2]], [2, 3, 4]), 2)
    for k, step in enumerate(steps.tolist()):
        ends = [values.copy(), values.copy()]
        ends[0][k] -= step
        ends[1][k] += step
        low, high = (first_lyapunov(end) for end in ends)
        result[k] = (high - low) / (2.0 * step)
    return result


def _rates_of_values(jet: PlanarJet, at: Point, moved: FloatArray) -> FloatArray:
    """Return the derivative by θ of the 18 derivatives at the point, which moves with θ, shape (18, p)."""
    rows = []
    for row, (i, j, _) in _ORDERS:
        curve = (jet.system.first, jet.system.second)[row]
        for name in (jet.system.variables[0],) * i + (jet.system.variables[1],) * j:
            curve = curve.derivative(name)
        along = [jet.derivative(row, order, at) for order in ((i + 1, j, 0), (i, j + 1, 0), (i, j, 1))]
        rows.append(curve.gradient(*at) + np.array(along) @ moved)
    return np.array(rows)


def _determinant_rate(values: FloatArray, turned: FloatArray) -> FloatArray:
    p, q, r, s = values[[0, 1, 9, 10]].tolist()
    rate: FloatArray = s * turned[0] + p * turned[10] - r * turned[1] - q * turned[9]
    return rate


def _rounding(jet: PlanarJet, at: Point, by_values: FloatArray, error: FloatArray) -> float:
    """Bound what rounding, of the derivatives and of the place, does to the first Lyapunov coefficient."""
    total = 0.0
    for (row, order), weight in zip(_ORDERS, by_values.tolist(), strict=True):
        i, j, k = order
        along = [jet.derivative(row, higher, at) for higher in ((i + 1, j, k), (i, j + 1, k), (i, j, k + 1))]
        total += abs(weight) * (jet.noise(row, order, at) + float(np.abs(along) @ error))
    return total


def _crossing_speed(jet: PlanarJet, at: Point) -> float:
    (p, q, by_p), (r, s, by_q), _ = jet.first(at)
    determinant = p * s - q * r
    along = (-(s * by_p - q * by_q) / determinant, -(p * by_q - r * by_p) / determinant, 1.0)
    return 0.5 * dot(jet.trace_gradient(at), along)


def _shift(jet: PlanarJet, at: Point) -> FloatArray:
    """Return the derivative by θ of states and parameter of a trace zero, shape (3, p); nan where it has none."""
    system = jet.system
    matrix, _ = equations(jet, trace_of(jet), at)
    one, two, _ = system.variables
    trace = system.first.derivative(one).gradient(*at) + system.second.derivative(two).gradient(*at)
    return solved(matrix, np.stack([system.first.gradient(*at), system.second.gradient(*at), trace]))

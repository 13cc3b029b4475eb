"""Periodic orbits as boundary value problems, solved by collocation at Gauss points (de Boor & Swartz 1973).

An orbit is a continuous periodic piecewise polynomial of degree four on a mesh that follows its speed. Unlike shooting
this does not mind how unstable the orbit is.
"""

from __future__ import annotations

from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray
from finback.dynamics.continuation.field import ScaledField

DEGREE: Final = 4
_NODES: Final = np.arange(DEGREE + 1) / DEGREE
_SLOWEST: Final = 1e-3  # of the fastest component's rate: rows of slower ones are not blown up
_ROUNDS: Final = 4  # a frame converges by the ratio of two multipliers in each
_RETURNED: Final = 1e-9  # what is smaller in the frame's turn is rounding, which large multipliers would blow up
_FLATTEST: Final = 0.2  # of the mean monitor: where little happens the mesh is not thinned out further


def _gauss() -> tuple[FloatArray, FloatArray]:
    points, weights = np.polynomial.legendre.leggauss(DEGREE)
    return 0.5 * (points + 1.0), 0.5 * weights


_POINTS, _WEIGHTS = _gauss()
_INVERSE: Final[FloatArray] = np.asarray(np.linalg.inv(np.vander(_NODES, increasing=True)), dtype=np.float64)


def basis(place: FloatArray) -> FloatArray:
    """Return the values of the Lagrange polynomials of an interval's nodes at places in [0, 1], shape (n, 5)."""
    values: FloatArray = np.vander(place, DEGREE + 1, increasing=True) @ _INVERSE
    return values


def slopes(place: FloatArray) -> FloatArray:
    """Return their derivatives by the place, shape (n, 5)."""
    powers = np.vander(place, DEGREE + 1, increasing=True)
    derivatives = np.zeros_like(powers)
    derivatives[:, 1:] = powers[:, :-1] * np.arange(1, DEGREE + 1)
    values: FloatArray = derivatives @ _INVERSE
    return values


_AT_POINTS: Final = basis(_POINTS)
_SLOPE_AT_POINTS: Final = slopes(_POINTS)


def _at_one(states: FloatArray, parameter: float) -> FloatArray:
    """Return states, shape (n, d), with the parameter behind each."""
    return np.column_stack((states, np.full(len(states), parameter)))


@final
class CycleEquations:
    """Collocation, phase: as many equations as unknowns less one.

    The unknowns u are the scaled states at the N nodes of one period over the root of N, the period over that of the
    reference, the scaled parameter.

    Args:
        scaled: the field.
        mesh: ends of the intervals in [0, 1], shape (k + 1,).
        nodes: states of a reference orbit at the N = 4 k nodes, scaled, shape (N, d): it fixes the phase.
        period: its period.
    """

    def __init__(self, scaled: ScaledField, mesh: FloatArray, nodes: FloatArray, period: float) -> None:
        self.scaled = scaled
        self.mesh = mesh
        self.period = period
        self.widths = np.diff(mesh)
        self.count, self.states = nodes.shape
        self._rates = scaled.rate_scale / scaled.scale[: self.states]
        intervals = len(self.widths)
        self._index = (np.arange(intervals)[:, np.newaxis] * DEGREE + np.arange(DEGREE + 1)) % self.count
        self._reference = self.at_points(nodes)
        self._phase = np.einsum("cj,ijd->icd", _SLOPE_AT_POINTS, nodes[self._index])
        self._phase *= _WEIGHTS[:, np.newaxis] / max(float(np.abs(self._phase).max()), 1e-300)
        speed = np.abs(self._phase_speed(nodes)).reshape(-1, self.states).max(axis=0) / period
        fastest = float(speed.max()) or 1.0
        self._row_scale = np.maximum(speed, _SLOWEST * fastest)

    def _phase_speed(self, nodes: FloatArray) -> FloatArray:
        slope: FloatArray = np.einsum("cj,ijd->icd", _SLOPE_AT_POINTS, nodes[self._index])
        return slope / self.widths[:, np.newaxis, np.newaxis]

    def at_points(self, nodes: FloatArray) -> FloatArray:
        """Return the states at the Gauss points, shape (k, 4, d)."""
        values: FloatArray = np.einsum("cj,ijd->icd", _AT_POINTS, nodes[self._index])
        return values

    def unknowns(self, nodes: FloatArray, period: float, parameter: float) -> FloatArray:
        """Return states (scaled), period and scaled parameter as unknowns."""
        return np.concatenate((nodes.ravel() / np.sqrt(self.count), [period / self.period, parameter]))

    def orbit(self, u: FloatArray) -> tuple[FloatArray, float, float]:
        """Return the scaled states at the nodes, the period and the scaled parameter."""
        nodes = u[:-2].reshape(self.count, self.states) * np.sqrt(self.count)
        return nodes, float(u[-2] * self.period), float(u[-1])

    def __call__(self, u: FloatArray) -> FloatArray:
        """Return the residuals in units of the orbit's own largest rates, the phase last."""
        nodes, period, parameter = self.orbit(u)
        points = self.at_points(nodes)
        rates = self.scaled.along(_at_one(points.reshape(-1, self.states), parameter)) * self._rates
        slope = self._phase_speed(nodes) / self.period
        rest = (slope - rates.reshape(points.shape) * (period / self.period)) / self._row_scale
        phase = float((self._phase * (points - self._reference)).sum())
        return np.append(rest.ravel(), phase)

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Return the derivatives of the residuals, shape (N d + 1, N d + 2)."""
        nodes, period, parameter = self.orbit(u)
        d, n = self.states, self.count
        points = self.at_points(nodes)
        flat = _at_one(points.reshape(-1, d), parameter)
        matrices = self.scaled.jacobians(flat) * self._rates[:, np.newaxis]
        rates = self.scaled.along(flat) * self._rates
        stretch = period / self.period
        blocks = -stretch * np.einsum("cj,icde->icdje", _AT_POINTS, matrices[:, :, :d].reshape(-1, DEGREE, d, d))
        slope = _SLOPE_AT_POINTS[np.newaxis] / (self.widths[:, np.newaxis, np.newaxis] * self.period)
        states = np.arange(d)
        blocks[:, :, states, :, states] += slope
        blocks /= self._row_scale[:, np.newaxis, np.newaxis]
        matrix = np.zeros((n * d + 1, n * d + 2))
        rows = np.arange(n * d).reshape(-1, DEGREE, d)
        columns = self._index[:, :, np.newaxis] * d + states
        root = np.sqrt(n)
        for interval in range(len(self.widths)):
            block = blocks[interval].reshape(DEGREE * d, (DEGREE + 1) * d)
            matrix[np.ix_(rows[interval].ravel(), columns[interval].ravel())] = block * root
        matrix[:-1, -2] = (-rates / self._row_scale).ravel()
        matrix[:-1, -1] = (-stretch * matrices[:, :, d] / self._row_scale).ravel()
        phase = np.zeros((n, d))
        np.add.at(phase, self._index, np.einsum("icd,cj->ijd", self._phase, _AT_POINTS))
        matrix[-1, :-2] = phase.ravel() * root
        return matrix

    def multipliers(self, jacobian: FloatArray) -> NDArray[np.complex128]:
        """Return the Floquet multipliers, shape (d,), from the Jacobian's own blocks.

        The product of the transfer matrices of the intervals would lose the small multipliers beside the large ones,
        so an orthonormal frame is carried round until it comes back to itself, and the triangular factors multiplied.
        """
        d = self.states
        transfers = []
        for interval in range(len(self.widths)):
            rows = slice(interval * DEGREE * d, (interval + 1) * DEGREE * d)
            columns = (self._index[interval][:, np.newaxis] * d + np.arange(d)).ravel()
            block = jacobian[rows][:, columns]
            transfers.append(-np.linalg.solve(block[:, d:], block[:, :d])[-d:])
        frame = np.eye(d)
        product, returned = np.eye(d), np.eye(d)
        for _ in range(_ROUNDS):
            start, product = frame, np.eye(d)
            for transfer in transfers:
                frame, triangle = np.linalg.qr(transfer @ frame)
                product = triangle @ product
            returned = start.T @ frame
        returned = np.where(np.abs(returned) < _RETURNED, 0.0, returned)
        return np.linalg.eigvals(returned @ product).astype(np.complex128)

    def defect(self, u: FloatArray) -> float:
        """Return how much the differential equation fails at the mesh points, in units of the orbit's rates."""
        nodes, period, parameter = self.orbit(u)
        starts = nodes[self._index[:, 0]]
        rates = self.scaled.along(_at_one(starts, parameter)) * self._rates
        slope = np.einsum("j,ijd->id", slopes(np.zeros(1))[0], nodes[self._index])
        slope /= self.widths[:, np.newaxis] * period
        return float((np.abs(slope - rates) / self._row_scale).max())

    def states_at(self, nodes: FloatArray, time: FloatArray) -> FloatArray:
        """Return the scaled states at times in periods, shape (n, d)."""
        time = time % 1.0
        interval = np.clip(np.searchsorted(self.mesh, time, side="right") - 1, 0, len(self.widths) - 1)
        place = (time - self.mesh[interval]) / self.widths[interval]
        values: FloatArray = np.einsum("nj,njd->nd", basis(place), nodes[self._index[interval]])
        return values

    def node_times(self) -> FloatArray:
        """Return the times of the nodes in periods, shape (N,)."""
        times: FloatArray = (self.mesh[:-1, np.newaxis] + self.widths[:, np.newaxis] * _NODES[:-1]).ravel()
        return times

    def finer_mesh(self, nodes: FloatArray) -> FloatArray:
        """Return the mesh on which the estimated error is spread evenly (de Boor 1973)."""
        pieces = nodes[self._index]
        top = np.einsum("j,ijd->id", _INVERSE[-1], pieces) / self.widths[:, np.newaxis] ** DEGREE
        gaps = 0.5 * (self.widths + np.roll(self.widths, 1))
        jumps = np.linalg.norm(top - np.roll(top, 1, axis=0), axis=1) / gaps
        monitor = (0.5 * (jumps + np.roll(jumps, -1))) ** (1.0 / (DEGREE + 1))
        monitor = np.maximum(monitor, _FLATTEST * float(monitor @ self.widths))
        if not monitor.any():
            return self.mesh
        total = np.concatenate(([0.0], np.cumsum(monitor * self.widths)))
        mesh = np.interp(np.linspace(0.0, total[-1], len(self.mesh)), total, self.mesh)
        mesh[0], mesh[-1] = 0.0, 1.0
        return mesh

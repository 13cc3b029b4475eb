"""Equilibria of a planar polynomial field at a held parameter: all of them, of what kind, how well known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind, eigenvalues, kind_of
from finback.dynamics.planar.root import PlanarRoot, planar_roots
from finback.dynamics.planar.system import PlanarFlow, PlanarScale, PlanarSystem
from finback.dynamics.planar.taylor import expansion


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarEquilibrium:
    """One equilibrium. Names and units of states and parameter are in ``system.variables``; time is in s.

    Attributes:
        parameter: held.
        state: where, shape (2,).
        eigenvalues_real: real parts, shape (2,), the larger first.
        eigenvalues_imag: imaginary parts, shape (2,), the positive first.
        kind: by the eigenvalues; degenerate where two equilibria cannot be told apart, too.
        state_interval: 95 % intervals of both states by the delta method, shape (2, 2), row i for state i; infinite
            at a degenerate equilibrium, which moves as a square root.
        residual: both rates as evaluated, shape (2,).
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    kind: Kind
    state_interval: FloatArray
    residual: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "eigenvalues_real", "eigenvalues_imag", "state_interval", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def planar_equilibria(system: PlanarSystem, parameter: float) -> tuple[PlanarEquilibrium, ...]:
    """Return all equilibria at a held parameter (up to 1e9 in each state), ordered by first, then second state.

    Raises:
        RefusedError: equilibria are not isolated: the rates have a common factor.
    """
    flow = system.at(parameter)
    return tuple(_equilibrium(system, parameter, flow, root) for root in planar_roots(flow))


def natural_planar_scale(system: PlanarSystem, parameter: float) -> PlanarScale:
    """Return units in which the outer equilibria lie 2 apart in each state, and the fastest eigenvalue is about 1.

    A unit that two equilibria do not give (there is one only, or both states agree) stays 1.
    """
    points = planar_equilibria(system, parameter)
    if not points:
        return PlanarScale()
    states = np.array([point.state for point in points])
    spans = 0.5 * (states.max(axis=0) - states.min(axis=0))
    fastest = max(float(np.hypot(p.eigenvalues_real, p.eigenvalues_imag).max()) for p in points)
    return PlanarScale(
        first=float(spans[0]) or 1.0, second=float(spans[1]) or 1.0, time=1.0 / fastest if fastest > 0.0 else 1.0
    )


def _equilibrium(system: PlanarSystem, parameter: float, flow: PlanarFlow, root: PlanarRoot) -> PlanarEquilibrium:
    state = np.array([root.x, root.y])
    here = expansion(flow, root.x, root.y)
    jacobian = here.jacobian
    (p, q), (r, s) = jacobian.tolist()
    (dp, dq), (dr, ds) = here.bend(np.array(root.radius)).tolist()
    trace, determinant = p + s, p * s - q * r
    slack = abs(p) * ds + abs(s) * dp + abs(q) * dr + abs(r) * dq + dp * ds + dq * dr
    known = root.resolved and abs(determinant) > slack
    real, imaginary = eigenvalues(trace, determinant)
    return PlanarEquilibrium(
        parameter=parameter,
        state=state,
        eigenvalues_real=frozen_array(real),
        eigenvalues_imag=frozen_array(imaginary),
        kind=kind_of(trace if abs(trace) > dp + ds else 0.0, determinant if known else 0.0),
        state_interval=state_intervals(system, state, parameter, jacobian, known=known),
        residual=here.value,
        in_domain=system.contains(state, parameter),
    )


def state_intervals(
    system: PlanarSystem, state: FloatArray, parameter: float, jacobian: FloatArray, *, known: bool
) -> FloatArray:
    """Return the 95 % intervals of both states of an equilibrium, shape (2, 2); infinite unless it is simple."""
    if not known:
        return frozen_array([[-np.inf, np.inf]] * 2)
    values = (float(state[0]), float(state[1]), parameter)
    rates = np.stack([system.first.gradient(*values), system.second.gradient(*values)])
    moved = -np.linalg.solve(jacobian, rates)
    return frozen_array([system.interval(float(v), row) for v, row in zip(state, moved, strict=True)])

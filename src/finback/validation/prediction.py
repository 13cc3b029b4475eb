"""What an analysis predicts of equilibria and folds, in one layout for models of either form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.equilibrium import Equilibrium, Kind, equilibria as lienard_equilibria
from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.planar.equilibrium import PlanarEquilibrium, planar_equilibria
from finback.dynamics.planar.system import PlanarSystem

_EVERYWHERE: Final = (-np.inf, np.inf)
_EDGE: Final = 0.01
"""Of the range of elevators: a fold nearer to its ends may be just beyond them in the field's own analysis."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PredictedFold:
    """A fold of the model.

    Attributes:
        elevator_rad: where.
        alpha_rad: of the two equilibria that meet.
        q_rad_s: their pitch rate.
        elevator_interval_rad: 95 % interval, shape (2,).
        alpha_interval_rad: the same for alpha, shape (2,).
        in_domain: whether it lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    elevator_interval_rad: FloatArray
    alpha_interval_rad: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "alpha_interval_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PredictedEquilibrium:
    """An equilibrium of the model, and the linear motion about it.

    Attributes:
        elevator_rad: held.
        alpha_rad: where.
        q_rad_s: pitch rate there.
        trace_1_s: of the Jacobian; it does not depend on the coordinates.
        determinant_1_s2: likewise.
        kind: by the eigenvalues.
        alpha_interval_rad: 95 % interval, shape (2,).
        covariance: of q, trace and determinant by the delta method, shape (3, 3); not finite where two equilibria
            cannot be told apart.
        in_domain: whether it lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    trace_1_s: float
    determinant_1_s2: float
    kind: Kind
    alpha_interval_rad: FloatArray
    covariance: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_interval_rad", "covariance"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    def half_width(self, *, q: float = 0.0, trace: float = 0.0, determinant: float = 0.0) -> float:
        """Return half of the 95 % interval of a number that has these derivatives by q, trace and determinant."""
        weights = np.array([q, trace, determinant])
        with np.errstate(over="ignore", invalid="ignore"):
            variance = float(weights @ self.covariance @ weights)
        return float(NORMAL_95 * np.sqrt(max(0.0, variance))) if np.isfinite(variance) else float(np.inf)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What an analysis says of equilibria and folds.

    A Liénard system is a matter of alpha alone: the elevator enters it linearly, and the pitch rate follows. A planar
    field is extrapolated beyond its data in alpha, in q, and in an elevator that enters otherwise than linearly and
    alone; its folds are known within the range of elevators only.

    Attributes:
        system: what was analyzed.
        folds: in the order of the analysis.
        domain: low and high of alpha, q and elevator where data supported the model, shape (3, 2).
        alpha_range_rad: in which folds were looked for.
        elevator_range_rad: likewise, without 1 % at either end; infinite where they were found at every elevator.
    """

    system: LienardSystem | PlanarSystem
    folds: tuple[PredictedFold, ...]
    domain: FloatArray
    alpha_range_rad: tuple[float, float]
    elevator_range_rad: tuple[float, float]

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "domain", frozen_array(self.domain))

    @property
    def fold_box(self) -> FloatArray:
        """Low and high of alpha, q and elevator between which a fold is predicted from data, shape (3, 2)."""
        ranges = np.array([self.alpha_range_rad, _EVERYWHERE, self.elevator_range_rad])
        return np.stack(
            [np.maximum(self.domain[:, 0], ranges[:, 0]), np.minimum(self.domain[:, 1], ranges[:, 1])], axis=1
        )

    def equilibria(self, elevator_rad: float) -> tuple[PredictedEquilibrium, ...]:
        """Return all equilibria at a held elevator, by rising alpha.

        Raises:
            RefusedError: they are not isolated.
        """
        if isinstance(self.system, PlanarSystem):
            field = self.system
            return tuple(_planar(field, point) for point in planar_equilibria(field, elevator_rad))
        lienard = self.system
        return tuple(_lienard(lienard, point) for point in lienard_equilibria(lienard, elevator_rad))

    def depth(self, alpha_rad: float, q_rad_s: float, elevator_rad: float) -> float:
        """Return how far a state lies inside the fitted domain, in rad of alpha; < 0 outside, also in q or elevator."""
        low, high = self.domain.T
        if not all(low[k] <= value <= high[k] for k, value in ((1, q_rad_s), (2, elevator_rad))):
            return float(-np.inf)
        return float(min(alpha_rad - low[0], high[0] - alpha_rad))


def prediction(analysis: AnyAnalysis) -> Prediction:
    """Return what an analysis of a model in (alpha, q, elevator) predicts."""
    if isinstance(analysis, PlanarAnalysis):
        low, high = analysis.options.parameter_range
        edge = _EDGE * (high - low)
        return Prediction(
            system=analysis.system,
            folds=tuple(_planar_folds(analysis)),
            domain=analysis.system.supported,
            alpha_range_rad=analysis.options.first_range,
            elevator_range_rad=(low + edge, high - edge),
        )
    return Prediction(
        system=analysis.system,
        folds=tuple(
            PredictedFold(
                elevator_rad=fold.elevator_rad,
                alpha_rad=fold.alpha_rad,
                q_rad_s=fold.q_rad_s,
                elevator_interval_rad=fold.elevator_interval_rad,
                alpha_interval_rad=fold.alpha_interval_rad,
                in_domain=fold.in_domain,
            )
            for fold in analysis.folds
        ),
        domain=frozen_array([analysis.system.domain[0], _EVERYWHERE, _EVERYWHERE]),
        alpha_range_rad=analysis.options.alpha_range_rad,
        elevator_range_rad=_EVERYWHERE,
    )


def _planar_folds(analysis: PlanarAnalysis) -> Iterator[PredictedFold]:
    for fold in analysis.found.folds:
        alpha, q = fold.state.tolist()
        yield PredictedFold(
            elevator_rad=fold.parameter,
            alpha_rad=alpha,
            q_rad_s=q,
            elevator_interval_rad=fold.parameter_interval,
            alpha_interval_rad=fold.state_interval[0],
            in_domain=fold.in_domain,
        )


def _lienard(system: LienardSystem, point: Equilibrium) -> PredictedEquilibrium:
    alpha, elevator = point.alpha_rad, point.elevator_rad
    slope = system.force.derivative("alpha_rad")
    force = system.force.gradient(alpha) + system.elevator_gain_sensitivity * elevator
    shift = system.root_shift(force, float(slope(alpha)))

    def moved(gradient: FloatArray, along: float) -> FloatArray:
        """Return the derivative by θ of a curve's value at the equilibrium, which moves along the curve."""
        return gradient + along * shift

    rate = system.pitch_rate
    gradients = [
        moved(rate.gradient(alpha, elevator), float(rate.derivative("alpha_rad")(alpha, elevator))),
        moved(system.damping.gradient(alpha), float(system.damping.derivative("alpha_rad")(alpha))),
        moved(-slope.gradient(alpha), -float(slope.derivative("alpha_rad")(alpha))),
    ]
    return PredictedEquilibrium(
        elevator_rad=elevator,
        alpha_rad=alpha,
        q_rad_s=point.q_rad_s,
        trace_1_s=float(system.damping(alpha)),
        determinant_1_s2=-float(slope(alpha)),
        kind=point.kind,
        alpha_interval_rad=point.alpha_interval_rad,
        covariance=_carried(np.array(gradients), system.covariance),
        in_domain=point.in_domain,
    )


def _planar(system: PlanarSystem, point: PlanarEquilibrium) -> PredictedEquilibrium:
    alpha, q = point.state.tolist()
    place = (alpha, q, point.parameter)
    names = system.variables[:2]
    jacobian = system.jacobian(point.state, point.parameter)
    rates = np.stack([system.first.gradient(*place), system.second.gradient(*place)])
    known = bool(np.isfinite(point.state_interval).all())
    moved = -np.linalg.solve(jacobian, rates) if known else np.full(rates.shape, np.nan)

    def entry(row: int, column: int) -> FloatArray:
        """Return the derivative by θ of an entry of the Jacobian at the equilibrium, which moves."""
        curve = (system.first, system.second)[row].derivative(names[column])
        bends = [float(curve.derivative(name)(*place)) for name in names]
        gradient: FloatArray = curve.gradient(*place) + bends[0] * moved[0] + bends[1] * moved[1]
        return gradient

    (a, b), (c, d) = jacobian.tolist()
    gradients = [
        moved[1],
        entry(0, 0) + entry(1, 1),
        d * entry(0, 0) + a * entry(1, 1) - c * entry(0, 1) - b * entry(1, 0),
    ]
    return PredictedEquilibrium(
        elevator_rad=point.parameter,
        alpha_rad=alpha,
        q_rad_s=q,
        trace_1_s=a + d,
        determinant_1_s2=a * d - b * c,
        kind=point.kind,
        alpha_interval_rad=point.state_interval[0],
        covariance=_carried(np.array(gradients), system.covariance),
        in_domain=point.in_domain,
    )


def _carried(gradients: FloatArray, covariance: FloatArray) -> FloatArray:
    with np.errstate(over="ignore", invalid="ignore"):
        return frozen_array(gradients @ covariance @ gradients.T)

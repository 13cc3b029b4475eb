"""Any planar polynomial field with one parameter: models that the Liénard form cannot hold, and everything else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import NORMAL_95, Curve, LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, RefusedError
from finback.units import si_unit, unit_of

_LIENARD_VARIABLES: Final = ("alpha_rad", "alpha_dot_rad_s", "elevator_rad")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarScale:
    """Units in which the numbers of a planar field are near 1.

    Attributes:
        first: unit of the first state, in its SI unit; > 0.
        second: unit of the second state, in its SI unit; > 0.
        time: unit of time, in s (in the field's own unit of time where its states carry the unit ``1``); > 0.
    """

    first: float = 1.0
    second: float = 1.0
    time: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is no unit."""
        if not all(0.0 < unit < np.inf for unit in (self.first, self.second, self.time)):
            raise InputError(f"a scale needs positive units, got {self.first}, {self.second}, {self.time}")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarFlow:
    """x' = Σ first[i, j] xⁱ yʲ, y' = Σ second[i, j] xⁱ yʲ: numbers without a unit, the parameter held.

    Attributes:
        first: coefficients of x', shape (m, n), row i for xⁱ, column j for yʲ; both tables have the same shape.
        second: coefficients of y', shape (m, n).
        first_sizes: what each coefficient of ``first`` was summed from in absolute value, for bounds on rounding.
        second_sizes: the same for ``second``.
        scale: s₁ = scale.first · x, s₂ = scale.second · y, t = scale.time · (time of this flow).
    """

    first: FloatArray
    second: FloatArray
    first_sizes: FloatArray
    second_sizes: FloatArray
    scale: PlanarScale

    def __post_init__(self) -> None:
        """Freeze the arrays and check their shapes."""
        for name in ("first", "second", "first_sizes", "second_sizes"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        shapes = {table.shape for table in (self.first, self.second, self.first_sizes, self.second_sizes)}
        if len(shapes) != 1 or self.first.ndim != 2 or not self.first.size:
            raise InputError(f"a planar flow needs four tables of one shape (m, n), got {sorted(shapes)}")

    def velocity(self, x: float, y: float) -> tuple[float, float]:
        """Return (x', y')."""
        columns = y ** np.arange(self.first.shape[1])
        rows = x ** np.arange(self.first.shape[0])
        return float(rows @ self.first @ columns), float(rows @ self.second @ columns)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarSystem:
    """s₁' = P(s₁, s₂, μ), s₂' = Q(s₁, s₂, μ): two states, one parameter, polynomials of any degree, in SI.

    Attributes:
        first: P over exactly three variables: first state, second state, parameter.
        second: Q over the same variables.
        covariance: of θ, on which the coefficients depend, shape (p, p); zero for a system exact by definition.
    """

    first: Curve
    second: Curve
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Freeze the covariance and check that both polynomials know the same variables and the same θ."""
        object.__setattr__(self, "covariance", frozen_array(self.covariance))
        names = self.first.polynomial.variables
        if len(names) != 3 or len(set(names)) != 3 or self.second.polynomial.variables != names:
            raise InputError(
                "a planar system needs two polynomials over the same three variables (two states, one parameter), "
                f"got {names} and {self.second.polynomial.variables}"
            )
        for name in names:
            if si_unit(unit_of(name)) != unit_of(name):
                raise InputError(f"a planar system is in SI, and {name} is not", hint="convert with Polynomial.to_si()")
        widths = {self.first.sensitivity.shape[1], self.second.sensitivity.shape[1]}
        size = self.covariance.shape[0] if self.covariance.ndim else 0
        if self.covariance.shape != (size, size) or widths != {size}:
            raise InputError(
                f"sensitivities by {sorted(widths)} parameters do not fit a covariance of shape {self.covariance.shape}"
            )

    @classmethod
    def from_polynomials(
        cls, first: Polynomial, second: Polynomial, *, covariance: ArrayLike | None = None
    ) -> PlanarSystem:
        """Make a system from its two polynomials, in SI.

        Args:
            first: the rate of the first state, over (first state, second state, parameter).
            second: the rate of the second state, over the same variables.
            covariance: of all coefficients, those of ``first`` first, shape (n, n); without it they are exact.
        """
        split = first.coefficients.size
        size = split + second.coefficients.size
        theta = np.eye(size)
        return cls(
            first=Curve(polynomial=first, sensitivity=theta[:split]),
            second=Curve(polynomial=second, sensitivity=theta[split:]),
            covariance=frozen_array(np.zeros((size, size)) if covariance is None else covariance),
        )

    @classmethod
    def from_model(cls, model: PolynomialModel) -> PlanarSystem:
        """Return a reduced model in (alpha, q) with the elevator as the parameter; every term is kept.

        Raises:
            InputError: the model has further inputs; hold them first (``PolynomialModel.held``).
        """
        return cls.from_polynomials(model.alpha_dot, model.q_dot, covariance=model.covariance)

    @classmethod
    def from_lienard(cls, system: LienardSystem) -> PlanarSystem:
        """Return a Liénard system in (alpha, dα/dt): s₁' = s₂, s₂' = f(s₁) s₂ + g(s₁) + c₁ δ.

        The elevator is held: its rate, which makes dα/dt jump, is not included.
        """
        everywhere = (-np.inf, np.inf)
        domain = frozen_array([system.domain[0], everywhere, system.domain[1]])
        size = system.covariance.shape[0]
        terms: dict[tuple[int, ...], float] = {}
        rows: list[FloatArray] = []
        for curve, state in ((system.damping, 1), (system.force, 0)):
            for (power,), value, row in zip(
                curve.polynomial.powers.tolist(),
                curve.polynomial.coefficients.tolist(),
                curve.sensitivity,
                strict=True,
            ):
                terms[power, state, 0] = value
                rows.append(row)
        terms[0, 0, 1] = system.elevator_gain
        rows.append(system.elevator_gain_sensitivity)
        rate = Polynomial.build({(0, 1, 0): 1.0}, variables=_LIENARD_VARIABLES, value_unit="rad_s", domain=domain)
        acceleration = Polynomial.build(terms, variables=_LIENARD_VARIABLES, value_unit="rad_s2", domain=domain)
        return cls(
            first=Curve(polynomial=rate, sensitivity=np.zeros((1, size))),
            second=Curve(polynomial=acceleration, sensitivity=np.array(rows).reshape(-1, size)),
            covariance=system.covariance,
        )

    @property
    def variables(self) -> tuple[str, str, str]:
        """Names with unit: first state, second state, parameter."""
        one, two, three = self.first.polynomial.variables
        return one, two, three

    @property
    def domain(self) -> FloatArray:
        """Low and high of both states and of the parameter where data supported both polynomials, shape (3, 2)."""
        one, two = self.first.polynomial.domain, self.second.polynomial.domain
        return frozen_array(np.stack([np.maximum(one[:, 0], two[:, 0]), np.minimum(one[:, 1], two[:, 1])], axis=1))

    @property
    def supported(self) -> FloatArray:
        """The domain, without end in a parameter that enters linearly and alone, shape (3, 2).

        Then it is the shape in the states that must not be extrapolated, as in ``LienardSystem.supports``.
        """
        domain = np.array(self.domain)
        powers = np.concatenate([self.first.polynomial.powers, self.second.polynomial.powers])
        moved = powers[powers[:, 2] > 0]
        if moved.size and (moved == (0, 0, 1)).all():
            domain[2] = (-np.inf, np.inf)
        return frozen_array(domain)

    def contains(self, state: ArrayLike, parameter: float) -> bool:
        """Tell whether a point lies where data supported the system."""
        point = np.append(np.asarray(state, dtype=np.float64), parameter)
        domain = self.supported
        return bool(((domain[:, 0] <= point) & (point <= domain[:, 1])).all())

    def velocity(self, state: ArrayLike, parameter: ArrayLike) -> FloatArray:
        """Return (s₁', s₂') for states of shape (..., 2): shape (..., 2)."""
        s = np.asarray(state, dtype=np.float64)
        values = (s[..., 0], s[..., 1], parameter)
        return np.stack([self.first(*values), self.second(*values)], axis=-1)

    def jacobian(self, state: ArrayLike, parameter: ArrayLike) -> FloatArray:
        """Return the derivative of the velocity by the states, shape (..., 2, 2), row i for sᵢ'."""
        s = np.asarray(state, dtype=np.float64)
        values = (s[..., 0], s[..., 1], parameter)
        rows = [
            np.stack([curve.polynomial.derivative(name)(*values) for name in self.variables[:2]], axis=-1)
            for curve in (self.first, self.second)
        ]
        return np.stack(rows, axis=-2)

    def at(self, parameter: float, scale: PlanarScale | None = None) -> PlanarFlow:
        """Return the field at a held parameter, in units of ``scale`` (without one: in SI).

        Raises:
            RefusedError: the coefficients are too large for double precision.
        """
        units = PlanarScale() if scale is None else scale
        polynomials = (self.first.polynomial, self.second.polynomial)
        shape = tuple(1 + max(int(p.powers[:, k].max(initial=0)) for p in polynomials) for k in (0, 1))
        tables = []
        with np.errstate(over="ignore", invalid="ignore"):
            for polynomial, unit in zip(polynomials, (units.first, units.second), strict=True):
                table, sizes = np.zeros(shape), np.zeros(shape)
                i, j, k = polynomial.powers.T
                grown = polynomial.coefficients * float(parameter) ** k
                grown *= units.time / unit * units.first**i * units.second**j
                np.add.at(table, (i, j), grown)
                np.add.at(sizes, (i, j), np.abs(grown))
                tables += [table, sizes]
        if not all(np.isfinite(table).all() for table in tables):
            raise RefusedError("the coefficients of the field are too large for double precision")
        first, first_sizes, second, second_sizes = tables
        return PlanarFlow(first=first, second=second, first_sizes=first_sizes, second_sizes=second_sizes, scale=units)

    def with_coefficients(self, coefficients: FloatArray) -> PlanarSystem:
        """Return the same system with other coefficients, those of ``first`` first; sensitivities are kept."""
        split = self.first.polynomial.coefficients.size
        parts = (coefficients[:split], coefficients[split:])
        first, second = (
            replace(curve, polynomial=replace(curve.polynomial, coefficients=frozen_array(part)))
            for curve, part in zip((self.first, self.second), parts, strict=True)
        )
        return replace(self, first=first, second=second)

    def moved(self, change: FloatArray) -> PlanarSystem:
        """Return the system of other parameters, θ + change (p,); its coefficients are linear in θ."""
        return replace(self, first=self.first.moved(change), second=self.second.moved(change))

    def interval(self, value: float, gradient: FloatArray) -> FloatArray:
        """Return the 95 % interval of a value with this derivative by θ (delta method), shape (2,).

        It is linear in θ. A derivative that is not finite gives an infinite interval.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            variance = float(gradient @ self.covariance @ gradient)
        if not np.isfinite(variance):
            return frozen_array([-np.inf, np.inf])
        half = NORMAL_95 * max(0.0, variance) ** 0.5  # rounding can leave -1e-30 where it should be 0
        return frozen_array([value - half, value + half])

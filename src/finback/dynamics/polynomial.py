"""Polynomials whose variables carry units in their names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.errors import InputError
from finback.units import si_factor, si_unit, unit_of


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Polynomial:
    """A sum of terms c · x₁^p₁ · x₂^p₂ ….

    Attributes:
        variables: names with unit, such as ``("alpha_rad", "q_rad_s", "elevator_rad")``; length v.
        powers: exponents >= 0, shape (n, v), one row a term, no two rows alike.
        coefficients: shape (n,), in ``value_unit`` divided by the units of the term's variables.
        value_unit: unit suffix of the value, such as ``rad_s``.
        domain: low and high of each variable where data supported the coefficients, shape (v, 2);
            infinite where nothing is said.
    """

    variables: tuple[str, ...]
    powers: IntArray
    coefficients: FloatArray
    value_unit: str
    domain: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the arrays."""
        powers = np.array(self.powers, dtype=np.int64).reshape(-1, len(self.variables))
        powers.setflags(write=False)
        object.__setattr__(self, "powers", powers)
        object.__setattr__(self, "coefficients", frozen_array(self.coefficients))
        object.__setattr__(self, "domain", frozen_array(self.domain))
        for name in self.variables:
            unit_of(name)
        si_factor(self.value_unit)
        if self.coefficients.shape != (powers.shape[0],):
            raise InputError(
                f"a polynomial of {powers.shape[0]} terms needs as many coefficients, got {self.coefficients.shape}"
            )
        if (powers < 0).any() or len({tuple(row) for row in powers.tolist()}) != len(powers):
            raise InputError("the terms of a polynomial have exponents >= 0, and no term stands twice")
        if not np.isfinite(self.coefficients).all():
            raise InputError(f"the coefficients of a polynomial must be finite, got {self.coefficients}")
        if self.domain.shape != (len(self.variables), 2):
            raise InputError(f"the domain has shape {self.domain.shape}, expected ({len(self.variables)}, 2)")

    @classmethod
    def build(
        cls,
        terms: Mapping[tuple[int, ...], float],
        *,
        variables: Sequence[str],
        value_unit: str,
        domain: ArrayLike | None = None,
    ) -> Polynomial:
        """Make a polynomial from exponents -> coefficient; without ``domain``, nothing is said about it."""
        everywhere = [(-np.inf, np.inf)] * len(variables)
        return cls(
            variables=tuple(variables),
            powers=np.array(list(terms), dtype=np.int64),
            coefficients=frozen_array(list(terms.values())),
            value_unit=value_unit,
            domain=frozen_array(everywhere if domain is None else domain),
        )

    def __call__(self, *values: ArrayLike) -> FloatArray:
        """Evaluate at one value (or broadcastable array) per variable, in the order of ``variables``."""
        return self.term_values(*values) @ self.coefficients

    def term_values(self, *values: ArrayLike) -> FloatArray:
        """Return every term without its coefficient: shape (..., n)."""
        if len(values) != len(self.variables):
            raise InputError(f"expected one value for each of {', '.join(self.variables)}, got {len(values)}")
        arrays = np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in values))
        result = np.ones((*arrays[0].shape, len(self.coefficients)))
        for column, array in enumerate(arrays):
            for term in range(len(self.coefficients)):
                exponent = int(self.powers[term, column])
                if exponent:
                    result[..., term] *= array**exponent
        return result

    def coefficient(self, **exponents: int) -> float:
        """Return the coefficient of the term with these exponents (variable name -> exponent); 0 if absent."""
        return float(self.coefficients[i]) if (i := self.term(**exponents)) >= 0 else 0.0

    def term(self, **exponents: int) -> int:
        """Return the row of the term with these exponents (variable name -> exponent); -1 if absent."""
        unknown = set(exponents) - set(self.variables)
        if unknown:
            raise InputError(f"no variable {', '.join(sorted(unknown))}; there are {', '.join(self.variables)}")
        row = np.array([exponents.get(name, 0) for name in self.variables])
        found = np.flatnonzero((self.powers == row).all(axis=1))
        return int(found[0]) if found.size else -1

    def labels(self) -> tuple[str, ...]:
        """Return a readable name for each term: ``1``, ``alpha``, ``alpha^2``, ``alpha*q``."""
        symbols = [name.removesuffix(f"_{unit_of(name)}") for name in self.variables]
        return tuple(
            "*".join(
                symbol if power == 1 else f"{symbol}^{power}"
                for symbol, power in zip(symbols, row, strict=True)
                if power
            )
            or "1"
            for row in self.powers.tolist()
        )

    def derivative(self, variable: str) -> Polynomial:
        """Return the partial derivative by ``variable``, over the same domain.

        Terms that vanish are dropped. No name is kept for the unit of the quotient: it is written ``1``.
        """
        if variable not in self.variables:
            raise InputError(f"no variable {variable}; there are {', '.join(self.variables)}")
        column = self.variables.index(variable)
        keep = self.powers[:, column] > 0
        powers = self.powers[keep].copy()
        coefficients = self.coefficients[keep] * powers[:, column]
        powers[:, column] -= 1
        return replace(self, powers=powers, coefficients=frozen_array(coefficients), value_unit="1")

    def substitution(self, values: Mapping[str, float]) -> tuple[Polynomial, FloatArray]:
        """Hold some variables at constant values.

        Terms that become alike are added, and terms that vanish with a value of 0 are dropped. A value outside the
        domain leaves no place where data supported the rest: its domain is then empty, every low end above its high.

        Args:
            values: variable -> value, in the variable's own unit.

        Returns:
            The polynomial in the variables that remain (n terms), and the matrix that makes its coefficients from
            the old ones, shape (n, old terms).

        Raises:
            InputError: no such variable, or a value that is not finite.
        """
        unknown = [name for name in values if name not in self.variables]
        if unknown or not all(np.isfinite(value) for value in values.values()):
            raise InputError(
                f"cannot hold {', '.join(f'{name} = {value}' for name, value in values.items())}",
                hint=f"give finite values to some of {', '.join(self.variables)}",
            )
        kept = [column for column, name in enumerate(self.variables) if name not in values]
        held = {self.variables.index(name): float(value) for name, value in values.items()}
        factors = np.ones(self.coefficients.size)
        for column, value in held.items():
            factors *= value ** self.powers[:, column]
        rows: dict[tuple[int, ...], FloatArray] = {}
        for term, (exponents, factor) in enumerate(zip(self.powers[:, kept].tolist(), factors.tolist(), strict=True)):
            if factor != 0.0:
                rows.setdefault(tuple(exponents), np.zeros(factors.size))[term] = factor
        matrix = np.array(list(rows.values())).reshape(len(rows), factors.size)
        inside = all(low <= held[column] <= high for column, (low, high) in enumerate(self.domain) if column in held)
        rest = Polynomial(
            variables=tuple(self.variables[column] for column in kept),
            powers=np.array(list(rows), dtype=np.int64),
            coefficients=frozen_array(matrix @ self.coefficients),
            value_unit=self.value_unit,
            domain=self.domain[kept] if inside else frozen_array([(np.inf, -np.inf)] * len(kept)),
        )
        return rest, frozen_array(matrix)

    def to_si(self) -> Polynomial:
        """Return the same function with variables and value in SI (``alpha_deg`` -> ``alpha_rad``)."""
        factors = np.array([si_factor(unit_of(name)) for name in self.variables])
        names = tuple(f"{name.removesuffix(f'_{unit_of(name)}')}_{si_unit(unit_of(name))}" for name in self.variables)
        scale = si_factor(self.value_unit) / np.prod(factors[np.newaxis, :] ** self.powers, axis=1)
        return replace(
            self,
            variables=names,
            coefficients=frozen_array(self.coefficients * scale),
            value_unit=si_unit(self.value_unit),
            domain=frozen_array(self.domain * factors[:, np.newaxis]),
        )

    def contains(self, *values: float) -> bool:
        """Tell whether a point (one value per variable) lies in the domain."""
        point = np.asarray(values, dtype=np.float64)
        return bool(((self.domain[:, 0] <= point) & (point <= self.domain[:, 1])).all())

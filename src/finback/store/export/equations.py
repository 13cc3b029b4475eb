"""Two rates as sums of terms, and how a term is written in a language."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.store.model_file import ModelFile
from finback.units import quantity_of


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equations:
    """A planar polynomial model, ready to be written.

    Attributes:
        first: rate of the first variable over all variables, in SI.
        second: rate of the second variable over the same variables.
        covariance: of all coefficients, those of ``first`` first, shape (n, n); zero if exact.
        source: where the model comes from, in a line.
    """

    first: Polynomial
    second: Polynomial
    covariance: FloatArray
    source: str

    def __post_init__(self) -> None:
        """Check that the names can be names in other languages."""
        if "\n" in self.source:
            raise InputError("the source of exported equations is one line")
        for name in self.variables:
            if not name.isidentifier():
                raise InputError(f"'{name}' cannot be a name in an exported file", hint="use letters, digits, _")
        object.__setattr__(self, "covariance", frozen_array(self.covariance))

    @classmethod
    def of_file(cls, file: ModelFile) -> Equations:
        """Take the equations of any model file."""
        source = f"{file.path.name}, SHA-256 {file.sha256}"
        return cls(first=file.first, second=file.second, covariance=file.covariance, source=source)

    @classmethod
    def of_model(cls, model: PolynomialModel, source: str) -> Equations:
        """Take the equations of a model of the longitudinal motion."""
        return cls(first=model.alpha_dot, second=model.q_dot, covariance=model.covariance, source=source)

    @property
    def variables(self) -> tuple[str, ...]:
        """The variables of both rates, with their SI units."""
        return self.first.variables

    @property
    def rates(self) -> tuple[str, str]:
        """Names of the rates, with their SI units: ``alpha_dot_rad_s``."""
        one, two = (
            f"{quantity_of(name)}_dot_{polynomial.value_unit}"
            for name, polynomial in zip(self.variables, (self.first, self.second), strict=False)
        )
        return one, two

    @property
    def standard_errors(self) -> tuple[FloatArray, FloatArray]:
        """One standard error per coefficient of each rate; 0 if exact."""
        deviations = np.sqrt(np.diag(self.covariance))
        split = self.first.coefficients.size
        return deviations[:split], deviations[split:]


def written(polynomial: Polynomial, factor: Callable[[str, int], str]) -> str:
    """Write a polynomial as ``c*x*x + …`` with every digit of its coefficients.

    Args:
        polynomial: what to write.
        factor: (variable, exponent >= 1) -> how its power is written.
    """
    terms = []
    for row, coefficient in zip(polynomial.powers.tolist(), polynomial.coefficients.tolist(), strict=True):
        powers = _powers(polynomial, row, factor)
        terms.append("*".join([repr(coefficient), *powers]))
    return " + ".join(terms).replace("+ -", "- ") or "0.0"


def _powers(polynomial: Polynomial, row: Iterable[int], factor: Callable[[str, int], str]) -> list[str]:
    return [factor(name, power) for name, power in zip(polynomial.variables, row, strict=True) if power]

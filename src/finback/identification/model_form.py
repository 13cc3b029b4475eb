"""The form of a model: which terms stand in dα/dt and dq/dt, and which of their coefficients are known or bounded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.errors import InputError
from finback.identification.explicit import explicit_model
from finback.identification.limits import Limits
from finback.identification.term import ALPHA, ALPHA_DOT, ELEVATOR, Q, Term


@final
class Equation(StrEnum):
    """One of the two equations of a model."""

    ALPHA_DOT = "alpha_dot"
    Q_DOT = "q_dot"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FixedCoefficient:
    """A coefficient that is known.

    Attributes:
        equation: where it stands.
        term: what it multiplies.
        value: in SI.
    """

    equation: Equation
    term: Term
    value: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoundedCoefficient:
    """A coefficient that lies between two known values; either may be infinite.

    Attributes:
        equation: where it stands.
        term: what it multiplies.
        low: lowest value, in SI.
        high: highest value, in SI.
    """

    equation: Equation
    term: Term
    low: float
    high: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ModelForm:
    """dα/dt and dq/dt, each a sum of coefficient times term.

    Coefficients stand in the order of the terms, those of dα/dt first. Terms of dq/dt may hold dα/dt itself, to the
    first power: ``alpha_dot``, or ``q+alpha_dot`` for one shared rate term. The model that comes out is explicit: dα/dt
    is substituted.

    Attributes:
        alpha_dot: terms of dα/dt, no two alike, without ``alpha_dot_rad_s``.
        q_dot: terms of dq/dt, no two alike.
        fixed: coefficients that are known.
        bounded: coefficients that are fitted within bounds.
    """

    alpha_dot: tuple[Term, ...]
    q_dot: tuple[Term, ...]
    fixed: tuple[FixedCoefficient, ...] = ()
    bounded: tuple[BoundedCoefficient, ...] = ()

    def __post_init__(self) -> None:
        """Check the terms, and that what is fixed or bounded is there, once."""
        for name, terms in (("alpha_dot", self.alpha_dot), ("q_dot", self.q_dot)):
            if not terms or len(set(terms)) < len(terms):
                raise InputError(f"the terms of {name} are one or more, no two alike")
        if any(ALPHA_DOT in term.variables for term in self.alpha_dot):
            raise InputError("dα/dt cannot stand among its own terms", hint="use alpha_dot in q_dot only")
        powers = [dict(part.factors).get(ALPHA_DOT, 0) for term in self.q_dot for part in term.monomials]
        if max(powers) > 1:
            raise InputError("dα/dt may stand in dq/dt to the first power only")
        _ = self.limits  # checks them

    @classmethod
    def polynomial(cls, alpha_order: tuple[int, int]) -> ModelForm:
        """Return Eq. (4) and the explicit Eq. (5) of Shi & Fan (2013): 1, q, alpha … alpha^n, elevator in each."""
        one, two = (
            (
                Term.of(),
                Term.of(q_rad_s=1),
                *(Term.of(alpha_rad=k) for k in range(1, order + 1)),
                Term.of(elevator_rad=1),
            )
            for order in alpha_order
        )
        return cls(alpha_dot=one, q_dot=two)

    @classmethod
    def parse(cls, alpha_dot: Sequence[str], q_dot: Sequence[str]) -> ModelForm:
        """Read the terms of both equations, each as ``Term.parse`` does."""
        return cls(alpha_dot=tuple(map(Term.parse, alpha_dot)), q_dot=tuple(map(Term.parse, q_dot)))

    def fix(self, equation: Equation, term: Term, value: float) -> ModelForm:
        """Return the same form with one coefficient known, in SI."""
        return replace(self, fixed=(*self.fixed, FixedCoefficient(equation=equation, term=term, value=value)))

    def bound(self, equation: Equation, term: Term, low: float, high: float) -> ModelForm:
        """Return the same form with one coefficient bounded, in SI."""
        item = BoundedCoefficient(equation=equation, term=term, low=low, high=high)
        return replace(self, bounded=(*self.bounded, item))

    @property
    def terms(self) -> tuple[tuple[Equation, Term], ...]:
        """Every coefficient's equation and term, in order."""
        return (
            *((Equation.ALPHA_DOT, term) for term in self.alpha_dot),
            *((Equation.Q_DOT, term) for term in self.q_dot),
        )

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of coefficients of dα/dt and of dq/dt."""
        return len(self.alpha_dot), len(self.q_dot)

    @property
    def size(self) -> int:
        """Number of all coefficients."""
        return sum(self.sizes)

    @property
    def inputs(self) -> tuple[str, ...]:
        """What moves the aircraft without being moved: the elevator, then the further inputs."""
        further = {name for _, term in self.terms for name in term.variables} - {*VARIABLES, ALPHA_DOT}
        return (ELEVATOR, *sorted(further))

    @property
    def variables(self) -> tuple[str, ...]:
        """Alpha, q and the inputs: the variables of the model that comes out."""
        return (ALPHA, Q, *self.inputs)

    @property
    def implicit(self) -> bool:
        """Whether dα/dt stands in dq/dt."""
        return any(ALPHA_DOT in term.variables for term in self.q_dot)

    @property
    def limits(self) -> Limits:
        """What is known of the coefficients beforehand, by their places."""
        return Limits(
            size=self.size,
            fixed=tuple((self.index(item.equation, item.term), item.value) for item in self.fixed),
            bounded=tuple((self.index(item.equation, item.term), item.low, item.high) for item in self.bounded),
        )

    @property
    def free(self) -> IntArray:
        """Indices of the coefficients that are fitted, bounded ones included."""
        return self.limits.free

    @property
    def known(self) -> FloatArray:
        """The values of fixed coefficients, 0 elsewhere, shape (p,)."""
        return self.limits.known

    @property
    def bounds(self) -> FloatArray:
        """Low and high of every coefficient, infinite where nothing is said, shape (p, 2)."""
        return self.limits.bounds

    def index(self, equation: Equation, term: Term) -> int:
        """Return the place of a coefficient.

        Raises:
            InputError: the equation has no such term.
        """
        try:
            return self.terms.index((equation, term))
        except ValueError:
            have = ", ".join(t.label for e, t in self.terms if e is equation)
            raise InputError(f"{equation} has no term {term.label}", hint=f"it has {have}") from None

    def labels(self) -> tuple[str, ...]:
        """Return a readable name for each coefficient, such as ``alpha^2 in dq/dt``."""
        rates = {Equation.ALPHA_DOT: "dalpha/dt", Equation.Q_DOT: "dq/dt"}
        return tuple(f"{term.label} in {rates[equation]}" for equation, term in self.terms)

    def split(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coefficients of dα/dt and of dq/dt."""
        return coefficients[: self.sizes[0]], coefficients[self.sizes[0] :]

    def term_values(self, equation: Equation, values: Mapping[str, ArrayLike]) -> FloatArray:
        """Return every term of one equation at the values of its variables, in SI, shape (..., terms)."""
        terms = self.alpha_dot if equation is Equation.ALPHA_DOT else self.q_dot
        return np.stack([term(values) for term in terms], axis=-1)

    def model(self, coefficients: FloatArray, covariance: FloatArray, domain: ArrayLike) -> PolynomialModel:
        """Return the explicit model: dα/dt substituted, the covariance carried to first order.

        Args:
            coefficients: of the form, in SI, shape (p,).
            covariance: of these, shape (p, p); zero rows for fixed ones.
            domain: low and high of alpha, q and the inputs where data supported the fit, shape (v, 2).
        """
        return explicit_model(
            self.alpha_dot,
            self.q_dot,
            self.variables,
            coefficients=coefficients,
            covariance=covariance,
            domain=frozen_array(domain),
        )

"""The form of coefficients: which terms stand in CX, CZ and Cm, or in CD, CL and Cm, and which of them are known."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, final

from finback.arrays import FloatArray, IntArray
from finback.channels import CHANNELS
from finback.errors import InputError
from finback.identification.limits import Limits
from finback.identification.term import ALPHA, ELEVATOR, Term

PITCH_RATE: Final = "pitch_rate_1"
"""q c / 2V, a pure number."""
REFERENCE_PITCH_RATE: Final = "reference_pitch_rate_1"
"""q c / 2V₀, with the reference speed V₀."""
SPEED: Final = "speed_ratio_1"
"""V / V₀. At one temperature the Mach number is a constant multiple of it."""
ALPHA_RATE: Final = "alpha_rate_1"
"""dα/dt c / 2V, a pure number; in Cm only, to the first power."""
MOVING: Final = (ALPHA, PITCH_RATE, REFERENCE_PITCH_RATE, SPEED, ALPHA_RATE)
"""The variables that move with the motion, in the order of every table of exponents; the elevator follows."""

_OWN: Final = re.compile(r"\b(reference_pitch_rate|pitch_rate|speed_ratio|alpha_rate)(?!\w)")
_MOTION: Final = frozenset({
    "time_s", "airspeed_m_s", "theta_rad", "q_rad_s", "alpha_dot_rad_s", "q_dot_rad_s2", "ax_m_s2", "az_m_s2"
})  # fmt: skip


@final
class Axes(StrEnum):
    """Which two force coefficients a form has."""

    BODY = "body"
    """CX and CZ: along the body's axes, x forward and z down"""
    WIND = "wind"
    """CD and CL: drag against the motion, lift normal to it"""


_NAMES: Final = {Axes.BODY: ("CX", "CZ", "Cm"), Axes.WIND: ("CD", "CL", "Cm")}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FixedTerm:
    """A coefficient that is known.

    Attributes:
        coefficient: where it stands: ``CX``, ``CZ``, ``CD``, ``CL`` or ``Cm``.
        term: what it multiplies.
        value: in SI.
    """

    coefficient: str
    term: Term
    value: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoundedTerm:
    """A coefficient that lies between two known values; either may be infinite.

    Attributes:
        coefficient: where it stands.
        term: what it multiplies.
        low: lowest value, in SI.
        high: highest value, in SI.
    """

    coefficient: str
    term: Term
    low: float
    high: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientForm:
    """Three coefficients, each a sum of number times term; the numbers stand in the order of the terms.

    Terms are over ``alpha_rad``, ``pitch_rate_1`` (q c / 2V), ``reference_pitch_rate_1`` (q c / 2V₀), ``speed_ratio_1``
    (V / V₀), ``alpha_rate_1`` (dα/dt c / 2V; in Cm only), ``elevator_rad`` and further inputs, which are channels that
    a record holds. ``pitch_rate+alpha_rate`` is one term, where the data know both only together.

    Attributes:
        axes: which force coefficients.
        along: terms of CX, or of CD.
        across: terms of CZ, or of CL.
        pitching: terms of Cm, about the reference point of the airframe.
        fixed: what is known.
        bounded: what is fitted within bounds.
    """

    axes: Axes
    along: tuple[Term, ...]
    across: tuple[Term, ...]
    pitching: tuple[Term, ...]
    fixed: tuple[FixedTerm, ...] = ()
    bounded: tuple[BoundedTerm, ...] = ()

    def __post_init__(self) -> None:
        """Check the terms, and that what is fixed or bounded is there, once."""
        for name, terms in zip(self.names, self.groups, strict=True):
            if not terms or len(set(terms)) < len(terms):
                raise InputError(f"the terms of {name} are one or more, no two alike")
            for term in terms:
                _check(name, term)
        powers = [dict(part.factors).get(ALPHA_RATE, 0) for term in self.pitching for part in term.monomials]
        if max(powers) > 1:
            raise InputError("dα/dt may stand in Cm to the first power only")
        _ = self.limits  # checks them

    @classmethod
    def parse(cls, axes: Axes, along: Sequence[str], across: Sequence[str], pitching: Sequence[str]) -> CoefficientForm:
        """Read the terms: ``1``, ``alpha^2``, ``alpha*pitch_rate``, ``speed_ratio``, ``elevator``."""
        groups = (tuple(parse_term(text) for text in texts) for texts in (along, across, pitching))
        one, two, three = groups
        return cls(axes=axes, along=one, across=two, pitching=three)

    def fix(self, coefficient: str, term: str, value: float) -> CoefficientForm:
        """Return the same form with one number known, in SI."""
        item = FixedTerm(coefficient=coefficient, term=parse_term(term), value=value)
        return replace(self, fixed=(*self.fixed, item))

    def bound(self, coefficient: str, term: str, low: float, high: float) -> CoefficientForm:
        """Return the same form with one number bounded, in SI."""
        item = BoundedTerm(coefficient=coefficient, term=parse_term(term), low=low, high=high)
        return replace(self, bounded=(*self.bounded, item))

    @property
    def names(self) -> tuple[str, str, str]:
        """What the three coefficients are called."""
        return names_in(self.axes)

    @property
    def groups(self) -> tuple[tuple[Term, ...], tuple[Term, ...], tuple[Term, ...]]:
        """The terms of the three coefficients."""
        return self.along, self.across, self.pitching

    @property
    def terms(self) -> tuple[tuple[str, Term], ...]:
        """Coefficient and term of every number, in order."""
        return tuple((name, term) for name, group in zip(self.names, self.groups, strict=True) for term in group)

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return sum(map(len, self.groups))

    @property
    def inputs(self) -> tuple[str, ...]:
        """The elevator, then the further inputs."""
        further = {name for _, term in self.terms for name in term.variables} - {*MOVING, ELEVATOR}
        return (ELEVATOR, *sorted(further))

    @property
    def variables(self) -> tuple[str, ...]:
        """The variables of the three polynomials."""
        return (*MOVING, *self.inputs)

    @property
    def limits(self) -> Limits:
        """What is known of the numbers beforehand, by their places."""
        return Limits(
            size=self.size,
            fixed=tuple((self.index(item.coefficient, item.term), item.value) for item in self.fixed),
            bounded=tuple((self.index(item.coefficient, item.term), item.low, item.high) for item in self.bounded),
        )

    @property
    def free(self) -> IntArray:
        """Indices of the numbers that are fitted, bounded ones included."""
        return self.limits.free

    @property
    def known(self) -> FloatArray:
        """The values of fixed numbers, 0 elsewhere, shape (p,)."""
        return self.limits.known

    @property
    def bounds(self) -> FloatArray:
        """Low and high of every number, infinite where nothing is said, shape (p, 2)."""
        return self.limits.bounds

    def index(self, coefficient: str, term: Term) -> int:
        """Return the place of a number.

        Raises:
            InputError: there is no such coefficient, or it has no such term.
        """
        if coefficient not in self.names:
            raise InputError(
                f"there is no {coefficient} in {self.axes} axes", hint=f"there are {', '.join(self.names)}"
            )
        try:
            return self.terms.index((coefficient, term))
        except ValueError:
            have = ", ".join(t.label for name, t in self.terms if name == coefficient)
            raise InputError(f"{coefficient} has no term {term.label}", hint=f"it has {have}") from None

    def labels(self) -> tuple[str, ...]:
        """Return a readable name for each number, such as ``alpha^2 in CZ``."""
        return tuple(f"{term.label} in {name}" for name, term in self.terms)

    def ends(self) -> tuple[int, int, int]:
        """Return the index after the last number of each coefficient."""
        one, two, three = map(len, self.groups)
        return one, one + two, one + two + three


def names_in(axes: Axes) -> tuple[str, str, str]:
    """Return what the three coefficients are called: ``CX``, ``CZ``, ``Cm``, or ``CD``, ``CL``, ``Cm``."""
    return _NAMES[axes]


def parse_term(text: str) -> Term:
    """Read a term; ``pitch_rate``, ``speed_ratio``, ``alpha_rate`` … may be named without their unit."""
    return Term.parse(_OWN.sub(r"\1_1", text))


def _check(name: str, term: Term) -> None:
    if name != "Cm" and ALPHA_RATE in term.variables:
        raise InputError(f"{name} cannot have the term {term.label}: dα/dt follows from the forces")
    for variable in term.variables:
        if variable in {*MOVING, ELEVATOR}:
            continue
        if variable in _MOTION:
            raise InputError(
                f"{name} cannot have the term {term.label}: {variable} is no variable of coefficients",
                hint="write pitch_rate for q c / 2V, speed_ratio for V / V0",
            )
        if variable not in CHANNELS:
            raise InputError(
                f"{name} cannot have the term {term.label}: no record holds {variable}",
                hint=f"there are {', '.join((*MOVING, ELEVATOR))}, and inputs such as aileron_rad",
            )

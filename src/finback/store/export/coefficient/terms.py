"""What every exported file says of a model in coefficient form: its terms, names, digits and where it holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.digits import NOT_DETERMINED, exponent, supported
from finback.errors import InputError
from finback.identification.coefficient.form import ALPHA_RATE, MOVING, Axes
from finback.identification.coefficient.model import CoefficientModel

AIR: Final = ("density_kg_m3", "thrust_n", "gravity_m_s2")
"""What the motion needs beside states and inputs."""
_PLAIN: Final = range(-4, 6)
"""Powers of ten in which a number is written without one."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientEquations:
    """A model in coefficient form, ready to be written.

    Attributes:
        model: its numbers.
        source: where it comes from, in a line.
    """

    model: CoefficientModel
    source: str

    def __post_init__(self) -> None:
        """Check that the names can be names in other languages, and that the source is one line."""
        if "\n" in self.source:
            raise InputError("the source of exported equations is one line")
        for name in self.model.form.inputs:
            if not (name.isidentifier() and name.isascii()):
                raise InputError(f"'{name}' cannot be a name in an exported file", hint="use letters, digits, _")

    @property
    def inputs(self) -> tuple[str, ...]:
        """The elevator, then further inputs that are not the air or the thrust, which the motion has anyway."""
        return tuple(name for name in self.model.form.inputs if name not in AIR)

    @property
    def air(self) -> tuple[str, ...]:
        """Of the air and the thrust, what the coefficients themselves depend on."""
        return tuple(name for name in AIR if name in self.model.form.inputs)

    @property
    def late(self) -> bool:
        """Whether Cm depends on dα/dt."""
        return any(ALPHA_RATE in term.variables for _, term in self.model.form.terms)

    @property
    def forces(self) -> tuple[str, str]:
        """What the two force coefficients are called."""
        one, two, _ = self.model.form.names
        return one, two

    @property
    def body(self) -> bool:
        """Whether they are CX and CZ."""
        return self.model.form.axes is Axes.BODY

    def monomials(self, name: str) -> dict[tuple[int, ...], float]:
        """Return a coefficient as exponents of ``form.variables`` -> number, sums of monomials written out."""
        form = self.model.form
        found: dict[tuple[int, ...], float] = {}
        for number, (owner, term) in zip(self.model.numbers.tolist(), form.terms, strict=True):
            for part in term.monomials if owner == name else ():
                powers = dict(part.factors)
                key = tuple(powers.get(variable, 0) for variable in form.variables)
                found[key] = found.get(key, 0.0) + number * part.weight
        return found

    def table(self) -> list[str]:
        """Return a line for each number: its coefficient, its digits with their standard error, its term."""
        form, errors = self.model.form, self.model.standard_errors.tolist()
        rows = [
            (name, stated(value, error), term.label)
            for (name, term), value, error in zip(form.terms, self.model.numbers.tolist(), errors, strict=True)
        ]
        width = max(len(number) for _, number, _ in rows)
        return [f"{name}  {number:<{width}}  {label}" for name, number, label in rows]

    def domain(self) -> list[str]:
        """Return a line for each variable: between which values data supported the model."""
        used = {name for _, term in self.model.form.terms for name in term.variables}
        return [
            f"{name}  {low:.4g} to {high:.4g}"
            for name, (low, high) in zip(self.model.form.variables, self.model.domain.tolist(), strict=True)
            if (name in used or name in MOVING[:1]) and np.isfinite([low, high]).all() and low <= high
        ]

    def said(self) -> list[str]:
        """Return what stands at the head of every file: numbers with their standard errors, and where they hold."""
        return [
            "Numbers with one standard error, over angles in rad; pitch_rate is q c / 2V, reference_pitch_rate q c /",
            "2V0, speed_ratio V / V0, alpha_rate dalpha/dt c / 2V:",
            *(f"  {line}" for line in self.table()),
            "Data supported them for:",
            *(f"  {line}" for line in self.domain()),
        ]


def stated(value: float, error: float) -> str:
    """Return a number with its standard error, both to the digits that this supports; all digits of one that is known.

    Written is ``-0.0194 +- 0.0012``, with a power of ten where that is shorter: ``(1.23 +- 0.12)e-07``.
    """
    if not np.isfinite(error):
        return NOT_DETERMINED
    if error == 0.0:
        return f"{value!r} (known)"
    power = exponent(value, error)
    if power in _PLAIN:
        return " +- ".join(supported(value, error))
    number, uncertainty = supported(value, error, power=power)
    return f"({number} +- {uncertainty})e{power:+03d}"

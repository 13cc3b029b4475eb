"""The equations of motion by coefficients as statements that are the same in C and in Python.

Longitudinal, wings level, over a flat Earth (docs/coefficients.md; Klein & Morelli 2006, section 3.5).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.identification.coefficient.form import ALPHA_RATE, MOVING, PITCH_RATE, REFERENCE_PITCH_RATE, SPEED
from finback.store.export.coefficient.terms import CoefficientEquations

STATES: Final = ("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s")
RATES: Final = ("airspeed_dot_m_s2", "alpha_dot_rad_s", "theta_dot_rad_s", "q_dot_rad_s2", "ax_m_s2", "az_m_s2")
"""Rates of the states in their order, and the specific forces along the body's axes."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """``name = text``.

    Attributes:
        name: what is defined.
        text: an expression of what was defined before; products, sums, quotients, sin and cos.
        meaning: of the name; or empty.
    """

    name: str
    text: str
    meaning: str = ""


def constants(equations: CoefficientEquations) -> list[Statement]:
    """Return the airframe in SI."""
    frame = equations.model.airframe
    return [
        Statement(name="mass_kg", text=repr(float(frame.mass_kg))),
        Statement(name="wing_area_m2", text=repr(float(frame.wing_area_m2))),
        Statement(name="chord_m", text=repr(float(frame.chord_m))),
        Statement(name="pitch_inertia_kg_m2", text=repr(float(frame.pitch_inertia_kg_m2))),
        Statement(name="thrust_angle_rad", text=repr(float(frame.thrust_angle_rad)), meaning="above the body x-axis"),
        Statement(name="thrust_arm_m", text=repr(float(frame.thrust_arm_m)), meaning="nose up > 0"),
        Statement(
            name="reference_x_m", text=repr(float(frame.reference_x_m)), meaning="Cm is about a point so far forward"
        ),
        Statement(name="reference_z_m", text=repr(float(frame.reference_z_m)), meaning="and so far below the CG"),
        Statement(name="reference_speed_m_s", text=repr(float(equations.model.reference_speed_m_s)), meaning="V0"),
    ]


def variables(equations: CoefficientEquations) -> list[Statement]:
    """Return those variables of the terms that are neither states nor inputs, but for dα/dt c / 2V."""
    every = (
        Statement(name=PITCH_RATE, text="q_rad_s*chord_m/(2.0*airspeed_m_s)", meaning="q c / 2V"),
        Statement(name=REFERENCE_PITCH_RATE, text="q_rad_s*chord_m/(2.0*reference_speed_m_s)", meaning="q c / 2V0"),
        Statement(name=SPEED, text="airspeed_m_s/reference_speed_m_s", meaning="V / V0"),
    )
    used = {name for _, term in equations.model.form.terms for name in term.variables}
    return [one for one in every if one.name in used]


def late(equations: CoefficientEquations) -> list[Statement]:
    """Return dα/dt c / 2V, if Cm depends on it."""
    text = "alpha_dot_rad_s*chord_m/(2.0*airspeed_m_s)"
    return [Statement(name=ALPHA_RATE, text=text, meaning="dalpha/dt c / 2V")] if equations.late else []


def coefficients(equations: CoefficientEquations, names: Sequence[str]) -> list[Statement]:
    """Return coefficients with every digit."""
    return [Statement(name=name, text=_sum(equations, name)) for name in names]


def motion(equations: CoefficientEquations) -> list[Statement]:
    """Return specific forces and rates of V, α and θ, the force coefficients given."""
    turned = (
        []
        if equations.body
        else [
            Statement(name="CX", text="CL*sin(alpha_rad) - CD*cos(alpha_rad)"),
            Statement(name="CZ", text="-CL*cos(alpha_rad) - CD*sin(alpha_rad)"),
        ]
    )
    return [
        *turned,
        Statement(name="load_n", text="0.5*density_kg_m3*airspeed_m_s*airspeed_m_s*wing_area_m2", meaning="qbar S"),
        Statement(name="ax_m_s2", text="(load_n*CX + thrust_n*cos(thrust_angle_rad))/mass_kg", meaning="forward > 0"),
        Statement(name="az_m_s2", text="(load_n*CZ - thrust_n*sin(thrust_angle_rad))/mass_kg", meaning="down > 0"),
        Statement(
            name="airspeed_dot_m_s2",
            text="ax_m_s2*cos(alpha_rad) + az_m_s2*sin(alpha_rad) - gravity_m_s2*sin(theta_rad - alpha_rad)",
        ),
        Statement(
            name="alpha_dot_rad_s",
            text="q_rad_s + (az_m_s2*cos(alpha_rad) - ax_m_s2*sin(alpha_rad)"
            " + gravity_m_s2*cos(theta_rad - alpha_rad))/airspeed_m_s",
        ),
        Statement(name="theta_dot_rad_s", text="q_rad_s"),
    ]


def turning() -> Statement:
    """Return dq/dt, the three coefficients given."""
    return Statement(
        name="q_dot_rad_s2",
        text="(load_n*(chord_m*Cm + reference_z_m*CX - reference_x_m*CZ) + thrust_n*thrust_arm_m)/pitch_inertia_kg_m2",
    )


def unused(names: Iterable[str], statements: Iterable[Statement]) -> list[str]:
    """Return which names no statement reads."""
    words = {word for one in statements for word in _words(one.text)}
    return [name for name in names if name not in words]


def _words(text: str) -> list[str]:
    return "".join(letter if letter.isalnum() or letter == "_" else " " for letter in text).split()


def _sum(equations: CoefficientEquations, name: str) -> str:
    names = (*MOVING, *equations.model.form.inputs)
    terms = [
        "*".join([repr(number), *(word for word, power in zip(names, row, strict=True) for _ in range(power))])
        for row, number in equations.monomials(name).items()
    ]
    return " + ".join(terms).replace("+ -", "- ")

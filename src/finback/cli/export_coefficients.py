"""What ``finback export`` writes of coefficients, and of the equations that they are at one condition."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Final

from finback.cli.exits import say
from finback.errors import InputError
from finback.files import sha256
from finback.identification.coefficient.form import MOVING, SPEED
from finback.identification.coefficient.model import CoefficientModel
from finback.records import Condition
from finback.store.coefficients import read_coefficients, reduced_text
from finback.store.export.c_source import c_source
from finback.store.export.coefficient.c_source import coefficients_in_c
from finback.store.export.coefficient.jsbsim_aircraft import coefficients_in_jsbsim
from finback.store.export.coefficient.latex import coefficients_in_latex
from finback.store.export.coefficient.symbolic import coefficients_in_sympy
from finback.store.export.coefficient.terms import CoefficientEquations
from finback.store.export.equations import Equations
from finback.store.export.jsbsim_aircraft import Airframe, jsbsim_aircraft
from finback.store.export.latex import latex
from finback.store.export.symbolic import sympy_module

_COEFFICIENTS: Final = {"c": coefficients_in_c, "latex": coefficients_in_latex, "sympy": coefficients_in_sympy}


def equations_as(equations: Equations, to: str) -> str:
    """Return two rates as C, LaTeX or SymPy."""
    match to:
        case "c":
            return c_source(equations)
        case "latex":
            return latex(equations)
        case _:
            return sympy_module(equations)


def coefficients_as(
    file: Path, to: str, *, conditions: tuple[Condition, ...], thrusts: tuple[float, ...], name: str
) -> str:
    """Return coefficients as another program wants them, or what they are at a condition.

    Args:
        file: a ``coefficients.json``.
        to: ``c``, ``latex``, ``sympy``, ``jsbsim`` or ``toml``.
        conditions: where they are reduced to dα/dt and dq/dt; or empty.
        thrusts: thrust in N in place of the flights' mean; or empty.
        name: of the aircraft, or of the model in TOML.
    """
    model = read_coefficients(file).model
    for thrust in thrusts:
        if not math.isfinite(thrust):
            raise InputError("--thrust: a finite number of newtons")
        model = replace(model, airframe=replace(model.airframe, thrust_n=thrust))
    source = f"{file.name}, SHA-256 {sha256(file)}"
    if conditions:
        return _reduced(model, to, condition=conditions[0], source=source, name=name)
    if to == "toml":
        raise InputError(
            f"{file} holds at any airspeed; TOML holds dα/dt and dq/dt at one",
            hint="add --condition V RHO G H, such as 120 0.9 9.8 3000",
        )
    equations = CoefficientEquations(model=model, source=source)
    return coefficients_in_jsbsim(equations, name=name) if to == "jsbsim" else _COEFFICIENTS[to](equations)


def _outside(model: CoefficientModel, condition: Condition) -> str:
    """Return what is to be said of an airspeed that the flights did not have; empty if they did."""
    low, high = model.reference_speed_m_s * model.domain[MOVING.index(SPEED)]
    if low <= condition.airspeed_m_s <= high:
        return ""
    return (
        f"{condition.airspeed_m_s:.6g} m/s lies outside the airspeeds flown, {low:.4g} to {high:.4g} m/s: what is "
        "written is extrapolated"
    )


def _reduced(model: CoefficientModel, to: str, *, condition: Condition, source: str, name: str) -> str:
    found, frame = model.reduced(condition), model.airframe
    if warning := _outside(model, condition):
        say(f"finback: warning: {warning}")
    if to == "toml":
        return reduced_text(found, name=name, condition=condition, thrust_n=frame.thrust_n)
    at = f"{condition.airspeed_m_s:.6g} m/s, {condition.density_kg_m3:.6g} kg/m3, {frame.thrust_n:.6g} N"
    source = f"{source}, reduced at {at}"
    if to == "jsbsim":
        sizes = Airframe(
            mass_kg=frame.mass_kg,
            pitch_inertia_kg_m2=frame.pitch_inertia_kg_m2,
            wing_area_m2=frame.wing_area_m2,
            chord_m=frame.chord_m,
            span_m=frame.wing_area_m2 / frame.chord_m,
        )
        return jsbsim_aircraft(found, name=name, condition=condition, airframe=sizes, source=source)
    return equations_as(Equations.of_model(found, source), to)

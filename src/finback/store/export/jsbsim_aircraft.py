"""A model as an aircraft for JSBSim: its polynomials as aerodynamic functions.

At the condition of the model, with alpha and q free and the speed held (the rig), its equations are the model's:
alpha_dot = q - L/(mV) + g/V and q_dot = M/Iyy. Elsewhere lift and moment scale as coefficients do, with dynamic
pressure and q·c/2V; that is a habit of aerodynamics, nothing that the model knows. It knows no drag, no thrust and no
lateral motion, and this aircraft has none.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, fields
from typing import Final, final

from finback.dynamics.model import INPUT, STATE, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.records import Condition
from finback.store.export.jsbsim_parts import (
    ELEVATOR_POSITION,
    add_elevator,
    add_mass,
    add_metrics,
    aircraft,
    child,
    half_chord,
    written,
)
from finback.units import quantity_of

_PROPERTIES: Final = {
    "alpha_rad": "aero/alpha-rad",
    "q_rad_s": "velocities/q-aero-rad_sec",
    "elevator_rad": ELEVATOR_POSITION,
    "beta_rad": "aero/beta-rad",
    "p_rad_s": "velocities/p-aero-rad_sec",
    "r_rad_s": "velocities/r-aero-rad_sec",
}
"""Variable -> JSBSim's property; any other input is a property ``input/<name>`` that stands at 0 until it is set."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Airframe:
    """What an aircraft needs and a model does not know; on the rig only the model's equations are left of it.

    Attributes:
        mass_kg: mass, > 0.
        pitch_inertia_kg_m2: moment of inertia about the y-axis, > 0; the others are made equal to it.
        wing_area_m2: reference area, > 0.
        chord_m: reference chord, > 0.
        span_m: reference span, > 0.
    """

    mass_kg: float = 10_000.0
    pitch_inertia_kg_m2: float = 100_000.0
    wing_area_m2: float = 30.0
    chord_m: float = 3.0
    span_m: float = 10.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for part in fields(self):
            value = getattr(self, part.name)
            if not 0 < value < math.inf:
                raise InputError(f"{part.name} of an airframe must be positive, got {value}")


def jsbsim_aircraft(model: PolynomialModel, *, name: str, condition: Condition, airframe: Airframe, source: str) -> str:
    """Return the XML of an aircraft, to be written to ``<folder>/<name>/<name>.xml``.

    Args:
        model: the model.
        name: of the aircraft.
        condition: the flight at which the model holds; its gravity is in the model's constant term.
        airframe: mass, inertia and reference lengths.
        source: where the model comes from, in a line.
    """
    root = aircraft(
        name,
        f"Longitudinal polynomial model: {source}. It holds at {condition.airspeed_m_s:.9g} m/s and "
        f"{condition.density_kg_m3:.9g} kg/m3; it has no drag, no thrust and no lateral motion.",
    )
    add_metrics(root, area_m2=airframe.wing_area_m2, span_m=airframe.span_m, chord_m=airframe.chord_m)
    add_mass(root, mass_kg=airframe.mass_kg, pitch_inertia_kg_m2=airframe.pitch_inertia_kg_m2)
    low, high = model.q_dot.domain[model.q_dot.variables.index(INPUT)].tolist()
    add_elevator(root, name, (low, high))
    _aerodynamics(ET.SubElement(root, "aerodynamics"), model, condition, airframe)
    return written(root)


def _aerodynamics(aerodynamics: ET.Element, model: PolynomialModel, condition: Condition, airframe: Airframe) -> None:
    for name in model.inputs:
        if name not in _PROPERTIES:
            child(aerodynamics, "property", _property(name), value="0")
    pressure = 0.5 * condition.density_kg_m3 * condition.airspeed_m_s**2
    force = pressure * airframe.wing_area_m2
    momentum = airframe.mass_kg * condition.airspeed_m_s
    # Lift is what bends the path less than q and gravity would: mass times speed times (q plus g/V less alpha_dot).
    rows = _rows(model.alpha_dot, -momentum / force)
    _add(rows, model, STATE[1], momentum / force)
    _add(rows, model, "", airframe.mass_kg * condition.gravity_m_s2 / force)
    lift = ET.SubElement(
        ET.SubElement(aerodynamics, "axis", {"name": "LIFT"}), "function", {"name": "aero/force/lift-lbs"}
    )
    _sum(lift, rows, model, condition, airframe, chord=False)
    drag = ET.SubElement(
        ET.SubElement(aerodynamics, "axis", {"name": "DRAG"}), "function", {"name": "aero/force/drag-lbs"}
    )
    child(drag, "value", "0")
    rows = _rows(model.q_dot, airframe.pitch_inertia_kg_m2 / (force * airframe.chord_m))
    pitch = ET.SubElement(
        ET.SubElement(aerodynamics, "axis", {"name": "PITCH"}), "function", {"name": "aero/moment/pitch-lbsft"}
    )
    _sum(pitch, rows, model, condition, airframe, chord=True)


Rows = dict[tuple[int, ...], float]


def _rows(polynomial: Polynomial, factor: float) -> Rows:
    terms = zip(polynomial.powers.tolist(), polynomial.coefficients.tolist(), strict=True)
    return {tuple(row): factor * coefficient for row, coefficient in terms}


def _add(rows: Rows, model: PolynomialModel, variable: str, value: float) -> None:
    row = tuple(int(name == variable) for name in model.alpha_dot.variables)
    rows[row] = rows.get(row, 0.0) + value


def _sum(
    function: ET.Element, rows: Rows, model: PolynomialModel, condition: Condition, airframe: Airframe, *, chord: bool
) -> None:
    """Write dynamic pressure · area (· chord) · sum of coefficient · variables, with q as q·c/2V."""
    product = ET.SubElement(function, "product")
    for name in ("aero/qbar-psf", "metrics/Sw-sqft", *(("metrics/cbarw-ft",) if chord else ())):
        child(product, "property", name)
    total = ET.SubElement(product, "sum")
    half_chord_s = airframe.chord_m / (2 * condition.airspeed_m_s)
    q = model.alpha_dot.variables.index(STATE[1])
    for row, coefficient in rows.items():
        term = ET.SubElement(total, "product") if any(row) else total
        child(term, "value", repr(coefficient / half_chord_s ** row[q]))
        for name, power in zip(model.alpha_dot.variables, row, strict=True):
            for _ in range(power):
                child(term, "property", _property(name))
                if name == STATE[1]:
                    half_chord(term)
    # A sum of one part would be no sum to JSBSim.
    child(total, "value", "0")
    child(total, "value", "0")


def _property(name: str) -> str:
    return _PROPERTIES.get(name, f"input/{quantity_of(name).replace('_', '-')}")

"""A model in coefficient form as an aircraft for JSBSim, which flies at any airspeed and in any air.

CX and CZ stand in its axes X and Z, CD and CL in DRAG and LIFT, as functions of alpha, q c / 2V, V / V0, the elevator
and further inputs; Cm in PITCH, about the model's own reference point, which is AERORP. Thrust is a property, constant
until it is set, that acts in the same axes along the airframe's line of thrust: so it is there in every fidelity of the
harness, the rig included, and in JSBSim alone. The model knows no lateral motion, and this aircraft has none.

A form in body axes whose Cm depends on dα/dt stands in LIFT and DRAG, too, turned by alpha: only from a lift does the
harness know the rate of alpha in the frame in which it acts. Without sideslip both are the same.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from typing import Final

from finback.channels import CHANNELS
from finback.identification.coefficient.form import (
    ALPHA_RATE,
    MOVING,
    PITCH_RATE,
    REFERENCE_PITCH_RATE,
    SPEED,
)
from finback.identification.term import ALPHA, ELEVATOR
from finback.store.export.coefficient.terms import CoefficientEquations
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
from finback.units import from_si, quantity_of

THRUST: Final = "model/thrust-lbs"
"""Thrust along its line, in lbs: of the model until something else is written."""

_Q: Final = "velocities/q-aero-rad_sec"
_SPEED: Final = "velocities/vt-fps"
_ALPHA_DOT: Final = "aero/alphadot-rad_sec"  # the harness puts a closed form in its place, without delay
_QBAR: Final = "aero/qbar-psf"
_AREA: Final = "metrics/Sw-sqft"
_CHORD: Final = "metrics/cbarw-ft"
_PROPERTIES: Final = {
    ALPHA: ("aero/alpha-rad", "1"),
    ELEVATOR: (ELEVATOR_POSITION, "1"),
    "p_rad_s": ("velocities/p-aero-rad_sec", "1"),
    "r_rad_s": ("velocities/r-aero-rad_sec", "1"),
    "thrust_n": (THRUST, "lbf"),
    "density_kg_m3": ("atmosphere/rho-slugs_ft3", "slug_ft3"),
}
"""Variable -> JSBSim's property and its unit, where the catalogue of channels says none or another."""


def coefficients_in_jsbsim(equations: CoefficientEquations, *, name: str) -> str:
    """Return the XML of an aircraft, to be written to ``<folder>/<name>/<name>.xml``.

    Its span, of which the model knows nothing, is area by chord; its moments of inertia are all that in pitch.
    """
    model = equations.model
    frame = model.airframe
    root = aircraft(name, "\n".join(_description(equations)))
    add_metrics(
        root,
        area_m2=frame.wing_area_m2,
        span_m=frame.wing_area_m2 / frame.chord_m,
        chord_m=frame.chord_m,
        reference_x_m=frame.reference_x_m,
        reference_z_m=frame.reference_z_m,
    )
    add_mass(root, mass_kg=frame.mass_kg, pitch_inertia_kg_m2=frame.pitch_inertia_kg_m2)
    low, high = model.domain[model.form.variables.index(ELEVATOR)].tolist()
    add_elevator(root, name, (low, high))
    aerodynamics = ET.SubElement(root, "aerodynamics")
    child(aerodynamics, "property", THRUST, value=repr(float(from_si(frame.thrust_n, "lbf"))))
    for other in equations.inputs:
        if _property(other)[0].startswith("input/"):
            child(aerodynamics, "property", _property(other)[0], value="0")
    for coefficient in model.form.names:
        _coefficient(aerodynamics, equations, coefficient)
    _forces(aerodynamics, equations)
    _moment(aerodynamics, equations)
    return written(root)


def _description(equations: CoefficientEquations) -> list[str]:
    thrust = equations.model.airframe.thrust_n
    return [
        f"{', '.join(equations.model.form.names)} of {equations.source}.",
        f"It has no lateral motion. Its thrust is {THRUST}, {thrust:.6g} N until that is set.",
        *equations.said(),
    ]


def _coefficient(aerodynamics: ET.Element, equations: CoefficientEquations, name: str) -> None:
    """Add a coefficient as a property; of Cm without what depends on dα/dt."""
    function = ET.SubElement(aerodynamics, "function", {"name": _named(name)})
    late = MOVING.index(ALPHA_RATE)
    rows = {row: number for row, number in equations.monomials(name).items() if not row[late]}
    _sum(function, equations, rows)


def _sum(parent: ET.Element, equations: CoefficientEquations, rows: dict[tuple[int, ...], float]) -> None:
    total = ET.SubElement(parent, "sum")
    names, reference = equations.model.form.variables, equations.model.reference_speed_m_s
    for row, number in rows.items():
        term = ET.SubElement(total, "product") if any(row) else total
        powers = dict(zip(names, row, strict=True))
        # V / V0 and q c / 2V0 are V and q c times numbers: these go into the coefficient.
        speed = from_si(reference, "ft_s") ** (powers[SPEED] + powers[REFERENCE_PITCH_RATE])
        child(term, "value", repr(float(number / speed / 2.0 ** powers[REFERENCE_PITCH_RATE])))
        for variable, power in powers.items():
            for _ in range(power):
                _factor(term, variable)
    # A sum of one part would be no sum to JSBSim.
    child(total, "value", "0")
    child(total, "value", "0")


def _factor(term: ET.Element, variable: str) -> None:
    match variable:
        case value if value == SPEED:
            child(term, "property", _SPEED)
        case value if value == PITCH_RATE:
            child(term, "property", _Q)
            half_chord(term)
        case value if value == REFERENCE_PITCH_RATE:
            child(term, "property", _Q)
            child(term, "property", _CHORD)
        case value if value == ALPHA_RATE:
            child(term, "property", _ALPHA_DOT)
            half_chord(term)
        case _:
            name, factor = _property(variable)
            child(term, "property", name)
            if factor != 1.0:
                child(term, "value", repr(factor))


def _property(variable: str) -> tuple[str, float]:
    """Return JSBSim's property of an input, and by what it is multiplied to be in SI.

    One that JSBSim does not have is ``input/<name>``, which stands at 0 until it is set.
    """
    if variable in _PROPERTIES:
        name, unit = _PROPERTIES[variable]
    elif CHANNELS[variable].jsbsim_property:
        name, unit = CHANNELS[variable].jsbsim_property, CHANNELS[variable].jsbsim_unit
    else:
        name, unit = f"input/{quantity_of(variable).replace('_', '-')}", "1"
    return name, 1.0 / from_si(1.0, unit)


def _forces(aerodynamics: ET.Element, equations: CoefficientEquations) -> None:
    one, two = equations.forces
    angle = equations.model.airframe.thrust_angle_rad
    turned = equations.body and equations.late
    if not equations.body or turned:
        # Lift is up and drag is back: positive against the wind axes z and x.
        parts = {"LIFT": ("sin", 1.0), "DRAG": ("cos", -1.0)}
        for axis, (function, sign) in parts.items():
            element = ET.SubElement(aerodynamics, "axis", {"name": axis})
            if turned:
                along, across = ((1.0, "sin"), (-1.0, "cos")) if axis == "LIFT" else ((-1.0, "cos"), (-1.0, "sin"))
                total = _force(element, f"aero/force/{axis.lower()}-lbs", "sum")
                for coefficient, (weight, turn) in zip((one, two), (along, across), strict=True):
                    product = ET.SubElement(total, "product")
                    child(product, "value", repr(weight))
                    child(product, "property", _named(coefficient))
                    child(ET.SubElement(product, turn), "property", _PROPERTIES[ALPHA][0])
            else:
                product = _force(element, f"aero/force/{axis.lower()}-lbs", "product")
                child(product, "value", "1")
                child(product, "property", _named(two if axis == "LIFT" else one))
            product = _thrust(element, axis, sign)
            inclination = ET.SubElement(ET.SubElement(product, function), "sum")
            child(inclination, "property", _PROPERTIES[ALPHA][0])
            child(inclination, "value", repr(float(angle)))
    else:
        for axis, coefficient, share in (("X", one, math.cos(angle)), ("Z", two, -math.sin(angle))):
            element = ET.SubElement(aerodynamics, "axis", {"name": axis})
            product = _force(element, f"aero/force/{axis}-lbs", "product")
            child(product, "value", "1")
            child(product, "property", _named(coefficient))
            child(_thrust(element, axis, share), "value", "1")


def _force(axis: ET.Element, name: str, operation: str) -> ET.Element:
    """Add a force: dynamic pressure times area times an operation; return that."""
    product = ET.SubElement(ET.SubElement(axis, "function", {"name": name}), "product")
    child(product, "property", _QBAR)
    child(product, "property", _AREA)
    return ET.SubElement(product, operation)


def _thrust(axis: ET.Element, name: str, share: float) -> ET.Element:
    """Add what the thrust gives to an axis; return its product."""
    function = ET.SubElement(axis, "function", {"name": f"model/thrust-{name.lower()}-lbs"})
    product = ET.SubElement(function, "product")
    child(product, "property", THRUST)
    child(product, "value", repr(float(share)))
    return product


def _moment(aerodynamics: ET.Element, equations: CoefficientEquations) -> None:
    frame = equations.model.airframe
    axis = ET.SubElement(aerodynamics, "axis", {"name": "PITCH"})
    product = ET.SubElement(ET.SubElement(axis, "function", {"name": "aero/moment/pitch-lbsft"}), "product")
    for name in (_QBAR, _AREA, _CHORD, _named(equations.model.form.names[2])):
        child(product, "property", name)
    late = MOVING.index(ALPHA_RATE)
    rows = {row: number for row, number in equations.monomials("Cm").items() if row[late]}
    if rows:
        function = ET.SubElement(axis, "function", {"name": "aero/moment/pitch-of-alpha-rate-lbsft"})
        product = ET.SubElement(function, "product")
        for name in (_QBAR, _AREA, _CHORD):
            child(product, "property", name)
        _sum(product, equations, rows)
    # JSBSim moves every force of the axes from AERORP to the center of gravity, that of the thrust as well.
    angle = frame.thrust_angle_rad
    moved = frame.reference_z_m * math.cos(angle) + frame.reference_x_m * math.sin(angle)
    function = ET.SubElement(axis, "function", {"name": "model/thrust-pitch-lbsft"})
    product = ET.SubElement(function, "product")
    child(product, "property", THRUST)
    child(product, "value", repr(float(from_si(frame.thrust_arm_m - moved, "ft"))))


def _named(coefficient: str) -> str:
    return f"aero/coefficient/{coefficient}"

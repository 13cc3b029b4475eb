"""The XML of a derived copy of an aircraft: its own aerodynamics in the surroundings of a fidelity.

``rig``: no gravity, no rotation, no engines, drag canceled, m·g along +z of the wind axes; total mass as one body.
``symmetric``: a sphere at rest with the gravity of the standard atmosphere; engines and tanks kept, what they do
sideways canceled. ``free``: JSBSim's Earth; the original with one force more, or with surfaces driven directly.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from copy import deepcopy
from typing import Final

from finback.flight.alpha_dot import NORMAL_FORCE
from finback.flight.derivation import CENTER, INERTIA, WEIGHT, Source
from finback.flight.xml_text import child, included
from finback.units import STANDARD_GRAVITY_M_S2, from_si

THRUST: Final = "finback/thrust-lbs"
"""A constant force along body x through the center of gravity."""

EARTH_RADIUS_M: Final = 6356766.0
"""Of the U.S. Standard Atmosphere 1976: with standard gravity g0 at r, g = g0 (r / (r + h))² is its Eq. (17)."""

_REPLACED: Final = (
    "planet",
    "mass_balance",
    "ground_reactions",
    "external_reactions",
    "buoyant_forces",
    "propulsion",
    "system",
    "autopilot",
    "flight_control",
    "input",
    "output",
)
_RIG_RADIUS_FT: Final = "20925646.3"  # without rotation and gravity it only places the vehicle
# JSBSim divides by GM in every frame and logs an error if it is 0. This one is a gravity of 2e-35 ft/s², which no
# 64-bit acceleration can feel.
_RIG_GRAVITY_FT3_S2: Final = "1e-20"
_SIDEWAYS: Final = (("l", (1, 0, 0)), ("n", (0, 0, 1)))


def rig_model(
    source: Source, mass: Mapping[str, float], *, normal_force_lbs: float, constants: Mapping[str, float]
) -> str:
    """Return the XML of the rig's copy.

    Args:
        source: the aircraft.
        mass: ``MASS_PROPERTIES`` of the whole aircraft, in its plane of symmetry.
        normal_force_lbs: the constant force along +z of the wind axes that supplies g/V.
        constants: properties that only a dropped part defined -> their value.
    """
    model = _new(source)
    model.append(_planet("rig", radius_ft=_RIG_RADIUS_FT, gravity_ft3_s2=_RIG_GRAVITY_FT3_S2))
    model.extend(deepcopy(source.root.findall("metrics")))
    model.append(_mass_balance(mass))
    model.append(ET.Element("ground_reactions"))
    forces = _properties({**constants, NORMAL_FORCE: normal_force_lbs})
    # Evaluated after the aerodynamics of the same frame: drag is canceled without lag.
    _add_force(forces, "rig-drag", "WIND", "forces/fwx-aero-lbs", (1, 0, 0), mass)
    _add_force(forces, "rig-normal", "WIND", NORMAL_FORCE, (0, 0, 1), mass)
    model.append(forces)
    model.append(deepcopy(source.aerodynamics))
    return _text(model)


def direct_model(
    source: Source, base: Mapping[str, float], total: Mapping[str, float], *, constants: Mapping[str, float]
) -> str:
    """Return the XML of a copy for ``symmetric`` or ``free`` whose surfaces are driven directly.

    Args:
        source: the aircraft.
        base: ``MASS_PROPERTIES`` of it without what the tanks hold.
        total: the same with it.
        constants: properties that only a dropped part defined -> their value.
    """
    model = _new(source)
    symmetric = source.fidelity == "symmetric"
    if symmetric:
        gravity = from_si(STANDARD_GRAVITY_M_S2, "ft_s2") * from_si(EARTH_RADIUS_M, "ft") ** 2
        radius = repr(from_si(EARTH_RADIUS_M, "ft"))
        model.append(_planet("sphere", radius_ft=radius, gravity_ft3_s2=repr(gravity)))
    else:
        model.extend(deepcopy(source.root.findall("planet")))
    model.extend(deepcopy(source.root.findall("metrics")))
    model.append(_mass_balance(base))
    model.append(ET.Element("ground_reactions"))
    model.extend(_engines(source))
    forces = _properties(constants)
    _add_thrust(forces, total)
    if symmetric and source.powered:
        _add_force(forces, "in-plane", "BODY", "-forces/fby-prop-lbs", (0, 1, 0), total)
        for axis, direction in _SIDEWAYS:
            moment = child(forces, "moment", name=f"in-plane-{axis}", frame="BODY")
            function = child(moment, "function", name=f"finback/in-plane-{axis}-lbsft")
            child(function, "property", f"-moments/{axis}-prop-lbsft")
            _add_direction(moment, direction)
    model.append(forces)
    model.append(_aerodynamics(source))
    return _text(model)


def original_model(source: Source, total: Mapping[str, float], base: tuple[Mapping[str, float], ...] = ()) -> str:
    """Return the XML of the original with the force ``THRUST``; without input and output, and with lag-free alpha_dot.

    Args:
        source: the aircraft.
        total: its ``MASS_PROPERTIES``, as loaded.
        base: if it is loaded otherwise, those of the body without what the tanks hold; else nothing.
    """
    model = deepcopy(source.root)
    for other in base:
        for element in model.findall("mass_balance"):
            model.remove(element)
        model.append(_mass_balance(other))
    for tag in ("input", "output", "aerodynamics"):
        for element in model.findall(tag):
            model.remove(element)
    forces = model.find("external_reactions")
    if forces is None:
        forces = child(model, "external_reactions")
    elif "file" in forces.attrib:
        model.remove(forces)
        forces = deepcopy(included(forces, source.path.parent))
        forces.tag = "external_reactions"
        model.append(forces)
    _add_thrust(forces, total)
    model.append(_aerodynamics(source))
    return _text(model)


def replaced(source: Source, loaded: Mapping[str, float], mass: Mapping[str, float], *, original: bool) -> list[str]:
    """Return what a copy replaces, in words; ``original``: everything but the aerodynamics' alpha_dot is kept."""
    kept = {"propulsion": source.fidelity != "rig", "planet": source.fidelity == "free"}
    parts = [
        tag
        for tag in _REPLACED
        if (source.root.find(tag) is not None or tag == "planet")
        and not kept.get(tag, False)
        and (not original or tag in ("input", "output"))
    ]
    parts += [f"axis {name}" for name in source.dropped_axes]
    if loaded[CENTER[1]] != mass[CENTER[1]]:
        parts.append(f"{CENTER[1]} {loaded[CENTER[1]]:.6g} by {mass[CENTER[1]]:.6g}")
    parts += [f"{name} {loaded[name]:.6g} by 0" for name in (INERTIA[3], INERTIA[5]) if loaded[name] != mass[name]]
    parts += [f"{name} in PITCH by its algebraic form" for name in source.algebraic]
    return parts


def _new(source: Source) -> ET.Element:
    return ET.Element("fdm_config", {"name": source.root.get("name", "copy"), "version": "2.0"})


def _text(model: ET.Element) -> str:
    return ET.tostring(model, encoding="unicode", xml_declaration=True)


def _planet(name: str, *, radius_ft: str, gravity_ft3_s2: str) -> ET.Element:
    planet = ET.Element("planet", {"name": name})
    child(planet, "semimajor_axis", radius_ft, unit="FT")
    child(planet, "semiminor_axis", radius_ft, unit="FT")
    child(planet, "rotation_rate", "0", unit="RAD/SEC")
    child(planet, "GM", gravity_ft3_s2, unit="FT3/SEC2")
    child(planet, "J2", "0")
    return planet


def _location(parent: ET.Element, mass: Mapping[str, float], **attributes: str) -> None:
    location = child(parent, "location", **attributes, unit="IN")
    for axis, name in zip("xyz", CENTER, strict=True):
        child(location, axis, repr(float(mass[name])))


def _mass_balance(mass: Mapping[str, float]) -> ET.Element:
    balance = ET.Element("mass_balance", {"negated_crossproduct_inertia": "false"})
    # The properties give the matrix entries, the file takes the products of inertia: opposite signs.
    for name, sign in zip(INERTIA, (1, 1, 1, -1, -1, -1), strict=True):
        tag = name.removeprefix("inertia/").removesuffix("-slugs_ft2")
        child(balance, tag, repr(sign * float(mass[name])), unit="SLUG*FT2")
    child(balance, "emptywt", repr(float(mass[WEIGHT])), unit="LBS")
    _location(balance, mass, name="CG")
    return balance


def _engines(source: Source) -> list[ET.Element]:
    """Return engines and tanks, from their own file if they lie in one."""
    found = [deepcopy(included(element, source.path.parent)) for element in source.root.findall("propulsion")]
    for element in found:
        element.tag = "propulsion"
    return found


def _aerodynamics(source: Source) -> ET.Element:
    """Return the aerodynamics, told what the force ``THRUST`` is along +z of the wind axes."""
    aerodynamics = deepcopy(source.aerodynamics)
    function = ET.Element("function", {"name": NORMAL_FORCE})
    product = child(function, "product")
    child(product, "property", f"-{THRUST}")
    child(child(product, "sin"), "property", "aero/alpha-rad")
    aerodynamics[:0] = [_property(THRUST, 0.0), function]
    return aerodynamics


def _property(name: str, value: float) -> ET.Element:
    element = ET.Element("property", {"value": repr(float(value))})
    element.text = name
    return element


def _properties(values: Mapping[str, float]) -> ET.Element:
    forces = ET.Element("external_reactions")
    forces.extend(_property(name, value) for name, value in values.items())
    return forces


def _add_thrust(forces: ET.Element, total: Mapping[str, float]) -> None:
    _add_force(forces, "fixed-thrust", "BODY", THRUST, (1, 0, 0), total)


def _add_force(
    forces: ET.Element,
    name: str,
    frame: str,
    magnitude: str,
    direction: tuple[int, int, int],
    mass: Mapping[str, float],
) -> None:
    """Add a force at the center of gravity."""
    force = child(forces, "force", name=name, frame=frame)
    function = child(force, "function", name=f"finback/{name}-magnitude-lbs")
    child(function, "property", magnitude)
    _location(force, mass)
    _add_direction(force, direction)


def _add_direction(parent: ET.Element, direction: tuple[int, int, int]) -> None:
    towards = child(parent, "direction")
    for axis, value in zip("xyz", direction, strict=True):
        child(towards, axis, str(value))

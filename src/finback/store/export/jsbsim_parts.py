"""Parts of an aircraft for JSBSim that every exported one has: sizes, mass, and what drives the elevator."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from typing import Final

from finback.units import from_si

ELEVATOR_POSITION: Final = "fcs/elevator-pos-rad"

_POUNDS_PER_SLUG: Final = 32_174_049e-6
"""By which JSBSim divides a weight to get a mass; its own number, no unit of ours."""
_WIDEST_RAD: Final = math.pi / 2
"""Elevator range where the model states no domain."""


def child(parent: ET.Element, tag: str, text: str, **attributes: str) -> None:
    """Add an element with a text."""
    ET.SubElement(parent, tag, attributes).text = text


def aircraft(name: str, description: str) -> ET.Element:
    """Return an aircraft that has a header only."""
    root = ET.Element("fdm_config", {"name": name, "version": "2.0", "release": "BETA"})
    header = ET.SubElement(root, "fileheader")
    child(header, "author", "Finback")
    child(header, "description", description)
    return root


def written(root: ET.Element) -> str:
    """Return the text of an XML file."""
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def add_metrics(
    root: ET.Element,
    *,
    area_m2: float,
    span_m: float,
    chord_m: float,
    reference_x_m: float = 0.0,
    reference_z_m: float = 0.0,
) -> None:
    """Add reference sizes, and the point that aerodynamic moments are about, forward of and below the origin."""
    metrics = ET.SubElement(root, "metrics")
    child(metrics, "wingarea", repr(float(from_si(area_m2, "ft2"))), unit="FT2")
    child(metrics, "wingspan", repr(float(from_si(span_m, "ft"))), unit="FT")
    child(metrics, "chord", repr(float(from_si(chord_m, "ft"))), unit="FT")
    # Of the structural frame, in which JSBSim is told places, x is aft and z is up.
    _location(metrics, "AERORP", -from_si(reference_x_m, "ft"), -from_si(reference_z_m, "ft"))


def add_mass(root: ET.Element, *, mass_kg: float, pitch_inertia_kg_m2: float) -> None:
    """Add a mass with its center of gravity at the origin; all three moments of inertia are that in pitch."""
    balance = ET.SubElement(root, "mass_balance", {"negated_crossproduct_inertia": "false"})
    inertia = repr(float(from_si(pitch_inertia_kg_m2, "slug_ft2")))
    for axis in ("ixx", "iyy", "izz"):
        child(balance, axis, inertia, unit="SLUG*FT2")
    child(balance, "emptywt", repr(float(from_si(mass_kg, "slug") * _POUNDS_PER_SLUG)), unit="LBS")
    _location(balance, "CG", 0.0, 0.0)
    ET.SubElement(root, "ground_reactions")


def add_elevator(root: ET.Element, name: str, domain: tuple[float, float]) -> None:
    """Let the elevator's command drive it over the range in which data supported the model.

    A command of 0 is an elevator of 0; so where that lies outside the range, both sides get the larger of its ends.
    """
    low, high = domain
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        low, high = -_WIDEST_RAD, _WIDEST_RAD
    if not low < 0.0 < high:
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    control = ET.SubElement(root, "flight_control", {"name": name})
    channel = ET.SubElement(control, "channel", {"name": "elevator"})
    scale = ET.SubElement(channel, "aerosurface_scale", {"name": "fcs/elevator-demand-rad"})
    child(scale, "input", "fcs/elevator-cmd-norm")
    limits = ET.SubElement(scale, "range")
    child(limits, "min", repr(low))
    child(limits, "max", repr(high))
    child(scale, "output", ELEVATOR_POSITION)


def half_chord(term: ET.Element) -> None:
    """Add c/2V of this frame: JSBSim's own aero/ci2vel is of the frame before outside the axes."""
    quotient = ET.SubElement(term, "quotient")
    child(quotient, "property", "metrics/cbarw-ft")
    twice = ET.SubElement(quotient, "product")
    child(twice, "value", "2")
    child(twice, "property", "velocities/vt-fps")


def _location(parent: ET.Element, name: str, x_ft: float, z_ft: float) -> None:
    location = ET.SubElement(parent, "location", {"name": name, "unit": "FT"})
    for axis, value in (("x", x_ft), ("y", 0.0), ("z", z_ft)):
        child(location, axis, repr(float(value)) if value else "0")

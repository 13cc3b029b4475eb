"""The rig's derived copy of an aircraft: its own aerodynamics, everything else replaced by the rig.

Kept: metrics, the aerodynamics of the plane of symmetry, and total mass, center of gravity and inertia as loaded.
Replaced: the planet (no rotation, no gravity), engines and tanks, flight control and systems (the surface position is
driven directly), landing gear, external forces (the rig's two instead).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError
from finback.units import from_si

ELEVATOR: Final = "fcs/elevator-pos-rad"
NORMAL_FORCE: Final = "rig/normal-force-lbs"
_ALGEBRAIC: Final = {
    "aero/alphadot-rad_sec": ("rig/alpha-dot-rad_sec", 1.0),
    "aero/alphadot-deg_sec": ("rig/alpha-dot-deg_sec", from_si(1.0, "deg")),
}
"""What JSBSim gives a frame late -> its algebraic form in the copy's pitch axis, and how many of its unit make 1/s."""
_LATE: Final = (*_ALGEBRAIC, "aero/cl-squared")
# JSBSim computes it after the functions that belong to no axis. (So it does aero/ci2vel, aero/bi2vel and
# aero/qbar-area; but with the airspeed held these do not change.)
_LATE_OUTSIDE_AXES: Final = ("aero/alpha-wing-rad",)

WEIGHT: Final = "inertia/weight-lbs"
CENTER: Final = ("inertia/cg-x-in", "inertia/cg-y-in", "inertia/cg-z-in")
INERTIA: Final = tuple(f"inertia/i{axes}-slugs_ft2" for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
REFERENCE_POINT_Y: Final = "metrics/aero-rp-y-in"
MASS_PROPERTIES: Final = (WEIGHT, *CENTER, *INERTIA, REFERENCE_POINT_Y)

_DRIVEN: Final = frozenset({ELEVATOR, "fcs/elevator-pos-deg"})
_LATERAL_AXES: Final = frozenset({"SIDE", "ROLL", "YAW", "Y"})
_FORGOTTEN_AT_RESET: Final = ("aero_ref_pt_shift_x", "hysteresis_limits")
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
_RADIUS_FT: Final = "20925646.3"  # of the sphere below; without rotation and gravity it only places the vehicle
# JSBSim divides by GM in every frame and logs an error if it is 0. This one is a gravity of 2e-35 ft/s², which no
# 64-bit acceleration can feel.
_GRAVITY_PARAMETER_FT3_S2: Final = "1e-20"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """An aircraft's XML, and what the rig's copy takes of it.

    Attributes:
        root: the whole model, unchanged.
        aerodynamics: the copy's aerodynamics: SIDE, ROLL and YAW dropped, alpha_dot in PITCH algebraic.
        dropped_axes: the names of the axes dropped.
        algebraic: which of JSBSim's late rates the copy's pitch axis has in algebraic form.
        reads: the properties that the copy's aerodynamics read and do not define.
    """

    root: ET.Element
    aerodynamics: ET.Element
    dropped_axes: tuple[str, ...]
    algebraic: tuple[str, ...]
    reads: tuple[str, ...]


def read_source(path: Path) -> Source:
    """Read an aircraft's XML for the rig.

    Raises:
        AircraftError: not readable, no aerodynamics, aerodynamics that do not feel the elevator, or with a memory
            that JSBSim loses at a reset.
    """
    root = _parse(path)
    found = root.find("aerodynamics")
    if found is None:
        raise AircraftError(f"{path}: it has no aerodynamics", hint="the rig flies aerodynamics only")
    if "file" in found.attrib:
        file = path.parent / found.attrib["file"]
        found = _parse(file if file.suffix == ".xml" else file.with_name(f"{file.name}.xml"))
    for tag in _FORGOTTEN_AT_RESET:
        if found.find(tag) is not None:
            raise AircraftError(f"{path}: JSBSim forgets <{tag}> at a reset", hint="remove it from the aerodynamics")
    aerodynamics = deepcopy(found)
    aerodynamics.tag = "aerodynamics"
    lateral = [axis for axis in aerodynamics.findall("axis") if axis.get("name") in _LATERAL_AXES]
    declared = aerodynamics.findall("property")
    for element in (*lateral, *(entry for entry in declared if _name(entry) == NORMAL_FORCE)):
        aerodynamics.remove(element)
    algebraic = _use_algebraic_alpha_dot(aerodynamics)
    reads = _reads(aerodynamics)
    if lost := sorted(reads & {name for axis in lateral for name in _defined(axis)}):
        raise AircraftError(f"{path}: lift, drag or pitch read {', '.join(lost)}, which belong to a lateral axis")
    if not reads & _DRIVEN:
        raise AircraftError(f"{path}: its aerodynamics do not read '{ELEVATOR}'", hint="the rig drives this property")
    known = _defined(aerodynamics) | {_name(entry) for entry in declared} | _DRIVEN | {NORMAL_FORCE}
    return Source(
        root=root,
        aerodynamics=aerodynamics,
        dropped_axes=tuple(axis.get("name", "") for axis in lateral),
        algebraic=algebraic,
        reads=tuple(sorted(reads - known)),
    )


def rig_model(
    source: Source, loaded: Mapping[str, float], *, normal_force_lbs: float, constants: Mapping[str, float]
) -> str:
    """Return the XML of the rig's copy.

    Args:
        source: the aircraft.
        loaded: ``MASS_PROPERTIES`` of the aircraft as JSBSim loaded it.
        normal_force_lbs: the constant force along +z of the wind axes that supplies g/V.
        constants: properties that only a dropped part defined -> their value.
    """
    model = ET.Element("fdm_config", {"name": source.root.get("name", "rig"), "version": "2.0"})
    model.append(_planet())
    model.extend(deepcopy(source.root.findall("metrics")))
    model.append(_mass_balance(loaded))
    model.append(ET.Element("ground_reactions"))
    model.append(_forces(loaded, {**constants, NORMAL_FORCE: normal_force_lbs}))
    model.append(deepcopy(source.aerodynamics))
    return ET.tostring(model, encoding="unicode", xml_declaration=True)


def center_in(loaded: Mapping[str, float]) -> tuple[float, float, float]:
    """Return the copy's center of gravity: the original's, moved into the plane of symmetry."""
    return loaded[CENTER[0]], loaded[REFERENCE_POINT_Y], loaded[CENTER[2]]


def inertia_slug_ft2(loaded: Mapping[str, float]) -> tuple[float, ...]:
    """Return the copy's inertia matrix entries, in the order of ``INERTIA``: xy and yz are 0, as by symmetry."""
    ixx, iyy, izz, _, ixz, _ = (loaded[name] for name in INERTIA)
    return ixx, iyy, izz, 0.0, ixz, 0.0


def replaced(source: Source, loaded: Mapping[str, float]) -> tuple[str, ...]:
    """Return what the rig's copy replaces, in words."""
    parts = [tag for tag in _REPLACED if source.root.find(tag) is not None or tag == "planet"]
    parts += [f"axis {name}" for name in source.dropped_axes]
    if loaded[CENTER[1]] != loaded[REFERENCE_POINT_Y]:
        parts.append(f"{CENTER[1]} {loaded[CENTER[1]]:.6g} by {loaded[REFERENCE_POINT_Y]:.6g}")
    parts += [f"{name} {loaded[name]:.6g} by 0" for name in (INERTIA[3], INERTIA[5]) if loaded[name] != 0]
    parts += [f"{name} in PITCH by its algebraic form" for name in source.algebraic]
    return tuple(parts)


def late_properties(source: Source) -> tuple[str, ...]:
    """Return what the copy's aerodynamics read that JSBSim gives a frame late: such flights are of first order."""
    outside = {name for element in source.aerodynamics.findall("function") for name in _reads(element)}
    late = [name for name in _LATE if name in source.reads]
    return (*late, *(name for name in _LATE_OUTSIDE_AXES if name in outside))


def _parse(path: Path) -> ET.Element:
    try:
        return ET.parse(path).getroot()  # noqa: S314 - the user's own aircraft, which JSBSim will read as well
    except ET.ParseError as error:
        raise AircraftError(f"{path}: malformed XML: {error}") from None
    except OSError as error:
        raise AircraftError(f"{path}: cannot be read: {error.strerror}") from None


def _name(element: ET.Element) -> str:
    return (element.text or "").strip().removeprefix("-")


def _reads(element: ET.Element) -> set[str]:
    return {_name(part) for part in _readers(element)}


def _readers(element: ET.Element) -> list[ET.Element]:
    """Return the parts that read a property."""
    return [part for tag in ("property", "p", "independentVar") for part in element.iter(tag)]


def _defined(element: ET.Element) -> set[str]:
    return {part.get("name", "") for tag in ("function", "table") for part in element.iter(tag)} - {""}


def _lift_functions(aerodynamics: ET.Element) -> list[str]:
    """Return the names of the lift axis's functions; unnamed ones get a name."""
    functions = aerodynamics.findall("axis[@name='LIFT']/function")
    for number, function in enumerate(functions):
        function.set("name", function.get("name") or f"rig/lift-{number}-lbs")
    return [function.get("name", "") for function in functions]


def _use_algebraic_alpha_dot(aerodynamics: ET.Element) -> tuple[str, ...]:
    """Put q - (L - F)/(mV) in place of JSBSim's alpha_dot in the pitch axis; return the properties replaced.

    JSBSim evaluates forces before moments, so it is exact there, and nowhere else. Lift must be an axis of its own.
    """
    if aerodynamics.find("axis[@name='LIFT']") is None:
        return ()
    lift, found = _lift_functions(aerodynamics), set[str]()
    axes = aerodynamics.findall("axis[@name='PITCH']")
    for part in (part for axis in axes for part in _readers(axis)):
        name = _name(part)
        if name in _ALGEBRAIC:
            sign = "-" if (part.text or "").strip().startswith("-") else ""
            part.text = sign + _ALGEBRAIC[name][0]
            found.add(name)
    for name in sorted(found):
        axes[0][:0] = _alpha_dot_functions(*_ALGEBRAIC[name], lift=lift)
    return tuple(sorted(found))


def _alpha_dot_functions(name: str, scale: float, *, lift: list[str]) -> tuple[ET.Element, ET.Element]:
    """Return two functions that define ``name`` in an axis and, as its first, add exactly nothing to it: x and -x.

    A table can look up by a function's name only, and a function with a name adds to its axis.
    """
    function, back = ET.Element("function", {"name": name}), ET.Element("function", {"name": f"{name}-taken-back"})
    _child(back, "property", f"-{name}")
    rate = _child(function, "product")
    _child(rate, "value", repr(scale))
    total = _child(rate, "sum")
    _child(total, "property", "velocities/q-rad_sec")
    path = _child(total, "quotient")
    force = _child(path, "sum")
    _child(force, "property", NORMAL_FORCE)
    for part in lift:
        _child(force, "property", f"-{part}")
    momentum = _child(path, "product")
    _child(momentum, "property", "inertia/mass-slugs")
    _child(momentum, "property", "velocities/vt-fps")
    return function, back


def _child(parent: ET.Element, tag: str, text: str = "", **attributes: str) -> ET.Element:
    child = ET.SubElement(parent, tag, attributes)
    child.text = text or None
    return child


def _planet() -> ET.Element:
    planet = ET.Element("planet", {"name": "rig"})
    _child(planet, "semimajor_axis", _RADIUS_FT, unit="FT")
    _child(planet, "semiminor_axis", _RADIUS_FT, unit="FT")
    _child(planet, "rotation_rate", "0", unit="RAD/SEC")
    _child(planet, "GM", _GRAVITY_PARAMETER_FT3_S2, unit="FT3/SEC2")
    _child(planet, "J2", "0")
    return planet


def _location(parent: ET.Element, loaded: Mapping[str, float], **attributes: str) -> None:
    location = _child(parent, "location", **attributes, unit="IN")
    for axis, value in zip("xyz", center_in(loaded), strict=True):
        _child(location, axis, repr(float(value)))


def _mass_balance(loaded: Mapping[str, float]) -> ET.Element:
    balance = ET.Element("mass_balance", {"negated_crossproduct_inertia": "false"})
    ixx, iyy, izz, _, ixz, _ = inertia_slug_ft2(loaded)
    # The property gives the matrix entry, the file takes the product of inertia: opposite signs.
    for tag, value in (("ixx", ixx), ("iyy", iyy), ("izz", izz), ("ixz", -ixz)):
        _child(balance, tag, repr(float(value)), unit="SLUG*FT2")
    _child(balance, "emptywt", repr(float(loaded[WEIGHT])), unit="LBS")
    _location(balance, loaded, name="CG")
    return balance


def _forces(loaded: Mapping[str, float], properties: Mapping[str, float]) -> ET.Element:
    forces = ET.Element("external_reactions")
    for name, value in properties.items():
        _child(forces, "property", name, value=repr(float(value)))
    # Evaluated after the aerodynamics of the same frame: drag is canceled without lag.
    for name, magnitude, direction in (
        ("rig-drag", "forces/fwx-aero-lbs", (1, 0, 0)),
        ("rig-normal", NORMAL_FORCE, (0, 0, 1)),
    ):
        force = _child(forces, "force", name=name, frame="WIND")
        function = _child(force, "function", name=f"rig/{name}-magnitude-lbs")
        _child(function, "property", magnitude)
        _location(force, loaded)
        towards = _child(force, "direction")
        for axis, value in zip("xyz", direction, strict=True):
            _child(towards, axis, str(value))
    return forces

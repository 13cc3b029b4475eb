"""What a derived copy of an aircraft takes of its XML.

The rig and ``symmetric`` take the aerodynamics of the plane of symmetry, ``free`` all of them. In each, JSBSim's late
rate of alpha is replaced by a closed form where one can stand.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError
from finback.flight.alpha_dot import (
    ALGEBRAIC,
    NORMAL_FORCE,
    flight_form,
    powered_form,
    rig_form,
    use_algebraic_alpha_dot,
)
from finback.flight.xml_text import defined, included, name_of, parse, reads

ELEVATOR: Final = "fcs/elevator-pos-rad"
AILERON: Final = "fcs/left-aileron-pos-rad"
RUDDER: Final = "fcs/rudder-pos-rad"

WEIGHT: Final = "inertia/weight-lbs"
CENTER: Final = ("inertia/cg-x-in", "inertia/cg-y-in", "inertia/cg-z-in")
INERTIA: Final = tuple(f"inertia/i{axes}-slugs_ft2" for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
REFERENCE_POINT_Y: Final = "metrics/aero-rp-y-in"
MASS_PROPERTIES: Final = (WEIGHT, *CENTER, *INERTIA, REFERENCE_POINT_Y)

_LATE: Final = (*ALGEBRAIC, "aero/cl-squared")
# JSBSim computes it after the functions that belong to no axis. (So it does aero/ci2vel, aero/bi2vel and
# aero/qbar-area; but with the airspeed held these do not change.)
_LATE_OUTSIDE_AXES: Final = ("aero/alpha-wing-rad",)
_LATE_WITH_AIRSPEED: Final = ("aero/ci2vel", "aero/bi2vel", "aero/qbar-area")
_DRIVEN: Final = frozenset({ELEVATOR, "fcs/elevator-pos-deg"})
_LATERAL_AXES: Final = frozenset({"SIDE", "ROLL", "YAW", "Y"})
_FORGOTTEN_AT_RESET: Final = ("aero_ref_pt_shift_x", "hysteresis_limits")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """An aircraft's XML, and what a copy takes of it.

    Attributes:
        path: the file.
        root: the whole model, unchanged.
        aerodynamics: the copy's aerodynamics: with alpha_dot in PITCH algebraic; without the lateral axes, but for
            ``free``.
        fidelity: of the copy.
        powered: it has engines, and the copy keeps them; JSBSim has no properties of their force otherwise.
        dropped_axes: the names of the axes dropped.
        algebraic: which of JSBSim's late rates the copy's pitch axis has in algebraic form.
        reads: the properties that the copy's aerodynamics read and do not define.
    """

    path: Path
    root: ET.Element
    aerodynamics: ET.Element
    fidelity: str
    powered: bool
    dropped_axes: tuple[str, ...]
    algebraic: tuple[str, ...]
    reads: tuple[str, ...]


def read_source(path: Path, fidelity: str) -> Source:
    """Read an aircraft's XML for a copy in a fidelity.

    Raises:
        AircraftError: not readable, no aerodynamics, aerodynamics that do not feel the elevator, or with a memory
            that JSBSim loses at a reset.
    """
    root = parse(path)
    found = root.find("aerodynamics")
    if found is None:
        raise AircraftError(f"{path}: it has no aerodynamics", hint="the rig flies aerodynamics only")
    found = included(found, path.parent)
    for tag in _FORGOTTEN_AT_RESET:
        if found.find(tag) is not None:
            raise AircraftError(
                f"{path}: JSBSim forgets <{tag}> at a reset, so no two flights of it would be alike",
                hint=f"copy {path.parent} to aircraft/{path.parent.name} beside the study and take <{tag}> out of the "
                f"copy; 'finback fly {path.stem}' flies one case with it",
            )
    aerodynamics = deepcopy(found)
    aerodynamics.tag = "aerodynamics"
    in_plane = fidelity != "free"
    lateral = [axis for axis in aerodynamics.findall("axis") if in_plane and axis.get("name") in _LATERAL_AXES]
    declared = aerodynamics.findall("property")
    for element in (*lateral, *(entry for entry in declared if name_of(entry) == NORMAL_FORCE)):
        aerodynamics.remove(element)
    engines = [included(element, path.parent).find("engine") for element in root.findall("propulsion")]
    powered = fidelity != "rig" and any(engine is not None for engine in engines)
    form = rig_form if fidelity == "rig" else powered_form if powered else flight_form
    algebraic = use_algebraic_alpha_dot(aerodynamics, form)
    read = reads(aerodynamics)
    if lost := sorted(read & {name for axis in lateral for name in defined(axis)}):
        raise AircraftError(f"{path}: lift, drag or pitch read {', '.join(lost)}, which belong to a lateral axis")
    if not read & _DRIVEN:
        raise AircraftError(f"{path}: its aerodynamics do not read '{ELEVATOR}'", hint="the rig drives this property")
    known = defined(aerodynamics) | {name_of(entry) for entry in declared} | _DRIVEN | {NORMAL_FORCE}
    return Source(
        path=path,
        root=root,
        aerodynamics=aerodynamics,
        fidelity=fidelity,
        powered=powered,
        dropped_axes=tuple(axis.get("name", "") for axis in lateral),
        algebraic=algebraic,
        reads=tuple(sorted(read - known)),
    )


def late_properties(source: Source) -> tuple[str, ...]:
    """Return what the copy's aerodynamics read that JSBSim gives a frame late: such flights are of first order."""
    outside = {name for element in source.aerodynamics.findall("function") for name in reads(element)}
    late = [name for name in _LATE if name in source.reads]
    moving = () if source.fidelity == "rig" else _LATE_WITH_AIRSPEED
    return (*late, *(name for name in (*_LATE_OUTSIDE_AXES, *moving) if name in outside))


def symmetric_mass(loaded: Mapping[str, float]) -> dict[str, float]:
    """Return mass properties moved into the plane of symmetry: center of gravity, and Ixy and Iyz 0."""
    moved = {CENTER[1]: loaded[REFERENCE_POINT_Y], INERTIA[3]: 0.0, INERTIA[5]: 0.0}
    return {**{name: loaded[name] for name in MASS_PROPERTIES}, **moved}

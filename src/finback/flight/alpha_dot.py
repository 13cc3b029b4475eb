"""The rate of alpha inside an aircraft's pitching moment: JSBSim gives it a frame late, which costs an order.

JSBSim evaluates forces before moments, so in the pitch axis the lift of the same frame is known, and with it the
rate: q less lift over momentum on the rig; elsewhere with engines, gravity, sideslip and the turning Earth.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Final

from finback.flight.xml_text import child, name_of, readers
from finback.units import from_si

NORMAL_FORCE: Final = "rig/normal-force-lbs"
"""A force that a derived copy applies along +z of the wind axes; an aircraft's own closed form may read it."""

ALGEBRAIC: Final = {
    "aero/alphadot-rad_sec": ("rig/alpha-dot-rad_sec", 1.0),
    "aero/alphadot-deg_sec": ("rig/alpha-dot-deg_sec", from_si(1.0, "deg")),
}
"""What JSBSim gives a frame late -> its algebraic form in the copy's pitch axis, and how many of its unit make 1/s."""

_SMALLEST: Final = 0.01  # of cos β, where the form divides by it

Form = Callable[[ET.Element, list[str]], None]
"""Adds the rate of alpha in rad/s to an element, given the names of the lift axis's functions."""


def use_algebraic_alpha_dot(aerodynamics: ET.Element, form: Form) -> tuple[str, ...]:
    """Put a closed form in place of JSBSim's alpha_dot in the pitch axis; return the properties replaced.

    Lift must be an axis of its own.
    """
    if aerodynamics.find("axis[@name='LIFT']") is None:
        return ()
    found = set[str]()
    axes = aerodynamics.findall("axis[@name='PITCH']")
    for part in (part for axis in axes for part in readers(axis)):
        name = name_of(part)
        if name in ALGEBRAIC:
            sign = "-" if (part.text or "").strip().startswith("-") else ""
            part.text = sign + ALGEBRAIC[name][0]
            found.add(name)
    if found:
        lift = _lift_functions(aerodynamics)
        for name in sorted(found):
            axes[0][:0] = _functions(*ALGEBRAIC[name], form=form, lift=lift)
    return tuple(sorted(found))


def rig_form(parent: ET.Element, lift: list[str]) -> None:
    """Add q + (F - L)/(mV): no gravity, no engines, no sideslip."""
    total = child(parent, "sum")
    child(total, "property", "velocities/q-rad_sec")
    path = child(total, "quotient")
    force = child(path, "sum")
    child(force, "property", NORMAL_FORCE)
    for part in lift:
        child(force, "property", f"-{part}")
    momentum = child(path, "product")
    child(momentum, "property", "inertia/mass-slugs")
    child(momentum, "property", "velocities/vt-fps")


def powered_form(parent: ET.Element, lift: list[str]) -> None:
    """Add ``flight_form`` of an aircraft with engines: their force counts."""
    force = _flight_form(parent, lift)
    for axis, part, sign in (("z", "cos", ""), ("x", "sin", "-")):
        product = child(force, "product")
        child(product, "property", f"{sign}forces/fb{axis}-prop-lbs")
        _of(part, "aero/alpha-rad", product)


def flight_form(parent: ET.Element, lift: list[str]) -> None:
    """Add the rate of alpha over a turning planet.

    dα/dt = q' - tan β (p' cos α + r' sin α)
            + [Fz cos α - Fx sin α + m g' (cos α cos φ cos θ + sin α sin θ) + F - L] / (m V cos β)

    with p', q', r' the rates to the planet plus twice its rotation, g' gravity less its centrifugal part (up to its
    lean off the local vertical, 5e-7 rad/s), Fx and Fz of the engines, F ``NORMAL_FORCE``. Still air.
    """
    _flight_form(parent, lift)


def _flight_form(parent: ET.Element, lift: list[str]) -> ET.Element:
    """Add the form; return the sum of forces along +z of the wind axes, for more of them."""
    total = child(parent, "sum")
    total.append(_coriolis("q"))
    turning = child(total, "product")
    child(turning, "value", "-1")
    slope = child(turning, "quotient")
    _of("sin", "aero/beta-rad", slope)
    _cos_beta(slope)
    rates = child(turning, "sum")
    for rate, part in (("p", "cos"), ("r", "sin")):
        product = child(rates, "product")
        product.append(_coriolis(rate))
        _of(part, "aero/alpha-rad", product)
    path = child(total, "quotient")
    force = child(path, "sum")
    child(force, "property", NORMAL_FORCE)
    for part in lift:
        child(force, "property", f"-{part}")
    _weight(force)
    momentum = child(path, "product")
    child(momentum, "property", "inertia/mass-slugs")
    child(momentum, "property", "velocities/vt-fps")
    _cos_beta(momentum)
    return force


def _functions(name: str, scale: float, *, form: Form, lift: list[str]) -> tuple[ET.Element, ET.Element]:
    """Return two functions that define ``name`` in an axis and, as its first, add exactly nothing to it: x and -x.

    A table can look up by a function's name only, and a function with a name adds to its axis.
    """
    function, back = ET.Element("function", {"name": name}), ET.Element("function", {"name": f"{name}-taken-back"})
    child(back, "property", f"-{name}")
    rate = child(function, "product")
    child(rate, "value", repr(scale))
    form(rate, lift)
    return function, back


def _lift_functions(aerodynamics: ET.Element) -> list[str]:
    """Return the names of the lift axis's functions; unnamed ones get a name."""
    functions = aerodynamics.findall("axis[@name='LIFT']/function")
    for number, function in enumerate(functions):
        function.set("name", function.get("name") or f"rig/lift-{number}-lbs")
    return [function.get("name", "") for function in functions]


def _of(function: str, angle: str, parent: ET.Element) -> None:
    child(child(parent, function), "property", angle)


def _cos_beta(parent: ET.Element) -> None:
    largest = child(parent, "max")
    _of("cos", "aero/beta-rad", largest)
    child(largest, "value", repr(_SMALLEST))


def _coriolis(rate: str) -> ET.Element:
    """Return the rate to the planet plus twice the planet's own: twice the inertial less the relative one."""
    difference = ET.Element("difference")
    twice = child(difference, "product")
    child(twice, "value", "2")
    child(twice, "property", f"velocities/{rate}i-rad_sec")
    child(difference, "property", f"velocities/{rate}-rad_sec")
    return difference


def _weight(parent: ET.Element) -> None:
    """Add weight, less the centrifugal relief, along +z of the wind axes."""
    weight = child(parent, "product")
    child(weight, "property", "inertia/mass-slugs")
    gravity = child(weight, "difference")
    child(gravity, "property", "accelerations/gravity-ft_sec2")
    relief = child(gravity, "product")
    child(relief, "property", "position/radius-to-vehicle-ft")
    square = child(relief, "pow")
    _of("cos", "position/lat-gc-rad", square)
    child(square, "value", "2")
    rotation = child(relief, "sum")
    for rate in "pqr":
        square = child(rotation, "pow")
        difference = child(square, "difference")
        child(difference, "property", f"velocities/{rate}i-rad_sec")
        child(difference, "property", f"velocities/{rate}-rad_sec")
        child(square, "value", "2")
    direction = child(weight, "sum")
    product = child(direction, "product")
    for function, angle in (("cos", "aero/alpha-rad"), ("cos", "attitude/phi-rad"), ("cos", "attitude/theta-rad")):
        _of(function, angle, product)
    product = child(direction, "product")
    _of("sin", "aero/alpha-rad", product)
    _of("sin", "attitude/theta-rad", product)

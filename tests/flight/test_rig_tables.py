"""Two roads to the rig: JSBSim, and the aircraft's tables read from its XML and interpolated here."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
import pytest

from finback.flight.plan import FlightPlan
from finback.flight.rig import Rig
from finback.records import Condition, Outcome
from finback.units import from_si

MakePlan = Callable[..., FlightPlan]
Properties = dict[str, float]

SAME = 1e-11  # relative to the largest rate: products and sums in another order
FLOWN_RAD = 5e-4  # the requirement for tabulated high-alpha flights at the default step; measured: 3e-5
AIRSPEED_M_S = 1e-4  # the requirement, over 20 s


Evaluate = Callable[[Properties], float]

OPERATORS: dict[str, Callable[[list[float]], float]] = {
    "product": math.prod,
    "sum": math.fsum,
    "difference": lambda parts: parts[0] - math.fsum(parts[1:]),
    "quotient": lambda parts: parts[0] / parts[1],
    "max": max,
    "min": min,
    "pow": lambda parts: math.pow(*parts),
    "sin": lambda parts: math.sin(*parts),
    "cos": lambda parts: math.cos(*parts),
    "abs": lambda parts: abs(*parts),
    "function": lambda parts: parts[0],
}


def reader(element: ET.Element) -> Evaluate:
    """Return what a part of an aerodynamic function is worth, as the file format defines it."""
    text, name = (element.text or "").strip(), element.get("name", "")
    if element.tag in ("property", "p"):
        return (lambda known: -known[text[1:].strip()]) if text.startswith("-") else (lambda known: known[text])
    if element.tag in ("value", "v"):
        number = float(text)
        return lambda _: number
    if element.tag == "table":
        look = interpolation(element)
    else:
        parts = [reader(part) for part in element if part.tag != "description"]
        operator = OPERATORS[element.tag]

        def look(known: Properties) -> float:
            return operator([part(known) for part in parts])

    def named(known: Properties) -> float:
        known[name] = look(known)
        return known[name]

    return named if name else look


def interpolation(table: ET.Element) -> Evaluate:
    axes = [(axis.text or "").strip() for axis in table.findall("independentVar")]
    lines = [line.split() for line in table.findtext("tableData", "").strip().splitlines()]
    rows = [[float(word) for word in line] for line in lines if line]
    if len(axes) == 1:
        keys, values = np.array(rows).T.copy()
        return lambda known: float(np.interp(known[axes[0]], keys, values))
    columns, body = np.array(rows[0]), np.array(rows[1:])

    def two(known: Properties) -> float:
        across = [float(np.interp(known[axes[1]], columns, row)) for row in body[:, 1:]]
        return float(np.interp(known[axes[0]], body[:, 0], across))

    return two


class Tables:
    """The pitching aircraft of an XML file: q - L/(mV) + g/V and M/Iyy."""

    def __init__(self, rig: Rig, condition: Condition) -> None:
        self.condition, self.rig = condition, rig
        aerodynamics = ET.parse(rig.model).getroot().find("aerodynamics")  # noqa: S314 - our own file
        assert aerodynamics is not None
        axes = sorted(aerodynamics.findall("axis"), key=lambda axis: axis.get("name") == "PITCH")  # forces first
        self.outside = [reader(function) for function in aerodynamics.findall("function")]
        self.axes = {axis.get("name"): [reader(part) for part in axis.findall("function")] for axis in axes}
        names = ("metrics/Sw-sqft", "metrics/cbarw-ft", "metrics/bw-ft", "inertia/mass-slugs", "inertia/iyy-slugs_ft2",
                 "metrics/aero-rp-x-in", "metrics/aero-rp-z-in", "inertia/cg-x-in", "inertia/cg-z-in")  # fmt: skip
        self.fixed = rig._simulator.read(names)
        self.held = rig._simulator.read(
            {(part.text or "").strip().removeprefix("-") for tag in ("property", "p", "independentVar")
             for part in aerodynamics.iter(tag)}
        )  # fmt: skip

    def rates(self, alpha: float, q: float, elevator: float) -> tuple[float, float]:
        """Return (alpha_dot, q_dot) in rad/s and rad/s²."""
        speed = from_si(self.condition.airspeed_m_s, "ft_s")
        pressure = 0.5 * from_si(self.condition.density_kg_m3, "slug_ft3") * speed**2
        known = {
            **self.held, **self.fixed, "aero/alpha-rad": alpha, "aero/alpha-deg": math.degrees(alpha),
            "aero/qbar-psf": pressure, "velocities/q-rad_sec": q, "velocities/q-aero-rad_sec": q,
            "fcs/elevator-pos-rad": elevator, "fcs/elevator-pos-deg": math.degrees(elevator),
            "aero/ci2vel": self.fixed["metrics/cbarw-ft"] / (2 * speed), "velocities/vt-fps": speed,
            "velocities/qi-rad_sec": q,
        }  # fmt: skip
        for function in self.outside:
            function(known)
        totals = {name: math.fsum(part(known) for part in parts) for name, parts in self.axes.items()}
        lift, drag = totals["LIFT"], totals["DRAG"]
        x = -drag * math.cos(alpha) + lift * math.sin(alpha)
        z = -drag * math.sin(alpha) - lift * math.cos(alpha)
        forward = (known["inertia/cg-x-in"] - known["metrics/aero-rp-x-in"]) / 12.0
        down = (known["inertia/cg-z-in"] - known["metrics/aero-rp-z-in"]) / 12.0
        moment = totals["PITCH"] + down * x - forward * z
        g = from_si(self.condition.gravity_m_s2, "ft_s2")
        return (
            q - lift / (known["inertia/mass-slugs"] * speed) + g / speed,
            moment / known["inertia/iyy-slugs_ft2"],
        )


def test_the_rates_are_those_of_the_tables(rig: Rig, condition: Condition) -> None:
    tables = Tables(rig, condition)
    for alpha, q, elevator in np.random.default_rng(9).uniform((-0.6, -1.0, -0.5), (0.9, 1.0, 0.4), (100, 3)):
        expected, found = tables.rates(alpha, q, elevator), rig.derivatives(alpha, q, elevator)
        assert found == pytest.approx(expected, rel=SAME, abs=SAME * max(map(abs, expected))), (alpha, q, elevator)


def test_twenty_seconds_through_stall_are_the_two_equations_integrated(
    rig: Rig, condition: Condition, make_plan: MakePlan
) -> None:
    tables = Tables(rig, condition)
    start, pull = (0.05, -0.52) if rig.aircraft.name == "f8ii" else (0.6, -0.15)
    knots = ((0.0, -0.05), (1.0, -0.05), (2.0, pull), (6.0, pull), (7.0, -0.05))
    plan = make_plan(*knots, alpha=start, duration=20.0, alpha_limits_rad=(-3.0, 3.0))
    record = rig.fly(plan)
    assert record.outcome is Outcome.COMPLETED
    assert record["alpha_rad"].max() > 0.35
    assert np.abs(record["airspeed_m_s"] - condition.airspeed_m_s).max() <= AIRSPEED_M_S
    # Runge and Kutta's fourth order by two samples: the corners of tables leave some 1e-6 rad.
    step, rows = 0.02, range(0, len(record) - 2, 2)
    x = np.array([start, 0.0])
    exact = [x]
    for row in rows:
        time = record["time_s"][row] + np.array([0.0, 0.5, 0.5, 1.0]) * step
        slope, total = np.zeros(2), np.zeros(2)
        for t, share, weight in zip(time, (0.0, 0.5, 0.5, 1.0), (1.0, 2.0, 2.0, 1.0), strict=True):
            slope = np.array(tables.rates(*(x + share * step * slope), float(plan.schedule.value(t))))
            total += weight * slope
        x = x + step / 6.0 * total
        exact.append(x)
    assert np.abs(record["alpha_rad"][::2] - np.array(exact)[:, 0]).max() <= FLOWN_RAD

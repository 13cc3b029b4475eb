"""Build the JSBSim files of the F-8 II, or of the one with realistic lift, from the identified model and the tables.

Reads ``published.toml``, ``reference.toml``, ``data/*.csv`` and the templates ``*.xml.in`` in ``aircraft/f8ii`` and
writes ``f8ii.xml`` and ``Engines/*.xml``. With ``--lift DIR`` it writes the variant of that folder, whose lift is its
own and whose equilibria and folds are the same. Inside ``extension.paper_deg`` the tables are the identified model;
outside they run over, value and slope continuous, into the estimates of ``data/longitudinal.csv``. Only basic
arithmetic of Python floats is used, so that every machine writes the same bytes.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import textwrap
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final, final

from f8ii_inputs import Settings, read_columns

from finback.errors import FinbackError, InputError
from finback.files import write_text
from finback.units import from_si, to_si

AIRCRAFT: Final = Path(__file__).resolve().parent.parent / "aircraft" / "f8ii"
DESCRIPTION: Final = (
    "F-8 II-like aircraft: identified pitch model of Shi and Fan (2013) inside a complete 6-DOF estimate"
)
REALISTIC: Final = (
    "F-8 II-like aircraft: folds and equilibria of the model of Shi and Fan (2013), realistic lift, 6-DOF estimate"
)
JSBSIM_LB_PER_SLUG: Final = 32.174049
"""By this JSBSim 1.3 divides pounds to get slugs, which count; the exact quotient differs in the ninth digit."""
EARTH_RADIUS_M: Final = 6356766.0
"""Of the standard atmosphere: geometric height = geopotential height / (1 - geopotential height / radius)."""
LATERAL: Final = tuple(
    f"{axis}_{cause}"
    for axis, causes in (
        ("CY", "beta p r rudder"),
        ("Cl", "beta p r aileron rudder"),
        ("Cn", "beta p r aileron rudder"),
    )
    for cause in causes.split()
)

Table = list[tuple[float, float]]
"""(breakpoint, value), breakpoints rising."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """The identified model as coefficients of the reference condition; polynomials in alpha [deg], lowest power first.

    dα/dt = q - CL_total / lift_time + g / V and d²θ/dt² = Cm_total / moment_time2, with rate derivatives referred to
    rate * chord / (2 V). No thrust is in CL.
    """

    lift_time_s: float
    moment_time2_s2: float
    half_chord_time_s: float
    weight_rate_rad_s: float
    CL: tuple[float, ...]
    CL_elevator: float
    CL_q: float
    Cm: tuple[float, ...]
    Cm_elevator: float
    Cm_rate: float


TERMS: Final = ("constant", "alpha", "alpha2", "alpha3")


def coefficients(published: Settings, reference: Settings) -> Coefficients:
    """Convert the identified model, in degrees, at the reference condition."""
    speed = reference.positive("condition.airspeed_m_s")
    pressure = reference.positive("condition.density_kg_m3") * speed * speed / 2.0
    force = pressure * reference.positive("geometry.wing_area_m2")
    chord = reference.positive("geometry.chord_m")
    lift_time = reference.positive("mass.total_kg") * speed / force
    moment_time2 = reference.positive("mass.pitch_inertia_kg_m2") / (force * chord)
    half_chord_time = chord / (2.0 * speed)
    weight_rate = reference.number("condition.gravity_m_s2") / speed
    z_q, z_elevator, *z = published.coefficients("alpha_dot_deg_s", ("q", "elevator", *TERMS))
    m_rate, m_elevator, *m = published.coefficients("q_dot_deg_s2", ("q_plus_alpha_dot", "elevator", *TERMS))
    lift = [-lift_time * to_si(term, "deg_s") for term in z]
    lift[0] += lift_time * weight_rate
    return Coefficients(
        lift_time_s=lift_time,
        moment_time2_s2=moment_time2,
        half_chord_time_s=half_chord_time,
        weight_rate_rad_s=weight_rate,
        CL=tuple(lift),
        CL_elevator=-lift_time * z_elevator,
        CL_q=lift_time * (1.0 - z_q) / half_chord_time,
        Cm=tuple(moment_time2 * to_si(term, "deg_s2") for term in m),
        Cm_elevator=moment_time2 * m_elevator,
        Cm_rate=moment_time2 * m_rate / half_chord_time,
    )


def polynomial(terms: Sequence[float], x: float) -> tuple[float, float]:
    """Return value and slope of a polynomial, lowest power first (Horner)."""
    value = slope = 0.0
    for term in reversed(terms):
        slope = slope * x + value
        value = value * x + term
    return value, slope


def hermite(x: float, left: tuple[float, float, float], right: tuple[float, float, float]) -> tuple[float, float]:
    """Return value and slope at ``x`` of the cubic through two points (breakpoint, value, slope)."""
    width = right[0] - left[0]
    t = (x - left[0]) / width
    rise = right[1] - left[1]
    bend = width * (left[2] + right[2]) - 2.0 * rise
    linear = width * left[2]
    square = rise - linear - bend
    return left[1] + t * (linear + t * (square + t * bend)), (linear + t * (2.0 * square + 3.0 * t * bend)) / width


def periodic_curve(alpha: Sequence[float], values: Sequence[float]) -> Callable[[float], tuple[float, float]]:
    """Return value and slope of a smooth curve through the points of the full circle, without overshoot.

    Piecewise cubic with the harmonic-mean slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5 (1984) 300).
    """
    x = [alpha[-2] - 360.0, *alpha, alpha[1] + 360.0]
    y = [values[-2], *values, values[1]]
    slopes = [0.0] * len(x)
    for i in range(1, len(x) - 1):
        before, after = x[i] - x[i - 1], x[i + 1] - x[i]
        fall, rise = (y[i] - y[i - 1]) / before, (y[i + 1] - y[i]) / after
        if fall * rise > 0.0:
            near, far = 2.0 * after + before, after + 2.0 * before
            slopes[i] = (near + far) / (near / fall + far / rise)

    def curve(at: float) -> tuple[float, float]:
        i = min(bisect_right(x, at, 1, len(x) - 1), len(x) - 2)
        return hermite(at, (x[i - 1], y[i - 1], slopes[i - 1]), (x[i], y[i], slopes[i]))

    return curve


def joined_curve(
    terms: Sequence[float],
    curve: Callable[[float], tuple[float, float]],
    paper: tuple[float, float],
    blended: tuple[float, float],
) -> Callable[[float], float]:
    """Return the polynomial inside ``paper``, the curve outside ``blended``, and between the curve plus a cubic.

    The cubic takes up the difference of value and slope at the polynomial's end and vanishes, with its slope, at the
    far end.
    """

    def at(point: float) -> float:
        if paper[0] <= point <= paper[1]:
            return polynomial(terms, point)[0]
        side = 0 if point < paper[0] else 1
        edge, far = paper[side], blended[side]
        if (point - far) * (edge - far) <= 0.0:
            return curve(point)[0]
        gap, kink = (p - c for p, c in zip(polynomial(terms, edge), curve(edge), strict=True))
        return curve(point)[0] + hermite(point, (edge, gap, kink), (far, 0.0, 0.0))[0]

    return at


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """Where the tables follow the model, where the CSV, and the breakpoints; all in deg."""

    path: Path
    paper: tuple[float, float]
    blended: tuple[float, float]
    paper_step: float
    blend_step: float
    outer_step: float

    @classmethod
    def read(cls, reference: Settings) -> Extension:
        """Take the section ``extension``."""
        found = cls(
            path=reference.path,
            paper=reference.interval("extension.paper_deg"),
            blended=reference.interval("extension.blended_deg"),
            paper_step=reference.positive("extension.paper_step_deg"),
            blend_step=reference.positive("extension.blend_step_deg"),
            outer_step=reference.positive("extension.outer_step_deg"),
        )
        if not -180.0 < found.blended[0] < found.paper[0] < found.paper[1] < found.blended[1] < 180.0:
            raise InputError(f"{reference.path}: 'extension.blended_deg' must enclose 'extension.paper_deg'")
        return found

    def breakpoints(self, nodes: Sequence[float], *, constant: bool) -> list[float]:
        """Return the breakpoints; those between the ends of the paper's interval only where needed."""
        (low, high), (start, end) = self.paper, self.blended
        outer = self._steps(-180.0, start, "outer") + self._steps(end, 180.0, "outer")
        outer += [node for node in nodes if not start <= node <= end]
        blend = self._steps(start, low, "blend") + self._steps(high, end, "blend")
        inside = [low, high] if constant else self._steps(low, high, "paper")
        return sorted({*outer, *blend, *inside})

    def _steps(self, low: float, high: float, name: str) -> list[float]:
        """Return ``low`` … ``high`` in equal steps, as the doubles nearest to the decimal numbers."""
        step = {"outer": self.outer_step, "blend": self.blend_step, "paper": self.paper_step}[name]
        count = round((high - low) / step)
        if count < 1 or abs(low + count * step - high) > 1e-9:
            place = f"{self.path}: 'extension.{name}_step_deg'"
            raise InputError(f"{place}: {low!r} … {high!r} is no whole number of steps of {step!r}")
        return [round(low + index * step, 9) for index in range(count + 1)]

    def table(self, terms: Sequence[float], alpha: Sequence[float], values: Sequence[float]) -> Table:
        """Return the polynomial inside, the curve through the values outside, and a blend between."""
        at = joined_curve(terms, periodic_curve(alpha, values), self.paper, self.blended)
        return [(point, at(point)) for point in self.breakpoints(alpha, constant=len(terms) == 1)]


def longitudinal_tables(model: Coefficients, extension: Extension, path: Path) -> dict[str, Table]:
    """Return the tables of CL, CD, Cm and their derivatives over the full circle."""
    inside = {
        "CL": model.CL,
        "CL_elevator": (model.CL_elevator,),
        "CL_q": (model.CL_q,),
        "Cm": model.Cm,
        "Cm_elevator": (model.Cm_elevator,),
        "Cm_q": (model.Cm_rate,),
        "Cm_alpha_dot": (model.Cm_rate,),
    }
    column = {name: name if name in ("CL", "Cm") else f"{name}_per_rad" for name in inside}
    columns = read_columns(path, "alpha_deg", "CD", *column.values())
    alpha = columns["alpha_deg"]
    if (alpha[0], alpha[-1]) != (-180.0, 180.0):
        raise InputError(f"{path}: alpha_deg must run from -180 to 180")
    for name, values in columns.items():
        if name != "alpha_deg" and values[0] != values[-1]:
            raise InputError(f"{path}: {name} must be the same at -180 and 180 deg")
    tables = {name: extension.table(terms, alpha, columns[column[name]]) for name, terms in inside.items()}
    return {**tables, "CD": list(zip(alpha, columns["CD"], strict=True))}


def with_realistic_lift(tables: dict[str, Table], model: Coefficients, variant: Path) -> dict[str, Table]:
    """Return the tables with the variant's lift, and the pitching moment that keeps every equilibrium of alpha and q.

    In an equilibrium dα/dt = 0, so q = (CL - L g/V) / (L Zq) with Zq = 1 - h CL_q / L, and Cm + h Cm_q q + ... = 0:
    the elevator that holds alpha stays the same if Cm changes by -h Cm_q / (L Zq) times the change of CL. Where CL_q
    and Cm_q are constant this holds between the breakpoints too. Damping changes: it is not in an equilibrium.
    """
    own = Settings.read(variant / "reference.toml")
    paper, blended = own.interval("lift.paper_deg"), own.interval("lift.blended_deg")
    if not -180.0 < blended[0] < paper[0] < paper[1] < blended[1] < 180.0:
        raise InputError(f"{own.path}: 'lift.blended_deg' must enclose 'lift.paper_deg'")
    columns = read_columns(variant / "data" / "lift.csv", "alpha_deg", "CL")
    if (columns["alpha_deg"][0], columns["alpha_deg"][-1]) != (-180.0, 180.0) or columns["CL"][0] != columns["CL"][-1]:
        raise InputError(f"{variant / 'data' / 'lift.csv'}: CL must run from -180 to 180 deg and be the same at both")
    lift = joined_curve(model.CL, periodic_curve(columns["alpha_deg"], columns["CL"]), paper, blended)
    lifts: Table = []
    moments: Table = []
    for (alpha, before), (_, moment) in zip(tables["CL"], tables["Cm"], strict=True):
        after = lift(alpha)
        damping, turning = (interpolate(tables[name], alpha) for name in ("Cm_q", "CL_q"))
        path = model.lift_time_s - model.half_chord_time_s * turning
        lifts.append((alpha, after))
        moments.append((alpha, moment - model.half_chord_time_s * damping * (after - before) / path))
    return {**tables, "CL": lifts, "Cm": moments}


def interpolate(table: Table, at: float) -> float:
    """Return what JSBSim reads between two breakpoints."""
    index = min(max(bisect_right(table, (at, math.inf)), 1), len(table) - 1)
    (left, low), (right, high) = table[index - 1], table[index]
    return low + (at - left) / (right - left) * (high - low)


def lateral_tables(path: Path) -> dict[str, Table]:
    """Return the lateral-directional tables; JSBSim holds their end values beyond their ends."""
    columns = read_columns(path, "alpha_deg", *(f"{name}_per_rad" for name in LATERAL))
    return {name: list(zip(columns["alpha_deg"], columns[f"{name}_per_rad"], strict=True)) for name in LATERAL}


def table_xml(name: str, table: Table) -> str:
    """Write a table over alpha, readable as the property ``aero/table/<name>``."""
    rows = "\n".join(f"    {alpha!r} {value!r}" for alpha, value in table)
    return (
        f'<table name="aero/table/{name}">\n  <independentVar lookup="row">aero/alpha-deg</independentVar>\n'
        f"  <tableData>\n{rows}\n  </tableData>\n</table>"
    )


def thrust_tables(reference: Settings, data: Path) -> dict[str, str]:
    """Return the thrust tables over Mach number and altitude.

    JSBSim gives idle + (rating - idle) * factor at full dry power, so the factor here is (dry - idle) / (1 - idle).
    """
    dry, reheat = (_read_thrust(data / f"thrust_{rating}.csv") for rating in ("dry", "reheat"))
    idle = reference.number("engine.idle_fraction")
    if not 0.0 <= idle < 0.5:
        raise InputError(f"{reference.path}: 'engine.idle_fraction' must lie in 0 … 0.5, is {idle!r}")
    return {
        "table_idle": _thrust_xml(dry, lambda fraction: idle * fraction),
        "table_dry": _thrust_xml(dry, lambda fraction: (fraction - idle * fraction) / (1.0 - idle * fraction)),
        "table_reheat": _thrust_xml(reheat, lambda fraction: fraction),
    }


def _read_thrust(path: Path) -> tuple[list[float], list[tuple[float, list[float]]]]:
    """Return the geopotential altitudes in m, and for each Mach number the fractions of the rating."""
    columns = read_columns(path)
    altitudes = columns.pop("geopotential_altitude_m", [])
    try:
        rows = [(float(name.removeprefix("mach_")), values) for name, values in columns.items()]
    except ValueError:
        rows = []
    if not altitudes or not rows or any(not low[0] < high[0] for low, high in pairwise(rows)):
        raise InputError(f"{path}: the columns must be geopotential_altitude_m and then mach_<number>, rising")
    return altitudes, rows


def _thrust_xml(table: tuple[list[float], list[tuple[float, list[float]]]], factor: Callable[[float], float]) -> str:
    altitudes, columns = table
    heights = [altitude / (1.0 - altitude / EARTH_RADIUS_M) for altitude in altitudes]  # JSBSim's is geometric
    head = "        " + " ".join(repr(from_si(height, "ft")) for height in heights)
    rows = "\n".join(f"    {mach!r} " + " ".join(repr(factor(value)) for value in values) for mach, values in columns)
    return (
        '<table>\n  <independentVar lookup="row">velocities/mach</independentVar>\n'
        '  <independentVar lookup="column">atmosphere/density-altitude</independentVar>\n'
        f"  <tableData>\n{head}\n{rows}\n  </tableData>\n</table>"
    )


def constants(reference: Settings) -> dict[str, str]:
    """Return the single numbers of the templates, in JSBSim's units."""
    number, positive, interval = reference.number, reference.positive, reference.interval
    total, fuel = positive("mass.total_kg"), positive("mass.fuel_kg")
    if fuel >= total:
        raise InputError(f"{reference.path}: 'mass.fuel_kg' must be below 'mass.total_kg'")
    values = {
        "wing_area_ft2": from_si(positive("geometry.wing_area_m2"), "ft2"),
        "span_ft": from_si(positive("geometry.span_m"), "ft"),
        "chord_ft": from_si(positive("geometry.chord_m"), "ft"),
        "empty_lb": from_si(total - fuel, "slug") * JSBSIM_LB_PER_SLUG,
        "fuel_lb": from_si(fuel, "slug") * JSBSIM_LB_PER_SLUG,
        "engine_arm_ft": from_si(positive("engine.lateral_arm_m"), "ft"),
        "nozzle_arm_ft": from_si(number("engine.nozzle_arm_m"), "ft"),
        "normal_bandwidth_rad_s": positive("stabilator.normal.bandwidth_rad_s"),
    }
    for axis in ("roll", "pitch", "yaw", "product"):
        values[f"{axis}_inertia_slug_ft2"] = from_si(number(f"mass.{axis}_inertia_kg_m2"), "slug_ft2")
    surfaces = ("stabilator.normal", "stabilator.research", "aileron", "rudder")
    for surface in surfaces:
        low, high = interval(f"{surface}.limits_deg")
        if not low < 0.0 < high:
            raise InputError(f"{reference.path}: '{surface}.limits_deg' must enclose 0, the surface of zero command")
        name = surface.removeprefix("stabilator.")
        values[f"{name}_min_rad"], values[f"{name}_max_rad"] = to_si(low, "deg"), to_si(high, "deg")
        values[f"{name}_rate_rad_s"] = to_si(positive(f"{surface}.rate_deg_s"), "deg")
    values["trim_alpha_min_deg"], values["trim_alpha_max_deg"] = interval("trim.alpha_deg")
    return {name: repr(value) for name, value in values.items()}


def engine_constants(reference: Settings) -> dict[str, str]:
    """Return the single numbers of the engine's template, in JSBSim's units."""
    values = {f"{r}_thrust_lbf": to_si(reference.positive(f"engine.{r}_thrust_kn"), "kn") for r in ("dry", "reheat")}
    values = {name: from_si(thrust, "lbf") for name, thrust in values.items()}
    for name in ("dry_fuel_1_h", "reheat_fuel_1_h", "idle_speed_percent", "spool_percent_s"):
        values[name] = reference.positive(f"engine.{name}")
    return {name: repr(value) for name, value in values.items()}


def render(path: Path, values: Mapping[str, str]) -> str:
    """Fill the placeholders ``${name}`` of a template; one alone on its line hands its indentation to every line."""
    template = path.read_text(encoding="utf-8")
    names = set(re.findall(r"\$\{(\w+)\}", template))
    if names != set(values):
        odd = ", ".join(sorted(names ^ set(values)))
        raise InputError(f"{path}: placeholder without a value, or value without a placeholder: {odd}")
    return re.sub(
        r"^( *)\$\{(\w+)\}$|\$\{(\w+)\}",
        lambda found: textwrap.indent(values[found[2]], found[1]) if found[2] else values[found[3]],
        template,
        flags=re.MULTILINE,
    )


def build(source: Path, published: Path, variant: Sequence[Path] = ()) -> dict[str, str]:
    """Return the text of every file, by its path within the aircraft's folder; nothing is written.

    ``variant``: the folder of the variant with realistic lift, if that is built.
    """
    reference = Settings.read(source / "reference.toml")
    model = coefficients(Settings.read(published), reference)
    tables = longitudinal_tables(model, Extension.read(reference), source / "data" / "longitudinal.csv")
    name, description = "f8ii", DESCRIPTION
    for folder in variant:
        tables, name, description = with_realistic_lift(tables, model, folder), folder.resolve().name, REALISTIC
    tables |= lateral_tables(source / "data" / "lateral.csv")
    note = {"generated_note": "Built by scripts/build_f8ii.py: edit the template or the data, not this file."}
    airframe = (
        note
        | {"name": name, "description": description}
        | constants(reference)
        | {f"table_{key}": table_xml(key, table) for key, table in tables.items()}
    )
    engine = note | engine_constants(reference) | thrust_tables(reference, source / "data")
    nozzle = "Engines/wp-13a-ii-nozzle.xml"
    return {
        f"{name}.xml": render(source / "f8ii.xml.in", airframe),
        "Engines/wp-13a-ii.xml": render(source / "Engines" / "wp-13a-ii.xml.in", engine),
        nozzle: (source / nozzle).read_text(encoding="utf-8"),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Build, or with ``--check`` compare; 0 done or equal, 1 different, 2 something to mend."""
    parser = argparse.ArgumentParser(description="Build the JSBSim files of the F-8 II.")
    parser.add_argument("--source", type=Path, default=AIRCRAFT, metavar="DIR", help="templates, reference.toml, data/")
    parser.add_argument("--published", type=Path, metavar="PATH", help="the identified model (published.toml of DIR)")
    parser.add_argument("--lift", type=Path, metavar="DIR", help="build the variant of this folder, with its own lift")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="folder to write to (default: the source or variant)"
    )
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if the files there differ")
    options = parser.parse_args(arguments)
    output: Path = options.output or options.lift or options.source
    variant = (options.lift,) if options.lift else ()
    try:
        files = build(options.source, options.published or options.source / "published.toml", variant)
        if options.check:
            return check(output, files)
        for name, text in files.items():
            (output / name).parent.mkdir(parents=True, exist_ok=True)
            write_text(output / name, text)
    except (FinbackError, OSError) as error:
        print(f"build_f8ii: {error}", file=sys.stderr)
        return 2
    return 0


def check(output: Path, files: Mapping[str, str]) -> int:
    """Name the files that differ from what would be built."""
    differing = [
        name
        for name, text in files.items()
        if not (output / name).is_file() or (output / name).read_bytes() != text.encode()
    ]
    for name in differing:
        print(f"build_f8ii: {output / name} differs; run scripts/build_f8ii.py", file=sys.stderr)
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())

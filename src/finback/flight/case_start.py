"""How a case begins: names and units of ours, made into JSBSim's initial condition and read back from its start.

JSBSim's own initial conditions depend on the order in which they are written, alias angles of attack beyond 90° and
take a wind twice; so attitude and velocity are computed here, written as Euler angles and velocities over the ground,
and what the start made of them is compared with what was asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.flight.flow_angles import air_velocity, alpha_of, body_to_local, theta_of
from finback.units import from_si, quantity_of, si_unit, to_si, unit_of

_PLACES: Final = ("latitude", "geocentric_latitude", "ecef")
_HEIGHTS: Final = ("altitude", "geodetic_altitude", "height", "ecef")
_VELOCITIES: Final = ("air", "body", "local", "ecef_velocity")
_RATES: Final = ("rates", "inertial_rates")

# Quantity -> where the start shows it, that property's unit, and which of several ways to say the same it belongs to.
_STARTS: Final = {
    "terrain": ("ic/terrain-elevation-ft", "ft", ()),
    "latitude": ("position/lat-geod-rad", "rad", ("latitude",)),
    "geocentric_latitude": ("position/lat-gc-rad", "rad", ("geocentric_latitude",)),
    "longitude": ("position/long-gc-rad", "rad", ()),
    "altitude": ("position/h-sl-ft", "ft", ("altitude",)),
    "geodetic_altitude": ("position/geod-alt-ft", "ft", ("geodetic_altitude",)),
    "height": ("position/h-agl-ft", "ft", ("height",)),
    "ecef_x": ("position/ecef-x-ft", "ft", ("ecef",)),
    "ecef_y": ("position/ecef-y-ft", "ft", ("ecef",)),
    "ecef_z": ("position/ecef-z-ft", "ft", ("ecef",)),
    "phi": ("attitude/phi-rad", "rad", ()),
    "theta": ("attitude/theta-rad", "rad", ()),
    "psi": ("attitude/psi-rad", "rad", ()),
    "wind_north": ("atmosphere/wind-north-fps", "ft_s", ()),
    "wind_east": ("atmosphere/wind-east-fps", "ft_s", ()),
    "airspeed": ("velocities/vtrue-fps", "ft_s", ("air",)),
    "mach": ("velocities/mach", "1", ("air",)),
    "alpha": ("aero/alpha-rad", "rad", ("air",)),
    "beta": ("aero/beta-rad", "rad", ("air",)),
    "gamma": ("flight-path/gamma-rad", "rad", ("air",)),
    "u": ("velocities/u-fps", "ft_s", ("body",)),
    "v": ("velocities/v-fps", "ft_s", ("body",)),
    "w": ("velocities/w-fps", "ft_s", ("body",)),
    "velocity_north": ("velocities/v-north-fps", "ft_s", ("local",)),
    "velocity_east": ("velocities/v-east-fps", "ft_s", ("local",)),
    "velocity_down": ("velocities/v-down-fps", "ft_s", ("local",)),
    "velocity_ecef_x": ("velocities/ecef-x", "ft_s", ("ecef_velocity",)),
    "velocity_ecef_y": ("velocities/ecef-y", "ft_s", ("ecef_velocity",)),
    "velocity_ecef_z": ("velocities/ecef-z", "ft_s", ("ecef_velocity",)),
    "p": ("velocities/p-rad_sec", "rad_s", ("rates",)),
    "q": ("velocities/q-rad_sec", "rad_s", ("rates",)),
    "r": ("velocities/r-rad_sec", "rad_s", ("rates",)),
    "inertial_p": ("velocities/pi-rad_sec", "rad_s", ("inertial_rates",)),
    "inertial_q": ("velocities/qi-rad_sec", "rad_s", ("inertial_rates",)),
    "inertial_r": ("velocities/ri-rad_sec", "rad_s", ("inertial_rates",)),
}
_QUARTER: Final = math.pi / 2
_TURN: Final = 2.0 * math.pi
_RANGES: Final = {
    "latitude": (-_QUARTER, _QUARTER),
    "geocentric_latitude": (-_QUARTER, _QUARTER),
    "longitude": (-_TURN, _TURN),
    "phi": (-_TURN, _TURN),
    "theta": (-_QUARTER, _QUARTER),
    "psi": (-_TURN, _TURN),
    "alpha": (-math.pi, math.pi),
    "beta": (-_QUARTER, _QUARTER),
    "gamma": (-_QUARTER, _QUARTER),
    "airspeed": (0.0, math.inf),
    "mach": (0.0, math.inf),
    "altitude": (-12e3, math.inf),  # m: nothing flies below the deepest sea
    "geodetic_altitude": (-12e3, math.inf),
}
_AROUND: Final = ("longitude", "phi", "psi", "alpha")
"""Compared around the circle."""
_UNSEEN: Final = ("terrain", "velocity_ecef_x", "velocity_ecef_y", "velocity_ecef_z")
"""JSBSim shows no such property after the start."""
_PLACE_M: Final = 0.01  # JSBSim's places are differences from the planet's radius
_RELATIVE: Final = 1e-6
_LEVEL: Final = 1e-6  # of cos(theta): nearer to the vertical, roll and heading are one angle
_CORRECTIONS: Final = 4  # of an altitude: each takes off all but the flattening, 3e-3


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """What a start needs of JSBSim, in JSBSim's units.

    Attributes:
        read: a property's value.
        write: takes a property and its value.
        evaluate: makes what was written the state.
    """

    read: Callable[[str], float]
    write: Callable[[str, float], None]
    evaluate: Callable[[], None]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CaseStart:
    """Initial conditions by name; what is not given stays as the script or the initialization file has it, or 0.

    Attributes:
        given: quantity and value in SI, each quantity once.
    """

    given: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        """Check what was given."""
        names = [name for name, _ in self.given]
        for name, value in self.given:
            low, high = _RANGES.get(name, (-math.inf, math.inf))
            if math.isfinite(value) and low <= value <= high:
                continue
            unit = _shown(_STARTS[name][1])
            limits = f"at least {from_si(low, unit):.6g}"
            if high < math.inf:
                limits = f"between {from_si(low, unit):.6g} and {from_si(high, unit):.6g}"
            raise InputError(
                f"a start with {name} = {from_si(value, unit):.9g} {unit}",
                hint=f"it is {limits} {unit}" if math.isfinite(value) else "give a finite number",
            )
        if "airspeed" in names and "mach" in names:
            raise InputError("airspeed and mach say the same twice", hint="give one of them")
        for ways in (_PLACES, _HEIGHTS, _VELOCITIES, _RATES):
            used = {way: [name for name in names if way in _STARTS[name][2]] for way in ways}
            said = [names for names in used.values() if names]
            if len(said) > 1:
                raise InputError(
                    f"{', '.join(said[0])} and {', '.join(said[1])} say the same twice", hint="give one or the other"
                )
        if "longitude" in names and any(name.startswith("ecef_") for name in names):
            raise InputError("ecef_x … and longitude say the same twice", hint="give one or the other")
        if "gamma" in names and any(name.startswith("wind_") for name in names):
            raise InputError("a wind with gamma, which would depend on it", hint="give theta and alpha, or velocities")

    @property
    def moves(self) -> bool:
        """Whether it says anything of the velocity."""
        return any(way in _VELOCITIES for name, _ in self.given for way in _STARTS[name][2])

    def put(self, access: Access, wind_at: Callable[[float], Mapping[str, float]]) -> None:
        """Write the initial condition.

        Args:
            access: to JSBSim, loaded, with the initial condition of its files.
            wind_at: ``wind_north``, ``wind_east`` in m/s at an altitude in ft, as a schedule or a profile has them.

        Raises:
            InputError: no such attitude exists, a wind is given twice, or gamma with a wind.
        """
        given = dict(self.given)
        _put_place(given, access)
        winds = {name: value for name, value in given.items() if name.startswith("wind_")}
        others = wind_at(access.read("ic/h-sl-ft"))
        if winds and others:
            raise InputError("a wind at the start and another one over time", hint="give one of them")
        if not given and not others:
            return
        angles, velocity = _motion(given, access, {**winds, **others})
        for name, angle in zip(("phi-rad", "theta-rad", "psi-true-rad"), angles, strict=True):
            access.write(f"ic/{name}", angle)
        for axis, speed in zip("uvw", velocity, strict=True):
            access.write(f"ic/{axis}-fps", from_si(float(speed), "ft_s"))
        _put_rates(given, access)

    def missed(self, read: Callable[[str], float]) -> tuple[str, ...]:
        """Return what the start has made otherwise than asked for, a sentence each; empty if all is well.

        Args:
            read: a property after the start, in JSBSim's unit.
        """
        upright = math.cos(read("attitude/theta-rad")) > _LEVEL
        said = []
        for name, wanted in self.given:
            place, unit, _ = _STARTS[name]
            if name in _UNSEEN or (name in {"phi", "psi"} and not upright):
                continue
            found = to_si(read(place), unit)
            off = found - wanted
            if name in _AROUND:
                off = math.remainder(off, _TURN)
            if not abs(off) <= (_PLACE_M if si_unit(unit) == "m" else _RELATIVE * max(1.0, abs(wanted))):
                shown = _shown(unit)
                said.append(f"{name} is {from_si(found, shown):.9g} {shown}, not {from_si(wanted, shown):.9g}")
        return tuple(said)


AS_IT_IS: Final = CaseStart()
"""What the script or the initialization file says, or all 0."""


def case_start(given: Iterable[tuple[str, float]]) -> CaseStart:
    """Return a start from names with units: ``alpha_deg``, ``airspeed_kt``, ``altitude_ft`` … -> value.

    Raises:
        InputError: a name is unknown, has no unit or one of another quantity, is given twice or cannot be met.
    """
    known: dict[str, float] = {}
    for name, value in given:
        quantity, unit = ("mach", "1") if name == "mach" else (quantity_of(name), unit_of(name))
        if quantity not in _STARTS:
            near = get_close_matches(quantity, _STARTS, n=1, cutoff=0.5)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(_STARTS)}"
            raise InputError(f"no initial condition is called '{quantity}'", hint=hint)
        if quantity in known:
            raise InputError(f"'{quantity}' is given twice")
        own = _STARTS[quantity][1]
        if si_unit(unit) != si_unit(own):
            raise InputError(f"'{name}': '{unit}' does not measure {quantity}", hint=f"as in '{quantity}_{own}'")
        known[quantity] = to_si(value, unit)
    return CaseStart(given=tuple(known.items()))


def _shown(unit: str) -> str:
    """Return the unit in which people read what is measured in ``unit``."""
    return {"rad": "deg", "rad_s": "deg_s"}.get(si_unit(unit), si_unit(unit))


def _put_place(known: Mapping[str, float], access: Access) -> None:
    given = dict(known)
    if any(f"ecef_{axis}" in given for axis in "xyz"):
        x, y, z = (given.get(f"ecef_{axis}", 0.0) for axis in "xyz")
        given |= {"geocentric_latitude": math.atan2(z, math.hypot(x, y)), "longitude": math.atan2(y, x)}
    for name, place in (
        ("terrain", "ic/terrain-elevation-ft"),
        ("latitude", "ic/lat-geod-rad"),
        ("geocentric_latitude", "ic/lat-gc-rad"),
        ("longitude", "ic/long-gc-rad"),
        ("altitude", "ic/h-sl-ft"),
        ("height", "ic/h-agl-ft"),
    ):
        if name in given:
            access.write(place, from_si(given[name], "ft") if place.endswith("-ft") else given[name])
    for _ in range(_CORRECTIONS if "geodetic_altitude" in given else 0):
        missing = from_si(given["geodetic_altitude"], "ft") - access.read("ic/geod-alt-ft")
        access.write("ic/h-sl-ft", access.read("ic/h-sl-ft") + missing)
    for _ in range(_CORRECTIONS if "ecef_x" in given or "ecef_y" in given or "ecef_z" in given else 0):
        access.evaluate()
        found = math.hypot(*(access.read(f"position/ecef-{axis}-ft") for axis in "xyz"))
        wanted = from_si(math.hypot(*(given.get(f"ecef_{axis}", 0.0) for axis in "xyz")), "ft")
        access.write("ic/h-sl-ft", access.read("ic/h-sl-ft") + wanted - found)


def _motion(given: Mapping[str, float], access: Access, winds: Mapping[str, float]) -> tuple[list[float], FloatArray]:
    """Return phi, theta, psi in rad, and the velocity over the ground in body axes in m/s; write the wind."""

    def known(name: str, place: str, unit: str) -> float:
        return given[name] if name in given else to_si(access.read(place), unit)

    phi, theta, psi = (
        known(name, place, "rad")
        for name, place in (("phi", "ic/phi-rad"), ("theta", "ic/theta-rad"), ("psi", "ic/psi-true-rad"))
    )
    alpha, beta = known("alpha", "ic/alpha-rad", "rad"), known("beta", "ic/beta-rad", "rad")
    gamma, speed = known("gamma", "ic/gamma-rad", "rad"), known("airspeed", "ic/vt-fps", "ft_s")
    body = np.array([known(axis, f"ic/{axis}-fps", "ft_s") for axis in "uvw"])
    local = np.array([known(f"velocity_{way}", f"ic/v{way[0]}-fps", "ft_s") for way in ("north", "east", "down")])
    north, east = (
        winds.get(f"wind_{way}", to_si(access.read(f"ic/vw-{way}-fps"), "ft_s")) for way in ("north", "east")
    )
    if "gamma" in given and (north or east):  # of a profile, a schedule or an initialization file
        raise InputError("a wind with gamma, which would depend on it", hint="give theta and alpha, or velocities")
    if winds:  # JSBSim's start has its size and where it blows to
        access.write("ic/vw-mag-fps", from_si(math.hypot(north, east), "ft_s"))
        access.write("ic/vw-dir-deg", from_si(math.atan2(east, north), "deg"))
    if "theta" not in given and ("alpha" in given or "gamma" in given):
        theta = theta_of(alpha=alpha, beta=beta, phi=phi, gamma=gamma)
    elif "gamma" in given and "alpha" not in given:
        alpha = alpha_of(beta=beta, phi=phi, theta=theta, gamma=gamma)
    to_local = body_to_local(phi, theta, psi)
    way = {way for name in given for way in _STARTS[name][2]}
    if "air" in way:
        if "mach" in given:
            access.evaluate()  # at its place; the speed of sound is the air's there
            speed = given["mach"] * to_si(access.read("atmosphere/a-fps"), "ft_s")
        body = air_velocity(speed, alpha, beta) + to_local.T @ np.array([north, east, 0.0])
    elif "local" in way:
        body = to_local.T @ local
    elif "ecef_velocity" in way:
        access.evaluate()
        latitude, longitude = (access.read(f"position/{name}-rad") for name in ("lat-geod", "long-gc"))
        fixed = np.array([given.get(f"velocity_ecef_{axis}", 0.0) for axis in "xyz"])
        # North, east, down are reached from the planet's axes by turning about z, then about y.
        body = to_local.T @ (body_to_local(0.0, -latitude - _QUARTER, longitude).T @ fixed)
    return [phi, theta, psi], body


def _put_rates(given: Mapping[str, float], access: Access) -> None:
    for axis in "pqr":
        if axis in given:
            access.write(f"ic/{axis}-rad_sec", given[axis])
    turning = [axis for axis in "pqr" if f"inertial_{axis}" in given]
    if turning:
        access.evaluate()
    for axis in turning:
        planet = access.read(f"velocities/{axis}i-rad_sec") - access.read(f"velocities/{axis}-rad_sec")
        access.write(f"ic/{axis}-rad_sec", given[f"inertial_{axis}"] - planet)

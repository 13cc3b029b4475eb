"""Six degrees of freedom against an integrator written here, in inertial space: quaternion, WGS 84, ISO 2533.

The check cases of six-degree-of-freedom simulators (a dropped sphere with and without drag, cannonballs north and east,
wind, a tumbling body with and without damping) are flown as ``finback fly`` flies them; ``symmetric`` and ``free``
fly an aircraft whose every coefficient stands here once more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from finback.cli.case_request import CaseRequest
from finback.flight.airborne import Airborne
from finback.flight.aircraft import find_aircraft
from finback.flight.case import Case
from finback.flight.case_flight import fly_case
from finback.flight.case_start import case_start
from finback.flight.plan import Drive, FlightOptions, FlightPlan
from finback.flight.start import FreeStart, SymmetricStart
from finback.pipeline import compare
from finback.records import Condition
from finback.store.case_file import save_case
from finback.validation.metric import Judgement

Array = np.ndarray
MakePlan = Callable[..., FlightPlan]
AIRCRAFT = Path(__file__).parent / "data" / "aircraft"
FOOT_M = 0.3048
FOOT_POUND = 1.3558179483314004  # N m
GM, J2, EQUATOR_M, FLATTENING, TURN_RAD_S = 3.986004418e14, 1.08262982e-3, 6378137.0, 1 / 298.257223563, 7.292115e-5
STILL_RADIUS_M, STANDARD_GRAVITY_M_S2 = 6356766.0, 9.80665
"""Of the sphere at rest that ``symmetric`` flies over: that of the standard atmosphere."""
POSITION_M, VELOCITY_M_S = 0.02, 2e-3
"""20 s at 200 Hz: 9e-3 m and 5e-4 m/s measured for cannonballs, whose first step (Euler's) meets the largest drag."""
VACUUM_M = 1e-4
"""3e-5 m measured."""
TUMBLE_RAD = 1e-4
GLIDER_RAD, GLIDER_M_S, GLIDER_M = 1e-4, 1e-3, 0.01
"""10 s at 400 Hz: 4e-5 (rad, rad/s), 3e-4 m/s, 3e-3 m measured; ISO 2533 and JSBSim's air differ by some 1e-6."""


@dataclass(frozen=True, kw_only=True)
class Planet:
    """An ellipsoid that turns, with gravity to second order."""

    equator_m: float = EQUATOR_M
    flattening: float = FLATTENING
    j2: float = J2
    turn_rad_s: float = TURN_RAD_S
    gm_m3_s2: float = GM

    def place(self, latitude: float, height_m: float) -> Array:
        """Return the place on the meridian of Greenwich."""
        e2 = self.flattening * (2 - self.flattening)
        n = self.equator_m / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
        return np.array([(n + height_m) * np.cos(latitude), 0.0, (n * (1 - e2) + height_m) * np.sin(latitude)])

    def latitude_height(self, place: Array) -> tuple[float, float]:
        """Geodetic, by fixed-point iteration (contraction e² = 0.007: 1e-15 after eight)."""
        e2, rho = self.flattening * (2 - self.flattening), float(np.hypot(place[0], place[1]))
        latitude, n = float(np.arctan2(place[2], rho * (1 - e2))), self.equator_m
        for _ in range(8):
            n = self.equator_m / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
            latitude = float(np.arctan2(place[2] + e2 * n * np.sin(latitude), rho))
        height = rho * np.cos(latitude) + place[2] * np.sin(latitude) - n * (1 - e2 * np.sin(latitude) ** 2)
        return latitude, float(height)

    def gravity(self, place: Array) -> Array:
        """Of mass alone (Vallado, Fundamentals of Astrodynamics, 4th ed., eq. 8-30)."""
        r = float(np.linalg.norm(place))
        z2, scale = 5 * (place[2] / r) ** 2, 1.5 * self.j2 * (self.equator_m / r) ** 2
        return -self.gm_m3_s2 / r**3 * place * (1 - scale * (z2 - np.array([1.0, 1.0, 3.0])))


EARTH = Planet()
STILL = Planet(
    equator_m=STILL_RADIUS_M,
    flattening=0.0,
    j2=0.0,
    turn_rad_s=0.0,
    gm_m3_s2=STANDARD_GRAVITY_M_S2 * STILL_RADIUS_M**2,
)


def air(height_m: float) -> tuple[float, float]:
    """Temperature in K and pressure in Pa below 11 km, ISO 2533."""
    height = 6356766.0 * height_m / (6356766.0 + height_m)
    temperature = 288.15 - 0.0065 * height
    return temperature, 101325.0 * (temperature / 288.15) ** (9.80665 / (287.05287 * 0.0065))


def air_density(height_m: float) -> float:
    """Below 11 km, ISO 2533."""
    temperature, pressure = air(height_m)
    return pressure / (287.05287 * temperature)


def rotation(quaternion: Array) -> Array:
    """Body to inertial, of a quaternion with its scalar first."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def times(one: Array, other: Array) -> Array:
    """Product of quaternions."""
    a, u, b, v = one[0], one[1:], other[0], other[1:]
    return np.concatenate([[a * b - u @ v], a * v + b * u + np.cross(u, v)])


def about(axis: int, angle: float) -> Array:
    found = np.zeros(4)
    found[0], found[1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return found


def level_axes(latitude: float, longitude: float) -> Array:
    """Quaternion from north, east, down to axes through the planet's equator and pole."""
    return times(about(2, longitude), about(1, -latitude - np.pi / 2))


@dataclass(frozen=True, kw_only=True)
class Body:
    """What flies: mass, principal inertia, and aerodynamic force and moment in body axes.

    ``loads`` takes the velocity through the air and the rates to the planet, body axes, and the density.
    """

    mass_kg: float
    inertia: Array
    loads: Callable[[Array, Array, float], tuple[Array, Array]]


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where, how fast over the planet, and which way up a flight begins."""

    latitude: float = 0.0
    height_m: float = 0.0
    north_east_down_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    phi_theta_psi: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rates: tuple[float, float, float] = (0.0, 0.0, 0.0)  # to the planet


def still(_: float) -> Array:
    """No wind."""
    return np.zeros(3)


def integrate(
    planet: Planet, body: Body, start: Start, time: Array, *, wind: Callable[[float], Array] = still
) -> dict[str, Array]:
    """Return what a record has, at the times of its rows; the wind is north, east, down at a height."""
    turn = np.array([0.0, 0.0, planet.turn_rad_s])

    def rates(_: float, y: Array) -> Array:
        r, v, quaternion, omega = y[:3], y[3:6], y[6:10], y[10:]
        to_inertial = rotation(quaternion)
        latitude, height = planet.latitude_height(r)
        moving = v - np.cross(turn, r)
        if wind is not still:
            moving = moving - rotation(level_axes(latitude, float(np.arctan2(r[1], r[0])))) @ wind(height)
        force, moment = body.loads(to_inertial.T @ moving, omega - to_inertial.T @ turn, air_density(height))
        spin = np.concatenate([[0.0], omega])
        return np.concatenate(
            [
                v,
                planet.gravity(r) + to_inertial @ force / body.mass_kg,
                0.5 * times(quaternion, spin),
                (moment - np.cross(omega, body.inertia * omega)) / body.inertia,
            ]
        )

    place = planet.place(start.latitude, start.height_m)
    level = level_axes(start.latitude, 0.0)
    phi, theta, psi = start.phi_theta_psi
    attitude = times(times(times(level, about(2, psi)), about(1, theta)), about(0, phi))
    velocity = rotation(level) @ np.array(start.north_east_down_m_s) + np.cross(turn, place)
    omega = np.array(start.rates) + rotation(attitude).T @ turn
    found = solve_ivp(
        rates, (0.0, float(time[-1])), np.concatenate([place, velocity, attitude, omega]), method="DOP853",
        rtol=1e-10, atol=1e-9, t_eval=np.minimum(time, time[-1]),
    )  # fmt: skip
    assert found.success
    return _as_recorded(planet, found.t, found.y.T)


def _as_recorded(planet: Planet, time: Array, states: Array) -> dict[str, Array]:
    turn, rows = np.array([0.0, 0.0, planet.turn_rad_s]), []
    for t, y in zip(time, states, strict=True):
        to_inertial, angle = rotation(y[6:10]), planet.turn_rad_s * t
        latitude, height = planet.latitude_height(y[:3])
        longitude = float(np.arctan2(y[1], y[0]))
        to_level = rotation(level_axes(latitude, longitude)).T
        moving = y[3:6] - np.cross(turn, y[:3])
        axes = to_level @ to_inertial
        u, v, w = to_inertial.T @ moving
        rows.append(
            [
                *(rotation(about(2, -angle)) @ y[:3]), height, latitude, *(to_level @ moving),
                np.arctan2(axes[2, 1], axes[2, 2]), -np.arcsin(axes[2, 0]), np.arctan2(axes[1, 0], axes[0, 0]),
                np.arctan2(w, u), np.arcsin(v / max(np.linalg.norm(moving), 1e-12)), np.linalg.norm(moving),
                *(y[10:] - to_inertial.T @ turn),
            ]
        )  # fmt: skip
    names = (
        "ecef_x_m ecef_y_m ecef_z_m geodetic_altitude_m latitude_rad velocity_north_m_s velocity_east_m_s"
        " velocity_down_m_s phi_rad theta_rad psi_rad alpha_rad beta_rad airspeed_m_s p_rad_s q_rad_s r_rad_s"
    )
    return dict(zip(names.split(), np.array(rows).T, strict=True))


def sphere(drag_coefficient: float) -> Body:
    """One slug, 0.1963495 ft²."""
    area = 0.1963495 * FOOT_M**2

    def loads(moving: Array, _: Array, density: float) -> tuple[Array, Array]:
        return -0.5 * density * area * drag_coefficient * np.linalg.norm(moving) * moving, np.zeros(3)

    return Body(mass_kg=14.593902937206, inertia=np.ones(3), loads=loads)


@pytest.mark.parametrize(
    ("drag", "velocity_ft_s", "wind_ft_s"),
    [
        (0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (0.1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (0.1, (0.0, 0.0, 0.0), (0.0, 20.0, 0.0)),
        (0.1, (0.0, 1000.0, -1000.0), (0.0, 0.0, 0.0)),
        (0.1, (1000.0, 0.0, -1000.0), (0.0, 0.0, 0.0)),
    ],
    ids=["dropped", "dropped with drag", "dropped in wind", "cannonball east", "cannonball north"],
)
@pytest.mark.parametrize("latitude_deg", [0.0, 40.0])
def test_spheres_fall_and_fly_around_the_turning_earth(
    drag: float, velocity_ft_s: tuple[float, ...], wind_ft_s: tuple[float, ...], latitude_deg: float
) -> None:
    height_ft = 30000.0 if velocity_ft_s == (0.0, 0.0, 0.0) else 100.0
    given = [("altitude_ft", height_ft), ("latitude_deg", latitude_deg)]
    given += [
        (f"velocity_{way}_ft_s", value) for way, value in zip(("north", "east", "down"), velocity_ft_s, strict=True)
    ]
    given += [(f"wind_{way}_ft_s", value) for way, value in zip(("north", "east"), wind_ft_s, strict=False)]
    case = Case(
        source=AIRCRAFT / "sphere" / "sphere.xml",
        settings=(("aero/drag-coefficient", drag),),
        start=case_start(given),
        duration_s=20.0,
        step_s=1 / 200,
        sample_interval_s=1.0,
    )
    flown = fly_case(case).columns
    begin = Start(
        latitude=float(np.radians(latitude_deg)),
        height_m=float(flown["geodetic_altitude_m"][0]),
        north_east_down_m_s=tuple(value * FOOT_M for value in velocity_ft_s),  # type: ignore[arg-type]
    )
    assert begin.height_m == pytest.approx(height_ft * FOOT_M, abs=0.05)  # JSBSim's altitude is along the radius
    wanted = integrate(
        EARTH,
        sphere(drag),
        begin,
        flown["time_s"],
        wind=lambda _: np.array(wind_ft_s) * FOOT_M,
    )
    for name in ("ecef_x_m", "ecef_y_m", "ecef_z_m", "geodetic_altitude_m"):
        assert np.abs(flown[name] - wanted[name]).max() < (POSITION_M if drag else VACUUM_M)
    for name in ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s"):
        assert np.abs(flown[name] - wanted[name]).max() < VELOCITY_M_S


def glider(elevator_rad: float) -> Body:
    """The coefficients of data/aircraft/glider."""
    area, span, chord = 20.0, 10.0, 2.0

    def loads(moving: Array, rates: Array, density: float) -> tuple[Array, Array]:
        u, v, w = moving
        speed = float(np.linalg.norm(moving))
        alpha, beta = np.arctan2(w, u), np.arcsin(v / speed)
        pressure = 0.5 * density * speed**2 * area
        p, q, r = rates
        wind = pressure * np.array([-0.02 - 1.5 * alpha**2, -0.6 * beta, -4.5 * alpha - 0.4 * elevator_rad])
        ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
        to_body = np.array([[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]])
        moment = pressure * np.array(
            [
                span * (-0.08 * beta - 0.4 * span / (2 * speed) * p),
                chord * (-0.6 * alpha - elevator_rad - 12 * chord / (2 * speed) * q),
                span * (0.1 * beta - 0.15 * span / (2 * speed) * r),
            ]
        )
        return to_body @ wind, moment

    return Body(mass_kg=3000.0, inertia=np.array([4000.0, 9000.0, 12000.0]), loads=loads)


@pytest.mark.parametrize("fidelity", ["symmetric", "free"])
def test_an_aircraft_flies_as_its_coefficients_say(fidelity: str, make_plan: MakePlan) -> None:
    elevator, free = -0.05, fidelity == "free"
    condition = Condition(airspeed_m_s=120.0, density_kg_m3=0.9, gravity_m_s2=9.8, altitude_m=3000.0)
    options = FlightOptions(
        fidelity=fidelity,
        alpha_limits_rad=(-0.6, 0.85),
        elevator_limits_rad=(-0.7, 0.35),
        elevator_rate_rad_s=1.0,
        drive=Drive.DIRECT,
    )
    sideways = {"beta_rad": 0.05, "phi_rad": 0.3, "psi_rad": 0.7, "p_rad_s": 0.2, "r_rad_s": -0.1, "latitude_rad": 0.6}
    start = {"theta_rad": 0.1, "airspeed_m_s": 120.0, "altitude_m": 3000.0}
    with Airborne(find_aircraft(str(AIRCRAFT / "glider" / "glider.xml"), near=AIRCRAFT), condition, options) as vehicle:
        flown = vehicle.fly(
            make_plan(
                (0.0, elevator),
                alpha=0.08,
                q=0.05,
                sample_interval_s=0.1,
                start=FreeStart(**start, **sideways) if free else SymmetricStart(**start),
            )
        )
    given = sideways if free else dict.fromkeys(sideways, 0.0)
    ca, sa = np.cos(0.08), np.sin(0.08)
    cb, sb = np.cos(given["beta_rad"]), np.sin(given["beta_rad"])
    angles = (given["phi_rad"], 0.1, given["psi_rad"])
    body_to_level = rotation(times(times(about(2, angles[2]), about(1, angles[1])), about(0, angles[0])))
    planet = EARTH if free else STILL
    wanted = integrate(
        planet,
        glider(elevator),
        Start(
            latitude=given["latitude_rad"],
            height_m=3000.0,
            north_east_down_m_s=tuple(body_to_level @ (120.0 * np.array([ca * cb, sb, sa * cb]))),
            phi_theta_psi=angles,
            rates=(given["p_rad_s"], 0.05, given["r_rad_s"]),
        ),
        flown["time_s"],
    )
    assert np.ptp(flown["theta_rad"]) > 0.1
    assert not free or np.ptp(flown["beta_rad"]) > 0.05
    for name in ("alpha", "beta", "phi", "theta", "psi"):
        assert np.abs(flown[f"{name}_rad"] - wanted[f"{name}_rad"]).max() < GLIDER_RAD
    for name in "pqr":
        assert np.abs(flown[f"{name}_rad_s"] - wanted[f"{name}_rad_s"]).max() < GLIDER_RAD
    assert np.abs(flown["airspeed_m_s"] - wanted["airspeed_m_s"]).max() < GLIDER_M_S
    assert np.abs(flown["altitude_m"] - wanted["geodetic_altitude_m"]).max() < GLIDER_M


BRICK_INERTIA = np.array([0.001894220, 0.006211019, 0.007194665])  # slug ft²


@pytest.mark.parametrize("damping", [0.0, -0.02])
def test_a_brick_tumbles_around_the_turning_earth(damping: float) -> None:
    """Damping of a body 1 ft long and wide: its moment is ``damping`` qbar S b b/(2V) p, and so on."""
    case = Case(
        source=AIRCRAFT / "tumbler" / "tumbler.xml",
        settings=(("aero/damping", damping),),
        start=case_start([("altitude_ft", 30000.0), ("p_deg_s", 10.0), ("q_deg_s", 20.0), ("r_deg_s", 30.0)]),
        duration_s=20.0,
        step_s=1 / 200,
        sample_interval_s=1.0,
    )
    flown = fly_case(case).columns

    def loads(moving: Array, rates: Array, density: float) -> tuple[Array, Array]:
        speed = float(np.linalg.norm(moving))
        return np.zeros(3), 0.25 * density * speed * FOOT_M**4 * damping * rates

    body = Body(mass_kg=1.0, inertia=BRICK_INERTIA * 14.593902937206 * FOOT_M**2, loads=loads)
    begin = Start(height_m=float(flown["geodetic_altitude_m"][0]), rates=tuple(np.radians([10.0, 20.0, 30.0])))  # type: ignore[arg-type]
    wanted = integrate(EARTH, body, begin, flown["time_s"])
    if damping:
        assert abs(flown["r_rad_s"][-1]) < 0.5 * flown["r_rad_s"][0]
    for name in ("p_rad_s", "q_rad_s", "r_rad_s", "theta_rad"):
        assert np.abs(flown[name] - wanted[name]).max() < TUMBLE_RAD
    for name in ("phi_rad", "psi_rad"):
        off = np.angle(np.exp(1j * (flown[name] - wanted[name])))
        assert np.abs(off).max() < TUMBLE_RAD


CHECK_CASES = Path(__file__).parents[2] / "docs" / "examples" / "check-cases"
BRICK = Body(
    mass_kg=5 * 0.45359237,
    inertia=BRICK_INERTIA * 14.593902937206 * FOOT_M**2,
    loads=lambda moving, rates, density: (
        np.zeros(3),
        0.25 * density * float(np.linalg.norm(moving)) * 0.22222 * FOOT_M**4
        * np.array([-0.33333**2, -0.66667**2, -0.33333**2]) * rates,
    ),
)  # fmt: skip
TUMBLE = ("inertial_p_deg_s=10", "inertial_q_deg_s=20", "inertial_r_deg_s=30")
ROUND = Planet(
    equator_m=20902255.199 * FOOT_M, flattening=0.0, j2=0.0, gm_m3_s2=1.407644180e16 * FOOT_M**3, turn_rad_s=7.292115e-5
)
ROUND_STILL = Planet(equator_m=ROUND.equator_m, flattening=0.0, j2=0.0, gm_m3_s2=ROUND.gm_m3_s2, turn_rad_s=0.0)


def as_check_case(
    planet: Planet, body: Body, flown: dict[str, Array], time: Array, wind: Callable[[float], Array]
) -> dict[str, Array]:
    """Return a flight with the columns and units of the check cases."""
    rows = []
    for k, t in enumerate(time):
        one = {name: float(values[k]) for name, values in flown.items()}
        height, latitude = one["geodetic_altitude_m"], one["latitude_rad"]
        angles = [one[f"{name}_rad"] for name in ("phi", "theta", "psi")]
        to_level = rotation(times(times(about(2, angles[2]), about(1, angles[1])), about(0, angles[0])))
        over_ground = np.array([one[f"velocity_{way}_m_s"] for way in ("north", "east", "down")])
        moving = to_level.T @ (over_ground - wind(height))
        spin = np.array([one[f"{name}_rad_s"] for name in "pqr"])
        inertial = spin + to_level.T @ (planet.turn_rad_s * np.array([np.cos(latitude), 0.0, -np.sin(latitude)]))
        place = np.array([one[f"ecef_{axis}_m"] for axis in "xyz"])
        temperature, pressure = air(height)
        density, speed, sound = (
            air_density(height),
            float(np.linalg.norm(moving)),
            np.sqrt(1.4 * 287.05287 * temperature),
        )
        force, moment = body.loads(moving, spin, density)
        rows.append(
            {
                "time": t,
                **{f"gePosition_ft_{axis}": value / FOOT_M for axis, value in zip("XYZ", place, strict=True)},
                **{f"feVelocity_ft_s_{axis}": value / FOOT_M for axis, value in zip("XYZ", over_ground, strict=True)},
                "altitudeMsl_ft": height / FOOT_M,
                "longitude_deg": np.degrees(np.arctan2(place[1], place[0])),
                "latitude_deg": np.degrees(latitude),
                "localGravity_ft_s2": float(np.linalg.norm(planet.gravity(place))) / FOOT_M,
                **{
                    f"eulerAngle_deg_{name}": np.degrees(angle)
                    for name, angle in zip(("Roll", "Pitch", "Yaw"), angles, strict=True)
                },
                **{
                    f"bodyAngularRateWrtEi_deg_s_{name}": np.degrees(rate)
                    for name, rate in zip(("Roll", "Pitch", "Yaw"), inertial, strict=True)
                },
                "altitudeRateWrtMsl_ft_min": -over_ground[2] / FOOT_M * 60.0,
                "speedOfSound_ft_s": sound / FOOT_M,
                "airDensity_slug_ft3": density / 515.3788183931961,
                "ambientPressure_lbf_ft2": pressure / 47.880258980335840,
                "ambientTemperature_dgR": temperature * 1.8,
                **{f"aero_bodyForce_lbf_{axis}": f / 4.4482216152605 for axis, f in zip("XYZ", force, strict=True)},
                **{f"aero_bodyMoment_ftlbf_{axis}": m / FOOT_POUND for axis, m in zip("LMN", moment, strict=True)},
                "mach": speed / sound,
                "dynamicPressure_lbf_ft2": 0.5 * density * speed**2 / 47.880258980335840,
                "trueAirspeed_nmi_h": speed * 3600.0 / 1852.0,
            }
        )  # fmt: skip
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


@dataclass(frozen=True, kw_only=True)
class CheckCase:
    """A case as it is typed, and what is integrated beside it."""

    source: str
    given: tuple[str, ...]
    body: Body
    start: Start = Start(height_m=30000.0 * FOOT_M)
    planet: Planet = EARTH
    planet_file: str = ""
    wind_file: str = ""
    wind: Callable[[float], Array] = still
    properties: tuple[str, ...] = ()


def _at_rest(*rates_deg_s: float, planet: Planet = EARTH) -> Start:
    """A start over the equator with rates to inertial space, which turns about the north there."""
    return Start(
        height_m=30000.0 * FOOT_M,
        rates=tuple(np.radians(rates_deg_s) - np.array([planet.turn_rad_s, 0.0, 0.0])),  # type: ignore[arg-type]
    )


HIGH = "geodetic_altitude_ft=30000"
DRAG = "aero/drag-coefficient=0.1"
DAMPED = ("aero/clp=-1", "aero/cmq=-1", "aero/cnr=-1")
SPHERE, BRICK_FILE = "aircraft/sphere/sphere.xml", "aircraft/brick/brick.xml"
CASES = {
    "dropped sphere, no drag": CheckCase(source=SPHERE, given=(HIGH,), body=sphere(0.0)),
    "tumbling brick": CheckCase(source="tumbling-brick.xml", given=TUMBLE, body=replace(BRICK, loads=sphere(0.0).loads),
                                start=_at_rest(10.0, 20.0, 30.0)),
    "tumbling brick, damped": CheckCase(source=BRICK_FILE, given=(HIGH, *TUMBLE), body=BRICK, properties=DAMPED,
                                        start=_at_rest(10.0, 20.0, 30.0)),
    "round Earth at rest": CheckCase(source=SPHERE, given=(HIGH,), body=sphere(0.1), properties=(DRAG,),
                                     planet=ROUND_STILL, planet_file="round-still.xml"),
    "round Earth that turns": CheckCase(source=SPHERE, given=(HIGH,), body=sphere(0.1), properties=(DRAG,),
                                        planet=ROUND, planet_file="round-rotating.xml"),
    "dropped sphere, drag": CheckCase(source=SPHERE, given=(HIGH,), body=sphere(0.1), properties=(DRAG,)),
    "steady wind": CheckCase(source=SPHERE, given=(HIGH, "wind_east_ft_s=20"), body=sphere(0.1), properties=(DRAG,),
                             wind=lambda _: np.array([0.0, 20.0 * FOOT_M, 0.0])),
    "wind shear": CheckCase(source=SPHERE, given=(HIGH,), body=sphere(0.1), properties=(DRAG,),
                            wind_file="wind-shear.csv",
                            wind=lambda height: np.array([0.0, 0.003 * height - 20.0 * FOOT_M, 0.0])),
    "cannonball east": CheckCase(
        source=SPHERE, given=("geodetic_altitude_ft=0", "velocity_east_ft_s=1000", "velocity_down_ft_s=-1000"),
        body=sphere(0.1), properties=(DRAG,),
        start=Start(north_east_down_m_s=(0.0, 1000.0 * FOOT_M, -1000.0 * FOOT_M))),
    "cannonball north": CheckCase(
        source=SPHERE, given=("geodetic_altitude_ft=0", "velocity_north_ft_s=1000", "velocity_down_ft_s=-1000"),
        body=sphere(0.1), properties=(DRAG,),
        start=Start(north_east_down_m_s=(1000.0 * FOOT_M, 0.0, -1000.0 * FOOT_M))),
}  # fmt: skip


def _request(case: CheckCase, duration_s: float) -> CaseRequest:
    return CaseRequest(
        source=str(CHECK_CASES / case.source),
        initial=case.given,
        settings=case.properties,
        schedules=(),
        records=(),
        duration_s=duration_s,
        step_hz=500.0,
        sample_hz=10.0,
        planet=CHECK_CASES / case.planet_file if case.planet_file else None,
        attitude="buss2",
        hold="foh",
        winds=(str(CHECK_CASES / case.wind_file),) if case.wind_file else (),
    )


def _reference(case: CheckCase, time: Array) -> pd.DataFrame:
    wanted = integrate(case.planet, case.body, case.start, time, wind=case.wind)
    return pd.DataFrame(as_check_case(case.planet, case.body, wanted, time, case.wind))


@pytest.mark.parametrize("name", CASES)
def test_a_check_case_with_its_own_columns_and_units(name: str, tmp_path: Path) -> None:
    """As it is typed, flown, and compared through the map of the documents with every column of the check cases."""
    flown = fly_case(_request(CASES[name], 10.0).case())
    save_case(flown, tmp_path / "ours.parquet")
    reference = _reference(CASES[name], flown.columns["time_s"][::5])
    reference.to_csv(tmp_path / "theirs.csv", index=False)
    found = compare(tmp_path / "ours.parquet", tmp_path / "theirs.csv", CHECK_CASES / "map.toml")
    assert found.verdict is Judgement.AGREES, [m for m in found.metrics if m.judgement is not Judgement.AGREES]
    assert len(found.metrics) == len(reference.columns) - 1


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("wind shear", {"wind_file": ""}),
        ("tumbling brick", {"given": ("inertial_p_deg_s=10.02", *TUMBLE[1:])}),
        ("tumbling brick, damped", {"properties": DAMPED[:2]}),
        ("round Earth that turns", {"planet_file": "round-still.xml"}),
        ("dropped sphere, drag", {"planet_file": "round-rotating.xml"}),
        ("cannonball east", {"properties": ("aero/drag-coefficient=0.1001",)}),
    ],
)
def test_another_case_disagrees(name: str, wrong: dict[str, object], tmp_path: Path) -> None:
    """Negative controls: wind left out, 0.02 deg/s of roll, a damping term, another Earth, 0.1 % of drag."""
    flown = fly_case(_request(replace(CASES[name], **wrong), 10.0).case())  # type: ignore[arg-type] # its fields
    save_case(flown, tmp_path / "ours.parquet")
    _reference(CASES[name], flown.columns["time_s"][::5]).to_csv(tmp_path / "theirs.csv", index=False)
    found = compare(tmp_path / "ours.parquet", tmp_path / "theirs.csv", CHECK_CASES / "map.toml")
    assert found.verdict is Judgement.DISAGREES


def test_the_reference_that_is_shipped_is_what_is_integrated_here() -> None:
    shipped = pd.read_csv(CHECK_CASES / "wind-shear-reference.csv")
    wanted = _reference(CASES["wind shear"], shipped["time"].to_numpy())
    pd.testing.assert_frame_equal(shipped, wanted, rtol=1e-9, atol=1e-9, check_dtype=False)  # twelve digits

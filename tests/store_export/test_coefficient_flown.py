"""The exported aircraft has the forces of its model, flies as the identification flies it, and is found again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.lienard import NORMAL_95
from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft
from finback.flight.derived_model import EARTH_RADIUS_M
from finback.flight.linear_model import linear_model
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.rig import Rig
from finback.flight.simulator import Simulator
from finback.flight.start import SymmetricStart
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.atmosphere import density_ratio
from finback.identification.coefficient.form import Axes, CoefficientForm, parse_term
from finback.identification.coefficient.identify import identify_coefficients
from finback.identification.coefficient.model import CoefficientModel
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.shooting import shoot
from finback.identification.coefficient.track import Track
from finback.identification.term import Term
from finback.records import Condition, FlightRecord, Hold, Schedule, Sweep
from finback.store.flown import as_flown
from finback.units import from_si, to_si

Exported = Callable[[CoefficientModel], Aircraft]

FORCES = 1e-10  # of the largest: feet, pounds and slugs are other roundings
EXACT = 1e-12  # rad/s and rad/s²: a dozen roundings of numbers up to 100
SERIES = 1e-7  # rad/s and rad/s²: sine and cosine up to the seventh power, at 0.4 rad
HEIGHT_M = 3000.0
SEA_LEVEL_KG_M3 = 1.225  # ICAO Doc 7488
# Gravity is one number here; over ten seconds V² / r and the height move it by 5e-4 m/s².
FLOWN = {"airspeed_m_s": 0.002, "alpha_rad": 3e-5, "theta_rad": 1e-4, "q_rad_s": 3e-5}
STATES = tuple(FLOWN)
LIMITS_RAD = (-0.6, 1.0)
INTERVAL_S = 0.02
NOISE = {
    "airspeed_m_s": 0.1,
    "alpha_rad": to_si(0.1, "deg"),
    "theta_rad": to_si(0.1, "deg"),
    "q_rad_s": to_si(0.1, "deg_s"),
    "q_dot_rad_s2": to_si(1.0, "deg_s2"),
}
CLOSE = 4.0  # standard errors: 37 numbers, one false alarm in 400
MOST = 0.75  # of eleven numbers: 95 % less three standard deviations of so few


def rates_of(
    model: CoefficientModel, speed: float, at: tuple[float, float, float], elevator: float, air: tuple[float, ...]
) -> np.ndarray:
    """Return the model's rates at alpha, theta, q; air is density, thrust, gravity."""
    inputs = np.zeros((1, len(model.form.inputs)))
    inputs[0, 0] = elevator
    terms = layout(model.form, model.airframe, model.reference_speed_m_s)
    states = np.array([[speed, *at]])
    density, thrust, gravity = air
    return motion(
        terms, model.numbers, states, inputs, np.array([density]), np.array([thrust]), gravity
    ).rates[0]  # fmt: skip


def trim(model: CoefficientModel, speed: float, density: float) -> tuple[float, float, float]:
    """Return alpha, elevator and thrust of level flight, by Newton's steps from differences."""
    point = np.array([0.08, -0.03, 1.0])

    def left(x: np.ndarray) -> np.ndarray:
        alpha, elevator, thrust = x.tolist()
        found = rates_of(model, speed, (alpha, alpha, 0.0), elevator, (density, 1e4 * thrust, 9.8))
        return found[[0, 1, 3]] * [1.0, speed, 1.0]

    for _ in range(20):
        slopes = np.column_stack([(left(point + h) - left(point - h)) / 2e-6 for h in 1e-6 * np.eye(3)])
        point = point - np.linalg.solve(slopes, left(point))
    alpha, elevator, thrust = point.tolist()
    return alpha, elevator, 1e4 * thrust


# forces


@pytest.mark.parametrize("name", ["transport", "transport-late", "morelli", "morelli-late"])
def test_forces_are_the_models_in_jsbsim_itself(
    exported: Exported, truths: dict[str, CoefficientModel], name: str
) -> None:
    """No fidelity of the harness: the aircraft as it was written, in the air of JSBSim, at any speed and height."""
    model = truths[name]
    path = exported(model).path
    simulator = Simulator(path, step_s=0.01, freeze_position=False)
    random = np.random.default_rng(3)
    found, expected = [], []
    for _ in range(30):
        alpha, speed = random.uniform(-0.3, 0.6), random.uniform(200.0, 700.0)
        values = {
            "ic/h-sl-ft": random.uniform(0.0, 4e4),
            "ic/u-fps": speed * np.cos(alpha),
            "ic/w-fps": speed * np.sin(alpha),
            "ic/q-rad_sec": random.uniform(-0.5, 0.5),
            "fcs/elevator-cmd-norm": random.uniform(-1.0, 1.0),
        }
        simulator.write({name: float(value) for name, value in values.items()})
        simulator.start()  # twice: the rate of alpha is told a frame late
        read, further = _read(simulator)
        found.append(read[5:])
        expected.append(_loads(model, *read[:5], density=further["density_kg_m3"], further=further))
        assert further["thrust_n"] == pytest.approx(model.airframe.thrust_n, rel=1e-15)
    assert np.isfinite(found).all()
    assert np.ptp(found, axis=0).min() > 0.0
    assert (np.abs(np.array(found) - expected) <= FORCES * np.abs(expected).max(axis=0)).all()


VARIABLES = (
    *("alpha", "pitch_rate", "reference_pitch_rate", "speed_ratio", "elevator", "canard", "beta", "p", "r"),
    *("aileron_rad", "rudder_rad", "phi_rad", "altitude_m", "density_kg_m3", "thrust_n"),
)
SIZES = {"altitude_m": 1e4, "thrust_n": 1e4}


def random_model(random: np.random.Generator, axes: Axes) -> CoefficientModel:
    """Any terms of anything that a record may hold, an airframe of any size, thrust along any line."""

    def term() -> Term:
        names = random.choice(VARIABLES, random.integers(0, 4), replace=False)
        return parse_term("*".join(f"{name}^{random.integers(1, 3)}" for name in names) or "1")

    groups = [tuple({term(): None for _ in range(6)} | {parse_term("elevator"): None}) for _ in range(3)]
    form = CoefficientForm(axes=axes, along=groups[0], across=groups[1], pitching=groups[2])
    sizes = [np.prod([SIZES.get(name, 1.0) ** power for name, power in t.monomials[0].factors]) for _, t in form.terms]
    angle, arm, x, z = random.normal(size=4).tolist()
    return CoefficientModel(
        form=form,
        airframe=Airframe(
            mass_kg=float(10.0 ** random.uniform(1, 5)),
            wing_area_m2=float(10.0 ** random.uniform(0, 2)),
            chord_m=float(10.0 ** random.uniform(-1, 1)),
            pitch_inertia_kg_m2=float(10.0 ** random.uniform(0, 6)),
            thrust_n=float(1e4 * random.normal()),
            thrust_angle_rad=0.2 * angle,
            thrust_arm_m=arm,
            reference_x_m=x,
            reference_z_m=z,
        ),
        reference_speed_m_s=float(random.uniform(20.0, 200.0)),
        numbers=random.normal(size=form.size) / np.array(sizes),
        covariance=np.zeros((form.size, form.size)),
        domain=np.tile([-0.3, 0.3], (len(form.variables), 1)),
    )


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_any_form_of_any_airframe_has_its_forces(exported: Exported, seed: int) -> None:
    """Body axes in sideslip as well; in wind axes drag turns with the wind, and there is none across."""
    random = np.random.default_rng(seed)
    axes = (Axes.BODY, Axes.WIND)[seed % 2]
    model = random_model(random, axes)
    simulator = Simulator(exported(model).path, step_s=0.01, freeze_position=False)
    for _ in range(5):
        values = {
            "ic/h-sl-ft": random.uniform(0.0, 3e4),
            "ic/u-fps": random.uniform(100.0, 600.0),
            "ic/v-fps": random.uniform(-20.0, 20.0) if axes is Axes.BODY else 0.0,
            "ic/w-fps": random.uniform(-100.0, 200.0),
            "fcs/elevator-cmd-norm": random.uniform(-1.0, 1.0),
            **{f"ic/{rate}-rad_sec": 0.2 * random.normal() for rate in "pqr"},
            **{name: 0.2 * random.normal() for name in ("ic/phi-rad", "input/canard") if simulator.has(name)},
            **{f"fcs/{name}-pos-rad": 0.2 * random.normal() for name in ("left-aileron", "rudder")},
        }
        simulator.write({name: float(value) for name, value in values.items()})
        simulator.start()
        found, further = _read(simulator)
        expected = np.array(_loads(model, *found[:5], density=further["density_kg_m3"], further=further))
        assert np.abs(np.array(found[5:]) - expected).max() <= FORCES * np.abs(expected).max()


def _read(simulator: Simulator) -> tuple[list[float], dict[str, float]]:
    """Return V, alpha, q, dα/dt, elevator, forces and moment in SI; and every input, 0 where the model has none."""
    names = {
        "velocities/vt-fps": "ft_s", "aero/alpha-rad": "rad", "velocities/q-aero-rad_sec": "rad_s",
        "aero/alphadot-rad_sec": "rad_s", "fcs/elevator-pos-rad": "rad", "forces/fbx-aero-lbs": "lbf",
        "forces/fbz-aero-lbs": "lbf", "moments/m-aero-lbsft": "ftlbf",
    }  # fmt: skip
    inputs = {
        "density_kg_m3": ("atmosphere/rho-slugs_ft3", "slug_ft3"),
        "thrust_n": ("model/thrust-lbs", "lbf"),
        "altitude_m": ("position/h-sl-ft", "ft"),
        "beta_rad": ("aero/beta-rad", "rad"),
        "p_rad_s": ("velocities/p-aero-rad_sec", "rad_s"),
        "r_rad_s": ("velocities/r-aero-rad_sec", "rad_s"),
        "phi_rad": ("attitude/phi-rad", "rad"),
        "aileron_rad": ("fcs/left-aileron-pos-rad", "rad"),
        "rudder_rad": ("fcs/rudder-pos-rad", "rad"),
        "canard_rad": ("input/canard", "rad"),
    }
    return (
        [to_si(simulator.getter(name)(), unit) for name, unit in names.items()],
        {
            name: to_si(simulator.getter(node)(), unit) if simulator.has(node) else 0.0
            for name, (node, unit) in inputs.items()
        },
    )


def _loads(  # noqa: PLR0913 - a state
    model: CoefficientModel,
    v: float,
    alpha: float,
    q: float,
    alpha_dot: float,
    elevator: float,
    *,
    density: float,
    further: Mapping[str, float],
) -> list[float]:
    """Return force along body x and z and the moment about the center of gravity, of aerodynamics and thrust."""
    frame = model.airframe
    half = 0.5 * frame.chord_m
    values = {
        "alpha_rad": alpha,
        "pitch_rate_1": q * half / v,
        "reference_pitch_rate_1": q * half / model.reference_speed_m_s,
        "speed_ratio_1": v / model.reference_speed_m_s,
        "alpha_rate_1": alpha_dot * half / v,
        **further,
        "elevator_rad": elevator,
    }
    one, two, cm = (float(model.coefficient(name, values)) for name in model.form.names)
    sine, cosine = np.sin(alpha), np.cos(alpha)
    cx, cz = (one, two) if model.form.names[0] == "CX" else (two * sine - one * cosine, -two * cosine - one * sine)
    load = 0.5 * density * v * v * frame.wing_area_m2
    turning = load * (frame.chord_m * cm + frame.reference_z_m * cx - frame.reference_x_m * cz)
    along, up = np.cos(frame.thrust_angle_rad), np.sin(frame.thrust_angle_rad)
    return [
        load * cx + frame.thrust_n * along,
        load * cz - frame.thrust_n * up,
        turning + frame.thrust_n * frame.thrust_arm_m,
    ]


# the model reduced at a condition


@contextmanager
def rigs(aircraft: Aircraft) -> Iterator[list[tuple[Condition, Rig]]]:
    """Return rigs at three airspeeds and heights."""
    conditions = [
        Condition(airspeed_m_s=speed, density_kg_m3=density, gravity_m_s2=gravity, altitude_m=altitude)
        for speed, density, gravity, altitude in (
            (75.0, 1.1, 9.81, 1000.0),
            (140.0, 0.7, 9.8, 5000.0),
            (220.0, 0.35, 9.77, 11000.0),
        )
    ]
    found = [(condition, Rig(aircraft, condition, step_s=1 / 400)) for condition in conditions]
    try:
        yield found
    finally:
        for _, rig in found:
            rig.__exit__(None, None, None)


@pytest.mark.parametrize("name", ["transport", "morelli-late"])
def test_reduced_anywhere_it_is_the_aircraft_on_the_rig(
    exported: Exported, truths: dict[str, CoefficientModel], name: str
) -> None:
    """Rates, equilibria and slopes; the series of sine and cosine apart, to rounding."""
    model = truths[name]
    thrust = model.airframe.thrust_n
    random = np.random.default_rng(7)
    with rigs(exported(model)) as found:
        for condition, rig in found:
            reduced = model.reduced(condition)
            further = dict.fromkeys(model.form.inputs[1:], 0.0)
            held = reduced.held(**further)
            air = (condition.density_kg_m3, thrust, condition.gravity_m_s2)
            for alpha, q, elevator in random.uniform(-0.4, 0.4, (10, 3)).tolist():
                flown = np.array(rig.derivatives(alpha, q, elevator))
                known = rates_of(model, condition.airspeed_m_s, (alpha, alpha, q), elevator, air)[[1, 3]]
                np.testing.assert_allclose(flown, known, atol=EXACT)
                planar = [float(part(alpha, q, elevator)) for part in (held.alpha_dot, held.q_dot)]
                np.testing.assert_allclose(flown, planar, atol=SERIES)
            _same_linearization(rig, held, condition)


def _same_linearization(rig: Rig, held: object, condition: Condition) -> None:
    """At an equilibrium of the reduced model the rig rests, and both have the same slopes."""
    parts = (held.alpha_dot, held.q_dot)  # type: ignore[attr-defined] # a PolynomialModel
    point = np.array([0.1, 0.0, 0.0])  # alpha stays; q and the elevator balance it
    names = ("alpha_rad", "q_rad_s", "elevator_rad")
    slopes = np.array([[part.derivative(name) for name in names] for part in parts])

    def at(table: np.ndarray) -> np.ndarray:
        return np.array([[float(one(*point)) for one in row] for row in table])

    for _ in range(20):
        left = np.array([float(part(*point)) for part in parts])
        point[1:] -= np.linalg.solve(at(slopes[:, 1:]), left)
    found = linear_model(
        lambda x, u: rig.derivatives(float(x[0]), float(x[1]), float(u[0])),
        state_names=names[:2],
        input_names=names[2:],
        state=point[:2],
        inputs=point[2:],
    )
    assert np.abs(found.rates).max() < SERIES, condition
    np.testing.assert_allclose(np.hstack([found.A, found.B]), at(slopes), atol=1e-6 * np.abs(at(slopes)).max())


# flights


def multistep(
    name: str, start: tuple[float, float, float], elevator: float, amplitude: float, unit_s: float
) -> FlightPlan:
    """A 3-2-1-1 at about 1 rad/s from a level start at V, alpha; corners on the samples, as a record must have them."""
    speed, alpha, altitude = start
    starts = 1.0 + unit_s * np.cumsum([0, 3, 2, 1, 1])
    levels = elevator + amplitude * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    ends = starts + INTERVAL_S * np.ceil(np.abs(np.diff(levels)) / INTERVAL_S)
    return FlightPlan(
        kind="test",
        name=name,
        alpha_rad=alpha,
        q_rad_s=0.0,
        schedule=Schedule(
            time_s=np.concatenate([[0.0], np.stack([starts, ends], axis=1).ravel()]),
            elevator_rad=np.concatenate([levels[:1], np.stack([levels[:-1], levels[1:]], axis=1).ravel()]),
        ),
        hold=Hold.FOH,
        duration_s=10.0,
        sample_interval_s=INTERVAL_S,
        alpha_limits_rad=LIMITS_RAD,
        start=SymmetricStart(airspeed_m_s=speed, theta_rad=alpha, altitude_m=altitude),
    )


def options(fidelity: str) -> FlightOptions:
    return FlightOptions(
        fidelity=fidelity, alpha_limits_rad=LIMITS_RAD, elevator_limits_rad=(-0.7, 0.7), elevator_rate_rad_s=1.0
    )


def condition_of(speed: float) -> Condition:
    """Return the standard atmosphere at ``HEIGHT_M``, with the gravity of that height."""
    return Condition(
        airspeed_m_s=speed,
        density_kg_m3=SEA_LEVEL_KG_M3 * float(density_ratio(HEIGHT_M, 0.0)),
        gravity_m_s2=9.80665 * (EARTH_RADIUS_M / (EARTH_RADIUS_M + HEIGHT_M)) ** 2,
        altitude_m=HEIGHT_M,
    )


@pytest.mark.parametrize("name", ["transport-late", "morelli"])
def test_it_flies_as_the_identification_flies_it(
    exported: Exported, truths: dict[str, CoefficientModel], name: str
) -> None:
    model, speed = truths[name], 120.0
    condition = condition_of(speed)
    alpha, elevator, thrust = trim(model, speed, condition.density_kg_m3)
    model = replace(model, airframe=replace(model.airframe, thrust_n=thrust))
    with Airborne(exported(model), condition, options("symmetric")) as vehicle:
        flown = as_flown(vehicle.fly(multistep(name, (speed, alpha, HEIGHT_M), elevator, 0.06, 0.6)), model.airframe)
        assert vehicle.provenance["frame_late"] == "nothing"
    assert np.ptp(flown["alpha_rad"]) > 0.1
    count = len(flown)
    height = flown["altitude_m"]
    track = Track(
        flight=name,
        start_s=0.0,
        interval_s=INTERVAL_S,
        outputs=(),
        measured=np.empty((count, 0)),
        states=np.empty((count, 4)),
        input_names=model.form.inputs,
        inputs=flown["elevator_rad"][:, np.newaxis],
        hold=Hold.FOH,
        density_kg_m3=flown.condition.density_kg_m3 * density_ratio(height, HEIGHT_M),
        thrust_n=np.full(count, thrust),
        gravity_m_s2=flown.condition.gravity_m_s2,
    )
    terms = layout(model.form, model.airframe, model.reference_speed_m_s)
    start = np.array([flown[state][0] for state in STATES])
    found = shoot(
        terms, model.numbers, start, track, samples=(0, count - 1), bias_rad=0.0, delay_s=0.0, substeps=4
    )[0]  # fmt: skip
    for state, mine in zip(STATES, found.T, strict=True):
        assert np.abs(flown[state] - mine).max() < FLOWN[state], state


def test_it_flies_in_all_six_degrees_of_freedom(exported: Exported, truths: dict[str, CoefficientModel]) -> None:
    """Over JSBSim's turning Earth, by its own flight control: the same motion but for what the Earth does."""
    model, speed = truths["transport-late"], 120.0
    condition = condition_of(speed)
    alpha, elevator, thrust = trim(model, speed, condition.density_kg_m3)
    plan = multistep("free", (speed, alpha, HEIGHT_M), elevator, 0.06, 0.6)
    model = replace(model, airframe=replace(model.airframe, thrust_n=thrust))
    records = []
    aircraft = exported(model)
    for fidelity in ("symmetric", "free"):
        with Airborne(aircraft, condition, options(fidelity)) as vehicle:
            records.append(vehicle.fly(plan))
    symmetric, free = records
    assert np.abs(free["phi_rad"]).max() < 1e-4
    assert np.abs(free["alpha_rad"] - symmetric["alpha_rad"]).max() < 3e-4


CIRCLES = {
    "morelli": (
        *((110.0, 4.0, 0.6), (150.0, 4.0, 0.5), (190.0, 4.0, 0.4), (130.0, -8.0, 0.6)),
        *((150.0, -10.0, 0.6), (180.0, -8.0, 0.7), (120.0, -10.0, 0.5), (190.0, -10.0, 0.5)),
    ),
    "transport": ((85.0, 3.0, 0.8), (105.0, -3.0, 0.6), (130.0, 3.0, 0.5), (95.0, -3.0, 0.7)),
}
"""Airspeed in m/s, amplitude in deg, unit in s of each 3-2-1-1."""


@pytest.mark.parametrize("name", sorted(CIRCLES))
def test_its_own_flights_give_the_model_again(
    exported: Exported, truths: dict[str, CoefficientModel], name: str
) -> None:
    """A model out, flown, measured with noise, and identified: the circle is closed."""
    truth = truths[name]
    condition = condition_of(150.0)
    random = np.random.default_rng(5)
    records = []
    with Airborne(exported(truth), condition, options("symmetric")) as vehicle:
        for index, (speed, amplitude_deg, unit_s) in enumerate(CIRCLES[name]):
            alpha, elevator, _ = trim(truth, speed, condition.density_kg_m3)
            plan = multistep(f"flight-{index}", (speed, alpha, HEIGHT_M), elevator, to_si(amplitude_deg, "deg"), unit_s)
            records.append(measured(as_flown(vehicle.fly(plan), truth.airframe), random))
    found = identify_coefficients(
        Sweep(study="circle", records=tuple(records)),
        CoefficientOptions(
            airframe=truth.airframe,
            form=truth.form,
            reference_speed_m_s=truth.reference_speed_m_s,
            method=CoefficientMethod.OUTPUT_ERROR,
            outputs=tuple(NOISE),
        ),
    ).model
    off = np.abs(found.numbers - truth.numbers) / found.standard_errors
    assert off.max() < CLOSE, dict(zip(found.form.labels(), off.round(1).tolist(), strict=True))
    assert (off < NORMAL_95).mean() > MOST


def measured(record: FlightRecord, random: np.random.Generator) -> FlightRecord:
    """Add noise."""
    noisy = {name: record[name] + size * random.standard_normal(len(record)) for name, size in NOISE.items()}
    return record.with_columns(**noisy)


def test_a_command_of_zero_is_an_elevator_of_zero(exported: Exported, truths: dict[str, CoefficientModel]) -> None:
    """Also where the data never had one: JSBSim would else drive it backward."""
    model = truths["transport"]
    domain = model.domain.copy()
    domain[model.form.variables.index("elevator_rad")] = [-0.2, -0.05]
    simulator = Simulator(exported(replace(model, domain=domain)).path, step_s=0.01, freeze_position=False)
    simulator.write({"ic/h-sl-ft": 1e4, "ic/u-fps": from_si(120.0, "m_s")})
    for command, expected in ((-1.0, -0.2), (0.0, 0.0), (0.5, 0.1)):
        simulator.write({"fcs/elevator-cmd-norm": command})
        simulator.start()
        assert simulator.read(["fcs/elevator-pos-rad"])["fcs/elevator-pos-rad"] == pytest.approx(expected)

"""Coefficients fitted to flights whose airspeed moves: Morelli's F-16, a transport in drag and lift, and refusals."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.formats.frame import record_from_frame
from finback.identification import gauss_newton
from finback.identification.coefficient import equation_error
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import CoefficientIdentification, identify_coefficients
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import Biases, CoefficientMethod, CoefficientOptions
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import from_si, to_si

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"

# 37 numbers at three standard errors, one chance in ten of a false alarm; measured 2.6 at this seed.
LARGEST_ERROR = 3.9
# Runge and Kutta's rule against DOP853 over 10 s: measured 8e-7 of the smallest number.
EXACT = 1e-5


@pytest.fixture(scope="module")
def study() -> ModuleType:
    """The script that flies Morelli's F-16 by an integrator of its own."""
    spec = importlib.util.spec_from_file_location("study_coefficients", SCRIPTS / "study_coefficients.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def flown(study: ModuleType) -> dict[Hold, tuple[FlightRecord, ...]]:
    """All maneuvers with a straight elevator, the first four with a held one."""
    return {Hold.FOH: study.flights(Hold.FOH), Hold.ZOH: study.flights(Hold.ZOH, 4)}


def _options(study: ModuleType, method: CoefficientMethod) -> CoefficientOptions:
    return CoefficientOptions(airframe=study.F16, form=study.FORM, reference_speed_m_s=150.0, method=method)


def test_the_flights_move_airspeed_and_alpha(flown: dict[Hold, tuple[FlightRecord, ...]]) -> None:
    speed = np.concatenate([record["airspeed_m_s"] for record in flown[Hold.FOH]])
    alpha = from_si(np.concatenate([record["alpha_rad"] for record in flown[Hold.FOH]]), "deg")
    assert speed.min() < 90.0
    assert speed.max() > 190.0
    assert alpha.min() < -9.0
    assert alpha.max() > 35.0


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(method, marks=[pytest.mark.slow] if method is CoefficientMethod.FILTER_ERROR else [])
        for method in CoefficientMethod
    ],
)
def test_the_f16_is_recovered_from_its_own_noisy_flights(
    study: ModuleType, flown: dict[Hold, tuple[FlightRecord, ...]], method: CoefficientMethod
) -> None:
    found = identify_coefficients(study.measured(flown[Hold.FOH], 1), _options(study, method))
    off = np.abs(found.model.numbers - study.TRUTH) / found.model.standard_errors
    assert off.max() < LARGEST_ERROR
    assert 0.6 < float(np.sqrt(np.mean(off**2))) < 1.4  # chi-square of 37, correlated
    assert found.converged
    if method is CoefficientMethod.OUTPUT_ERROR:
        rms = dict(zip(found.residual_names, found.residual_rms.tolist(), strict=True))
        for name, noise in study.NOISE.items():
            assert rms[name] == pytest.approx(noise, rel=0.05)  # 3700 samples tell a deviation to 1.2 %


def test_without_noise_output_error_is_exact(study: ModuleType, flown: dict[Hold, tuple[FlightRecord, ...]]) -> None:
    options = _options(study, CoefficientMethod.OUTPUT_ERROR)
    found = identify_coefficients(Sweep(study="clean", records=flown[Hold.FOH]), options)
    np.testing.assert_allclose(found.model.numbers, study.TRUTH, rtol=EXACT)


def test_a_held_elevator_is_held(study: ModuleType, flown: dict[Hold, tuple[FlightRecord, ...]]) -> None:
    # Four flights cannot tell all 37 numbers from noise, but without noise they can.
    sweep = Sweep(study="held", records=flown[Hold.ZOH])
    options = _options(study, CoefficientMethod.OUTPUT_ERROR)
    found = identify_coefficients(sweep, options)
    np.testing.assert_allclose(found.model.numbers, study.TRUTH, rtol=100 * EXACT)
    straight = Sweep(study="wrong", records=tuple(replace(item, hold=Hold.FOH) for item in flown[Hold.ZOH]))
    # Negative control, by the estimator that is cheap: wrong by more than some numbers, not by a tenth.
    cheap = _options(study, CoefficientMethod.EQUATION_ERROR)
    right, wrong = (identify_coefficients(item, cheap).model.numbers for item in (sweep, straight))
    assert np.abs(right / study.TRUTH - 1.0).max() < 0.2
    assert np.abs(wrong / study.TRUTH - 1.0).max() > 1.0


def test_a_model_at_constant_pressure_would_not_do(
    study: ModuleType, flown: dict[Hold, tuple[FlightRecord, ...]]
) -> None:
    # Negative control: with the airspeed of the records replaced by its mean, residuals leave nothing to be known.
    records = tuple(
        record.with_columns(airspeed_m_s=np.full(len(record), record["airspeed_m_s"].mean()))
        for record in flown[Hold.FOH]
    )
    options = _options(study, CoefficientMethod.EQUATION_ERROR)
    with pytest.raises(RefusedError, match="cannot tell apart, within the noise"):
        identify_coefficients(Sweep(study="still", records=records), options)
    identify_coefficients(Sweep(study="moving", records=flown[Hold.FOH]), options)


# A transport: drag and lift with the airspeed's own terms, thrust at an angle and off the center of gravity, q c / 2V₀.
TRANSPORT = Airframe(
    mass_kg=7472.0,
    wing_area_m2=30.97,
    chord_m=2.43,
    pitch_inertia_kg_m2=51929.0,
    thrust_angle_rad=to_si(3.0, "deg"),
    thrust_arm_m=-0.2,
)
CRUISE = Condition(airspeed_m_s=104.67, density_kg_m3=0.792, gravity_m_s2=9.80665, altitude_m=4300.0)
DRAG_LIFT = CoefficientForm.parse(
    Axes.WIND,
    ["1", "speed_ratio", "alpha"],
    ["1", "speed_ratio", "alpha"],
    ["1", "speed_ratio", "alpha", "reference_pitch_rate", "elevator"],
)
NUMBERS = np.array([0.12, -0.065, 0.32, -0.09, 0.15, 4.33, 0.11, 0.004, -0.97, -34.7, -1.53])
SIGMA = {
    "airspeed_m_s": 0.1,
    "alpha_rad": to_si(0.05, "deg"),
    "theta_rad": to_si(0.05, "deg"),
    "q_rad_s": to_si(0.05, "deg_s"),
    "q_dot_rad_s2": to_si(0.5, "deg_s2"),
    "ax_m_s2": 0.02,
    "az_m_s2": 0.05,
}
OPTIONS = CoefficientOptions(airframe=TRANSPORT, form=DRAG_LIFT, reference_speed_m_s=104.67)
BIAS = {"alpha_rad": 0.01, "az_m_s2": 0.2}
LATE_S = 0.06


def _transport(seed: int, *, bias: bool = False, late_s: float = 0.0) -> FlightRecord:
    """Fly a 3-2-1-1 and, later, a pulse of thrust; add noise."""
    time = 0.04 * np.arange(1001)
    starts = 2.0 + 0.8 * np.cumsum([0, 3, 2, 1, 1])
    levels = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    elevator = -0.003 + 0.05 * np.interp(
        time, np.repeat(starts, 2) + np.tile([-0.1, 0.1], 5), np.repeat(levels, 2)[1:-1]
    )
    thrust = 10e3 + 4e3 * np.interp(time, [15.0, 16.0, 24.0, 25.0], [0.0, 1.0, 1.0, 0.0])
    terms = layout(DRAG_LIFT, TRANSPORT, 104.67)

    def at(when: float, state: FloatArray) -> FloatArray:
        inputs = np.array([[np.interp(when - late_s, time, elevator)]])
        air = np.array([0.792]), np.array([np.interp(when, time, thrust)])
        return motion(terms, NUMBERS, state[np.newaxis], inputs, *air, 9.80665).rates[0]

    solved = solve_ivp(
        lambda when, state: at(when, state)[:4],
        (0.0, 40.0),
        [106.0, 0.1, 0.1, 0.0],
        method="DOP853",
        t_eval=time,
        rtol=1e-9,
        atol=1e-9,
        max_step=0.04,
    )
    rates = np.array([at(when, state) for when, state in zip(time, solved.y.T, strict=True)])
    truth = dict(zip(SIGMA, [*solved.y, rates[:, 3], rates[:, 4], rates[:, 5]], strict=True))
    random = np.random.default_rng(seed)
    noisy = {name: truth[name] + SIGMA[name] * random.standard_normal(time.size) for name in SIGMA}
    if bias:
        noisy = {name: values + BIAS.get(name, 0.0) for name, values in noisy.items()}
    return FlightRecord(
        name="transport",
        columns={"time_s": time, "elevator_rad": elevator, "thrust_n": thrust, **noisy},
        outcome=Outcome.COMPLETED,
        note="",
        condition=CRUISE,
        schedule=Schedule(time_s=time, elevator_rad=elevator),
        hold=Hold.FOH,
    )


@pytest.fixture(scope="module")
def transport() -> FlightRecord:
    """One noisy flight of the transport."""
    return _transport(0)


@pytest.fixture(scope="module")
def fitted(transport: FlightRecord) -> CoefficientIdentification:
    """Its coefficients by output error."""
    return identify_coefficients(Sweep(study="transport", records=(transport,)), OPTIONS)


def test_drag_lift_and_moment_of_a_transport(fitted: CoefficientIdentification) -> None:
    off = np.abs(fitted.model.numbers - NUMBERS) / fitted.model.standard_errors
    assert off.max() < 3.2  # 11 numbers, one false alarm in 70
    assert fitted.residual_names == tuple(SIGMA)
    assert fitted.model.number("alpha in CL") == pytest.approx(4.33, rel=0.02)
    varied, *others = fitted.warnings
    assert varied.startswith("thrust varied, 10000 to 14000 N")
    assert all("zero" in line for line in others)


@pytest.mark.parametrize(("passes", "converged"), [(2, False), (4, True)])
def test_equation_error_says_whether_its_last_pass_moved_anything(
    transport: FlightRecord,
    monkeypatch: pytest.MonkeyPatch,
    passes: int,
    converged: bool,  # noqa: FBT001 - a case of the test
) -> None:
    """Drag and lift share both forces, so the second pass, that weighs these by their residuals, moves them."""
    monkeypatch.setattr(equation_error, "_FEWEST_PASSES", passes)
    monkeypatch.setattr(equation_error, "_MOST_PASSES", passes)
    options = replace(OPTIONS, method=CoefficientMethod.EQUATION_ERROR, biases=Biases())
    found = identify_coefficients(Sweep(study="transport", records=(transport,)), options)
    assert (found.iterations, found.converged) == (passes, converged)
    assert any("still moved" in line for line in found.warnings) is not converged


def test_output_error_names_what_gave_its_first_estimate(
    transport: FlightRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gauss_newton, "_finite", lambda _: False)
    with pytest.raises(RefusedError, match="the model of the equation error leaves the range"):
        identify_coefficients(Sweep(study="transport", records=(transport,)), OPTIONS)


@pytest.mark.parametrize(
    ("method", "left"),
    [
        (CoefficientMethod.EQUATION_ERROR, tuple(SIGMA)),
        (CoefficientMethod.EQUATION_ERROR, tuple(SIGMA)[:4]),  # forces from dV/dt and dα/dt
        (CoefficientMethod.FREQUENCY, tuple(SIGMA)),
        (CoefficientMethod.FREQUENCY, tuple(SIGMA)[:4]),
        (CoefficientMethod.OUTPUT_ERROR, tuple(SIGMA)[:4]),
        (CoefficientMethod.OUTPUT_ERROR, ("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2")),  # no pitch angle
    ],
)
def test_any_of_the_outputs_will_do(transport: FlightRecord, method: CoefficientMethod, left: tuple[str, ...]) -> None:
    columns = {name: transport[name] for name in ("time_s", "elevator_rad", "thrust_n", *left)}
    found = identify_coefficients(
        Sweep(study="less", records=(replace(transport, columns=columns),)), replace(OPTIONS, method=method)
    )
    off = np.abs(found.model.numbers - NUMBERS) / found.model.standard_errors
    assert off.max() < 3.2


def test_biases_and_a_delay_are_told() -> None:
    record = _transport(1, bias=True, late_s=LATE_S)
    biases = Biases(alpha_rad=0.02, az_m_s2=0.5, elevator_delay_s=0.1)
    found = identify_coefficients(Sweep(study="biased", records=(record,)), replace(OPTIONS, biases=biases))
    (one,) = found.stretches
    values, errors = (dict(zip(one.names, array.tolist(), strict=True)) for array in (one.values, one.errors))
    for name, truth in (("alpha bias", 0.01), ("az bias", 0.2), ("elevator delay", LATE_S)):
        assert abs(values[name] - truth) < 3.2 * errors[name], name
        assert abs(values[name]) > 5.0 * errors[name], name
    off = np.abs(found.model.numbers - NUMBERS) / found.model.standard_errors
    assert off.max() < 3.2
    unaware = identify_coefficients(Sweep(study="unaware", records=(record,)), OPTIONS)
    assert (np.abs(unaware.model.numbers - NUMBERS) / unaware.model.standard_errors).max() > 5.0
    with pytest.raises(InputError, match="output error and filter error only"):
        identify_coefficients(
            Sweep(study="biased", records=(record,)),
            replace(OPTIONS, biases=biases, method=CoefficientMethod.EQUATION_ERROR),
        )


def test_a_table_in_knots_feet_and_degrees_is_the_same_flight(
    transport: FlightRecord, fitted: CoefficientIdentification
) -> None:
    frame = transport.frame()
    frame["TAS"] = from_si(frame.pop("airspeed_m_s").to_numpy(), "kt")
    frame["AoA"] = from_si(frame.pop("alpha_rad").to_numpy(), "deg")
    frame["Nz"] = -from_si(frame.pop("az_m_s2").to_numpy(), "g")
    frame["thrust"] = from_si(frame.pop("thrust_n").to_numpy(), "lbf")
    columns = {"TAS": "airspeed_kt", "AoA": "alpha_deg", "Nz": "az_g", "thrust": "thrust_lbf"}
    same = ("time_s", "theta_rad", "q_rad_s", "q_dot_rad_s2", "ax_m_s2", "elevator_rad")
    record = record_from_frame(
        frame,
        name="table",
        condition=CRUISE,
        hold=Hold.FOH,
        columns={**columns, **{name: name for name in same}},
        factors={"az": -1.0},
    )
    found = identify_coefficients(Sweep(study="table", records=(record,)), OPTIONS)
    np.testing.assert_allclose(found.model.numbers, fitted.model.numbers, rtol=1e-6)
    np.testing.assert_allclose(found.model.standard_errors, fitted.model.standard_errors, rtol=1e-5)


def test_known_and_bounded_numbers(transport: FlightRecord, fitted: CoefficientIdentification) -> None:
    sweep = Sweep(study="known", records=(transport,))
    free = dict(zip(DRAG_LIFT.labels(), fitted.model.standard_errors.tolist(), strict=True))
    form = DRAG_LIFT.fix("Cm", "reference_pitch_rate", -34.7)
    known = identify_coefficients(sweep, replace(OPTIONS, form=form)).model
    errors = dict(zip(form.labels(), known.standard_errors.tolist(), strict=True))
    assert known.number("reference_pitch_rate in Cm") == -34.7
    assert errors["reference_pitch_rate in Cm"] == 0.0
    assert errors["elevator in Cm"] < 0.8 * free["elevator in Cm"]  # which the damping went with
    # A bound that holds changes nothing; one that does not is where the number ends.
    wide = identify_coefficients(sweep, replace(OPTIONS, form=DRAG_LIFT.bound("CL", "alpha", 4.0, 5.0))).model
    np.testing.assert_allclose(wide.numbers, fitted.model.numbers, rtol=1e-9)
    narrow = identify_coefficients(sweep, replace(OPTIONS, form=DRAG_LIFT.bound("CL", "alpha", 4.5, 6.0)))
    assert narrow.model.number("alpha in CL") == 4.5
    assert any("at their bound: alpha in CL" in warning for warning in narrow.warnings)


def test_what_the_data_cannot_tell_is_refused(transport: FlightRecord) -> None:
    twice = CoefficientForm.parse(
        Axes.WIND,
        ["1", "alpha"],
        ["1", "alpha"],
        [
            "1",
            "alpha",
            "elevator",
            "pitch_rate",
            "pitch_rate*speed_ratio",
            "reference_pitch_rate",
        ],  # the last two agree
    )
    with pytest.raises(RefusedError, match=r"cannot tell apart.*reference_pitch_rate"):
        identify_coefficients(Sweep(study="twice", records=(transport,)), replace(OPTIONS, form=twice))
    still = transport.with_columns(elevator_rad=np.zeros(len(transport)))
    with pytest.raises(RefusedError, match="nothing about: elevator in Cm"):
        identify_coefficients(Sweep(study="still", records=(still,)), OPTIONS)


def _without(name: str) -> Callable[[FlightRecord], FlightRecord]:
    return lambda record: replace(record, columns={k: v for k, v in record.columns.items() if k != name})


@pytest.mark.parametrize(
    ("spoiled", "options", "says"),
    [
        (_without("airspeed_m_s"), OPTIONS, "has no airspeed_m_s"),
        (_without("ax_m_s2"), replace(OPTIONS, outputs=("ax_m_s2", "q_rad_s")), "has no ax_m_s2"),
        (lambda r: r.with_columns(airspeed_m_s=r["airspeed_m_s"] - 110.0), OPTIONS, "airspeed falls to"),
        (lambda r: r.with_columns(alpha_rad=from_si(r["alpha_rad"], "deg")), OPTIONS, "alpha leaves ±180 deg"),
        (lambda r: r.with_columns(theta_rad=from_si(r["theta_rad"], "deg")), OPTIONS, "theta leaves ±180 deg"),
        (lambda r: r, replace(OPTIONS, method=CoefficientMethod.FREQUENCY, biases=Biases(q_rad_s=1.0)), "output error"),
        (
            lambda r: r,
            replace(OPTIONS, method=CoefficientMethod.FILTER_ERROR, noise_correlated=True),
            "filter error takes the noise of the outputs for independent",
        ),
        (_without("theta_rad"), replace(OPTIONS, biases=Biases(theta_rad=0.1)), "bias of theta_rad"),
    ],
)
def test_mistakes_are_named(
    transport: FlightRecord,
    spoiled: Callable[[FlightRecord], FlightRecord],
    options: CoefficientOptions,
    says: str,
) -> None:
    with pytest.raises(InputError, match=says):
        identify_coefficients(Sweep(study="wrong", records=(spoiled(transport),)), options)


def test_a_banked_flight_is_named(transport: FlightRecord) -> None:
    banked = transport.with_columns(phi_rad=np.full(len(transport), 0.5))
    found = identify_coefficients(Sweep(study="banked", records=(banked,)), OPTIONS)
    assert "'transport' up to 29 deg" in found.warnings[0]


def test_missing_samples_split_a_flight(transport: FlightRecord) -> None:
    alpha = np.array(transport["alpha_rad"])
    alpha[500:520] = np.nan
    found = identify_coefficients(Sweep(study="gap", records=(transport.with_columns(alpha_rad=alpha),)), OPTIONS)
    assert [one.samples for one in found.stretches] == [500, 481]
    off = np.abs(found.model.numbers - NUMBERS) / found.model.standard_errors
    assert off.max() < 3.2


@pytest.mark.parametrize("axes", list(Axes))
def test_the_reduced_model_is_the_motion_at_its_condition(axes: Axes, fitted: CoefficientIdentification) -> None:
    frame = replace(TRANSPORT, reference_x_m=-0.1, reference_z_m=0.2, thrust_n=12e3)
    if axes is Axes.WIND:
        model = replace(fitted.model, airframe=frame)
    else:
        form = CoefficientForm.parse(
            axes,
            ["1", "alpha", "speed_ratio"],
            ["1", "alpha", "pitch_rate"],
            ["1", "pitch_rate+alpha_rate", "elevator"],
        )
        numbers = np.array([-0.03, 0.2, 0.05, -0.2, -4.5, -8.0, 0.03, -20.0, -1.4])
        domain = np.tile([-1.0, 2.0], (6, 1))
        model = replace(
            fitted.model, form=form, airframe=frame, numbers=numbers, covariance=np.eye(9) * 1e-6, domain=domain
        )
    condition = replace(CRUISE, airspeed_m_s=115.0, density_kg_m3=0.9)
    reduced = model.reduced(condition, order=9)
    terms = layout(model.form, frame, 104.67)
    for alpha, q, elevator in ((0.1, 0.2, -0.05), (0.4, -0.3, 0.1), (-0.2, 0.0, 0.0)):
        # The level flight of the reduction: the flight path is horizontal, θ = α.
        state, air = np.array([[115.0, alpha, alpha, q]]), (np.array([0.9]), np.array([12e3]))
        rates = motion(terms, model.numbers, state, np.array([[elevator]]), *air, 9.80665).rates[0]
        # The series leaves |α|¹⁰ / 10! = 3e-11 of forces of some 5 rad/s² out.
        assert float(reduced.alpha_dot(alpha, q, elevator)) == pytest.approx(rates[1], abs=1e-9)
        assert float(reduced.q_dot(alpha, q, elevator)) == pytest.approx(rates[3], abs=1e-9)


def test_a_form_names_its_mistakes() -> None:
    with pytest.raises(InputError, match="q_rad_s is no variable"):
        CoefficientForm.parse(Axes.BODY, ["1"], ["q"], ["1"])
    with pytest.raises(InputError, match="no record holds flap_rad"):
        CoefficientForm.parse(Axes.BODY, ["1"], ["flap_rad"], ["1"])
    with pytest.raises(InputError, match="follows from the forces"):
        CoefficientForm.parse(Axes.BODY, ["1"], ["alpha_rate"], ["1"])
    with pytest.raises(InputError, match="first power only"):
        CoefficientForm.parse(Axes.BODY, ["1"], ["1"], ["alpha_rate^2"])
    with pytest.raises(InputError, match="no CL in body axes"):
        CoefficientForm.parse(Axes.BODY, ["1"], ["1"], ["1"]).fix("CL", "1", 0.0)
    with pytest.raises(InputError, match="Cm has no term alpha"):
        CoefficientForm.parse(Axes.BODY, ["1"], ["1"], ["1"]).bound("Cm", "alpha", 0.0, 1.0)


def _with_own_color(record: FlightRecord, random: np.random.Generator) -> FlightRecord:
    """Add noise with a memory of ten samples to alpha, as large again as a usual vane's."""
    noise = lfilter([to_si(0.2, "deg")], [1.0, -0.9], random.standard_normal(len(record)))
    return record.with_columns(alpha_rad=record["alpha_rad"] + noise)


@pytest.mark.parametrize("method", [method for method in CoefficientMethod if method != "filter-error"])
def test_noise_with_a_color_of_its_own_is_told(
    study: ModuleType, flown: dict[Hold, tuple[FlightRecord, ...]], method: CoefficientMethod
) -> None:
    random = np.random.default_rng(4)
    sweep = study.measured(flown[Hold.ZOH], 1)
    colored = replace(sweep, records=tuple(_with_own_color(record, random) for record in sweep.records))
    options = replace(_options(study, method), outputs=("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s"))
    said = "times those that the white noise"
    if method is CoefficientMethod.OUTPUT_ERROR:
        said = "larger than the white noise of the records, by factors: alpha_rad"
    assert not any(said in warning for warning in identify_coefficients(sweep, options).warnings)
    assert any(said in warning for warning in identify_coefficients(colored, options).warnings)


def test_rates_without_accelerometers_do_not_widen_the_errors(make_record: Callable[..., FlightRecord]) -> None:
    """Noise of dV/dt averages out over a flight, as neighboring rates err oppositely: drag is known that well."""
    density, speed, alpha, area = 0.26548, 100.0, 0.05, 30.0
    airframe = Airframe(mass_kg=1000.0, wing_area_m2=area, chord_m=2.0, pitch_inertia_kg_m2=3000.0, thrust_n=1000.0)
    form = CoefficientForm.parse(Axes.WIND, ["1"], ["1"], ["1"])
    options = CoefficientOptions(
        airframe=airframe, form=form, reference_speed_m_s=speed, method=CoefficientMethod.EQUATION_ERROR
    )
    drag = 1000.0 * np.cos(alpha) / (0.5 * density * speed**2 * area)
    off = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        one = np.ones(751)
        noise = random.standard_normal((751, 4)) * [0.1, 1e-5, 1e-5, 1e-5]
        record = make_record("level", noise[:, 2:] + [alpha, 0.0], 0.0 * one, interval_s=0.02)
        record = record.with_columns(airspeed_m_s=speed + noise[:, 0], theta_rad=alpha + noise[:, 1])
        found = identify_coefficients(Sweep(study="level", records=(record,)), options)
        off.append((found.model.numbers[0] - drag) / found.model.standard_errors[0])
    assert 0.4 < float(np.sqrt(np.mean(np.square(off)))) < 2.0

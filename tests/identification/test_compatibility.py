"""Faults of instruments against motions whose rates and forces are exact derivatives; no integrator is shared."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.errors import InputError, RefusedError
from finback.identification.compatibility import check
from finback.identification.compatibility.check import Compatibility, check_compatibility
from finback.identification.compatibility.correct import corrected
from finback.identification.compatibility.fault import ALL, CompatibilityOptions, Fault, Kind
from finback.identification.compatibility.flight_path import Sideward, flight_path
from finback.identification.compatibility.judgement import Knowledge, hanging_together, judged
from finback.identification.compatibility.piece import Piece, edges
from finback.identification.compatibility.reconstruction import Reconstruction
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
RATES_FORCES = ("p_rad_s", "q_rad_s", "r_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")


def _study() -> ModuleType:
    sys.path.insert(0, str(SCRIPTS))
    try:
        return importlib.import_module("compatibility_identification")
    finally:
        sys.path.pop(0)


STUDY = _study()
SIX, PLANE = STUDY.Case(), STUDY.Case(plane=True)


def _checked(case: object, faults: dict[str, float], *, seed: int = 0) -> Compatibility:
    return check_compatibility([STUDY.flight(seed, case, faults)])


def _only(record: FlightRecord, *names: str) -> FlightRecord:
    return replace(record, columns={name: record[name] for name in ("time_s", *names)})


def test_the_path_is_that_of_an_integrator_of_eighth_order() -> None:
    """Euler angles by DOP853 against quaternions by RK4: 50 Hz, 5 rad/s; (h ω)⁵/120 · 200 steps is 5e-6 of an angle."""
    time, step = np.linspace(0.0, 4.0, 201), 0.02

    def rates(now: float, state: np.ndarray) -> list[float]:
        phi, theta, _, u, v, w, _ = state
        p, q, r, ax, ay, az = (float(STUDY.true_values(np.array([now]), plane=False)[name][0]) for name in RATES_FORCES)
        s, c, g = np.sin, np.cos, STUDY.GRAVITY
        return [
            p + np.tan(theta) * (q * s(phi) + r * c(phi)),
            q * c(phi) - r * s(phi),
            (q * s(phi) + r * c(phi)) / c(theta),
            r * v - q * w - g * s(theta) + ax,
            p * w - r * u + g * c(theta) * s(phi) + ay,
            q * u - p * v + g * c(theta) * c(phi) + az,
            u * s(theta) - v * s(phi) * c(theta) - w * c(phi) * c(theta),
        ]

    start = np.array([0.2, 0.1, 0.5, 95.0, 3.0, 8.0])
    exact = solve_ivp(rates, (0.0, 4.0), [*start, 0.0], method="DOP853", t_eval=time, rtol=1e-10, atol=1e-10).y.T
    at = [STUDY.true_values(when, plane=False) for when in (time, time[:-1] + 0.5 * step)]
    path = flight_path(
        *(np.column_stack([values[name] for name in RATES_FORCES]) for values in at),
        interval_s=step,
        gravity_m_s2=STUDY.GRAVITY,
        start=start,
        sideward=Sideward(free=True, velocity_m_s=np.zeros(201), middles_m_s=np.zeros(200)),
    )
    np.testing.assert_allclose(path.attitude_rad, exact[:, :3], atol=1e-5)
    np.testing.assert_allclose(path.velocity_m_s, exact[:, 3:6], atol=1e-3)  # 100 m/s times such an angle
    np.testing.assert_allclose(path.height_m, exact[:, 6], atol=4e-3)


@pytest.mark.parametrize(
    "faults",
    [
        {"theta bias": 0.02},
        {"airspeed bias": 5.0, "airspeed delay": 0.2},
        {"az scale": 0.05, "ax scale": -0.03},
        {"q scale": 0.03, "theta scale": -0.02, "alpha scale": 0.1},
        {"phi delay": -0.05, "beta bias": 0.02, "ay delay": 0.04, "p scale": 0.02, "psi delay": 0.03},
    ],
)
def test_a_fault_is_found_and_no_other_is_blamed(faults: dict[str, float]) -> None:
    """Of 36 faults at 95 %, 1.7 are beyond by chance and 6 once in 100 records; none is beyond 4 standard errors."""
    found = _checked(SIX, faults)
    assert {error.name for error in found.errors if error.known} >= set(faults)
    off = [(error.value - faults.get(error.name, 0.0)) / error.standard_error for error in found.errors]
    assert np.max(np.abs(off)) < 4.0
    assert sum(error.significant and error.name not in faults for error in found.errors) < 6


@pytest.mark.parametrize(
    ("case", "most"), [(SIX, 2.0), pytest.param(replace(SIX, gust_m_s=0.5), 2.0, marks=pytest.mark.slow)]
)
def test_stated_errors_are_the_real_ones(case: object, most: float) -> None:
    """Mean square of (estimate − truth)/error over 2 seeds of some 30 faults, about 10 independent each: 1 ± 0.32."""
    off = []
    for seed in range(2):
        truth = STUDY.drawn(seed, 0.5)
        found = _checked(case, truth, seed=seed)
        off += [(error.value - truth[error.name]) / error.standard_error for error in found.errors if error.known]
    assert len(off) > 45
    assert 0.3 < float(np.mean(np.square(off))) < most


def test_a_late_attitude_makes_no_rate_better_known_than_its_noise_allows() -> None:
    """A bias that is the mean of n samples of white noise is known to σ/√n at best, whatever else is measured."""
    found = _checked(STUDY.Case(duration_s=40.0), STUDY.drawn(0, 0.5))
    for name in ("p", "q", "r"):
        best = STUDY.NOISE[f"{name}_rad_s"] / np.sqrt(2000.0)
        assert 0.85 * best < found.error(f"{name} bias").standard_error < 2.0 * best


def _three_two_one_one(seed: int) -> FlightRecord:
    """Measure a jet of 150 m/s without any fault that flies a 3-2-1-1 in the vertical plane, 20 s at 100 Hz."""
    lift, mass, pressure, steps = 28.0 * 3.6, 9000.0, 0.4, 2.0 + 0.85 * np.array([0, 3, 5, 6, 7])
    level = mass * STUDY.GRAVITY / (pressure * 150.0**2 * lift)

    def forces(time: float, state: np.ndarray) -> tuple[float, float, float]:
        u, w, q, _ = state
        square, alpha = pressure * (u * u + w * w), np.arctan2(w, u)
        push = np.radians(3.0) * (0, 1, -1, 1, -1, 0)[int(np.searchsorted(steps, time, side="right"))]
        up = 28.0 * (3.6 * alpha + 0.5 * push)
        drag = 28.0 * (0.02 + 0.12 * (up / 28.0) ** 2)
        thrust = pressure * 150.0**2 * 28.0 * (0.02 + 0.12 * (3.6 * level) ** 2)
        moment = 28.0 * 3.4 * (-0.3 * (alpha - level) - 0.6 * push - 8.5 * q / np.hypot(u, w))
        return (
            (square * (up * np.sin(alpha) - drag * np.cos(alpha)) + thrust) / mass,
            -square * (up * np.cos(alpha) + drag * np.sin(alpha)) / mass,
            square * moment / 75_000.0,
        )

    def rates(time: float, state: np.ndarray) -> list[float]:
        (u, w, q, theta), (ax, az, turn) = state, forces(time, state)
        g = STUDY.GRAVITY
        return [ax - q * w - g * np.sin(theta), az + q * u + g * np.cos(theta), turn, q]

    time = np.arange(2000) / 100.0
    start = [150.0 * np.cos(level), 150.0 * np.sin(level), 0.0, level]
    state = solve_ivp(rates, (0.0, 20.0), start, t_eval=time, max_step=0.05, rtol=1e-8, atol=1e-8).y.T
    felt = np.array([forces(now, row) for now, row in zip(time, state, strict=True)])
    u, w, q, theta = state.T
    true = {"q_rad_s": q, "ax_m_s2": felt[:, 0], "az_m_s2": felt[:, 1],
            "airspeed_m_s": np.hypot(u, w), "alpha_rad": np.arctan2(w, u), "theta_rad": theta}  # fmt: skip
    random = np.random.default_rng([seed, 77])
    columns = {name: values + STUDY.NOISE[name] * random.standard_normal(time.size) for name, values in true.items()}
    return replace(STUDY.flight(0, PLANE, {}), columns={"time_s": time, **columns})


def test_two_delays_that_can_stand_for_each_other_are_not_told_of_a_faultless_flight() -> None:
    """Delays of ax and of the airspeed make a valley, flat between ±0.1 s: at its walls they look known to 0.03 s."""
    for seed in (0, 6):
        found = check_compatibility([_three_two_one_one(seed)])
        off = {error.name: error.value / error.standard_error for error in found.errors if error.known}
        assert {"alpha bias", "alpha scale", "alpha delay", "theta delay", "az delay"} <= set(off)
        assert max(map(abs, off.values())) < 3.5


def test_the_mean_of_few_gusts_is_not_known_as_if_their_strength_were() -> None:
    """A mean over T = 20 s of gusts of τ = 3 s has σ √(2τ/T (1 − τ/T)) = 1.01 m/s: 0.0101 rad of an angle at 100 m/s.

    In this record the gusts happen to look faster and weaker than they are.
    """
    found = _checked(STUDY.Case(gust_m_s=2.0, gust_s=3.0), STUDY.drawn(9, 0.5), seed=9)
    assert min(found.error(name).standard_error for name in ("alpha bias", "beta bias")) > 0.0101


def test_gusts_are_told_from_the_motion() -> None:
    found = _checked(replace(SIX, gust_m_s=1.0), {})
    assert set(found.air.gusts_m_s) == {"airspeed_m_s", "alpha_rad", "beta_rad"}
    for size in found.air.gusts_m_s.values():
        assert size == pytest.approx(1.0, rel=0.5)  # 20 correlation times in a record
    assert not _checked(SIX, {}).air.moved


def test_what_is_known_only_together_is_said_so() -> None:
    """The vertical force is nearly g in the vertical plane: its bias and its scale are one number."""
    faults = {"az bias": 0.3, "az scale": 0.04}
    found = _checked(PLANE, faults)
    assert found.error("az bias").knowledge is Knowledge.TOGETHER
    assert found.error("az bias").standard_error == np.inf
    (sum_,) = [one for one in found.combinations if "az bias" in one.names]
    true = sum(weight * faults.get(name, 0.0) for weight, name in zip(sum_.weights, sum_.names, strict=True))
    assert abs(sum_.value - true) < 3.0 * sum_.standard_error
    assert "known only together" in sum_.sentence()
    # Said to have no fault, the one gives its number to the other.
    told = check_compatibility([STUDY.flight(0, PLANE, faults)], CompatibilityOptions(sizes={"az scale": 0.0}))
    assert told.error("az bias").known
    assert "az scale" not in {error.name for error in told.errors}


def test_flights_together_tell_more_than_each() -> None:
    each = [STUDY.flight(seed, PLANE, {"alpha scale": 0.1}) for seed in range(2)]
    alone = check_compatibility(each[:1]).error("alpha scale")
    both = check_compatibility(each).error("alpha scale")
    assert both.standard_error < 0.85 * alone.standard_error
    assert abs(both.value - 0.1) < 3.0 * both.standard_error


def test_straight_and_level_tells_no_scale_and_no_delay() -> None:
    random, time = np.random.default_rng(1), np.arange(0.0, 10.0, 0.02)
    level = {"alpha_rad": 0.05, "theta_rad": 0.05, "airspeed_m_s": 100.0, "q_rad_s": 0.0,
             "ax_m_s2": STUDY.GRAVITY * np.sin(0.05), "az_m_s2": -STUDY.GRAVITY * np.cos(0.05)}  # fmt: skip
    columns = {name: value + STUDY.NOISE[name] * random.standard_normal(time.size) for name, value in level.items()}
    found = check_compatibility([replace(STUDY.flight(0, PLANE, {}), columns={"time_s": time, **columns})])
    assert not [error.name for error in found.errors if error.known and error.name.endswith(("scale", "delay"))]


def test_pitch_alone_is_checked_and_the_rest_is_named() -> None:
    record = _only(STUDY.flight(3, PLANE, {"q bias": 5e-3, "theta delay": 0.05}), "q_rad_s", "theta_rad")
    found = check_compatibility([record])
    assert found.error("q bias").value == pytest.approx(5e-3, abs=3e-4)
    assert found.error("theta delay").value == pytest.approx(0.05, abs=5e-3)
    assert found.error("theta bias").knowledge is Knowledge.UNKNOWN  # the start takes it up
    assert any("there is no ax_m_s2, az_m_s2" in note for note in found.not_checked)


def test_gaps_divide_a_flight_and_missing_outputs_are_left_out() -> None:
    record = STUDY.flight(0, PLANE, {"alpha bias": 0.02})
    q, alpha = record["q_rad_s"].copy(), record["alpha_rad"].copy()
    q[400:430] = np.nan
    alpha[::2] = np.nan
    found = check_compatibility([record.with_columns(q_rad_s=q, alpha_rad=alpha)])
    whole = check_compatibility([record])
    bias = found.error("alpha bias")
    assert abs(bias.value - 0.02) < 4.0 * bias.standard_error
    assert bias.standard_error > whole.error("alpha bias").standard_error


def test_rising_air_is_no_fault_of_an_instrument() -> None:
    case = STUDY.Case(altitude=True, wind_up_m_s=3.0)
    found = _checked(case, {})
    off = [error.value / error.standard_error for error in found.errors if error.known]
    assert "altitude delay" in {error.name for error in found.errors if error.known}
    assert np.max(np.abs(off)) < 4.0


def test_what_was_taken_out_is_no_longer_there() -> None:
    faults = {"alpha delay": 0.04, "theta bias": 0.02, "az delay": 0.03, "airspeed scale": 0.05}
    record = STUDY.flight(5, SIX, faults)
    mended, taken_out = corrected(record, check_compatibility([record]))
    assert {error.name for error in taken_out} >= set(faults)
    again = check_compatibility([mended])
    assert not [name for name in faults if again.error(name).significant]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("theta_rad",), "without q_rad_s"),
        (("q_rad_s",), "record the pitch angle"),
        (("q_rad_s", "theta_rad", "phi_rad"), "banks by"),
    ],
)
def test_what_cannot_be_checked_is_refused_with_its_reason(names: tuple[str, ...], said: str) -> None:
    with pytest.raises(RefusedError) as error:
        check_compatibility([_only(STUDY.flight(0, SIX, {}), *names)])
    assert said in str(error.value)


def test_jitter_and_short_records_are_refused() -> None:
    record = STUDY.flight(0, PLANE, {})
    time = record["time_s"] + 0.004 * np.random.default_rng(0).random(len(record))
    with pytest.raises(RefusedError, match="not uniform"):
        check_compatibility([record.with_columns(time_s=time)])
    short = replace(record, columns={name: values[:10] for name, values in record.columns.items()})
    with pytest.raises(RefusedError, match="no 20 samples"):
        check_compatibility([short])
    with pytest.raises(RefusedError, match="no flight"):
        check_compatibility([])


def test_a_fault_that_nobody_has_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="no instrument has a fault 'alfa bias'"):
        CompatibilityOptions(sizes={"alfa bias": 1.0})
    with pytest.raises(InputError, match="expected a number >= 0"):
        CompatibilityOptions(sizes={"alpha bias": -1.0})


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(1e-4, 0.05))
def test_of_two_faults_that_only_differ_in_noise_the_sum_is_known(seed: int, error: float) -> None:
    """Information along one direction alone: neither is determined, their weighted sum is, whatever the direction."""
    way = np.random.default_rng(seed).uniform(0.5, 1.0, 2)
    faults = (Fault(channel="ax_m_s2", kind=Kind.BIAS), Fault(channel="theta_rad", kind=Kind.BIAS))
    covariance = np.linalg.inv(np.outer(way, way) / error**2 + np.eye(2))
    found = judged(faults, way, covariance, np.ones(2))
    assert {one.knowledge for one in found.errors} == {Knowledge.TOGETHER}
    (sum_,) = found.combinations
    weights = np.array(sum_.weights)[[sum_.names.index(fault.name) for fault in faults]]
    assert weights[0] * way[1] == pytest.approx(weights[1] * way[0], rel=0.02)
    assert sum_.standard_error < 3.0 * error


def test_every_fault_has_a_name_of_its_own_and_a_unit() -> None:
    assert len({fault.name for fault in ALL}) == len(ALL)
    assert {fault.unit for fault in ALL} == {"rad_s", "m_s2", "m_s", "rad", "1", "s"}


def test_a_wrong_unit_is_found_as_a_scale_or_said_to_fit_nowhere() -> None:
    record = STUDY.flight(0, replace(SIX, duration_s=6.0, rate_hz=25.0), {})
    scale = check_compatibility([record.with_columns(az_m_s2=record["az_m_s2"] / STUDY.GRAVITY)]).error("az scale")
    assert abs(scale.value - (1.0 / STUDY.GRAVITY - 1.0)) < 4.0 * scale.standard_error
    for wrong in ({"alpha_rad": np.degrees(record["alpha_rad"])}, {"az_m_s2": -record["az_m_s2"]}):
        found = check_compatibility([record.with_columns(**wrong)])
        assert any("they do not tell one motion" in note for note in found.not_checked)
        # Nothing is said of flow and forces then; the attitudes are judged by themselves.
        assert {error.name.split()[0] for error in found.errors} == {"p", "q", "r", "phi", "theta", "psi"}
    with pytest.raises(RefusedError, match="do not tell one motion"):
        check_compatibility([record.with_columns(theta_rad=np.degrees(record["theta_rad"]))])


@pytest.mark.parametrize(
    ("channel", "delay_s", "expected"),
    [
        ("alpha_rad", 0.2, (0.2, 0.0)),
        ("alpha_rad", -0.2, (0.0, 0.2)),
        ("az_m_s2", 0.2, (0.0, 0.2)),
        ("az_m_s2", -0.2, (0.2, 0.0)),
    ],
)
def test_nothing_is_compared_where_a_delay_asks_for_what_is_not_recorded(
    channel: str, delay_s: float, expected: tuple[float, float]
) -> None:
    """An output is implied by the motion before it; an input without its delay is the one measured after it."""
    assert edges((Fault(channel=channel, kind=Kind.DELAY),), np.array([delay_s])) == expected


def test_the_level_holds_for_all_numbers_of_a_check() -> None:
    """Two standard errors (a chance of 0.0455) are significant of one fault, not of six; 2.7 (0.0069) are of six."""
    names = ("ax_m_s2", "az_m_s2", "theta_rad", "alpha_rad", "airspeed_m_s", "q_rad_s")
    faults = tuple(Fault(channel=name, kind=Kind.BIAS) for name in names)
    for count, off, told in ((1, 2.0, True), (6, 2.0, False), (6, 2.7, True)):
        values = np.array([0.01 * off, *np.zeros(count - 1)])
        found = judged(faults[:count], values, 1e-4 * np.eye(count), np.ones(count))
        assert [error.significant for error in found.errors] == [told, *[False] * (count - 1)]


def test_what_hangs_together_is_one_line_a_group() -> None:
    pairs = (("a", "b", 0.95), ("c", "d", -0.92), ("b", "e", 0.99))
    assert hanging_together(pairs) == (
        "c and d hang together (correlation -0.920)",
        "a, b and e hang together (correlation 0.950 to 0.990)",
    )
    assert hanging_together(()) == ()


def _in_gusts(seed: int, *, shown: bool) -> FlightRecord:
    """A short period in the vertical plane at 120 m/s, flown level by 3-2-1-1, whose air moves across the path.

    Gusts of 1.5 m/s and 1 s act on the aircraft and on alpha; others, drawn apart, on the airspeed if it shows any.
    """
    random = np.random.default_rng(seed)
    step, count, speed = 0.04, 501, 120.0
    time = step * np.arange(count)
    elevator = 0.04 * np.select([time < edge for edge in (1.0, 3.4, 5.0, 5.8, 6.6)], [0, 1, -1, 1, -1], 0)
    gusts = np.zeros((2, count))
    memory = np.exp(-step)
    for k in range(1, count):
        gusts[:, k] = memory * gusts[:, k - 1] + 1.5 * np.sqrt(1.0 - memory**2) * random.standard_normal(2)
    path = solve_ivp(
        lambda now, state: _short_period(state, *(float(np.interp(now, time, one)) for one in (elevator, gusts[0]))),
        (0.0, time[-1]), [0.0, 0.0, 0.0], t_eval=time, max_step=step, rtol=1e-7, atol=1e-9,
    ).y  # fmt: skip
    alpha, q, theta = path[0] + 0.07, path[1], path[2] + 0.07
    lift = speed * (-0.75 * (path[0] + gusts[0] / speed) - 0.06 * elevator) - STUDY.GRAVITY * np.cos(theta - alpha)
    drag = STUDY.GRAVITY * np.sin(theta - alpha)  # of a constant speed
    noise = random.standard_normal((6, count))
    return FlightRecord(
        name=f"seed {seed}",
        columns={
            "time_s": time,
            "alpha_rad": alpha + gusts[0] / speed + 0.0017 * noise[0],
            "q_rad_s": q + 0.0017 * noise[1],
            "theta_rad": theta + 0.0009 * noise[2],
            "airspeed_m_s": speed + (gusts[1] if shown else 0.0) + 0.1 * noise[3],
            "ax_m_s2": drag * np.cos(alpha) - lift * np.sin(alpha) + 0.02 * noise[4],
            "az_m_s2": drag * np.sin(alpha) + lift * np.cos(alpha) + 0.05 * noise[5],
            "elevator_rad": elevator,
        },
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=speed, density_kg_m3=0.9, gravity_m_s2=STUDY.GRAVITY, altitude_m=3000.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=Hold.ZOH,
    )


def _short_period(state: np.ndarray, elevator: float, gust: float) -> list[float]:
    alpha, q = state[0] + gust / 120.0, state[1]
    return [-0.75 * alpha + q - 0.06 * elevator, -1.9 * alpha - 1.1 * q - 2.2 * elevator, q]


@pytest.mark.parametrize(("seed", "shown"), [(2, False), (0, True)])
def test_gusts_across_the_path_are_no_bias_of_alpha(seed: int, shown: bool) -> None:  # noqa: FBT001 - a parameter
    """An airspeed that shows none asks for strengths of their own; else the mean of few gusts passes for known."""
    found = check_compatibility([_in_gusts(seed, shown=shown)])
    assert not [note for note in found.not_checked if "airspeed" in note]  # the estimate settles
    assert not [error.name for error in found.errors if error.known and abs(error.value) > 2.6 * error.standard_error]
    across, along = (found.air.gusts_m_s[name] for name in ("alpha_rad", "airspeed_m_s"))
    assert 0.75 < across < 3.0  # of 20 correlation times, to a factor of 2
    assert shown is (along > 0.5)


def test_an_estimate_without_end_is_not_laid_to_a_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is said against the instruments, and the attitudes, whose estimate ends, are still judged."""
    whole = check.reconstruct

    def unsettled(pieces: Sequence[Piece], *rest: Any) -> Reconstruction:
        found = whole(pieces, *rest)
        return replace(found, converged=not pieces[0].translation)

    monkeypatch.setattr(check, "reconstruct", unsettled)
    found = _checked(replace(PLANE, duration_s=6.0), {})
    (said,) = [note for note in found.not_checked if "settle" in note]
    assert "[instruments]" in said
    assert not any("may be wrong" in note for note in found.not_checked)
    assert found.error("theta scale")
    monkeypatch.setattr(check, "reconstruct", lambda *given: replace(whole(*given), converged=False))
    with pytest.raises(RefusedError, match="did not settle") as refused:
        _checked(replace(PLANE, duration_s=6.0), {})
    assert "unit" not in refused.value.hint

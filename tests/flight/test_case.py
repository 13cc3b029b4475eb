"""Cases flown as they are, against closed forms, an independent integrator, and JSBSim's own scripts."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import jsbsim
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj

from finback.errors import AircraftError, InputError
from finback.flight.case import Attitude, Case, FlownCase
from finback.flight.case_column import CASE_COLUMNS, CaseColumn
from finback.flight.case_drive import Drive
from finback.flight.case_flight import fly_case
from finback.flight.case_start import case_start
from finback.records import Outcome

DATA = Path(__file__).parent / "data"
BRICK = DATA / "aircraft" / "brick" / "brick.xml"
STILL = str(DATA / "still_sphere.xml")
INERTIA = np.array([0.001894220, 0.006211019, 0.007194665])  # slug ft²; only ratios matter without torque
RADIUS_M, GM_M3_S2 = 6_371_000.0, 3.986004418e14
SCRIPTS = Path(jsbsim.get_default_root_dir()) / "scripts"

TOP_RAD_S = 2e-7
"""Second order of the first step (which is Euler's) at 500 Hz, rates of 0.5 rad/s: 1e-7 measured."""
DROP_M = 1e-4
"""30 s of fall at 500 Hz: 2e-5 m measured, of an altitude that is a difference from the radius (6e6 m, 1e-9 m)."""


def _brick(start: dict[str, float], *, duration_s: float = 30.0, step_hz: float = 500.0, **more: object) -> FlownCase:
    case = Case(
        source=BRICK,
        start=case_start(start.items()),
        planet_file=STILL,
        duration_s=duration_s,
        step_s=1.0 / step_hz,
        **more,  # type: ignore[arg-type] # fields of Case
    )
    return fly_case(case)


def _rates(flown: FlownCase) -> np.ndarray:
    return np.column_stack([flown.columns[f"inertial_{axis}_rad_s"] for axis in "pqr"])


@pytest.mark.parametrize(("p", "r"), [(30.0, 10.0), (5.0, 30.0)])
def test_a_free_top_follows_the_elliptic_functions(p: float, r: float) -> None:
    """Both sides of the separatrix; Landau & Lifshitz, Mechanics, section 37."""
    flown = _brick({"altitude_m": 1e4, "p_deg_s": p, "r_deg_s": r})
    one, two, three = INERTIA
    start = np.radians([p, 0.0, r])
    energy, momentum = float(INERTIA @ start**2), float((INERTIA * start) @ (INERTIA * start))
    turned = momentum < energy * two
    if turned:
        one, three = three, one
    size = np.sqrt(
        [
            (energy * three - momentum) / (one * (three - one)),
            (energy * three - momentum) / (two * (three - two)),
            (momentum - energy * one) / (three * (three - one)),
        ]
    )
    speed = np.sqrt((three - two) * (momentum - energy * one) / (one * two * three))
    modulus = (two - one) * (energy * three - momentum) / ((three - two) * (momentum - energy * one))
    sn, cn, dn, _ = ellipj(speed * flown.columns["time_s"], modulus)
    # q begins with the sign of its derivative, (I3 − I1)/I2 r p > 0.
    expected = np.column_stack([size[0] * cn, size[1] * sn, size[2] * dn])[:, [2, 1, 0] if turned else [0, 1, 2]]
    assert np.abs(_rates(flown) - expected).max() < TOP_RAD_S


def test_energy_and_angular_momentum_of_a_tumble_stay() -> None:
    rates = _rates(_brick({"altitude_m": 1e4, "p_deg_s": 10.0, "q_deg_s": 20.0, "r_deg_s": 30.0}))
    for kept in (rates**2 @ INERTIA, (rates**2) @ INERTIA**2):
        assert np.ptp(kept) / kept[0] < 1e-6  # 3e-7 measured: the square of the error of the first step


@pytest.mark.parametrize("attitude", Attitude)
def test_the_angular_momentum_keeps_its_direction_in_space(attitude: Attitude) -> None:
    flown = _brick(
        {"altitude_m": 1e4, "p_deg_s": 10.0, "q_deg_s": 20.0, "r_deg_s": 30.0}, step_hz=100.0, attitude=attitude
    )
    phi, theta, psi = (flown.columns[f"{name}_rad"] for name in ("phi", "theta", "psi"))
    momentum = (_rates(flown) * INERTIA).T
    turned = _to_north_east_down(phi, theta, psi, momentum)
    drift = np.abs(turned - turned[:, :1]).max() / np.linalg.norm(momentum[:, 0])
    assert drift < 1e-5  # 4e-6 measured with either rule, from the first step


def _to_north_east_down(phi: np.ndarray, theta: np.ndarray, psi: np.ndarray, body: np.ndarray) -> np.ndarray:
    x, y, z = body
    y, z = y * np.cos(phi) - z * np.sin(phi), y * np.sin(phi) + z * np.cos(phi)
    x, z = x * np.cos(theta) + z * np.sin(theta), -x * np.sin(theta) + z * np.cos(theta)
    return np.array([x * np.cos(psi) - y * np.sin(psi), x * np.sin(psi) + y * np.cos(psi), z])


def test_a_drop_in_vacuum_follows_newton() -> None:
    flown = _brick({"altitude_ft": 30_000.0})
    time = flown.columns["time_s"]
    fall = solve_ivp(
        lambda _, state: [state[1], -GM_M3_S2 / state[0] ** 2],
        (0.0, time[-1]),
        [RADIUS_M + 9144.0, 0.0],
        method="DOP853",
        rtol=1e-13,
        atol=1e-9,
        t_eval=time,
    )
    assert np.abs(fall.y[0] - RADIUS_M - flown.columns["altitude_m"]).max() < DROP_M
    energy = 0.5 * flown.columns["velocity_down_m_s"] ** 2 - GM_M3_S2 / (RADIUS_M + flown.columns["altitude_m"])
    assert np.ptp(energy) < 1e-2  # of 4.3e4 J/kg gained; 1e-3 measured


def test_halving_the_step_quarters_the_error() -> None:
    ends = [
        _brick({"altitude_m": 1e4, "p_deg_s": 30.0, "r_deg_s": 40.0}, duration_s=10.0, step_hz=hz)
        for hz in (100.0, 200.0, 400.0)
    ]
    values = [_rates(flown)[-1] for flown in ends]
    ratio = np.linalg.norm(values[0] - values[1]) / np.linalg.norm(values[1] - values[2])
    assert 3.5 < ratio < 4.5


def test_a_script_keeps_its_start_step_and_events() -> None:
    flown = fly_case(Case(source=SCRIPTS / "c1722.xml", duration_s=5.0))
    assert flown.outcome is Outcome.COMPLETED
    assert float(flown.provenance["step_s"]) == pytest.approx(1 / 120, rel=1e-4)
    # The script's altitude is above its runway, an ellipsoid away from the sphere of h-sl: 5 mm.
    assert flown.columns["altitude_m"][0] == pytest.approx(4000 * 0.3048, abs=0.01)


def test_a_script_ends_where_it_says(tmp_path: Path) -> None:
    script = tmp_path / "short.xml"
    script.write_text(
        '<runscript name="short"><use aircraft="ball" initialize="reset00"/>'
        '<run start="0" end="0.5" dt="0.01"/></runscript>'
    )
    flown = fly_case(Case(source=script))
    assert flown.columns["time_s"][-1] == pytest.approx(0.5, abs=0.011)
    assert "the script ended" in flown.note


def test_a_script_without_a_step_is_a_fault_of_the_script(tmp_path: Path) -> None:
    script = tmp_path / "still.xml"
    script.write_text(
        '<runscript name="still"><use aircraft="ball" initialize="reset00"/>'
        '<run start="0" end="0.5" dt="0"/></runscript>'
    )
    with pytest.raises(InputError, match=r"its step is 0\.0 s"):
        fly_case(Case(source=script, duration_s=0.1))


def test_nothing_is_written_where_nobody_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ball has an output element of its own."""
    monkeypatch.chdir(tmp_path)
    fly_case(Case(source=SCRIPTS / "ball.xml", duration_s=0.1))
    assert list(tmp_path.iterdir()) == []


def test_a_schedule_is_written_before_the_step_that_goes_there() -> None:
    drive = Drive(
        jsbsim_property="fcs/throttle-cmd-norm", time_s=np.array([0.0, 0.1, 0.1]), values=np.array([0.0, 1.0, 0.5])
    )
    column = CaseColumn(name="throttle_1", jsbsim_property="fcs/throttle-cmd-norm", jsbsim_unit="1")
    aircraft = Path(jsbsim.get_default_root_dir()) / "aircraft" / "c172x" / "c172x.xml"
    start = case_start([("altitude_ft", 5000.0), ("airspeed_kt", 100.0)])
    flown = fly_case(
        Case(source=aircraft, start=start, drives=(drive,), columns=(column,), duration_s=0.2, step_s=0.01)
    )
    time = flown.columns["time_s"]
    expected = np.where(np.isclose(time, 0.1), 0.75, np.where(time < 0.1, time / 0.1, 0.5))
    np.testing.assert_allclose(flown.columns["throttle_1"], expected, atol=1e-9)


def test_start_names_are_converted_and_checked() -> None:
    start = case_start([("alpha_deg", 180.0), ("airspeed_ft_s", 1.0), ("altitude_ft", 7.0), ("mach", 0.5)][:3])
    assert dict(start.given) == pytest.approx({"alpha": np.pi, "airspeed": 0.3048, "altitude": 7.0 * 0.3048})
    assert dict(case_start([("mach", 0.5)]).given) == {"mach": 0.5}
    for wrong, said in (
        ([("alpa_deg", 1.0)], "no initial condition is called 'alpa'"),
        ([("alpha_ft", 1.0)], "'ft' does not measure alpha"),
        ([("alpha", 1.0)], "names no unit"),
        ([("alpha_deg", 1.0), ("alpha_rad", 1.0)], "'alpha' is given twice"),
        ([("airspeed_kt", -100.0)], "airspeed = -51.4444444 m_s"),
        ([("mach", -0.5)], "mach = -0.5"),
        ([("latitude_deg", 91.0)], "latitude = 91 deg"),
        ([("altitude_ft", -3e7)], "altitude = -9144000 m"),
        ([("altitude_ft", np.nan)], "altitude = nan"),
        ([("airspeed_kt", 100.0), ("mach", 0.5)], "say the same twice"),
        ([("airspeed_kt", 100.0), ("u_ft_s", 100.0)], "airspeed and u say the same twice"),
        ([("u_ft_s", 100.0), ("velocity_north_ft_s", 100.0)], "u and velocity_north say the same twice"),
        ([("latitude_deg", 10.0), ("geocentric_latitude_deg", 10.0)], "say the same twice"),
        ([("altitude_ft", 10.0), ("geodetic_altitude_ft", 10.0)], "say the same twice"),
        ([("p_deg_s", 10.0), ("inertial_p_deg_s", 10.0)], "say the same twice"),
        ([("ecef_x_m", 7e6), ("longitude_deg", 10.0)], "say the same twice"),
        ([("gamma_deg", 3.0), ("airspeed_m_s", 50.0), ("wind_east_m_s", 6.0)], "a wind with gamma"),
    ):
        with pytest.raises(InputError, match=said):
            case_start(wrong)


@pytest.mark.parametrize(("old", "name"), [(">5</emptywt>", "mass"), (">0.006211019</iyy>", "iyy")])
def test_nothing_flies_without_mass_or_inertia(tmp_path: Path, old: str, name: str) -> None:
    text = BRICK.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "aircraft" / "brick" / "brick.xml"
    path.parent.mkdir(parents=True)
    path.write_text(text.replace(old, ">0<" + old.partition("<")[2]), encoding="utf-8")
    with pytest.raises(AircraftError, match=f"brick.xml: 'inertia/{name}.*' is 0"):
        fly_case(Case(source=path, duration_s=0.1, step_s=0.01))


def test_what_the_start_takes_back_is_told() -> None:
    """JSBSim's start sets the wind from its own initial condition."""
    column = CaseColumn(name="wind_m_s", jsbsim_property="atmosphere/wind-east-fps", jsbsim_unit="ft_s")
    start = {"altitude_m": 1000.0, "airspeed_m_s": 50.0}
    lost = _brick(start, duration_s=0.1, columns=(column,))
    assert not any("again" in word for word in lost.warnings)
    case = Case(source=BRICK, settings=(("atmosphere/wind-east-fps", 20.0),), duration_s=0.1, columns=(column,))
    flown = fly_case(replace(case, step_s=0.01))
    assert "the start has made 'atmosphere/wind-east-fps' 0 again, not 20" in " ".join(flown.warnings)
    assert not flown.columns["wind_m_s"].any()
    windy = _brick({"altitude_m": 1000.0, "u_m_s": 50.0, "wind_east_ft_s": 20.0}, duration_s=0.1, columns=(column,))
    np.testing.assert_allclose(windy.columns["wind_m_s"], 20 * 0.3048, rtol=1e-12)


@pytest.mark.parametrize(
    ("case", "error", "said"),
    [
        (Case(source=BRICK), InputError, "needs a duration"),
        (Case(source=BRICK, duration_s=1.0, settings=(("ic/alpha-deg", np.nan),)), InputError, "would become nan"),
        (Case(source=BRICK, duration_s=1.0, settings=(("ic/alfa-deg", 1.0),)), AircraftError, "no property"),
        (Case(source=BRICK, duration_s=1.0, settings=(("aero/alpha-rad", 1.0),)), AircraftError, "read-only"),
        (Case(source=DATA / "still_sphere.xml", duration_s=1.0), AircraftError, "JSBSim does not load it"),
        (Case(source=BRICK, duration_s=1.0, step_s=0.01, sample_interval_s=0.015), InputError, "sample interval"),
    ],
)
def test_faults_name_what_is_wrong(case: Case, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        fly_case(case)


def test_every_column_names_its_unit_once() -> None:
    names = [column.name for column in CASE_COLUMNS]
    assert len(names) == len(set(names))
    with pytest.raises(InputError, match="SI unit"):
        CaseColumn(name="alpha_deg", jsbsim_property="aero/alpha-deg", jsbsim_unit="deg")


@pytest.mark.parametrize(("printed", "every"), [("0.008333", 6), ("0.00833333", 6), ("0.01", 5)])
def test_a_script_prints_its_step_with_a_few_digits(tmp_path: Path, printed: str, every: int) -> None:
    text = (SCRIPTS / "ball.xml").read_text()
    script = tmp_path / "it.xml"
    script.write_text(re.sub(r'dt="[^"]*"', f'dt="{printed}"', text))
    flown = fly_case(Case(source=script, duration_s=0.2, sample_interval_s=0.05))
    np.testing.assert_allclose(np.diff(flown.columns["time_s"]), every * float(printed), rtol=1e-9)
    for interval in (0.052, 0.0505):
        with pytest.raises(InputError, match="no whole number of steps"):
            fly_case(Case(source=script, duration_s=0.2, sample_interval_s=interval))

"""``finback coefficients``: a setup and tables in, numbers, a file and a model for ``analyze`` out."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.lienard import LienardSystem
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.shooting import shoot
from finback.identification.coefficient.track import Track
from finback.records import Condition, Hold, Sweep
from finback.store.coefficient_setup import read_coefficient_setup
from finback.store.coefficients import read_coefficients, read_flights, write_reduced
from finback.store.model_file import read_model_file
from finback.units import from_si

ROOT = Path(__file__).resolve().parents[2]
RUNNER = CliRunner()
FORM = CoefficientForm.parse(
    Axes.WIND, ["1", "alpha^2"], ["1", "alpha", "elevator"], ["1", "alpha", "pitch_rate", "elevator"]
)
NUMBERS = np.array([0.03, 1.2, 0.25, 4.4, 0.4, 0.03, -0.9, -14.0, -1.3])
FRAME = Airframe(mass_kg=5000.0, wing_area_m2=25.0, chord_m=2.0, pitch_inertia_kg_m2=2e4)
THRUST_N = 7e3
SETUP = """
schema = "finback/coefficient-setup/1"
name = "a trainer"

[airframe]
mass_kg = 5000.0
wing_area_m2 = 25.0
chord_m = 2.0
pitch_inertia_kg_m2 = 2e4
thrust_kn = 7.0

[condition]
airspeed_m_s = 100.0
density_kg_m3 = 1.0

[form]
CD = ["1", "alpha^2"]
CL = ["1", "alpha", "elevator"]
Cm = ["1", "alpha", "pitch_rate", "elevator"]

[bounded]
"CL: alpha" = [0.0, 10.0]

[records]
hold = "zoh"
"""
COLUMNS = """
[records.columns]
t = "time_s"
TAS = "airspeed_kt"
AoA = "alpha_deg"
theta_rad = "theta_rad"
q_rad_s = "q_rad_s"
Nz = "az_g"
stick = "elevator_deg"

[records.factors]
az = -1.0
elevator = -1.0
"""
CLOSE = 3.5  # standard errors: 9 numbers, one false alarm in 240


def _fly(amplitude: float, seed: int, frame: Airframe = FRAME) -> pd.DataFrame:
    """Fly steps of the elevator; add noise."""
    count = 601
    elevator = -0.01 + amplitude * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[
        np.searchsorted(50 + 35 * np.array([0, 3, 5, 6, 7]), np.arange(count), side="right")
    ]  # fmt: skip
    track = Track(
        flight="",
        start_s=0.0,
        interval_s=0.02,
        outputs=(),
        measured=np.empty((count, 0)),
        states=np.empty((count, 4)),
        input_names=("elevator_rad",),
        inputs=elevator[:, np.newaxis],
        hold=Hold.ZOH,
        density_kg_m3=np.ones(count),
        thrust_n=np.full(count, THRUST_N),
        gravity_m_s2=9.80665,
    )
    terms = layout(FORM, frame, 100.0)
    start = np.array([100.0, 0.04, 0.04, 0.0])
    states = shoot(terms, NUMBERS, start, track, samples=(0, 600), bias_rad=0.0, delay_s=0.0, substeps=2)[0]
    felt = motion(terms, NUMBERS, states, track.inputs, track.density_kg_m3, track.thrust_n, 9.80665).rates[:, 5]
    random = np.random.default_rng(seed)
    noisy = np.column_stack([states, felt]) + np.array([0.1, 1e-3, 1e-3, 1e-3, 0.1]) * random.standard_normal(
        (count, 5)
    )
    return pd.DataFrame(
        {
            "time_s": 0.02 * np.arange(count),
            "airspeed_m_s": noisy[:, 0],
            "alpha_rad": noisy[:, 1],
            "theta_rad": noisy[:, 2],
            "q_rad_s": noisy[:, 3],
            "az_m_s2": noisy[:, 4],
            "elevator_rad": elevator,
        }
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A setup and two tables."""
    (tmp_path / "setup.toml").write_text(SETUP, encoding="utf-8")
    for name, amplitude in (("small", 0.03), ("large", -0.08)):
        _fly(amplitude, len(name)).to_csv(tmp_path / f"{name}.csv", index=False)
    return tmp_path


def _arguments(folder: Path, *more: str) -> list[str]:
    flights = [str(folder / f"{name}.csv") for name in ("small", "large")]
    return [
        "coefficients", str(folder / "setup.toml"), *flights, "--output", str(folder / "found.json"), "--quiet", *more
    ]  # fmt: skip


@pytest.mark.parametrize("name", ['the "new" tail', "C:\\flights", "é ✈\t\n\x7f", "'''"])
def test_a_model_of_any_name_can_be_read(tmp_path: Path, name: str) -> None:
    model = read_model_file(ROOT / "aircraft" / "f8ii" / "published.toml").model()
    condition = Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=9.8, altitude_m=0.0)
    write_reduced(model, tmp_path / "model.toml", name=name, condition=condition, thrust_n=0.0)
    assert tomllib.loads((tmp_path / "model.toml").read_text(encoding="utf-8"))["name"] == name
    found = read_model_file(tmp_path / "model.toml").model()
    assert found.q_dot.coefficients.tolist() == model.q_dot.coefficients.tolist()


def test_tables_become_coefficients_a_file_and_a_model(folder: Path) -> None:
    reduced = folder / "model.toml"
    result = RUNNER.invoke(app, _arguments(folder, "--reduced", str(reduced), "--json"))
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    for item, truth in zip(document["coefficients"], NUMBERS, strict=True):
        assert abs(item["value"] - truth) < CLOSE * item["standard_error"], item
        assert item["cramer_rao_error"] == pytest.approx(item["standard_error"], rel=0.1)  # its noise is white
    found = read_coefficients(folder / "found.json")
    assert [item["value"] for item in document["coefficients"]] == found.model.numbers.tolist()
    assert [one.samples for one in found.stretches] == [601, 601]
    # What is written for analyze is the reduction, with its errors.
    file = read_model_file(reduced)
    condition = Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=9.80665, altitude_m=0.0)
    expected = found.model.reduced(condition)
    known = []
    for one, two in ((file.first, expected.alpha_dot), (file.second, expected.q_dot)):
        kept = two.coefficients != 0.0  # the thrust has no angle: the even powers of its share are no terms
        assert one.labels() == tuple(label for label, there in zip(two.labels(), kept, strict=True) if there)
        np.testing.assert_array_equal(one.coefficients, two.coefficients[kept])
        np.testing.assert_array_equal(one.domain, two.domain)
        known += kept.tolist()
    assert not all(known)
    np.testing.assert_array_equal(file.covariance, expected.covariance[np.ix_(known, known)])
    assert isinstance(file.system(), LienardSystem)


def test_the_reduction_has_the_thrust_that_was_flown(folder: Path) -> None:
    """A column of thrust says what the airframe's own number said: two roads to one reduced model."""
    arguments = _arguments(folder, "--reduced", str(folder / "model.toml"), "--method", "equation-error")
    assert RUNNER.invoke(app, arguments).exit_code == 0
    stated = read_model_file(folder / "model.toml")
    (folder / "setup.toml").write_text(SETUP.replace("thrust_kn = 7.0", ""), encoding="utf-8")
    for name in ("small", "large"):
        frame = pd.read_csv(folder / f"{name}.csv")
        frame.assign(thrust_n=THRUST_N).to_csv(folder / f"{name}.csv", index=False)
    result = RUNNER.invoke(app, arguments)
    assert result.exit_code == 0, result.stderr
    assert "thrust   7000 N" in result.stdout
    assert "thrust varied" not in result.stderr
    recorded = read_model_file(folder / "model.toml")
    assert "kg/m3, 7000 N" in (folder / "model.toml").read_text(encoding="utf-8")
    assert recorded.first.labels() == stated.first.labels()
    np.testing.assert_array_equal(recorded.first.coefficients, stated.first.coefficients)
    np.testing.assert_array_equal(recorded.second.coefficients, stated.second.coefficients)
    # Thrust that varies is reduced at its mean, with a warning.
    frame.assign(thrust_n=0.0).to_csv(folder / "large.csv", index=False)
    varied = RUNNER.invoke(app, arguments)
    assert "thrust   3500 N" in varied.stdout
    assert "thrust varied, 0 to 7000 N" in varied.stderr
    assert "alpha in dα/dt" in varied.stderr


def test_another_method_and_a_table_for_people(folder: Path) -> None:
    result = RUNNER.invoke(app, _arguments(folder, "--method", "equation-error"))
    assert result.exit_code == 0, result.stderr
    assert "pitch_rate" in result.stdout
    assert "Cramér-Rao bound" in result.stdout
    assert "used     2 stretches, 1202 samples" in result.stdout
    wrong = RUNNER.invoke(app, _arguments(folder, "--method", "guess"))
    assert wrong.exit_code == 2
    assert "equation-error, frequency, output-error" in wrong.stderr


def test_flights_of_another_mass_have_their_own_equations(folder: Path) -> None:
    """All flights with one mass would be off by many errors."""
    heavy = replace(FRAME, mass_kg=5500.0, pitch_inertia_kg_m2=2.3e4)
    _fly(-0.08, 5, heavy).to_csv(folder / "large.csv", index=False)
    own = f"{SETUP}\n[flights.large]\nmass_kg = 5500.0\npitch_inertia_kg_m2 = 2.3e4\n"
    worst = []
    for text, method in (
        (own, "output-error"),
        (own, "equation-error"),
        (SETUP, "equation-error"),
    ):
        (folder / "setup.toml").write_text(text, encoding="utf-8")
        result = RUNNER.invoke(app, _arguments(folder, "--method", method))
        assert result.exit_code == 0, result.stderr
        model = read_coefficients(folder / "found.json").model
        worst.append(float(np.abs((model.numbers - NUMBERS) / model.standard_errors).max()))
        if text == SETUP:
            worst[-1] = float(np.abs(model.numbers / NUMBERS - 1.0).max())
    assert max(worst[:2]) < CLOSE
    assert worst[2] > 0.03
    (folder / "setup.toml").write_text(own.replace("flights.large", "flights.big").replace("mass_kg = 5500.0", ""))
    lost = RUNNER.invoke(app, _arguments(folder))
    assert lost.exit_code == 2
    assert "there is no flight big" in lost.stderr
    (folder / "setup.toml").write_text(own.replace("mass_kg = 5500.0", "chord_m = 3.0"))
    assert "flights.large.chord_m: unknown key" in RUNNER.invoke(app, _arguments(folder)).stderr


def test_the_condition_stands_for_an_airspeed_that_was_not_recorded(folder: Path) -> None:
    for name in ("small", "large"):
        pd.read_csv(folder / f"{name}.csv").drop(columns="airspeed_m_s").to_csv(folder / f"{name}.csv", index=False)
    (folder / "setup.toml").write_text(SETUP.replace("[records]", "[records]\nairspeed = 'condition'"))
    refused = RUNNER.invoke(app, _arguments(folder))
    assert refused.exit_code == 2
    assert "choose method equation-error or frequency" in refused.stderr
    result = RUNNER.invoke(app, _arguments(folder, "--method", "equation-error", "--json"))
    assert result.exit_code == 0, result.stderr
    assert "no airspeed was recorded: 100 m/s, that of the condition" in result.stderr
    found = {(item["coefficient"], item["term"]): item["value"] for item in json.loads(result.stdout)["coefficients"]}
    assert found["CL", "alpha"] == pytest.approx(4.4, rel=0.1)
    assert found["Cm", "elevator"] == pytest.approx(-1.3, rel=0.1)


def test_biases_of_which_nothing_is_known_are_kept_in_the_file(folder: Path) -> None:
    text = f"{SETUP}\n[fit]\nband_hz = [0.1, 1.5]\n[biases]\ntheta_deg = inf\nalpha_deg = 0.2\n"
    (folder / "setup.toml").write_text(text.replace("[0.0, 10.0]", "[-inf, inf]"), encoding="utf-8")
    result = RUNNER.invoke(app, _arguments(folder))
    assert result.exit_code == 0, result.stderr
    assert "theta bias [deg]" in result.stdout
    assert "below 0.001 the residuals are not white" in result.stdout
    found = read_coefficients(folder / "found.json")
    assert found.options.biases.theta_rad == np.inf
    assert found.options.band_1_s == (0.1, 1.5)
    assert found.options.form.bounds.tolist() == [[-np.inf, np.inf]] * 9
    for one in found.stretches:
        place = one.names.index("theta bias")
        assert abs(one.values[place]) < CLOSE * one.errors[place]  # noqa: PD011 - no pandas


@pytest.mark.parametrize("method", ["equation-error", "frequency"])
def test_another_method_leaves_the_biases_of_the_setup_out(folder: Path, method: str) -> None:
    plain = json.loads(RUNNER.invoke(app, _arguments(folder, "--method", method, "--json")).stdout)
    (folder / "setup.toml").write_text(f"{SETUP}\n[biases]\nalpha_deg = 0.5\n", encoding="utf-8")
    result = RUNNER.invoke(app, _arguments(folder, "--method", method, "--json"))
    assert result.exit_code == 0, result.stderr
    assert f"[biases] of the setup are left out: {method}" in result.stderr
    document = json.loads(result.stdout)
    assert document["coefficients"] == plain["coefficients"]
    assert document["warnings"][1:] == plain["warnings"]
    # A setup that asks for both itself contradicts itself.
    text = f'{SETUP}\n[fit]\nmethod = "{method}"\n[biases]\nalpha_deg = 0.5\n'
    (folder / "setup.toml").write_text(text, encoding="utf-8")
    assert RUNNER.invoke(app, _arguments(folder)).exit_code == 2


def test_foreign_names_units_and_signs_are_mapped(folder: Path) -> None:
    plain = json.loads(RUNNER.invoke(app, _arguments(folder, "--json")).stdout)
    (folder / "setup.toml").write_text(SETUP + COLUMNS, encoding="utf-8")
    for name in ("small", "large"):
        frame = pd.read_csv(folder / f"{name}.csv")
        frame["TAS"] = from_si(frame.pop("airspeed_m_s").to_numpy(), "kt")
        frame["AoA"] = from_si(frame.pop("alpha_rad").to_numpy(), "deg")
        frame["Nz"] = -from_si(frame.pop("az_m_s2").to_numpy(), "g")
        frame["stick"] = -from_si(frame.pop("elevator_rad").to_numpy(), "deg")
        frame = frame.rename(columns={"time_s": "t"})
        frame["comment"] = "none"
        frame.to_csv(folder / f"{name}.csv", index=False)
    mapped = json.loads(RUNNER.invoke(app, _arguments(folder, "--json")).stdout)
    for one, two in zip(plain["coefficients"], mapped["coefficients"], strict=True):
        assert two["value"] == pytest.approx(one["value"], rel=1e-5)


def test_all_faults_of_a_setup_are_told_at_once(folder: Path) -> None:
    text = (
        SETUP.replace('"finback/coefficient-setup/1"', '"finback/setup/9"')
        .replace("mass_kg = 5000.0", "mas_kg = 5000.0")
        .replace('CD = ["1", "alpha^2"]', 'CD = ["1", "alhpa"]')
        .replace("[0.0, 10.0]", "3.0")
        .replace('hold = "zoh"', 'hold = "held"')
        .replace("density_kg_m3 = 1.0", "density_kg_m3 = nan")
    )
    (folder / "setup.toml").write_text(text + "[fit]\nmethod = 'best'\n[biases]\nalpha_deg = 0.1\nspeed_kt = 1.0\n")
    result = RUNNER.invoke(app, _arguments(folder))
    assert result.exit_code == 2
    for place in (
        "schema: 'finback/setup/9'",
        "airframe.mas_kg: unknown key; did you mean 'mass_kg'?",
        "airframe.mass_kg: missing",
        "form: unknown variable 'alhpa'",
        "records.hold: must be one of zoh",
        "condition.density_kg_m3: must be a finite number",
        "fit.method: must be one of equation-error",
        "biases.speed_kt: unknown key",
    ):
        assert place in result.stderr, place
    assert not (folder / "found.json").exists()


def test_flights_that_lack_something_are_named(folder: Path) -> None:
    frame = pd.read_csv(folder / "small.csv")
    frame.drop(columns="airspeed_m_s").to_csv(folder / "small.csv", index=False)
    result = RUNNER.invoke(app, _arguments(folder))
    assert result.exit_code == 2
    assert "small.csv: nothing gives airspeed_m_s" in result.stderr
    assert "airspeed = 'condition'" in result.stderr
    missing = RUNNER.invoke(app, ["coefficients", str(folder / "setup.toml"), str(folder / "smal.csv")])
    assert missing.exit_code == 2
    assert "did you mean" in missing.stderr
    nowhere = RUNNER.invoke(app, _arguments(folder, "--reduced", str(folder / "none" / "m.toml")))
    assert nowhere.exit_code == 2


DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "coefficients.md"


def _blocks(language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```$", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )


def test_the_setup_that_is_printed_can_be_read(tmp_path: Path) -> None:
    (block,) = _blocks("toml")
    (tmp_path / "setup.toml").write_text(block, encoding="utf-8")
    setup = read_coefficient_setup(tmp_path / "setup.toml")
    assert setup.options.reference_speed_m_s == 104.67
    assert setup.options.form.size == 11
    assert setup.options.form.free.size == 10
    assert setup.condition.airspeed_m_s == pytest.approx(104.7, abs=0.1)


def test_the_python_that_is_printed_runs(folder: Path) -> None:
    (block,) = _blocks("python")
    sweep = read_flights([folder / "small.csv", folder / "large.csv"], read_coefficient_setup(folder / "setup.toml"))
    names: dict[str, Any] = {"sweep": _with_thrust(sweep)}
    exec(block, names)  # noqa: S102 - the documents are ours
    assert names["found"].model.number("alpha in CL") == pytest.approx(4.4, rel=0.02)
    assert names["found"].model.number("elevator in CL") == 0.4
    assert names["model"].q_dot.coefficient(alpha_rad=1) < 0.0


def _with_thrust(sweep: Sweep) -> Sweep:
    """The airframe of the page has no thrust of its own."""
    records = tuple(record.with_columns(thrust_n=np.full(len(record), THRUST_N)) for record in sweep.records)
    return replace(sweep, records=records)

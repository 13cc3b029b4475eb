"""Models for other programs say the same as the model, bit for bit where the language can."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.trajectory import free_run
from finback.errors import InputError
from finback.flight.aircraft import find_aircraft
from finback.flight.plan import FlightPlan
from finback.flight.rig import Rig
from finback.records import Condition, Hold, Schedule
from finback.store.export.c_source import c_source
from finback.store.export.equations import Equations
from finback.store.export.jsbsim_aircraft import Airframe, jsbsim_aircraft
from finback.store.export.latex import concise, latex
from finback.store.export.symbolic import symbolic, sympy_module
from finback.store.model_file import read_model_file
from finback.units import to_si

PUBLISHED = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"
CONDITION = Condition(airspeed_m_s=150.0, density_kg_m3=0.7, gravity_m_s2=9.80665, altitude_m=5000.0)
BITS = 1e-15  # of the sum of absolute terms: products and sums in another order
EXACT = 1e-12  # rad/s and rad/s²: a dozen roundings of numbers up to 100
FLOWN_DEG = 1e-4  # JSBSim begins its multistep rule with a step of low order: 1e-5 from a state that is no trim


def random_model(seed: int, *, inputs: tuple[str, ...] = ()) -> PolynomialModel:
    """A model of random terms up to the third order, mild enough to be flown."""
    random = np.random.default_rng(seed)
    names = (*VARIABLES, *inputs)
    rates = []
    for own, unit in (((0, 1, 0), "rad_s"), ((0, 0, 1), "rad_s2")):
        rows = {tuple(int(i == k) for i in range(len(names))): 1.0 for k in range(len(names))}
        for _ in range(6):
            rows[tuple(random.multinomial(random.integers(0, 4), np.full(len(names), 1 / len(names))).tolist())] = 1.0
        rows[(*own, *(0,) * len(inputs))] = 1.0
        terms = {row: float(random.normal()) for row in rows}
        rates.append(Polynomial.build(terms, variables=names, value_unit=unit))
    size = sum(rate.coefficients.size for rate in rates)
    return PolynomialModel(alpha_dot=rates[0], q_dot=rates[1], covariance=np.zeros((size, size)))


def points(count: int, seed: int, width: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.7, 0.7, (count, width))


def scale(polynomial: Polynomial, point: np.ndarray) -> float:
    """The sum of absolute terms: what rounding is relative to."""
    return float(np.abs(polynomial.term_values(*point) * polynomial.coefficients).sum()) + 1e-300


# C


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_c_function_is_the_polynomial(
    compile_c: Callable[[str, str, int, int], Callable[..., list[float]]], seed: int
) -> None:
    inputs = ("beta_rad", "canard_rad")[:seed]
    model = random_model(seed, inputs=inputs)
    rates = compile_c(c_source(Equations.of_model(model, "random */ model"), name="rates_of"), "rates_of", 3 + seed, 2)
    for point in points(200, seed, 3 + seed):
        for found, polynomial in zip(rates(*point.tolist()), (model.alpha_dot, model.q_dot), strict=True):
            assert abs(found - float(polynomial(*point))) <= BITS * scale(polynomial, point)


def test_c_names_are_checked(truth_equations: Equations) -> None:
    for name in ("double", "two words", "é", "9lives"):
        with pytest.raises(InputError, match="no name in C"):
            c_source(truth_equations, name=name)


@pytest.fixture
def truth_equations() -> Equations:
    return Equations.of_file(read_model_file(PUBLISHED))


# SymPy


@pytest.mark.parametrize("seed", [3, 4])
def test_sympy_expressions_are_the_polynomial_and_have_its_derivative(seed: int) -> None:
    model = random_model(seed)
    found = symbolic(Equations.of_model(model, "random"))
    alpha = found.symbols[0]
    for rate, polynomial in zip(found.rates, (model.alpha_dot, model.q_dot), strict=True):
        slope, known = rate.diff(alpha), polynomial.derivative("alpha_rad")
        for point in points(20, seed):
            at = dict(zip(found.symbols, point.tolist(), strict=True))
            assert abs(float(rate.subs(at)) - float(polynomial(*point))) <= 10 * BITS * scale(polynomial, point)
            assert float(slope.subs(at)) == pytest.approx(float(known(*point)), abs=1e-12)


def test_the_sympy_module_makes_the_same_expressions(truth_equations: Equations) -> None:
    names: dict[str, object] = {}
    exec(sympy_module(truth_equations), names)  # noqa: S102 - the module under test
    found = symbolic(truth_equations)
    for rate, name in zip(found.rates, truth_equations.rates, strict=True):
        assert (rate - names[name]).simplify() == 0


# LaTeX


@given(st.floats(1e-9, 1e9), st.floats(1e-12, 1e9))
@settings(deadline=None)
def test_latex_numbers_show_the_digits_that_the_error_supports(value: float, error: float) -> None:
    text = concise(value, error)
    number = re.fullmatch(r"([\d.]+)\((\d+)\)(?: \\times 10\^\{(-?\d+)\})?", text)
    assert number is not None, text
    power = 10.0 ** int(number[3] or 0)
    last = 10.0 ** -len(number[1].partition(".")[2]) * power
    assert 10 <= int(number[2]) <= 99
    assert abs(int(number[2]) * last - error) <= 0.5001 * last
    assert abs(float(number[1]) * power - value) <= 0.5001 * last + 10 * BITS * value


def test_latex_of_the_published_model_has_every_digit(truth_equations: Equations) -> None:
    text = latex(truth_equations)
    assert r"\dot{\alpha} &= " in text
    assert r"0.98471492754086\,q" in text
    assert r"- 0.3504260784\,\alpha" in text
    assert text.count(r"\delta_e") == 2


# JSBSim


@pytest.mark.parametrize("seed", [5, 6])
def test_the_aircraft_on_the_rig_is_the_polynomial(seed: int, tmp_path: Path) -> None:
    model = random_model(seed, inputs=("beta_rad", "canard_rad"))
    airframe = Airframe(mass_kg=14300.0 * (1 + seed), pitch_inertia_kg_m2=2.2e5, wing_area_m2=42.0, chord_m=5.7)
    file = tmp_path / "reduced" / "reduced.xml"
    file.parent.mkdir()
    file.write_text(
        jsbsim_aircraft(model, name="reduced", condition=CONDITION, airframe=airframe, source="a test"),
        encoding="utf-8",
    )
    held = model.held(beta_rad=0.0, canard_rad=0.0)
    with Rig(find_aircraft(str(file), near=tmp_path), CONDITION, step_s=1 / 400) as rig:
        for alpha, q, elevator in points(100, seed).tolist():
            found = rig.derivatives(alpha, q, elevator)
            assert found[0] == pytest.approx(float(held.alpha_dot(alpha, q, elevator)), abs=EXACT)
            assert found[1] == pytest.approx(float(held.q_dot(alpha, q, elevator)), abs=EXACT)


def test_the_published_model_flies_as_its_own_equations(tmp_path: Path) -> None:
    model = read_model_file(PUBLISHED).model()
    file = tmp_path / "reduced" / "reduced.xml"
    file.parent.mkdir()
    file.write_text(
        jsbsim_aircraft(model, name="reduced", condition=CONDITION, airframe=Airframe(), source="published"),
        encoding="utf-8",
    )
    schedule = Schedule(time_s=np.array([0.0, 0.5, 0.55, 3.0]), elevator_rad=np.array([-0.1, -0.1, -0.15, -0.15]))
    plan = FlightPlan(
        name="step",
        kind="step",
        alpha_rad=0.1,
        q_rad_s=0.0,
        schedule=schedule,
        hold=Hold.FOH,
        duration_s=3.0,
        sample_interval_s=0.01,
        alpha_limits_rad=(-0.5, 0.8),
    )
    with Rig(find_aircraft(str(file), near=tmp_path), CONDITION, step_s=1 / 400) as rig:
        flown = rig.fly(plan)
    predicted = free_run(
        model, time_s=flown["time_s"], elevator_rad=flown["elevator_rad"], hold="foh", alpha_rad=0.1, q_rad_s=0.0
    )
    assert np.abs(flown["alpha_rad"] - predicted[:, 0]).max() < to_si(FLOWN_DEG, "deg")
    assert np.abs(flown["q_rad_s"] - predicted[:, 1]).max() < 10 * to_si(FLOWN_DEG, "deg_s")


def test_an_airframe_is_positive() -> None:
    with pytest.raises(InputError, match="mass_kg"):
        Airframe(mass_kg=-1.0)
    with pytest.raises(InputError, match="chord_m"):
        Airframe(chord_m=math.nan)


# the verb


def said(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["export", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_the_verb_writes_what_it_is_asked(tmp_path: Path, truth_equations: Equations) -> None:
    assert said(PUBLISHED, "--to", "latex") == (0, latex(truth_equations), "")
    path = tmp_path / "rates.c"
    assert said(PUBLISHED, "--to", "c", "--output", path) == (0, f"{path}\n", "")
    assert path.read_text(encoding="utf-8") == c_source(truth_equations)
    code, text, _ = said(PUBLISHED, "--to", "sympy", "--output", tmp_path / "rates.py", "--json")
    assert (code, json.loads(text)["to"]) == (0, "sympy")


def test_an_aircraft_needs_a_condition_that_a_run_has(tmp_path: Path, finished_run: Path) -> None:
    code, _, error = said(PUBLISHED, "--to", "jsbsim", "--output", tmp_path / "reduced")
    assert (code, "--condition" in error) == (2, True)
    code, text, _ = said(finished_run, "--to", "jsbsim", "--output", tmp_path / "reduced")
    assert (code, text) == (0, f"{tmp_path / 'reduced' / 'reduced.xml'}\n")
    assert "295.07 m/s" in (tmp_path / "reduced" / "reduced.xml").read_text(encoding="utf-8")
    code, _, error = said(finished_run, "--to", "jsbsim", "--output", tmp_path / "other" / "reduced.xml")
    assert (code, "folder" in error) == (2, True)

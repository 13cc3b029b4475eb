"""C, SymPy and LaTeX of a model in coefficient form say the same as the model."""

from __future__ import annotations

import json
import re
import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from matplotlib.mathtext import MathTextParser
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.model import VARIABLES
from finback.errors import InputError
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import CoefficientIdentification
from finback.identification.coefficient.model import CoefficientModel
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.records import Condition
from finback.store.coefficients import save_coefficients
from finback.store.export.coefficient.c_source import coefficients_in_c
from finback.store.export.coefficient.jsbsim_aircraft import coefficients_in_jsbsim
from finback.store.export.coefficient.latex import coefficients_in_latex
from finback.store.export.coefficient.statements import RATES, STATES
from finback.store.export.coefficient.symbolic import coefficients_in_sympy
from finback.store.export.coefficient.terms import AIR, CoefficientEquations, stated
from finback.store.model_file import read_model_file

ROUNDING = 1e-12  # of the largest of each: 40 terms of both signs, summed in another order

Points = tuple[np.ndarray, np.ndarray, np.ndarray]


def points(model: CoefficientModel, count: int, seed: int) -> Points:
    """Return states, inputs, and density, thrust and gravity."""
    random = np.random.default_rng(seed)
    states = random.uniform([60.0, -0.3, -0.6, -0.6], [220.0, 0.6, 0.8, 0.6], (count, 4))
    inputs = random.uniform(-0.3, 0.3, (count, len(model.form.inputs)))
    air = random.uniform([0.3, -5e3, 9.6], [1.3, 4e4, 9.9], (count, 3))
    return states, inputs, air


def known(model: CoefficientModel, at: Points) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients and the motion as the model says them, in the order of ``RATES``."""
    states, inputs, air = at
    rates = np.vstack(
        [
            motion(
                layout(model.form, model.airframe, model.reference_speed_m_s),
                model.numbers, states[i : i + 1], inputs[i : i + 1], air[i : i + 1, 0], air[i : i + 1, 1], air[i, 2],
            ).rates
            for i in range(len(states))
        ]
    )  # fmt: skip
    speed, alpha, _, q = states.T
    half = 0.5 * model.airframe.chord_m
    values = {
        "alpha_rad": alpha,
        "pitch_rate_1": q * half / speed,
        "reference_pitch_rate_1": q * half / model.reference_speed_m_s,
        "speed_ratio_1": speed / model.reference_speed_m_s,
        "alpha_rate_1": rates[:, 1] * half / speed,
        **dict(zip(model.form.inputs, inputs.T, strict=True)),
    }
    return np.column_stack([model.coefficient(name, values) for name in model.form.names]), rates


def assert_close(found: np.ndarray, expected: np.ndarray) -> None:
    assert (np.abs(found - expected) <= ROUNDING * np.abs(expected).max(axis=0)).all()


def test_c_is_the_model(compile_c: Callable[[str, str, int, int], Any], coefficients: CoefficientModel) -> None:
    at = states, inputs, air = points(coefficients, 100, 1)
    numbers, rates = known(coefficients, at)
    source = coefficients_in_c(CoefficientEquations(model=coefficients, source="a */ test \\"))
    width = inputs.shape[1]
    function = compile_c(source, "finback_motion", 7 + width, 6)
    found = np.array([function(*row) for row in np.hstack([states, inputs, air]).tolist()])
    assert_close(found, rates)
    function = compile_c(source, "finback_coefficients", 4 + width, 3)
    rows = np.column_stack([states[:, [0, 1, 3]], rates[:, 1], inputs])
    assert_close(np.array([function(*row) for row in rows.tolist()]), numbers)


def test_sympy_is_the_model_and_has_its_derivative(coefficients: CoefficientModel, tmp_path: Path) -> None:
    at = states, inputs, air = points(coefficients, 100, 2)
    numbers, rates = known(coefficients, at)
    module = tmp_path / "model.py"
    module.write_text(
        coefficients_in_sympy(CoefficientEquations(model=coefficients, source='a "test"')), encoding="utf-8"
    )
    names = runpy.run_path(str(module))
    symbols = [names[name] for name in (*STATES, *coefficients.form.inputs, *AIR)]
    expressions = [names[name] for name in (*coefficients.form.names, *RATES)]
    slope = names["q_dot_rad_s2"].diff(names["alpha_rad"])
    *found, slopes = sympy.lambdify(symbols, [*expressions, slope])(*states.T, *inputs.T, *air.T)
    assert_close(np.column_stack([np.broadcast_to(one, len(states)) for one in found]), np.hstack([numbers, rates]))
    step = 1e-6 * np.array([0.0, 1.0, 0.0, 0.0])
    up, down = (known(coefficients, (states + way * step, inputs, air))[1][:, 3] for way in (1.0, -1.0))
    np.testing.assert_allclose(slopes, (up - down) / 2e-6, atol=1e-7 * np.abs(slopes).max())


def test_air_may_stand_in_the_terms(
    compile_c: Callable[[str, str, int, int], Any], truths: dict[str, CoefficientModel]
) -> None:
    """A thrust or a density that the coefficients depend on is one argument, not two."""
    form = CoefficientForm.parse(
        Axes.WIND, ["1", "thrust_n"], ["alpha", "density_kg_m3"], ["1", "elevator", "altitude_m"]
    )
    model = replace(
        truths["transport"],
        form=form,
        numbers=np.array([0.03, 1e-6, 4.0, 0.1, 0.02, -1.1, 1e-5]),
        covariance=np.zeros((7, 7)),
        domain=np.tile([0.0, 1.0], (9, 1)),
    )
    source = coefficients_in_c(CoefficientEquations(model=model, source="a test"))
    function = compile_c(source, "finback_motion", 9, 6)
    assert form.inputs == ("elevator_rad", "altitude_m", "density_kg_m3", "thrust_n")
    at = (np.array([[90.0, 0.1, 0.2, 0.3]]), np.array([[-0.1, 3000.0, 0.9, 1e4]]), np.array([[0.9, 1e4, 9.8]]))
    found = function(*at[0][0].tolist(), -0.1, 3000.0, *at[2][0].tolist())
    np.testing.assert_allclose(found, known(model, at)[1][0], rtol=ROUNDING)


# what is printed for people


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (-0.0194337, 0.00123, "-0.0194 +- 0.0012"),
        (4.4, 0.0, "4.4 (known)"),
        (1.2345e-7, 1.2e-8, "(1.23 +- 0.12)e-07"),
        (684.8, 31.0, "685 +- 31"),
        (0.0, 0.5, "0.00 +- 0.50"),
        (1.0, np.inf, "not determined"),
    ],
)
def test_numbers_have_the_digits_that_their_errors_support(value: float, error: float, text: str) -> None:
    assert stated(value, error) == text


WRITERS = (
    coefficients_in_c, coefficients_in_sympy, lambda equations: coefficients_in_jsbsim(equations, name="found")
)  # fmt: skip


@pytest.mark.parametrize("write", WRITERS)
def test_every_file_says_the_errors_and_where_the_numbers_hold(
    write: Callable[[CoefficientEquations], str], truths: dict[str, CoefficientModel]
) -> None:
    text = write(CoefficientEquations(model=truths["transport"], source="a test"))
    for line in ("CL  4.400 +- 0.057 ", "Cm  -34.70 +- 0.45 ", "alpha_rad  -0.5 to 0.8", "speed_ratio_1  0.6 to 1.3"):
        assert line in text, line


def test_latex_shows_all_three(coefficients: CoefficientModel) -> None:
    text = coefficients_in_latex(CoefficientEquations(model=coefficients, source="a test"))
    body = re.fullmatch(r"%.*\n\\begin\{aligned\}\n(.*)\n\\end\{aligned\}\n", text, flags=re.DOTALL)
    assert body is not None
    lines = body[1].split(r" \\" + "\n")
    heads = [line.split(" &=", 1)[0] for line in lines[:3]]
    assert heads == [f"C_{name[1:]}" for name in coefficients.form.names]
    for number, error in zip(coefficients.numbers.tolist(), coefficients.standard_errors.tolist(), strict=True):
        assert f"({round(error / 10.0 ** np.floor(np.log10(error)) * 10)})" in text, number


def test_latex_of_the_transport(truths: dict[str, CoefficientModel]) -> None:
    text = coefficients_in_latex(CoefficientEquations(model=truths["transport-late"], source="a test"))
    assert r"C_D &= 0.1240(16) - 0.06500(84)\,\hat{V} + 0.3200(42)\,\alpha \\" in text
    assert r"- 20.00(26)\,\left(\hat{q} + \hat{\dot{\alpha}}\right)" in text
    assert r"m &= 7472.0\,\mathrm{kg}" in text
    parser = MathTextParser("path")
    for line in text.splitlines()[2:13]:
        parser.parse(f"${line.removesuffix(' ' + 2 * chr(92)).replace('&', '')}$")


# the verb


def said(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["export", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def file(tmp_path: Path, truths: dict[str, CoefficientModel]) -> Path:
    """A coefficients.json."""
    model = truths["transport"]
    options = CoefficientOptions(airframe=model.airframe, form=model.form, reference_speed_m_s=104.67)
    found = CoefficientIdentification(
        model=model, options=options, residual_names=(), residual_rms=np.zeros(0), whiteness=(), coloring=1.0,
        condition_number=1.0, iterations=1, converged=True, stretches=(), unused=(), warnings=(),
    )  # fmt: skip
    save_coefficients(found, tmp_path / "coefficients.json", inputs={})
    return tmp_path / "coefficients.json"


@pytest.mark.parametrize("to", ["c", "latex", "sympy"])
def test_the_verb_writes_coefficients(file: Path, to: str) -> None:
    code, text, error = said(file, "--to", to)
    assert (code, error) == (0, "")
    assert said(file.parent, "--to", to)[:2] == (0, text)  # a folder with nothing else
    assert "4.400" in text


def test_the_verb_writes_an_aircraft_with_another_thrust(file: Path, tmp_path: Path) -> None:
    code, text, _ = said(file, "--to", "jsbsim", "--output", tmp_path / "jet", "--json", "--thrust", 9000.0)
    assert (code, json.loads(text)["to"]) == (0, "jsbsim")
    assert "Its thrust is model/thrust-lbs, 9000 N" in (tmp_path / "jet" / "jet.xml").read_text(encoding="utf-8")


def test_the_verb_reduces_at_a_condition(file: Path, tmp_path: Path, truths: dict[str, CoefficientModel]) -> None:
    for speed in (90.0, 120.0):
        output = tmp_path / f"at-{speed:g}.toml"
        assert said(file, "--to", "toml", "--condition", speed, 0.9, 9.8, 3000, "--output", output)[0] == 0
        condition = Condition(airspeed_m_s=speed, density_kg_m3=0.9, gravity_m_s2=9.8, altitude_m=3000.0)
        expected, found = truths["transport"].reduced(condition), read_model_file(output).model()
        for one, two in ((found.alpha_dot, expected.alpha_dot), (found.q_dot, expected.q_dot)):
            for point in np.random.default_rng(1).uniform(-0.3, 0.3, (5, len(VARIABLES))):
                assert float(one(*point)) == pytest.approx(float(two(*point)), rel=1e-13)
    for to in ("c", "latex", "sympy"):
        code, text, _ = said(file, "--to", to, "--condition", 90, 0.9, 9.8, 3000)
        assert (code, "reduced at 90 m/s, 0.9 kg/m3, 11600 N" in text) == (0, True)
    assert (
        "outside the airspeeds flown, 62.8 to 136.1 m/s" in said(file, "--to", "c", "--condition", 40, 0.9, 9.8, 0)[2]
    )
    assert said(file, "--to", "c", "--condition", 90, 0.9, 9.8, 0)[2] == ""
    output = tmp_path / "held" / "held.xml"
    assert said(file, "--to", "jsbsim", "--condition", 90, 0.9, 9.8, 3000, "--output", output)[0] == 0
    assert "It holds at 90 m/s" in output.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--to", "toml"), "add --condition"),
        (("--to", "c", "--airframe", "1", "1", "1", "1", "1"), "airframe stands in the coefficients"),
        (("--to", "c", "--thrust", "nan"), "finite number of newtons"),
        (("--to", "c", "--condition", "-1", "1", "1", "1"), "airspeed and density are positive"),
    ],
)
def test_the_verb_says_what_coefficients_cannot(file: Path, options: tuple[str, ...], words: str) -> None:
    code, _, error = said(file, *options)
    assert (code, words in error) == (2, True), error


def test_analyze_says_what_to_do_with_coefficients(file: Path) -> None:
    result = CliRunner().invoke(app, ["analyze", str(file), "--quiet"])
    assert result.exit_code == 2
    assert f"finback export {file} --condition V RHO G H --to toml" in result.stderr


def test_a_file_of_an_earlier_version_is_refused_with_what_makes_it_again(file: Path, tmp_path: Path) -> None:
    tree = json.loads(file.read_text(encoding="utf-8"))
    tree["schema"] = "finback/coefficients/1"
    tree["provenance"]["inputs"] = {"setup.toml": "ab", "my flight.csv": "cd"}
    file.write_text(json.dumps(tree), encoding="utf-8")
    code, _, error = said(file, "--to", "c")
    again = f"finback coefficients setup.toml 'my flight.csv' --output {tmp_path / 'coefficients.json'}"
    assert (code, again in " ".join(error.split())) == (2, True), error


def test_a_broken_file_and_options_of_the_other_form(tmp_path: Path) -> None:
    published = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"
    for options, words in ((("--to", "toml"), "no coefficients"), (("--to", "c", "--thrust", "1"), "no coefficients")):
        code, _, error = said(published, *options)
        assert (code, words in error) == (2, True), error
    broken = tmp_path / "coefficients.json"
    broken.write_text('{"schema": "finback/coefficients/1", "content"', encoding="utf-8")
    assert said(broken, "--to", "c")[0] == 2


def test_names_and_sources_are_checked(truths: dict[str, CoefficientModel]) -> None:
    with pytest.raises(InputError, match="one line"):
        CoefficientEquations(model=truths["transport"], source="two\nlines")

"""Models from files: the published one by its digits, polynomials by hand, and every fault with its place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import VARIABLES
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.reduction import reduce
from finback.errors import InputError, ModelFileError
from finback.store import load_identification
from finback.store.model_file import read_model_file
from finback.store.model_terms import MAXIMUM_POWER, parse_term
from finback.units import from_si, si_factor, to_si

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = ROOT / "aircraft" / "f8ii" / "published.toml"
EXAMPLES = ROOT / "docs" / "examples"

# Shi & Fan (2013), Eq. (37), as printed; in degrees.
PRINTED = {
    "ag0": "-1.211386346",
    "ag1": "-0.01992265993",
    "ag2": "0.002050667285",
    "bg0": "2.038986943",
    "bg1": "-8.243739010",
    "bg2": "-0.1379647003",
    "bg3": "0.008192987992",
    "c1": "-4.619857062",
    "c2": "-0.03768490060652",
}
# By exact rational arithmetic from the primitive model these two end in ...993 and ...061: the paper cut the first
# off and erred in the last digit of the second.
CORRECTED = {"bg3": "0.008192987993", "c1": "-4.619857061"}


def write(folder: Path, text: str) -> Path:
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    return path


# the paper's form


def test_the_published_file_gives_the_reduced_equation_digit_by_digit() -> None:
    system = read_model_file(PUBLISHED).system()
    assert isinstance(system, LienardSystem)
    degree = si_factor("deg")
    found = {
        **{f"ag{k}": value * degree**k for k, value in enumerate(system.damping.ascending.tolist())},
        **{f"bg{k}": value * degree ** (k - 1) for k, value in enumerate(system.force.ascending.tolist())},
        "c1": system.elevator_gain,
        "c2": system.elevator_rate_gain,
    }
    for name, printed in PRINTED.items():
        decimals = len(printed.partition(".")[2])
        assert f"{found[name]:.{decimals}f}" == CORRECTED.get(name, printed), name
    assert all(found[name] != pytest.approx(float(PRINTED[name]), rel=0, abs=0.5e-12) for name in CORRECTED)


def test_the_published_model_is_the_reduction_of_its_file() -> None:
    file = read_model_file(PUBLISHED)
    model = file.model()
    assert (model.alpha_dot.variables, file.held, file.ranges) == (VARIABLES, {}, {})
    assert file.written == ("alpha_deg", "q_deg_s", "elevator_deg")
    assert not model.covariance.any()
    assert np.isinf(model.alpha_dot.domain).all()
    system = file.system()
    assert isinstance(system, LienardSystem)
    np.testing.assert_array_equal(system.force.ascending, reduce(model).force.ascending)


PAPER_FORM = """
[alpha_dot_deg_s]
q = 0.98
constant = 0.1
alpha = -0.35
alpha4 = 1e-6
elevator = -0.04
canard = 0.02
alpha_beta = 0.003

[q_dot_deg_s2]
q = -0.4
alpha_dot = -0.3
alpha = -8.0
elevator = -4.7
canard = 1.5

[f_q]
p_r = 0.9
r2_minus_p2 = 0.02

[held]
beta_deg = 2.0
p_deg_s = 10.0

[domain]
alpha_deg = [-10.0, 30.0]
beta_deg = [-5.0, 5.0]

[range]
elevator_deg = [-20.0, 10.0]
"""


def test_every_term_of_the_paper_can_be_written(tmp_path: Path) -> None:
    file = read_model_file(write(tmp_path, PAPER_FORM))
    assert file.model().inputs == ("canard_rad", "beta_rad", "p_rad_s", "r_rad_s")
    assert file.held == {"canard_rad": 0.0, "beta_rad": to_si(2.0, "deg"), "p_rad_s": to_si(10.0, "deg"), "r_rad_s": 0}
    assert file.ranges == {"elevator_rad": (to_si(-20.0, "deg"), to_si(10.0, "deg"))}
    system = file.system()
    assert isinstance(system, LienardSystem)
    np.testing.assert_allclose(system.domain[0], to_si(np.array([-10.0, 30.0]), "deg"))
    # Eq. (11) by hand, with q' substituted: f = M_zq + (1+C_zq) M_zad + C' + C_zab beta
    assert system.damping(0.0) == pytest.approx(-0.4 + 0.98 * -0.3 - 0.35 + 0.003 * 2.0, rel=1e-14)
    p = to_si(10.0, "deg")
    force = from_si(0.98 * 0.02 * -p * p, "deg") + 0.4 * 0.1
    assert from_si(float(system.force(0.0)), "deg") == pytest.approx(force, rel=1e-13)
    moved = file.holding({"canard_deg": 1.0}).system()
    assert isinstance(moved, LienardSystem)
    assert from_si(float(moved.force(0.0)), "deg") == pytest.approx(force + 0.98 * 1.5 + 0.4 * 0.02, rel=1e-13)


def test_an_input_held_outside_its_data_leaves_no_domain(tmp_path: Path) -> None:
    file = read_model_file(write(tmp_path, PAPER_FORM))
    system = file.holding({"beta_deg": 5.5}).system()
    assert isinstance(system, LienardSystem)
    assert not system.supports(0.1)
    with pytest.raises(InputError, match="no input 'bet_deg' can be held; did you mean 'beta_deg'"):
        file.holding({"bet_deg": 1.0})
    with pytest.raises(InputError, match="no input 'canard_deg' can be held") as caught:
        read_model_file(PUBLISHED).holding({"canard_deg": 1.0})
    assert "no inputs" in caught.value.hint


# polynomials by hand

OSCILLATOR = """
schema = "finback/polynomials/1"
state = ["x_1", "y_1"]
parameter = "mu_1"
[x_dot_1]
y = 1
[y_dot_1]
x = -1.0
"mu*y" = 1.0
"x^2 * mu * y" = -1
"""

PITCH = """
schema = "finback/polynomials/1"
state = ["alpha_deg", "q_deg_s"]
parameter = "elevator_deg"
inputs = ["canard_deg"]

[alpha_dot_deg_s]
constant = 0.1
q = 0.98
alpha = {{ value = -0.35, standard_error = 0.01 }}
"alpha^2" = 0.001

[q_dot_deg_s2]
alpha = -8.0
q = -0.4
"{term}" = 0.05
elevator = -4.0
canard = {{ value = 1.5, standard_error = 0.2 }}

[held]
canard_deg = 2.0
[domain]
alpha_deg = [-10, 30]
[covariance]
terms = ["alpha_dot: q", "q_dot: alpha"]
matrix = [[1e-4, -2e-4], [-2e-4, 9e-4]]
"""


def test_the_shipped_oscillator() -> None:
    file = read_model_file(EXAMPLES / "van-der-pol.toml")
    system = file.system()
    assert isinstance(system, PlanarSystem)
    assert system.variables == ("x_1", "y_1", "mu_1")
    x, y, mu = 0.7, -1.3, 0.4
    np.testing.assert_allclose(system.velocity([x, y], mu), [y, (mu - x * x) * y - x], rtol=1e-15)
    assert file.ranges == {"mu_1": (-1.0, 2.0), "x_1": (-4.0, 4.0), "y_1": (-6.0, 6.0)}
    with pytest.raises(InputError, match="none of the longitudinal motion"):
        file.model()


def test_the_shipped_short_period_model_needs_the_planar_field() -> None:
    file = read_model_file(EXAMPLES / "f8-crusader.toml")
    system = file.system()
    assert isinstance(system, PlanarSystem)
    model = file.model()
    # Garrard & Jordan (1977), their equations, evaluated as printed.
    a, q, u = 0.2, -0.3, 0.05
    alpha_dot = -0.877 * a + q - 0.088 * a * q + 0.47 * a * a - a * a * q + 3.846 * a**3 - 0.215 * u
    alpha_dot += 0.28 * a * a * u + 0.47 * a * u * u + 0.63 * u**3
    q_dot = -4.208 * a - 0.396 * q - 0.47 * a * a - 3.564 * a**3 - 20.967 * u
    q_dot += 6.265 * a * a * u + 46.0 * a * u * u + 61.4 * u**3
    assert model.alpha_dot(a, q, u) == pytest.approx(alpha_dot, rel=1e-14)
    assert model.q_dot(a, q, u) == pytest.approx(q_dot, rel=1e-14)


def test_degrees_errors_and_covariance_by_hand(tmp_path: Path) -> None:
    file = read_model_file(write(tmp_path, PITCH.format(term="alpha*elevator")))
    model = file.model()
    degree = to_si(1.0, "deg")
    assert model.alpha_dot(3 * degree, 2 * degree, 0, 0) == pytest.approx((0.1 + 1.96 - 1.05 + 0.009) * degree)
    assert model.q_dot(3 * degree, 2 * degree, degree, degree) == pytest.approx((-24 - 0.8 + 0.15 - 4 + 1.5) * degree)
    names = [*(f"alpha_dot: {name}" for name in model.alpha_dot.labels())]
    names += [*(f"q_dot: {name}" for name in model.q_dot.labels())]
    spread = dict(zip(names, np.sqrt(np.diag(model.covariance)).tolist(), strict=True))
    expected = {"alpha_dot: alpha": 0.01, "alpha_dot: q": 0.01, "q_dot: alpha": 0.03, "q_dot: canard": 0.2}
    assert {name: value for name, value in spread.items() if value} == pytest.approx(expected)
    tied = model.covariance[names.index("alpha_dot: q"), names.index("q_dot: alpha")]
    assert tied == pytest.approx(-2e-4)
    np.testing.assert_allclose(model.q_dot.domain[0], [-10 * degree, 30 * degree])
    assert isinstance(file.system(), PlanarSystem)
    held = read_model_file(write(tmp_path, PITCH.format(term="alpha^3"))).system()
    assert isinstance(held, LienardSystem)
    # The canard held at 2 deg adds 0.98 * 1.5 * 2 to g, with an error of 0.98 * 0.2 * 2 and that of the q gain.
    force = 0.98 * 1.5 * 2.0 + 0.4 * 0.1
    assert from_si(float(held.force(0.0)), "deg") == pytest.approx(force, rel=1e-13)
    gradient = held.force.gradient(0.0)
    error = from_si(float(np.sqrt(gradient @ held.covariance @ gradient)), "deg")
    assert error == pytest.approx(np.hypot(0.98 * 0.2 * 2.0, 0.01 * 1.5 * 2.0), rel=1e-12)


def test_any_input_can_be_the_parameter(tmp_path: Path) -> None:
    """The canard over a held elevator: a planar field in alpha and q."""
    text = PITCH.format(term="alpha^3").replace('parameter = "elevator_deg"', 'parameter = "canard_deg"')
    text = text.replace('inputs = ["canard_deg"]', 'inputs = ["elevator_deg"]').replace(
        "canard_deg = 2.0", "elevator_deg = 3.0"
    )
    file = read_model_file(write(tmp_path, text))
    system = file.system()
    assert isinstance(system, PlanarSystem)
    assert system.variables == ("alpha_rad", "q_rad_s", "canard_rad")
    rates = from_si(system.velocity([0.0, 0.0], to_si(2.0, "deg")), "deg")
    np.testing.assert_allclose(rates, [0.1, 1.5 * 2.0 - 4.0 * 3.0], rtol=1e-13)


def test_terms_with_angular_units_convert_by_their_powers(tmp_path: Path) -> None:
    """A coefficient of alpha^2*q in 1/(deg² s) is (180/pi)² larger in radians: the same function."""
    text = PITCH.format(term="alpha^2*q")
    model = read_model_file(write(tmp_path, text)).model()
    row = model.q_dot.term(alpha_rad=2, q_rad_s=1)
    assert model.q_dot.coefficients[row] * si_factor("deg") ** 2 == pytest.approx(0.05, rel=1e-14)


def test_dimensionless_states_may_change_per_second(tmp_path: Path) -> None:
    text = OSCILLATOR.replace("x_dot_1", "x_dot_1_s").replace("y_dot_1", "y_dot_1_s")
    system = read_model_file(write(tmp_path, text)).system()
    assert isinstance(system, PlanarSystem)
    assert system.first.polynomial.value_unit == "1_s"


@given(st.dictionaries(st.sampled_from(["x", "y1", "mu_long"]), st.integers(0, MAXIMUM_POWER)))
def test_any_term_is_read_back(powers: dict[str, int]) -> None:
    text = "*".join(name if power == 1 else f"{name}^{power}" for name, power in powers.items()) or "constant"
    symbols = ("x", "y1", "mu_long")
    assert parse_term(text, symbols) == tuple(powers.get(name, 0) for name in symbols)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x*", "is no term"),
        ("x^-1", "is no term"),
        ("2x", "is no term"),
        ("x y", "is no term"),
        ("", "is no term"),
        ("z", "unknown variable 'z'; expected one of: x, y1, mu_long, constant"),
        ("mulong", "unknown variable 'mulong'; did you mean 'mu_long'?"),
        ("x3", "unknown variable 'x3'; did you mean 'x^3'?"),
        ("x^31", "above 30"),
        ("x^20*x^11", "above 30"),
    ],
)
def test_what_is_no_term(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=re.escape(says)):
        parse_term(text, ("x", "y1", "mu_long"))


# faults


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('schema = "finback/polynomials/1"\n', "", "schema: missing; write schema = 'finback/polynomials/1'"),
        ("polynomials/1", "polynomials/2", "did you mean 'finback/polynomials/1'?"),
        ('["x_1", "y_1"]', '["x_1"]', "state: must be a list of 2 names, got ['x_1']"),
        ('["x_1", "y_1"]', '["x", "y_1"]', "state[0]: 'x' names no unit"),
        ('["x_1", "y_1"]', '["x_1", "x_rad"]', "state: the name 'x' stands for two variables"),
        ('["x_1", "y_1"]', '["x_1", 3]', "state[1]: must be a name with its unit, got 3"),
        ('["x_1", "y_1"]', '["x-y_1", "y_1"]', "state[0]: 'x-y_1' is no name"),
        ('["x_1", "y_1"]', '["x_kg", "y_1"]', "state: the rate of 'x_kg' has no unit here"),
        ('parameter = "mu_1"\n', "", "parameter: missing"),
        ("[x_dot_1]", "[xdot_1]", "x_dot: the rate of x_1 needs one table [x_dot_1]"),
        ("[x_dot_1]", "[xdot_1]", "xdot_1: unknown key; did you mean"),
        ("[x_dot_1]", "[x_dot_deg]", "x_dot: the rate of x_1 needs one table [x_dot_1], got x_dot_deg"),
        ("[x_dot_1]", "[x_dot_1_s]", "x_dot_1_s and y_dot_1: one rate is per second"),
        ("y = 1", "z = 1", "x_dot_1.z: unknown variable 'z'"),
        ("y = 1", "y = '1'", "x_dot_1.y: must be a number, got '1'"),
        ("y = 1", "y = true", "x_dot_1.y: must be a number, got True"),
        ("y = 1", "y = inf", "x_dot_1.y: must be a finite number, got inf"),
        ("y = 1", f"y = {'9' * 400}", "x_dot_1.y: must be a finite number"),
        ("y = 1", 'y = 1\n"y*x^0" = 2', "x_dot_1.y*x^0: this term stands here twice"),
        ("y = 1", "y = { valu = 1 }", "x_dot_1.y.valu: unknown key; did you mean 'value'?"),
        ("y = 1", "y = { valu = 1 }", "x_dot_1.y.value: missing"),
        ("y = 1", "y = { value = 1, standard_error = -1 }", "x_dot_1.y.standard_error: must be 0 or more"),
        ("[x_dot_1]", "[held]\nx_1 = 1.0\n[x_dot_1]", "held: there are no inputs to be held"),
        ("[x_dot_1]", "[range]\nx_1 = 1.0\n[x_dot_1]", "range.x_1: must be [low, high], got 1.0"),
        ("[x_dot_1]", "[range]\nx_1 = [2, 1]\n[x_dot_1]", "range.x_1: the lower end must come first"),
        ("[x_dot_1]", "[range]\nx = [1, 2]\n[x_dot_1]", "range.x: unknown key"),
        ("[x_dot_1]", "[domain]\nx_1 = [1, 'b']\n[x_dot_1]", "domain.x_1[1]: must be a number"),
        ('parameter = "mu_1"', 'parameter = "mu_1"\nrange = 3', "range: must be a table [range], got 3"),
        ('parameter = "mu_1"', 'parameter = "mu_1"\ninputs = ["k_1"]', "held.k_1: missing; an input needs the value"),
        ('parameter = "mu_1"', 'parameter = "mu_1"\nspeed = 3', "speed: unknown key"),
        ("[x_dot_1]", "[covariance]\nterms = 'y'\n[x_dot_1]", "covariance.terms: must be a list of terms"),
        (
            "[x_dot_1]",
            "[covariance]\nterms = ['x_do: y']\nmatrix = []\n[x_dot_1]",
            "covariance.terms[0]: 'x_do: y' begins with no equation; did you mean 'x_dot'?",
        ),
        (
            "[x_dot_1]",
            "[covariance]\nterms = ['x_dot: x', 'x_dot: z']\nmatrix = [[1.0]]\n[x_dot_1]",
            "covariance.terms[0]: 'x' is no term of x_dot",
        ),
        (
            "[x_dot_1]",
            "[covariance]\nterms = ['x_dot: y', 'x_dot: y']\nmatrix = [[1, 0], [0, 1]]\n[x_dot_1]",
            "covariance.terms[1]: this term stands here twice",
        ),
        (
            "[x_dot_1]",
            "[covariance]\nterms = ['x_dot: y']\nmatrix = [[1, 2]]\n[x_dot_1]",
            "covariance.matrix: must be a list of 1 rows of 1 numbers",
        ),
        (
            "[x_dot_1]",
            "[covariance]\nterms = ['x_dot: y', 'y_dot: x']\nmatrix = [[1, 2], [2, 1]]\n[x_dot_1]",
            "covariance.matrix: the covariance of two coefficients exceeds their standard deviations",
        ),
        (
            "y = 1",
            "y = { value = 1, standard_error = 1 }\n[covariance]\nterms = ['x_dot: y']\nmatrix = [[1]]",
            "covariance.terms: a term that has a standard_error stands here too",
        ),
        ("y = 1", "y = ", "syntax: "),
    ],
)
def test_a_fault_of_polynomials_is_said_with_its_place(old: str, new: str, says: str, tmp_path: Path) -> None:
    assert old in OSCILLATOR
    path = write(tmp_path, OSCILLATOR.replace(old, new, 1))
    with pytest.raises(ModelFileError) as caught:
        read_model_file(path)
    assert any(fault.startswith(says) or says in fault for fault in caught.value.faults), caught.value.faults
    assert caught.value.message.startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("alpha4 = 1e-6", "alfa4 = 1e-6", "alpha_dot_deg_s.alfa4: unknown term"),
        ("q = 0.98\n", "", "alpha_dot_deg_s.q: missing"),
        ("q = 0.98", "q = 'a'", "alpha_dot_deg_s.q: must be a number, got 'a'"),
        ("[q_dot_deg_s2]", "[q_dot_deg]", "q_dot_deg_s2: missing; add a table [q_dot_deg_s2]"),
        ("[q_dot_deg_s2]", "[q_dot_deg]", "q_dot_deg: unknown key; did you mean 'q_dot_deg_s2'?"),
        ("q = -0.4\nalpha_dot = -0.3\n", "", "q_dot_deg_s2.q_plus_alpha_dot: missing (or give q and alpha_dot)"),
        ("q = -0.4\n", "q_plus_alpha_dot = 1.0\n", "q_dot_deg_s2.q_plus_alpha_dot: stands for q and alpha_dot"),
        ("p_r = 0.9", "pr = 0.9", "f_q.pr: unknown key; did you mean 'p_r'?"),
        ("p_deg_s = 10.0", "gamma_deg = 10.0", "held.gamma_deg: unknown key"),
        ("alpha_beta = 0.003\n", "", "held.beta_deg: the model does not depend on it"),
        ("[domain]\nalpha_deg", "[domain]\nalpha", "domain.alpha: unknown key; did you mean 'alpha_deg'?"),
        (
            "elevator_deg = [-20.0, 10.0]",
            "elevator_deg = [10, 10]",
            "range.elevator_deg: the lower end must come first",
        ),
    ],
)
def test_a_fault_of_the_paper_form_is_said_with_its_place(old: str, new: str, says: str, tmp_path: Path) -> None:
    assert old in PAPER_FORM
    with pytest.raises(ModelFileError) as caught:
        read_model_file(write(tmp_path, PAPER_FORM.replace(old, new, 1)))
    assert any(fault.startswith(says) for fault in caught.value.faults), caught.value.faults


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    text = OSCILLATOR.replace("y = 1", "z = 1").replace("x = -1.0", "x = 'a'") + "[range]\nx_1 = [1]\n[speed]\n"
    with pytest.raises(ModelFileError) as caught:
        read_model_file(write(tmp_path, text))
    assert [fault.partition(":")[0] for fault in caught.value.faults] == [
        "speed",
        "x_dot_1.z",
        "y_dot_1.x",
        "range.x_1",
    ]


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    write(tmp_path, OSCILLATOR)
    with pytest.raises(ModelFileError, match="file: not found; did you mean"):
        read_model_file(tmp_path / "mode.toml")


# results of a run


def test_a_run_and_its_model_json_are_one_model(finished_run: Path) -> None:
    identified = load_identification(finished_run).model
    for path in (finished_run, finished_run / "model.json"):
        file = read_model_file(path)
        np.testing.assert_array_equal(file.model().coefficients, identified.coefficients)
        np.testing.assert_array_equal(file.model().covariance, identified.covariance)
        assert isinstance(file.system(), LienardSystem)
    with pytest.raises(InputError, match=r"sweep\.json is no model that this version can read"):
        read_model_file(finished_run / "sweep.json")

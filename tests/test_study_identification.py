"""Estimator, terms and biases in a study file."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from finback.errors import StudyError
from finback.identification.method import Method
from finback.study.reader import inspect_study, read_study_part
from finback.units import to_si

TABLE = "[identification]\n"


def faults(text: str, folder: Path) -> tuple[str, ...]:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return inspect_study(path)[2]


def test_estimator_terms_and_biases_are_read(small_study_text: str, tmp_path: Path) -> None:
    added = (
        'method = "output-error"\nalpha_dot_terms = ["1", "q", "alpha"]\nq_dot_terms = ["q+alpha_dot", "alpha^2"]\n'
        "alpha_bias_deg = 0.5\nelevator_delay_s = 0.02\n"
    )
    path = tmp_path / "study.toml"
    path.write_text(small_study_text.replace(TABLE, TABLE + added), encoding="utf-8")
    study, _, found = inspect_study(path)
    assert not found
    assert study is not None
    options = study.identification
    assert options.method is Method.OUTPUT_ERROR
    assert [term.label for term in options.model_form.q_dot] == ["q+alpha_dot", "alpha^2"]
    assert options.nuisances.alpha_bias_rad == pytest.approx(to_si(0.5, "deg"))
    assert options.nuisances.elevator_delay_s == 0.02


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ('method = "newton"', "identification.method: must be one of: weak-form, output-error"),
        ('alpha_dot_terms = ["1"]', "identification.q_dot_terms: missing: alpha_dot_terms stands here"),
        ("alpha_bias_deg = nan", "identification.alpha_bias_deg: must be"),
        ("q_bias_deg_s = 2e4", "identification.q_bias_deg_s: must be at most 10000, or inf"),
        (
            'alpha_dot_terms = ["1"]\nq_dot_terms = ["q", "alfa"]',
            "identification.q_dot_terms[1]: unknown variable 'alfa'",
        ),
    ],
)
def test_each_fault_is_told(added: str, said: str, small_study_text: str, tmp_path: Path) -> None:
    found = faults(small_study_text.replace(TABLE, f"{TABLE}{added}\n"), tmp_path)
    assert any(fault.startswith(said) for fault in found), found


KNOWN = """
[identification.fixed]
"alpha_dot: q" = 1.0
"q_dot: alpha^2" = -0.02

[identification.bounded]
"q_dot: q" = [-inf, 0.0]
"q_dot: elevator" = [-6, -4]

[analysis]"""


def test_known_coefficients_are_read_in_degrees(small_study_text: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    asked = "alpha_bias_deg = inf\nconstants_per_flight = true\n"
    path.write_text(small_study_text.replace(TABLE, TABLE + asked).replace("[analysis]", KNOWN), encoding="utf-8")
    study, _, found = inspect_study(path)
    assert not found
    assert study is not None
    options = study.identification
    assert options.constants_per_flight
    assert math.isinf(options.nuisances.alpha_bias_rad)
    form = options.model_form
    assert form.sizes == (6, 6)  # those of the orders
    fixed = {(item.equation, item.term.label): item.value for item in form.fixed}
    # q is 1 in any unit of angle; 1/(deg s²) is 57.3/(rad s²).
    assert fixed == pytest.approx({("alpha_dot", "q"): 1.0, ("q_dot", "alpha^2"): -0.02 / to_si(1.0, "deg")})
    bounded = {item.term.label: (item.low, item.high) for item in form.bounded}
    assert bounded == {"q": (-math.inf, 0.0), "elevator": (-6.0, -4.0)}


def test_faults_of_known_coefficients_come_at_once(small_study_text: str, tmp_path: Path) -> None:
    wrong = (
        '[identification.fixed]\n"alphadot: q" = 1.0\n"q_dot: q^2" = 1.0\n"q_dot: alpha" = "x"\n"q_dot: q" = inf\n'
        '[identification.bounded]\n"q_dot: alpha" = [2.0, 1.0]\n"q_dot: elevator" = -4\n\n[analysis]'
    )
    said = faults(small_study_text.replace("[analysis]", wrong), tmp_path)
    assert len(said) == 6
    assert any("'alphadot' is no equation; did you mean 'alpha_dot'?" in fault for fault in said)
    assert any("identification.fixed.'q_dot: q^2': q_dot has no term q^2" in fault for fault in said)
    assert sum("must be two numbers, the lower one first" in fault for fault in said) == 2
    both = small_study_text.replace("[analysis]", KNOWN.replace("[analysis]", f"{SELECT}\n[analysis]"))
    assert any("terms that are not yet found" in fault for fault in faults(both, tmp_path))


def without_orders(text: str) -> str:
    return text.replace("alpha_dot_order = 3\nq_dot_order = 3\n", "")


TERMS = 'alpha_dot_terms = ["1", "q"]\nq_dot_terms = ["alpha*q", "elevator"]\n'
SELECT = "[identification.select]\n"


@pytest.mark.parametrize("form", [TERMS, SELECT])
def test_orders_are_asked_for_only_where_nothing_else_says_the_terms(
    form: str, small_study_text: str, tmp_path: Path
) -> None:
    bare = without_orders(small_study_text)
    assert bare != small_study_text
    text = bare.replace(TABLE, TABLE + form) if form == TERMS else bare.replace("[analysis]", f"{form}\n[analysis]")
    assert faults(text, tmp_path) == ()
    said = faults(bare, tmp_path)
    assert [fault.partition(":")[0] for fault in said] == [
        "identification.alpha_dot_order",
        "identification.q_dot_order",
    ]


def test_all_faults_of_terms_and_of_the_library_come_at_once(small_study_text: str, tmp_path: Path) -> None:
    added = (
        f"{SELECT}variables = ['alpha', 'kew']\ndegre = 2\nfalse_alarm = 0.9\nterms = ['alpha**', '1', 'q*elevatr']\n"
        "prediction = ['three-two-one-one-01', 'release-05', 'three-two-one-03']\n\n[analysis]"
    )
    text = small_study_text.replace("[analysis]", added).replace("spacing_s = 0.05", "spacing_s = 0.5")
    said = faults(text.replace(TABLE, f'{TABLE}method = "newton"\n'), tmp_path)
    places = {fault.partition(":")[0] for fault in said}
    assert places == {
        "identification.method",
        "identification.spacing_s",
        "identification.select.degre",
        "identification.select.false_alarm",
        "identification.select.variables[1]",
        "identification.select.terms[0]",
        "identification.select.terms[2]",
        "identification.select.prediction[1]",
        "identification.select.prediction[2]",
    }
    assert any("did you mean 'degree'" in fault for fault in said)
    assert any("did you mean elevator" in fault for fault in said)
    assert any("the sweep has no flight 'release-05'; did you mean 'release-04'?" in fault for fault in said)


def test_terms_and_a_library_at_once_are_a_fault(small_study_text: str, tmp_path: Path) -> None:
    text = small_study_text.replace(TABLE, TABLE + TERMS).replace("[analysis]", f"{SELECT}\n[analysis]")
    (said,) = faults(text, tmp_path)
    assert said.startswith("identification.select: alpha_dot_terms stands here too")


def test_terms_are_found_where_constants_differ(small_study_text: str, tmp_path: Path) -> None:
    text = without_orders(small_study_text).replace(TABLE, f"{TABLE}constants_per_flight = true\n")
    assert faults(text.replace("[analysis]", f"{SELECT}\n[analysis]"), tmp_path) == ()
    kept = text.replace("[analysis]", f'{SELECT}prediction = ["multistep"]\n[analysis]')
    assert any("constants that nothing fits" in fault for fault in faults(kept, tmp_path))


def test_a_stage_asks_for_its_own_section_only(small_study_text: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    sections = re.split(r"(?m)^(?=\[analysis\]|\[validation\])", small_study_text)
    path.write_text(sections[0], encoding="utf-8")
    part = read_study_part(path, "identification")
    assert part.identification
    assert part.analysis == ()
    with pytest.raises(StudyError) as refused:
        read_study_part(path, "analysis")
    assert refused.value.faults == ("analysis: missing; add a table [analysis]",)
    path.write_text(f"{sections[0]}{sections[1]}[validation]\n", encoding="utf-8")
    with pytest.raises(StudyError, match=r"validation\.equilibrium_elevator_deg: missing"):
        read_study_part(path, "identification")  # what is there is checked

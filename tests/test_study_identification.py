"""Estimator, terms and biases in a study file."""

from __future__ import annotations

from pathlib import Path

import pytest

from finback.identification.method import Method
from finback.study.reader import inspect_study
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
        ('alpha_dot_terms = ["1"]', "identification: alpha_dot_terms and q_dot_terms"),
        ('alpha_dot_terms = ["1"]\nq_dot_terms = ["alfa"]', "identification: unknown variable 'alfa'"),
    ],
)
def test_each_fault_is_told(added: str, said: str, small_study_text: str, tmp_path: Path) -> None:
    found = faults(small_study_text.replace(TABLE, f"{TABLE}{added}\n"), tmp_path)
    assert any(fault.startswith(said) for fault in found), found

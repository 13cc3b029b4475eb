"""Numbers and units as people read them."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, strategies as st

from finback.units import SI_FACTORS
from finback.views.labels import axis_label, minus, short, unit_text, with_error


@pytest.mark.parametrize(
    ("unit", "text"),
    [("deg_s2", "deg/s²"), ("m_s", "m/s"), ("kg_m3", "kg/m³"), ("1", ""), ("1_s", "1/s"), ("deg", "deg")],
)
def test_units_are_written_as_printed(unit: str, text: str) -> None:
    assert unit_text(unit) == text


def test_every_known_unit_can_be_written() -> None:
    assert all("_" not in unit_text(unit) for unit in SI_FACTORS)


def test_axes_have_symbol_and_unit() -> None:
    assert [axis_label(name) for name in ("alpha_rad", "q_rad_s", "elevator_rad", "time_s")] == [
        "α [deg]",
        "q [deg/s]",
        "δe [deg]",
        "t [s]",
    ]


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (-35.129324, 0.0034, "−35.1293 ± 0.0034"),
        (14.7, 0.3, "14.70 ± 0.30"),
        (1234.5, 56.0, "1234 ± 56"),
        (0.00068356, 0.0000005, "(6.8356 ± 0.0050)×10⁻⁴"),
        (1.5, 0.0, "1.5 ± 0"),
        (1.5, float("inf"), "not determined"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_errors_decide_the_digits(value: float, error: float, text: str) -> None:
    assert with_error(value, error) == text


@given(value=st.floats(-1e6, 1e6), error=st.floats(1e-9, 1e3))
def test_what_is_written_is_within_the_error(value: float, error: float) -> None:
    match = re.fullmatch(r"\(?(−?[\d.]+) ± ([\d.]+)\)?(?:×10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+))?", with_error(value, error))
    assert match
    power = int((match[3] or "⁰").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")))
    assert abs(float(match[1].replace("−", "-")) * 10.0**power - value) <= 0.51 * error
    assert float(match[2]) * 10.0**power == pytest.approx(error, rel=0.06)  # two digits, rounded


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.0"),
        (0.1, "0.10"),
        (18.4, "18"),
        (0.00031, "3.1×10⁻⁴"),
        (float("inf"), "∞"),
        (-2.5e7, "−2.5×10⁷"),
        (float("nan"), "–"),
    ],
)
def test_short_numbers(value: float, text: str) -> None:
    assert short(value) == text


def test_signs_are_printed_and_hyphens_stay() -> None:
    assert minus("holdout-doublet-01: -3.5 deg, (-1), x-ray, -.5") == "holdout-doublet-01: −3.5 deg, (−1), x-ray, −.5"


def test_zero_has_no_sign() -> None:
    assert minus("α -0.00, -0 deg, (-0.000), -0.01, x-0, -05") == "α 0.00, 0 deg, (0.000), −0.01, x-0, −05"
    assert with_error(-1e-9, 0.01) == "0.000 ± 0.010"

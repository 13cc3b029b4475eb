"""No digit more than an uncertainty supports, wherever a number is written for people."""

from __future__ import annotations

import re
from decimal import Decimal

import pytest
from hypothesis import given, strategies as st

from finback.cli.numbers import coefficient, measured
from finback.digits import NOT_DETERMINED, decimals, exponent, interval, supported
from finback.store.export.latex import concise
from finback.views.labels import with_error

ROUNDED = 0.51  # of the last digit: half of it, and the binary fraction
TWO_DIGITS = 0.051  # relative: 1.05 is written 1.1 or 1.0

values = st.floats(min_value=-1e8, max_value=1e8)
uncertainties = st.floats(min_value=1e-8, max_value=1e6)


def significant(text: str) -> int:
    """Count the digits of a decimal number from the first that is not 0; zeros that end a whole number do not count."""
    bare = text.lstrip("-").replace(".", "").lstrip("0")
    return len(bare if "." in text else bare.rstrip("0"))


@given(value=values, uncertainty=uncertainties, power=st.integers(min_value=-6, max_value=6))
def test_two_digits_of_the_uncertainty_and_none_beyond(value: float, uncertainty: float, power: int) -> None:
    number, error = supported(value, uncertainty, power=power)
    assert 1 <= significant(error) <= 2
    scale = Decimal(10) ** power
    assert float(Decimal(error) * scale) == pytest.approx(uncertainty, rel=TWO_DIGITS)
    last = 10.0 ** -decimals(uncertainty)
    assert abs(float(Decimal(number) * scale) - value) <= ROUNDED * last + 1e-15 * abs(value)
    # Both end at the same place.
    assert len(number.partition(".")[2]) == len(error.partition(".")[2])
    assert not re.fullmatch(r"-[0.]+", number)


@pytest.mark.parametrize(
    ("value", "uncertainty", "texts"),
    [
        (-35.12932412, 0.0021, ("-35.1293", "0.0021")),
        (1.0, 0.0996, ("1.00", "0.10")),  # rounds up to one digit less
        (1234.5, 56.0, ("1234", "56")),
        (1234.5, 249.0, ("1230", "250")),
        (-3e-6, 1.5e-3, ("0.0000", "0.0015")),  # smaller than its error: no sign, no digit
        (12.0, 3.0, ("12.0", "3.0")),
    ],
)
def test_known_texts(value: float, uncertainty: float, texts: tuple[str, str]) -> None:
    assert supported(value, uncertainty) == texts


@pytest.mark.parametrize("size", [1e-300, 1e300, 5e-324])
def test_extremes_are_written(size: float) -> None:
    assert supported(size, size, power=exponent(size, size))


def test_an_uncertainty_without_end_leaves_no_digit() -> None:
    for text in (
        measured(-35.12932412, float("inf")),
        coefficient(-35.12932412, float("inf")),
        with_error(-35.12932412, float("inf")),
        concise(-35.12932412, float("inf")),
        interval(float("-inf"), float("inf"))[0],
    ):
        assert NOT_DETERMINED in text
        assert not re.search(r"\d", text)


@given(value=st.floats(min_value=-1e3, max_value=1e3), error=st.floats(min_value=1e-6, max_value=1e3))
def test_every_writer_writes_the_same_digits(value: float, error: float) -> None:
    """The number of the terminal, of the report and of LaTeX, read back, are one to a unit of the last digit."""
    last = 10.0 ** -decimals(error)
    terminal = float(measured(value, error).partition(" ± ")[0])
    table = float(coefficient(value, error).partition(" ± ")[0])
    report = re.fullmatch(r"\(?(−?[\d.]+) ± [\d.]+\)?(?:×10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+))?", with_error(value, error))
    latex = re.fullmatch(r"(-?[\d.]+)\(\d\d?\)(?: \\times 10\^\{(-?\d+)\})?", concise(value, error))
    assert report
    assert latex
    power = int((report[2] or "⁰").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")))
    shown = [
        terminal,
        table,
        float(report[1].replace("−", "-")) * 10.0**power,
        float(latex[1]) * 10.0 ** int(latex[2] or 0),
    ]
    for number in shown:
        assert abs(number - value) <= ROUNDED * last


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (-0.06, 0.12, "-0.06 ± 0.12"),
        (0.001, 0.23, "0.00 ± 0.23"),
        (0.3, 1.1, "0.3 ± 1.1"),
        (-35.1293, 0.0021, "-35.1293 ± 0.0021"),
        (-6.2e-6, 1.2e-5, "-6e-06 ± 1.2e-05"),
        (1e-8, 1.2e-5, "0 ± 1.2e-05"),
        (-1.314e-5, 2.1e-9, "-1.31400e-05 ± 2.1e-09"),
        (3.45678e6, 1.2e3, "3.4568e+06 ± 1.2e+03"),
    ],
)
def test_coefficients_begin_with_a_digit_that_is_not_zero(value: float, error: float, text: str) -> None:
    assert coefficient(value, error) == text


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (1.23456, 1.24456, ("1.2346", "1.2446")),
        (-10.0, 30.0, ("-10", "30")),
        (1.0e-7, 1.2e-7, ("1.00e-07", "1.20e-07")),
        (2.0, 2.0, ("2", "2")),
    ],
)
def test_ends_of_intervals(low: float, high: float, texts: tuple[str, str]) -> None:
    assert interval(low, high) == texts

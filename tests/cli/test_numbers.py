"""Numbers on the terminal."""

from __future__ import annotations

import math

import pytest

from finback.cli.numbers import decimals, display_unit, measured, plain, shown, to_places, written


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (-35.12932412, 0.0021, "-35.1293 ± 0.0021"),
        (-35.12932412, 0.21, "-35.13 ± 0.21"),
        (-35.12932412, 21.0, "-35 ± 21"),
        (-35.12932412, 0.0, "-35.129"),
        (-35.12932412, math.inf, "not determined"),
        (math.nan, 0.1, "–"),
        (1.0, 0.0099, "1.0000 ± 0.0099"),
    ],
)
def test_a_measured_number_shows_two_digits_of_its_uncertainty(value: float, uncertainty: float, text: str) -> None:
    assert measured(value, uncertainty) == text


@pytest.mark.parametrize(("scale", "places"), [(0.01, 3), (0.5, 2), (1.0, 1), (10.0, 0), (1e5, 0), (1e-30, 9)])
def test_decimals(scale: float, places: int) -> None:
    assert decimals(scale) == places


def test_what_rounds_to_zero_has_no_sign() -> None:
    assert (to_places(-0.004, 2), to_places(-0.006, 2)) == ("0.00", "-0.01")


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("1", ""),
        ("deg", "deg"),
        ("deg_s2", "deg/s²"),
        ("1_s", "1/s"),
        ("1_s_rad2", "1/(s rad²)"),
        ("k", "K"),
        ("pa", "Pa"),
        ("n_m2", "N/m²"),
        ("nm", "N m"),
        ("kt", "kt"),
    ],
)
def test_how_a_unit_is_written(unit: str, text: str) -> None:
    assert written(unit) == text


def test_numbers_that_are_none() -> None:
    assert (plain(math.nan), plain(math.inf), to_places(math.nan, 2), to_places(-math.inf, 2)) == ("–", "∞", "–", "-∞")


def test_people_read_degrees() -> None:
    assert display_unit("rad_s") == "deg_s"
    assert display_unit("1") == "1"
    assert shown(math.pi, "rad") == pytest.approx(180.0, rel=1e-15)  # one division
    assert shown(2.0, "1") == 2.0

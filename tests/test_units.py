"""The conversion table against independently known exact values."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.errors import InputError
from finback.units import SI_FACTORS, from_si, quantity_of, si_unit, to_si, unit_named, unit_of

EXACT = 4 * np.finfo(float).eps  # a handful of roundings


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (180.0, "deg", math.pi),
        (90.0, "deg_s", math.pi / 2),
        (1.0, "ft", 0.3048),
        (1.0, "ft_s", 0.3048),
        (1.0, "lbf", 4.4482216152605),  # NIST SP 811, exact
        (1.0, "slug", 14.593902937206364794),  # 0.45359237 * 9.80665 / 0.3048
        (1.0, "slug_ft2", 1.3558179483314004),  # = 1 ft lbf in J, NIST SP 811
        (1.0, "psf", 47.880258980335840277),  # 1 lbf/ft²
        (1.0, "slug_ft3", 515.3788183931961),
        (1.0, "kn", 1000.0),
        (1.0, "psi", 6894.757293168361),  # NIST SP 811
        (1.0, "lb_ft3", 16.018463373960142),  # NIST SP 811
        (1.0, "mi_h", 0.44704),  # exact
        (30.0, "rpm", math.pi),
    ],
)
def test_factors_are_exact(value: float, unit: str, expected: float) -> None:
    assert to_si(value, unit) == pytest.approx(expected, rel=EXACT, abs=0)


@given(st.floats(-1e9, 1e9), st.sampled_from(sorted(SI_FACTORS)))
def test_there_and_back(value: float, unit: str) -> None:
    assert from_si(to_si(value, unit), unit) == pytest.approx(value, rel=EXACT, abs=1e-300)
    assert si_unit(si_unit(unit)) == si_unit(unit)


def test_the_unit_is_read_from_the_end_of_a_name() -> None:
    assert unit_of("q_deg_s") == "deg_s"
    assert unit_of("alpha_dot_rad_s") == "rad_s"
    assert unit_of("q_dot_rad_s2") == "rad_s2"
    assert quantity_of("q_dot_rad_s2") == "q_dot"
    assert unit_of("time_s") == "s"


@pytest.mark.parametrize("name", ["alpha", "", "alpha_degrees", "deg"])
def test_a_name_without_unit_is_a_mistake(name: str) -> None:
    with pytest.raises(InputError, match="names no unit"):
        unit_of(name)


def test_an_unknown_unit_names_the_known_ones() -> None:
    with pytest.raises(InputError, match="unknown unit 'furlong'") as caught:
        to_si(1.0, "furlong")
    assert "ft_s" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "suffix"),
    [
        ("dgR", "degr"),
        ("slug/ft3", "slug_ft3"),
        ("slug/ft^3", "slug_ft3"),
        ("slug/ft³", "slug_ft3"),
        ("nmi/h", "nmi_h"),
        ("nmi_h", "nmi_h"),
        ("ft/min", "ft_min"),
        ("ftlbf", "ftlbf"),
        ("ft-lbf", "ftlbf"),
        ("ft·lbf", "ftlbf"),
        ("lbf*ft", "ftlbf"),
        ("ft lbf", "ftlbf"),
        ("lbf/ft2", "lbf_ft2"),
        ("deg/s", "deg_s"),
        ("°/s", "deg_s"),
        ("rad/sec", "rad_s"),
        ("deg per second", "deg_s"),
        ("ft/sec**2", "ft_s2"),
        ("ft/s/s", "ft_s2"),
        ("Degrees", "deg"),
        ("KTS", "kt"),
        ("N·m", "nm"),
        ("N/m^2", "n_m2"),
        ("slug-ft2", "slug_ft2"),
        ("Pa", "pa"),
        ("-", "1"),
    ],
)
def test_units_as_people_and_files_write_them(text: str, suffix: str) -> None:
    assert unit_named(text) == suffix


@pytest.mark.parametrize("unit", sorted(SI_FACTORS))
def test_every_suffix_is_read_with_slashes_and_capitals(unit: str) -> None:
    text = unit.replace("_", "/")
    assert unit_named(text) == unit_named(text.upper()) == unit


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("degF", "unit = 'degr', offset = 459.67"),
        ("°C", "unit = 'k', offset = 273.15"),
        ("lbs", "did you mean lb"),
        ("furlong", "known units"),
    ],
)
def test_what_is_no_unit_is_answered(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        unit_named(text)
    assert said in str(caught.value)

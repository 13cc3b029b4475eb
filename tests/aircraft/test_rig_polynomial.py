"""At the reference condition the simulator's rates are the published polynomial, and those of a changed one."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from finback.flight.rig import Rig
from finback.units import to_si

Polynomial = Callable[[float, float, float], tuple[float, float]]

EXACT = 1e-9  # rad/s and rad/s², at breakpoints
BREAKPOINT_DEG = 0.1
STATES = 1500


def states(alpha_deg: np.ndarray, seed: int) -> np.ndarray:
    """Return alpha, q, elevator in SI: q within ±120 deg/s, elevator over the research range."""
    random = np.random.default_rng(seed)
    q, elevator = random.uniform(-120.0, 120.0, alpha_deg.size), random.uniform(-40.0, 20.0, alpha_deg.size)
    return to_si(np.column_stack([alpha_deg, q, elevator]), "deg")


def worst(rig: Rig, polynomial: Polynomial, points: np.ndarray) -> np.ndarray:
    """Return the largest differences of alpha_dot in rad/s and q_dot in rad/s²."""
    flown = np.array([rig.derivatives(*point) for point in points.tolist()])
    expected = np.array([polynomial(*point) for point in points.tolist()])
    return np.abs(flown - expected).max(axis=0)


def at_breakpoints(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(-340, 461, STATES) / 10.0


def test_the_rig_is_the_polynomial_at_breakpoints(
    rig: Rig, published_polynomial: Callable[[Path], Polynomial], aircraft_folder: Path
) -> None:
    polynomial = published_polynomial(aircraft_folder / "published.toml")
    assert (worst(rig, polynomial, states(at_breakpoints(1), 2)) < EXACT).all()


def test_between_breakpoints_it_errs_by_the_interpolation_bound_at_most(
    rig: Rig, published_polynomial: Callable[[Path], Polynomial], aircraft_folder: Path
) -> None:
    # A chord of a function f over h is off by at most h²/8 max|f''|. In degrees: P'' and M'' of the two cubics are
    # linear in alpha, so largest at an end; the error of alpha_dot also enters q_dot, through k (q + alpha_dot).
    ends = np.array([-34.0, 46.0])
    share = BREAKPOINT_DEG**2 / 8.0
    bound_p = share * np.abs(2 * -0.00996132996307 + 6 * 0.000683555761819 * ends).max()
    bound_m = share * np.abs(2 * -0.13571798007977 + 6 * 0.00801903617531 * ends).max() + 0.4337954310598 * bound_p
    polynomial = published_polynomial(aircraft_folder / "published.toml")
    alpha_deg = np.random.default_rng(3).uniform(-34.0, 46.0, STATES)
    found = worst(rig, polynomial, states(alpha_deg, 4))
    assert (found <= to_si(np.array([bound_p, bound_m]), "deg") + EXACT).all()
    assert (found > EXACT).all()  # between breakpoints it is a table


@pytest.mark.parametrize("seed", [11, 12])
def test_another_published_model_gives_another_aircraft(
    builder: ModuleType,
    mount_rig: Callable[[Path], Rig],
    published_polynomial: Callable[[Path], Polynomial],
    aircraft_folder: Path,
    tmp_path: Path,
    seed: int,
) -> None:
    random = np.random.default_rng(seed)
    text, count = re.subn(
        r"^((?:q|q_plus_alpha_dot|constant|alpha\d?|elevator) = )(\S+)",
        lambda found: f"{found[1]}{float(found[2]) * float(random.uniform(0.8, 1.2))!r}",
        (aircraft_folder / "published.toml").read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    )
    assert count == 12
    published, folder = tmp_path / "published.toml", tmp_path / "f8ii"
    published.write_text(text, encoding="utf-8")
    assert builder.main(["--published", str(published), "--output", str(folder)]) == 0
    assert (folder / "f8ii.xml").read_bytes() != (aircraft_folder / "f8ii.xml").read_bytes()
    with mount_rig(folder) as changed:
        assert (worst(changed, published_polynomial(published), states(at_breakpoints(seed), seed)) < EXACT).all()
        original = published_polynomial(aircraft_folder / "published.toml")
        assert (worst(changed, original, states(at_breakpoints(seed), seed)) > 1e-2).all()

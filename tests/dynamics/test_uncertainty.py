"""Intervals against sampling: coefficients drawn from the covariance, every object found anew for each draw.

The delta method is linear; with 2 % of scatter what it leaves out is a few percent of a standard deviation, and the
standard deviation of n draws is itself known to 1/sqrt(2 n), 5 % for 200.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.connection.search import connections
from finback.dynamics.cycle.cycle import cycles
from finback.dynamics.cycle.family import cycle_families
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points
from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.stability.region import stability_region
from finback.units import from_si, to_si

Build = Callable[..., LienardSystem]
Values = Callable[[LienardSystem], Sequence[float]]

SCATTER = 0.02
DRAWS = 200
AGREE = 0.15  # of a standard deviation: the acceptance of the issue; see above


def sd(interval: FloatArray) -> float:
    return float(interval[1] - interval[0]) / (2.0 * NORMAL_95)


def sampled(
    build: Build, rows: tuple[Sequence[float], Sequence[float]], gain: float, of: Values, draws: int = DRAWS
) -> FloatArray:
    """Return the standard deviations of what is found in systems with scattered f and g."""
    damping, force = (np.array(row, dtype=np.float64) for row in rows)
    generator = np.random.default_rng(7)
    found = []
    for _ in range(draws):
        one, other = (row * (1.0 + SCATTER * generator.standard_normal(row.size)) for row in (damping, force))
        found.append(list(of(build(one.tolist(), other.tolist(), gain=gain))))
    return np.std(found, axis=0, ddof=1)


def scattered(build: Build, rows: tuple[Sequence[float], Sequence[float]], gain: float) -> LienardSystem:
    """Return the system with the covariance of that scatter; the gain is known."""
    sizes = np.array([*rows[0], *rows[1], 0.0])
    return build(rows[0], rows[1], gain=gain, covariance=np.diag((SCATTER * sizes) ** 2))


def agree(delta: Sequence[float], samples: FloatArray) -> None:
    assert all(value > 0.0 for value in delta)
    np.testing.assert_allclose(np.array(delta) / samples, 1.0, rtol=0, atol=AGREE)


# the aircraft


@pytest.fixture(scope="module")
def aircraft(printed_system: LienardSystem) -> tuple[tuple[list[float], list[float]], float]:
    rows = printed_system.damping.ascending.tolist(), printed_system.force.ascending.tolist()
    return rows, printed_system.elevator_gain


RANGE = to_si(-45.0, "deg"), to_si(25.0, "deg")


def test_folds(build_system: Build, aircraft: tuple[tuple[list[float], list[float]], float]) -> None:
    rows, gain = aircraft
    found = folds(scattered(build_system, rows, gain))
    delta = [sd(fold.elevator_interval_rad) for fold in found] + [sd(fold.alpha_interval_rad) for fold in found]

    def values(system: LienardSystem) -> list[float]:
        again = folds(system)
        return [fold.elevator_rad for fold in again] + [fold.alpha_rad for fold in again]

    agree(delta, sampled(build_system, rows, gain, values))


def test_both_connections_of_the_aircraft(
    build_system: Build, aircraft: tuple[tuple[list[float], list[float]], float]
) -> None:
    """The elevator of the lower one moves by 0.42 to 0.44 deg for 2 % of scatter on the seven coefficients."""
    rows, gain = aircraft
    found = connections(scattered(build_system, rows, gain), RANGE).heteroclinics
    delta = [sd(one.elevator_interval_rad) for one in found]
    assert 0.42 <= from_si(delta[1], "deg") <= 0.445

    def values(system: LienardSystem) -> list[float]:
        return [one.elevator_rad for one in connections(system, RANGE).heteroclinics]

    samples = sampled(build_system, rows, gain, values)
    assert from_si(float(samples[1]), "deg") == pytest.approx(0.43, rel=3.0 / np.sqrt(2.0 * DRAWS))
    agree(delta, samples)


def test_the_boundary_of_the_aircraft(
    build_system: Build, aircraft: tuple[tuple[list[float], list[float]], float]
) -> None:
    rows, gain = aircraft
    elevator, limits = to_si(5.0, "deg"), (to_si(-100.0, "deg"), to_si(100.0, "deg"))
    region = stability_region(scattered(build_system, rows, gain), elevator, alpha_range_rad=limits)

    def values(system: LienardSystem) -> list[float]:
        again = stability_region(system, elevator, alpha_range_rad=limits)
        return [again.escape_distance_rad, again.area_rad2_s]

    samples = sampled(build_system, rows, gain, values, draws=100)  # 7 % of a standard deviation
    agree([sd(region.escape_interval_rad), sd(region.area_interval_rad2_s)], samples)


# a field with a Hopf point, a loop and cycles: x" = (0.1 + x) x' − x + x² + δ

LOOPED = (0.1, 1.0), (0.01, -1.0, 1.0)


def test_hopf_point_loop_and_cycle(build_system: Build) -> None:
    system = scattered(build_system, LOOPED, 1.0)
    (hopf,), (loop,) = hopf_points(system), connections(system, (-0.6, 0.4)).homoclinics
    (cycle,) = cycles(system, -0.25).cycles
    intervals = [hopf.elevator_interval_rad, hopf.alpha_interval_rad, hopf.lyapunov_interval_1_s]
    intervals += [loop.elevator_interval_rad, cycle.amplitude_interval_rad, cycle.period_interval_s]

    def values(one: LienardSystem) -> list[float]:
        (born,), (closed,) = hopf_points(one), connections(one, (-0.6, 0.4)).homoclinics
        (moving,) = cycles(one, -0.25).cycles
        found = [born.elevator_rad, born.alpha_rad, born.lyapunov_1_s]
        return [*found, closed.elevator_rad, moving.amplitude_rad, moving.period_s]

    agree([sd(interval) for interval in intervals], sampled(build_system, LOOPED, 1.0, values))


# two cycles that meet: x" = (0.5 x − x²) x' − 0.35 x + 0.5 x² + x³ + δ

SEMISTABLE = (0.0, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0)


@pytest.mark.slow  # cycle folds of 80 sampled models
def test_the_fold_of_two_cycles(build_system: Build) -> None:
    def fold_of(system: LienardSystem) -> tuple[float, FloatArray]:
        family, *_ = cycle_families(system, (-0.1, 0.1))
        (fold,) = family.folds
        return fold.elevator_rad, fold.elevator_interval_rad

    _, interval = fold_of(scattered(build_system, SEMISTABLE, 1.0))
    samples = sampled(build_system, SEMISTABLE, 1.0, lambda system: [fold_of(system)[0]], draws=80)  # 8 %
    agree([sd(interval)], samples)

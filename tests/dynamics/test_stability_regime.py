"""Regimes of what bounds the stability regions, and regions over the elevator with their greatest area and escape."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from finback.dynamics.connection.search import connections
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.regime import Event, bounds_at, regimes
from finback.dynamics.stability.region import stability_region
from finback.dynamics.stability.sweep import region_sweep
from finback.errors import RefusedError
from finback.units import from_si, to_si

Build = Callable[..., LienardSystem]
_CUT = (to_si(-100.0, "deg"), to_si(100.0, "deg"))


def test_the_published_model_has_three_regimes_with_a_region(printed_system: LienardSystem) -> None:
    """Both saddles bound the region between the two connections; beyond them the one towards which the fold lies."""
    found = regimes(printed_system, (to_si(-60.0, "deg"), to_si(40.0, "deg")))
    first, last = sorted(fold.elevator_rad for fold in folds(printed_system))
    upper, lower = (c.elevator_rad for c in connections(printed_system, (-1.0, 1.0)).heteroclinics)
    ends = [to_si(-60.0, "deg"), first, upper, lower, last, to_si(40.0, "deg")]
    assert [one.elevator_rad.tolist() for one in found] == [[a, b] for a, b in pairwise(ends)]
    fold, joined = Event.FOLD, Event.HETEROCLINIC
    assert [one.events[1] for one in found] == [fold, joined, joined, fold, Event.RANGE]
    assert [one.events[0] for one in found] == [Event.RANGE, fold, joined, joined, fold]
    sides = [
        [tuple(np.sign(np.array(b.saddles_alpha_rad) - b.alpha_rad).astype(int)) for b in one.bounds] for one in found
    ]
    assert sides == [[], [(1,)], [(-1, 1)], [(-1,)], []]
    assert not any(any(b.slits) or b.cycle for one in found for b in one.bounds)
    for one in found[1:4]:
        region = stability_region(printed_system, one.elevator_seen_rad, alpha_range_rad=_CUT)
        saddles = tuple(sorted({branch.saddle_alpha_rad for branch in region.boundary}))
        assert saddles == one.bounds[0].saddles_alpha_rad


def test_hopf_points_and_named_events_split_too(build_system: Build) -> None:
    """With f = x² − 0.3 the middle equilibrium is a sink within ±0.548, with an unstable cycle near the Hopf points."""
    system = build_system((-0.3, 0.0, 1.0), (0.0, -1.0, 0.0, 0.5))
    found = regimes(system, (-0.5, 0.5), others=(0.1,))
    assert Event.HOPF in [event for one in found for event in one.events]
    assert [one.elevator_rad[1] for one in found if one.events[1] is Event.OTHER] == [0.1]
    for one in found:
        assert len(one.bounds) == int(abs(_middle(system, one.elevator_seen_rad)) < 0.3**0.5)
    assert any(b.cycle and not b.saddles_alpha_rad for one in found for b in one.bounds)


def _middle(system: LienardSystem, elevator: float) -> float:
    roots = np.roots([*system.force.ascending[:0:-1], system.force.ascending[0] + elevator])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    return float(real[1])


def test_slits_are_told_from_borders(build_system: Build) -> None:
    """Between its wells' cycles and loops: the left sink takes both sides of the saddle, the right one none."""
    left, right = bounds_at(build_system((0.74, 0.3, -1.0), (0.0, 1.0, 0.2, -1.0), gain=0.0), 0.0)
    assert (left.slits, left.cycle) == ((True,), False)
    assert (right.saddles_alpha_rad, right.cycle) == ((), True)


def test_the_area_is_greatest_near_minus_ten_degrees(printed_system: LienardSystem) -> None:
    """As measured in 130 bits; where the derivative says it turns, the areas beside it are less."""
    degrees = [-35.0, -25.0, -12.5, -7.5, 0.0, 10.0, 16.0]
    found = region_sweep(printed_system, [to_si(value, "deg") for value in degrees], alpha_range_rad=_CUT)
    areas = from_si(from_si(found.area_rad2_s, "deg"), "deg")
    np.testing.assert_allclose(areas[[4, 5]], [9469.046, 2709.797], rtol=0, atol=6e-4)
    assert found.saddles == (1, 1, 2, 2, 1, 1, 0)
    assert np.isnan(areas[-1])
    assert np.isnan(found.escape_distance_rad[-1])
    (best,) = found.greatest_area
    assert from_si(best.elevator_rad, "deg") == pytest.approx(-9.935, abs=1e-3)  # a regression, not a reference
    step = to_si(0.01, "deg")
    for elevator in (best.elevator_rad - step, best.elevator_rad + step):
        beside = stability_region(printed_system, elevator, alpha_range_rad=_CUT).area_rad2_s
        assert best.value - 1e-4 * best.value < beside < best.value
    (corner,) = found.greatest_escape  # the nearest point changes from one saddle's border to the other's
    assert corner.value > found.escape_distance_rad[:-1].max()
    assert abs(corner.slope) > 0.1


def test_slopes_are_what_differences_give(printed_system: LienardSystem) -> None:
    at, step = to_si(-5.0, "deg"), 1e-5
    found = region_sweep(printed_system, [at - step, at, at + step], alpha_range_rad=_CUT)
    for values, slopes in (
        (found.area_rad2_s, found.area_slope_rad_s),
        (found.escape_distance_rad, found.escape_slope),
    ):
        assert slopes[1] == pytest.approx((values[2] - values[0]) / (2.0 * step), rel=1e-7)


def test_refusals(printed_system: LienardSystem) -> None:
    with pytest.raises(RefusedError, match="is empty"):
        regimes(printed_system, (0.0, 0.0))
    with pytest.raises(RefusedError, match="to rise"):
        region_sweep(printed_system, [0.1, 0.0], alpha_range_rad=_CUT)

"""Stability regions: reference areas, the three regimes, a grid map as the second road, and refusals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.path import Path

from finback.arrays import FloatArray
from finback.dynamics.analysis import AnalysisOptions, analyze, analyze_model
from finback.dynamics.connection.search import connections
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.stability.map import stability_map
from finback.dynamics.stability.region import StabilityRegion, stability_region
from finback.errors import RefusedError
from finback.units import from_si, to_si

_CUT = (to_si(-100.0, "deg"), to_si(100.0, "deg"))


def _region(system: LienardSystem, elevator_deg: float) -> StabilityRegion:
    return stability_region(system, to_si(elevator_deg, "deg"), alpha_range_rad=_CUT)


def _outline(region: StabilityRegion) -> FloatArray:
    """The boundary as one closed curve: along each saddle's two branches, the ends joined where they are cut."""
    curves = []
    for saddle in sorted({branch.saddle_alpha_rad for branch in region.boundary}):
        left, right = (b for b in region.boundary if b.saddle_alpha_rad == saddle)
        points = [np.column_stack([b.alpha_rad, b.alpha_dot_rad_s]) for b in (left, right)]
        curves.append(np.concatenate([points[0][::-1], points[1]]))
    return np.concatenate([curves[0], *(curve[::-1] for curve in curves[1:])])


@pytest.mark.parametrize(("elevator_deg", "area_deg2_s"), [(10.0, 2709.797), (0.0, 9469.046)])
def test_areas_of_the_published_model(printed_system: LienardSystem, elevator_deg: float, area_deg2_s: float) -> None:
    """Taylor integration in 130 bits, within 100 degrees; printed to three decimals."""
    area = from_si(from_si(_region(printed_system, elevator_deg).area_rad2_s, "deg"), "deg")
    assert area == pytest.approx(area_deg2_s, abs=6e-4)


def test_the_branch_of_the_left_saddle_crosses_where_it_was_computed_to(printed_system: LienardSystem) -> None:
    """130 bits: backward, W_s(L)+ at elevator 0 meets alpha = 0 at −59.9321 deg/s, turns, and comes back above."""
    branch = _region(printed_system, 0.0).boundary[1]
    assert branch.side == 1
    meets = np.flatnonzero(np.diff(np.sign(branch.alpha_rad)))
    assert len(meets) == 2
    down, up = (from_si(branch.alpha_dot_rad_s[k : k + 2], "deg_s") for k in meets)
    assert down.min() < -59.9321 < down.max()
    assert (up > 0.0).all()
    first = slice(meets[0] - 3, meets[0] + 5)  # the polyline's own points, joined by a polynomial
    series = np.polynomial.Polynomial.fit(branch.alpha_rad[first], branch.alpha_dot_rad_s[first], 7)
    assert from_si(float(series(0.0)), "deg_s") == pytest.approx(-59.9321, abs=6e-5)


def test_three_regimes_meet_at_the_folds_and_connections(printed_system: LienardSystem) -> None:
    """Both saddles bound the region between the connections, one beyond each."""
    upper, lower = connections(printed_system, (-1.0, 1.0)).heteroclinics
    first, last = sorted(fold.elevator_rad for fold in folds(printed_system))
    near = to_si(1e-6, "deg")
    for elevator, signs in (
        (first + to_si(0.001, "deg"), (1.0,)),
        (upper.elevator_rad - near, (1.0,)),
        (upper.elevator_rad + near, (-1.0, 1.0)),
        (lower.elevator_rad - near, (-1.0, 1.0)),
        (lower.elevator_rad + near, (-1.0,)),
        (last - to_si(0.001, "deg"), (-1.0,)),
    ):
        region = stability_region(printed_system, elevator, alpha_range_rad=_CUT)
        saddles = sorted({branch.saddle_alpha_rad - region.alpha_rad for branch in region.boundary})
        assert tuple(np.sign(saddles)) == signs
        assert len(region.boundary) == 2 * len(signs)


@pytest.mark.parametrize("elevator_deg", [8.0, -10.0, -25.0])
def test_a_grid_map_shows_the_same_region(printed_system: LienardSystem, elevator_deg: float) -> None:
    region = _region(printed_system, elevator_deg)
    alpha, rate = np.meshgrid(np.linspace(-1.7, 1.7, 81), np.linspace(-4.0, 4.0, 81))
    mapped = stability_map(printed_system, region.elevator_rad, alpha, rate)
    inside = Path(_outline(region)).contains_points(np.column_stack([alpha.ravel(), rate.ravel()])).reshape(alpha.shape)
    # Chords of the polyline cut less than a hundredth of a cell off; of 6561 points few are so near the boundary.
    assert ((mapped == 0) != inside).sum() <= 3
    cell = (3.4 / 80) * (8.0 / 80)
    assert (mapped == 0).sum() * cell == pytest.approx(region.area_rad2_s, rel=0.1)
    assert (mapped == 0).any()
    assert (mapped != 0).any()


@pytest.mark.parametrize("elevator_deg", [10.0, -10.0])
def test_the_smallest_disturbance_is_smallest_and_escapes(printed_system: LienardSystem, elevator_deg: float) -> None:
    region = _region(printed_system, elevator_deg)
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ring = region.escape_distance_rad * np.array([np.cos(angle), region.frequency_rad_s * np.sin(angle)])
    within = stability_map(printed_system, region.elevator_rad, region.alpha_rad + 0.9999 * ring[0], 0.9999 * ring[1])
    assert (within == 0).all()
    step = np.array([region.escape_alpha_rad - region.alpha_rad, region.escape_alpha_dot_rad_s])
    scaled = np.hypot(step[0], step[1] / region.frequency_rad_s)
    assert scaled == pytest.approx(region.escape_distance_rad, rel=1e-12)
    beyond = region.alpha_rad + 1.0001 * step[:1]
    assert (stability_map(printed_system, region.elevator_rad, beyond, 1.0001 * step[1:]) != 0).all()


def test_the_boundary_in_pitch_rate_is_the_same_states(paper_model: PolynomialModel) -> None:
    region = analyze_model(paper_model, _options()).regions[1]
    for branch in region.boundary:
        back = paper_model.alpha_dot(branch.alpha_rad, branch.q_rad_s, region.elevator_rad)
        np.testing.assert_allclose(back, branch.alpha_dot_rad_s, rtol=0, atol=1e-13 * np.abs(back).max())
        assert not np.allclose(branch.q_rad_s, branch.alpha_dot_rad_s, rtol=0, atol=1e-3)


def test_boundary_points_stay_on_the_boundary(printed_system: LienardSystem) -> None:
    """Any point of the boundary, moved towards the sink, returns; moved away, it does not."""
    region = _region(printed_system, 5.0)
    branch = region.boundary[1]
    inner = slice(20, 60, 5)  # where the region is wide; the rays meet the boundary once
    points = np.column_stack([branch.alpha_rad[inner], branch.alpha_dot_rad_s[inner]])
    center = np.array([region.alpha_rad, 0.0])
    for share, returns in ((1.0 - 1e-5, True), (1.0 + 1e-5, False)):
        moved = center + share * (points - center)
        mapped = stability_map(printed_system, region.elevator_rad, moved[:, 0], moved[:, 1])
        assert ((mapped == 0) == returns).all()


def _options(cut: tuple[float, float] = _CUT) -> AnalysisOptions:
    low, high, step = (to_si(value, "deg") for value in (-40.0, 20.0, 5.0))
    alpha = (to_si(-34.0, "deg"), to_si(46.0, "deg"))
    return AnalysisOptions(
        elevator_range_rad=(low, high), elevator_step_rad=step, alpha_range_rad=alpha, region_alpha_rad=cut
    )


def test_an_analysis_has_a_region_for_each_regime(paper_model: PolynomialModel) -> None:
    analysis = analyze_model(paper_model, _options())
    assert [len(region.boundary) for region in analysis.regions] == [2, 4, 2]
    assert len(analysis.connections.heteroclinics) == 2
    for region in analysis.regions:
        sinks = [p for p in equilibria(analysis.system, region.elevator_rad) if p.kind.stable]
        assert [p.alpha_rad for p in sinks] == pytest.approx([region.alpha_rad], abs=1e-13)
        assert [p.q_rad_s for p in sinks] == pytest.approx([region.q_rad_s], abs=1e-13)


def test_what_could_not_be_computed_is_said(printed_system: LienardSystem) -> None:
    still = replace(
        printed_system,
        damping=replace(
            printed_system.damping, polynomial=replace(printed_system.damping.polynomial, coefficients=np.zeros(3))
        ),
    )
    analysis = analyze(still, _options())
    assert analysis.regions == ()
    assert any("no equilibrium is stable" in note for note in analysis.notes)


def test_refusals(printed_system: LienardSystem, build_system: Callable[..., LienardSystem]) -> None:
    with pytest.raises(RefusedError, match="no equilibrium is stable"):
        _region(printed_system, 16.0)
    with pytest.raises(RefusedError, match="here are 2"):
        stability_region(build_system((-0.2,), (0.0, 1.0, 0.0, -1.0)), 0.0, alpha_range_rad=(-2.0, 2.0))
    # y' = (x − 0.1) y − x: orbits beyond the line y = −1 … blow up, and neither a saddle nor a cycle says which.
    with pytest.raises(RefusedError, match="no saddle and no cycle"):
        stability_region(build_system((-0.1, 1.0), (0.0, -1.0)), 0.0, alpha_range_rad=(-2.0, 2.0))
    with pytest.raises(RefusedError, match="is empty"):
        stability_region(printed_system, 0.0, alpha_range_rad=(1.0, 1.0))

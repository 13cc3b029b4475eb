"""Estimates beside the exact curves, regions by exact curves, counts, and the diagram of the published aircraft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.diagram.count import counts, exact_region
from finback.dynamics.diagram.cubic import cubic_diagram
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramOptions, PointKind
from finback.dynamics.diagram.system import system_diagram
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.normal_form.cubic_region import CurveSource, Region
from finback.errors import InputError, RefusedError
from finback.units import to_si


@pytest.fixture(scope="module")
def half() -> Diagram:
    return cubic_diagram(Cubic(a1=0.5, b1=0.5, a0=0.0, b0=0.0), (-1.0, -0.2))


def test_estimates_stand_beside_the_exact_curves_and_are_called_so(half: Diagram) -> None:
    estimates = {curve.name: curve for curve in half.curves if not curve.exact}
    assert set(estimates) == {"estimate of homoclinic, strip 0", "estimate of cycle-fold between-saddles, strip 0"}
    loop = estimates["estimate of homoclinic, strip 0"]
    # First order at b0 = -1, in closed form; the loop itself is at 0.0594558236872.
    assert loop.lam[0] == pytest.approx(0.0599376308, rel=0, abs=1e-10)
    assert np.isnan(loop.residual).all()
    exact = half.curve("homoclinic 2 left, strip 0")
    shared = np.isin(loop.mu, exact.mu)
    assert shared.sum() > 3
    assert half.of_kind(CurveKind.HOMOCLINIC) == (exact,)


def test_the_first_order_end_of_the_fold(half: Diagram) -> None:
    """b_d is -0.54665944 to first order and -0.54630081 exactly."""
    neutral = half.points_of_kind(PointKind.NEUTRAL_LOOP)
    assert [point.exact for point in neutral] == [False, True]
    assert neutral[0].mu == pytest.approx(-0.54665944, rel=0, abs=1e-8)
    assert neutral[1].mu == pytest.approx(-0.54630081, rel=0, abs=1e-8)


def test_estimates_follow_the_system_into_other_coordinates() -> None:
    """The same system in other units, and with time reversed."""
    other = cubic_diagram(
        Cubic(a1=0.5, b1=0.5, a0=0.0, b0=0.0).rescaled(2.0, -3.0), (-9.0, -1.8), options=DiagramOptions(nodes=5)
    )
    loop = other.curve("estimate of homoclinic, strip 0")
    assert loop.lam[0] == pytest.approx(-3.0 * 0.0599376308, rel=0, abs=1e-9)
    point = next(point for point in other.points if not point.exact)
    assert point.mu == pytest.approx(9.0 * -0.54665944, rel=0, abs=1e-7)


def test_estimates_of_an_outer_saddle_at_the_origin() -> None:
    """For 0 < b0 < b1²/4 they are those about the middle equilibrium; exact and estimate meet at both ends."""
    found = cubic_diagram(Cubic(a1=-0.2, b1=0.5, a0=0.0, b0=0.0), (0.0, 0.0625), options=DiagramOptions(nodes=5))
    estimate = next(curve for curve in found.curves if curve.name == "estimate of homoclinic, strip 0")
    for curve in found.of_kind(CurveKind.HOMOCLINIC):
        inside = (estimate.mu > curve.mu[1]) & (estimate.mu < curve.mu[-2])
        exact = np.interp(estimate.mu[inside], curve.mu, curve.lam)
        assert np.abs(exact - estimate.lam[inside]).max() < 0.02 * np.ptp(estimate.lam)


def test_estimates_of_two_wells() -> None:
    found = cubic_diagram(Cubic(a1=0.3, b1=0.2, b2=-1.0, a0=0.0, b0=0.0), (0.8, 1.0), options=DiagramOptions(nodes=5))
    ends = {curve.name: curve.lam[-1] for curve in found.curves if not curve.exact}
    assert ends["estimate of large homoclinic, strip 0"] == pytest.approx(0.7700403505, rel=0, abs=1e-10)
    assert ends["estimate of cycle-fold outer, strip 0"] == pytest.approx(0.729698245, rel=0, abs=1e-9)


# regions and counts


@pytest.mark.parametrize(
    ("a0", "region", "stable"),
    [
        (-0.01, Region.V, ()),
        (0.001, Region.III, (True,)),
        (0.0022, Region.II, (True, False)),
        (0.01, Region.I, ()),
    ],
)
def test_regions_by_the_exact_curves(a0: float, region: Region, stable: tuple[bool, ...]) -> None:
    cubic = Cubic(a1=0.5, b1=0.5, a0=a0, b0=-0.35)
    answer = exact_region(cubic)
    assert answer.region is region
    assert answer.source is CurveSource.EXACT
    here = counts(cubic.family(), -0.35, a0)
    assert here.around(1) == stable == region.cycles
    assert here.equilibria[1].stable == region.origin_stable
    assert here.total == len(stable)


def test_region_four_lies_between_the_loop_and_the_hopf_point() -> None:
    cubic = Cubic(a1=0.5, b1=0.5, a0=-0.002, b0=-0.1)
    assert exact_region(cubic).region is Region.IV
    assert counts(cubic.family(), -0.1, -0.002).around(1) == (False,)


def test_regions_of_another_normal_form_are_refused() -> None:
    with pytest.raises(RefusedError, match="b2 = 1"):
        exact_region(Cubic(a1=0.5, b1=0.5, a0=0.0, b0=1.0, b2=-1.0))


@pytest.mark.parametrize(
    ("a0", "wells"),
    [
        (0.6, (0, 0, 0)),
        (0.73, (0, 1, 0)),
        (0.765, (0, 1, 2)),
        (0.8, (0, 1, 1)),
        (0.89, (0, 0, 1)),
        (0.95, (1, 0, 1)),
        (1.2, (0, 0, 1)),
    ],
)
def test_counts_in_two_wells(a0: float, wells: tuple[int, int, int]) -> None:
    """Reference: [left, right, outer] between the special values of a0 at (0.3, 0.2, 1), on a grid of sections."""
    here = counts(Cubic(a1=0.3, b1=0.2, b2=-1.0, a0=0.0, b0=0.0).family(), 1.0, a0)
    assert here.wells == wells
    assert here.around(0, 1, 2) in ((), (True,), (False, True))  # the smaller of a pair is unstable
    assert not any(here.around(0)) and not any(here.around(2))  # noqa: PT018 - one statement: both are unstable


# the published aircraft


def test_the_plane_of_the_paper(printed_system: LienardSystem) -> None:
    """Shi & Fan 2013, Fig. 6: folds, a0(δ) far below everything; the numbers from exact rational arithmetic."""
    found = system_diagram(printed_system, options=DiagramOptions(nodes=7))
    lines = sorted(curve.elevator_rad[0] for curve in found.curves if curve.kind.is_line)
    assert lines == pytest.approx([to_si(-35.1293238979, "deg"), to_si(14.7252153801, "deg")], abs=1e-11)
    (own,) = found.own
    assert own.trace_1_s[[0, -1]] == pytest.approx([-0.44684986, -0.56555687], abs=1e-8)
    assert own.trace_1_s.min() == pytest.approx(-1.25977454, abs=1e-2)
    assert (own.trace_1_s < 0.0).all()
    hopf = next(curve for curve in found.curves if curve.kind is CurveKind.HOPF)
    assert np.abs(hopf.trace_1_s).max() < 1e-12
    assert found.trace_shift_range_1_s[0] <= 0.0 <= found.trace_shift_range_1_s[1]
    # Were its trace free, the loop at no elevator would need the trace -0.2415671 (130-bit Taylor series).
    at_zero = system_diagram(printed_system, (to_si(-1.0, "deg"), 0.0), options=DiagramOptions(nodes=5))
    loop = next(curve for curve in at_zero.curves if curve.kind is CurveKind.HOMOCLINIC)
    assert loop.trace_1_s[-1] == pytest.approx(-0.2415671, abs=1e-7)
    assert not [curve for curve in found.curves if curve.kind is CurveKind.CYCLE_FOLD]


def test_points_in_physical_units(printed_system: LienardSystem) -> None:
    found = system_diagram(printed_system, options=DiagramOptions(nodes=5))
    for point, plain in zip(found.points, found.plain.points, strict=True):
        assert (point.name, point.elevator_rad, point.exact) == (plain.name, plain.mu, plain.exact)
        if point.kind is PointKind.BOGDANOV_TAKENS:
            assert float(printed_system.damping(point.alpha_rad)) + point.trace_shift_1_s == pytest.approx(
                0.0, abs=1e-12
            )
            held = float(printed_system.force(point.alpha_rad)) + printed_system.elevator_gain * point.elevator_rad
            assert held == pytest.approx(0.0, abs=1e-12)


def test_a_system_without_an_effect_of_the_elevator_is_refused(printed_system: LienardSystem) -> None:
    with pytest.raises(InputError, match="no effect"):
        system_diagram(replace(printed_system, elevator_gain=0.0))

"""Two-parameter diagrams: reference values, names of ends, symmetric cases, scaling, reversal of time, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.dynamics.diagram.cell import lines
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramCurve, DiagramOptions, PointKind
from finback.dynamics.diagram.diagram import diagram, natural_mu_range
from finback.dynamics.family import Family
from finback.dynamics.normal_form.bogdanov_takens import Unfolding
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import InputError, RefusedError

# References are printed to 10 to 13 decimals; twice half of the last digit.
TEN_DIGITS = 1e-10
TWELVE_DIGITS = 1e-12
# Ends of a strip are found by brentq to 1e-15 of its width, and λ by shooting to 1e-15 of the rate.
LOCATED = 1e-12
FEW = DiagramOptions(nodes=5)


def _family(a1: float, b1: float, b2: float = 1.0) -> Family:
    return Cubic(a1=a1, b1=b1, b2=b2, a0=0.0, b0=0.0).family()


def _only(found: Diagram, kind: CurveKind) -> DiagramCurve:
    (curve,) = found.of_kind(kind)
    return curve


@pytest.fixture(scope="module")
def half() -> Diagram:
    """The paper's kind of diagram: a1 = b1 = 1/2, where all five regions are."""
    return diagram(_family(0.5, 0.5), (-1.0, -0.01))


def test_the_special_points_of_a_published_kind_of_diagram(half: Diagram) -> None:
    """Reference: closed form for the Bautin point; 130-bit Taylor series for the neutral loop."""
    (bautin,) = half.points_of_kind(PointKind.BAUTIN)
    assert (bautin.mu, bautin.lam, bautin.x) == (pytest.approx(-0.25, rel=LOCATED), 0.0, 0.0)
    (neutral,) = half.points_of_kind(PointKind.NEUTRAL_LOOP)
    assert neutral.mu == pytest.approx(-0.5463008119455, rel=0, abs=TWELVE_DIGITS)
    assert neutral.lam == pytest.approx(0.0160439235135, rel=0, abs=TWELVE_DIGITS)
    (crossing,) = half.points_of_kind(PointKind.CROSSING)
    assert neutral.mu < crossing.mu < bautin.mu  # b_d < b_x < −a1 b1
    assert crossing.lam == pytest.approx(0.0, abs=LOCATED)
    for point in half.points:
        assert point.bracket[0] <= point.mu <= point.bracket[1]
        assert np.ptp(point.bracket) < LOCATED
        assert abs(point.residual) < LOCATED
        assert point.exact
        assert point.resolved


def test_curves_end_at_points_that_have_names(half: Diagram) -> None:
    fold = _only(half, CurveKind.CYCLE_FOLD)
    assert fold.ends == ("neutral-loop 1", "bautin 1")
    for index, name in ((0, "neutral-loop 1"), (-1, "bautin 1")):
        (point,) = (point for point in half.points if point.name == name)
        assert (fold.mu[index], fold.lam[index]) == (point.mu, point.lam)
        assert fold.name in point.curves
    assert _only(half, CurveKind.HOPF).ends == ("range", "range")
    assert half.notes == ()


def test_the_flat_end_of_the_fold_is_flagged_and_nothing_else_is(half: Diagram) -> None:
    """The gap to the loop falls below 1e-8 near b0 = -0.51 and below rounding near -0.53: λ holds, the flag falls."""
    fold = _only(half, CurveKind.CYCLE_FOLD)
    assert fold.resolved[fold.mu > -0.49].all()
    assert not fold.resolved[fold.mu < -0.53].any()
    assert (fold.mu < -0.53).sum() >= 4  # it is followed into the flat end
    for curve in half.curves:
        assert curve is fold or curve.resolved.all()
        assert curve.exact


def test_how_many_cycles_are_born_on_each_curve(half: Diagram) -> None:
    hopf, loop, fold = (_only(half, kind) for kind in (CurveKind.HOPF, CurveKind.HOMOCLINIC, CurveKind.CYCLE_FOLD))
    # Supercritical for b0 < −a1 b1; a loop is stable from inside where the trace of its saddle is negative.
    np.testing.assert_array_equal(hopf.change[hopf.mu < -0.26], [[1, 0]] * int((hopf.mu < -0.26).sum()))
    np.testing.assert_array_equal(hopf.change[hopf.mu > -0.24], [[0, -1]] * int((hopf.mu > -0.24).sum()))
    np.testing.assert_array_equal(loop.change[loop.mu < -0.55], [[-1, 0]] * int((loop.mu < -0.55).sum()))
    np.testing.assert_array_equal(loop.change[loop.mu > -0.54], [[0, 1]] * int((loop.mu > -0.54).sum()))
    np.testing.assert_array_equal(fold.change, [[-1, -1]] * fold.mu.size)
    assert hopf.enclosed == loop.enclosed == fold.enclosed == (1,)


@pytest.mark.parametrize(
    ("low", "high", "at_low", "at_high"),
    [(-0.5, -0.1, 0.0123387537, -0.0062445674), (-2.0, -1.0, 0.1783210866, 0.0594558236872)],
)
def test_homoclinic_values(low: float, high: float, at_low: float, at_high: float) -> None:
    """Reference: 80-bit Taylor shooting, cross-checked by another program's orthogonal collocation."""
    loop = _only(diagram(_family(0.5, 0.5), (low, high)), CurveKind.HOMOCLINIC)
    assert loop.lam[0] == pytest.approx(at_low, rel=0, abs=TEN_DIGITS)
    assert loop.lam[-1] == pytest.approx(at_high, rel=0, abs=TEN_DIGITS)


def test_fold_of_cycles_values() -> None:
    """Reference: a continuation of folds of cycles; b0 has six decimals, and a0 falls by 0.07 per unit of b0."""
    fold = _only(diagram(_family(0.5, 0.5), (-0.472226, -0.383335)), CurveKind.CYCLE_FOLD)
    rounding = 0.5e-6 * 0.07 + 0.5e-8
    assert fold.lam[0] == pytest.approx(0.01021202, rel=0, abs=rounding)
    assert fold.lam[-1] == pytest.approx(0.00424373, rel=0, abs=rounding)
    assert fold.ends == ("range", "range")


def test_bogdanov_takens() -> None:
    """Reference: 130-bit Taylor series; the curves start together, the loop at 5/7 of the Hopf point's distance."""
    found = diagram(Unfolding(mu1=0.0, mu2=0.0).family(), (-0.1, 0.05))
    (point,) = found.points
    assert (point.kind, point.mu, point.lam) == (PointKind.BOGDANOV_TAKENS, 0.0, 0.0)
    hopf, loop = _only(found, CurveKind.HOPF), _only(found, CurveKind.HOMOCLINIC)
    np.testing.assert_allclose(hopf.lam, np.sqrt(-hopf.mu), rtol=1e-9)
    assert loop.lam[0] == pytest.approx(0.2288528176297, rel=1e-10)
    assert hopf.ends == loop.ends == ("range", "bogdanov-takens 1")
    near = loop.mu[-2]
    assert loop.lam[-2] / math.sqrt(-near) == pytest.approx(5.0 / 7.0, abs=2.0 * 72.0 / 2401.0 * math.sqrt(-near))
    assert not found.of_kind(CurveKind.CYCLE_FOLD)
    (line,) = found.of_kind(CurveKind.FOLD)
    assert line.name in point.curves
    assert [len(cell.saddles) for cell in found.cells] == [2, 0]


def test_where_the_loop_crosses_a_round_value() -> None:
    """Reference: m1 of the loop at m2 = 1/2, by a homotopy of another program: its eleven digits fix λ to 1e-11."""
    found = diagram(Unfolding(mu1=0.0, mu2=0.0).family(), (-0.46360219842, -0.2))
    assert _only(found, CurveKind.HOMOCLINIC).lam[0] == pytest.approx(0.5, rel=0, abs=2e-11)


def test_a_diagram_through_all_kinds_of_lines() -> None:
    """For b0 above 0 the origin is an outer saddle; the paper leaves that out."""
    found = diagram(_family(0.5, 0.5), (-0.3, 0.2))
    assert [curve.mu[0] for curve in found.of_kind(CurveKind.TRANSCRITICAL)] == [0.0]
    assert [curve.mu[0] for curve in found.of_kind(CurveKind.FOLD)] == [0.0625]
    assert [point.lam for point in found.points_of_kind(PointKind.BOGDANOV_TAKENS)] == [0.0, 0.1875]
    assert len(found.points_of_kind(PointKind.BAUTIN)) == 2
    # Between them the loop changes its saddle: at one point both saddles are connected both ways.
    (corner,) = found.points_of_kind(PointKind.TWO_SADDLE_CYCLE)
    ends = {curve.name: curve.ends for curve in found.of_kind(CurveKind.HOMOCLINIC)}
    assert ends["homoclinic 2 left, strip 1"] == ("bogdanov-takens 1", corner.name)
    assert ends["homoclinic 0 right, strip 1"] == (corner.name, "bogdanov-takens 2")
    assert not any("unresolved" in curve.ends for curve in found.curves)


def test_a_two_saddle_cycle_for_all_parameters() -> None:
    """a1 = b1 = 0: reference at b0 = -1/4: 130-bit Taylor series."""
    found = diagram(_family(0.0, 0.0), (-0.25, 0.1))
    cycle = _only(found, CurveKind.SADDLE_CYCLE)
    assert cycle.lam[0] == pytest.approx(0.0500753647784, rel=0, abs=TWELVE_DIGITS)
    assert cycle.enclosed == (1,)
    np.testing.assert_array_equal(cycle.change, [[-1, 0]] * cycle.mu.size)
    assert not found.of_kind(CurveKind.HOMOCLINIC)
    assert _only(found, CurveKind.PITCHFORK).mu[0] == 0.0
    assert cycle.ends == ("range", "bogdanov-takens 1")


def test_a_figure_eight_for_all_parameters() -> None:
    """a1 = b1 = 0, b2 = −1: reference at b0 = 1: 130-bit Taylor series."""
    found = diagram(_family(0.0, 0.0, -1.0), (0.4, 1.0), options=FEW)
    eight, fold = _only(found, CurveKind.SADDLE_CYCLE), _only(found, CurveKind.CYCLE_FOLD)
    assert eight.lam[-1] == pytest.approx(0.813793663107, rel=0, abs=TWELVE_DIGITS)
    assert fold.lam[-1] == pytest.approx(0.771215070536, rel=0, abs=TWELVE_DIGITS)
    assert eight.enclosed == fold.enclosed == (0, 1, 2)
    assert [curve.enclosed for curve in found.of_kind(CurveKind.HOMOCLINIC)] == [(0,), (2,)]


def test_two_wells() -> None:
    """Reference at (a1, b1, b0) = (0.3, 0.2, 1), b2 = −1: 130-bit Taylor series."""
    found = diagram(_family(0.3, 0.2, -1.0), (0.5, 1.0), options=FEW)
    at_one = {curve.name: curve.lam[-1] for curve in found.curves}
    expected = {
        "hopf 0, strip 0": 1.090498756,
        "hopf 2, strip 0": 0.889501244,
        "homoclinic 1 left, strip 0": 0.900526573169,
        "homoclinic 1 right, strip 0": 0.708497480248,
        "large homoclinic 1 right, strip 0": 0.769240611445,
        "cycle-fold around 0-2, strip 0": 0.761455282401,
    }
    assert at_one.keys() == expected.keys()
    for name, value in expected.items():
        assert at_one[name] == pytest.approx(value, rel=0, abs=1e-9 if "hopf" in name else TWELVE_DIGITS)


def test_the_two_saddle_cycle_off_b1_zero() -> None:
    """Where the paper says b1 = 0, it is at b1 = -0.0111561592 for (a1, b0) = (0.3, -0.49); ten digits are printed."""
    found = diagram(_family(0.3, -0.0111561592), (-0.6, -0.4))
    (corner,) = found.points_of_kind(PointKind.TWO_SADDLE_CYCLE)
    assert corner.mu == pytest.approx(-0.49, rel=0, abs=1e-8)  # b0 moves by 88 per unit of b1
    assert corner.lam == pytest.approx(0.0972788168, rel=0, abs=1e-8)
    # At b1 = 0 itself the two halves are apart, and the loop is homoclinic.
    apart = diagram(_family(0.3, 0.0), (-0.49, -0.4))
    upper, lower = apart.of_kind(CurveKind.HETEROCLINIC)
    assert (upper.lam[0], lower.lam[0]) == pytest.approx((0.0899484180, 0.1062696062), rel=0, abs=TEN_DIGITS)
    assert len(apart.of_kind(CurveKind.HOMOCLINIC)) == 1


def test_cycles_that_no_abelian_integral_sees() -> None:
    """a1 b1 = 0 allows no double cycle to first order; at a1 = 3/2, b1 = 0, b0 = -1 there is one, 2.7e-6 from a0."""
    fold = _only(diagram(_family(1.5, 0.0), (-1.2, -1.0)), CurveKind.CYCLE_FOLD)
    assert fold.lam[-1] == pytest.approx(0.11994, abs=1e-5)


def test_a_loop_that_ends_at_a_saddle_node() -> None:
    """b2 = −1: a saddle and a well meet on the orbit; where, is extrapolated, and said to be so."""
    found = diagram(_family(0.3, 0.2, -1.0), (-0.01, -0.006), options=FEW)
    ends = found.points_of_kind(PointKind.SADDLE_NODE_LOOP)
    assert ends
    for point in ends:
        assert point.mu == pytest.approx(-0.01)
        assert not point.exact
        assert not point.resolved
        assert abs(point.residual) < 1e-3


def _told(found: Diagram) -> dict[str, list[float]]:
    """Return what a diagram says, without the places at which its curves happen to be sampled."""
    said = {curve.name: [*curve.mu[[0, -1]], *curve.lam[[0, -1]]] for curve in found.curves if not curve.kind.is_line}
    return said | {point.name: [point.mu, point.lam] for point in found.points}


@settings(max_examples=2, deadline=None, derandomize=True)
@given(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))
def test_rescaling_commutes_with_the_diagram(length_power: float, time_power: float) -> None:
    cubic = Cubic(a1=0.5, b1=0.5, a0=0.0, b0=0.0)
    length, time = 10.0**length_power, 10.0**time_power
    plain = _told(diagram(cubic.family(), (-0.6, -0.2), options=FEW))
    scaled = _told(diagram(cubic.rescaled(length, time).family(), (-0.6 * time**2, -0.2 * time**2), options=FEW))
    assert plain.keys() == scaled.keys()
    for name, values in plain.items():
        units = [time**2] * (len(values) // 2) + [time] * (len(values) // 2)
        np.testing.assert_allclose(np.array(scaled[name]) / units, values, rtol=1e-9, atol=1e-12)


def test_reversal_of_time_commutes_with_the_diagram() -> None:
    """λ changes its sign; stable and unstable change places, and so do birth and death."""
    plain = diagram(_family(0.5, 0.5), (-0.6, -0.2), options=FEW)
    reverse = diagram(Cubic(a1=0.5, b1=0.5, a0=0.0, b0=0.0).reversed().family(), (-0.6, -0.2), options=FEW)
    for kind in (CurveKind.HOPF, CurveKind.HOMOCLINIC, CurveKind.CYCLE_FOLD):
        one, other = _only(plain, kind), _only(reverse, kind)
        np.testing.assert_allclose(other.lam[[0, -1]], -one.lam[[0, -1]], atol=LOCATED)
        np.testing.assert_array_equal(other.change[1], -one.change[1, ::-1])
    for one, other in zip(plain.points, reverse.points, strict=True):
        assert (one.kind, one.mu, one.lam) == (
            other.kind,
            pytest.approx(other.mu, abs=LOCATED),
            pytest.approx(-other.lam, abs=LOCATED),
        )


def test_the_mirror_image_has_the_same_points() -> None:
    plain, mirror = (diagram(_family(a, a), (-0.6, -0.2), options=FEW) for a in (0.5, -0.5))
    for one, other in zip(plain.points, mirror.points, strict=True):
        assert (one.mu, one.lam, one.x) == pytest.approx((other.mu, other.lam, -other.x), abs=LOCATED)
    assert "homoclinic 0 right, strip 0" in {curve.name for curve in mirror.curves}


def test_curves_are_smooth_enough_to_draw(half: Diagram) -> None:
    for curve in half.curves:
        chord = np.interp(
            curve.mu[1:-1], curve.mu[[0, *range(2, curve.mu.size, 2)]], curve.lam[[0, *range(2, curve.mu.size, 2)]]
        )
        assert np.abs(curve.lam[1:-1] - chord).max() < 0.02 * max(np.ptp(half.lam_range), np.ptp(curve.lam))


def test_lines_of_any_family() -> None:
    """The cubic's two, in closed form; an equilibrium from infinity where μ multiplies the highest power."""
    found = lines(_family(0.3, 0.2, -1.0))
    assert [(line.kind, line.x) for line in found] == [
        (CurveKind.FOLD, pytest.approx(0.1)),
        (CurveKind.TRANSCRITICAL, 0),
    ]
    assert found[0].mu == pytest.approx(-0.01)
    far = lines(Family(damping=(0.0, 1.0), force=(-1.0, 1.0), direction=(0.0, 0.0, 1.0)))
    # −1 + x + μ x² has a double root where 1 + 4 μ = 0, and a root from infinity at μ = 0.
    assert [(line.kind, line.mu) for line in far] == [(CurveKind.FOLD, pytest.approx(-0.25)), (CurveKind.INFINITY, 0.0)]


def test_the_natural_range_holds_all_closed_forms() -> None:
    low, high = natural_mu_range(_family(0.5, 0.5))
    assert low < -0.25
    assert high > 0.0625


def test_the_window_may_be_given() -> None:
    found = diagram(_family(0.5, 0.5), (-0.3, 0.1), lam_range=(-1.0, 2.0), options=FEW)
    assert found.lam_range.tolist() == [-1.0, 2.0]
    assert {curve.lam[0] for curve in found.curves if curve.kind.is_line} == {-1.0}


@pytest.mark.parametrize("span", [(0.0, 0.0), (1.0, -1.0), (-math.inf, 0.0), (math.nan, 1.0)])
def test_ranges_that_are_none_are_refused(span: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="no range"):
        diagram(_family(0.5, 0.5), span)
    with pytest.raises(InputError, match="no range"):
        diagram(_family(0.5, 0.5), (-1.0, 0.0), lam_range=span)


def test_options_and_names_that_make_no_sense_are_refused(half: Diagram) -> None:
    for wrong in ({"nodes": 2}, {"smoothness": 0.0}, {"most_turns": 1}):
        with pytest.raises(InputError, match="make no diagram"):
            DiagramOptions(**wrong)  # type: ignore[arg-type] - one of three names
    with pytest.raises(InputError, match="no curve is named"):
        half.curve("homoclinic")
    with pytest.raises(RefusedError, match="mu has no effect"):
        diagram(Family(damping=(0.0, 1.0), force=(0.0, 1.0), direction=(0.0,)), (-1.0, 1.0))

"""Trajectories beside a reference, against answers known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.errors import InputError, RefusedError
from finback.validation.compare import Bound, MappedChannel, Measure, Resampling, Trajectory, compare
from finback.validation.metric import Judgement

ROUNDING = 1e-12
"""Of numbers of size 1 after a few operations."""


def _ours(step_s: float = 0.01, end_s: float = 10.0) -> Trajectory:
    time = np.arange(round(end_s / step_s) + 1) * step_s
    return Trajectory(
        name="ours", time_s=time, columns={"alpha_rad": np.sin(time), "psi_rad": np.angle(np.exp(1j * time))}
    )


def _theirs(time: np.ndarray, **columns: np.ndarray) -> Trajectory:
    return Trajectory(name="theirs", time_s=time, columns=columns)


def test_worst_rmse_and_theil_of_a_known_difference() -> None:
    ours = _ours()
    reference = _theirs(ours.time_s, a=np.degrees(np.sin(ours.time_s)) + np.where(ours.time_s == 4.0, 3.0, 1.0))
    found = compare(ours, reference, [MappedChannel(name="alpha_rad", reference="a", unit="deg")]).channels[0]
    size = ours.time_s.size
    assert found.worst == pytest.approx(math.radians(3.0), abs=ROUNDING)
    assert found.worst_time_s == 4.0
    assert found.rmse == pytest.approx(math.radians(math.sqrt((size - 1 + 9) / size)), abs=ROUNDING)
    shares = (found.theil.bias, found.theil.variance, found.theil.covariance)
    assert sum(shares) == pytest.approx(1.0, abs=1e-9)
    assert found.interpolated == 0


@given(st.floats(0.003, 0.05), st.floats(0.0, 0.02))
def test_smooth_motion_is_resampled_to_fourth_order(step_s: float, start_s: float) -> None:
    ours = _ours(step_s=0.02)
    time = np.arange(start_s, 9.9, step_s)
    reference = _theirs(time, a=np.sin(time))
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad")
    assert compare(ours, reference, [channel]).channels[0].worst <= 5e-8  # h⁴ of 0.02 s, with the constant at the ends


def test_a_held_signal_is_held_and_a_straight_one_straight() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    ours = Trajectory(name="ours", time_s=time, columns={"elevator_rad": np.array([0.0, 1.0, 0.0, 0.0])})
    between = np.array([0.5, 1.5, 2.5])
    for resampling, values in ((Resampling.PREVIOUS, [0.0, 1.0, 0.0]), (Resampling.LINEAR, [0.5, 0.5, 0.0])):
        channel = MappedChannel(name="elevator_rad", reference="e", unit="rad", resampling=resampling)
        found = compare(ours, _theirs(between, e=np.array(values)), [channel]).channels[0]
        assert found.worst == 0.0
        assert found.interpolated == 3


@given(st.floats(-20.0, 20.0))
def test_an_angle_differs_around_the_circle(offset_deg: float) -> None:
    ours = _ours()
    wrapped = np.mod(np.degrees(ours.time_s) + offset_deg, 360.0)
    channel = MappedChannel(name="psi_rad", reference="h", unit="deg", angular=True)
    found = compare(ours, _theirs(ours.time_s, h=wrapped), [channel]).channels[0]
    np.testing.assert_allclose(found.difference, -math.radians(offset_deg), atol=1e-11)


def test_factor_and_offset_turn_the_reference_into_ours() -> None:
    ours = _ours()
    channel = MappedChannel(name="alpha_rad", reference="a", unit="deg", factor=-2.0, offset=5.0)
    theirs = _theirs(ours.time_s, a=(np.degrees(np.sin(ours.time_s)) - 5.0) / -2.0)
    assert compare(ours, theirs, [channel]).channels[0].worst <= ROUNDING


@pytest.mark.parametrize(("value", "judgement"), [(1.1e-3, Judgement.AGREES), (0.9e-3, Judgement.DISAGREES)])
def test_a_bound_holds_or_not(value: float, judgement: Judgement) -> None:
    ours = _ours()
    bound = Bound(measure=Measure.WORST, value=value, source="this test")
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad", bounds=(bound,))
    assert compare(ours, _theirs(ours.time_s, a=np.sin(ours.time_s) + 1e-3), [channel]).verdict is judgement


def test_rows_without_a_number_are_left_out_and_counted() -> None:
    ours = _ours()
    values = np.sin(ours.time_s)
    values[[3, 7, 500]] = math.nan
    found = compare(ours, _theirs(ours.time_s, a=values), [MappedChannel(name="alpha_rad", reference="a", unit="rad")])
    assert found.channels[0].missing == 3
    assert found.channels[0].worst == 0.0


def test_ours_that_is_not_finite_agrees_with_nothing() -> None:
    time = np.arange(5.0)
    ours = Trajectory(name="ours", time_s=time, columns={"alpha_rad": np.array([0.0, 0.0, math.nan, 0.0, 0.0])})
    bound = Bound(measure=Measure.RMSE, value=1e9, source="this test")
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad", bounds=(bound,))
    found = compare(ours, _theirs(time, a=np.zeros(5)), [channel])
    assert found.channels[0].worst == math.inf
    assert found.channels[0].worst_time_s == 2.0
    assert found.verdict is Judgement.DISAGREES


def test_how_much_of_ours_is_no_number_is_said() -> None:
    ours = _ours()
    alpha = np.array(ours.columns["alpha_rad"])
    alpha[300:] = np.nan
    broken = Trajectory(name="broken", time_s=ours.time_s, columns={"alpha_rad": alpha})
    theirs = _theirs(ours.time_s, a=np.array(ours.columns["alpha_rad"]))
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad")
    [whole] = compare(ours, theirs, (channel,)).channels
    [found] = compare(broken, theirs, (channel,)).channels
    assert whole.suspicion == ""
    assert (
        found.suspicion
        == f"{alpha.size - 300} of our {alpha.size} values there are no finite numbers (NaN), from 3 s on"
    )


def test_only_the_common_time_is_compared() -> None:
    ours = _ours(end_s=2.0)
    time = np.linspace(1.0, 5.0, 401)
    found = compare(ours, _theirs(time, a=np.sin(time)), [MappedChannel(name="alpha_rad", reference="a", unit="rad")])
    assert (found.start_s, found.end_s) == (1.0, 2.0)
    assert found.uncovered_s == pytest.approx(3.0)
    with pytest.raises(RefusedError, match="nothing in common"):
        compare(ours, _theirs(time + 5.0, a=time), [MappedChannel(name="alpha_rad", reference="a", unit="rad")])


def test_a_flight_that_ends_early_cannot_agree() -> None:
    """Within its tolerance as far as it goes, it is inconclusive; in a window that it covers, it agrees."""
    ours = _ours(end_s=2.0)
    time = np.linspace(0.0, 30.0, 3001)
    bound = Bound(measure=Measure.WORST, value=1e-3, source="this test")
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad", bounds=(bound,))
    reference = _theirs(time, a=np.sin(time))
    assert compare(ours, reference, [channel]).verdict is Judgement.INCONCLUSIVE
    assert compare(ours, reference, [channel], window_s=(0.0, 2.0)).verdict is Judgement.AGREES
    assert compare(ours, _theirs(time, a=np.sin(time) + 0.1), [channel]).verdict is Judgement.DISAGREES


def test_a_mostly_empty_column_cannot_agree() -> None:
    ours = _ours()
    values = np.where(np.arange(ours.time_s.size) < 3, np.sin(ours.time_s), math.nan)
    bound = Bound(measure=Measure.WORST, value=1e-3, source="this test")
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad", bounds=(bound,))
    assert compare(ours, _theirs(ours.time_s, a=values), [channel]).verdict is Judgement.INCONCLUSIVE


def test_all_missing_names_at_once() -> None:
    ours = _ours()
    channels = [
        MappedChannel(name="beta_rad", reference="a", unit="rad"),
        MappedChannel(name="alpha_rad", reference="b", unit="rad"),
    ]
    with pytest.raises(InputError, match=r"'ours' has no 'beta_rad' \(but .*\); 'theirs' has no 'b'"):
        compare(ours, _theirs(ours.time_s, a=ours.time_s), channels)


def test_time_must_increase() -> None:
    with pytest.raises(InputError, match=r"from row 2 \(1 s\) to row 3 \(1 s\)"):
        Trajectory(name="it", time_s=np.array([0.0, 1.0, 1.0]), columns={})


def test_nothing_may_differ_where_the_tolerance_is_zero() -> None:
    ours = _ours()
    bound = Bound(measure=Measure.WORST, value=0.0, source="the same bits")
    channel = MappedChannel(name="alpha_rad", reference="a", unit="rad", bounds=(bound,))
    assert compare(ours, _theirs(ours.time_s, a=np.sin(ours.time_s)), [channel]).verdict is Judgement.AGREES
    beside = np.nextafter(np.sin(ours.time_s), 2.0)
    assert compare(ours, _theirs(ours.time_s, a=beside), [channel]).verdict is Judgement.DISAGREES


@pytest.mark.parametrize(("value", "judgement"), [(0.0, Judgement.AGREES), (1e-9, Judgement.DISAGREES)])
def test_nothing_is_small_beside_a_reference_of_zero(value: float, judgement: Judgement) -> None:
    time = np.arange(3.0)
    ours = Trajectory(name="ours", time_s=time, columns={"beta_rad": np.full(3, value)})
    bound = Bound(measure=Measure.RELATIVE, value=0.5, source="this test")
    channel = MappedChannel(name="beta_rad", reference="b", unit="rad", bounds=(bound,))
    assert compare(ours, _theirs(time, b=np.zeros(3)), [channel]).verdict is judgement


def test_a_hole_in_an_angle_spoils_no_other_sample() -> None:
    time = np.arange(5.0)
    ours = Trajectory(name="ours", time_s=time, columns={"psi_rad": np.array([3.0, math.nan, -3.0, -2.9, -2.8])})
    channel = MappedChannel(name="psi_rad", reference="h", unit="rad", angular=True)
    found = compare(ours, _theirs(time, h=np.array([3.0, 0.0, 2 * np.pi - 3.0, -2.9, -2.8])), [channel]).channels[0]
    np.testing.assert_allclose(found.difference[[0, 2, 3, 4]], 0.0, atol=ROUNDING)
    assert math.isnan(found.difference[1])


@pytest.mark.parametrize(
    ("unit", "factor", "said"),
    [
        ("m", 1 / 0.3048, "in 'ft'"),
        ("ft", 1.0, "in 'm'"),
        ("m", -1.0, "with the other sign"),
        ("m", 1.7, ""),
        ("m", 1.0, ""),
    ],
)
def test_a_wrong_unit_is_suspected(unit: str, factor: float, said: str) -> None:
    time = np.arange(50) / 10
    height = 3000.0 - 5.0 * time**2
    ours = Trajectory(name="ours", time_s=time, columns={"altitude_m": height})
    channel = MappedChannel(name="altitude_m", reference="h", unit=unit)
    found = compare(ours, _theirs(time, h=height * factor), [channel]).channels[0].suspicion
    assert said in found
    assert bool(found) == bool(said)

"""Lift that is made by a formula along a prescribed angle of attack: what lags is hysteresis, what does not is none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from finback.arrays import FloatArray
from finback.identification.identify import identify
from finback.identification.options import IdentificationOptions
from finback.identification.suspicions.finding import Suspect
from finback.identification.suspicions.lift import lift_hysteresis
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si

INTERVAL_S, SPEED, GRAVITY = 0.02, 90.0, 9.81
PULL = 60.0  # m/s² of lift for a rad of alpha, attached
DAMPING = 0.3  # m/s² for each rad/s of q: CL of q c / 2V near 5
STALL = (to_si(14.0, "deg"), to_si(1.0, "deg"))


def _record(
    seed: int,
    *,
    lag_s: float = 0.0,
    alpha_noise_deg: float = 0.1,
    damping: float = DAMPING,
    downwash: float = 0.0,
    further_rad: FloatArray | float = 0.0,
) -> FlightRecord:
    """Pull slowly through the stall and back twice, pumping; the flow separates with a lag."""
    random = np.random.default_rng(seed)
    time = INTERVAL_S * np.arange(round(60.0 / INTERVAL_S))
    slow = np.interp(time, [0, 10, 22, 30, 42, 52, 60], [5.0, 5.0, 17.0, 10.0, 18.0, 5.0, 5.0])
    alpha = (
        to_si(slow + 1.0 * np.sin(2.0 * np.pi * 0.4 * time) + 0.5 * np.sin(2.0 * np.pi * 0.13 * time), "deg")
        + further_rad
    )
    rate = np.gradient(alpha, INTERVAL_S)
    speed = SPEED * (1.0 - 0.15 * np.sin(np.pi * time / 60.0))
    pressure = (speed / SPEED) ** 2
    lift = _lift(alpha, lag_s) * pressure + downwash * rate
    # dα/dt = q - lift/V + g/V, with the part of the lift that q makes.
    q = (rate + (lift - GRAVITY) / speed) / (1.0 - damping / speed)
    lift = lift + damping * q
    noise = random.standard_normal((3, time.size))
    return FlightRecord(
        name=f"stall {seed}",
        columns={
            "time_s": time,
            "alpha_rad": alpha + to_si(alpha_noise_deg, "deg") * noise[0],
            "q_rad_s": q + to_si(0.1, "deg") * noise[1],
            "elevator_rad": -0.5 * alpha + to_si(1.0, "deg") * np.sin(2.0 * np.pi * 0.4 * time + 1.0),
            "airspeed_m_s": speed,
            "az_m_s2": -lift + 0.1 * noise[2] + 0.2,
        },
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=SPEED, density_kg_m3=1.0, gravity_m_s2=GRAVITY, altitude_m=2000.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=Hold.FOH,
    )


def _lift(alpha: FloatArray, lag_s: float) -> FloatArray:
    """Return the lift of Kirchhoff's flow: the separation point goes to its place with a time constant."""
    place = 1.0 / (1.0 + np.exp((alpha - STALL[0]) / STALL[1]))
    if lag_s > 0.0:
        stays = np.exp(-INTERVAL_S / lag_s)
        place = lfilter([1.0 - stays], [1.0, -stays], place, zi=np.array([stays * place[0]]))[0]
    return np.asarray(PULL * alpha * ((1.0 + np.sqrt(np.maximum(place, 0.0))) / 2.0) ** 2)


@pytest.mark.parametrize("alpha_noise_deg", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_a_stall_without_lag_is_no_hysteresis(seed: int, alpha_noise_deg: float) -> None:
    (found,) = lift_hysteresis([_record(seed, alpha_noise_deg=alpha_noise_deg)])
    assert found.suspect is Suspect.HYSTERESIS
    assert not found.raised


@pytest.mark.parametrize("alpha_noise_deg", [0.02, 0.1])
@pytest.mark.parametrize("lag_s", [0.2, 0.5, 1.0])
def test_a_stall_that_lags_is_hysteresis(lag_s: float, alpha_noise_deg: float) -> None:
    (found,) = lift_hysteresis([_record(1, lag_s=lag_s, alpha_noise_deg=alpha_noise_deg)])
    assert found.raised
    assert found.probability < 1e-3
    assert "stall hysteresis" in found.statement


@pytest.mark.parametrize(("damping", "downwash"), [(0.8, 0.0), (DAMPING, 0.5)])
def test_damping_and_downwash_are_no_hysteresis(damping: float, downwash: float) -> None:
    (found,) = lift_hysteresis([_record(1, damping=damping, downwash=downwash)])
    assert not found.raised


def test_records_without_normal_acceleration_say_nothing() -> None:
    record = _record(1)
    kept = {name: values for name, values in record.columns.items() if name != "az_m_s2"}
    bare = FlightRecord(
        name="bare",
        columns=kept,
        outcome=record.outcome,
        note="",
        condition=record.condition,
        schedule=record.schedule,
        hold=record.hold,
    )
    assert lift_hysteresis([bare]) == ()
    assert lift_hysteresis([]) == ()
    assert len(lift_hysteresis([bare, record])) == 1


def test_an_identification_asks_the_lift_where_it_is_known(clean: Sweep, options: IdentificationOptions) -> None:
    """The published model at one airspeed: az follows from its own dα/dt, with no lag in it."""
    known = tuple(
        record.with_columns(
            airspeed_m_s=np.full(len(record), 295.0),
            az_m_s2=295.0 * (np.gradient(record["alpha_rad"], 0.01) - record["q_rad_s"]),
        )
        for record in clean.records
    )
    found = identify(Sweep(study="lift", records=known), options).suspicions
    assert [item.suspect for item in found] == ["turbulence", "hysteresis", "input", "hysteresis"]
    assert len(identify(clean, options).suspicions) == 3


def _gentle(seed: int, *, span_s: float = 20.0, factor: float = 1.0, **condition: float) -> FlightRecord:
    """Maneuver far below the stall, with cheap sensors; ``factor`` is of the lift."""
    random = np.random.default_rng(seed)
    time = INTERVAL_S * np.arange(round(span_s / INTERVAL_S))
    pulses = np.select([(time > at) & (time <= at + long) for at, long in ((2, 1), (3, 0.7), (3.7, 0.3), (4, 0.3))],
                       [1.0, -1.0, 1.0, -1.0])  # fmt: skip
    alpha = to_si(4.0 + lfilter([0.0, 0.006], [1.0, -1.92, 0.926], 4.0 * pulses), "deg")
    lift = factor * (3.0 + PULL * alpha)
    q = np.gradient(alpha, INTERVAL_S) + (lift - GRAVITY) / SPEED
    noise = random.standard_normal((4, time.size))
    return FlightRecord(
        name=f"gentle {seed} {factor}",
        columns={
            "time_s": time,
            "alpha_rad": alpha + to_si(0.3, "deg") * noise[0],
            "q_rad_s": q + to_si(0.3, "deg") * noise[1],
            "elevator_rad": -0.5 * alpha,
            "airspeed_m_s": SPEED + noise[2],
            "az_m_s2": -lift + 0.5 * noise[3],
        },
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(
            airspeed_m_s=SPEED, gravity_m_s2=GRAVITY, **{"density_kg_m3": 1.0, "altitude_m": 2000.0, **condition}
        ),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=Hold.FOH,
    )


def test_short_attached_flights_with_cheap_sensors_are_no_hysteresis() -> None:
    """With as many nodes as a long stall has, the curve follows the noise, and chance explains a tenth of the rest."""
    assert not any(lift_hysteresis([_gentle(seed)])[0].raised for seed in range(40))


def test_flights_of_other_weight_or_at_other_density_are_no_hysteresis() -> None:
    """One curve for all would be wrong by 10 %; each flight has its own straight part."""
    heavy = [_gentle(seed, factor=factor) for seed, factor in enumerate((0.9, 1.0, 1.1))]
    thin = [_gentle(5, factor=0.7, density_kg_m3=0.7), _gentle(6)]
    for records in (heavy, thin):
        (found,) = lift_hysteresis(records)
        assert not found.raised
        assert found.size < 0.05


@pytest.mark.parametrize("known", ["density_kg_m3", "altitude_m"])
def test_the_density_counts_as_it_is_recorded(known: str) -> None:
    """A stall while the air gets denser by a fifth: unknown, that hides a part of the hysteresis."""
    record = _record(1, lag_s=0.5)
    share = np.linspace(1.0, 1.2, len(record))
    channel = {"density_kg_m3": share, "altitude_m": np.interp(share, [1.0, 1.2], [2000.0, 40.0])}[known]
    denser = record.with_columns(az_m_s2=record["az_m_s2"] * share)
    (plain,), (hidden,), (found,) = (
        lift_hysteresis([one]) for one in (record, denser, denser.with_columns(**{known: channel}))
    )
    assert found.raised
    assert hidden.size < 0.8 * found.size < 0.8 * plain.size


def test_a_stall_that_is_flown_through_to_where_the_lift_rises_again_is_hysteresis() -> None:
    """Far beyond the stall the lift of separated flow has a slope of its own: what breaks is the middle."""
    time = _record(1)["time_s"]
    dive = np.exp(-0.5 * ((time - 42.0) / 1.5) ** 2)
    assert lift_hysteresis([_record(1, lag_s=0.5, further_rad=to_si(14.0, "deg") * dive)])[0].raised


def test_what_is_too_short_or_too_still_is_not_judged() -> None:
    still = _gentle(1).with_columns(alpha_rad=to_si(4.0, "deg") + to_si(0.3, "deg") * np.sin(np.arange(1000.0) ** 2))
    for records in ([_gentle(1, span_s=6.0)], [still]):
        (found,) = lift_hysteresis(records)
        assert not found.judged
        assert not found.raised


def test_missing_samples_do_not_count() -> None:
    record = _record(1, lag_s=0.5)
    alpha = np.array(record["alpha_rad"])
    alpha[100:120] = np.nan
    (found,) = lift_hysteresis([record.with_columns(alpha_rad=alpha)])
    assert found.raised
    assert lift_hysteresis([record.with_columns(alpha_rad=np.full(alpha.size, np.nan))]) == ()


GAPS_S = ((13.0, 16.5), (24.0, 28.0), (35.0, 38.5), (46.0, 49.0))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("lag_s", "least", "most"), [(0.0, 0.0, 0.07), (0.5, 0.5, 1.0)])
def test_nothing_is_smoothed_across_a_gap(seed: int, lag_s: float, least: float, most: float) -> None:
    """Across gaps, dα/dt would be a false peak: 0.1 of the squares without hysteresis, and 0.2 of 0.58 with it."""
    record = _record(seed, lag_s=lag_s)
    time = record["time_s"]
    gone = np.any([(time >= start) & (time < end) for start, end in GAPS_S], axis=0)
    (found,) = lift_hysteresis([record.with_columns(az_m_s2=np.where(gone, np.nan, record["az_m_s2"]))])
    assert found.raised is (lag_s > 0.0)
    assert least <= found.size <= most


def test_single_lost_samples_cut_no_record() -> None:
    """One row in ten: pieces between them are shorter than the kernel."""
    record = _record(1, lag_s=0.5)
    normal = np.array(record["az_m_s2"])
    normal[5::10] = np.nan
    (whole,) = lift_hysteresis([record])
    (found,) = lift_hysteresis([record.with_columns(az_m_s2=normal)])
    assert found.raised
    assert found.size == pytest.approx(whole.size, rel=0.1)

"""Equation error where sensors' noise has a color of its own, in gusts, and with few samples a second."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.equation_error import equation_error
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import identify_coefficients
from finback.identification.coefficient.known_together import known_together
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.sections import sections
from finback.identification.coefficient.track import tracks
from finback.identification.coefficient.weak_equations import equations
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si

FRAME = Airframe(mass_kg=7472.0, wing_area_m2=30.1, chord_m=2.43, pitch_inertia_kg_m2=91400.0, thrust_n=11.6e3)
CRUISE = Condition(airspeed_m_s=104.67, density_kg_m3=0.792, gravity_m_s2=9.80665, altitude_m=4300.0)
FORM = CoefficientForm.parse(
    Axes.WIND, ["1", "speed_ratio", "alpha"], ["1", "alpha"], ["1", "alpha", "reference_pitch_rate", "elevator"]
)
TRUTH = np.array([0.124, -0.065, 0.32, 0.055, 4.4, 0.118, -1.0, -37.0, -1.6])
EQUATION_ERROR = CoefficientOptions(
    airframe=FRAME, form=FORM, reference_speed_m_s=104.67, method=CoefficientMethod.EQUATION_ERROR
)
NOISE = {
    "airspeed_m_s": 0.05,
    "alpha_rad": 5e-4,
    "theta_rad": 2e-4,
    "q_rad_s": 3e-4,
    "ax_m_s2": 0.01,
    "az_m_s2": 0.02,
}
FELT = tuple(NOISE)
UNFELT = FELT[:4]
SEEDS = 12
STEP_S = 0.02
# Of 12 seeds and nine numbers that hang together, two standard deviations of what chance leaves of 0.95 covered.
COVERED = 0.88
# The root mean square of errors in standard errors: 12 seeds tell one number's to 20 %; the median of nine is steadier.
HONEST = (0.7, 1.25)
WORST = 1.7  # of one number


def _flown(interval_s: float, gusts: FloatArray) -> list[FlightRecord]:
    """Fly a 3-2-1-1 and a pulse in 40 s by Runge and Kutta's rule, in gusts (n, flights, 2) of V and α at 50 Hz."""
    inner, (count, flights, _) = round(interval_s / STEP_S), gusts.shape
    clock = np.linspace(0.0, STEP_S * (count - 1), count)
    knots = 2.0 + 1.2 * np.cumsum([0, 3, 2, 1, 1])
    times = [*(np.repeat(knots, 2) + np.tile([0.0, 0.2], 5))[1:-1], 24.0, 24.2, 26.0, 26.2]
    elevator = 0.006 + 0.03 * np.interp(clock, times, [0, 1, 1, -1, -1, 1, 1, -1, -1, 0, 0, 1, 1, 0][1:-1])
    terms, one = layout(FORM, FRAME, 104.67), np.ones(flights)
    air = np.concatenate([gusts, np.zeros((count, flights, 2))], axis=2)
    halves = 0.5 * (air[:-1] + air[1:]), 0.5 * (elevator[:-1] + elevator[1:])

    def rates(state: FloatArray, gust: FloatArray, deflected: float) -> FloatArray:
        known = CRUISE.density_kg_m3 * one, FRAME.thrust_n * one
        return motion(terms, TRUTH, state + gust, deflected * one[:, np.newaxis], *known, 9.80665).rates

    seen, state = np.empty((count, flights, 6)), np.tile([104.67, 0.096, 0.1, 0.0], (flights, 1))
    for k in range(count):
        first = rates(state, air[k], elevator[k])
        seen[k] = np.hstack([state + air[k], first[:, 4:]])
        if k + 1 < count:
            second = rates(state + 0.5 * STEP_S * first[:, :4], halves[0][k], halves[1][k])
            third = rates(state + 0.5 * STEP_S * second[:, :4], halves[0][k], halves[1][k])
            fourth = rates(state + STEP_S * third[:, :4], air[k + 1], elevator[k + 1])
            state = state + STEP_S / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)[:, :4]
    taken = slice(None, None, inner)
    known = {"time_s": clock[taken], "elevator_rad": elevator[taken]}
    return [
        FlightRecord(
            name="transport",
            columns={**known, **dict(zip(FELT, seen[taken, flight].T, strict=True))},
            outcome=Outcome.COMPLETED,
            note="",
            condition=CRUISE,
            schedule=Schedule(time_s=known["time_s"], elevator_rad=known["elevator_rad"]),
            hold=Hold.FOH,
        )
        for flight in range(flights)
    ]


def _wandering(random: np.random.Generator, count: int, deviation: float, memory_s: float, step_s: float) -> FloatArray:
    """Return noise that forgets exponentially."""
    kept = float(np.exp(-step_s / memory_s))
    driven = random.standard_normal(count + 500) * deviation * np.sqrt(1.0 - kept**2)
    found: FloatArray = lfilter([1.0], [1.0, -kept], driven)[500:]
    return found


def _measured(
    record: FlightRecord, seed: int, channels: tuple[str, ...], own: dict[str, tuple[float, float]]
) -> FlightRecord:
    """Add white noise, and to some channels noise of a deviation and a memory in s."""
    random = np.random.default_rng(seed)
    step = float(record["time_s"][1])
    columns = {name: record[name] for name in ("time_s", "elevator_rad")}
    for name in channels:
        columns[name] = record[name] + NOISE[name] * random.standard_normal(len(record))
        if name in own:
            columns[name] = columns[name] + _wandering(random, len(record), *own[name], step)
    return replace(record, columns=columns)


@pytest.fixture(scope="module")
def still() -> FlightRecord:
    """A flight in calm air at 10 Hz, without noise."""
    return _flown(0.1, np.zeros((2001, 1, 2)))[0]


def _off(records: list[FlightRecord], options: CoefficientOptions) -> tuple[FloatArray, FloatArray]:
    """Return errors and standard errors of every record by itself, shape (seeds, p)."""
    found = [identify_coefficients(Sweep(study="own", records=(record,)), options).model for record in records]
    return np.array([model.numbers for model in found]) - TRUTH, np.array([model.standard_errors for model in found])


def _honest(missed: FloatArray, errors: FloatArray) -> None:
    """Check what 95 % intervals hold, and that errors are as large as they say: neither too small nor too large."""
    assert (np.abs(missed) <= 1.96 * errors).mean() >= COVERED
    rms = np.sqrt((missed**2).mean(axis=0) / (errors**2).mean(axis=0))
    assert HONEST[0] < float(np.median(rms)) < HONEST[1]
    assert float(rms.max()) < WORST


VANE = {"alpha_rad": (to_si(0.2, "deg"), 1.0)}
PROBE = {"airspeed_m_s": (0.5, 0.5)}


@pytest.mark.parametrize(
    ("method", "channels", "own"),
    [
        (CoefficientMethod.EQUATION_ERROR, UNFELT, PROBE),
        (CoefficientMethod.FREQUENCY, FELT, VANE),
        # Transforms of rates err the more the higher their frequency, and drag is known by the low ones.
        (CoefficientMethod.FREQUENCY, UNFELT, {}),
    ],
)
def test_errors_are_as_large_as_they_say(
    still: FlightRecord, method: CoefficientMethod, channels: tuple[str, ...], own: dict[str, tuple[float, float]]
) -> None:
    records = [_measured(still, seed, channels, own) for seed in range(SEEDS)]
    _honest(*_off(records, replace(EQUATION_ERROR, method=method)))


def test_noise_of_a_vane_moves_no_number_on_average(still: FlightRecord) -> None:
    """Least squares alone make the moment's slope by alpha smaller, by more than its error; that is named."""
    records = [_measured(still, seed, FELT, VANE) for seed in range(SEEDS)]
    missed, errors = _off(records, EQUATION_ERROR)
    _honest(missed, errors)
    place = FORM.labels().index("alpha in Cm")
    far = float(np.median(errors[:, place]))
    (track,) = tracks(records[0], FRAME, outputs=FELT, inputs=FORM.inputs, shortest_s=1.0)
    raw, _ = equation_error([track], EQUATION_ERROR, np.full(len(FELT), 1e-9))
    assert raw.coefficients[place] - TRUTH[place] > missed[0, place] + 0.7 * far
    assert abs(missed[:, place].mean()) < 0.9 * far  # chance leaves 0.3, the second order the rest
    said = identify_coefficients(Sweep(study="own", records=(records[0],)), EQUATION_ERROR).warnings
    assert any("was corrected for" in line and "alpha in Cm" in line for line in said)


def test_gusts_without_accelerometers_bias_no_lift() -> None:
    """A gust is no acceleration: alpha as it moves by itself would pass for lift that does not turn the path."""
    random = np.random.default_rng(11)
    gusts = np.zeros((2001, SEEDS, 2))
    gusts[:, :, 1] = np.stack([_wandering(random, 2001, 0.01, 2.9, STEP_S) for _ in range(SEEDS)], axis=1)
    records = [_measured(record, seed, UNFELT, {}) for seed, record in enumerate(_flown(0.1, gusts))]
    missed, errors = _off(records, EQUATION_ERROR)
    place = FORM.labels().index("alpha in CL")
    assert abs(missed[:, place].mean()) < 0.1 * TRUTH[place]
    assert (np.abs(missed) <= 1.96 * errors).mean() >= COVERED


def test_ten_samples_a_second_will_do(still: FlightRecord) -> None:
    """A bump over four samples on each side and less left 0.5 % of the moment out."""
    found = identify_coefficients(Sweep(study="own", records=(still,)), EQUATION_ERROR).model
    np.testing.assert_allclose(found.numbers[5:], TRUTH[5:], rtol=2e-3)


@pytest.mark.parametrize("method", [CoefficientMethod.EQUATION_ERROR, CoefficientMethod.FREQUENCY])
def test_damping_and_lag_of_the_downwash_are_not_told_apart_by_noise(
    still: FlightRecord, method: CoefficientMethod
) -> None:
    pitching = ["1", "alpha", "pitch_rate", "alpha_rate", "elevator"]
    options = replace(EQUATION_ERROR, method=method)
    short = replace(still, columns={name: still[name][:121] for name in ("time_s", "elevator_rad", *FELT)})
    record = _measured(short, 0, FELT, {"alpha_rad": (to_si(0.8, "deg"), 1.0)})
    with pytest.raises(RefusedError, match=r"cannot tell apart, within the noise.*alpha_rate in Cm"):
        identify_coefficients(
            Sweep(study="both", records=(record,)),
            replace(options, form=CoefficientForm.parse(Axes.WIND, ["1", "alpha"], ["1", "alpha"], pitching)),
        )
    one = [*pitching[:2], "pitch_rate+alpha_rate", "elevator"]
    identify_coefficients(
        Sweep(study="one", records=(record,)),
        replace(options, form=CoefficientForm.parse(Axes.WIND, ["1", "alpha"], ["1", "alpha"], one)),
    )


def test_numbers_known_only_together_are_named() -> None:
    """Two numbers of which the sum is known a hundred times better than the difference."""
    form = CoefficientForm.parse(Axes.WIND, ["1"], ["1", "alpha"], ["1", "alpha", "elevator"])
    apart = np.eye(6) * 1e-4
    assert known_together(form, np.ones(6), apart) == ()
    apart[3:5, 3:5] += 0.5 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    (said,) = known_together(form, np.ones(6), apart)
    assert "1 in Cm with alpha in Cm (condition index" in said
    assert known_together(form, np.array([1.0, 1.0, 1.0, 40.0, 1.0, 1.0]), apart) == ()  # one is told from zero


@pytest.mark.parametrize("method", [CoefficientMethod.EQUATION_ERROR, CoefficientMethod.FREQUENCY])
@pytest.mark.parametrize("channels", [FELT, UNFELT])
def test_gains_of_sources_are_what_a_moved_sample_does(
    still: FlightRecord, method: CoefficientMethod, channels: tuple[str, ...]
) -> None:
    options = replace(EQUATION_ERROR, method=method)
    record = _measured(still, 0, channels, {})
    weight, sample, step = np.array([0.3, 0.4, 0.5]), 100, 1e-5

    def whitened(moved: FlightRecord) -> FloatArray:
        (track,) = tracks(moved, FRAME, outputs=channels, inputs=FORM.inputs, shortest_s=1.0)
        piece = equations(track, options, TRUTH)
        parts = sections([track], [piece], options, TRUTH, weight)
        found: FloatArray = np.concatenate([part.residual for part in parts])
        return found

    (track,) = tracks(record, FRAME, outputs=channels, inputs=FORM.inputs, shortest_s=1.0)
    parts = sections([track], [equations(track, options, TRUTH)], options, TRUTH, weight)
    assert len(parts) == 2  # 40 s
    for source, name in enumerate(channels):
        column = np.array(record[name])
        up, down = column.copy(), column.copy()
        up[sample] += step
        down[sample] -= step
        change = whitened(record.with_columns(**{name: up})) - whitened(record.with_columns(**{name: down}))
        change /= 2.0 * step
        gains = []
        for part in parts:
            one = np.repeat(np.eye(len(part.residual))[:, np.newaxis], 3, axis=1)
            inside = part.samples.start <= sample < part.samples.stop
            own = part.gains(one)[source, sample - part.samples.start] if inside else np.zeros((3, len(part.residual)))
            gains.append(own.T)
        np.testing.assert_allclose(np.concatenate(gains), change, atol=1e-6 * np.abs(change).max() + 1e-9)

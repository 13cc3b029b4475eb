"""What a study says of drive, thrust, properties, turbulence and sensors: in SI, every fault at once."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from finback.errors import StudyError
from finback.flight.air import CALM, DrydenAir
from finback.flight.plan import Drive
from finback.flight.power import ENGINES_OFF, FixedThrust, Throttle
from finback.study import Study, read_study

DEG = math.pi / 180.0

FREE = {
    'fidelity = "rig"': 'fidelity = "free"\ndrive = "direct"\nthrust_kn = 25.9',
}
SENSORS = """
[sensors.alpha]
bias_deg = 0.5
scale = 1.02
lag_s = 0.1
resolution_deg = 0.05

[sensors.q]
sample_hz = 50
bias_deg_s = 0.2

[sensors.airspeed]
noise_m_s = 1.5

[turbulence]
intensity_m_s = 1.5
length_m = 533.4

[flight.properties]
"fcs/stabilator-research-mode" = 1
"""


def study_of(small_study: Path, *changes: tuple[str, str], end: str = "") -> Study:
    text = small_study.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = small_study.with_name("changed.toml")
    path.write_text(f"{text}\n{end}", encoding="utf-8")
    return read_study(path)


def faults_of(small_study: Path, *changes: tuple[str, str], end: str = "") -> str:
    with pytest.raises(StudyError) as caught:
        study_of(small_study, *changes, end=end)
    return "\n".join(caught.value.faults)


def test_what_is_not_said_is_off(small_study: Path) -> None:
    study = study_of(small_study)
    assert (study.flight.power, study.flight.air, study.flight.drive) == (ENGINES_OFF, CALM, Drive.OWN)
    assert (study.flight.properties, study.sensors.instruments, study.sensors.vane_forward_m) == ((), (), 0.0)


def test_everything_is_read_in_si(small_study: Path) -> None:
    study = study_of(
        small_study, *FREE.items(), ("q_noise_deg_s = 0.02", "q_noise_deg_s = 0.02\nvane_forward_m = 6.0"), end=SENSORS
    )
    flight, sensors = study.flight, study.sensors
    assert (flight.fidelity, flight.drive, flight.power) == ("free", Drive.DIRECT, FixedThrust(thrust_n=25900.0))
    assert flight.properties == (("fcs/stabilator-research-mode", 1.0),)
    assert flight.air == DrydenAir(intensity_m_s=1.5, length_m=533.4, seed=study.seed)
    assert sensors.vane_forward_m == 6.0
    alpha, q, airspeed = sensors.instruments
    assert (alpha.channel, alpha.scale, alpha.lag_s) == ("alpha_rad", 1.02, 0.1)
    assert (alpha.bias, alpha.resolution) == pytest.approx((0.5 * DEG, 0.05 * DEG), rel=1e-15)
    assert (q.channel, q.sample_interval_s, q.bias) == ("q_rad_s", 0.02, pytest.approx(0.2 * DEG, rel=1e-15))
    assert (airspeed.channel, airspeed.noise) == ("airspeed_m_s", 1.5)
    throttled = study_of(small_study, ('fidelity = "rig"', 'fidelity = "symmetric"\nthrottle = 0.6'))
    assert throttled.flight.power == Throttle(setting=0.6)


def test_every_fault_is_named_at_once(small_study: Path) -> None:
    wrong = """
[sensors.alpha]
bias_rad = 0.5
lag_s = -0.1
[sensors.alfa]
bias_deg = 0.1
[sensors.q]
sample_hz = 33
[turbulence]
intensity_m_s = "strong"
[flight.properties]
"fcs/mode" = "on"
"""
    said = faults_of(
        small_study, ('fidelity = "rig"', 'fidelity = "free"\ndrive = "indirect"\nthrottle = 2.0'), end=wrong
    )
    for fault in (
        "flight.drive: must be one of: own, direct, got 'indirect'",
        "flight.throttle: must be less than or equal to 1",
        "flight.properties.'fcs/mode': must be a finite number, got 'on'",
        "turbulence.intensity_m_s: must be a valid number",
        "turbulence.length_m: missing",
        "sensors.alpha.bias_rad: unknown key; did you mean 'bias_deg'?",
        "sensors.alpha.lag_s: must be greater than or equal to 0",
        "sensors.alfa: no sensor gives 'alfa'; did you mean 'alpha'?",
    ):
        assert fault in said


@pytest.mark.parametrize(
    ("change", "end", "fault"),
    [
        ("thrust_kn = 10.0", "", "flight.thrust_kn: the rig has neither engines nor flight control"),
        ("", '[flight.properties]\n"a/b" = 1', "flight.properties: the rig has neither"),
        (
            "",
            "[turbulence]\nintensity_m_s = 1.0\nlength_m = 500.0",
            "turbulence: needs flight.fidelity 'free'",
        ),
        (
            "",
            "[sensors.q]\nsample_hz = 33",
            "sensors.q.sample_hz: flight.sample_hz must be a whole multiple",
        ),
        ("", "[sensors.q]\nnoise_deg_s = 0.1", "sensors: sensors: the noise of 'q_rad_s' is given twice"),
    ],
)
def test_what_does_not_fit_is_a_fault(small_study: Path, change: str, end: str, fault: str) -> None:
    assert fault in faults_of(small_study, ('fidelity = "rig"', f'fidelity = "rig"\n{change}'), end=end)


def test_a_thrust_and_a_throttle_are_one_too_many(small_study: Path) -> None:
    both = ('fidelity = "rig"', 'fidelity = "free"\nthrust_kn = 10.0\nthrottle = 0.5')
    assert "flight.thrust_kn: a fixed thrust and a throttle stand here" in faults_of(small_study, both)

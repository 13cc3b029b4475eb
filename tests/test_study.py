"""Study files: every field in SI, every fault at once, and nothing but StudyError for whatever stands in a file."""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from finback.errors import StudyError
from finback.flight.excitation import Doublet, Hold, Ramp, Release, Step, ThreeTwoOneOne
from finback.study import inspect_study, read_study

ROOT = Path(__file__).resolve().parents[1]
STUDY = ROOT / "aircraft" / "f8ii" / "studies" / "elevator-sweep.toml"
DEG = math.pi / 180.0
EXACT = 1e-15  # relative: one multiplication apart from the same factor


def faults_of(text: str, folder: Path) -> tuple[str, ...]:
    path = folder / "broken.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        read_study(path)
    assert str(path) in str(caught.value)
    return caught.value.faults


def test_the_shipped_study_has_no_fault() -> None:
    study = read_study(STUDY)
    assert study.name == "f8ii-elevator-sweep"
    assert study.aircraft.path == ROOT / "aircraft" / "f8ii" / "f8ii.xml"
    assert study.text == STUDY.read_text(encoding="utf-8")


def test_every_field_is_converted_to_si(small_study: Path) -> None:
    study = read_study(small_study)
    flight, fold, tolerances = study.flight, study.validation.fold, study.validation.tolerances
    expected_and_found = {
        "condition": (
            (295.07, 0.26548, 9.80665, 13026.6),
            (
                study.condition.airspeed_m_s,
                study.condition.density_kg_m3,
                study.condition.gravity_m_s2,
                study.condition.altitude_m,
            ),
        ),
        "steps": ((1 / 200, 1 / 100), (flight.step_s, flight.sample_interval_s)),
        "limits": ((-33 * DEG, 46 * DEG), flight.alpha_limits_rad),
        "elevator": ((-40 * DEG, 20 * DEG, 60 * DEG), (*flight.elevator_limits_rad, flight.elevator_rate_rad_s)),
        "sensors": ((0.02 * DEG, 0.02 * DEG), (study.sensors.alpha_noise_rad, study.sensors.q_noise_rad_s)),
        "window": ((-32.5 * DEG, 45.5 * DEG), study.identification.alpha_window_rad),
        "times": (
            (0.2, 0.05, 1.0),
            (
                study.identification.half_width_s,
                study.identification.spacing_s,
                study.identification.minimum_duration_s,
            ),
        ),
        "analysis": (
            (-40 * DEG, 20 * DEG, 5 * DEG, -34 * DEG, 46 * DEG),
            (
                *study.analysis.elevator_range_rad,
                study.analysis.elevator_step_rad,
                *study.analysis.alpha_range_rad,
            ),
        ),
        "equilibria": ((-10 * DEG, 0.0), study.validation.equilibrium_elevators_rad),
        "rates": ((0.05 * DEG, 0.1 * DEG, 0.2 * DEG, 0.4 * DEG), fold.ramp_rates_rad_s),
        "fold": (
            (5 * DEG, 2 * DEG, 30.0, 2.0, 0.01 * DEG),
            (fold.margin_rad, fold.start_offset_rad, fold.hold_s, fold.approach_s, fold.resolution_rad),
        ),
        "tolerances": (
            (0.5 * DEG, 0.5 * DEG, 0.1, 0.1 * DEG, 0.5 * DEG, 0.2 * DEG),
            (
                tolerances.alpha_rmse.value,
                tolerances.q_rmse.value,
                tolerances.theil.value,
                tolerances.fold_elevator.value,
                tolerances.ramp_fold_elevator.value,
                tolerances.equilibrium_alpha.value,
            ),
        ),
    }
    for name, (expected, found) in expected_and_found.items():
        assert found == pytest.approx(expected, rel=EXACT, abs=0), name
    assert study.identification.alpha_order == (3, 3)
    assert (study.seed, study.validation.seed) == (7, 7)
    assert tolerances.alpha_rmse.source == "loose on purpose: a test of the chain"


KINDS = """
[[sweep]]
kind = "step"
elevator_deg = 2
amplitude_deg = -3.0
lead_s = 0.5
duration_s = 4.0
[[sweep]]
kind = "doublet"
elevator_deg = 1.0
amplitude_deg = 4.0
unit_s = 0.5
lead_s = 0.5
duration_s = 4.0
[[sweep]]
kind = "ramp"
elevator_deg = 5.0
to_elevator_deg = 8.0
rate_deg_s = 2.0
lead_s = 0.5
duration_s = 4.0
[[sweep]]
kind = "hold"
elevator_deg = -1.0
duration_s = 4.0
[[sweep]]
kind = "release"
elevator_deg = -1.0
alpha_deg = 10.0
q_deg_s = -20.0
duration_s = 4.0
[identification]
"""


def test_every_kind_of_maneuver_becomes_its_class_in_si(small_study_text: str, tmp_path: Path) -> None:
    path = tmp_path / "kinds.toml"
    path.write_text(small_study_text.replace("[identification]\n", KINDS), encoding="utf-8")
    expected = (
        Step(elevator_rad=2 * DEG, amplitude_rad=-3 * DEG, lead_s=0.5, duration_s=4.0),
        Doublet(elevator_rad=DEG, amplitude_rad=4 * DEG, unit_s=0.5, lead_s=0.5, duration_s=4.0),
        Ramp(elevator_rad=5 * DEG, to_elevator_rad=8 * DEG, rate_rad_s=2 * DEG, lead_s=0.5, duration_s=4.0),
        Hold(elevator_rad=-DEG, duration_s=4.0),
        Release(elevator_rad=-DEG, alpha_rad=10 * DEG, q_rad_s=-20 * DEG, duration_s=4.0),
    )
    assert read_study(path).maneuvers[-5:] == expected


def test_lists_make_one_flight_for_each_combination(small_study: Path) -> None:
    maneuvers = read_study(small_study).maneuvers
    multisteps = [maneuver for maneuver in maneuvers if isinstance(maneuver, ThreeTwoOneOne)]
    releases = [maneuver for maneuver in maneuvers if isinstance(maneuver, Release)]
    assert [round(one.elevator_rad / DEG) for one in multisteps] == [4, -5]
    assert [(round(one.elevator_rad / DEG), round(one.alpha_rad / DEG)) for one in releases] == [
        (-35, -20),
        (-35, 30),
        (10, -20),
        (10, 30),
    ]


# What is changed in the file, and what must be said about it.
BROKEN = {
    "typo": ("seed = 7", "sed = 7", "sed: unknown key; did you mean 'seed'?"),
    "typo in a table": ("step_hz = 200", "stp_hz = 200", "flight.stp_hz: unknown key; did you mean 'step_hz'?"),
    "missing key": ("seed = 7", "", "seed: missing"),
    "missing table": ("[sensors]\nalpha_noise_deg = 0.02\nq_noise_deg_s = 0.02", "", "sensors: missing; add a table"),
    "schema": ("schema = 1", "schema = 2", "schema: must be 1, got 2"),
    "schema true": ("schema = 1", "schema = true", "schema: must be a valid integer, got True"),
    "schema 1.0": ("schema = 1", "schema = 1.0", "schema: must be a valid integer, got 1.0"),
    "name with a slash": ('name = "small"', 'name = "../small"', "name: "),
    "wrong type": (
        "alpha_noise_deg = 0.02",
        'alpha_noise_deg = "0.02"',
        "sensors.alpha_noise_deg: must be a valid number",
    ),
    "boolean": (
        "gravity_m_s2 = 9.80665",
        "gravity_m_s2 = true",
        "condition.gravity_m_s2: must be a valid number, got True",
    ),
    "not finite": (
        "altitude_m = 13026.6",
        "altitude_m = nan",
        "condition.altitude_m: must be a finite number, got nan",
    ),
    "negative": (
        "density_kg_m3 = 0.26548",
        "density_kg_m3 = -1",
        "condition.density_kg_m3: must be greater than or equal to 0.000001, got -1",
    ),
    "limits": ("[-33.0, 46.0]", "[46.0, -33.0]", "flight.alpha_limits_deg: the lower limit must come first"),
    "limits of three": ("[-33.0, 46.0]", "[-33.0, 0.0, 46.0]", "flight.alpha_limits_deg: "),
    "one of two": ("[-33.0, 46.0]", '["x", 46.0]', "flight.alpha_limits_deg[0]: must be a valid number, got 'x'"),
    "no multiple": ("sample_hz = 100", "sample_hz = 120", "flight.sample_hz: step_hz (200) must be a whole multiple"),
    "fidelity": (
        'fidelity = "rig"',
        'fidelity = "rag"',
        "flight.fidelity: must be one of: rig, symmetric, free",
    ),
    "kind": ('kind = "release"', 'kind = "relase"', "sweep[1].kind: unknown kind 'relase'; did you mean 'release'?"),
    "key of a maneuver": (
        "amplitude_deg = 8.0",
        "amplitud_deg = 8.0",
        "sweep[0].amplitud_deg: unknown key; did you mean 'amplitude_deg'?",
    ),
    "in a list": (
        "alpha_deg = [-20.0, 30.0]",
        "alpha_deg = [-20.0, 'a']",
        "sweep[1].alpha_deg[1]: must be a valid number",
    ),
    "alone": ("q_deg_s = 0.0", "q_deg_s = 'a'", "sweep[1].q_deg_s: must be a valid number, got 'a'"),
    "elevator": (
        "elevator_deg = [4.0, -5.0]",
        "elevator_deg = 14.0",
        "sweep[0].elevator_deg: reaches 22 deg, outside flight.elevator_limits_deg",
    ),
    "alpha": (
        "alpha_deg = [-20.0, 30.0]",
        "alpha_deg = 50",
        "sweep[1].alpha_deg: reaches 50 deg, outside flight.alpha_limits_deg",
    ),
    "too short": ("duration_s = 8.0", "duration_s = 2.0", "sweep[0]: "),
    "table of the root": ("[[sweep]]", "[[swep]]", "swep: unknown key; did you mean 'sweep'?"),
    "window": (
        "alpha_window_deg = [-32.5, 45.5]",
        "alpha_window_deg = [-32.5, 47]",
        "identification.alpha_window_deg: reaches 47 deg",
    ),
    "spacing": (
        "spacing_s = 0.05",
        "spacing_s = 0.3",
        "identification.spacing_s: must not exceed half_width_s (0.2), got 0.3",
    ),
    "order": (
        "q_dot_order = 3",
        "q_dot_order = 0",
        "identification.q_dot_order: must be greater than or equal to 1, got 0",
    ),
    "rates": (
        "[0.05, 0.1, 0.2, 0.4]",
        "[0.1, 0.1, 0.1, 0.2]",
        "validation.fold.ramp_rate_deg_s: needs at least 4 different rates, got 2",
    ),
    "rate": (
        "[0.05, 0.1, 0.2, 0.4]",
        "[0.05, 0.1, 0.2, 0.0]",
        "validation.fold.ramp_rate_deg_s[3]: must be greater than or equal to 0.000001",
    ),
    "resolution": (
        "resolution_deg = 0.01",
        "resolution_deg = 2.0",
        "validation.fold.resolution_deg: must be smaller than start_offset_deg (2)",
    ),
    "source": (
        'theil = { value = 0.1, source = "loose on purpose" }',
        'theil = { value = 0.1, source = " " }',
        "validation.tolerance.theil.source: ",
    ),
    "no source": (
        'theil = { value = 0.1, source = "loose on purpose" }',
        "theil = { value = 0.1 }",
        "validation.tolerance.theil.source: missing",
    ),
    "no holdout": (
        "[[validation.holdout]]",
        "[[validation.holdouts]]",
        "validation.holdout: needs at least one maneuver",
    ),
    "equilibria": ("[-10.0, 0.0]", "[-10.0, 30.0]", "validation.equilibrium_elevator_deg: reaches 30 deg"),
}


@pytest.mark.parametrize(("old", "new", "said"), BROKEN.values(), ids=BROKEN.keys())
def test_each_fault_names_its_place_and_the_rule(
    old: str, new: str, said: str, small_study_text: str, tmp_path: Path
) -> None:
    assert old in small_study_text
    faults = faults_of(small_study_text.replace(old, new, 1), tmp_path)
    assert any(fault.startswith(said) for fault in faults), faults


SWEEPS = ("kind", "key of a maneuver", "in a list", "alone", "elevator", "alpha", "too short")
LIMITS = ("limits", "limits of three", "one of two")
# What cannot be seen beside another fault, since that is what it is a fault of: flights of a table with a misspelled
# name, angles beyond limits that are none, how far an elevator goes that has no amplitude, a multiple of nothing.
DEPENDENT = {
    *((one, "table of the root") for one in SWEEPS),
    *((one, "alpha") for one in LIMITS),
    ("key of a maneuver", "elevator"),
    ("key of a maneuver", "too short"),
    ("typo in a table", "no multiple"),
}


@pytest.fixture(scope="module")
def alone(small_study_text: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """What is said of each fault alone."""
    folder = tmp_path_factory.mktemp("alone")
    changed = {name: small_study_text.replace(old, new, 1) for name, (old, new, _) in BROKEN.items()}
    return {name: set(faults_of(text, folder)) for name, text in changed.items()}


@pytest.mark.parametrize("one", BROKEN)
def test_no_fault_hides_another(one: str, alone: dict[str, set[str]], small_study_text: str, tmp_path: Path) -> None:
    """Every later fault beside this one: both are said, and nothing that neither says alone."""
    old, new, said = BROKEN[one]
    later = list(BROKEN)[list(BROKEN).index(one) + 1 :]
    for other, (was, becomes, also) in ((name, BROKEN[name]) for name in later):
        text = small_study_text.replace(old, new, 1)
        both = text.replace(was, becomes, 1)
        if was not in text or new not in both or {(one, other), (other, one)} & DEPENDENT:
            continue
        found = faults_of(both, tmp_path)
        for expected in (said, also):
            assert any(fault.startswith(expected) for fault in found), (other, expected, found)
        if {one, other} != {"no multiple", "too short"}:  # the end of a movement is told in another grid
            assert set(found) <= alone[one] | alone[other], other


# What no aircraft flies and no machine ends: the key, what it is set to, and the place of the fault.
ABSURD = [
    ("airspeed_m_s", "1e308", "condition.airspeed_m_s"),
    ("airspeed_m_s", "1e-308", "condition.airspeed_m_s"),
    ("density_kg_m3", "1e308", "condition.density_kg_m3"),
    ("gravity_m_s2", "1e308", "condition.gravity_m_s2"),
    ("altitude_m", "-1e308", "condition.altitude_m"),
    ("step_hz", "1e18", "flight.step_hz"),
    ("sample_hz", "1e-308", "flight.sample_hz"),
    ("elevator_rate_deg_s", "1e-308", "flight.elevator_rate_deg_s"),
    ("alpha_limits_deg", "[-1e308, 46.0]", "flight.alpha_limits_deg[0]"),
    ("alpha_noise_deg", "1e308", "sensors.alpha_noise_deg"),
    ("q_noise_deg_s", "1e308", "sensors.q_noise_deg_s"),
    ("unit_s", "1e308", "sweep[0].unit_s"),
    ("lead_s", "1e308", "sweep[0].lead_s"),
    ("duration_s", "1e18", "sweep[0].duration_s"),
    ("duration_s", "1e308", "sweep[0].duration_s"),
    ("duration_s", "0.005", "sweep[0].duration_s"),
    ("q_deg_s", "1e308", "sweep[1].q_deg_s"),
    ("half_width_s", "1e308", "identification.half_width_s"),
    ("spacing_s", "1e-308", "identification.spacing_s"),
    ("elevator_step_deg", "1e-9", "analysis.elevator_step_deg"),
    ("elevator_step_deg", "1e-308", "analysis.elevator_step_deg"),
    ("elevator_step_deg", "1e-5", "analysis.elevator_step_deg"),
    ("elevator_range_deg", "[-1e308, 20.0]", "analysis.elevator_range_deg[0]"),
    ("alpha_range_deg", "[-34.0, 1e308]", "analysis.alpha_range_deg[1]"),
    ("ramp_rate_deg_s", "[1e-9, 0.1, 0.2, 0.4]", "validation.fold.ramp_rate_deg_s[0]"),
    ("ramp_rate_deg_s", "[0.1, 0.2, 0.4, 1e-5]", "validation.fold.ramp_rate_deg_s[3]"),
    ("hold_s", "1e18", "validation.fold.hold_s"),
    ("approach_s", "1e308", "validation.fold.approach_s"),
    ("approach_s", "14400.0", "validation.fold.approach_s"),
    ("resolution_deg", "1e-308", "validation.fold.resolution_deg"),
    ("margin_deg", "1e308", "validation.fold.margin_deg"),
    ("theil", '{ value = 5e-324, source = "x" }', "validation.tolerance.theil.value"),
    ("alpha_rmse_deg", '{ value = 5e-324, source = "x" }', "validation.tolerance.alpha_rmse_deg.value"),
    ("aircraft", f'"{"x" * 5000}"', "aircraft"),
    ("aircraft", '"a\\u0000b"', "aircraft"),
]


@pytest.mark.parametrize(("key", "value", "place"), ABSURD)
def test_a_number_that_no_run_would_end_with_is_a_fault_of_its_key(
    key: str, value: str, place: str, small_study_text: str, tmp_path: Path
) -> None:
    text, count = re.subn(rf"^{key} = .*$", lambda _: f"{key} = {value}", small_study_text, count=1, flags=re.MULTILINE)
    assert count == 1
    faults = faults_of(text, tmp_path)
    assert any(fault.startswith(f"{place}: ") for fault in faults), faults


def test_more_samples_than_fit_in_memory_are_one_fault(small_study_text: str, tmp_path: Path) -> None:
    angles = ", ".join(["0.0"] * 10)
    text = small_study_text.replace("alpha_deg = [-20.0, 30.0]", f"alpha_deg = [{angles}]").replace(
        "duration_s = 5.0", "duration_s = 14000.0"
    )
    assert faults_of(text, tmp_path) == ("sweep: its flights have 2.8e+07 samples, more than 10000000",)


def test_all_faults_come_at_once_those_of_the_aircraft_included(small_study_text: str, tmp_path: Path) -> None:
    text = re.sub(r'aircraft = ".*"', 'aircraft = "no-such-aircraft"', small_study_text)
    for old, new in (("seed = 7", "seed = -7"), ("hold_s = 30.0", "hold_s = 0.0"), ("step_hz", "step_herz")):
        text = text.replace(old, new)
    faults = faults_of(text, tmp_path)
    for place in ("aircraft", "seed", "validation.fold.hold_s", "flight.step_hz", "flight.step_herz"):
        assert any(fault.startswith(f"{place}: ") for fault in faults), (place, faults)


def test_a_holdout_may_not_be_a_flight_of_the_sweep(small_study_text: str, tmp_path: Path) -> None:
    again = """[[validation.holdout]]
kind = "release"
elevator_deg = 10.0
alpha_deg = 30.0
q_deg_s = 0.0
duration_s = 5.0

[validation.fold]"""
    faults = faults_of(small_study_text.replace("[validation.fold]", again), tmp_path)
    assert faults == ("validation.holdout: a release of the sweep stands here too; hold-outs are never in the fit",)


def test_a_million_combinations_are_one_fault(small_study_text: str, tmp_path: Path) -> None:
    many = f"[{', '.join(['1.0'] * 200)}]"
    text = small_study_text.replace("alpha_deg = [-20.0, 30.0]", f"alpha_deg = {many}").replace(
        "q_deg_s = 0.0", f"q_deg_s = {many}"
    )
    assert faults_of(text, tmp_path) == ("sweep[1]: its lists combine to more than 10000 flights",)


def test_a_study_without_maneuvers_says_what_to_add(small_study_text: str, tmp_path: Path) -> None:
    faults = faults_of(small_study_text.replace("[[sweep]]", "[[swep]]"), tmp_path)
    assert "sweep: needs at least one maneuver: add a table [[sweep]]" in faults


def test_what_is_no_table_is_a_fault(tmp_path: Path) -> None:
    faults = faults_of("sensors = 3\nsweep = [1]\naircraft = 4\nvalidation = {fold = [], tolerance = 'x'}\n", tmp_path)
    for said in (
        "sensors: must be a table [sensors], got 3",
        "sweep[0]: must be a table, got 1",
        "aircraft: must be a valid string, got 4",
        "validation.fold: must be a table [validation.fold], got []",
        "validation.tolerance: must be a table [validation.tolerance], got 'x'",
    ):
        assert said in faults, faults


def test_an_aircraft_is_found_in_a_study_with_faults(small_study_text: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(small_study_text.replace("seed = 7", "seed = -7"), encoding="utf-8")
    study, aircraft, faults = inspect_study(path)
    assert study is None
    assert aircraft is not None
    assert len(faults) == 1


def test_a_syntax_error_names_its_line(tmp_path: Path) -> None:
    (fault,) = faults_of("schema = 1\nname = = 2\n", tmp_path)
    assert fault.startswith("syntax: ")
    assert "line 2" in fault


def test_a_missing_file_names_the_nearest_one(tmp_path: Path) -> None:
    (tmp_path / "elevator.toml").touch()
    with pytest.raises(StudyError, match=r"not found; did you mean .*elevator\.toml"):
        read_study(tmp_path / "elevatr.toml")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"x = [" * 5000, b"x = " + b"1" * 5000])
def test_bytes_that_are_no_toml_are_a_fault(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    with pytest.raises(StudyError, match="1 fault"):
        read_study(path)


def test_a_folder_is_no_study(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="cannot be read"):
        read_study(tmp_path)


VALUES = st.one_of(
    st.integers().map(str),
    st.floats().map(repr),
    st.sampled_from(["true", "[]", "{}", "[[]]", "''", "'rig'", "'hold'", "1979-05-27", "1e308", "5e-324", "-1e308"]),
    st.lists(st.floats(), max_size=4).map(repr),
    st.text(st.characters(codec="utf-8", exclude_characters="'\n\r", exclude_categories=["Cc"]), max_size=8).map(
        lambda text: f"'{text}'"
    ),
)


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_whatever_stands_in_a_key_ends_in_a_study_or_a_study_error(data: st.DataObject, small_study_text: str) -> None:
    lines = small_study_text.splitlines()
    for number in data.draw(st.lists(st.sampled_from(range(len(lines))), min_size=1, max_size=3)):
        key, equals, _ = lines[number].partition(" = ")
        if equals:
            lines[number] = f"{key} = {data.draw(VALUES)}"
        else:
            lines[number] = data.draw(st.sampled_from(["", "[x]", "[[sweep]]", "[flight]", "kind = 3"]))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text("\n".join(lines), encoding="utf-8")
        study, _, faults = inspect_study(path)
    assert (study is None) == bool(faults)


@settings(max_examples=50, deadline=None)
@given(content=st.binary(max_size=200))
def test_any_bytes_end_in_a_study_error(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_bytes(content)
        with pytest.raises(StudyError):
            read_study(path)

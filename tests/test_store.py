"""The store: bit for bit, never half-written, never stale, always valid JSON."""

from __future__ import annotations

import errno
import json
import math
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from finback.arrays import FloatArray, IntArray
from finback.channels import CHANNELS
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, MissingResultError
from finback.files import replacing, sha256, write_text
from finback.flight.excitation import Hold as HoldManeuver, Maneuver, Release, Step
from finback.identification.identify import Diagnostics, Identification, Segment
from finback.identification.options import IdentificationOptions
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store import (
    load_analysis,
    load_identification,
    load_sweep,
    load_validation,
    save_identification,
    save_sweep,
)
from finback.store.codec import from_tree, to_json, to_tree

CONDITION = Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=9.80665, altitude_m=math.inf)
ANY_FLOAT = st.floats(allow_nan=True, allow_infinity=True, width=64)


def record(name: str = "hold-01", **columns: FloatArray) -> FlightRecord:
    given_columns = columns or {"alpha_rad": np.array([1 / 3, math.nan, -0.0]), "q_rad_s": np.array([1e-320, 2.0, 3.0])}
    rows = len(next(iter(given_columns.values())))
    return FlightRecord(
        name=name,
        columns={"time_s": np.arange(rows) * 0.01, **given_columns},
        outcome=Outcome.DEPARTED,
        note="α left its limits",
        condition=CONDITION,
        schedule=Schedule(time_s=[0.0, 1.0], elevator_rad=[0.1, 0.2]),
        hold=Hold.FOH,
        provenance={"aircraft": "x"},
    )


def sweep_of(*records: FlightRecord) -> Sweep:
    return Sweep(study="test", records=records, provenance={"aircraft_sha256": "ab"})


def identification_of() -> Identification:
    terms = {(0, 0, 0): 0.1, (1, 0, 0): 1 / 3}
    domain = [(-0.5, 0.5), (-math.inf, math.inf), (-0.2, 0.2)]
    return Identification(
        model=PolynomialModel(
            alpha_dot=Polynomial.build(terms, variables=VARIABLES, value_unit="rad_s", domain=domain),
            q_dot=Polynomial.build(terms, variables=VARIABLES, value_unit="rad_s2", domain=domain),
            covariance=np.eye(4) / 7,
        ),
        options=IdentificationOptions(alpha_window_rad=(-0.5, 0.5)),
        alpha_noise_rad=0.1,
        q_noise_rad_s=0.2,
        segments=(Segment(flight="hold-01", start_s=0.0, end_s=1.0, samples=3),),
        unused=("x: too short",),
        diagnostics=Diagnostics(
            equations=3,
            condition_number=2.0,
            chi_square=(1.0, 1.1),
            lag1_correlation=(0.0, 0.1),
            used_fraction=1.0,
            iterations=2,
        ),
        warnings=(),
    )


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A folder with a study, a sweep and a model."""
    folder = tmp_path / "run of mine"
    folder.mkdir()
    (folder / "study.toml").write_text("schema = 1\n", encoding="utf-8")
    save_sweep(sweep_of(record()), folder)
    save_identification(identification_of(), folder)
    return folder


# values


@dataclass(frozen=True, slots=True, kw_only=True)
class Everything:
    """One field of each type that results are made of."""

    number: float
    count: int
    flag: bool
    text: str
    outcome: Outcome
    row: FloatArray
    grid: FloatArray
    powers: IntArray
    flags: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    pair: tuple[float, float]
    names: tuple[str, ...]
    maneuvers: tuple[Maneuver, ...]


def everything(**fields: object) -> Everything:
    usual = Everything(
        number=0.1,
        count=-3,
        flag=True,
        text="α",
        outcome=Outcome.DIVERGED,
        row=np.array([0.1, math.nan]),
        grid=np.empty((0, 2)),
        powers=np.array([[1, 2], [3, 4]]),
        flags=np.array([True, False]),
        pair=(1.0, -math.inf),
        names=("a", "b"),
        maneuvers=(
            Step(elevator_rad=0.1, amplitude_rad=0.2, lead_s=0.3, duration_s=0.4),
            HoldManeuver(elevator_rad=0.1, duration_s=0.4),
            Release(elevator_rad=0.1, alpha_rad=0.2, q_rad_s=0.3, duration_s=0.4),
        ),
    )
    return replace(usual, **fields)


def through_json(value: Everything) -> Everything:
    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is no JSON")

    return from_tree(json.loads(to_json(to_tree(value)), parse_constant=refuse), Everything)


def test_every_type_comes_back() -> None:
    value = everything()
    back = through_json(value)
    assert (back.number, back.count, back.flag, back.text) == (0.1, -3, True, "α")
    assert type(back.outcome) is Outcome
    assert back.outcome is Outcome.DIVERGED
    assert (back.pair, back.names, back.maneuvers) == (value.pair, value.names, value.maneuvers)
    for name in ("row", "grid", "powers", "flags"):
        before, after = getattr(value, name), getattr(back, name)
        assert (before.dtype, before.shape, before.tobytes()) == (after.dtype, after.shape, after.tobytes()), name
        assert not after.flags.writeable


@given(number=ANY_FLOAT)
def test_a_float_comes_back_bit_for_bit(number: float) -> None:
    back = through_json(everything(number=number)).number
    assert math.isnan(back) if math.isnan(number) else struct.pack("d", back) == struct.pack("d", number)


@given(
    grid=hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=4), elements=ANY_FLOAT)
)
def test_an_array_comes_back_bit_for_bit(grid: FloatArray) -> None:
    back = through_json(everything(grid=grid)).grid
    assert back.shape == grid.shape
    np.testing.assert_array_equal(back, grid)
    np.testing.assert_array_equal(np.signbit(back), np.signbit(np.where(np.isnan(grid), np.abs(grid), grid)))


def test_a_tree_holds_nothing_but_what_json_knows() -> None:
    def check(tree: object) -> None:
        assert type(tree) in {dict, list, tuple, str, float, int, bool}
        for item in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, (list, tuple)) else ():
            check(item)

    check(to_tree(everything(number=np.float64(1.0))))


def test_numpy_scalars_are_written_as_numbers() -> None:
    tree = to_tree(everything(number=np.float64(1 / 3), count=np.int64(3), flag=np.bool_(False)))
    assert json.loads(to_json(tree))["number"] == 1 / 3
    assert (tree["count"], tree["flag"]) == (3, False)


@pytest.mark.parametrize(
    ("key", "wrong", "said"),
    [
        ("number", "0.1", "expected a number, got '0.1' @ $.number"),
        ("number", True, "expected a number, got True @ $.number"),
        ("count", 1.5, "expected int, got 1.5 @ $.count"),
        ("flag", 1, "expected bool, got 1 @ $.flag"),
        ("outcome", "landed", "'landed' is not a valid Outcome @ $.outcome"),
        ("row", "abc", "expected a list of numbers, got 'abc' @ $.row"),
        ("maneuvers", [{"type": "Loop"}], "expected a value whose 'type' is one of Step"),
    ],
)
def test_a_wrong_value_is_named_with_its_place(key: str, wrong: object, said: str) -> None:
    tree = {**to_tree(everything()), key: wrong}
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the text is compared
        from_tree(tree, Everything)
    assert str(caught.value).startswith(said)


# sweeps


@settings(max_examples=30, deadline=None)
@given(
    tables=st.lists(
        st.integers(0, 5).flatmap(
            lambda rows: st.dictionaries(
                st.sampled_from(sorted(set(CHANNELS) - {"time_s"})),
                hnp.arrays(np.float64, rows, elements=ANY_FLOAT),
                min_size=1,
            )
        ),
        max_size=3,
    )
)
def test_a_sweep_comes_back_bit_for_bit(tables: list[dict[str, FloatArray]]) -> None:
    flown = sweep_of(*(record(f"f-{index}", **columns) for index, columns in enumerate(tables)))
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "study.toml").touch()
        save_sweep(flown, Path(folder))
        back = load_sweep(Path(folder))
    assert (back.study, dict(back.provenance)) == (flown.study, dict(flown.provenance))
    for before, after in zip(flown.records, back.records, strict=True):
        assert list(before.columns) == list(after.columns)
        for name, values in before.columns.items():
            assert values.tobytes() == after[name].tobytes(), name
        assert (before.name, before.outcome, before.note, before.hold) == (
            after.name,
            after.outcome,
            after.note,
            after.hold,
        )
        assert before.condition == after.condition
        assert before.schedule.time_s.tobytes() == after.schedule.time_s.tobytes()
        assert before.schedule.elevator_rad.tobytes() == after.schedule.elevator_rad.tobytes()
        assert dict(before.provenance) == dict(after.provenance)


def test_the_table_is_long_form_and_names_its_units(run: Path) -> None:
    schema = pq.read_schema(run / "sweep.parquet")
    assert schema.names == ["flight", "time_s", "alpha_rad", "q_rad_s"]
    units = {name: schema.field(name).metadata[b"unit"].decode() for name in schema.names[1:]}
    assert units == {"time_s": "s", "alpha_rad": "rad", "q_rad_s": "rad_s"}


def test_a_table_of_another_sweep_is_refused(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "study.toml").touch()
    save_sweep(sweep_of(record("other")), other)
    (other / "sweep.parquet").replace(run / "sweep.parquet")
    with pytest.raises(InputError, match=r"sweep\.parquet is not the table that sweep\.json describes"):
        load_sweep(run)
    (run / "sweep.parquet").unlink()
    with pytest.raises(InputError, match=r"sweep\.parquet cannot be read"):
        load_sweep(run)


# files


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt])
def test_a_write_that_is_stopped_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, stop: type[BaseException]
) -> None:
    path = tmp_path / "model.json"
    write_text(path, "old")
    with pytest.raises(stop), replacing(path) as part:  # noqa: PT012 - the block is what is stopped
        part.write_text("half", encoding="utf-8")
        raise stop
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_names_the_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    with pytest.raises(OSError, match="No space") as told, replacing(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert str(told.value) == f"[Errno {errno.ENOSPC}] No space left on device: '{path}'"


def test_a_sweep_that_is_stopped_halfway_is_no_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("finback.store.sweep.write_result", stop)  # after the table, before sweep.json
    with pytest.raises(KeyboardInterrupt):
        save_sweep(sweep_of(record()), tmp_path)
    with pytest.raises(MissingResultError):
        load_sweep(tmp_path)


def test_a_file_says_what_it_is_and_where_it_comes_from(run: Path) -> None:
    tree = json.loads((run / "model.json").read_bytes())
    provenance = tree["provenance"]
    assert tree["schema"] == "finback/model/2"
    assert provenance["inputs"].keys() == {"study.toml", "sweep.json"}
    assert provenance["inputs"]["sweep.json"] == sha256(run / "sweep.json")
    assert provenance["study_sha256"] == sha256(run / "study.toml")
    assert provenance["aircraft_sha256"] == "ab"
    assert provenance["created_at"].endswith("+00:00")


def test_what_is_asked_of_a_model_may_be_written_after_the_flights(run: Path) -> None:
    text = (run / "study.toml").read_text("utf-8")
    write_text(run / "study.toml", f"# later\n{text}\n[validation]\nmine = 1\n")
    load_identification(run)
    write_text(run / "study.toml", f"{text}\n[identification]\nmine = 1\n")
    load_sweep(run)
    with pytest.raises(MissingResultError, match=r"model\.json is stale: study\.toml(.|\n)*finback identify '"):
        load_identification(run)
    write_text(run / "study.toml", f"{text}\n[[flights]]\nmine = 1\n")
    with pytest.raises(MissingResultError, match=r"sweep\.json is stale(.|\n)*finback sweep"):
        load_sweep(run)


def test_a_model_comes_back(run: Path) -> None:
    assert to_tree(load_identification(run)) == to_tree(identification_of())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is damaged"),
        (b"[" * 100_000, "is damaged"),
        (b"\xff", "is damaged"),
        (b"[]", "its schema is None"),
        (b'{"schema": "finback/model/3"}', "its schema is 'finback/model/3', expected 'finback/model/2'"),
        (b'{"schema": "finback/model/2"}', "is damaged"),
        (b'{"schema": "finback/model/2", "provenance": {}, "content": {}}', "is damaged"),
    ],
)
def test_a_damaged_file_is_refused_with_its_path(run: Path, content: bytes, said: str) -> None:
    (run / "model.json").write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_identification(run)
    assert str(run / "model.json") in str(caught.value)
    assert said in str(caught.value)


def test_a_damaged_content_is_named_with_every_place(run: Path) -> None:
    tree = json.loads((run / "model.json").read_bytes())
    tree["content"]["alpha_noise_rad"] = "much"
    del tree["content"]["model"]["covariance"]
    write_text(run / "model.json", json.dumps(tree))
    with pytest.raises(InputError, match=r"missing @ \$\.model\.covariance(.|\n)*got 'much' @ \$\.alpha_noise_rad"):
        load_identification(run)


def edited(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change a result's JSON, as a user with an editor may."""
    tree = json.loads(path.read_bytes())
    change(tree)
    path.write_text(json.dumps(tree), encoding="utf-8")


EDITED_SWEEPS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "negative samples": (lambda flight: flight.update(samples=-3), "its flights have"),
    "more samples": (lambda flight: flight.update(samples=flight["samples"] + 3), "the table has 6 rows"),
    "unknown column": (lambda flight: flight.update(columns=["time_s", "beta_rad"]), "beta_rad, in the table time_s"),
    "column of another flight": (lambda flight: flight["columns"].append("theta_rad"), "has the columns"),
    "column left out": (lambda flight: flight["columns"].remove("q_rad_s"), "has the columns"),
    "the table's own column": (lambda flight: flight["columns"].append("flight"), "has the columns"),
    "another name": (lambda flight: flight.update(name="mine"), "the rows of flight 'mine' are of another one"),
    "the other's name": (lambda flight: flight.update(name="b"), "the rows of flight 'b' are of another one"),
}


@pytest.mark.parametrize(("change", "said"), EDITED_SWEEPS.values(), ids=EDITED_SWEEPS.keys())
def test_an_edited_sweep_is_refused_with_its_path(
    run: Path, change: Callable[[dict[str, Any]], object], said: str
) -> None:
    save_sweep(sweep_of(record("a"), record("b", theta_rad=np.ones(3))), run)
    edited(run / "sweep.json", lambda tree: change(tree["content"]["flights"][0]))
    with pytest.raises(InputError) as caught:
        load_sweep(run)
    assert f"{run / 'sweep.json'} is damaged" in caught.value.message
    assert said in caught.value.message
    assert caught.value.hint.startswith("fly again with: finback sweep '")


@pytest.mark.parametrize("value", ["nan", -1e6])
def test_an_edited_covariance_is_refused_with_its_path(run: Path, value: object) -> None:
    def spoil(tree: dict[str, Any]) -> None:
        tree["content"]["model"]["covariance"][0][0] = value

    edited(run / "model.json", spoil)
    with pytest.raises(
        InputError, match=r"model\.json is damaged:(.|\n)*covariance(.|\n)*finback identify '"
    ) as caught:
        load_identification(run)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(("file", "verb"), [("model.json", "identify"), ("sweep.json", "sweep")])
def test_a_result_that_does_not_say_what_it_was_made_from_is_refused(run: Path, file: str, verb: str) -> None:
    edited(run / file, lambda tree: tree["provenance"].update(inputs={}))
    with pytest.raises(InputError, match=rf"provenance names the inputs \[\](.|\n)*finback {verb} '"):
        load_identification(run)


def test_a_result_is_not_written_without_what_it_is_made_from(tmp_path: Path) -> None:
    with pytest.raises(MissingResultError, match=r"sweep\.json cannot be written: study\.toml"):
        save_sweep(sweep_of(record()), tmp_path)
    write_text(tmp_path / "study.toml", "")
    with pytest.raises(MissingResultError, match=r"model\.json cannot be written: sweep\.json"):
        save_identification(identification_of(), tmp_path)


# what is missing or stale


def test_a_missing_result_names_the_command_that_makes_it(run: Path) -> None:
    with pytest.raises(
        MissingResultError, match=r"analysis\.json is missing\n  make it with: finback analyze '.*mine'"
    ):
        load_analysis(run)
    with pytest.raises(MissingResultError, match=r"analysis\.json is missing\n  make it with: finback analyze"):
        load_validation(run)  # the first that is missing is what to make
    with pytest.raises(MissingResultError, match=r"there is no run .*elsewhere\n  make one with: finback run STUDY"):
        load_sweep(run / "elsewhere")


def test_a_stale_result_names_the_command_that_renews_it(run: Path) -> None:
    save_sweep(sweep_of(record("another")), run)
    with pytest.raises(
        MissingResultError, match=r"model\.json is stale: sweep\.json has changed(.|\n)*finback identify"
    ):
        load_identification(run)
    save_identification(identification_of(), run)
    load_identification(run)


def test_what_is_stale_far_back_is_found(run: Path) -> None:
    (run / "study.toml").write_text("schema = 2\n", encoding="utf-8")
    with pytest.raises(MissingResultError, match=r"sweep\.json is stale: study\.toml has changed(.|\n)*finback sweep"):
        load_identification(run)


def test_a_sweep_is_renewed_from_the_study_that_it_was_flown_from(run: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.touch()
    save_sweep(replace(sweep_of(record()), provenance={"study_path": str(mine)}), run)
    (run / "sweep.parquet").unlink()
    with pytest.raises(InputError, match=rf"finback sweep {mine}$"):
        load_sweep(run)
    mine.unlink()
    with pytest.raises(InputError, match=r"finback sweep '.*mine/study\.toml'$"):
        load_sweep(run)
    edited(run / "sweep.json", lambda tree: tree["content"]["provenance"].update(study_path="a\0b"))
    with pytest.raises(InputError, match=r"finback sweep '.*mine/study\.toml'$"):
        load_sweep(run)


def test_recorded_flights_are_prepared_again_from_their_tables_and_map(run: Path, tmp_path: Path) -> None:
    mapped = tmp_path / "map.toml"
    mapped.touch()
    tables = [str(tmp_path / name) for name in ("first.csv", "on the second.csv")]
    flights = tuple(replace(record(name), provenance={"file": name}) for name in tables)
    told = {"origin": "recorded", "study_path": str(mapped), "options": "--correct"}
    save_sweep(replace(sweep_of(*flights), provenance=told), run)
    (run / "study.toml").write_text("schema = 2\n", encoding="utf-8")
    with pytest.raises(MissingResultError, match=r"study\.toml has changed") as refused:
        load_sweep(run)
    assert refused.value.hint == f"renew it with: finback prepare {tables[0]} '{tables[1]}' --map {mapped} --correct"
    edited(run / "sweep.json", lambda tree: tree["content"].update(flights=0))
    mapped.unlink()
    with pytest.raises(MissingResultError, match=r"finback prepare FLIGHT... --map '.*mine/study\.toml' --correct$"):
        load_sweep(run)


def test_a_result_whose_input_is_gone_is_stale(run: Path) -> None:
    (run / "sweep.json").unlink()
    with pytest.raises(MissingResultError, match=r"sweep\.json is missing"):
        load_identification(run)

"""A first flight in a child process is made once of the same files, and again of others."""

from __future__ import annotations

from pathlib import Path

import pytest

from finback.flight import trial

START = {"ic/h-sl-ft": 10000.0, "ic/u-fps": 300.0}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Every request that reached a child."""
    seen: list[str] = []
    monkeypatch.setattr(trial, "_passed", type(trial._passed)())

    def child(_: object, request: str, *, timeout_s: float) -> trial.Trial:
        assert timeout_s > 0
        seen.append(request)
        return trial.Trial(faults=("broken",) if "broken" in request else (), values={})

    monkeypatch.setattr(trial, "run_child", child)
    return seen


def model(folder: Path, text: str = "<fdm_config/>", name: str = "any.xml") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(text)
    return path


def test_the_same_files_are_tried_once_wherever_they_lie(asked: list[str], tmp_path: Path) -> None:
    one, two = (model(tmp_path / root / "aircraft" / "any") for root in ("a", "b"))
    assert trial.fly_trial(one, initial=START) == trial.fly_trial(two, initial=START)
    assert len(asked) == 1


@pytest.mark.parametrize(
    "where", ["aircraft/any/any.xml", "aircraft/any/tables/x.xml", "engine/e.xml", "systems/s.xml"]
)
def test_what_has_changed_is_tried_again(asked: list[str], tmp_path: Path, where: str) -> None:
    path = model(tmp_path / "aircraft" / "any")
    model((tmp_path / where).parent, "<old/>" if "any.xml" not in where else "<fdm_config/>", Path(where).name)
    trial.fly_trial(path, initial=START)
    (tmp_path / where).write_text("<new/>")
    trial.fly_trial(path, initial=START)
    assert len(asked) == 2


def test_so_is_what_lies_behind_the_links_of_a_copy(asked: list[str], tmp_path: Path) -> None:
    path = model(tmp_path / "copy" / "aircraft" / "any")
    table = model(tmp_path / "original" / "tables", "<old/>")
    (path.parent / "tables").symlink_to(table.parent)
    (path.parent / "round").symlink_to(path.parent)  # must not lead round for ever
    (path.parent / "nowhere.xml").symlink_to(tmp_path / "nowhere.xml")
    trial.fly_trial(path, initial=START)
    table.write_text("<new/>")
    trial.fly_trial(path, initial=START)
    assert len(asked) == 2


@pytest.mark.parametrize("other", [{"initial": {}}, {"read": ("a/b",)}, {"density_slug_ft3": 1.0}])
def test_another_question_is_asked(asked: list[str], tmp_path: Path, other: dict[str, object]) -> None:
    path = model(tmp_path / "any")
    trial.fly_trial(path, initial=START)
    trial.fly_trial(path, **{"initial": START, **other})  # type: ignore[arg-type] # as in the list
    assert len(asked) == 2


def test_a_fault_is_not_remembered(asked: list[str], tmp_path: Path) -> None:
    path = model(tmp_path / "any", name="broken.xml")
    for _ in range(2):
        assert trial.fly_trial(path, initial=START).faults == ("broken",)
    assert len(asked) == 2

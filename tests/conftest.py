"""One small real run of the whole chain, shared by every test that needs a finished one."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
AIRCRAFT = TESTS.parent / "aircraft" / "f8ii"


@pytest.fixture(scope="session")
def small_study_text() -> str:
    """The text of a small study that names its aircraft by path, so that it may stand anywhere."""
    text = (TESTS / "small_study.toml").read_text(encoding="utf-8")
    return text.replace('aircraft = "f8ii"', f'aircraft = "{AIRCRAFT}"')


@pytest.fixture
def small_study(small_study_text: str, tmp_path: Path) -> Path:
    """That study as a file."""
    path = tmp_path / "study.toml"
    path.write_text(small_study_text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def finished_run(small_study_text: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished run of the small study. Tests must not write to it."""
    from finback import pipeline

    folder = tmp_path_factory.mktemp("finished")
    study = folder / "study.toml"
    study.write_text(small_study_text, encoding="utf-8")
    return pipeline.run(study, output=folder).folder


@pytest.fixture
def own_run(finished_run: Path, tmp_path: Path) -> Path:
    """A copy of that run, below ``tmp_path/logs``, for tests that write."""
    folder = tmp_path / "logs" / finished_run.parent.name / finished_run.name
    shutil.copytree(finished_run, folder)
    return folder

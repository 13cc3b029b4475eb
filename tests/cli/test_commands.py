"""The program as a user meets it, judged by exit code, stdout and stderr.

It is started as a process where the process itself is the point (streams, signals, imports, one whole run): that costs
seconds. Elsewhere the same application answers within this one.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from finback.cli.application import app

PROGRAM = [sys.executable, "-m", "finback.cli"]
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "error"}
PUBLISHED = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"
PRINTING = ["analyze {run} --quiet", "export {model} --to latex"]  # a table for a person, and plain text
PATIENCE_S = 120.0  # for a program that hangs; no measure of speed


def started(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=PATIENCE_S,
        check=False,
        env=ENVIRONMENT,
    )


def finback(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)])


def is_clean(done: Result) -> bool:
    """Tell whether an error is a message and no more: nothing on stdout, no traceback."""
    return not done.stdout and "Traceback" not in done.stderr and done.stderr.startswith("finback: ")


# what is said at once


def test_help_names_every_verb_and_imports_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from finback.cli.main import main\n"
        "sys.argv = ['finback', '--help']\n"
        "try: main()\n"
        "finally: print(' '.join(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    for verb in ("run", "sweep", "identify", "analyze", "validate", "report", "replay", "check"):
        assert re.search(rf"\b{verb}\b", done.stdout), verb
    heavy = {"numpy", "scipy", "pandas", "matplotlib", "rerun", "jsbsim", "pyarrow", "pydantic", "cattrs", "jinja2"}
    assert not heavy & set(done.stderr.split())


def test_version() -> None:
    done = started("--version")
    assert (done.returncode, done.stdout.split()[0]) == (0, "finback")


@pytest.mark.parametrize("arguments", [("fly",), ("run",), ("run", "a.toml", "--fast"), ("identify", "a", "b")])
def test_a_wrong_call_is_2_and_says_so_on_stderr(arguments: tuple[str, ...]) -> None:
    done = finback(*arguments)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "Usage" in done.stderr


def test_a_process_says_what_the_application_says(tmp_path: Path) -> None:
    arguments = ("run", tmp_path / "no.toml")
    process, done = started(*arguments), finback(*arguments)
    assert (process.returncode, process.stdout, process.stderr) == (done.exit_code, done.stdout, done.stderr)
    assert done.exit_code == 2


# what the user can mend


def test_a_typo_in_a_study(small_study: Path, tmp_path: Path) -> None:
    text = small_study.read_text(encoding="utf-8").replace("seed", "sed").replace("hold_s", "hld_s")
    small_study.write_text(text, encoding="utf-8")
    done = finback("run", small_study, "--output", tmp_path)
    assert done.exit_code == 2
    assert is_clean(done)
    for fault in ("seed: missing", "sed: unknown key; did you mean 'seed'?", "validation.fold.hold_s: missing"):
        assert fault in done.stderr
    assert not (tmp_path / "logs").exists()


def test_a_missing_aircraft(small_study: Path, tmp_path: Path) -> None:
    text = re.sub('aircraft = ".*"', 'aircraft = "f8iii"', small_study.read_text(encoding="utf-8"))
    small_study.write_text(text, encoding="utf-8")
    done = finback("sweep", small_study, "--output", tmp_path)
    assert done.exit_code == 2
    assert is_clean(done)
    assert "aircraft: " in done.stderr
    assert "f8iii" in done.stderr


def test_a_missing_study(tmp_path: Path) -> None:
    done = finback("run", tmp_path / "no.toml")
    assert done.exit_code == 2
    assert is_clean(done)
    assert "not found" in done.stderr


def test_a_missing_result_names_the_command_that_makes_it(own_run: Path) -> None:
    (own_run / "model.json").unlink()
    done = finback("analyze", own_run)
    assert done.exit_code == 2
    assert is_clean(done)
    assert f"{own_run / 'model.json'} is missing" in done.stderr
    assert f"finback identify {own_run}\n" in done.stderr


def test_no_run_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = finback("identify")
    assert done.exit_code == 2
    assert is_clean(done)
    assert "finback run STUDY" in done.stderr


def test_an_output_that_cannot_be_written(small_study: Path, tmp_path: Path) -> None:
    output = tmp_path / "taken"
    output.touch()
    done = finback("run", small_study, "--output", output)
    assert done.exit_code == 2
    assert is_clean(done)
    assert str(output) in done.stderr


def test_check_reports_every_fault_and_flies_nothing(small_study: Path, tmp_path: Path) -> None:
    done = finback("check", small_study, "--quiet")
    assert (done.exit_code, done.stderr) == (0, "")
    small_study.write_text(small_study.read_text(encoding="utf-8").replace("seed = 7", ""), encoding="utf-8")
    done = finback("check", small_study, "--model", tmp_path, "--json", "--quiet")
    assert (done.exit_code, done.stderr) == (2, "")
    document = json.loads(done.stdout)
    assert document["schema"] == "finback/check/1"
    faults = document["faults"]
    assert len(faults) == 2
    assert "seed: missing" in faults[0]
    assert "model.json" in faults[1]


def test_replay_of_an_unknown_flight_names_the_others(finished_run: Path) -> None:
    done = finback("replay", "loop-01", finished_run)
    assert done.exit_code == 2
    assert is_clean(done)
    assert "release-01" in done.stderr


# results


@pytest.mark.parametrize(("verb", "key"), [("identify", "coefficients"), ("analyze", "located")])
def test_a_stage_works_on_the_newest_run_and_says_only_json(
    own_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verb: str, key: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = finback(verb, "--json")
    document = json.loads(done.stdout)
    assert (done.exit_code, tmp_path / document["run"]) == (0, own_run)
    assert key in document
    begun, *warnings = done.stderr.splitlines()
    assert begun == f"finback: {verb}"
    assert all(line.startswith("finback: warning: ") for line in warnings)


def test_a_run_from_the_command_line(small_study: Path, tmp_path: Path) -> None:
    process = started("run", small_study, "--output", tmp_path / "with space", "--json", "--quiet")
    assert process.returncode == 0
    assert all(line.startswith("finback: warning: ") for line in process.stderr.splitlines()), process.stderr
    document = json.loads(process.stdout)
    assert document["verdict"] == "agrees"
    assert all(Path(path).is_file() for path in (document["report"], *document["recordings"]))
    assert {metric["judgement"] for metric in document["metrics"]} == {"agrees"}
    done = finback("validate", document["run"])
    lines = done.stdout.splitlines()
    assert (done.exit_code, lines[0].split()[:2]) == (0, ["verdict", "AGREES"])
    assert done.stderr == "finback: validate\n"


def test_a_model_that_disagrees_is_1(own_run: Path) -> None:
    from dataclasses import replace

    from finback.dynamics.analysis import analyze
    from finback.store import load_analysis, save_analysis

    analysis = load_analysis(own_run)
    wrong = replace(analysis.system, elevator_gain=-analysis.system.elevator_gain)
    save_analysis(analyze(wrong, analysis.options), own_run)
    done = finback("validate", own_run, "--quiet")
    assert (done.exit_code, done.stderr) == (1, "")
    assert done.stdout.startswith("verdict  DISAGREES")


@pytest.mark.parametrize("words", PRINTING)
def test_nobody_reads_the_output(own_run: Path, words: str) -> None:
    program = subprocess.Popen(
        [*PROGRAM, *words.format(run=own_run, model=PUBLISHED).split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=ENVIRONMENT,
    )
    assert program.stdout is not None
    program.stdout.close()
    assert program.stderr is not None
    said = program.stderr.read()
    program.stderr.close()
    assert (program.wait(PATIENCE_S), said) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("words", PRINTING)
def test_a_full_standard_output_is_named(own_run: Path, words: str) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*PROGRAM, *words.format(run=own_run, model=PUBLISHED).split()],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=PATIENCE_S,
            check=False,
            env=ENVIRONMENT,
        )
    assert (done.returncode, done.stderr) == (2, "finback: standard output: No space left on device\n")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell that closes streams")
@pytest.mark.parametrize("closed", [">&- 2>&- <&-"])
def test_closed_streams_hinder_nothing(own_run: Path, closed: str) -> None:
    (own_run / "analysis.json").unlink()
    command = f"{shlex.join([*PROGRAM, 'analyze', str(own_run), '--quiet'])} {closed}"
    done = subprocess.run(
        ["/bin/sh", "-c", command], capture_output=True, text=True, timeout=PATIENCE_S, check=False, env=ENVIRONMENT
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    json.loads((own_run / "analysis.json").read_text(encoding="utf-8"))


# Ctrl-C


def wait_until_it_listens(process: int) -> None:
    """Wait until a process has a handler for SIGTERM, which Python itself never sets."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
        caught = int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16)  # type: ignore[index]
        if caught >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.005)
    raise TimeoutError("the program never listened")


def is_gone(group: int) -> bool:
    """Tell whether no process of a group is left; one that was killed may take a moment to go."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc; the program itself is the same elsewhere")
@pytest.mark.parametrize(
    ("stage", "number"),
    [
        ("", signal.SIGINT),
        ("sweep", signal.SIGINT),
        pytest.param("validate", signal.SIGINT, marks=pytest.mark.slow),  # seconds until the stage is reached
        ("sweep", signal.SIGHUP),
    ],
)
def test_a_signal_is_its_code_one_line_and_nothing_half_written(
    small_study: Path, tmp_path: Path, stage: str, number: signal.Signals
) -> None:
    output, temporary = tmp_path / "output", tmp_path / "temporary"
    temporary.mkdir()
    with subprocess.Popen(
        [*PROGRAM, "run", str(small_study), "--output", str(output)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**ENVIRONMENT, "TMPDIR": str(temporary)},
    ) as program:
        assert program.stderr is not None
        said = []
        if stage:
            for line in program.stderr:
                said.append(line)
                if line.startswith(f"finback: {stage}"):
                    break
        else:
            wait_until_it_listens(program.pid)  # it imports now
        os.killpg(program.pid, number)
        out, rest = program.communicate(timeout=PATIENCE_S)
    assert (program.returncode, out) == (128 + number, "")
    assert "".join([*said, rest]).splitlines()[-1] == "finback: interrupted; nothing is half-written"
    assert "Traceback" not in rest
    left = {path.name for path in output.rglob("*") if path.is_file() and path.suffix != ".rrd"}
    assert left == (
        {"study.toml", "sweep.json", "sweep.parquet", "model.json", "analysis.json"} if stage == "validate" else set()
    )
    # The interpreter itself can be interrupted between making a temporary folder and remembering to remove it.
    assert [path for path in temporary.rglob("*") if path.is_file()] == []
    assert is_gone(program.pid)

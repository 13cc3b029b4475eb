"""Accuracy and honesty of Finback's estimators beside pysindy and aeroid, on the same flights, in one run.

3-2-1-1 maneuvers of the F-8 II model as in ``judged_identification.py``: three, and one. Each seed of the noise is
written once and given to all. pysindy and aeroid live in a venv of their own: --python names its interpreter. aeroid
fits one record only: it gets the first, and begins at ordinary least squares of all. Printed: median and worst error of
the 12 explicit coefficients (median over the seeds), spurious and missing terms (of any seed), the free run of a flight
that nobody has seen, the root mean square of error / stated standard error (1 is honest), seconds of one core.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import judged_identification as judged
import numpy as np
from judged_row import page
from study_selection import CUBIC

from finback.arrays import FloatArray
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import RefusedError
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.selection.options import SelectionOptions
from finback.records import FlightRecord, Sweep
from finback.store.model_file import read_model_file
from finback.units import from_si, to_si

ROOT: Final = Path(__file__).resolve().parent
DOCUMENT: Final = ROOT.parent / "docs/benchmarks.md"
RIVALS: Final = ROOT / "bench_identification_rivals.py"
SETS: Final = {"three maneuvers": judged.THREE, "one maneuver": ((judged.ONE[0], judged.ONE_AMPLITUDE),)}
NOISES: Final = ((0.0, 0.0), *judged.NOISES)
COLUMNS: Final = "median % | worst % | spurious | missing | hold-out α ° | q °/s | rms z | s"
REMARK: Final = """\
aeroid is fitted to the first seed only; without noise one seed is enough. Where noise hides terms, a selection leaves
them out, and the stated errors of the others do not know of that (rms z above 1): let it find terms from flights that
reach as far as the model shall."""
RATES: Final = ("alpha_dot", "q_dot")

Fit = dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What one competitor gave on all seeds: coefficients and errors in degrees and seconds, seconds of one core."""

    name: str
    outcomes: Sequence[tuple[Fit, Fit]]
    seconds: Sequence[float]


def in_degrees(model: PolynomialModel, errors: FloatArray) -> tuple[Fit, Fit]:
    """Return rate and exponents of (alpha, q, elevator) -> coefficient, and its error, in degrees and seconds."""
    fit: Fit = {}
    known: Fit = {}
    split = model.alpha_dot.coefficients.size
    for rate, polynomial, own in zip(RATES, (model.alpha_dot, model.q_dot), np.split(errors, [split]), strict=True):
        for powers, value, error in zip(polynomial.powers.tolist(), polynomial.coefficients, own, strict=True):
            scale = float(from_si(1.0, "deg")) * float(to_si(1.0, "deg")) ** sum(powers)
            name = f"{rate} {' '.join(map(str, powers))}"
            fit[name], known[name] = scale * float(value), scale * float(error)
    return fit, known


def in_si(fit: Fit) -> PolynomialModel:
    """Return the model of coefficients in degrees and seconds, without errors."""
    names = tuple(name.replace("rad", "deg") for name in VARIABLES)
    halves = [
        Polynomial.build(
            {tuple(map(int, key.split()[1:])): value for key, value in fit.items() if key.split()[0] == rate},
            variables=names,
            value_unit=unit,
        ).to_si()
        for rate, unit in zip(RATES, ("deg_s", "deg_s2"), strict=True)
    ]
    size = sum(half.coefficients.size for half in halves)
    return PolynomialModel(alpha_dot=halves[0], q_dot=halves[1], covariance=np.zeros((size, size)))


def line(result: Result, truth: Fit, holdout: FlightRecord) -> str:
    """Return the row of one competitor."""
    if not result.outcomes:
        return f"| {result.name} | refused | | | | | | | |"
    fits = [fit for fit, _ in result.outcomes]
    off = np.array([[fit.get(key, 0.0) / value - 1.0 for key, value in truth.items()] for fit in fits])
    percent = 100 * np.median(np.abs(off), axis=0)
    spurious = max(sum(key not in truth and value != 0.0 for key, value in fit.items()) for fit in fits)
    missing = max(sum(fit.get(key, 0.0) == 0.0 for key in truth) for fit in fits)
    missed = np.array([judged.free_run_error(in_si(fit), holdout) for fit in fits])
    alpha, q = (_number(float(value)) for value in np.median(missed, axis=0))
    z = [
        (fit[key] - value) / errors[key]
        for fit, errors in result.outcomes
        for key, value in truth.items()
        if errors.get(key, 0.0) > 0.0
    ]
    cells = [
        _number(float(np.median(percent))),
        _number(float(percent.max())),
        str(spurious),
        str(missing),
        alpha,
        q,
        _number(float(np.sqrt(np.mean(np.square(z))))) if z else "none stated",
        _number(float(np.median(result.seconds))),
    ]
    return f"| {result.name} | {' | '.join(cells)} |"


def _number(value: float) -> str:
    return f"{value:.2g}" if abs(value) < 100 else f"{value:.3g}" if math.isfinite(value) else "diverges"


def ours(sweeps: Sequence[Sweep]) -> list[Result]:
    """Fit with every method of Finback, and with terms that it finds itself."""
    low, high = (to_si(value, "deg") for value in judged.WINDOW_DEG)
    plain = [IdentificationOptions(alpha_window_rad=(low, high), method=method) for method in Method]
    library = (SelectionOptions(library=CUBIC, bootstraps=0),)
    found = replace(plain[list(Method).index(Method.OUTPUT_ERROR)], selection=library)
    results = []
    for name, options in (
        *((f"finback, {one.method}, true terms", one) for one in plain),
        ("finback, finds terms", found),
    ):
        outcomes, seconds = [], []
        for sweep in (sweeps[0], *sweeps):  # the first one compiles, and does not count
            start = time.process_time()
            try:
                result = identify(sweep, options)
            except RefusedError:
                continue
            seconds.append(time.process_time() - start)
            outcomes.append(in_degrees(result.model, result.standard_errors))
        results.append(Result(name=f"**{name}**", outcomes=outcomes[1:], seconds=seconds[1:]))
    return results


def rivals(sweeps: Sequence[Sweep], python: str) -> list[Result]:
    """Hand the same noisy flights to pysindy and aeroid."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "flights.npz"
        columns = ("alpha_rad", "q_rad_s", "elevator_rad")
        flights = [[[from_si(record[name], "deg") for name in columns] for record in sweep.records] for sweep in sweeps]
        np.savez(data, time_s=sweeps[0].records[0]["time_s"], flights_deg=np.array(flights))
        command = [python, str(RIVALS), str(data)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - the user's own python
    if done.returncode:
        raise SystemExit(f"pysindy and aeroid did not run in {python}:\n{done.stderr.strip()[-2000:]}")
    return [
        Result(name=name, outcomes=[(fit, errors) for fit, errors in one["outcomes"]], seconds=one["seconds"])
        for name, one in json.loads(done.stdout.splitlines()[-1]).items()
    ]


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, metavar="N", help="noise seeds (10)")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has pysindy and aeroid")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/benchmarks.md")
    arguments = parser.parse_args()
    model = read_model_file(judged.PUBLISHED).model()
    truth, _ = in_degrees(model, np.zeros(model.coefficients.size))
    (holdout,) = judged.flown((judged.HOLDOUT,), judged.DOUBLET)
    parts = []
    for title, trims in SETS.items():
        for alpha, q in NOISES:
            deviations = np.array([to_si(alpha, "deg"), to_si(q, "deg_s")])
            seeds = range(arguments.seeds if alpha else 1)
            sweeps = [judged.noisy(judged.flown(trims, judged.PATTERN), deviations, seed) for seed in seeds]
            results = [*ours(sweeps), *rivals(sweeps, arguments.python)]
            rows = "\n".join(line(result, truth, holdout) for result in results)
            parts.append(f"| {title}, {alpha}°, {q}°/s | {COLUMNS} |\n|---|{'--:|' * 8}\n{rows}")
            print(parts[-1], end="\n\n", flush=True)
    if arguments.write:
        said = " ".join((__doc__ or "").split("Printed: ")[1].split())
        head = (
            "## Identification, beside pysindy 2.1.0 and aeroid 0.5.0\n\n`scripts/bench-identification --write`: "
            f"{arguments.seeds} seeds. In the columns: {said}"
        )
        page(DOCUMENT, "identification", "\n\n".join([head, *parts, REMARK]))
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Accuracy and time of Finback's estimators beside pysindy and aeroid, on the same flights, in one run.

Three 3-2-1-1 maneuvers of the F-8 II model as in ``judged_identification.py``; each seed of the noise is written once
and given to all. pysindy and aeroid may live in a venv of their own: --python names its interpreter. aeroid fits one
record only: it gets the first, from the estimate of ordinary least squares; pysindy gets all three. Printed: median
and worst error of the 12 explicit coefficients (median over the seeds), spurious and missing terms, seconds of a fit.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import judged_identification as judged
import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.errors import RefusedError
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.records import Sweep
from finback.store.model_file import read_model_file
from finback.units import from_si, to_si

RIVALS = Path(__file__).resolve().parent / "bench_identification_rivals.py"


def in_degrees(model: PolynomialModel) -> dict[str, float]:
    """Return rate and exponents of (alpha, q, elevator) -> coefficient in degrees and seconds."""
    found = {}
    for rate, polynomial in (("alpha_dot", model.alpha_dot), ("q_dot", model.q_dot)):
        for powers, value in zip(polynomial.powers.tolist(), polynomial.coefficients.tolist(), strict=True):
            key = f"{rate} {' '.join(map(str, powers))}"
            found[key] = float(from_si(value, "deg")) * float(to_si(1.0, "deg")) ** sum(powers)
    return found


def errors(truth: dict[str, float], fits: list[dict[str, float]]) -> tuple[float, float, int, int]:
    """Return median and worst coefficient error in %, and the largest numbers of spurious and missing terms."""
    table = np.array([[abs(fit.get(key, 0.0) / value - 1.0) for key, value in truth.items()] for fit in fits])
    percent: FloatArray = 100 * np.median(table, axis=0)
    spurious = max(sum(key not in truth and value != 0.0 for key, value in fit.items()) for fit in fits)
    missing = max(sum(fit.get(key, 0.0) == 0.0 for key in truth) for fit in fits)
    return float(np.median(percent)), float(percent.max()), spurious, missing


def line(name: str, truth: dict[str, float], fits: list[dict[str, float]], seconds: list[float]) -> None:
    """Print one competitor."""
    if not fits:
        print(f"  {name:<44} refused or failed in every seed")
        return
    median, worst, spurious, missing = errors(truth, fits)
    print(
        f"  {name:<44}{median:>9.3f}{worst:>11.2f}{spurious:>10}{missing:>9}{np.median(seconds):>10.3f}   "
        f"({len(fits)} seeds)"
    )


def ours(sweeps: list[Sweep], truth: dict[str, float]) -> None:
    """Fit with every method of Finback."""
    low, high = (to_si(value, "deg") for value in judged.WINDOW_DEG)
    for method in Method:
        options = IdentificationOptions(alpha_window_rad=(low, high), method=method)
        identify(sweeps[0], options)  # compiles
        fits, seconds = [], []
        for sweep in sweeps:
            start = time.perf_counter()
            try:
                fits.append(in_degrees(identify(sweep, options).model))
            except RefusedError:
                continue
            seconds.append(time.perf_counter() - start)
        line(f"finback {method}", truth, fits, seconds)


def rivals(sweeps: list[Sweep], truth: dict[str, float], python: str) -> None:
    """Hand the same noisy flights to pysindy and aeroid."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "flights.npz"
        columns = ("alpha_rad", "q_rad_s", "elevator_rad")
        flights = [[[from_si(record[name], "deg") for name in columns] for record in sweep.records] for sweep in sweeps]
        np.savez(data, time_s=sweeps[0].records[0]["time_s"], flights_deg=np.array(flights))
        command = [python, str(RIVALS), str(data)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - the user's own python
    if done.returncode:
        print(f"  pysindy and aeroid did not run in {python}:\n{done.stderr.strip()[-2000:]}")
        return
    for name, result in json.loads(done.stdout.splitlines()[-1]).items():
        line(name, truth, result["fits"], result["seconds"])


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="noise seeds (5)")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has pysindy and aeroid")
    arguments = parser.parse_args()
    model = read_model_file(judged.PUBLISHED).model()
    truth = in_degrees(model)
    flown = tuple(judged.fly(model, at, judged.PATTERN, judged.UNIT_S) for at in judged.THREE)
    for alpha, q in judged.NOISES:
        noise = np.array([to_si(alpha, "deg"), to_si(q, "deg_s")])
        sweeps = [judged.noisy(flown, noise, seed) for seed in range(arguments.seeds)]
        print(f"noise {alpha} deg, {q} deg/s")
        print(f"  {'':<44}{'median %':>9}{'worst %':>11}{'spurious':>10}{'missing':>9}{'seconds':>10}")
        ours(sweeps, truth)
        rivals(sweeps, truth, arguments.python)
    return 0


if __name__ == "__main__":
    sys.exit(main())

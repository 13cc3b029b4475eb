"""pysindy and aeroid on flights written by ``bench_identification.py``: prints one line of JSON.

Everything in degrees and seconds, as both packages are usually shown. Runs in any interpreter that has both packages.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Flights = NDArray[np.float64]
"""Flights of one seed: (flight, channel, sample), channels alpha, q and elevator in degrees."""
Fit = dict[str, float]

TRUE = [(0, 0, 0), (0, 1, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (0, 0, 1)]


def key(rate: str, powers: tuple[int, ...]) -> str:
    """Name a coefficient."""
    return f"{rate} {' '.join(map(str, powers))}"


def ordinary(time_s: Flights, flights: Flights) -> Fit:
    """Return the estimate of ordinary least squares on central differences, true terms given."""
    rows, targets = [], []
    for alpha, q, elevator in flights:
        rows.append(np.stack([alpha**a * q**b * elevator**c for a, b, c in TRUE], axis=1))
        targets.append(np.stack([np.gradient(alpha, time_s), np.gradient(q, time_s)], axis=1))
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=None)[0]
    return {
        key(rate, p): float(found[i, k]) for k, rate in enumerate(("alpha_dot", "q_dot")) for i, p in enumerate(TRUE)
    }


def sindy(
    time_s: Flights, flights: Flights, differentiation: Callable[[Any], Any], optimizer: Callable[[Any], Any]
) -> Fit:
    """Fit a cubic library to all flights."""
    pysindy = import_module("pysindy")
    model = pysindy.SINDy(
        differentiation_method=differentiation(pysindy),
        optimizer=optimizer(pysindy),
        feature_library=pysindy.PolynomialLibrary(degree=3),
    )
    states = [np.column_stack(flight[:2]) for flight in flights]
    model.fit(states, t=time_s, u=[np.asarray(flight[2])[:, np.newaxis] for flight in flights])
    powers = model.feature_library.powers_
    found = model.coefficients()
    return {
        key(rate, tuple(int(n) for n in row)): float(found[k, i])
        for k, rate in enumerate(("alpha_dot", "q_dot"))
        for i, row in enumerate(powers)
    }


def output_error(time_s: Flights, flight: Flights, guess: Fit) -> Fit:
    """Fit the true terms to one record with aeroid's defaults, its initial state taken from the data."""
    aeroid = import_module("aeroid")
    names = [f"{rate}_{i}" for rate in ("a", "q") for i in range(len(TRUE))]
    start = dict(zip(names, guess.values(), strict=True))

    def dynamics(_t: float, x: Sequence[float], u: Sequence[float], p: Fit) -> list[float]:
        terms = [x[0] ** a * x[1] ** b * u[0] ** c for a, b, c in TRUE]
        return [sum(p[f"{rate}_{i}"] * term for i, term in enumerate(terms)) for rate in ("a", "q")]

    model = aeroid.Model(states=("alpha", "q"), controls=("elevator",), parameters=start, dynamics=dynamics)
    data = aeroid.FlightData(time=time_s, channels=dict(zip(("alpha", "q", "elevator"), flight, strict=True)))
    found = aeroid.identify(model, data, names).parameters
    labels = [key(rate, p) for rate in ("alpha_dot", "q_dot") for p in TRUE]
    return {label: float(found[name]) for label, name in zip(labels, names, strict=True)}


def main() -> None:
    """Run every competitor over every seed."""
    warnings.simplefilter("ignore")
    with np.load(sys.argv[1]) as data:
        time_s, seeds = data["time_s"], data["flights_deg"]
    entries: dict[str, Callable[[Flights], Fit]] = {
        "ordinary least squares, true terms": lambda f: ordinary(time_s, f),
        "pysindy default, cubic library": lambda f: sindy(
            time_s, f, lambda p: p.FiniteDifference(), lambda p: p.STLSQ(threshold=0.1)
        ),
        "pysindy smoothed, threshold 3e-4, alpha 0": lambda f: sindy(
            time_s, f, lambda p: p.SmoothedFiniteDifference(), lambda p: p.STLSQ(threshold=3e-4, alpha=0.0)
        ),
        "aeroid output error (one record)": lambda f: output_error(time_s, f[0], ordinary(time_s, f)),
    }
    results = {}
    for name, fit in entries.items():
        fits, seconds = [], []
        for flights in seeds[:1] if name.startswith("aeroid") else seeds:
            start = time.perf_counter()
            try:
                fits.append(fit(flights))
            except Exception as error:  # noqa: BLE001 - whatever a rival raises is its result
                print(f"{name}: {error!r}", file=sys.stderr)
                continue
            seconds.append(time.perf_counter() - start)
        results[name] = {"fits": fits, "seconds": seconds}
    print(json.dumps(results))


if __name__ == "__main__":
    main()

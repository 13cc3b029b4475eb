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
Outcome = tuple[Fit, Fit]
"""Coefficients, and their standard errors where a package states them."""

TRUE = [(0, 0, 0), (0, 1, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (0, 0, 1)]


def key(rate: str, powers: tuple[int, ...]) -> str:
    """Name a coefficient."""
    return f"{rate} {' '.join(map(str, powers))}"


def ordinary(time_s: Flights, flights: Flights) -> Outcome:
    """Return the estimate of ordinary least squares on central differences, true terms given."""
    rows, targets = [], []
    for alpha, q, elevator in flights:
        rows.append(np.stack([alpha**a * q**b * elevator**c for a, b, c in TRUE], axis=1))
        targets.append(np.stack([np.gradient(alpha, time_s), np.gradient(q, time_s)], axis=1))
    regressors, target = np.concatenate(rows), np.concatenate(targets)
    found = np.linalg.lstsq(regressors, target, rcond=None)[0]
    variance = ((target - regressors @ found) ** 2).sum(axis=0) / (len(target) - len(TRUE))
    errors = np.sqrt(np.outer(np.diag(np.linalg.inv(regressors.T @ regressors)), variance))
    return _named(found), _named(errors)


def _named(values: Flights) -> Fit:
    """Name values of shape (terms, rates)."""
    return {
        key(rate, p): float(values[i, k]) for k, rate in enumerate(("alpha_dot", "q_dot")) for i, p in enumerate(TRUE)
    }


def sindy(
    time_s: Flights, flights: Flights, differentiation: Callable[[Any], Any], optimizer: Callable[[Any], Any]
) -> Outcome:
    """Fit a cubic library to all flights; pysindy states no errors."""
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
    fit = {
        key(rate, tuple(int(n) for n in row)): float(found[k, i])
        for k, rate in enumerate(("alpha_dot", "q_dot"))
        for i, row in enumerate(powers)
    }
    return fit, {}


def output_error(time_s: Flights, flight: Flights, guess: Fit) -> Outcome:
    """Fit the true terms to one record with aeroid's defaults, its initial state taken from the data."""
    aeroid = import_module("aeroid")
    names = [f"{rate}_{i}" for rate in ("a", "q") for i in range(len(TRUE))]
    start = dict(zip(names, guess.values(), strict=True))

    def dynamics(_t: float, x: Sequence[float], u: Sequence[float], p: Fit) -> list[float]:
        terms = [x[0] ** a * x[1] ** b * u[0] ** c for a, b, c in TRUE]
        return [sum(p[f"{rate}_{i}"] * term for i, term in enumerate(terms)) for rate in ("a", "q")]

    model = aeroid.Model(states=("alpha", "q"), controls=("elevator",), parameters=start, dynamics=dynamics)
    data = aeroid.FlightData(time=time_s, channels=dict(zip(("alpha", "q", "elevator"), flight, strict=True)))
    found = aeroid.identify(model, data, names)
    labels = [key(rate, p) for rate in ("alpha_dot", "q_dot") for p in TRUE]
    fit, errors = (
        {label: float(values[name]) for label, name in zip(labels, names, strict=True)}
        for values in (found.parameters, found.stderr)
    )
    return fit, errors


def main() -> None:
    """Run every competitor over every seed."""
    warnings.simplefilter("ignore")
    with np.load(sys.argv[1]) as data:
        time_s, seeds = data["time_s"], data["flights_deg"]
    entries: dict[str, Callable[[Flights], Outcome]] = {
        "ordinary least squares, true terms": lambda f: ordinary(time_s, f),
        "pysindy, default": lambda f: sindy(
            time_s, f, lambda p: p.FiniteDifference(), lambda p: p.STLSQ(threshold=0.1)
        ),
        "pysindy, smoothed, threshold 1e-3": lambda f: sindy(
            time_s, f, lambda p: p.SmoothedFiniteDifference(), lambda p: p.STLSQ(threshold=1e-3)
        ),
        "pysindy, smoothed, threshold 3e-4, alpha 0": lambda f: sindy(
            time_s, f, lambda p: p.SmoothedFiniteDifference(), lambda p: p.STLSQ(threshold=3e-4, alpha=0.0)
        ),
        "aeroid, output error, true terms, one record": lambda f: output_error(time_s, f[0], ordinary(time_s, f)[0]),
    }
    results = {}
    for name, run in entries.items():
        outcomes, seconds = [], []
        for flights in seeds[:1] if name.startswith("aeroid") else seeds:
            start = time.process_time()
            try:
                outcomes.append(run(flights))
            except Exception as error:  # noqa: BLE001 - whatever a rival raises is its result
                print(f"{name}: {error!r}", file=sys.stderr)
                continue
            seconds.append(time.process_time() - start)
        results[name] = {"outcomes": outcomes, "seconds": seconds}
    print(json.dumps(results))


if __name__ == "__main__":
    main()

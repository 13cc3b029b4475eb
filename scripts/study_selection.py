"""How often does the structure selection find exactly the true terms?

Three 3-2-1-1 maneuvers (trims at 2, 9 and 16 deg, amplitudes 3, 3 and 1.5 deg, unit 0.7 s after 1 s, 15 s at 100 Hz,
elevator held between samples) of the published model, with white noise on alpha and q; then, with ``--random``, four
maneuvers of models whose terms are drawn at random from the same library of 20 + 20. Exit code 1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.trajectory import free_run
from finback.identification.options import IdentificationOptions
from finback.identification.selection.library import library, polynomial_terms
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.select import select
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store import read_model_file
from finback.units import to_si

PUBLISHED: Final = Path(__file__).resolve().parent.parent / "aircraft" / "f8ii" / "published.toml"
REQUIRED: Final = 0.95  # share of the seeds with exactly the true terms, published model at 0.1 deg and 0.1 deg/s
INTERVAL_S: Final = 0.01
SAMPLES: Final = 1501
CONDITION: Final = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
CUBIC: Final = library(polynomial_terms(("alpha", "q", "elevator"), 3))
OPTIONS: Final = IdentificationOptions(alpha_window_rad=(to_si(-45.0, "deg"), to_si(45.0, "deg")))
JUDGED: Final = ((2.0, 3.0, 0.7), (9.0, 3.0, 0.7), (16.0, 1.5, 0.7))  # trim and amplitude in deg, unit in s
RANDOM: Final = ((0.0, 4.0, 0.7), (5.0, -4.0, 0.5), (10.0, 3.0, 0.7), (15.0, -3.0, 0.5))
TYPICAL: Final = (0.2, 0.2, 0.15)  # alpha, q, elevator in these flights, in rad and rad/s

Terms = dict[tuple[int, ...], float]


def trimmed(model: PolynomialModel, alpha: float) -> tuple[float, float]:
    """Return q and elevator of the equilibrium near the linear one."""
    q, elevator = 0.0, 0.0
    for _ in range(50):
        at = (alpha, q, elevator)
        rates = np.array([float(model.alpha_dot(*at)), float(model.q_dot(*at))])
        slopes = np.array(
            [[float(part.derivative(name)(*at)) for name in VARIABLES[1:]] for part in (model.alpha_dot, model.q_dot)]
        )
        q, elevator = np.array([q, elevator]) - np.linalg.solve(slopes, rates)
    return float(q), float(elevator)


def flown(model: PolynomialModel, maneuvers: tuple[tuple[float, float, float], ...]) -> list[FlightRecord]:
    """Fly 3-2-1-1 maneuvers without noise."""
    time_s, records = frozen_array(INTERVAL_S * np.arange(SAMPLES)), []
    for number, (alpha_deg, amplitude_deg, unit_s) in enumerate(maneuvers):
        alpha = to_si(alpha_deg, "deg")
        q, elevator = trimmed(model, alpha)
        edges = 1.0 + unit_s * np.cumsum([0, 3, 2, 1, 1])
        wave = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[np.searchsorted(edges, time_s + 1e-9, side="right")]
        held = elevator + to_si(amplitude_deg, "deg") * wave
        state = free_run(model, time_s=time_s, elevator_rad=held, hold="zoh", alpha_rad=alpha, q_rad_s=q)
        records.append(record(f"flight-{number}", time_s, state, held))
    return records


def record(name: str, time_s: FloatArray, state: FloatArray, held: FloatArray) -> FlightRecord:
    """Make a record of a solution."""
    columns = {"time_s": time_s, "alpha_rad": state[:, 0], "q_rad_s": state[:, 1], "elevator_rad": held}
    return FlightRecord(
        name=name,
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=CONDITION,
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=Hold.ZOH,
    )


def noisy(records: list[FlightRecord], *, alpha_deg: float, q_deg_s: float, seed: int) -> Sweep:
    """Add white noise to alpha and q."""
    random = np.random.default_rng(seed)
    return Sweep(
        study="selection",
        records=tuple(
            flight.with_columns(
                alpha_rad=flight["alpha_rad"] + to_si(alpha_deg, "deg") * random.standard_normal(len(flight)),
                q_rad_s=flight["q_rad_s"] + to_si(q_deg_s, "deg_s") * random.standard_normal(len(flight)),
            )
            for flight in records
        ),
    )


def labels(model: PolynomialModel) -> set[str]:
    """Return the names of a model's terms, as a form writes them."""
    return {f"{term} in dalpha/dt" for term in model.alpha_dot.labels()} | {
        f"{term} in dq/dt" for term in model.q_dot.labels()
    }


def found(records: list[FlightRecord], noise: tuple[float, float], seed: int) -> set[str]:
    """Select terms from noisy flights."""
    sweep = noisy(records, alpha_deg=noise[0], q_deg_s=noise[1], seed=seed)
    return set(select(sweep, OPTIONS, SelectionOptions(library=CUBIC, bootstraps=0)).form.labels())


def random_model(seed: int) -> tuple[PolynomialModel, list[FlightRecord]]:
    """Draw a model with one to three terms of degree two or three in each equation, until its flights stay bounded."""
    random = np.random.default_rng(seed)
    names = (*VARIABLES,)
    while True:
        one: Terms = {(0, 0, 0): 0.01 * random.normal(), (1, 0, 0): -random.uniform(0.3, 0.9)}
        one |= {(0, 1, 0): random.uniform(0.9, 1.0), (0, 0, 1): -random.uniform(0.03, 0.15)}
        two: Terms = {(0, 0, 0): 0.05 * random.normal(), (1, 0, 0): -random.uniform(2.0, 9.0)}
        two |= {(0, 1, 0): -random.uniform(0.5, 2.0), (0, 0, 1): -random.uniform(3.0, 12.0)}
        for equation, size in ((one, 0.03), (two, 0.3)):
            others = [term for term in CUBIC.alpha_dot if term.degree >= 2]
            for place in random.choice(len(others), random.integers(1, 4), replace=False):
                exponents = dict(others[place].monomials[0].factors)
                row = tuple(exponents.get(name, 0) for name in names)
                scale = float(np.prod(np.array(TYPICAL) ** np.array(row)))
                equation[row] = float(random.choice([-1, 1]) * random.uniform(1.0, 3.0) * size / scale)
        rates = [
            Polynomial.build(terms, variables=VARIABLES, value_unit=unit)
            for terms, unit in ((one, "rad_s"), (two, "rad_s2"))
        ]
        count = len(one) + len(two)
        model = PolynomialModel(alpha_dot=rates[0], q_dot=rates[1], covariance=np.zeros((count, count)))
        try:
            records = flown(model, RANDOM)
        except (np.linalg.LinAlgError, OverflowError):
            continue
        if all(
            np.nanmax(np.abs(flight["alpha_rad"]), initial=9.0 * np.isnan(flight["alpha_rad"]).any()) < 0.7
            for flight in records
        ):
            return model, records


def told(name: str, outcomes: list[tuple[set[str], set[str]]], started: float) -> float:
    """Print how often found and true terms agree; return the share."""
    exact = sum(chosen == true for chosen, true in outcomes)
    spurious, missing = Counter[str](), Counter[str]()
    for chosen, true in outcomes:
        spurious.update(chosen - true)
        missing.update(true - chosen)
    print(
        f"{name}: exactly the true terms in {exact} of {len(outcomes)}; spurious {spurious.total()}, "
        f"missing {missing.total()}; {(time.perf_counter() - started) / len(outcomes):.2f} s each"
    )
    for what, terms in (("spurious", spurious), ("missing", missing)):
        if terms:
            print(f"  {what}: {', '.join(f'{term} {count}' for term, count in terms.most_common(6))}")
    return exact / len(outcomes)


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100, help="noise seeds of the published model")
    parser.add_argument("--random", type=int, default=0, help="random models, one seed each")
    parser.add_argument("--noise", type=float, nargs=2, default=(0.1, 0.1), help="of alpha in deg and q in deg/s")
    arguments = parser.parse_args()
    noise = (arguments.noise[0], arguments.noise[1])
    truth = read_model_file(PUBLISHED).model()
    records, started = flown(truth, JUDGED), time.perf_counter()
    share = told(
        f"published model, noise {noise[0]:g} deg and {noise[1]:g} deg/s",
        [(found(records, noise, seed), labels(truth)) for seed in range(arguments.seeds)],
        started,
    )
    if arguments.random:
        started = time.perf_counter()
        outcomes = []
        for seed in range(arguments.random):
            model, flights = random_model(seed)
            outcomes.append((found(flights, noise, seed), labels(model)))
        told("random models", outcomes, started)
    return 0 if share >= REQUIRED else 1


if __name__ == "__main__":
    sys.exit(main())

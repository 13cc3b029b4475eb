"""Is every row of the identification's requirements kept? Prints each with what was measured; about 3 min on 2 cores.

The F-8 II model of Shi & Fan (2013) is flown by Runge and Kutta's rule, its elevator held between samples at 100 Hz:
3-2-1-1 of 0.7 s in 15 s, at trims of alpha 2, 9 and 16 deg by ±3, ±3 and ±1.5 deg (three maneuvers), or at one trim by
±3 deg (one maneuver). White noise is added to alpha and q, the elevator is exact. For each seed the model is
identified, and only this script compares it with the truth: the error of a coefficient is the median over the seeds,
its root mean square is held against the Cramér-Rao bound, 95 % intervals of coefficients and folds against the truth,
and a doublet of ±2.5 deg at 12 deg, which no fit has seen, against the model's free run. Exit code 1 if a limit is
missed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import numpy as np
import study_selection
from judged_row import Row, between, least, most, page, table

from finback.arrays import FloatArray
from finback.dynamics.fold import folds
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.dynamics.trajectory import free_run
from finback.errors import RefusedError
from finback.identification.estimators import estimated
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.noise import Noise
from finback.identification.options import IdentificationOptions
from finback.identification.output_error import output_error
from finback.identification.stretch import stretches
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.model_file import read_model_file
from finback.units import from_si, to_si

PUBLISHED = Path(__file__).resolve().parent.parent / "aircraft/f8ii/published.toml"
INTERVAL_S, SAMPLES, UNIT_S = 0.01, 1501, 0.7
PATTERN = ((1, 3), (-1, 2), (1, 1), (-1, 1))  # sign, units
DOUBLET = ((1, 1), (-1, 1))
THREE = ((2.0, 3.0), (9.0, 3.0), (16.0, 1.5))  # alpha of the trim and amplitude, deg
ONE = (8.0, -4.0, 14.0)  # the judged trim, and two from which a fold is nearer
ONE_AMPLITUDE = 3.0
HOLDOUT = (12.0, 2.5)
WINDOW_DEG = (-30.0, 45.0)
WIDTH_95 = 1.959963984540054

# Limits: (median, worst) coefficient error in %, of alpha noise in deg and q noise in deg/s.
NOISES = {(0.1, 0.1): (1.0, 5.0), (0.3, 0.5): (3.0, 18.0)}
HOLDOUT_LIMITS = (0.002, 0.005)  # deg and deg/s, at the lower noise
BOUND_RATIO, WIDTH_RATIO, TIME_S = 1.15, 1.2, 1.0
EACH, POOLED, FEWEST_ONE = (0.90, 0.99), (0.93, 0.97), 0.90
SELECTED, SELECTION_SEEDS = 0.95, 100
BLOCK = 25  # seeds that a process takes at once
DOCUMENT: Final = Path(__file__).resolve().parent.parent / "docs/identification.md"


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What is flown and how noisy it is measured; alpha in deg, q in deg/s."""

    trims: tuple[tuple[float, float], ...]
    noise: tuple[float, float]
    method: Method

    @property
    def deviations(self) -> FloatArray:
        """Return the standard deviations of alpha in rad and q in rad/s."""
        return np.array([to_si(self.noise[0], "deg"), to_si(self.noise[1], "deg_s")])

    @property
    def options(self) -> IdentificationOptions:
        """Return what is asked of the identification."""
        low, high = (to_si(value, "deg") for value in WINDOW_DEG)
        return IdentificationOptions(alpha_window_rad=(low, high), method=self.method)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """What one seed gave; folds are nan where they are not determined."""

    model: PolynomialModel
    errors: FloatArray
    fold_rad: FloatArray
    fold_half_rad: FloatArray
    holdout: FloatArray
    cpu_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcomes:
    """What all seeds gave; rows are seeds that were not refused."""

    model: PolynomialModel
    coefficients: FloatArray
    errors: FloatArray
    fold_rad: FloatArray
    fold_half_rad: FloatArray
    holdout: FloatArray
    cpu_s: FloatArray
    refused: int


def trim(model: PolynomialModel, alpha_rad: float) -> tuple[float, float]:
    """Return q and elevator of the equilibrium at this alpha."""
    rates = [np.array([model.alpha_dot(alpha_rad, *x), model.q_dot(alpha_rad, *x)]) for x in ((0, 0), (1, 0), (0, 1))]
    q, elevator = np.linalg.solve(np.stack([rates[1] - rates[0], rates[2] - rates[0]], axis=1), -rates[0])
    return float(q), float(elevator)


def fly(
    model: PolynomialModel, at: tuple[float, float], pattern: tuple[tuple[int, int], ...], unit_s: float
) -> FlightRecord:
    """Fly a multistep from a trim, without noise."""
    alpha, amplitude = to_si(at[0], "deg"), to_si(at[1], "deg")
    q, level = trim(model, alpha)
    clock = np.linspace(0.0, (SAMPLES - 1) * INTERVAL_S, SAMPLES)
    elevator, begin = np.full(SAMPLES, level), 1.0
    for sign, units in pattern:
        end = begin + units * unit_s
        elevator[(clock >= begin - 1e-9) & (clock < end - 1e-9)] += sign * amplitude
        begin = end
    state: FloatArray = free_run(model, time_s=clock, elevator_rad=elevator, hold="zoh", alpha_rad=alpha, q_rad_s=q)
    return FlightRecord(
        name=f"trim {at[0]:g} deg",
        columns={"time_s": clock, "alpha_rad": state[:, 0], "q_rad_s": state[:, 1], "elevator_rad": elevator},
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=1.0, density_kg_m3=1.0, gravity_m_s2=1.0, altitude_m=0.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.full(1, level)),
        hold=Hold.ZOH,
    )


def noisy(records: tuple[FlightRecord, ...], noise: FloatArray, seed: int) -> Sweep:
    """Add white noise of (alpha in rad, q in rad/s)."""
    random = np.random.default_rng(seed)
    return Sweep(
        study="judged",
        records=tuple(
            record.with_columns(
                alpha_rad=record["alpha_rad"] + noise[0] * random.standard_normal(SAMPLES),
                q_rad_s=record["q_rad_s"] + noise[1] * random.standard_normal(SAMPLES),
            )
            for record in records
        ),
    )


def aligned(model: PolynomialModel, like: PolynomialModel) -> FloatArray:
    """Return the coefficients of ``model`` in the order of ``like``."""
    return np.array(
        [
            one.coefficient(**dict(zip(two.variables, powers, strict=True)))
            for one, two in ((model.alpha_dot, like.alpha_dot), (model.q_dot, like.q_dot))
            for powers in two.powers.tolist()
        ]
    )


def bound(
    records: tuple[FlightRecord, ...], truth: FloatArray, noise: FloatArray, options: IdentificationOptions
) -> FloatArray:
    """Return the Cramér-Rao standard deviations: at the truth, with the noise known, the starts unknown."""
    pieces = [piece for record in records for piece in stretches(record, options, windowed=True)]
    exact = replace(
        estimated(pieces, replace(options, method=Method.WEAK_FORM), Noise(found=noise, least=noise)),
        coefficients=truth,
        states=tuple(piece.measured for piece in pieces),
    )
    fit = output_error(pieces, options.model_form, exact, least_noise=noise, nuisances=options.nuisances)
    return np.sqrt(np.diag(fit.covariance))


def fold_numbers(model: PolynomialModel, alphas: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return elevator and half-width of the folds nearest to the true ones; nan where the model determines none."""
    values, halves = np.full(alphas.size, np.nan), np.full(alphas.size, np.nan)
    found = folds(reduce(model))
    for i in range(alphas.size):
        for fold in found:
            nearest = int(np.argmin(np.abs(alphas - fold.alpha_rad)))
            if nearest == i and np.isfinite(fold.elevator_interval_rad).all():
                values[i] = fold.elevator_rad
                halves[i] = float(np.diff(fold.elevator_interval_rad)[0]) / 2
    return values, halves


def free_run_error(model: PolynomialModel, record: FlightRecord) -> FloatArray:
    """Return the root mean square error of alpha and q of a free run, in deg and deg/s."""
    state = free_run(
        model,
        time_s=record["time_s"],
        elevator_rad=record["elevator_rad"],
        hold="zoh",
        alpha_rad=float(record["alpha_rad"][0]),
        q_rad_s=float(record["q_rad_s"][0]),
    )
    off = state - np.column_stack([record["alpha_rad"], record["q_rad_s"]])
    with np.errstate(over="ignore"):  # of a model that diverges
        return from_si(np.sqrt(np.mean(off**2, axis=0)), "deg")


@cache
def flown(trims: tuple[tuple[float, float], ...], pattern: tuple[tuple[int, int], ...]) -> tuple[FlightRecord, ...]:
    """Fly the published model from all trims, without noise; a process does it once."""
    truth = read_model_file(PUBLISHED).model()
    return tuple(fly(truth, at, pattern, UNIT_S) for at in trims)


def fit(case: Case, seed: int) -> list[Fit]:
    """Identify once; nothing where the data were refused."""
    truth = read_model_file(PUBLISHED).model()
    alphas = np.array([fold.alpha_rad for fold in folds(reduce(truth))])
    sweep = noisy(flown(case.trims, PATTERN), case.deviations, seed)
    start = time.process_time()
    try:
        result = identify(sweep, case.options)
    except RefusedError:
        return []
    spent = time.process_time() - start
    values, halves = fold_numbers(result.model, alphas)
    return [
        Fit(
            model=result.model,
            errors=np.array(result.standard_errors),
            fold_rad=values,
            fold_half_rad=halves,
            holdout=free_run_error(result.model, *flown((HOLDOUT,), DOUBLET)),
            cpu_s=spent,
        )
    ]


def block(case: Case, seeds: range) -> list[Fit]:
    """Identify for some seeds; the first fit of a process compiles, and is made twice."""
    fit(case, seeds[0])
    return [found for seed in seeds for found in fit(case, seed)]


def selected(seeds: range) -> list[bool]:
    """Tell for some seeds whether the selection found exactly the true terms."""
    truth = read_model_file(PUBLISHED).model()
    records, true = study_selection.flown(truth, study_selection.JUDGED), study_selection.labels(truth)
    return [study_selection.found(records, min(NOISES), seed) == true for seed in seeds]


def gathered(fits: Iterable[Fit], count: int) -> Outcomes:
    """Put the fits of all seeds together."""
    found = list(fits)
    truth = read_model_file(PUBLISHED).model()
    return Outcomes(
        model=found[0].model if found else truth,
        coefficients=np.array([one.model.coefficients for one in found]),
        errors=np.array([one.errors for one in found]),
        fold_rad=np.array([one.fold_rad for one in found]),
        fold_half_rad=np.array([one.fold_half_rad for one in found]),
        holdout=np.array([one.holdout for one in found]),
        cpu_s=np.array([one.cpu_s for one in found]),
        refused=count - len(found),
    )


def judge_three(case: Case, found: Outcomes, *, details: bool) -> list[Row]:
    """Return the rows of three maneuvers."""
    truth = read_model_file(PUBLISHED).model()
    right = aligned(truth, found.model)
    bounds = bound(flown(case.trims, PATTERN), right, case.deviations, case.options)
    off = found.coefficients - right
    percent = 100 * np.median(np.abs(off / right), axis=0)
    ratio = np.sqrt(np.mean(off**2, axis=0)) / bounds
    width = np.median(found.errors, axis=0) / bounds
    covered = np.abs(off) <= WIDTH_95 * found.errors
    exact = np.array([fold.elevator_rad for fold in folds(reduce(truth))])
    fold_covered = np.abs(found.fold_rad - exact) <= found.fold_half_rad
    every = np.hstack([covered, fold_covered])
    if details:
        names = (("dα/dt", found.model.alpha_dot), ("dq/dt", found.model.q_dot))
        labels = [f"{rate} {label}" for rate, polynomial in names for label in polynomial.labels()]
        print(f"noise {case.noise[0]} deg, {case.noise[1]} deg/s")
        for row in zip(labels, percent, ratio, covered.mean(axis=0), width, strict=True):
            print(
                "  {:<18} median error {:8.4f} %   rms/bound {:.3f}   covered {:.3f}   width/bound {:.3f}".format(*row)
            )
        for fold, share in zip(exact, fold_covered.mean(axis=0), strict=True):
            print(f"  fold {from_si(float(fold), 'deg'):+.4f} deg: covered {share:.3f}")
    median, worst = NOISES[case.noise]
    alpha, q = np.median(found.holdout, axis=0).tolist()
    at = f"{case.noise[0]}°, {case.noise[1]}°/s"
    rows = [
        most(f"{at}: coefficient error, median, %", float(np.median(percent)), median),
        most(f"{at}: coefficient error, worst, %", float(percent.max()), worst),
        most(f"{at}: worst rms error / Cramér-Rao", float(ratio.max()), BOUND_RATIO),
        between(f"{at}: coverage, least of 12 coefficients and 2 folds", float(every.mean(axis=0).min()), EACH),
        between(f"{at}: coverage, largest of them", float(every.mean(axis=0).max()), EACH),
        between(f"{at}: coverage, pooled", float(every.mean()), POOLED),
        most(f"{at}: worst median half-width / Cramér-Rao", float(width.max()), WIDTH_RATIO),
        least(f"{at}: share of seeds that state both folds", float(np.isfinite(found.fold_half_rad).mean()), 1.0),
        most(f"{at}: seeds refused", float(found.refused), 0.0),
        most(f"{at}: time of a fit, s of one core (median)", float(np.median(found.cpu_s)), TIME_S),
    ]
    if case.noise == min(NOISES):
        rows += [
            most(f"{at}: hold-out free run, alpha, ° rms (median)", alpha, HOLDOUT_LIMITS[0]),
            most(f"{at}: hold-out free run, q, °/s rms (median)", q, HOLDOUT_LIMITS[1]),
        ]
    return rows


def judge_one(case: Case, found: Outcomes) -> list[Row]:
    """Return the rows of one maneuver: refused, or intervals that cover."""
    truth = read_model_file(PUBLISHED).model()
    at = f"one maneuver at {case.trims[0][0]:g}°, {case.noise[0]}°, {case.noise[1]}°/s"
    count = found.refused + len(found.errors)
    if not len(found.errors):
        return [least(f"{at}: refused, share of {count} seeds", 1.0, 1.0)]
    off = found.coefficients - aligned(truth, found.model)
    covered = np.mean(np.abs(off) <= WIDTH_95 * found.errors, axis=0)
    name = f"{at}: least coverage of a coefficient" + (
        f" ({found.refused} of {count} refused)" if found.refused else ""
    )
    rows = [least(name, float(covered.min()), FEWEST_ONE)]
    for i, fold in enumerate(folds(reduce(truth))):
        stated = np.isfinite(found.fold_half_rad[:, i])
        name = f"{at}: fold at {from_si(fold.elevator_rad, 'deg'):+.1f}°"
        if not stated.any():
            rows.append(least(f"{name}, not determined, share of seeds", 1.0, 1.0))
            continue
        right = np.abs(found.fold_rad[stated, i] - fold.elevator_rad) <= found.fold_half_rad[stated, i]
        rows.append(least(f"{name}, coverage where stated ({int(stated.sum())})", float(right.mean()), FEWEST_ONE))
    return rows


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200, metavar="N", help="number of noise seeds (200)")
    parser.add_argument("--first-seed", type=int, default=0, metavar="N", help="the first of them (0)")
    parser.add_argument("--method", choices=[str(method) for method in Method], default=str(Method.OUTPUT_ERROR))
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="how many at once (2)")
    parser.add_argument("--details", action="store_true", help="also print every coefficient")
    parser.add_argument("--write", action="store_true", help="put the table into docs/identification.md")
    arguments = parser.parse_args()
    if min(arguments.seeds, arguments.processes) < 1:
        parser.error("--seeds and --processes must be at least 1")
    method, begin = Method(arguments.method), arguments.first_seed
    three = [Case(trims=THREE, noise=noise, method=method) for noise in NOISES]
    one = [Case(trims=((trim, ONE_AMPLITUDE),), noise=noise, method=method) for trim in ONE for noise in NOISES]
    seeds, started = range(begin, begin + arguments.seeds), time.perf_counter()
    with ProcessPoolExecutor(arguments.processes, mp_context=get_context("spawn")) as pool:
        chosen = [pool.submit(selected, part) for part in parts(range(begin, begin + SELECTION_SEEDS))]
        jobs = [(case, [pool.submit(block, case, part) for part in parts(seeds)]) for case in (*three, *one)]
        outcomes = [gathered((each for job in done for each in job.result()), len(seeds)) for _, done in jobs]
        exact = [right for job in chosen for right in job.result()]
    rows = [
        row
        for case, found in zip(three, outcomes, strict=False)
        for row in judge_three(case, found, details=arguments.details)
    ]
    rows.append(
        least(
            "selection from the 20-term library: exactly 6 + 6 terms, share of 100 seeds",
            sum(exact) / len(exact),
            SELECTED,
        )
    )
    rows += [row for case, found in zip(one, outcomes[len(three) :], strict=True) for row in judge_one(case, found)]
    said = f"{arguments.method}, seeds {seeds[0]} to {seeds[-1]}"
    print(f"{said}; {time.perf_counter() - started:.0f} s, {arguments.processes} processes\n\n{table(rows)}")
    if arguments.write:
        page(DOCUMENT, "judged", f"`scripts/study-identification judged --write`, {said}:\n\n{table(rows)}")
    return 0 if all(row.kept for row in rows) else 1


def parts(seeds: range) -> list[range]:
    """Split seeds into blocks."""
    return [seeds[k : k + BLOCK] for k in range(0, len(seeds), BLOCK)]


if __name__ == "__main__":
    sys.exit(main())

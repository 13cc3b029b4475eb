"""How good are the coefficients and folds that a study identifies, and how honest are their intervals?

Flies the study's sweep once on the rig, without noise; then, for each seed, adds sensor noise, identifies, and compares
with the published model from which the aircraft was built. Prints, per coefficient, the median error; the errors of
the folds, the coverage of their 95 % intervals with what chance alone would give, and the half-widths. Only this
script reads the truth. Exit code 1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta, binom

from finback.arrays import FloatArray
from finback.dynamics.fold import folds
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.errors import FinbackError, InputError
from finback.flight.rig import Rig
from finback.flight.sensors import Sensors, measure
from finback.flight.sweep import plan_flights
from finback.identification.identify import Identification, identify
from finback.records import FlightRecord, Sweep
from finback.store.model_file import read_model_file
from finback.study import Study, read_study
from finback.units import from_si, to_si

ROOT = Path(__file__).resolve().parent.parent

# Limits at 0.1 deg and 0.1 deg/s of noise.
MEDIAN_PERCENT = 0.2  # median over the coefficients of the median error over the seeds
WORST_PERCENT = 3.0  # the worst coefficient's
FOLD_DEG = 0.02  # every fold in every seed
COVERAGE = (0.91, 0.98)  # of the folds' 95 % intervals, pooled
HALF_WIDTH_DEG = 0.01  # median of the folds' intervals, pooled


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcomes:
    """What all seeds gave: coefficients (seeds, p), their errors (seeds, p), folds in deg (seeds, folds)."""

    coefficients: FloatArray
    standard_errors: FloatArray
    fold_deg: FloatArray
    half_width_deg: FloatArray


def flown(study: Study) -> tuple[FlightRecord, ...]:
    """Return the flights of the study's sweep, without noise."""
    with Rig(study.aircraft, study.condition, step_s=study.flight.step_s) as rig:
        return tuple(rig.fly(plan) for plan in plan_flights(study.maneuvers, rig.derivatives, study.flight).plans)


def aligned(model: PolynomialModel, like: PolynomialModel) -> FloatArray:
    """Return the coefficients of ``model`` in the order of ``like``."""
    pairs = ((model.alpha_dot, like.alpha_dot), (model.q_dot, like.q_dot))
    return np.array(
        [
            polynomial.coefficient(**dict(zip(pattern.variables, powers, strict=True)))
            for polynomial, pattern in pairs
            for powers in pattern.powers.tolist()
        ]
    )


def fold_numbers(model: PolynomialModel) -> tuple[list[float], list[float]]:
    """Return the elevators of the folds and the half-widths of their 95 % intervals, in deg, ordered by alpha."""
    found = folds(reduce(model))
    half_widths = [float(np.diff(fold.elevator_interval_rad)[0]) / 2 for fold in found]
    return [from_si(fold.elevator_rad, "deg") for fold in found], [from_si(width, "deg") for width in half_widths]


def repeat(study: Study, records: tuple[FlightRecord, ...], sensors: Sensors, seeds: range) -> list[Identification]:
    """Identify once for each seed of the noise."""
    results = []
    for seed in seeds:
        noisy = tuple(measure(record, sensors, seed=seed, index=index) for index, record in enumerate(records))
        results.append(identify(Sweep(study=study.name, records=noisy), study.identification))
    return results


def collect(results: list[Identification], exact: PolynomialModel) -> Outcomes:
    """Gather the numbers of all seeds.

    Raises:
        InputError: a seed gave another number of folds than the truth has.
    """
    numbers = [fold_numbers(result.model) for result in results]
    wanted = len(fold_numbers(exact)[0])
    if any(len(elevators) != wanted for elevators, _ in numbers):
        raise InputError(f"a seed gave another number of folds than the published model ({wanted})")
    return Outcomes(
        coefficients=np.array([result.model.coefficients for result in results]),
        standard_errors=np.array([result.standard_errors for result in results]),
        fold_deg=np.array([elevators for elevators, _ in numbers]),
        half_width_deg=np.array([widths for _, widths in numbers]),
    )


def binomial_interval(hits: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a share by Clopper and Pearson (1934)."""
    low = float(beta.ppf(0.025, hits, trials - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, trials - hits)) if hits < trials else 1.0
    return low, high


def report(outcomes: Outcomes, results: list[Identification], exact: PolynomialModel) -> bool:
    """Print every number; return whether all limits are kept."""
    model = results[0].model
    right = aligned(exact, model)
    error = 100 * np.median(np.abs(outcomes.coefficients / right - 1), axis=0)
    covered = np.abs(outcomes.coefficients - right) < 1.96 * outcomes.standard_errors
    labels = [f"{name}: {label}" for name, polynomial in (("dα/dt", model.alpha_dot), ("dq/dt", model.q_dot))
              for label in polynomial.labels()]  # fmt: skip
    print(f"{'coefficient':<18}{'truth (SI)':>14}{'median |error| %':>18}{'in its 95 %':>13}")
    for row in zip(labels, right, error, covered.mean(axis=0), strict=True):
        print("{:<18}{:>14.6g}{:>18.4f}{:>13.3f}".format(*row))
    chi = np.mean([result.diagnostics.chi_square for result in results], axis=0)
    lag = np.mean([result.diagnostics.lag1_correlation for result in results], axis=0)
    noise = np.mean([(result.alpha_noise_rad, result.q_noise_rad_s) for result in results], axis=0)
    print(f"{'median of them':<32}{np.median(error):>18.4f}{covered.mean():>13.3f}\n{'worst':<32}{error.max():>18.4f}")
    print(f"noise found: {from_si(noise[0], 'deg'):.4f} deg, {from_si(noise[1], 'deg_s'):.4f} deg/s")
    print(f"residuals: chi-square {chi[0]:.3f}, {chi[1]:.3f}; lag-1 correlation {lag[0]:+.3f}, {lag[1]:+.3f}")
    print(f"widened or warned in {sum(bool(result.warnings) for result in results)} of {len(results)} seeds\n")
    fine = limit("median coefficient error %", float(np.median(error)), MEDIAN_PERCENT)
    fine &= limit("worst coefficient error %", float(error.max()), WORST_PERCENT)
    return report_folds(outcomes, exact) and fine


def report_folds(outcomes: Outcomes, exact: PolynomialModel) -> bool:
    """Print errors, coverage and half-widths of the folds; return whether their limits are kept."""
    right, _ = fold_numbers(exact)
    off = outcomes.fold_deg - right
    covered = np.abs(off) <= outcomes.half_width_deg
    for i, elevator in enumerate(right):
        low, high = binomial_interval(int(covered[:, i].sum()), len(off))
        mean, rms, worst = off[:, i].mean(), np.sqrt(np.mean(off[:, i] ** 2)), np.abs(off[:, i]).max()
        print(
            f"fold at {elevator:+.6f} deg: error mean {mean:+.5f}, rms {rms:.5f}, worst {worst:.5f} deg; "
            f"half-width {np.median(outcomes.half_width_deg[:, i]):.5f} deg; "
            f"covered {covered[:, i].mean():.3f} (95 %: {low:.3f} to {high:.3f})"
        )
    low, high = binomial_interval(int(covered.sum()), covered.size)
    expected = binom.interval(0.95, covered.size, 0.95)
    print(
        f"pooled: covered {int(covered.sum())} of {covered.size} (95 %: {low:.3f} to {high:.3f}); "
        f"honest intervals give {int(expected[0])} to {int(expected[1])}\n"
    )
    fine = limit("worst fold error deg", float(np.abs(off).max()), FOLD_DEG)
    fine &= limit("median half-width deg", float(np.median(outcomes.half_width_deg)), HALF_WIDTH_DEG)
    inside = COVERAGE[0] <= covered.mean() <= COVERAGE[1]
    print(f"{'pooled coverage':<28}{covered.mean():>10.4f}   limits {COVERAGE[0]} to {COVERAGE[1]}   {verdict(inside)}")
    return fine and inside


def limit(name: str, value: float, most: float) -> bool:
    """Print one limit and whether it is kept."""
    print(f"{name:<28}{value:>10.4f}   limit {most:<12}     {verdict(value <= most)}")
    return value <= most


def verdict(kept: bool) -> str:  # noqa: FBT001 - one word for one truth value
    """Say whether a limit is kept."""
    return "kept" if kept else "MISSED"


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=ROOT / "aircraft/f8ii/studies/elevator-sweep.toml")
    parser.add_argument("--published", type=Path, help="the truth (published.toml beside the aircraft)")
    parser.add_argument("--seeds", type=int, default=100, metavar="N", help="number of noise seeds (100)")
    parser.add_argument("--first-seed", type=int, default=0, metavar="N", help="the first of them (0)")
    parser.add_argument("--alpha-noise-deg", type=float, help="instead of the study's")
    parser.add_argument("--q-noise-deg-s", type=float, help="instead of the study's")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error("--seeds must be at least 1")
    try:
        study = read_study(options.study)
        exact = read_model_file(options.published or study.aircraft.path.parent / "published.toml").model()
        sensors = study.sensors
        if options.alpha_noise_deg is not None:
            sensors = replace(sensors, alpha_noise_rad=to_si(options.alpha_noise_deg, "deg"))
        if options.q_noise_deg_s is not None:
            sensors = replace(sensors, q_noise_rad_s=to_si(options.q_noise_deg_s, "deg_s"))
        start = time.perf_counter()
        records = flown(study)
        flying = time.perf_counter()
        results = repeat(study, records, sensors, range(options.first_seed, options.first_seed + options.seeds))
        done = time.perf_counter()
        print(
            f"{study.name}: {len(records)} flights of {sum(record.duration_s for record in records):.0f} s together, "
            f"flown in {flying - start:.1f} s; {options.seeds} seeds, {(done - flying) / options.seeds:.3f} s each\n"
        )
        return 0 if report(collect(results, exact), results, exact) else 1
    except FinbackError as error:
        print(error, file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main())

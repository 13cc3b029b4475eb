"""Does a wrong choice of terms carry a warning, and do intervals hold the truth after a selection?

Models of three aircraft, each with terms of degree two and three of its own, fly multisines and 3-2-1-1 maneuvers, some
of them so small that terms are hardly told apart. Counted is how often the terms are exactly those that are true, and
how many of the other choices carry a warning; with ``--coverage`` also the shares of 95 % intervals, of coefficients
and of derivatives at the trims, that hold the truth. Exit code 1 if fewer than 95 % of the wrong choices are warned of.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from study_selection import CUBIC, INTERVAL_S, OPTIONS, PUBLISHED, Terms, labels, noisy, record, trimmed

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.trajectory import free_run
from finback.identification.identify import Identification, identify
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.select import select
from finback.records import FlightRecord
from finback.store import read_model_file
from finback.units import to_si

REQUIRED: Final = 0.95  # share of the wrong choices that carry a warning
NORMAL_95: Final = 1.96
LINEAR: Final = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
AIRCRAFT: Final = {
    "fighter": ((0.01, -0.6, 0.95, -0.08), (0.05, -6.0, -0.9, -6.0)),
    "light": ((0.06, -1.8, 0.97, -0.15), (0.1, -10.0, -3.0, -14.0)),
    "transport": ((0.02, -0.7, 0.98, -0.05), (0.02, -2.0, -1.0, -2.5)),
}
# Aircraft, then the further terms of dα/dt and dq/dt by their exponents of alpha, q and the elevator.
TRUTHS: Final[dict[str, tuple[str, Terms, Terms]]] = {
    "alpha*q": ("fighter", {(1, 1, 0): -0.9}, {(1, 1, 0): -5.0}),
    "q^2": ("fighter", {(2, 0, 0): 0.8}, {(0, 2, 0): 2.5, (2, 0, 0): -8.0}),
    "alpha*elevator": ("light", {(2, 0, 0): 1.0}, {(1, 0, 1): 14.0, (2, 0, 0): -9.0}),
    "elevator^2": ("light", {(1, 0, 1): 0.6}, {(0, 0, 2): 14.0, (1, 1, 0): -5.0}),
    "alpha^2*q": ("transport", {(1, 1, 0): -0.8}, {(2, 1, 0): -12.0, (3, 0, 0): -10.0}),
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Flights of one kind.

    Attributes:
        trims_deg: alpha of each.
        amplitude_deg: of the elevator.
        duration_s: of each.
        multisine: whether sixteen sines are flown, or else a 3-2-1-1 of 0.7 s.
    """

    trims_deg: tuple[float, ...]
    amplitude_deg: float
    duration_s: float
    multisine: bool


PLANS: Final = {
    "multisines": Plan(trims_deg=(3.0, 9.0, 15.0), amplitude_deg=1.5, duration_s=15.0, multisine=True),
    "3-2-1-1": Plan(trims_deg=(2.0, 9.0, 15.0), amplitude_deg=2.5, duration_s=15.0, multisine=False),
    "small multisines": Plan(trims_deg=(3.0, 8.0, 13.0), amplitude_deg=0.7, duration_s=10.0, multisine=True),
    "small 3-2-1-1": Plan(trims_deg=(4.0, 8.0, 12.0), amplitude_deg=1.5, duration_s=10.0, multisine=False),
    "one trim": Plan(trims_deg=(8.0, 8.0), amplitude_deg=2.5, duration_s=20.0, multisine=True),
}


def truths() -> dict[str, PolynomialModel]:
    """Return all models."""
    found = {"published F-8 II": read_model_file(PUBLISHED).model()}
    for name, (aircraft, one, two) in TRUTHS.items():
        rates = []
        for base, further, unit in zip(AIRCRAFT[aircraft], (one, two), ("rad_s", "rad_s2"), strict=True):
            terms: Terms = dict(zip(LINEAR, base, strict=True))
            terms |= further
            rates.append(Polynomial.build(terms, variables=VARIABLES, value_unit=unit))
        size = len(one) + len(two) + 2 * len(LINEAR)
        found[name] = PolynomialModel(alpha_dot=rates[0], q_dot=rates[1], covariance=np.zeros((size, size)))
    return found


def flown(model: PolynomialModel, plan: Plan) -> list[FlightRecord]:
    """Fly a plan without noise."""
    time_s = frozen_array(INTERVAL_S * np.arange(round(plan.duration_s / INTERVAL_S) + 1))
    harmonics = np.arange(1, 17)
    records = []
    for number, trim_deg in enumerate(plan.trims_deg):
        alpha = to_si(trim_deg, "deg")
        q, elevator = trimmed(model, alpha)
        if plan.multisine:
            phases = -np.pi * harmonics * (harmonics - 1) / 16 * (number + 1)
            waves = np.sin(3 * np.pi * np.outer(time_s, harmonics / plan.duration_s) + phases)
            wave = waves.sum(axis=1) / np.sqrt(8)
        else:
            edges = 1.0 + 0.7 * np.cumsum([0, 3, 2, 1, 1])
            wave = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[np.searchsorted(edges, time_s + 1e-9, side="right")]
        held = elevator + to_si(plan.amplitude_deg, "deg") * wave
        state = free_run(model, time_s=time_s, elevator_rad=held, hold="zoh", alpha_rad=alpha, q_rad_s=q)
        records.append(record(f"flight-{number}", time_s, state, frozen_array(held)))
    return records


def slopes(model: PolynomialModel, at: tuple[float, float, float]) -> FloatArray:
    """Return the derivatives of both rates by alpha, q and elevator by the coefficients, shape (6, n)."""
    rows = []
    size = model.coefficients.size
    first = model.alpha_dot.coefficients.size
    for polynomial, start in ((model.alpha_dot, 0), (model.q_dot, first)):
        for column in range(3):
            row = np.zeros(size)
            powers = polynomial.powers.copy()
            factors = powers[:, column].copy()
            powers[:, column] = np.maximum(factors - 1, 0)
            row[start : start + len(powers)] = factors * np.prod(np.array(at) ** powers, axis=1)
            rows.append(row)
    return np.array(rows)


def held(fitted: Identification, truth: PolynomialModel, plan: Plan) -> dict[str, list[bool]]:
    """Tell for each coefficient, and each derivative at the trims, whether its interval holds the truth."""
    model = fitted.model
    exact = [
        dict(zip(map(tuple, part.powers.tolist()), part.coefficients.tolist(), strict=True))
        for part in (truth.alpha_dot, truth.q_dot)
    ]
    true = np.array(
        [
            values.get(tuple(row), 0.0)
            for part, values in zip((model.alpha_dot, model.q_dot), exact, strict=True)
            for row in part.powers.tolist()
        ]
    )
    coefficients = np.abs(model.coefficients - true) <= NORMAL_95 * fitted.standard_errors
    derivatives: list[bool] = []
    for trim_deg in plan.trims_deg:
        alpha = to_si(trim_deg, "deg")
        at = (alpha, *trimmed(truth, alpha))
        mine, theirs = slopes(model, at), slopes(truth, at)
        errors = NORMAL_95 * np.sqrt(np.einsum("ij,jk,ik->i", mine, model.covariance, mine))
        off = np.abs(mine @ model.coefficients - theirs @ truth.coefficients)
        derivatives += (off <= errors)[errors > 0].tolist()
    return {"coefficients": coefficients.tolist(), "derivatives": derivatives}


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="noise seeds of each model and plan")
    parser.add_argument("--noise", type=float, nargs=2, default=(0.1, 0.1), help="of alpha in deg and q in deg/s")
    parser.add_argument("--coverage", action="store_true", help="also identify, and judge the intervals")
    arguments = parser.parse_args()
    asked = SelectionOptions(library=CUBIC, bootstraps=0)
    wrong, silent, shares = 0, 0, {"coefficients": list[bool](), "derivatives": list[bool]()}
    for name, model in truths().items():
        for kind, plan in PLANS.items():
            records, counts = flown(model, plan), Counter[str]()
            for seed in range(arguments.seeds):
                sweep = noisy(records, alpha_deg=arguments.noise[0], q_deg_s=arguments.noise[1], seed=seed)
                if arguments.coverage:
                    fitted = identify(sweep, replace(OPTIONS, selection=(asked,)))
                    (found,) = fitted.selection
                    for what, values in held(fitted, model, plan).items():
                        shares[what] += values
                else:
                    found = select(sweep, OPTIONS, asked)
                exact = set(found.form.labels()) == labels(model)
                counts["exact" if exact else "wrong"] += 1
                counts["open" if exact else "warned"] += bool(found.warnings)
            wrong += counts["wrong"]
            silent += counts["wrong"] - counts["warned"]
            print(
                f"{name}, {kind}: exact {counts['exact']} of {arguments.seeds}, {counts['open']} of these with a "
                f"warning; of {counts['wrong']} others, {counts['wrong'] - counts['warned']} without"
            )
    print(f"{silent} of {wrong} wrong choices carry no warning")
    for what, values in shares.items():
        if values:
            print(f"95 % intervals of {what} hold the truth: {np.mean(values):.3f} of {len(values)}")
    return 0 if silent <= (1 - REQUIRED) * wrong else 1


if __name__ == "__main__":
    sys.exit(main())

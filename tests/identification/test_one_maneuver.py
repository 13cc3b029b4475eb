"""One maneuver knows nothing of folds far from it, and says so; three around it know them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import pytest

from finback.dynamics.any_form import why_planar
from finback.dynamics.fold import Fold, folds
from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.branch import planar_branches
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.fold import PlanarFold
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.dynamics.trajectory import free_run
from finback.identification.design.information import form_of
from finback.identification.followed_numbers import analysis_numbers
from finback.identification.identify import Identification, identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.propagation import propagate
from finback.records import FlightRecord, Hold, Sweep
from finback.units import to_si

Make = Callable[..., FlightRecord]
Noisy = Callable[..., Sweep]

NOISES = ((0.1, 0.1), (0.3, 0.5))  # deg, deg/s
SEEDS: Final = 6
# A normal error beyond 5 deviations comes once in two million.
FAR = 5.0
TIME_S = 0.01 * np.arange(1501)


def flight(
    truth: PolynomialModel, make: Make, alpha_deg: float, elevator_deg: float, amplitude_deg: float
) -> FlightRecord:
    """Fly a 3-2-1-1 of 0.7 s; the elevator is the trim's to 0.1 deg."""
    steps = 1.0 + 0.7 * np.array([0, 3, 5, 6, 7])
    levels = elevator_deg + amplitude_deg * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    elevator = to_si(levels[np.searchsorted(steps, TIME_S + 1e-9, side="right")], "deg")
    state = free_run(
        truth,
        time_s=TIME_S,
        elevator_rad=elevator,
        hold="zoh",
        alpha_rad=to_si(alpha_deg, "deg"),
        q_rad_s=to_si(0.1 * alpha_deg, "deg"),
    )
    return make(f"trim-{alpha_deg:g}", state, elevator, hold=Hold.ZOH)


def fitted(sweep: Sweep) -> Identification:
    window = (to_si(-30.0, "deg"), to_si(45.0, "deg"))
    return identify(sweep, IdentificationOptions(alpha_window_rad=window, method=Method.OUTPUT_ERROR))


def stated(fold: Fold) -> bool:
    return bool(np.isfinite([fold.elevator_interval_rad, fold.alpha_interval_rad]).all())


ALPHA_Q = (0.15, -0.9)  # of alpha q in dα/dt and in dq/dt, 1/rad and 1/(rad s): no Liénard form holds it


def with_alpha_q(truth: PolynomialModel) -> PolynomialModel:
    one, two = (
        Polynomial.build(
            {
                **dict(zip(map(tuple, rate.powers.tolist()), rate.coefficients.tolist(), strict=True)),
                (1, 1, 0): value,
            },
            variables=rate.variables,
            value_unit=rate.value_unit,
        )
        for rate, value in zip((truth.alpha_dot, truth.q_dot), ALPHA_Q, strict=True)
    )
    return PolynomialModel(alpha_dot=one, q_dot=two, covariance=np.zeros((14, 14)))


def planar_folds(model: PolynomialModel) -> tuple[PlanarFold, ...]:
    system, elevators = PlanarSystem.from_model(model), (to_si(-45.0, "deg"), to_si(25.0, "deg"))
    starts = [p for elevator in np.linspace(*elevators, 8).tolist() for p in planar_equilibria(system, elevator)]
    return planar_branches(system, elevators, np.array([[-0.8, 1.0], [-1.0, 1.0]]), starts).folds


def test_one_maneuver_of_a_model_with_alpha_q_states_no_fold_and_four_state_both(
    truth: PolynomialModel, make_record: Make, noisy: Noisy
) -> None:
    planar = with_alpha_q(truth)
    assert why_planar(planar)
    plans = ((0.2, 0.0, 3.0), (9.0, -16.5, 3.0), (16.0, -28.5, 1.5), (-5.0, 8.0, 3.0))
    flights = tuple(flight(planar, make_record, *plan) for plan in plans)
    asked = IdentificationOptions(
        alpha_window_rad=(to_si(-30.0, "deg"), to_si(45.0, "deg")),
        method=Method.OUTPUT_ERROR,
        form=(form_of(planar),),
    )

    def known(*records: FlightRecord) -> list[bool]:
        sweep = noisy(Sweep(study="some", records=records), alpha_deg=0.1, q_deg_s=0.1, seed=1)
        found = planar_folds(identify(sweep, asked).model)
        return [bool(np.isfinite([*one.state_interval, one.parameter_interval]).all()) for one in found]

    assert not any(known(flights[1]))
    assert known(*flights) == [True, True]


@pytest.mark.parametrize("noise", NOISES)
def test_one_maneuver_states_no_fold_and_three_state_both(
    truth: PolynomialModel, make_record: Make, noisy: Noisy, noise: tuple[float, float]
) -> None:
    one = Sweep(study="one", records=(flight(truth, make_record, 8.0, -14.8, 3.0),))
    three = Sweep(
        study="three",
        records=tuple(
            flight(truth, make_record, *plan) for plan in ((2.0, -3.5, 3.0), (9.0, -16.5, 3.0), (16.0, -28.5, 1.5))
        ),
    )
    for seed in range(SEEDS):
        alone = fitted(noisy(one, alpha_deg=noise[0], q_deg_s=noise[1], seed=seed)).model
        assert not any(stated(fold) for fold in folds(reduce(alone)))
        around = folds(reduce(fitted(noisy(three, alpha_deg=noise[0], q_deg_s=noise[1], seed=seed)).model))
        assert len(around) == 2
        assert all(stated(fold) for fold in around)
        for fold, right in zip(around, folds(reduce(truth)), strict=True):
            error = float(np.diff(fold.elevator_interval_rad)[0]) / (2 * 1.96)
            assert abs(fold.elevator_rad - right.elevator_rad) < FAR * error


def test_both_judges_of_a_fold_agree(truth: PolynomialModel, make_record: Make, noisy: Noisy) -> None:
    """The analysis, by its closed form, and the propagation, by differences and samples."""
    one = Sweep(study="one", records=(flight(truth, make_record, 8.0, -14.8, 3.0),))
    model = fitted(noisy(one, alpha_deg=0.1, q_deg_s=0.1, seed=0)).model
    found = [n for n in propagate(model, analysis_numbers(model)) if n.name.startswith(("fold", "hopf"))]
    assert found
    assert not any(number.determined for number in found)

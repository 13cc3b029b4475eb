"""Published polynomial models of other aircraft, flown and found again: terms, and the curves they make.

F-16: Morelli, "Global nonlinear parametric modeling with application to F-16 aerodynamics", ACC 1998. F-16C and A-7:
Grauer and Morelli, "Generic Global Aerodynamic Model", Journal of Aircraft 52(1), 2015, theta 29 to 38 (Cm). All in
coefficient form, here reduced to dα/dt and dq/dt at one flight condition; angles in rad, rates as q·c/2V.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pytest

from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.trajectory import free_run
from finback.identification.identify import identify
from finback.identification.options import IdentificationOptions
from finback.identification.selection.library import library
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.select import Selection, select
from finback.identification.term import Term
from finback.records import FlightRecord, Hold, Sweep
from finback.units import to_si

Terms = dict[tuple[int, int, int], float]

# Geometry of the F-16 (the same source), and a slow flight, where coefficients make the motion they are known for.
AREA_M2, CHORD_M = to_si(300.0, "ft2"), to_si(11.32, "ft")
MASS_KG, INERTIA_KG_M2 = to_si(20_500.0, "lb"), to_si(55_814.0, "slug_ft2")
AIRSPEED_M_S, DENSITY_KG_M3, GRAVITY_M_S2 = 150.0, 0.7, 9.80665
PRESSURE = 0.5 * DENSITY_KG_M3 * AIRSPEED_M_S**2
HALF_CHORD_S = CHORD_M / (2 * AIRSPEED_M_S)
HEAVE = PRESSURE * AREA_M2 / (MASS_KG * AIRSPEED_M_S)
PITCH = PRESSURE * AREA_M2 * CHORD_M / INERTIA_KG_M2

CZ_ALPHA: Final = (-1.378278e-1, -4.211369, 4.775187, -1.026225e1, 8.399763)
CZ_ELEVATOR: Final = -4.354000e-1
CZ_Q: Final = (-3.054956e1, -4.132305e1, 3.292788e2, -6.848038e2, 4.080244e2)
CM: Final = {(0, 0, 0): -2.029370e-2, (1, 0, 0): 4.660702e-2, (0, 0, 1): -6.012308e-1, (1, 0, 1): -8.062977e-2}
CM_ELEVATOR: Final = {(0, 0, 2): 8.320429e-2, (2, 0, 1): 5.018538e-1, (0, 0, 3): 6.378864e-1, (1, 0, 2): 4.226356e-1}
CM_Q: Final = (-5.19153, -3.554716, -3.598636e1, 2.247355e2, -4.120991e2, 2.411750e2)
CENTER: Final = 0.35 - 0.30  # reference less center of gravity, in chords
GENERIC: Final = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (2, 1, 0), (2, 0, 1), (3, 1, 0), (3, 0, 1))
F16C: Final = (-0.024, -0.288, -8.267, -0.563, -5.513, 9.793, -1.057, -2.018, 1.897, -0.094)
A7: Final = (-0.023, -0.810, -7.033, -1.032, 0.502, 8.007, 1.215, 17.15, -1.278, -1.969)

CANDIDATES: Final = (
    *("1", "elevator", "elevator^2", "elevator^3", "alpha*elevator", "alpha^2*elevator", "alpha^3*elevator"),
    *("alpha*elevator^2", "alpha", "alpha^2", "alpha^3", "alpha^4", "q", "alpha*q", "alpha^2*q", "alpha^3*q"),
    *("alpha^4*q", "alpha^5*q", "q^2", "alpha*q^2", "q^3", "q*elevator", "q^2*elevator"),
)
# Trim alpha in deg, amplitude in deg, unit in s.
FLOWN: Final = (
    *((-2.0, 6.0, 0.7), (3.0, -6.0, 0.5), (8.0, 6.0, 0.6), (14.0, -5.0, 0.7)),
    *((20.0, 5.0, 0.6), (26.0, -4.0, 0.6), (32.0, 4.0, 0.7)),
)
CURVE = 0.01  # of the largest rate between -5 and 30 deg: noise of 0.1 deg on a hundred seconds of flight
REACHED_DEG = 45.0


def heave(highest: int, *, damped: bool) -> Terms:
    """dα/dt = q + g/V + CZ · pressure · area / (mass · V), along the wind."""
    terms = {(k, 0, 0): HEAVE * CZ_ALPHA[k] for k in range(highest + 1)}
    terms[0, 0, 0] += GRAVITY_M_S2 / AIRSPEED_M_S
    terms[0, 0, 1] = HEAVE * CZ_ELEVATOR
    terms |= {(k, 1, 0): HEAVE * CZ_Q[k] * HALF_CHORD_S for k in range(5 if damped else 1)}
    terms[0, 1, 0] += 1.0
    return terms


def f16() -> tuple[Terms, Terms]:
    """The model of Morelli (1998): 11 + 17 terms."""
    cm: Terms = CM | CM_ELEVATOR
    for k, value in enumerate(CZ_ALPHA):
        cm[k, 0, 0] = cm.get((k, 0, 0), 0.0) + value * CENTER
    cm[0, 0, 1] += CZ_ELEVATOR * CENTER
    for k, value in enumerate(CM_Q):
        cm[k, 1, 0] = (value + (CZ_Q[k] * CENTER if k < 5 else 0.0)) * HALF_CHORD_S
    return heave(4, damped=True), {row: PITCH * value for row, value in cm.items()}


def generic(theta: Sequence[float]) -> tuple[Terms, Terms]:
    """The Cm of Grauer and Morelli (2015), 10 terms, above a simple heave equation."""
    cm = {row: value * HALF_CHORD_S ** row[1] for row, value in zip((*GENERIC, (4, 0, 0)), theta, strict=True)}
    return heave(3, damped=False), {row: PITCH * value for row, value in cm.items()}


def model_of(one: Terms, two: Terms) -> PolynomialModel:
    rates = [
        Polynomial.build(terms, variables=VARIABLES, value_unit=unit)
        for terms, unit in ((one, "rad_s"), (two, "rad_s2"))
    ]
    size = len(one) + len(two)
    return PolynomialModel(alpha_dot=rates[0], q_dot=rates[1], covariance=np.zeros((size, size)))


def trimmed(model: PolynomialModel, alpha: float) -> tuple[float, float]:
    """Return q and elevator of an equilibrium, by Newton's steps from the linear one."""
    q, elevator = 0.0, 0.0
    for _ in range(30):
        at = (alpha, q, elevator)
        rates = np.array([float(model.alpha_dot(*at)), float(model.q_dot(*at))])
        slopes = np.array(
            [[float(part.derivative(name)(*at)) for name in VARIABLES[1:]] for part in (model.alpha_dot, model.q_dot)]
        )
        q, elevator = np.array([q, elevator]) - np.linalg.solve(slopes, rates)
    return float(q), float(elevator)


def flown(model: PolynomialModel, make_record: Callable[..., FlightRecord]) -> list[FlightRecord]:
    """Fly all 3-2-1-1 maneuvers that stay below 45 deg."""
    time = 0.01 * np.arange(1501)
    records = []
    for i, (alpha_deg, amplitude_deg, unit_s) in enumerate(FLOWN):
        alpha = to_si(alpha_deg, "deg")
        q, elevator = trimmed(model, alpha)
        edges = 1.0 + unit_s * np.cumsum([0, 3, 2, 1, 1])
        wave = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[np.searchsorted(edges, time + 1e-9, side="right")]
        held = elevator + to_si(amplitude_deg, "deg") * wave
        state = free_run(model, time_s=time, elevator_rad=held, hold="zoh", alpha_rad=alpha, q_rad_s=q)
        if np.isfinite(state).all() and np.abs(state[:, 0]).max() < to_si(REACHED_DEG, "deg"):
            records.append(make_record(f"flight-{i}", state, held, hold=Hold.ZOH))
    return records


Found = tuple[PolynomialModel, Selection, PolynomialModel]


@pytest.fixture(scope="module")
def found_again(
    make_record: Callable[..., FlightRecord], noisy: Callable[..., Sweep]
) -> Callable[[tuple[Terms, Terms]], Found]:
    """Fly a model with noise, select its terms, identify it; return truth, selection and model."""

    def find(terms: tuple[Terms, Terms]) -> Found:
        truth = model_of(*terms)
        sweep = noisy(
            Sweep(study="published", records=tuple(flown(truth, make_record))), alpha_deg=0.1, q_deg_s=0.1, seed=4
        )
        options = IdentificationOptions(alpha_window_rad=(to_si(-45.5, "deg"), to_si(45.5, "deg")))
        candidates = library(map(Term.parse, CANDIDATES))
        selection = select(sweep, options, SelectionOptions(library=candidates, bootstraps=0))
        return truth, selection, identify(sweep, replace(options, form=(selection.form,))).model

    return find


def true_labels(terms: tuple[Terms, Terms]) -> set[str]:
    labels = set()
    for rate, part in zip(("dalpha/dt", "dq/dt"), terms, strict=True):
        names = Polynomial.build(part, variables=VARIABLES, value_unit="rad_s").labels()
        labels |= {f"{name} in {rate}" for name in names}
    return labels


def curve_error(truth: PolynomialModel, model: PolynomialModel) -> float:
    """Largest difference of both rates over alpha, q and elevator of the flights, over their largest values."""
    random = np.random.default_rng(5)
    alpha = to_si(random.uniform(-5.0, 25.0, 200), "deg")
    q, elevator = to_si(random.uniform(-15.0, 15.0, 200), "deg_s"), to_si(random.uniform(-10.0, 0.0, 200), "deg")
    return max(
        float(np.abs(one(alpha, q, elevator) - two(alpha, q, elevator)).max() / np.abs(one(alpha, q, elevator)).max())
        for one, two in ((truth.alpha_dot, model.alpha_dot), (truth.q_dot, model.q_dot))
    )


@pytest.mark.parametrize("terms", [f16(), generic(A7)], ids=["F-16", "A-7"])
def test_published_terms_are_found_and_no_others(
    found_again: Callable[[tuple[Terms, Terms]], Found], terms: tuple[Terms, Terms]
) -> None:
    truth, selection, model = found_again(terms)
    assert set(selection.form.labels()) == true_labels(terms)
    assert all("explain the data equally" in note for note in selection.warnings)
    assert curve_error(truth, model) < CURVE


def test_where_two_terms_say_the_same_the_selection_names_the_rival(
    found_again: Callable[[tuple[Terms, Terms]], Found],
) -> None:
    # alpha³·q and alpha⁴·q of the F-16C: up to 36 deg the one is nearly a multiple of the other.
    terms = generic(F16C)
    truth, selection, model = found_again(terms)
    wrong = set(selection.form.labels()) ^ true_labels(terms)
    assert wrong <= {"alpha^3*q in dq/dt", "alpha^4*q in dq/dt"}
    (note,) = [note for note in selection.warnings if "explain the data equally" in note]
    assert not selection.determined
    assert "alpha^3*q in dq/dt" in note
    assert curve_error(truth, model) < CURVE

"""The coefficient form, on Morelli's polynomials of the F-16 (ACC 1998), against the forces themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.model import PolynomialModel
from finback.errors import InputError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.conversion import reduced
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.model import CoefficientModel
from finback.records import Condition
from finback.units import to_si

# Morelli 1998, as coded in AeroBenchVVPython (morellif16.py); the moment about the reference center.
AXIAL = {
    (0, 0, 0): -1.943367e-2, (1, 0, 0): 2.136104e-1, (0, 0, 2): -2.903457e-1, (0, 0, 1): -3.348641e-3,
    (1, 0, 1): -2.060504e-1, (2, 0, 0): 6.988016e-1, (3, 0, 0): -9.035381e-1, (0, 1, 0): 4.833383e-1,
    (1, 1, 0): 8.644627, (2, 1, 0): 1.131098e1, (3, 1, 0): -7.422961e1, (4, 1, 0): 6.075776e1,
}  # fmt: skip
NORMAL = {
    (0, 0, 0): -1.378278e-1, (1, 0, 0): -4.211369, (2, 0, 0): 4.775187, (3, 0, 0): -1.026225e1, (4, 0, 0): 8.399763,
    (0, 0, 1): -4.354000e-1, (0, 1, 0): -3.054956e1, (1, 1, 0): -4.132305e1, (2, 1, 0): 3.292788e2,
    (3, 1, 0): -6.848038e2, (4, 1, 0): 4.080244e2,
}  # fmt: skip
PITCHING = {
    (0, 0, 0): -2.029370e-2, (1, 0, 0): 4.660702e-2, (0, 0, 1): -6.012308e-1, (1, 0, 1): -8.062977e-2,
    (0, 0, 2): 8.320429e-2, (2, 0, 1): 5.018538e-1, (0, 0, 3): 6.378864e-1, (1, 0, 2): 4.226356e-1,
    (0, 1, 0): -5.19153, (1, 1, 0): -3.554716, (2, 1, 0): -3.598636e1, (3, 1, 0): 2.247355e2,
    (4, 1, 0): -4.120991e2, (5, 1, 0): 2.411750e2,
}  # fmt: skip
F16 = Airframe(
    mass_kg=to_si(20500.0, "lb"),
    wing_area_m2=to_si(300.0, "ft2"),
    chord_m=to_si(11.32, "ft"),
    pitch_inertia_kg_m2=to_si(55814.0, "slug_ft2"),
    thrust_n=20e3,
    thrust_angle_rad=0.05,
    thrust_arm_m=0.1,
)
LEVEL = Condition(airspeed_m_s=150.0, density_kg_m3=1.0, gravity_m_s2=9.80665, altitude_m=2000.0)


def _labels(terms: dict[tuple[int, int, int], float]) -> list[str]:
    names = ("alpha", "pitch_rate", "elevator")
    return [
        "*".join(f"{name}^{power}" for name, power in zip(names, powers, strict=True) if power) or "1"
        for powers in terms
    ]


@pytest.fixture(scope="module")
def body() -> CoefficientModel:
    form = CoefficientForm.parse(Axes.BODY, _labels(AXIAL), _labels(NORMAL), _labels(PITCHING))
    root = np.random.default_rng(0).normal(scale=1e-3, size=(form.size, form.size))
    return CoefficientModel(
        form=form,
        airframe=F16,
        reference_speed_m_s=LEVEL.airspeed_m_s,
        numbers=np.array([*AXIAL.values(), *NORMAL.values(), *PITCHING.values()]),
        covariance=root @ root.T,
        domain=np.tile([-1.0, 1.0], (len(form.variables), 1)),
    )


@pytest.mark.parametrize("order", [5, 9])
def test_the_reduction_is_the_motion_of_the_forces(body: CoefficientModel, order: int) -> None:
    model = body.reduced(LEVEL, order)
    load = 0.5 * LEVEL.density_kg_m3 * LEVEL.airspeed_m_s**2 * F16.wing_area_m2
    for alpha, q, elevator in ((0.1, 0.2, -0.05), (0.6, -0.4, 0.2), (-0.15, 0.0, -0.4)):
        rate = q * F16.chord_m / (2 * LEVEL.airspeed_m_s)
        at = {"alpha_rad": alpha, "pitch_rate_1": rate, "elevator_rad": elevator}
        cx, cz, cm = (float(body.coefficient(name, at)) for name in ("CX", "CZ", "Cm"))
        # Newton's law along the lift: forces along the body's axes, turned by alpha.
        x = load * cx + F16.thrust_n * np.cos(F16.thrust_angle_rad)
        z = load * cz - F16.thrust_n * np.sin(F16.thrust_angle_rad)
        lift = x * np.sin(alpha) - z * np.cos(alpha)
        expected = q + (-lift / F16.mass_kg + LEVEL.gravity_m_s2) / LEVEL.airspeed_m_s
        left_out = abs(alpha) ** (order + 1) / np.prod(np.arange(1.0, order + 2))
        size = (abs(x) + abs(z)) / F16.mass_kg / LEVEL.airspeed_m_s
        assert float(model.alpha_dot(alpha, q, elevator)) == pytest.approx(expected, abs=1.01 * left_out * size + 1e-12)
        moment = load * F16.chord_m * cm + F16.thrust_n * F16.thrust_arm_m
        assert float(model.q_dot(alpha, q, elevator)) == pytest.approx(moment / F16.pitch_inertia_kg_m2, rel=1e-12)


def test_the_covariance_is_that_of_drawn_coefficients(body: CoefficientModel) -> None:
    point = (0.3, 0.1, -0.1)
    model = body.reduced(LEVEL)
    terms = np.concatenate([model.alpha_dot.term_values(*point), np.zeros(model.q_dot.coefficients.size)])
    stated = float(np.sqrt(terms @ model.covariance @ terms))
    root = np.linalg.cholesky(body.covariance + 1e-15 * np.eye(len(body.covariance)))
    drawn = [
        float(replace(body, numbers=body.numbers + noise).reduced(LEVEL).alpha_dot(*point))
        for noise in np.random.default_rng(1).standard_normal((100, len(root))) @ root.T
    ]
    assert np.std(drawn) == pytest.approx(stated, rel=0.25)  # 100 draws tell a deviation to 7 %


def test_other_variables_are_a_mistake(body: CoefficientModel, truth: PolynomialModel) -> None:
    wrong = replace(body.lift_coefficients(LEVEL), lift=truth.alpha_dot)
    with pytest.raises(InputError, match="lift is over"):
        reduced(wrong, F16, LEVEL)
    with pytest.raises(InputError, match="airframe"):
        replace(F16, chord_m=0.0)

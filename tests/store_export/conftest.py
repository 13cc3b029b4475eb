"""Models in coefficient form that exported files are tested with, and a C compiler."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from finback.flight.aircraft import Aircraft, find_aircraft
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.model import CoefficientModel
from finback.store.export.coefficient.jsbsim_aircraft import coefficients_in_jsbsim
from finback.store.export.coefficient.terms import CoefficientEquations
from finback.units import to_si

CFunction = Callable[..., list[float]]

# Morelli (1998), "Global nonlinear parametric modeling with application to F-16 aerodynamics", ACC; angles in rad.
AXIAL = {
    "1": -1.943367e-2, "alpha": 2.136104e-1, "elevator^2": -2.903457e-1, "elevator": -3.348641e-3,
    "alpha*elevator": -2.060504e-1, "alpha^2": 6.988016e-1, "alpha^3": -9.035381e-1, "pitch_rate": 4.833383e-1,
    "alpha*pitch_rate": 8.644627, "alpha^2*pitch_rate": 1.131098e1, "alpha^3*pitch_rate": -7.422961e1,
    "alpha^4*pitch_rate": 6.075776e1,
}  # fmt: skip
NORMAL = {
    "1": -1.378278e-1, "alpha": -4.211369, "alpha^2": 4.775187, "alpha^3": -1.026225e1, "alpha^4": 8.399763,
    "elevator": -4.354000e-1, "pitch_rate": -3.054956e1, "alpha*pitch_rate": -4.132305e1,
    "alpha^2*pitch_rate": 3.292788e2, "alpha^3*pitch_rate": -6.848038e2, "alpha^4*pitch_rate": 4.080244e2,
}  # fmt: skip
PITCHING = {
    "1": -2.029370e-2, "alpha": 4.660702e-2, "elevator": -6.012308e-1, "alpha*elevator": -8.062977e-2,
    "elevator^2": 8.320429e-2, "alpha^2*elevator": 5.018538e-1, "elevator^3": 6.378864e-1,
    "alpha*elevator^2": 4.226356e-1, "pitch_rate": -5.19153, "alpha*pitch_rate": -3.554716,
    "alpha^2*pitch_rate": -3.598636e1, "alpha^3*pitch_rate": 2.247355e2, "alpha^4*pitch_rate": -4.120991e2,
    "alpha^5*pitch_rate": 2.411750e2,
}  # fmt: skip
F16_CHORD_M = to_si(11.32, "ft")
F16 = Airframe(
    mass_kg=to_si(20500.0, "lb"),
    wing_area_m2=to_si(300.0, "ft2"),
    chord_m=F16_CHORD_M,
    pitch_inertia_kg_m2=to_si(55814.0, "slug_ft2"),
    thrust_n=2e4,
    reference_x_m=-0.05 * F16_CHORD_M,
)
# A twin jet whose drag, lift and moment depend on the airspeed; its thrust is inclined and has an arm.
AREA_M2 = 7472.0 * 4.028e-3
TRANSPORT = Airframe(
    mass_kg=7472.0,
    wing_area_m2=AREA_M2,
    chord_m=2.43,
    pitch_inertia_kg_m2=AREA_M2 * 2.43 / 8.0027e-4,
    thrust_n=11600.0,
    thrust_angle_rad=0.0524,
    thrust_arm_m=-0.6,
    reference_x_m=0.1,
    reference_z_m=-0.2,
)
WIND = {"CD": [0.124, -0.065, 0.32], "CL": [-0.1, 0.155, 4.4], "Cm": [0.108, 0.01, -1.0]}


def model_of(
    form: CoefficientForm, numbers: list[float], airframe: Airframe, reference_speed_m_s: float
) -> CoefficientModel:
    """Return a model, each number with a standard error of 1.3 %."""
    values = np.array(numbers)
    domain = np.tile([-0.5, 0.8], (len(form.variables), 1))
    domain[form.variables.index("speed_ratio_1")] = [0.6, 1.3]
    return CoefficientModel(
        form=form,
        airframe=airframe,
        reference_speed_m_s=reference_speed_m_s,
        numbers=values,
        covariance=np.diag((0.013 * values) ** 2),
        domain=domain,
    )


def transport(*, late: bool = False) -> CoefficientModel:
    """Return the twin jet: pitch rate over the reference speed, or with its dα/dt over the airspeed."""
    rate, number = ("pitch_rate+alpha_rate", -20.0) if late else ("reference_pitch_rate", -34.7)
    forces = ["1", "speed_ratio", "alpha"]
    form = CoefficientForm.parse(Axes.WIND, forces, forces, [*forces, rate, "elevator"])
    return model_of(form, [*WIND["CD"], *WIND["CL"], *WIND["Cm"], number, -1.6], TRANSPORT, 104.67)


def morelli(*, late: bool = False) -> CoefficientModel:
    """Return the F-16 of 37 numbers; or with dα/dt in Cm, and an input that no aircraft of JSBSim's has."""
    more = {"alpha_rate": -3.0, "alpha*alpha_rate": 2.0, "canard": 0.2} if late else {}
    form = CoefficientForm.parse(Axes.BODY, list(AXIAL), list(NORMAL), [*PITCHING, *more])
    return model_of(form, [*AXIAL.values(), *NORMAL.values(), *PITCHING.values(), *more.values()], F16, 150.0)


MODELS = {
    "transport": transport(),
    "transport-late": transport(late=True),
    "morelli": morelli(),
    "morelli-late": morelli(late=True),
}


@pytest.fixture
def truths() -> dict[str, CoefficientModel]:
    """All models by name."""
    return MODELS


@pytest.fixture(params=["transport", "morelli-late"])
def coefficients(request: pytest.FixtureRequest) -> CoefficientModel:
    """The models that have everything between them: both axes, both airspeeds, dα/dt, thrust with an arm, an input."""
    return MODELS[request.param]


@pytest.fixture
def exported(tmp_path: Path) -> Callable[[CoefficientModel], Aircraft]:
    """Write a model as an aircraft and find it."""

    def write(model: CoefficientModel) -> Aircraft:
        file = tmp_path / "found" / "found.xml"
        file.parent.mkdir()
        equations = CoefficientEquations(model=model, source="a test")
        file.write_text(coefficients_in_jsbsim(equations, name="found"), encoding="utf-8")
        return find_aircraft(str(file), near=tmp_path)

    return write


@pytest.fixture
def compile_c(tmp_path: Path) -> Callable[[str, str, int, int], CFunction]:
    """Compile a C file with every warning an error and return a function: (source, its name, arguments, results)."""

    def make(source: str, name: str, arguments: int, results: int) -> CFunction:
        compiler = shutil.which("cc")
        assert compiler is not None, "the exported C function is tested with a C compiler: install one"
        file, library = tmp_path / f"{name}.c", tmp_path / f"{name}.so"
        file.write_text(source, encoding="utf-8")
        flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run([compiler, *flags, "-o", str(library), str(file), "-lm"], check=True)
        function = getattr(ctypes.CDLL(str(library)), name)
        function.argtypes = [ctypes.c_double] * arguments + [ctypes.POINTER(ctypes.c_double)]
        function.restype = None

        def call(*values: float) -> list[float]:
            result = (ctypes.c_double * results)()
            function(*values, result)
            return list(result)

        return call

    return make

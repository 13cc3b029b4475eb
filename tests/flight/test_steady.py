"""Branches of steady flight of the simulator itself, and its linear models, in three fidelities."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.continuation.path import Ending
from finback.errors import InputError, RefusedError
from finback.flight import steady
from finback.flight.airborne import Airborne
from finback.flight.equilibrium import equilibrium_curve
from finback.flight.linear_model import LinearModel
from finback.flight.plan import FlightPlan
from finback.flight.power import FixedThrust
from finback.flight.rig import Rig
from finback.flight.start import SymmetricStart
from finback.flight.state import STATE_NAMES
from finback.flight.steady import RESIDUAL, SteadyBranch, linearized, steady_branch
from finback.flight.steady_problem import Family, FreeThrust, HeldThrust, OnRig, SteadyProblem
from finback.units import to_si

MakePlan = Callable[..., FlightPlan]

THRUST = HeldThrust(thrust_n=25900.0)
LIMITS = {"alpha_limits_rad": (-0.3, 0.5), "elevator_limits_rad": (-0.7, 0.35), "step_rad": to_si(0.5, "deg")}


def at(branch: SteadyBranch, alpha_rad: float) -> int:
    return int(np.argmin(np.abs(branch["alpha_rad"] - alpha_rad)))


@pytest.fixture(scope="module")
def rig_branch(f8ii_rig: Rig) -> SteadyBranch:
    return steady_branch(
        f8ii_rig, OnRig(), alpha_rad=0.05, alpha_limits_rad=(-0.59, 0.8), elevator_limits_rad=(-0.7, 0.35)
    )


@pytest.fixture(scope="module")
def gliding(f8ii_symmetric: Airborne) -> SteadyBranch:
    return steady_branch(f8ii_symmetric, THRUST, alpha_rad=0.05, **LIMITS)


# The rig


def test_the_rigs_branch_goes_through_both_folds_and_says_how_it_ends(rig_branch: SteadyBranch, f8ii_rig: Rig) -> None:
    """Two roads: the branch, and the curve over alpha that validation uses."""
    _, folds = equilibrium_curve(f8ii_rig.derivatives, alpha_limits_rad=(-0.59, 0.8), elevator_limits_rad=(-0.7, 0.35))
    assert len(rig_branch.folds) == 2
    for fold, other in zip(sorted(rig_branch.folds, key=lambda fold: fold.alpha_rad), folds, strict=True):
        assert fold.elevator_rad == pytest.approx(other.elevator_rad, abs=1e-10)
        assert fold.corner
    assert rig_branch.beginning is rig_branch.end is Ending.PARAMETER_LIMIT
    assert "elevator_rad reached its limit" in rig_branch.end_note
    assert rig_branch.residual.max() <= RESIDUAL
    assert set(rig_branch["alpha_rad"] > 0.44) == {True, False}
    between = (rig_branch["alpha_rad"] > -0.23) & (rig_branch["alpha_rad"] < 0.43)
    assert rig_branch.stable[between].all()
    outside = (rig_branch["alpha_rad"] < -0.24) | (rig_branch["alpha_rad"] > 0.44)
    assert not rig_branch.stable[outside].any()


def test_every_point_is_an_equilibrium_of_the_simulator(rig_branch: SteadyBranch, f8ii_rig: Rig) -> None:
    for elevator, (alpha, q) in zip(rig_branch.elevator_rad, rig_branch.state, strict=True):
        assert max(map(abs, f8ii_rig.derivatives(alpha, q, elevator))) <= RESIDUAL


def test_the_linear_model_has_names_units_and_the_published_derivatives(f8ii_rig: Rig) -> None:
    path = Path(__file__).parents[2] / "aircraft" / "f8ii" / "published.toml"
    tree = tomllib.loads(path.read_text(encoding="utf-8"))
    z, m = tree["alpha_dot_deg_s"], tree["q_dot_deg_s2"]
    model = linearized(f8ii_rig, state=np.array([to_si(5.05, "deg"), 0.1]), elevator_rad=-0.1)
    k = m["q_plus_alpha_dot"]
    assert model.A[0, 1] == pytest.approx(z["q"], rel=1e-8)
    assert model.A[1, 1] == pytest.approx(k * (1 + z["q"]), rel=1e-8)
    assert model.B[:, 0] == pytest.approx([z["elevator"], m["elevator"] + k * z["elevator"]], rel=1e-8)
    slope = sum(power * z[f"alpha{power}" if power > 1 else "alpha"] * 5.05 ** (power - 1) for power in (1, 2, 3))
    assert model.A[0, 0] == pytest.approx(slope, rel=1e-5)  # a chord of 0.1 deg in place of the tangent
    assert (model.state_names, model.input_names) == (("alpha_rad", "q_rad_s"), ("elevator_rad",))
    units, input_units = model.units()
    assert units == (("1_s", "1"), ("1_s2", "1_s"))
    assert input_units == (("1_s",), ("1_s2",))


# In the air


def test_a_steady_flight_stays_as_it_is(gliding: SteadyBranch, f8ii_symmetric: Airborne, make_plan: MakePlan) -> None:
    for alpha in (0.05, 0.2):
        row = at(gliding, alpha)
        speed, angle, q, theta = gliding.state[row]
        start = SymmetricStart(
            theta_rad=float(theta), airspeed_m_s=float(speed), altitude_m=f8ii_symmetric.condition.altitude_m
        )
        record = f8ii_symmetric.fly(
            make_plan(
                (0.0, float(gliding.elevator_rad[row])),
                alpha=float(angle),
                q=float(q),
                duration=0.5,
                start=start,
                power=FixedThrust(thrust_n=float(gliding.thrust_n[row])),
            )
        )
        # It climbs or sinks meanwhile into other air; within half a second that is little.
        assert np.abs(record["alpha_rad"] - angle).max() < 1e-4
        assert abs(record["q_dot_rad_s2"][0]) < 1e-9
        assert abs(record["alpha_dot_rad_s"][0]) < 1e-9


def test_symmetric_flight_has_folds_and_a_phugoid(gliding: SteadyBranch) -> None:
    assert gliding.residual.max() <= RESIDUAL
    assert len(gliding.folds) == 2
    modes = np.sort(
        np.abs(gliding.eigenvalues_real[at(gliding, 0.05)] + 1j * gliding.eigenvalues_imag[at(gliding, 0.05)])
    )
    speed = gliding["airspeed_m_s"][at(gliding, 0.05)]
    # Lanchester: the phugoid turns at about √2 g / V; the short period is far from it.
    assert modes[0] == pytest.approx(math.sqrt(2.0) * 9.77 / speed, rel=0.3)
    assert modes[-1] > 20.0 * modes[0]


def test_free_and_symmetric_flight_share_their_longitudinal_modes(
    gliding: SteadyBranch, f8ii_direct: Airborne, f8ii_symmetric: Airborne
) -> None:
    """Two fidelities: the same state linearized; what the turning Earth changes is 1e-3 of it."""
    row = at(gliding, 0.05)
    speed, alpha, q, theta = gliding.state[row]
    state = dict.fromkeys(STATE_NAMES, 0.0) | {
        "airspeed_m_s": speed,
        "alpha_rad": alpha,
        "q_rad_s": q,
        "theta_rad": theta,
    }
    elevator, thrust = float(gliding.elevator_rad[row]), float(gliding.thrust_n[row])
    whole = linearized(f8ii_direct, state=np.array([*state.values()]), elevator_rad=elevator, thrust_n=thrust)
    part = linearized(f8ii_symmetric, state=gliding.state[row], elevator_rad=elevator, thrust_n=thrust)
    rows = [STATE_NAMES.index(name) for name in part.state_names]
    np.testing.assert_allclose(whole.A[np.ix_(rows, rows)], part.A, rtol=5e-3, atol=2e-4)
    np.testing.assert_allclose(whole.B[rows], part.B, rtol=5e-3, atol=1e-9)
    lateral = [index for index in range(len(STATE_NAMES)) if index not in rows]
    assert np.abs(whole.A[np.ix_(rows, lateral)])[1:].max() < 1e-3  # by symmetry, but for the turning Earth
    assert whole.input_names == ("elevator_rad", "thrust_n")
    found = gliding.eigenvalues_real[row] + 1j * gliding.eigenvalues_imag[row]
    np.testing.assert_allclose(sorted(found.real), sorted(part.eigenvalues.real), atol=1e-4)


def test_thrust_acts_along_the_body_over_the_mass(f8ii_symmetric: Airborne) -> None:
    model = linearized(f8ii_symmetric, state=np.array([250.0, 0.1, 0.0, 0.1]), elevator_rad=-0.05, thrust_n=1e4)
    mass = f8ii_symmetric.mass_kg
    by_thrust = model.B[:, 1]
    assert by_thrust[0] == pytest.approx(math.cos(0.1) / mass, rel=1e-6)
    assert by_thrust[1] == pytest.approx(-math.sin(0.1) / (mass * 250.0), rel=1e-6)
    assert model.A[3] == pytest.approx([0.0, 0.0, 1.0, 0.0], abs=1e-5)  # θ' = q, but for the horizon's turning


@pytest.mark.parametrize("climb_deg", [0.0, 10.0])
def test_free_thrust_flies_the_path_that_is_asked_for(f8ii_symmetric: Airborne, climb_deg: float) -> None:
    branch = steady_branch(
        f8ii_symmetric, FreeThrust(climb_rad=to_si(climb_deg, "deg")), alpha_rad=0.05, alpha_limits_rad=(-0.01, 0.25),
        elevator_limits_rad=(-0.6, 0.2),
    )  # fmt: skip
    assert branch.residual.max() <= RESIDUAL
    np.testing.assert_allclose(branch["theta_rad"] - branch["alpha_rad"], to_si(climb_deg, "deg"), atol=1e-12)
    row = at(branch, 0.05)
    speed, alpha, _, theta = branch.state[row]
    weight = f8ii_symmetric.mass_kg * 9.77
    drag = branch.thrust_n[row] * math.cos(alpha) - weight * math.sin(theta - alpha)
    assert 0.05 * weight < drag < 0.4 * weight
    # eigenvalues are those of the motion with that thrust held
    held = linearized(
        f8ii_symmetric, state=branch.state[row], elevator_rad=float(branch.elevator_rad[row]),
        thrust_n=float(branch.thrust_n[row]),
    )  # fmt: skip
    np.testing.assert_allclose(np.sort(branch.eigenvalues_real[row]), np.sort(held.eigenvalues.real), atol=1e-9)
    assert speed > 100.0


@pytest.mark.parametrize("family", [THRUST, FreeThrust()], ids=["held", "free"])
def test_branches_of_free_flight_are_those_of_symmetric_flight_but_for_the_turning_earth(
    f8ii_direct: Airborne, f8ii_symmetric: Airborne, family: Family
) -> None:
    limits = {"alpha_limits_rad": (0.0, 0.2), "elevator_limits_rad": (-0.6, 0.2), "step_rad": to_si(1.0, "deg")}
    free, plane = (steady_branch(one, family, alpha_rad=0.08, **limits) for one in (f8ii_direct, f8ii_symmetric))
    assert free.residual.max() <= RESIDUAL
    order = np.argsort(plane["alpha_rad"])
    for name in ("airspeed_m_s", "theta_rad"):
        there = np.interp(free["alpha_rad"], plane["alpha_rad"][order], plane[name][order])
        np.testing.assert_allclose(free[name], there, rtol=0.02, atol=0.01)
    assert np.abs(free["phi_rad"]).max() < 0.01
    assert free.eigenvalues_real.shape == (len(free.elevator_rad), 8)


def test_any_aircraft_has_them(f16_symmetric: Airborne, f16_rig: Rig) -> None:
    limits = {"alpha_limits_rad": (0.0, 0.2), "elevator_limits_rad": (-0.4, 0.4), "step_rad": to_si(0.5, "deg")}
    for vehicle, family in ((f16_symmetric, HeldThrust(thrust_n=2e4)), (f16_rig, OnRig())):
        branch = steady_branch(vehicle, family, alpha_rad=0.06, **limits)
        assert branch.residual.max() <= RESIDUAL
        assert len(branch.elevator_rad) > 10
        assert branch.end in {Ending.STATE_LIMIT, Ending.PARAMETER_LIMIT}


# What is refused


def test_what_does_not_fit_is_refused(f8ii_rig: Rig, f8ii_symmetric: Airborne) -> None:
    with pytest.raises(InputError, match="not of the family"):
        steady_branch(f8ii_rig, THRUST, alpha_rad=0.05, **LIMITS)
    with pytest.raises(InputError, match="not of the family"):
        steady_branch(f8ii_symmetric, OnRig(), alpha_rad=0.05, **LIMITS)
    with pytest.raises(InputError, match="climb"):
        steady_branch(f8ii_symmetric, FreeThrust(climb_rad=2.0), alpha_rad=0.05, **LIMITS)
    with pytest.raises(InputError, match="do not fit shapes"):
        linearized(f8ii_rig, state=np.zeros(3), elevator_rad=0.0)
    with pytest.raises(InputError, match="linearized"):
        linearized(f8ii_rig, state=np.array([math.nan, 0.0]), elevator_rad=0.0)


def test_a_linear_model_is_a_value(f8ii_rig: Rig) -> None:
    model = linearized(f8ii_rig, state=np.array([0.1, 0.0]), elevator_rad=0.0)
    assert isinstance(model, LinearModel)
    assert not model.A.flags.writeable


CORNER = 0.46


def cornered(x: FloatArray, elevator: float, _: float) -> FloatArray:
    """Return rates with a corner at which slopes of 300 and 10 meet."""
    beyond = x[0] - CORNER
    return np.array([10.0 * beyond + 290.0 * max(beyond, 0.0) + 1e-9 * elevator, x[1]])


def test_a_point_beside_a_corner_is_solved_as_well_as_any() -> None:
    names = ("alpha_rad", "q_rad_s")
    problem = SteadyProblem(names, names, cornered, np.ones(2), lambda x: x, lambda _: 0.0)
    unknowns, _, left = steady._polished(problem, np.array([CORNER - 2e-9, 0.0]), 0.2)
    assert left <= RESIDUAL
    assert np.abs(cornered(unknowns, 0.2, 0.0)).max() <= RESIDUAL


@pytest.mark.parametrize(
    ("spoiled", "told"),
    [(slice(0, 3), "beginning_note"), (slice(-2, None), "end_note"), (slice(7, 8), "end_note")],
    ids=["beginning", "end", "between"],
)
def test_a_branch_keeps_what_is_solved(
    spoiled: slice, told: str, f8ii_rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = {"alpha_limits_rad": (0.0, 0.2), "elevator_limits_rad": (-0.7, 0.35), "step_rad": to_si(1.0, "deg")}
    whole = steady_branch(f8ii_rig, OnRig(), alpha_rad=0.05, **limits)
    polished, bad = steady._polished, whole.elevator_rad[spoiled].tolist()

    def spoiling(problem: SteadyProblem, x: FloatArray, elevator: float) -> tuple[FloatArray, float, float]:
        *point, left = polished(problem, x, elevator)
        return *point, 3e-9 if point[1] in bad else left

    monkeypatch.setattr(steady, "_polished", spoiling)
    branch = steady_branch(f8ii_rig, OnRig(), alpha_rad=0.05, **limits)
    kept = ~np.isin(whole.elevator_rad, bad)
    np.testing.assert_array_equal(branch.state, whole.state[kept])
    np.testing.assert_array_equal(branch.eigenvalues_real, whole.eigenvalues_real[kept])
    assert branch.residual.max() <= RESIDUAL
    assert f"{len(bad)} point" in getattr(branch, told)
    assert "3.0e-09" in getattr(branch, told)
    inside = spoiled.start == 7
    assert (branch.beginning is whole.beginning) == (told == "end_note")
    assert (branch.end is whole.end) == (told == "beginning_note" or inside)
    bad[:] = whole.elevator_rad.tolist()
    with pytest.raises(RefusedError, match="no point"):
        steady_branch(f8ii_rig, OnRig(), alpha_rad=0.05, **limits)

"""The analysis of a planar field as one value: ranges, grid, and what the notes tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.analysis import PlanarAnalysis, PlanarAnalysisOptions, PlanarEvent, analyze_planar
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, RefusedError

_NAMES = ("x_1", "y_1", "mu_1")
_OPTIONS = PlanarAnalysisOptions(
    parameter_range=(-1.0, 1.0), parameter_step=0.3, first_range=(-2.0, 2.0), second_range=(-2.0, 2.0)
)


def _analysis(first: dict[tuple[int, ...], float], second: dict[tuple[int, ...], float]) -> PlanarAnalysis:
    one, two = (Polynomial.build(t, variables=_NAMES, value_unit="1") for t in (first, second))
    return analyze_planar(PlanarSystem.from_polynomials(one, two), _OPTIONS)


def test_the_grid_divides_the_range() -> None:
    np.testing.assert_allclose(_OPTIONS.grid, np.linspace(-1.0, 1.0, 8))
    assert replace(_OPTIONS, parameter_step=100.0).grid == (-1.0, 1.0)


@pytest.mark.parametrize(
    "change",
    [
        {"parameter_range": (1.0, 1.0)},
        {"first_range": (2.0, 1.0)},
        {"second_range": (-np.inf, 1.0)},
        {"parameter_step": 0.0},
        {"parameter_step": float("nan")},
    ],
)
def test_what_is_no_range_is_refused(change: dict[str, tuple[float, float]]) -> None:
    with pytest.raises(InputError, match=next(iter(change))):
        replace(_OPTIONS, **change)  # type: ignore[arg-type]


def test_equilibria_are_listed_within_the_box_and_counted_outside() -> None:
    analysis = _analysis({(1, 0, 0): 3.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.0, (0, 0, 1): 1.0})
    assert [p.parameter for p in analysis.equilibria] == list(_OPTIONS.grid)
    assert all(p.state[0] == 0.0 for p in analysis.equilibria)
    assert "Equilibria outside the ranges of the states, not listed: 8." in analysis.notes
    assert len(analysis.found.branches) == 1


def test_the_notes_name_what_is_special() -> None:
    cusp = _analysis({(0, 0, 1): 1.0, (3, 0, 0): -1.0}, {(0, 1, 0): -1.0})
    assert any("a cusp, or two folds within rounding" in note for note in cusp.notes)
    crossing = _analysis({(1, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.5})
    assert any("branches cross (transcritical)" in note for note in crossing.notes)
    double = _analysis({(0, 1, 0): 1.0}, {(0, 0, 1): 1.0, (2, 0, 0): 1.0, (1, 1, 0): 1.0})
    assert any("trace and determinant vanish together" in note for note in double.notes)
    still = _analysis({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 0, 1): 0.3})
    assert any("no Hopf point can be told" in note for note in still.notes)
    nothing = _analysis({(0, 0, 0): 1.0}, {(0, 1, 0): -1.0})
    assert any("no equilibrium" in note for note in nothing.notes)
    assert nothing.found.branches == ()


def test_what_is_extrapolated_is_said(paper_model: PolynomialModel) -> None:
    domain = np.array([[-0.2, 0.3], [-np.inf, np.inf], [-0.4, 0.4]])
    model = replace(
        paper_model,
        alpha_dot=replace(paper_model.alpha_dot, domain=domain),
        q_dot=replace(paper_model.q_dot, domain=domain),
    )
    options = PlanarAnalysisOptions(
        parameter_range=(-1.0, 0.7), parameter_step=0.2, first_range=(-1.2, 1.2), second_range=(-3.0, 3.0)
    )
    analysis = analyze_planar(PlanarSystem.from_model(model), options)
    extrapolated = [note for note in analysis.notes if note.startswith("The fold")]
    # The published fold of the lower branch, in degrees as a reader of the paper knows it.
    assert len(extrapolated) == 2
    assert "elevator -35.129°" in extrapolated[0]
    assert sum(not p.in_domain for p in analysis.equilibria) > 0
    assert any(note.startswith("Equilibria listed where no data") for note in analysis.notes)
    (branch,) = analysis.found.branches
    inside = (branch.state[:, 0] >= -0.2) & (branch.state[:, 0] <= 0.3)  # at any elevator: it enters linearly
    np.testing.assert_array_equal(branch.in_domain, inside)


def test_a_line_of_equilibria_is_refused() -> None:
    with pytest.raises(RefusedError, match="not isolated"):
        _analysis({(1, 0, 0): 1.0}, {(1, 1, 0): 1.0})


def test_regimes_cover_the_range_and_are_split_at_every_event() -> None:
    """x" = y, y' = mu y − x² y − x: one sink before the Hopf point at 0, none after."""
    analysis = _analysis({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 0): -1.0})
    before, after = analysis.regimes
    assert (before.events, after.events) == (
        (PlanarEvent.RANGE, PlanarEvent.HOPF),
        (PlanarEvent.HOPF, PlanarEvent.RANGE),
    )
    np.testing.assert_allclose([*before.parameter, *after.parameter], [-1.0, 0.0, 0.0, 1.0], atol=1e-14)
    assert (before.regions, after.regions) == (1, 0)
    assert [region.parameter for region in analysis.regions] == [before.parameter_seen]
    assert any("There is no saddle within the ranges" in note for note in analysis.notes)


def test_connections_that_were_not_found_are_said_to_be_measured() -> None:
    """x" = −x' + x − x³ + mu/10: a saddle between two sinks, and neither loops nor orbits to another saddle."""
    analysis = _analysis({(0, 1, 0): 1.0}, {(0, 1, 0): -1.0, (1, 0, 0): 1.0, (3, 0, 0): -1.0, (0, 0, 1): 0.1})
    assert analysis.connections.homoclinics == ()
    assert sum("No saddle connection was found" in note and "not proved" in note for note in analysis.notes) == 1


def test_one_parameter_without_isolated_equilibria_stops_nothing() -> None:
    """The field x' = mu, y' = x − y: no equilibrium at all but at mu = 0, which the grid meets."""
    options = replace(_OPTIONS, parameter_step=0.25)
    first = Polynomial.build({(0, 0, 1): 1.0}, variables=_NAMES, value_unit="1")
    second = Polynomial.build({(1, 0, 0): 1.0, (0, 1, 0): -1.0}, variables=_NAMES, value_unit="1")
    analysis = analyze_planar(PlanarSystem.from_polynomials(first, second), options)
    assert analysis.equilibria == ()
    (note,) = (note for note in analysis.notes if "no equilibrium is listed" in note)
    assert note.startswith("At mu 0 ")

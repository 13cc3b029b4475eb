"""The planar system: what it evaluates to, on both roads, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.system import PlanarFlow, PlanarScale, PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.errors import InputError, RefusedError

_NAMES = ("x_1", "y_1", "mu_1")


def _polynomial(terms: dict[tuple[int, ...], float]) -> Polynomial:
    return Polynomial.build(terms, variables=_NAMES, value_unit="1")


def test_a_model_and_its_lienard_form_move_alike(paper_model: PolynomialModel) -> None:
    """Two roads: dα/dt and d²α/dt² from (alpha, q) by the chain rule, and from the Liénard form."""
    system = reduce(paper_model)
    plane, lienard = PlanarSystem.from_model(paper_model), PlanarSystem.from_lienard(system)
    generator = np.random.default_rng(3)
    for alpha, q, elevator in generator.uniform(-0.8, 0.8, (20, 3)):
        rates = plane.velocity((alpha, q), elevator)
        second = plane.jacobian((alpha, q), elevator)[0] @ rates
        np.testing.assert_allclose(lienard.velocity((alpha, rates[0]), elevator), [rates[0], second], atol=1e-12)
        jacobian = lienard.jacobian((alpha, rates[0]), elevator)
        own = plane.jacobian((alpha, q), elevator)
        assert np.trace(jacobian) == pytest.approx(np.trace(own), abs=1e-12)
    assert lienard.variables == ("alpha_rad", "alpha_dot_rad_s", "elevator_rad")
    assert lienard.covariance.shape == system.covariance.shape


def test_the_flow_is_the_velocity_in_other_units(printed_system: LienardSystem) -> None:
    system = PlanarSystem.from_lienard(printed_system)
    scale = PlanarScale(first=0.3, second=1.7, time=0.25)
    flow = system.at(-0.2, scale)
    for x, y in ((0.0, 0.0), (1.3, -0.4), (-2.0, 5.0)):
        expected = system.velocity((0.3 * x, 1.7 * y), -0.2) * 0.25 / np.array([0.3, 1.7])
        np.testing.assert_allclose(flow.velocity(x, y), expected, rtol=1e-13)
    # The constant of y' nearly cancels here: its size remembers what it was summed from.
    trim = float(printed_system.holding_elevator(0.0))
    held = system.at(trim)
    assert abs(held.second[0, 0]) < 1e-15 < held.second_sizes[0, 0]


def test_a_table_holds_every_term() -> None:
    first = _polynomial({(1, 2, 0): 2.0, (1, 2, 1): -0.5, (0, 0, 2): 1.0})
    second = _polynomial({(3, 0, 0): 1.0})
    flow = PlanarSystem.from_polynomials(first, second).at(2.0)
    assert flow.first.shape == flow.second.shape == (4, 3)
    assert flow.first[1, 2] == 1.0
    assert flow.first_sizes[1, 2] == 3.0
    assert flow.first[0, 0] == 4.0
    assert flow.second[3, 0] == 1.0
    assert flow.velocity(2.0, 3.0) == (22.0, 8.0)


def test_the_domain_is_where_both_polynomials_hold() -> None:
    one = replace(_polynomial({(0, 0, 0): 1.0}), domain=np.array([[-1.0, 2.0], [-np.inf, 1.0], [0.0, 1.0]]))
    two = replace(_polynomial({(0, 0, 0): 1.0}), domain=np.array([[-2.0, 1.0], [0.0, np.inf], [0.0, 1.0]]))
    system = PlanarSystem.from_polynomials(one, two)
    np.testing.assert_array_equal(system.domain, [[-1.0, 1.0], [0.0, 1.0], [0.0, 1.0]])
    assert system.contains((0.0, 0.5), 0.5)
    assert not system.contains((1.5, 0.5), 0.5)
    assert not system.contains((0.0, 0.5), 1.5)


def test_intervals_and_replaced_coefficients() -> None:
    system = PlanarSystem.from_polynomials(
        _polynomial({(1, 0, 0): 1.0}), _polynomial({(0, 1, 0): 2.0}), covariance=np.diag([0.04, 0.0])
    )
    np.testing.assert_allclose(system.interval(3.0, np.array([0.5, 1.0])), [3.0 - 0.1959964, 3.0 + 0.1959964], 1e-6)
    np.testing.assert_array_equal(system.interval(3.0, np.array([np.nan, 1.0])), [-np.inf, np.inf])
    other = system.with_coefficients(np.array([5.0, 7.0]))
    np.testing.assert_array_equal(other.velocity((1.0, 1.0), 0.0), [5.0, 7.0])


def test_a_system_checks_its_parts() -> None:
    good = _polynomial({(1, 0, 0): 1.0})
    foreign = Polynomial.build({(1, 0, 0): 1.0}, variables=("x_1", "z_1", "mu_1"), value_unit="1")
    degrees = Polynomial.build({(1, 0, 0): 1.0}, variables=("x_deg", "y_1", "mu_1"), value_unit="1")
    with pytest.raises(InputError, match="same three variables"):
        PlanarSystem.from_polynomials(good, foreign)
    with pytest.raises(InputError, match="in SI"):
        PlanarSystem.from_polynomials(degrees, degrees)
    with pytest.raises(InputError, match="do not fit a covariance"):
        PlanarSystem.from_polynomials(good, good, covariance=np.zeros((3, 3)))
    with pytest.raises(InputError, match="positive units"):
        PlanarScale(first=0.0)
    table = np.zeros((2, 2))
    with pytest.raises(InputError, match="one shape"):
        PlanarFlow(first=table, second=np.zeros((1, 2)), first_sizes=table, second_sizes=table, scale=PlanarScale())
    with pytest.raises(RefusedError, match="too large"):
        PlanarSystem.from_polynomials(good, _polynomial({(0, 0, 4): 1e300})).at(1e9)


def test_a_parameter_that_enters_linearly_and_alone_is_supported_everywhere() -> None:
    box = np.array([[-1.0, 1.0], [-2.0, 2.0], [-0.5, 0.5]])
    for terms, alone in (
        ({(0, 0, 1): 1.0, (1, 1, 0): 2.0}, True),
        ({(0, 0, 2): 1.0}, False),
        ({(1, 0, 1): 1.0}, False),
        ({(0, 0, 0): 1.0}, False),
    ):
        rate, moment = (replace(_polynomial(one), domain=box) for one in ({(0, 1, 0): 1.0}, terms))
        system = PlanarSystem.from_polynomials(rate, moment)
        np.testing.assert_array_equal(system.domain, box)
        np.testing.assert_array_equal(system.supported[:2], box[:2])
        assert system.contains([0.0, 0.0], 3.0) is alone
        assert not system.contains([1.1, 0.0], 0.0)

"""Families of flows: what the two parameters do, and what they leave alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.dynamics.family import Family, lienard_family
from finback.dynamics.flow import Scale, flow_at, rests
from finback.dynamics.lienard import LienardSystem
from finback.errors import InputError, RefusedError

_CUBIC = Family(damping=(0.0, 0.5, -1.0), force=(0.0, 0.0, 0.5, 1.0), direction=(0.0, 1.0))
_NUMBER = st.floats(-3.0, 3.0)


@settings(deadline=None)
@given(mu=_NUMBER, lam=_NUMBER, x=_NUMBER, y=_NUMBER)
def test_the_field_is_what_the_formula_says(mu: float, lam: float, x: float, y: float) -> None:
    expected = (-x * x + 0.5 * x + lam) * y + (x * x + 0.5 * x + mu) * x
    assert _CUBIC.at(mu, lam).acceleration(x, y) == pytest.approx(expected, abs=1e-13)  # a dozen roundings of 40


@settings(deadline=None)
@given(mu=st.floats(-3.0, -0.1), lam=_NUMBER)
def test_lambda_moves_no_equilibrium(mu: float, lam: float) -> None:
    assert [point.x for point in rests(_CUBIC.at(mu, lam))] == [point.x for point in rests(_CUBIC.at(mu, 0.0))]


def test_a_direction_may_reach_higher_than_the_force() -> None:
    flow = Family(damping=(1.0,), force=(2.0,), direction=(0.0, 0.0, -3.0)).at(2.0, -0.5)
    assert (flow.damping, flow.force, flow.force_sizes) == ((0.5,), (2.0, 0.0, -6.0), (2.0, 0.0, 6.0))


def test_the_family_of_a_system_passes_through_the_system(printed_system: LienardSystem) -> None:
    scale = Scale(length_rad=0.4, time_s=0.3)
    flow, expected = lienard_family(printed_system, scale).at(-0.1, 0.0), flow_at(printed_system, -0.1, scale)
    for name in ("damping", "force", "force_sizes"):
        np.testing.assert_allclose(getattr(flow, name), getattr(expected, name), rtol=1e-15, atol=0)


def test_what_is_not_finite_is_refused(printed_system: LienardSystem) -> None:
    with pytest.raises(InputError, match="damping"):
        Family(damping=(), force=(1.0,), direction=(1.0,))
    with pytest.raises(InputError, match="force"):
        Family(damping=(1.0,), force=(math.nan,), direction=(1.0,))
    with pytest.raises(InputError, match="finite parameters"):
        _CUBIC.at(0.0, math.inf)
    with pytest.raises(RefusedError, match="too large"):
        lienard_family(printed_system, Scale(length_rad=1e100, time_s=1e150))
    # A power of a float beyond double precision is refused, too, not raised as an OverflowError.
    with pytest.raises(RefusedError, match="too large"):
        lienard_family(printed_system, Scale(length_rad=1e200, time_s=1.0))

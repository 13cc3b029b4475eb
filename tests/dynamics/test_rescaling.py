"""Changes of coordinates: the new field moves states as the old one does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.dynamics.flow import Flow
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.errors import InputError

_ROUNDING = 1e-12  # a few dozen operations on numbers up to 100

_size = st.floats(0.2, 5.0).flatmap(lambda size: st.sampled_from([size, -size]))
_rescaling = st.builds(Rescaling, length=_size, time=_size, shift=st.floats(-2.0, 2.0))
_number = st.floats(-3.0, 3.0)
_row = st.lists(_number, min_size=1, max_size=4).map(tuple)


def _flow(damping: tuple[float, ...], force: tuple[float, ...]) -> Flow:
    return Flow(damping=damping, force=force, force_sizes=tuple(map(abs, force)))


@given(_rescaling, _row, _row, _number, _number)
def test_the_field_commutes_with_the_change(
    change: Rescaling, damping: tuple[float, ...], force: tuple[float, ...], x: float, y: float
) -> None:
    """dX/dT = Y and dY/dT = the old acceleration in new units."""
    old = _flow(damping, force)
    new_x, new_y = change.to_new(x, y)
    speed, acceleration = change.to_new(change.shift + y, old.acceleration(x, y))
    assert float(speed) * change.time == pytest.approx(float(new_y), abs=_ROUNDING)
    got = change.flow(old).acceleration(float(new_x), float(new_y))
    size = np.polyval(np.abs(force[::-1]), abs(x) + 2.0) + abs(y) * np.polyval(np.abs(damping[::-1]), abs(x) + 2.0)
    unit = change.time * change.time / abs(change.length)
    assert got == pytest.approx(float(acceleration) * change.time, abs=_ROUNDING * (1.0 + size) * (1.0 + unit))


@given(_rescaling, _rescaling, _number, _number)
def test_changes_compose_and_invert(first: Rescaling, second: Rescaling, x: float, y: float) -> None:
    there = first.to_new(x, y)
    both = first.then(second).to_new(x, y)
    np.testing.assert_allclose(both, second.to_new(*there), rtol=_ROUNDING, atol=1e2 * _ROUNDING)
    np.testing.assert_allclose(first.to_old(*there), (x, y), rtol=_ROUNDING, atol=_ROUNDING)
    np.testing.assert_allclose(first.inverse().to_new(*there), (x, y), rtol=_ROUNDING, atol=_ROUNDING)


def test_what_has_no_inverse_is_refused() -> None:
    for wrong in ({"length": 0.0}, {"time": 0.0}, {"shift": np.inf}, {"length": np.nan}):
        with pytest.raises(InputError, match="no change of coordinates"):
            Rescaling(**wrong)

"""The recorder keeps every number bit for bit and converts it once."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.flight.recorder import Recorder
from finback.units import to_si


@given(values=st.lists(st.tuples(st.floats(), st.floats()), max_size=20))
def test_rows_are_what_was_read_in_si(values: list[tuple[float, float]]) -> None:
    rows = iter(values)
    now = [(0.0, 0.0)]
    recorder = Recorder([lambda: now[0][0], lambda: now[0][1]], ["rad", "ft"])
    for row in rows:
        now[0] = row
        recorder.take()
    table = recorder.table()
    assert len(recorder) == len(values)
    assert table.shape == (len(values), 2)
    wanted = np.array(values, dtype=np.float64).reshape(-1, 2)
    wanted[:, 1] = to_si(wanted[:, 1], "ft")
    assert table.tobytes() == wanted.tobytes() or np.array_equal(table, wanted, equal_nan=True)


def test_a_table_can_be_had_while_it_grows() -> None:
    numbers = count()
    recorder = Recorder([lambda: float(next(numbers))], ["s"])
    recorder.take()
    first = recorder.table()
    recorder.take()
    assert first.tolist() == [[0.0]]
    assert recorder.table().tolist() == [[0.0], [1.0]]


def test_each_column_has_a_unit() -> None:
    with pytest.raises(ValueError, match="1 columns with 2 units"):
        Recorder([float], ["s", "s"])

"""Which predicted point is which simulated one."""

from __future__ import annotations

from hypothesis import given, strategies as st

from finback.validation.matching import match

points = st.lists(st.integers(min_value=-1000, max_value=1000), max_size=6, unique=True).map(
    lambda values: sorted(0.01 * value for value in values)
)


def test_a_missing_point_is_found() -> None:
    matching = match([-0.24, 0.43], [0.44])
    assert matching.pairs == ((1, 0),)
    assert (matching.simulated_alone, matching.predicted_alone) == ((0,), ())


def test_nothing_matches_nothing() -> None:
    assert match([], []).pairs == ()
    assert match([1.0], []).simulated_alone == (0,)
    assert match([], [1.0, 2.0]).predicted_alone == (0, 1)


@given(points, points)
def test_every_point_has_one_partner_or_none_and_order_is_kept(simulated: list[float], predicted: list[float]) -> None:
    matching = match(simulated, predicted)
    rows, columns = [row for row, _ in matching.pairs], [column for _, column in matching.pairs]
    assert len(matching.pairs) == min(len(simulated), len(predicted))
    assert sorted([*rows, *matching.simulated_alone]) == list(range(len(simulated)))
    assert sorted([*columns, *matching.predicted_alone]) == list(range(len(predicted)))
    total = sum(abs(simulated[row] - predicted[column]) for row, column in matching.pairs)
    in_order = sum(abs(simulated[row] - predicted[column]) for row, column in zip(rows, sorted(columns), strict=True))
    assert total <= in_order + 1e-9  # rounding of sums below 60

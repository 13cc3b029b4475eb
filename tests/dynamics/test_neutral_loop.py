"""Neutral loops: the diagram's point as the second road, brute conditions, and mistakes."""

from __future__ import annotations

import pytest

from finback.dynamics.connection.loop import loops
from finback.dynamics.diagram.curve import DiagramOptions, PointKind
from finback.dynamics.diagram.diagram import diagram
from finback.dynamics.diagram.neutral import neutral_loops
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import InputError

# The trace rises with μ at a rate near 1, and is known to some 1e-13 (λ by shooting): so is μ.
PLACE = 1e-11


@pytest.mark.parametrize(("a1", "b1", "b2", "span"), [(0.5, 0.5, 1.0, (-2.0, -0.3)), (-0.3, 1.0, -1.0, (-0.5, -0.1))])
def test_it_is_the_diagrams_point(a1: float, b1: float, b2: float, span: tuple[float, float]) -> None:
    family = Cubic(a1=a1, b1=b1, b2=b2, a0=0.0, b0=span[0]).family()
    found = neutral_loops(family, span)
    drawn = diagram(family, span, options=DiagramOptions(nodes=7)).points
    expected = sorted((point.mu, point.lam) for point in drawn if point.kind is PointKind.NEUTRAL_LOOP)
    assert expected
    assert [one.mu for one in found] == pytest.approx([mu for mu, _ in expected], abs=PLACE)
    assert [one.lam for one in found] == pytest.approx([lam for _, lam in expected], abs=PLACE)
    for one in found:
        assert one.bracket[0] < one.mu < one.bracket[1]
        sides = [
            next(loop for loop in loops(family, mu, most_turns=2) if loop.route == one.loop.route).saddle_trace
            for mu in one.bracket.tolist()
        ]
        assert sides[0] * sides[1] < 0.0


def test_without_one_nothing_is_found() -> None:
    assert neutral_loops(Cubic(a1=0.5, b1=0.5, a0=0.0, b0=-2.0).family(), (-0.2, -0.05)) == ()


def test_mistakes_are_told() -> None:
    family = Cubic(a1=0.5, b1=0.5, a0=0.0, b0=-1.0).family()
    with pytest.raises(InputError, match="no range"):
        neutral_loops(family, (-1.0, -2.0))
    with pytest.raises(InputError, match="needs two"):
        neutral_loops(family, (-2.0, -1.0), nodes=1)

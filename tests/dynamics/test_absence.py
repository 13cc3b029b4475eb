"""Absence of limit cycles: proofs over whole ranges, and systems with cycles, which must never be proved free."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.flow import plain_flow
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.absence import Absence, AbsenceMeasured, AbsenceProven, Theorem, absence
from finback.dynamics.stability.interval import Effort, Interval, evaluate, everywhere, homogeneous
from finback.dynamics.stability.level_criterion import energy_levels, field_of, mean_damping, strip_of
from finback.errors import RefusedError
from finback.units import to_si

Build = Callable[..., LienardSystem]


def test_the_published_aircraft_never_cycles(printed_system: LienardSystem) -> None:
    """Proved for every elevator from −60 to 40 degrees, the folds included."""
    found = absence(printed_system, (to_si(-60.0, "deg"), to_si(40.0, "deg")))
    assert found.proven
    assert not found.refuted
    first, last = sorted(fold.elevator_rad for fold in folds(printed_system))
    inside = sorted((tuple(p.elevator_rad) for p in found.parts if p.enclosed), key=lambda span: span[0])
    assert inside[0][0] == pytest.approx(first, abs=1e-12)
    assert inside[-1][1] == pytest.approx(last, abs=1e-12)
    assert all(a[1] == b[0] for a, b in pairwise(inside))
    outside = [p for p in found.parts if not p.enclosed]
    assert [p.theorem for p in outside if isinstance(p, AbsenceProven)] == [Theorem.INDEX] * 2


def test_the_mean_of_the_damping_is_negative_all_the_way_to_both_saddles(printed_system: LienardSystem) -> None:
    """The second road to the proof: plain numbers, 400 sinks and 400 angles between the saddles of each."""
    f, g = printed_system.damping.ascending, printed_system.force.ascending
    turns = np.sort(np.roots(np.polynomial.polynomial.polyder(g)[::-1]).real)
    for s in np.linspace(turns[0] + 0.045, turns[1], 400):
        low, high = np.sort(np.roots((g - [g[0] + np.polynomial.polynomial.polyval(s, g) - g[0], 0, 0, 0])[::-1]).real)[
            [0, 2]
        ]
        x = np.linspace(low, high, 400)
        primitive = np.polynomial.polynomial.polyint(f)
        change = np.polynomial.polynomial.polyval(x, primitive) - np.polynomial.polynomial.polyval(s, primitive)
        assert (change * (x - s) <= 0.0).all()


@pytest.mark.parametrize(
    ("b2", "parameters", "free"),
    [
        # (a1, b1, b0, a0) between published loops, folds and Hopf points of both families.
        (1.0, (0.5, 0.5, -1.0, -0.01), True),
        (1.0, (0.5, 0.5, -1.0, 0.03), False),
        (1.0, (0.5, 0.5, -1.0, 0.0594), False),
        (1.0, (0.5, 0.5, -1.0, 0.1), True),
        (1.0, (1.0, 0.75, -1.0, 0.0053), False),
        (1.0, (1.0, 0.75, -1.0, 0.01), True),
        (-1.0, (0.0, 0.0, 1.0, -0.1), True),
        (-1.0, (0.0, 0.0, 1.0, 0.79), False),
        (-1.0, (0.0, 0.0, 1.0, 0.9), False),
        (-1.0, (1.0, 0.5, -1.0, -0.05), True),
        (-1.0, (2.0, 1.2, -1.0, -0.2), True),
        (-1.0, (2.0, 1.2, -1.0, -0.05), False),
    ],
)
def test_known_members_of_the_cubic_family(
    build_system: Build, b2: float, parameters: tuple[float, ...], *, free: bool
) -> None:
    a1, b1, b0, a0 = parameters
    found = absence(build_system((a0, a1, -1.0), (0.0, b0, b1, b2), gain=0.0), (0.0, 0.0))
    assert found.proven == free
    assert found.refuted == (not free)


@given(
    damping=st.lists(st.integers(-20, 20), min_size=1, max_size=3),
    force=st.lists(st.integers(-20, 20), min_size=4, max_size=4),
)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_no_system_with_a_cycle_is_proved_free(build_system: Build, damping: list[int], force: list[int]) -> None:
    """Whatever is proved free has no cycle that a systematic search finds."""
    assume(any(force[1:]))
    f, g = [0.1 * c for c in damping], [0.1 * c for c in force]
    try:
        cycles = flow_cycles(plain_flow(f, g)).cycles
    except RefusedError:
        return
    found = absence(build_system(f, g, gain=0.0), (0.0, 0.0))
    assert not (cycles and found.proven)
    for part in found.parts:
        if isinstance(part, AbsenceProven) and part.enclosed:
            low, high = part.alpha_rad
            assert not any(
                len(c.enclosed) == part.enclosed and low - 1e-9 <= c.enclosed[0] <= high + 1e-9 for c in cycles
            )


def _coverage(found: Absence, low: float, high: float) -> bool:
    """Tell whether the parts leave no elevator out."""
    reached = low
    for start, end in sorted(tuple(part.elevator_rad) for part in found.parts):
        if start > reached + 1e-12:
            return False
        reached = max(reached, end)
    return reached >= high - 1e-12


def test_a_hopf_point_leaves_a_gap_in_which_cycles_are_found(build_system: Build) -> None:
    """F = x² − 0.3: sources outside ±0.548, sinks inside with an unstable cycle around them."""
    found = absence(build_system((-0.3, 0.0, 1.0), (0.0, -1.0, 0.0, 0.5)), (-1.0, 1.0))
    assert _coverage(found, -1.0, 1.0)
    assert found.refuted
    assert not found.proven
    hopf = -(0.3**0.5) * (0.5 * 0.3 - 1.0)
    (measured,) = (part for part in found.parts if isinstance(part, AbsenceMeasured))
    assert measured.elevator_rad[1] == pytest.approx(hopf, abs=2e-3)
    proved = [part for part in found.parts if isinstance(part, AbsenceProven) and part.enclosed]
    assert {part.theorem for part in proved} <= {Theorem.ENERGY_LEVELS, Theorem.MEAN_DAMPING}
    assert len(proved) == 2


def test_bendixson_reaches_cycles_around_several(build_system: Build) -> None:
    found = absence(build_system((-0.2,), (0.0, 1.0, 0.0, -1.0)), (-0.1, 0.1))
    assert found.proven
    assert [p.theorem for p in found.parts if p.enclosed == 3 and isinstance(p, AbsenceProven)] == [Theorem.BENDIXSON]


def test_without_damping_nothing_is_proved(build_system: Build) -> None:
    """A center: closed orbits everywhere, and no theorem here says more than that none is isolated."""
    found = absence(build_system((0.0,), (0.0, -1.0)), (-1.0, 1.0))
    assert not found.proven
    with pytest.raises(RefusedError, match="is empty"):
        absence(build_system((-1.0,), (0.0, -1.0)), (1.0, -1.0))


numbers = st.floats(-4.0, 4.0, allow_nan=False).map(lambda value: round(value, 3))


@given(st.lists(numbers, min_size=1, max_size=5), numbers, numbers, st.floats(0.0, 1.0))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_intervals_hold_the_exact_value(row: list[float], one: float, other: float, share: float) -> None:
    """Rational arithmetic of a polynomial at a point of the interval, plain and homogeneous."""
    low, high = min(one, other), max(one, other)
    x = min(max(low + share * (high - low), low), high)
    interval = Interval(np.array([low]), np.array([high]))
    coefficients = [Interval.around(c) for c in row]
    exact = sum(Fraction(c) * Fraction(x) ** k for k, c in enumerate(row))
    found = evaluate(coefficients, interval)
    assert Fraction(float(found.low.ravel()[0])) <= exact <= Fraction(float(found.high.ravel()[0]))
    w = Fraction(0.375)
    exact = sum(Fraction(c) * Fraction(x) ** k * w ** (len(row) - 1 - k) for k, c in enumerate(row))
    found = homogeneous(coefficients, interval, Interval.around(float(w)))
    assert Fraction(float(found.low.ravel()[0])) <= exact <= Fraction(float(found.high.ravel()[0]))
    third = Interval.around(Fraction(1, 3))
    assert Fraction(float(third.low)) < Fraction(1, 3) < Fraction(float(third.high))


def plenty() -> Effort:
    return Effort(1_000_000)


@pytest.mark.parametrize(("constant", "holds"), [(-0.3, True), (-0.2, False), (-0.25, False)])
def test_a_claim_is_decided_in_every_box(constant: float, *, holds: bool) -> None:
    """X − x² + c < 0 on [0, 1] for c < −1/4 only; Horner's rule on the whole interval cannot tell."""

    def claim(box: Interval) -> tuple[np.ndarray, np.ndarray]:
        row = [Interval.around(c) for c in (constant, 1.0, -1.0)]
        value = evaluate(row, Interval(box.low[0], box.high[0]))
        return value.high < 0.0, value.low >= 0.0

    boxes = everywhere(claim, np.array([[(0.0, 1.0)]]), plenty())
    assert (boxes > 1) == holds
    assert (
        everywhere(lambda _: (np.array(True), np.array(False)), np.array([[(0.0, 1.0)], [(1.0, 2.0)]]), plenty()) == 2
    )


@pytest.mark.parametrize("sign", [-1, 1])
def test_criteria_have_a_sign_and_need_the_right_one(sign: int) -> None:
    """X'' = ±x'(1 − x²/8) − x: no cycle can be excluded; with x²/8 left out both criteria hold, for one sign."""
    plain = strip_of(field_of([0.5 * sign], [0.0, -1.0, 0.0, 1.0]), (-0.1, 0.1))
    assert plain.left == pytest.approx(1.1, abs=0.2)
    assert mean_damping(plain, sign, plenty())
    assert energy_levels(plain, sign, plenty())
    assert not mean_damping(plain, -sign, plenty())
    assert not energy_levels(plain, -sign, plenty())
    van_der_pol = strip_of(field_of([sign, 0.0, -0.125 * sign], [0.0, -1.0]), (-0.1, 0.1))
    assert not any(
        criterion(van_der_pol, way, plenty()) for criterion in (mean_damping, energy_levels) for way in (-1, 1)
    )


def test_at_one_elevator_nothing_is_halved(build_system: Build) -> None:
    """The damping changes its sign and no criterion holds: the search for cycles is asked once, at that elevator."""
    found = absence(build_system((-1.2, -2.0), (1.5, -1.8, 1.7, -0.7)), (0.0, 0.0))
    (part,) = found.parts
    assert isinstance(part, AbsenceMeasured)
    assert part.sampled_rad.tolist() == [0.0]
    assert part.counts == (0,)


def test_leading_zeros_change_nothing(build_system: Build) -> None:
    """Out to infinity the last coefficient decides; one that is zero must not."""
    for zeros in ((), (0.0,), (0.0, 0.0)):
        assert absence(build_system((-1.0, *zeros), (0.0, -1.0, 0.0, -1.0, *zeros), gain=0.0), (0.0, 0.0)).proven


def test_levels_reach_where_means_do_not() -> None:
    """F = −0.1 + x − x²/10: the mean to the right is positive, but the left side outweighs it."""
    field = field_of([-0.1, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0])
    strip = strip_of(field, (-1e-3, 1e-3))
    assert not mean_damping(strip, -1, plenty())
    assert not energy_levels(strip_of(field_of([-0.1, 0.0, 1.0], [0.0, -1.0, 0.0, 1.0]), (-1e-3, 1e-3)), -1, plenty())
    assert energy_levels(strip, -1, plenty())


def test_what_may_be_spent_is_spent_and_no_more() -> None:
    """A proof that needs more boxes than are left is no proof, and the next one finds nothing left."""
    strip = strip_of(field_of([-0.1, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]), (-1e-3, 1e-3))
    enough = plenty()
    boxes = energy_levels(strip, -1, enough)
    assert enough.left == 1_000_000 - boxes
    little = Effort(boxes - 1)
    assert not energy_levels(strip, -1, little)
    assert little.left < 0
    assert not energy_levels(strip, -1, little)
    assert energy_levels(strip, -1, Effort(boxes))

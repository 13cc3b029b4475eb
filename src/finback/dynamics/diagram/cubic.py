"""The diagram of a cubic system with the first-order estimates of its curves beside the exact ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, final

from finback.arrays import frozen_array
from finback.dynamics.diagram.curve import (
    CurveKind,
    Diagram,
    DiagramCurve,
    DiagramOptions,
    DiagramPoint,
    PointKind,
)
from finback.dynamics.diagram.diagram import diagram, natural_mu_range
from finback.dynamics.diagram.knot import Knot, curve_of, spaced
from finback.dynamics.first_order.abelian import RingKind
from finback.dynamics.first_order.abelian_zeros import first_order_folds
from finback.dynamics.first_order.estimate import Estimate
from finback.dynamics.first_order.saddles import loop_estimate, neutral_loop_b0
from finback.dynamics.first_order.wells import well_loops_estimate
from finback.dynamics.normal_form.cubic import Cubic, cubic_normal_form, middle_equilibrium
from finback.dynamics.normal_form.rescaling import Rescaling
from finback.errors import FinbackError

_NODES: Final = 21
_FOLDS: Final = 12
_DEFAULT: Final = DiagramOptions()
_RINGS: Final = {
    RingKind.LEFT_WELL: (0,),
    RingKind.RIGHT_WELL: (2,),
    RingKind.OUTER: (0, 1, 2),
    RingKind.SINGLE_WELL: (0,),
    RingKind.BETWEEN_SADDLES: (1,),
}

Label = tuple[CurveKind, str, tuple[int, ...]]
"""Kind, what it is in words, and the equilibria inside."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Guess:
    """An estimate at one b0."""

    label: Label
    knot: Knot
    caution: str


def cubic_diagram(
    cubic: Cubic,
    b0_range: tuple[float, float] | None = None,
    *,
    a0_range: tuple[float, float] | None = None,
    options: DiagramOptions = _DEFAULT,
) -> Diagram:
    """Find every curve of the plane (b0, a0) at the a2, a1, b2, b1 of a system, exact and to first order.

    The estimates (−k_sc b0 and −k_d b0 about the middle equilibrium, and their like for two wells) are curves with
    ``exact`` False, named for what they estimate; so is the estimate of b_d among the points.

    Args:
        cubic: the system; its b0 and a0 do not matter.
        b0_range: low and high of b0; None: around all special points known in closed form, and b_d.
        a0_range: the window of a0; None: around the curves.
        options: how densely.

    Raises:
        InputError: a range is empty or not finite.
    """
    family = cubic.family()
    neutral = _neutral_estimate(cubic)
    span = b0_range or natural_mu_range(family, *(() if neutral is None else (neutral.mu,)))
    exact = diagram(family, span, lam_range=a0_range, options=options)
    guesses = [curve for index in range(len(exact.cells)) for curve in _estimated(cubic, exact, index)]
    points = list(exact.points)
    if neutral is not None and span[0] <= neutral.mu <= span[1]:
        points = sorted([*points, neutral], key=lambda point: point.mu)
    return replace(exact, curves=(*exact.curves, *guesses), points=tuple(points))


def _normal_at(cubic: Cubic, b0: float) -> tuple[Cubic, Rescaling, float]:
    """Return the normal form about the middle equilibrium, its coordinates without that shift, and the shift."""
    form = cubic_normal_form(replace(cubic, b0=b0, a0=0.0))
    middle = middle_equilibrium(form.normal)
    return form.normal.moved(middle), form.rescaling, middle


def _a0(cubic: Cubic, rescaling: Rescaling, middle: float, about_middle: float) -> float:
    """Return the a0 of the given system at which the moved one has this damping at its origin."""
    a2, a1 = cubic.a2 * rescaling.time * rescaling.length**2, cubic.a1 * rescaling.time * rescaling.length
    return (about_middle - (a1 + a2 * middle) * middle) / rescaling.time


def _estimated(cubic: Cubic, exact: Diagram, index: int) -> Iterator[DiagramCurve]:
    """Yield the estimated curves of a strip."""
    cell = exact.cells[index]
    low, high = cell.mu.tolist()
    lines = {curve.mu.item(0) for curve in exact.curves if curve.kind.is_line}
    nodes = spaced(low, high, _NODES, singular=(low in lines, high in lines))
    # Folds cost most; between saddles they are looked for where there are exact ones.
    known = sorted({mu for curve in exact.of_kind(CurveKind.CYCLE_FOLD) if curve.cell == index for mu in curve.mu})
    with_folds = {*known[:: 1 + len(known) // _FOLDS], *(nodes[::2] if cubic.b2 < 0.0 else ())}
    runs: dict[Label, list[_Guess]] = {}
    for b0 in sorted({*nodes, *with_folds}):
        for guess in _guesses(cubic, float(b0), folds=b0 in with_folds):
            runs.setdefault(guess.label, []).append(guess)
    for (kind, words, enclosed), guesses in runs.items():
        cautions = dict.fromkeys(guess.caution for guess in guesses if guess.caution)
        yield curve_of(
            kind,
            f"estimate of {words}, strip {index}",
            index,
            [guess.knot for guess in guesses],
            enclosed=enclosed,
            ends=("estimate", "estimate"),
            exact=False,
            caution="; ".join(cautions),
        )


def _guesses(cubic: Cubic, b0: float, *, folds: bool) -> Iterator[_Guess]:
    try:
        normal, rescaling, middle = _normal_at(cubic, b0)
        numbers: dict[RingKind, int] = {}
        for label, estimate in _loops(normal):
            a0 = _a0(cubic, rescaling, middle, estimate.value)
            yield _Guess(label=label, knot=_knot(b0, a0, math.nan, resolved=True), caution=estimate.caution)
        for fold in first_order_folds(normal) if folds else ():
            numbers[fold.ring] = numbers.get(fold.ring, 0) + 1
            enclosed = _mirrored(_RINGS[fold.ring], rescaling)
            words = f"cycle-fold {fold.ring}" + (f" ({numbers[fold.ring]})" if numbers[fold.ring] > 1 else "")
            x = fold.x_max if rescaling.length > 0.0 else fold.x_min
            knot = _knot(
                b0,
                _a0(cubic, rescaling, middle, fold.a0.value),
                (x + middle) * rescaling.length,
                resolved=fold.resolved,
            )
            yield _Guess(label=(CurveKind.CYCLE_FOLD, words, enclosed), knot=knot, caution=fold.a0.caution)
    except FinbackError:
        return  # no estimate is known for such a system


def _knot(b0: float, a0: float, x: float, *, resolved: bool) -> Knot:
    return Knot(mu=b0, lam=a0, x=x, residual=math.nan, resolved=resolved, change=(0, 0))


def _mirrored(enclosed: tuple[int, ...], rescaling: Rescaling) -> tuple[int, ...]:
    return tuple(sorted(2 - index for index in enclosed)) if rescaling.length < 0.0 and len(enclosed) == 1 else enclosed


def _loops(normal: Cubic) -> Sequence[tuple[Label, Estimate]]:
    if normal.b2 > 0.0:
        kind = CurveKind.HOMOCLINIC if normal.b1 else CurveKind.SADDLE_CYCLE
        words = "homoclinic" if normal.b1 else "two-saddle cycle"
        return [((kind, words, (1,)), loop_estimate(normal))] if normal.b0 < 0.0 else []
    if normal.b0 <= 0.0:
        return []
    loops = well_loops_estimate(normal)
    return [
        ((CurveKind.HOMOCLINIC, "homoclinic left", (0,)), loops.left),
        ((CurveKind.HOMOCLINIC, "homoclinic right", (2,)), loops.right),
        ((CurveKind.HOMOCLINIC, "large homoclinic", (0, 1, 2)), loops.large),
    ]


def _neutral_estimate(cubic: Cubic) -> DiagramPoint | None:
    """Return b_d: to first order, where the fold of cycles about the origin meets the loop."""
    try:
        form = cubic_normal_form(cubic)
        if form.normal.b2 < 0.0:
            return None
        b_d = neutral_loop_b0(form.normal.a1, form.normal.b1)
        loop = loop_estimate(replace(form.normal, b0=b_d.value, a0=0.0))
    except FinbackError:
        return None
    b0 = b_d.value / form.rescaling.time**2
    return DiagramPoint(
        kind=PointKind.NEUTRAL_LOOP,
        name="estimate of neutral-loop",
        exact=False,
        mu=b0,
        lam=loop.value / form.rescaling.time,
        x=math.nan,
        bracket=frozen_array((b0, b0)),
        residual=math.nan,
        resolved=True,
        curves=(),
    )

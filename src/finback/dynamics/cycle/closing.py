"""A cycle located between two orbits, by where its halves meet and, independently, by where a whole turn ends.

Where the flow leads outward on the inner orbit and inward on the outer, whole turns forward lead from both into what
lies between, and, landings being monotone, to a cycle; in the opposite case turns backward do. That direction never
spreads orbits for long, so a cycle that rounding can tell at all closes in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.cycle.scan import Change
from finback.dynamics.flow import horner
from finback.dynamics.orbit.closure import Field, newton_in_p
from finback.dynamics.orbit.turn import Stage, Trial, Turn

_ITERATIONS: Final = 200
_SURE: Final = 4e-16  # of p and 1
_ROUNDED: Final = 2e-15  # of the size of a cycle: what a whole turn misses by rounding alone
_CLOSES: Final = 1e-9  # of the size: a turn that misses by more shows no cycle
_CONFIRMS: Final = 1e-7  # of the size: where both roads must meet
_SPREADS: Final = 15.0  # of ∫f dt and of the growth over any stretch: then halves are not followed from one end
_NEUTRAL: Final = 1e-6  # of the logarithm of a multiplier: nearer to 0 its sign is not asked for
_GROWTH: Final = 4.0
_WIDEST: Final = 1e-3  # of the size, of a bracket
_WIDEST_P: Final = 10.0  # the same of p
_COARSE: Final = 1e-3  # of p
_LARGEST: Final = 700.0


@final
@dataclass(frozen=True, slots=True)
class Closing:
    """A cycle.

    Attributes:
        field: the flow in the coordinate in which it was found.
        left: where it turns on the left in that.
        right: where it turns on the right.
        period: the time of a turn.
        growth: ∮f dt.
        miss: by how much it misses itself, as evaluated.
        bracket: two places of x_max around it between which the flow leads to opposite sides.
    """

    field: Field
    left: float
    right: float
    period: float
    growth: float
    miss: float
    bracket: tuple[float, float]

    @property
    def turns(self) -> tuple[float, float]:
        """x_min and x_max."""
        low, high = sorted((self.field.x_of(self.left), self.field.x_of(self.right)))
        return low, high


def closing(change: Change) -> Closing | str:
    """Locate the cycle between two orbits, or say in words why it cannot be; in none if there is no cycle."""
    by_halves = _by_halves(change)
    way = 1.0 if change.low.sign < 0 else -1.0
    if by_halves is not None:
        size = by_halves.right - by_halves.left
        turn = change.stage.turn(by_halves.right, way, from_right=True)
        if abs(turn.end - turn.start) <= _CONFIRMS * size and _signed(by_halves.growth, way):
            return by_halves
    by_turns = _by_turns(change, way)
    if by_turns is not None and _signed(by_turns.growth, way):
        return by_turns
    # A landing may jump from before the cell beyond it where no orbit lands in it: then turns do not close in.
    if _moves(change.stage, change.low, way) < 0.0 or _moves(change.stage, change.high, way) > 0.0:
        return ""
    field = change.stage.chart.field
    ends = sorted(field.x_of(trial.right) for trial in (change.low, change.high))
    side = "left" if field.mirrored else "right"
    return (
        f"the flow changes its side between orbits that turn on the {side} at x = {ends[0]:.6g} and {ends[1]:.6g}, "
        "but no orbit there could be followed so closely that it closes"
    )


def confirmed(stage: Stage, p: float, growth: float) -> Closing | None:
    """Return a cycle that was found by other means, as it closes; None if it does not, or is a canard.

    Args:
        stage: where it is followed.
        p: its name in the chart.
        growth: the logarithm of its multiplier: a whole turn is followed in the direction in which it attracts.
    """
    trial = stage.trial(p)
    if trial.landed and trial.growth <= _SPREADS:
        return _of_halves(stage, trial) if abs(trial.miss) <= _CLOSES else None
    if not math.isfinite(trial.right):
        return None
    way = 1.0 if growth < 0.0 else -1.0
    turn = _settled(stage, (trial.right, trial.right), way, from_right=True)
    if turn is None:
        return None
    size = abs(turn.start - turn.middle)
    closes = abs(turn.end - turn.start) <= _CLOSES * size and abs(turn.start - trial.right) <= _CONFIRMS * size
    if not closes or max(leg.canard for leg in turn.legs) > _SPREADS:
        return None
    mark = turn.middle if stage.chart.field.mirrored else turn.start
    bracket = _bracket_of_turns(stage, mark, size, way)
    return _of_turn(stage, turn, (turn.middle, turn.start, turn.end - turn.start), bracket)


def _moves(stage: Stage, trial: Trial, way: float) -> float:
    """Return by how much a turn moves an orbit outward where it turns on the right; ±∞ where it does not come back."""
    if math.isfinite(trial.right):
        return stage.turn(trial.right, way, from_right=True).end - trial.right
    # It passes a saddle inside, but turns on the right before the cell or beyond it; followed on, it may in it.
    place = _first(stage, trial, way)
    return place if math.isinf(place) else -math.copysign(math.inf, trial.right)


def _first(stage: Stage, trial: Trial, way: float) -> float:
    """Return where an orbit turns on the right, or would after a turn; ±∞ where it does not."""
    left = trial.ahead if way > 0.0 else trial.behind
    if math.isfinite(trial.right) or not math.isfinite(left):
        return trial.right
    return stage.leg((left, 0.0), way, leftward=False).u


def _signed(growth: float, way: float) -> bool:
    return way * growth < _NEUTRAL


def _by_halves(change: Change) -> Closing | None:
    """Find p by Newton's method on the miss within the bracket; None where halves spread orbits too far."""
    stage, low, high = change.stage, change.low, change.high
    inside, outside = low.p, high.p
    rising = high.sign > 0
    p = 0.5 * (inside + outside)
    if low.landed and high.landed:
        share = low.miss / (low.miss - high.miss)
        p = inside + share * (outside - inside)
    for _ in range(_ITERATIONS):
        trial = stage.trial(p)
        if not trial.landed or trial.growth > _SPREADS:
            return None
        if (trial.miss > 0.0) == rising:
            outside = p
        else:
            inside = p
        change_of_p = newton_in_p(stage.chart, p, trial.probe())
        fine = _SURE * max(1.0, abs(p))
        if abs(change_of_p) <= fine or outside - inside <= fine:
            break
        p = p + change_of_p if inside < p + change_of_p < outside else 0.5 * (inside + outside)
    return None if abs(trial.miss) > _CLOSES else _of_halves(stage, trial)


def _of_halves(stage: Stage, trial: Trial) -> Closing:
    return Closing(
        field=stage.chart.field,
        left=trial.ahead,
        right=trial.right,
        period=trial.durations[0] - trial.durations[1],
        growth=trial.dampings[0] - trial.dampings[1],
        miss=trial.ahead - trial.behind,
        bracket=_bracket_of_p(stage, trial),
    )


def _bracket_of_p(stage: Stage, trial: Trial) -> tuple[float, float]:
    """Return two places of x_max around a cycle from which orbits miss themselves on opposite sides.

    So near to a loop that no parameter tells one orbit from the next the miss has no sign; there they are such that
    the distance to the saddle differs by a factor e^±10.
    """
    chart, p = stage.chart, trial.p
    here = _x_max(stage, trial)
    distance = max(map(abs, chart.start(p)))
    step = min(_WIDEST_P, _SURE * max(1.0, abs(p), abs(here) / distance))
    while True:
        low, high = stage.trial(p - step), stage.trial(p + step)
        ends = [end for end in (_x_max(stage, low), _x_max(stage, high)) if math.isfinite(end)] or [here]
        # So near to a saddle that p moves no digit of x, both places are the same number.
        strict = min(ends) < here < max(ends) or step > _COARSE
        if (low.miss * high.miss < 0.0 and strict) or step >= _WIDEST_P:
            return min(*ends, here), max(*ends, here)
        step = min(_WIDEST_P, step * _GROWTH)


def _x_max(stage: Stage, trial: Trial) -> float:
    field = stage.chart.field
    return field.x_of(trial.ahead if field.mirrored else trial.right)


def _by_turns(change: Change, way: float) -> Closing | None:
    """Find where a whole turn ends where it began, from the side on which rounding grows less."""
    stage = change.stage
    ends = _first(stage, change.low, way), _first(stage, change.high, way)
    begin = _settled(stage, ends, way, from_right=True)
    if begin is None:
        return None
    there = _settled(stage, (begin.middle, begin.middle), way, from_right=False)
    # Two places known each as well as it can be: each from the turn that ends there.
    left, right = begin.middle, begin.start
    miss = begin.end - begin.start
    turn = begin
    if there is not None and abs(there.end - there.start) < abs(miss):
        left, right, miss, turn = there.start, there.middle, there.end - there.start, there
    if abs(miss) > _CLOSES * (right - left):
        return None
    # The largest x is on the left of a mirrored field.
    mark = left if stage.chart.field.mirrored else right
    return _of_turn(stage, turn, (left, right, miss), _bracket_of_turns(stage, mark, right - left, way))


def _of_turn(stage: Stage, turn: Turn, ends: tuple[float, float, float], bracket: tuple[float, float]) -> Closing:
    left, right, miss = ends
    return Closing(
        field=stage.chart.field,
        left=left,
        right=right,
        period=turn.way * math.fsum(leg.duration for leg in turn.legs),
        growth=turn.way * turn.damping,
        miss=miss,
        bracket=bracket,
    )


def _settled(stage: Stage, ends: tuple[float, float], way: float, *, from_right: bool) -> Turn | None:
    """Return the turn that ends nearest to where it began, between two places; of one place, as long as it improves."""
    outward = 1.0 if from_right else -1.0
    low, high = ends
    start, best = (low if math.isfinite(low) else high), None
    for _ in range(_ITERATIONS):
        turn = stage.turn(start, way, from_right=from_right)
        if math.isnan(turn.end):
            break
        miss = turn.end - start
        if math.isfinite(miss):
            near = abs(miss) / abs(start - turn.middle)
            stalled = best is not None and abs(miss) >= abs(best.end - best.start)
            best = best if stalled else turn
            if near <= _ROUNDED or (stalled and (low == high or near <= _CLOSES)):
                break
        if low != high:
            low, high = (start, high) if miss * outward > 0.0 else (low, start)
            if abs(high - low) <= _SURE * max(abs(low), abs(high)):
                break
        start = _following(stage, turn, (low, high))
        if not math.isfinite(start):
            break
    return best


def _following(stage: Stage, turn: Turn, ends: tuple[float, float]) -> float:
    """Return where to try next: by Newton's method, where the turn ended, or halfway, whichever lies between."""
    low, high = min(ends), max(ends)
    tries = [turn.end, 0.5 * (low + high)]
    if math.isfinite(turn.end):
        force = stage.chart.field.force.tolist()
        push = horner(force, turn.end)  # 0 where it comes to rest there, within rounding
        shrinks = math.exp(min(turn.damping, _LARGEST)) * horner(force, turn.start) / push if push else math.nan
        if 0.0 < shrinks < 1.0:
            tries.insert(0, turn.start + (turn.end - turn.start) / (1.0 - shrinks))
    return tries[0] if low == high else next((u for u in tries if low < u < high), math.nan)


def _bracket_of_turns(stage: Stage, mark: float, size: float, way: float) -> tuple[float, float]:
    """Return two places of x_max around a cycle from which turns lead back towards it."""
    field = stage.chart.field
    from_right = not field.mirrored
    step = 4.0 * math.ulp(max(abs(mark), _ROUNDED * size))
    while True:
        low, high = mark - step, mark + step
        moves = [stage.turn(u, way, from_right=from_right).end - u for u in (low, high)]
        if (moves[0] > 0.0 > moves[1]) or step >= _WIDEST * size:
            break
        step *= _GROWTH
    ends = sorted((field.x_of(low), field.x_of(high)))
    return ends[0], ends[1]

"""Folds of the simulator itself, flown: by holding the elevator, and by slow ramps.

Nothing here knows a model. Where a fold lies and on which side its stable branch, is read from the simulator's own
equilibria; then it is flown, because a fold that only an equation solver saw has not been seen by an aircraft.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.flight.equilibrium import EquilibriumCurve, Field, SimulatedEquilibrium, SimulatedFold, equilibria
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.vehicle import Vehicle
from finback.records import Hold, Outcome, Schedule
from finback.units import from_si
from finback.validation.extrapolation import extrapolate, ramp_terms
from finback.validation.options import FoldOptions

_APPROACH_REST: Final = 0.1  # of the resolution: what the exponential approach leaves out
_KNOTS_PER_TIME_CONSTANT: Final = 20  # a chord then differs from the exponential by 3e-4 of what is left of the way
_FIRST_WIDTH: Final = 4.0  # resolutions: half the first bracket around the fold of the equilibrium curve
_WIDENING: Final = 4.0
_HALVED: Final = (
    1.0 + 1e-6
)  # the widths are the resolution times powers of two: rounding shall not ask for one flight more
_RAMP_SAMPLE_S: Final = 0.05  # at a jump of 10 deg/s the crossing is then interpolated to 1e-4 s
_BEYOND_MARGIN: Final = 1.5  # margins: where a ramp ends, so that the crossing lies between two of its samples


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """How a fold of the simulator is reached: from an equilibrium of the stable branch that ends in it.

    Attributes:
        fold: the fold of the simulator's own equilibrium curve.
        outward: +1 if the branch ends when the elevator rises past the fold, -1 when it falls.
        jump: +1 if alpha rises in the jump, -1 if it falls.
        start: the stable equilibrium from which every search starts.
    """

    fold: SimulatedFold
    outward: int
    jump: int
    start: SimulatedEquilibrium


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class HoldFold:
    """A fold found by hold bisection.

    The elevator approaches a value exponentially from the stable side and is held there; whether the aircraft jumps
    decides the next value. Close beyond the fold the jump takes longer than the hold, so the result errs outward.

    By how much, the flights that jumped tell. A passage at a distance ε beyond a saddle-node takes T = K·ε^(−1/2)
    (Strogatz, Nonlinear Dynamics and Chaos, section 4.3: the bottleneck), so a flight that jumps after T_k at ε_k
    says that a hold of T cannot see what lies nearer than ε = ε_k (T_k/T)². The clock of each starts when the
    elevator passes the fold: the approach with its time constant τ stops short by r, hence T = hold_s + τ·ln(ε/r) and
    T_k = t_k + τ·ln(ε_k/r), where t_k is the time from the end of the approach to the jump and ε_k = ε + the distance
    from the inner end of the bracket. ``delay_rad`` is the ε that solves this, the smallest over the flights that
    jumped: each is a bound, because on its way to ε_k the elevator was nearer to the fold and the passage slower.

    Attributes:
        table_elevator_rad: the elevator of the fold of the simulator's own equilibrium curve.
        table_alpha_rad: its alpha, which defines the jump.
        outward: +1 if the branch ends when the elevator rises past the fold, -1 when it falls.
        elevator_rad: the middle of the bracket.
        bracket_rad: lowest and highest elevator between which the fold was found.
        delay_rad: how far beyond the fold the inner end of the bracket may lie because the hold is finite, >= 0.
        uncertainty_rad: 95 % uncertainty: the width of the bracket and ``delay_rad``; infinite if nothing jumped.
        flights: number of flights that the search took.
    """

    table_elevator_rad: float
    table_alpha_rad: float
    outward: int
    elevator_rad: float
    bracket_rad: tuple[float, float]
    delay_rad: float
    uncertainty_rad: float
    flights: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RampFold:
    """A fold extrapolated from slow elevator ramps to rate zero, with a + b·rate^(2/3) + c·rate.

    The 2/3 is the delay of a slow passage through a saddle-node (Jung, Gray, Roy & Mandel 1990, PRL 65, 1873), the
    linear term the inertia of the aircraft and the time from the fold to the margin.

    Attributes:
        table_elevator_rad: the elevator of the fold of the simulator's own equilibrium curve.
        table_alpha_rad: its alpha.
        outward: +1 if the elevator rises on the ramps, -1 if it falls.
        alpha_crossing_rad: the alpha whose crossing counts as the jump: the fold's with the margin.
        rates_rad_s: rates of the ramps that jumped, > 0, shape (n,), increasing.
        crossing_elevator_rad: the elevator at the crossing, shape (n,).
        at_limit: whether the elevator limit ends the ramps nearer to the fold than they started before it.
        elevator_rad: extrapolated to rate zero: a.
        uncertainty_rad: 95 % uncertainty of it; infinite if too few ramps jumped.
        coefficients: a, b, c in SI, shape (3,).
        residual_rad: root mean square of the fit, with n − 3 degrees of freedom.
    """

    table_elevator_rad: float
    table_alpha_rad: float
    outward: int
    alpha_crossing_rad: float
    rates_rad_s: FloatArray
    crossing_elevator_rad: FloatArray
    at_limit: bool
    elevator_rad: float
    uncertainty_rad: float
    coefficients: FloatArray
    residual_rad: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("rates_rad_s", "crossing_elevator_rad", "coefficients"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    def elevator_at(self, rate_rad_s: ArrayLike) -> FloatArray:
        """Return the fitted elevator at the crossing for ``rate_rad_s`` >= 0 (any shape), in rad."""
        return ramp_terms(np.asarray(rate_rad_s, dtype=np.float64)) @ self.coefficients


def approaches(
    field: Field, curve: EquilibriumCurve, folds: Iterable[SimulatedFold], options: FoldOptions, flight: FlightOptions
) -> tuple[tuple[Approach, ...], tuple[str, ...]]:
    """Return how each fold of a stable branch is reached, and in words which folds cannot be flown and why.

    Args:
        field: (alpha, q, elevator) -> (dα/dt, dq/dt), the simulator's.
        curve: its equilibria, by rising alpha.
        folds: the folds of that curve.
        options: offset and margin.
        flight: the limits of alpha and elevator.
    """
    found: list[Approach] = []
    notes: list[str] = []
    for fold in folds:
        result = _approach(field, curve, fold, options, flight)
        if isinstance(result, Approach):
            found.append(result)
        else:
            notes.append(f"the simulator's fold at {describe(fold)} cannot be flown: {result}")
    return tuple(found), tuple(notes)


def describe(fold: SimulatedFold) -> str:
    """Return where a fold is, for people."""
    elevator, alpha = from_si(fold.elevator_rad, "deg"), from_si(fold.alpha_rad, "deg")
    return f"elevator {elevator:z.3f} deg, alpha {alpha:z.2f} deg"


def _approach(
    field: Field, curve: EquilibriumCurve, fold: SimulatedFold, options: FoldOptions, flight: FlightOptions
) -> Approach | str:
    """Return the approach to a fold, or why there is none."""
    low, high = flight.elevator_limits_rad
    if not low < fold.elevator_rad < high:
        return "it lies outside the elevator limits"
    branches = [side for side in (-1, 1) if _is_stable_beside(curve, fold, side)]
    if len(branches) != 1:
        return "no stable branch ends in it" if not branches else "the branches on both sides of it are stable"
    side = branches[0]
    crossing = fold.alpha_rad - side * options.margin_rad
    if not flight.alpha_limits_rad[0] < crossing < flight.alpha_limits_rad[1]:
        return "alpha leaves its limits before it has passed the fold by the margin"
    alpha, elevator = _branch_from(curve, fold, side)
    offset = np.abs(elevator - fold.elevator_rad)
    enough = np.flatnonzero(offset >= options.start_offset_rad)
    # A branch shorter than the offset is entered in its middle.
    at = int(enough[0]) if enough.size else int(np.searchsorted(offset, 0.5 * offset.max()))
    outward = 1 if fold.elevator_rad > elevator[at] else -1
    start_elevator = fold.elevator_rad - outward * min(options.start_offset_rad, float(offset[at]))
    near = equilibria(field, elevator_rad=start_elevator, alpha_limits_rad=flight.alpha_limits_rad)
    stable = [point for point in near if point.stable and side * (point.alpha_rad - fold.alpha_rad) > 0.0]
    if not stable:
        return "no stable equilibrium was found beside it"
    start = min(stable, key=lambda point: abs(point.alpha_rad - float(alpha[at])))
    return Approach(fold=fold, outward=outward, jump=-side, start=start)


def _is_stable_beside(curve: EquilibriumCurve, fold: SimulatedFold, side: int) -> bool:
    """Tell whether the branch on this side of the fold (by alpha) is stable; its last point is too close to tell."""
    beside = np.flatnonzero(side * (curve.alpha_rad - fold.alpha_rad) > 0.0)
    beside = beside if side > 0 else beside[::-1]
    return beside.size > 1 and bool(curve.stable[beside[1]])


def _branch_from(curve: EquilibriumCurve, fold: SimulatedFold, side: int) -> tuple[FloatArray, FloatArray]:
    """Return alpha and elevator of the stable branch, from the fold to where it loses stability or turns."""
    beside = np.flatnonzero(side * (curve.alpha_rad - fold.alpha_rad) > 0.0)
    beside = (beside if side > 0 else beside[::-1])[1:]
    lost = np.flatnonzero(~curve.stable[beside])
    branch = beside[: lost[0]] if lost.size else beside
    offset = np.abs(curve.elevator_rad[branch] - fold.elevator_rad)
    turn = np.flatnonzero(np.diff(offset) <= 0.0)
    branch = branch[: turn[0] + 1] if turn.size else branch
    return curve.alpha_rad[branch], curve.elevator_rad[branch]


def hold_fold(rig: Vehicle, approach: Approach, options: FoldOptions, flight: FlightOptions) -> HoldFold:
    """Find a fold by hold bisection on the rig.

    The bracket starts four resolutions to either side of the equilibrium curve's fold and widens until its inner end
    holds and its outer end jumps. Without a jump up to the elevator limit the uncertainty is infinite.
    """
    fold, outward = approach.fold, approach.outward
    start = approach.start.elevator_rad
    limit = max(flight.elevator_limits_rad) if outward > 0 else min(flight.elevator_limits_rad)
    held: dict[float, float] = {}  # elevator -> time from the end of the approach to the jump; infinite without one

    def jumps(elevator_rad: float) -> bool:
        held[elevator_rad] = _jump_time(rig, approach, elevator_rad, options, flight)
        return math.isfinite(held[elevator_rad])

    widths = [_FIRST_WIDTH * options.resolution_rad]
    while widths[-1] < abs(limit - start):
        widths.append(_WIDENING * widths[-1])
    inner, outer = start, math.nan
    for width in widths:
        elevator = outward * min(outward * fold.elevator_rad + width, outward * limit)
        if jumps(elevator):
            outer = elevator
            break
        inner = elevator
    for width in widths:
        elevator = fold.elevator_rad - outward * width
        if inner != start or math.isnan(outer) or outward * (elevator - start) <= 0.0:
            break
        inner, outer = (inner, elevator) if jumps(elevator) else (elevator, outer)
    while abs(outer - inner) > _HALVED * options.resolution_rad:
        middle = 0.5 * (inner + outer)
        inner, outer = (inner, middle) if jumps(middle) else (middle, outer)
    found = not math.isnan(outer)
    outer = outer if found else limit
    beyond = [(outward * (elevator - inner), time) for elevator, time in held.items() if math.isfinite(time)]
    delay = min((_delay(distance, time, options) for distance, time in beyond), default=math.inf)
    return HoldFold(
        table_elevator_rad=fold.elevator_rad,
        table_alpha_rad=fold.alpha_rad,
        outward=outward,
        elevator_rad=0.5 * (inner + outer),
        bracket_rad=(min(inner, outer), max(inner, outer)),
        delay_rad=delay,
        uncertainty_rad=abs(outer - inner) + delay,
        flights=len(held),
    )


def _delay(distance_rad: float, time_s: float, options: FoldOptions) -> float:
    """Return the ε of ``HoldFold`` by one flight that jumped; infinite if it tells nothing.

    Args:
        distance_rad: from the inner end of the bracket to the elevator that was held, > 0.
        time_s: from the end of the approach to the jump; < 0 if it came before.
        options: hold, approach and resolution.
    """
    rest = _APPROACH_REST * options.resolution_rad

    def cost(delay_rad: float, held_s: float) -> float:
        return delay_rad * (held_s + options.approach_s * math.log(max(delay_rad, rest) / rest)) ** 2

    def excess(delay_rad: float) -> float:
        return cost(delay_rad, options.hold_s) - cost(delay_rad + distance_rad, time_s)

    high = rest
    while excess(high) <= 0.0:
        high *= 2.0
        if high > options.start_offset_rad:
            return math.inf
    return float(brentq(excess, 0.0, high))


def _jump_time(
    rig: Vehicle, approach: Approach, elevator_rad: float, options: FoldOptions, flight: FlightOptions
) -> float:
    """Return when the aircraft leaves the branch after the elevator came to a value to be held; infinite if never."""
    schedule, duration = hold_schedule(approach.start.elevator_rad, elevator_rad, options)
    crossing = approach.fold.alpha_rad + approach.jump * options.margin_rad
    low, high = flight.alpha_limits_rad
    escape = rig.escape(
        alpha_rad=approach.start.alpha_rad,
        q_rad_s=approach.start.q_rad_s,
        schedule=schedule,
        duration_s=duration,
        alpha_limits_rad=(low, crossing) if approach.jump > 0 else (crossing, high),
    )
    if escape.outcome is Outcome.COMPLETED:
        return math.inf
    return escape.time_s - (duration - options.hold_s)


def hold_schedule(start_rad: float, elevator_rad: float, options: FoldOptions) -> tuple[Schedule, float]:
    """Return the elevator of one hold flight, and its duration in s.

    The elevator goes exponentially to the value until a tenth of the resolution is left, then there, and is held for
    ``hold_s``. It never passes the value.
    """
    way = max(abs(elevator_rad - start_rad), options.resolution_rad)
    approach_s = options.approach_s * math.log(way / (_APPROACH_REST * options.resolution_rad))
    knots = math.ceil(_KNOTS_PER_TIME_CONSTANT * approach_s / options.approach_s)
    time = np.linspace(0.0, approach_s, knots + 1)
    elevator = elevator_rad + (start_rad - elevator_rad) * np.exp(-time / options.approach_s)
    elevator[-1] = elevator_rad
    return Schedule(time_s=time, elevator_rad=elevator), approach_s + options.hold_s


def ramp_fold(rig: Vehicle, approach: Approach, options: FoldOptions, flight: FlightOptions) -> RampFold:
    """Find a fold from slow elevator ramps on the rig, extrapolated to rate zero.

    Each ramp starts at equilibrium and goes past the fold as far as it started before it, or to the elevator limit.
    A ramp that ends before alpha has passed the fold by the margin is left out.
    """
    crossings = {
        rate: elevator
        for rate in sorted(set(options.ramp_rates_rad_s))
        if not math.isnan(elevator := _crossing(rig, approach, rate, options, flight))
    }
    rates, elevators = np.array(list(crossings)), np.array(list(crossings.values()))
    fit = extrapolate(rates, elevators)
    low, high = flight.elevator_limits_rad
    return RampFold(
        table_elevator_rad=approach.fold.elevator_rad,
        table_alpha_rad=approach.fold.alpha_rad,
        outward=approach.outward,
        alpha_crossing_rad=approach.fold.alpha_rad + approach.jump * options.margin_rad,
        rates_rad_s=rates,
        crossing_elevator_rad=elevators,
        at_limit=not low <= 2.0 * approach.fold.elevator_rad - approach.start.elevator_rad <= high,
        elevator_rad=float(fit.coefficients[0]),
        uncertainty_rad=fit.uncertainty_rad,
        coefficients=fit.coefficients,
        residual_rad=fit.residual_rad,
    )


def _crossing(
    rig: Vehicle, approach: Approach, rate_rad_s: float, options: FoldOptions, flight: FlightOptions
) -> float:
    """Return the elevator at which alpha passes the margin on one ramp; NaN if it does not."""
    start, outward, jump = approach.start, approach.outward, approach.jump
    low, high = flight.elevator_limits_rad
    end = 2.0 * approach.fold.elevator_rad - start.elevator_rad
    end = min(end, high) if outward > 0 else max(end, low)
    duration = abs(end - start.elevator_rad) / rate_rad_s
    beyond = approach.fold.alpha_rad + jump * _BEYOND_MARGIN * options.margin_rad
    alpha_low, alpha_high = flight.alpha_limits_rad
    record = rig.fly(
        FlightPlan(
            name=f"fold-ramp-{from_si(rate_rad_s, 'deg_s'):.9g}-deg-s",
            kind="ramp",
            alpha_rad=start.alpha_rad,
            q_rad_s=start.q_rad_s,
            schedule=Schedule(time_s=np.array([0.0, duration]), elevator_rad=np.array([start.elevator_rad, end])),
            hold=Hold.FOH,
            duration_s=duration,
            sample_interval_s=max(1, round(_RAMP_SAMPLE_S / flight.step_s)) * flight.step_s,
            alpha_limits_rad=(alpha_low, min(beyond, alpha_high)) if jump > 0 else (max(beyond, alpha_low), alpha_high),
        )
    )
    past = jump * (record["alpha_rad"] - (approach.fold.alpha_rad + jump * options.margin_rad))
    after = np.flatnonzero(past >= 0.0)
    if not after.size:
        return math.nan
    i = int(after[0])
    share = past[i - 1] / (past[i - 1] - past[i])
    elevator = record["elevator_rad"]
    return float(elevator[i - 1] + share * (elevator[i] - elevator[i - 1]))

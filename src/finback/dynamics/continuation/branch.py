"""Branches of equilibria of any field by continuation, with everything that happens on them.

The field is a function and nothing else; derivatives are differences. It may have corners, as tables have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.branch_point import BranchPoint, branch_point
from finback.dynamics.continuation.degenerate import Degeneracy, DegeneratePoint, degenerate_points
from finback.dynamics.continuation.dip import dips
from finback.dynamics.continuation.event import Happening, Located, Observed, happenings, observe
from finback.dynamics.continuation.field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation.fold import LimitPoint, limit_point
from finback.dynamics.continuation.hopf import HopfPoint, NeutralSaddle, coincident_hopf_points, hopf_or_saddle
from finback.dynamics.continuation.path import (
    ContinuationOptions,
    Ending,
    Path,
    PathPoint,
    correct,
    follow,
    joined,
    null_direction,
    point_at,
    within,
)
from finback.errors import InputError, RefusedError

_NEWTON: Final = 30
_FAR: Final = 100.0  # typical sizes: no start is worth a step this long
_AWAY: Final = 1e-3  # typical sizes: how far beside a branch point the other branch is entered
_BESIDE: Final = 3  # points away from a corner
_TOGETHER: Final = 1e-5  # typical sizes: a fold and a pair of opposite eigenvalues this near are one point
_DOUBLE: Final = (Degeneracy.BOGDANOV_TAKENS, Degeneracy.DOUBLE_ZERO)
_SAME: Final = 1e-3  # typical sizes: a fold this near to a branch point is the turn of a pitchfork's branch


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EquilibriumBranch:
    """A branch of equilibria; arrays of n points, in its own order; located points are among them.

    Attributes:
        parameter: shape (n,), the user's unit.
        state: shape (n, d).
        eigenvalues_real: of the linearized field, shape (n, d), 1 / time.
        eigenvalues_imag: imaginary parts, shape (n, d).
        stable: all real parts are negative, shape (n,).
        residual: largest rate left, shape (n,), in typical rates.
        beginning: why the branch ends at its first point.
        beginning_note: the same in words, with place.
        end: why it ends at its last point; ``closed`` at both ends if it is a loop.
        end_note: the same in words.
        limit_points: its folds, in the order of the branch.
        hopf_points: its Hopf points.
        neutral_saddles: where two real eigenvalues are opposite.
        branch_points: where another branch crosses it.
        degenerate_points: cusps, Bogdanov-Takens points, pairs that cross together, and the like, by name. Where trace
            and determinant vanish together no Hopf point and no neutral saddle is listed.
    """

    parameter: FloatArray
    state: FloatArray
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    stable: NDArray[np.bool_]
    residual: FloatArray
    beginning: Ending
    beginning_note: str
    end: Ending
    end_note: str
    limit_points: tuple[LimitPoint, ...]
    hopf_points: tuple[HopfPoint, ...]
    neutral_saddles: tuple[NeutralSaddle, ...]
    branch_points: tuple[BranchPoint, ...]
    degenerate_points: tuple[DegeneratePoint, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("parameter", "state", "eigenvalues_real", "eigenvalues_imag", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        stable = np.array(self.stable, dtype=np.bool_)
        stable.setflags(write=False)
        object.__setattr__(self, "stable", stable)


def equilibrium_branch(
    box: BlackBox, *, state: ArrayLike, parameter: float, options: ContinuationOptions | None = None
) -> EquilibriumBranch:
    """Return the branch of equilibria through a point, followed both ways.

    Args:
        box: a field of one parameter.
        state: near an equilibrium, shape (d,); Newton's method must reach it.
        parameter: where.
        options: steps.

    Raises:
        InputError: more than one parameter, or a state outside the box.
        RefusedError: no equilibrium is found from this state.
    """
    scaled = scaled_field(box)
    start = np.append(np.asarray(state, dtype=np.float64), parameter)
    if start.shape != (box.states + 1,) or not np.isfinite(start).all():
        raise InputError(f"{box.states} finite states and a parameter are needed, not {start.tolist()}")
    try:
        found = equilibrium_near(scaled, start / scaled.scale)
    except FieldError as error:
        raise RefusedError(f"the field failed {error}", hint="start where the field is defined") from error
    if found is None:
        raise RefusedError(
            f"no equilibrium is reached from state {start[:-1].tolist()} at parameter {parameter:g}",
            hint="start nearer to one, or let equilibrium_branches search",
        )
    return followed(scaled, found, options or ContinuationOptions())


def equilibrium_holding(
    box: BlackBox, *, state: ArrayLike, parameter: float, held: int
) -> tuple[FloatArray, float] | None:
    """Return the equilibrium with one state held, and the parameter that holds it; nothing if none is reached.

    Args:
        box: a field of one parameter.
        state: near it, shape (d,).
        parameter: near it.
        held: which state is held.
    """
    scaled = scaled_field(box)
    u = np.append(np.asarray(state, dtype=np.float64), parameter) / scaled.scale
    row = np.eye(len(u))[held]
    try:
        found = correct(scaled, u, row, float(u[held]), scaled.jacobian(u))
    except FieldError:
        return None
    if found is None:
        return None
    values = found * scaled.scale
    return values[:-1], float(values[-1])


def scaled_field(box: BlackBox) -> ScaledField:
    """Return the field in scaled variables.

    Raises:
        InputError: it has more than one parameter.
    """
    if box.parameters != 1:
        raise InputError(f"the field has {box.parameters} parameters", hint="hold all but one with .held(...)")
    return ScaledField(box)


def equilibrium_near(scaled: ScaledField, u: FloatArray) -> PathPoint | None:
    """Return the equilibrium that Newton's method reaches at this parameter, else the nearest at any, else nothing."""
    fixed = np.zeros(len(u))
    fixed[scaled.states] = 1.0
    for row in (fixed, None):
        v = u
        for _ in range(_NEWTON):
            jacobian = scaled.jacobian(v)
            across = null_direction(jacobian) if row is None else row
            found = correct(scaled, v, across, float(across @ (v if row is None else u)), jacobian)
            if found is not None:
                return oriented(scaled, found)
            change = np.linalg.lstsq(jacobian, scaled(v), rcond=None)[0]
            if np.linalg.norm(change) > _FAR:
                return None
            v = v - change
            if row is not None:
                break
    return None


def oriented(scaled: ScaledField, u: FloatArray) -> PathPoint:
    """Return an equilibrium as a point whose tangent has a rising parameter, if it changes at all."""
    direction = null_direction(scaled.jacobian(u))
    return point_at(scaled, u, direction if direction[scaled.states] >= 0.0 else -direction)


def followed(scaled: ScaledField, start: PathPoint, options: ContinuationOptions) -> EquilibriumBranch:
    """Return the whole branch through an equilibrium."""
    outside = within(scaled.limits, scaled.states, len(scaled.scale))
    forward = follow(scaled, start, outside, options)
    if forward.ending is Ending.CLOSED:
        return collected(scaled, forward.points, Path([], forward.ending, forward.note), forward)
    backward = follow(scaled, start.reversed(), outside, options)
    if _stuck(forward) and not _stuck(backward):
        forward, backward = backward, forward
    if _stuck(backward) and len(forward.points) > _BESIDE:
        # A start on a corner has no tangent: from beside it the corner is turned.
        beside = forward.points[_BESIDE]
        backward = follow(scaled, beside.reversed(), outside, options)
        if backward.ending is Ending.CLOSED:
            return collected(scaled, backward.points, Path([], backward.ending, backward.note), backward)
        forward = Path(forward.points[_BESIDE:], forward.ending, forward.note)
    return collected(scaled, joined(backward, forward), backward, forward)


def _stuck(path: Path) -> bool:
    return path.ending is Ending.STEP_TOO_SMALL and len(path.points) == 1


def other_branch(box: BlackBox, crossing: BranchPoint, options: ContinuationOptions | None = None) -> EquilibriumBranch:
    """Return the branch that crosses at a branch point the one it was found on, followed both ways.

    Raises:
        RefusedError: it is not found beside the point.
    """
    scaled, options = scaled_field(box), options or ContinuationOptions()
    outside = within(scaled.limits, scaled.states, len(scaled.scale))
    center = np.append(crossing.state, crossing.parameter) / scaled.scale
    way = crossing.directions[1]
    halves = []
    for direction in (-way, way):
        try:
            guess = center + _AWAY * direction
            u = correct(scaled, guess, direction, float(direction @ guess), scaled.jacobian(guess))
            if u is not None:
                beside = point_at(scaled, u, direction)
                halves.append(follow(scaled, beside, outside, options))
        except FieldError:
            continue
    if len(halves) < 2:
        raise RefusedError(f"the other branch at parameter {crossing.parameter:g} is not found beside the crossing")
    backward, forward = halves
    points = [*(point.reversed() for point in reversed(backward.points)), *forward.points]
    return collected(scaled, points, backward, forward)


def collected(scaled: ScaledField, points: list[PathPoint], backward: Path, forward: Path) -> EquilibriumBranch:
    """Return followed points as a branch, everything that happens on it located and put among them."""
    seen, cusps = dips(scaled, observe(scaled, points))
    located = happenings(scaled, seen)
    crossings = [cross for one in _of(located, Happening.BRANCH_POINT) if (cross := branch_point(scaled, one))]
    centers = [np.append(cross.state, cross.parameter) / scaled.scale for cross in crossings]
    folds = [
        one
        for one in _of(located, Happening.FOLD)
        if not any(np.linalg.norm(one.at.point.u - center) < _SAME for center in centers)
    ]
    degenerate = degenerate_points(scaled, seen, located, cusps)
    double = [one.state / scaled.scale[:-1] for one in degenerate if one.kind in _DOUBLE]
    pairs: list[HopfPoint | NeutralSaddle] = [
        hopf_or_saddle(scaled, one)
        for one in located
        if one.kind in {Happening.HOPF, Happening.NEUTRAL_SADDLE}
        and not any(np.linalg.norm(one.at.point.u[:-1] - state) < _TOGETHER for state in double)
    ]
    for one in _of(located, Happening.COINCIDENCE):
        pairs += coincident_hopf_points(scaled, one)
    rows = _with(seen, [one for one in located if one.kind is not Happening.BRANCH_POINT])
    d = scaled.states
    values = np.array([row.point.u for row in rows]) * scaled.scale
    eigenvalues = np.array([row.eigenvalues for row in rows])
    return EquilibriumBranch(
        parameter=values[:, d],
        state=values[:, :d],
        eigenvalues_real=eigenvalues.real,
        eigenvalues_imag=eigenvalues.imag,
        stable=np.asarray((eigenvalues.real < 0.0).all(axis=1)),
        residual=np.array([row.point.residual for row in rows]),
        beginning=backward.ending,
        beginning_note=backward.note,
        end=forward.ending,
        end_note=forward.note,
        limit_points=tuple(limit_point(scaled, one) for one in folds),
        hopf_points=tuple(pair for pair in pairs if isinstance(pair, HopfPoint)),
        neutral_saddles=tuple(pair for pair in pairs if isinstance(pair, NeutralSaddle)),
        branch_points=tuple(crossings),
        degenerate_points=degenerate,
    )


def _of(located: Sequence[Located], kind: Happening) -> list[Located]:
    return [one for one in located if one.kind is kind]


def _with(seen: list[Observed], located: Sequence[Located]) -> list[Observed]:
    """Return the points with the located ones among them, each in its place along the branch."""
    rows: list[Observed] = []
    left = list(located)
    for index, point in enumerate(seen):
        rows.append(point)
        if index + 1 == len(seen):
            break
        chord = seen[index + 1].point.u - point.point.u
        length = float(chord @ chord)
        here: list[tuple[float, Observed]] = []
        for one in list(left):
            share = float((one.at.point.u - point.point.u) @ chord) / length if length else 0.0
            away = one.at.point.u - point.point.u - share * chord
            if 0.0 < share < 1.0 and away @ away <= length:
                here.append((share, one.at))
                left.remove(one)
            elif 0.0 <= share <= 1.0 and away @ away <= length:
                left.remove(one)  # it is one of the points already
        rows += [row for _, row in sorted(here, key=lambda pair: pair[0])]
    return rows

"""Numbers of the analysis, of a model and of many beside it: every point is found once, and then followed.

Points of a model in Liénard form are found wherever they are, those of another planar field within three times
the ranges of its data. Both are followed in the plane of alpha and q as the coefficients
move (``dynamics.planar.tracked``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.any_form import why_planar
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points, neutral_saddles
from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.branch import planar_branches
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.hopf import hopf_numbers
from finback.dynamics.planar.jet import Point
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.tracked import Mark, MovedField, tracked
from finback.dynamics.reduction import reduce
from finback.errors import InputError
from finback.units import from_si

FOLD: Final = "fold"
HOPF: Final = "hopf"
SADDLE: Final = "neutral-saddle"
EQUILIBRIUM: Final = "equilibrium"

_PLACE: Final = ("alpha_rad", "q_rad_s", "elevator_rad")
_WIDER: Final = 3.0
"""Times the ranges of the data, where points of a planar field are looked for: a fold may lie beyond its flights."""
_STARTS: Final = 51
"""Elevators at which branches are looked for: equilibria between two of which fold both ends, 2 % of the range apart,
alone are missed; all others lie on a branch that one of them begins."""


@final
@dataclass(frozen=True, slots=True)
class FollowedPoint:
    """A point of a model.

    Attributes:
        name: "fold 1".
        kind: "fold", "hopf", "neutral-saddle" or "equilibrium".
        at: alpha, q and elevator.
    """

    name: str
    kind: str
    at: Point

    @property
    def mark(self) -> Mark:
        """What makes the point."""
        return {FOLD: Mark.FOLD, EQUILIBRIUM: Mark.HELD}.get(self.kind, Mark.TRACE)


@final
class FollowedNumbers:
    """The numbers of some points of a model, as a function of its coefficients.

    A point of another model is the one that it becomes as the coefficients move there on a straight way; where it
    vanishes on that way, its numbers are left out.

    Args:
        like: the model.
        points: what to follow.
    """

    def __init__(self, like: PolynomialModel, points: tuple[FollowedPoint, ...]) -> None:
        self._like, self._points = like, points
        self._system = PlanarSystem.from_model(like)

    def __call__(self, model: PolynomialModel) -> dict[str, float]:
        """Return name (ending in its unit) -> number.

        Raises:
            InputError: the model has other terms.
        """
        return self.of_all(_in_order(model, self._like)[np.newaxis])[0]

    def of_all(self, coefficients: FloatArray) -> list[dict[str, float]]:
        """Return the numbers of models of these coefficients, shape (n, p), in the order of the model's own."""
        field = MovedField(self._system, coefficients - self._like.coefficients)
        moved = np.asarray(field.changes.any(axis=1))
        found: list[dict[str, float]] = [{} for _ in moved]
        for point in self._points:
            places = tracked(field, point.at, point.mark)
            places[~moved] = point.at
            there = np.flatnonzero(np.isfinite(places).all(axis=1))
            numbers = {**dict(zip(_PLACE, places[there].T, strict=True)), **_properties(field, point, places, there)}
            if point.kind == EQUILIBRIUM:
                del numbers["elevator_rad"]  # it is held
            values = np.stack(list(numbers.values()), axis=-1)
            for row, own in zip(there.tolist(), values.tolist(), strict=True):
                if all(map(math.isfinite, own)):
                    found[row].update((f"{point.name} {name}", v) for name, v in zip(numbers, own, strict=True))
        return found


def analysis_numbers(like: PolynomialModel, within: FloatArray | None = None) -> FollowedNumbers:
    """Return a function that gives what the analysis of a model prints of its points, in SI.

    Of each fold alpha, q, elevator and the other eigenvalue; of each Hopf point the frequency and the first Lyapunov
    coefficient in their place; of each neutral saddle its positive eigenvalue; of each equilibrium, at both ends and in
    the middle of the elevator's range, alpha, q and both parts of the first eigenvalue. Points are counted by rising
    alpha in ``like`` and followed from there, so one that vanishes is left out.

    Args:
        like: the model.
        within: low and high of alpha, q and elevator, shape (3, 2): where points of a planar field are looked for, and
            between which elevators equilibria are; without it, three times the ranges of the data for the former, and
            those of the data for the latter.

    Raises:
        InputError: the model has further inputs; or it has no Liénard form, and nothing says where to look.
        RefusedError: its equilibria are not isolated.
    """
    system = PlanarSystem.from_model(like)
    planar = bool(why_planar(like))
    box = _box(system) if within is None else np.asarray(within)
    points = _planar_points(system, box) if planar else _lienard_points(like)
    named = [
        FollowedPoint(f"{kind} {place}", kind, at)
        for kind, found in points.items()
        for place, at in enumerate(sorted(found), start=1)
    ]
    low, high = (system.domain if within is None else box)[2].tolist()
    elevators = (low, 0.5 * (low + high), high) if math.isfinite(low) and math.isfinite(high) else ()
    least, most = box[0].tolist() if planar else (-math.inf, math.inf)
    for elevator in elevators:
        there = sorted(_place(p.state, elevator) for p in planar_equilibria(system, elevator))
        title = f"at elevator {from_si(elevator, 'deg'):.2f} deg, {EQUILIBRIUM}"
        named += [
            FollowedPoint(f"{title} {place}", EQUILIBRIUM, at)
            for place, at in enumerate((at for at in there if least <= at[0] <= most), start=1)
        ]
    return FollowedNumbers(like, tuple(named))


def _lienard_points(model: PolynomialModel) -> dict[str, list[Point]]:
    system = reduce(model)
    return {
        FOLD: [(point.alpha_rad, point.q_rad_s, point.elevator_rad) for point in folds(system)],
        HOPF: [(point.alpha_rad, point.q_rad_s, point.elevator_rad) for point in hopf_points(system)],
        SADDLE: [(point.alpha_rad, point.q_rad_s, point.elevator_rad) for point in neutral_saddles(system)],
    }


def _planar_points(system: PlanarSystem, box: FloatArray) -> dict[str, list[Point]]:
    if not (np.isfinite(box).all() and (box[:, 0] < box[:, 1]).all()):
        raise InputError("nothing says where to look: the model states no domain", hint="give it one, or identify it")
    begin, end = box[2].tolist()
    starts = [p for elevator in np.linspace(begin, end, _STARTS).tolist() for p in planar_equilibria(system, elevator)]
    found = planar_branches(system, (begin, end), box[:2], starts)
    return {
        FOLD: [_place(point.state, point.parameter) for point in found.folds],
        HOPF: [_place(point.state, point.parameter) for point in found.hopf_points],
        SADDLE: [_place(point.state, point.parameter) for point in found.neutral_saddles],
    }


def _box(system: PlanarSystem) -> FloatArray:
    """Return three times the ranges of the data, shape (3, 2); those that are not known without end."""
    low, high = np.asarray(system.domain).T
    room = np.where(np.isfinite(low) & np.isfinite(high), 0.5 * (_WIDER - 1.0) * (high - low), 0.0)
    return np.stack([low - room, high + room], axis=1)


def _place(state: FloatArray, elevator_rad: float) -> Point:
    return float(state[0]), float(state[1]), elevator_rad


def _properties(field: MovedField, point: FollowedPoint, places: FloatArray, which: IntArray) -> dict[str, FloatArray]:
    """Return name -> values of what else is known of a point at some changes, each of shape (k,)."""
    share, powers = np.ones(which.size), field.powers(places[which])
    p, q, r, s = (
        field.derivative(row, order, powers, share, which)[0] for row in (0, 1) for order in ((1, 0, 0), (0, 1, 0))
    )
    trace, determinant = p + s, p * s - q * r
    if point.kind == FOLD:
        return {"other eigenvalue_1_s": trace}
    if point.kind == EQUILIBRIUM:
        square = 0.25 * trace**2 - determinant
        root = np.sqrt(np.abs(square))
        return {
            "eigenvalue real_1_s": 0.5 * trace + np.where(square > 0.0, root, 0.0),
            "eigenvalue imag_1_s": np.where(square < 0.0, root, 0.0),
        }
    if point.kind == SADDLE:
        return {"eigenvalue_1_s": np.sqrt(np.where(determinant < 0.0, -determinant, np.nan))}
    frequency, lyapunov = hopf_numbers(field, places[which], which).T
    return {"frequency_rad_s": frequency, "lyapunov_1_s": lyapunov}


def _in_order(model: PolynomialModel, like: PolynomialModel) -> FloatArray:
    """Return the coefficients of a model in the order of another one that has the same terms."""
    ordered = []
    for one, other in ((model.alpha_dot, like.alpha_dot), (model.q_dot, like.q_dot)):
        known = dict(zip(map(tuple, one.powers.tolist()), one.coefficients.tolist(), strict=True))
        rows = [tuple(row) for row in other.powers.tolist()]
        if one.variables != other.variables or known.keys() != set(rows):
            raise InputError("numbers are followed among models of the same terms, and this one has others")
        ordered += [known[row] for row in rows]
    return np.array(ordered)

"""How far two manifolds of saddles miss each other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest
from finback.dynamics.manifold import Branch, branch_to, manifold
from finback.dynamics.taylor import Ending
from finback.errors import RefusedError

_OUTWARD: Final = 100.0  # units of the flow: an orbit that comes so far without turning is taken not to return


@final
@dataclass(frozen=True, slots=True)
class Splitting:
    """An unstable branch against a stable one.

    Attributes:
        value: its sign tells which passes outside the other (positive: the unstable one); nan where neither turns.
        outgoing: the unstable branch.
        incoming: the stable branch.
    """

    value: float
    outgoing: Branch
    incoming: Branch

    @property
    def met(self) -> bool:
        """Whether both came to where they are compared, and neither to rest."""
        ending = self.outgoing.path.ending
        return ending is self.incoming.path.ending and ending is not Ending.REST and math.isfinite(self.value)


def between(flow: Flow, points: tuple[Rest, ...], source: int, target: int) -> Splitting:
    """Compare the branch that leaves one saddle towards another with the branch that enters that.

    Both stay on one side of y = 0. They are compared where x is halfway, by |y|; one that turns before counts as
    minus the distance at which it turned. For y > 0, y' grows with a constant force everywhere, so the one value
    rises with it and the other falls (for y < 0 likewise, signs exchanged): **the splitting is strictly monotone in
    the elevator**, and each ordered pair of saddles has at most one such connection in a stretch without folds.
    """
    section = 0.5 * (points[source].x + points[target].x)
    outgoing = _branch(flow, points, source, section, stable=False)
    incoming = _branch(flow, points, target, section, stable=True)
    return Splitting(_height(outgoing, section) - _height(incoming, section), outgoing, incoming)


def around(flow: Flow, points: tuple[Rest, ...], index: int, side: int) -> Splitting:
    """Compare where the two branches of one saddle on one side (-1 left, 1 right) turn.

    A branch that passes the outermost saddle of that side never turns: beyond it the force points outward.
    """
    last = points[-1 if side > 0 else 0]
    section = last.x if last.kind is Kind.SADDLE else last.x + side * _OUTWARD
    outgoing = _branch(flow, points, index, section, stable=False)
    incoming = _branch(flow, points, index, section, stable=True)
    far, near = _turn(outgoing, side), _turn(incoming, side)
    return Splitting(math.nan if math.isinf(far) and math.isinf(near) else far - near, outgoing, incoming)


def _branch(flow: Flow, points: tuple[Rest, ...], index: int, section: float, *, stable: bool) -> Branch:
    found = branch_to(flow, points, manifold(flow, points[index], stable=stable), section)
    if found.path.ending is Ending.NOWHERE:
        raise RefusedError("a manifold of a saddle could not be followed: it needs too many steps")
    return found


def _height(branch: Branch, section: float) -> float:
    path = branch.path
    return abs(path.y) if path.ending is Ending.SECTION else -abs(section - path.x)


def _turn(branch: Branch, side: int) -> float:
    """Return where a branch turns, counted outward; one that rests does so nearer than any that comes back."""
    return math.inf if branch.path.ending in (Ending.SECTION, Ending.AWAY) else side * branch.path.x

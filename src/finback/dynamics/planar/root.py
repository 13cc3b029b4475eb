"""All real common zeros of two polynomials in two variables, each certified, or named as not resolved.

One variable is eliminated without rounding; the zeros of the eliminant, counted by signs (``roots``), leave narrow
boxes, and no common zero lies outside them. Within a box Krawczyk's test (Neumaier, Interval Methods for Systems of
Equations, 1990, section 5.1) with Taylor coefficients and bounds on their rounding shows that there is none, or
exactly one. What neither is shown of, down to where double precision ends, is one zero that is not resolved: two or
more that meet, or miss each other by less than rounding.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.box import (
    NOT_ISOLATED,
    NOT_ISOLATED_HINT,
    boxes,
    second_degree,
    turned_over,
)
from finback.dynamics.planar.system import PlanarFlow
from finback.dynamics.planar.taylor import (
    UNIT_ROUNDOFF,
    Expansion,
    along_principal_axes,
    expansion,
    inverse_of,
    second_derivatives,
)
from finback.errors import RefusedError

_LEAF: Final = 16.0  # roundings: a box in which the rates change by no more is not halved further
_SMALLEST: Final = 1e-30  # zeros of no rounding, where three or more meet, are one below that distance
_BOXES: Final = 20_000
_CONVERGING: Final = 1e-8  # relative: from here on, Newton steps that grow are rounding
_NEWTON_STEPS: Final = 60
_SLOW: Final = 0.3  # of the last step: toward zeros that meet, each Newton step is half of the last or more
_SLOW_STEPS: Final = 12
_TINY: Final = sys.float_info.min


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarRoot:
    """One common zero, or several that double precision cannot tell apart.

    Attributes:
        x: first coordinate.
        y: second coordinate.
        radius: half-widths of a box around it that holds the exact zero and no other, by which signs are judged.
        resolved: whether this is one simple zero; if not, the Jacobian is singular here within rounding.
    """

    x: float
    y: float
    radius: tuple[float, float]
    resolved: bool


def planar_roots(flow: PlanarFlow) -> tuple[PlanarRoot, ...]:
    """Return all common zeros up to 1e9 in absolute value, ordered by x, then by y.

    Raises:
        RefusedError: they are not isolated (the polynomials have a common factor, within rounding), or the
            coefficients are too far apart for double precision.
    """
    if second_degree(flow.first.T, flow.second.T) < 2 <= second_degree(flow.first, flow.second):
        turned = planar_roots(turned_over(flow))
        found = [PlanarRoot(x=r.y, y=r.x, radius=(r.radius[1], r.radius[0]), resolved=r.resolved) for r in turned]
        return tuple(sorted(found, key=lambda r: (r.x, r.y)))
    search = _Search(flow)
    for center, radius in boxes(flow):
        search.look(center, radius)
    return search.roots()


class _Search:
    """Boxes are decided one by one; what remains undecided is gathered in clusters."""

    def __init__(self, flow: PlanarFlow) -> None:
        self._flow = flow
        self._certain: list[tuple[FloatArray, FloatArray, FloatArray]] = []  # center, enclosure, box of uniqueness
        self._leaves: list[tuple[FloatArray, FloatArray]] = []
        self._others: list[PlanarRoot] = []

    def look(self, center: FloatArray, radius: FloatArray) -> None:
        """Decide one box: at once where it holds one simple zero or none, else by halving it along its own axes."""
        here = expansion(self._flow, *center.tolist())
        if self._decided(center, radius, here):
            return
        axes, turned = along_principal_axes(here, self._flow)
        inner = _Search(turned)
        inner.divide(np.abs(axes.T) @ radius)
        self._others += [
            PlanarRoot(
                x=float(center[0] + axes[0] @ (root.x, root.y)),
                y=float(center[1] + axes[1] @ (root.x, root.y)),
                radius=(float(np.abs(axes[0]) @ root.radius), float(np.abs(axes[1]) @ root.radius)),
                resolved=root.resolved,
            )
            for root in inner.roots()
        ]

    def divide(self, radius: FloatArray) -> None:
        """Decide a box around 0 by halving it."""
        stack = [(np.zeros(2), radius)]
        for _ in range(_BOXES):
            if not stack:
                return
            middle, half = stack.pop()
            here = expansion(self._flow, *middle.tolist())
            if self._decided(middle, half, here):
                continue
            noise = here.noise(half) + _TINY
            if (here.reach(half) <= _LEAF * noise).all() or (half <= _SMALLEST).all():
                self._leaves.append((middle, half))
                continue
            # Along the axis that matters more: near a fold the zeros are known far better across than along.
            shares = [(here.reach(np.where(k == np.arange(2), half, 0.0)) / noise).max() for k in (0, 1)]
            axis = int(np.argmax(shares))
            step = np.where(axis == np.arange(2), 0.5 * half, 0.0)
            stack += [(middle - step, half - step), (middle + step, half - step)]
        raise RefusedError(NOT_ISOLATED, hint=NOT_ISOLATED_HINT)

    def _decided(self, center: FloatArray, radius: FloatArray, here: Expansion) -> bool:
        if (np.abs(here.value) > here.reach(radius)).any():
            return True
        return self._known(center, radius) or self._settled(center, radius, here)

    def _known(self, center: FloatArray, radius: FloatArray) -> bool:
        """Tell whether a box lies in one that is known to hold exactly one zero."""
        return any((np.abs(center - c) + radius <= box).all() for c, _, box in self._certain)

    def _settled(self, center: FloatArray, radius: FloatArray, here: Expansion) -> bool:
        """Show that a box holds no zero, or that exactly one zero lies in a box around it."""
        inverse = inverse_of(here.jacobian)
        if inverse is None:
            return False
        with np.errstate(over="ignore", invalid="ignore"):
            moved = -inverse @ here.value
            spread = np.abs(inverse) @ here.rest(radius)
            if (np.abs(moved) - spread > radius).any():
                return True
        point = self._newton(center)
        if point is None:
            return False
        there = expansion(self._flow, *point.tolist())
        inverse = inverse_of(there.jacobian)
        if inverse is None:
            return False
        size = np.abs(inverse)
        offset = np.abs(inverse @ there.value)
        enclosure = 2.0 * (offset + size @ there.error) + np.maximum(_TINY, UNIT_ROUNDOFF * np.abs(point))
        box = np.maximum(np.abs(point - center) + radius, enclosure)
        if not _unique(there, size, offset, box):
            return False
        if not any((np.abs(point - c) <= other).all() for c, _, other in self._certain):
            self._certain.append((point, enclosure, box))
        return True

    def _newton(self, start: FloatArray) -> FloatArray | None:
        point, last, before, slow = start, np.inf, np.inf, 0
        for _ in range(_NEWTON_STEPS):
            here = expansion(self._flow, *point.tolist())
            inverse = inverse_of(here.jacobian)
            if inverse is None:
                return None
            with np.errstate(over="ignore", invalid="ignore"):
                step = inverse @ here.value
                length = float(np.abs(step / np.maximum(np.abs(point), _TINY)).max())
            if not np.isfinite(length):
                return None
            size = float(np.abs(step).max())
            slow += size > _SLOW * before
            if slow > _SLOW_STEPS:
                return None
            before = size
            point = point - step
            if length <= 4.0 * UNIT_ROUNDOFF or (length >= last and length < _CONVERGING):
                return point
            last = length
        return None

    def roots(self) -> tuple[PlanarRoot, ...]:
        """Return what was found, the certain zeros and one for each cluster of undecided boxes."""
        found = [
            PlanarRoot(x=float(c[0]), y=float(c[1]), radius=(float(e[0]), float(e[1])), resolved=True)
            for c, e, _ in self._certain
        ]
        for low, high in _clusters(self._leaves):
            point = _meeting(self._flow, low, high)
            if point is not None:
                half = np.maximum(np.maximum(high - point, point - low), _TINY)
                radius = (float(half[0]), float(half[1]))
                found.append(PlanarRoot(x=float(point[0]), y=float(point[1]), radius=radius, resolved=False))
        for root in self._others:
            if not any(_same(root, other) for other in found):
                found.append(root)
        return tuple(sorted(found, key=lambda root: (root.x, root.y)))


def _same(one: PlanarRoot, other: PlanarRoot) -> bool:
    """Tell whether two boxes with one zero each overlap: neighboring boxes can both lead to a zero between them."""
    offset = np.abs([one.x - other.x, one.y - other.y])
    return bool((offset <= np.add(one.radius, other.radius)).all())


def _unique(there: Expansion, size: FloatArray, offset: FloatArray, box: FloatArray) -> bool:
    """Krawczyk's test: the box is mapped into itself, and the map contracts."""
    with np.errstate(over="ignore", invalid="ignore"):
        inside = (offset + size @ there.rest(box) <= box).all()
        # Row sums in the norm of the box.
        slack = (size @ there.bend(box)) @ box
    return bool(inside and (slack < box).all())


def _meeting(flow: PlanarFlow, low: FloatArray, high: FloatArray) -> FloatArray | None:
    """Return the point of a cluster where the Jacobian is singular and both rates vanish within rounding.

    Newton's method for det J = 0 and the component of the rates across the null direction; it ends, undamped, where
    the zeros meet. Where that fails (more than two meet), the middle of the cluster is tried.
    """
    middle = 0.5 * (low + high)
    wide = np.maximum(high - low, 4.0 * UNIT_ROUNDOFF * np.abs(middle))
    point = middle
    for _ in range(20):
        step = _meeting_step(expansion(flow, *point.tolist()))
        if step is None or not np.isfinite(step).all():
            break
        point = point + step
        if (np.abs(point - middle) > 2.0 * wide).any():
            break
    for candidate in (point, middle):
        here = expansion(flow, *candidate.tolist())
        near = (np.abs(candidate - middle) <= 2.0 * wide).all()
        # As far as half a leaf changes the rates: no more can be asked of the middle of one.
        slack = 2.0 * here.error + (here.rest(0.5 * wide) if candidate is middle else 0.0)
        if near and (np.abs(here.value) <= slack).all():
            return np.array(candidate)
    return None


def _meeting_step(here: Expansion) -> FloatArray | None:
    left, values, _ = np.linalg.svd(here.jacobian)
    if not values[0] > 0.0:
        return None
    across = left[:, 0]
    (p, q), (r, s) = here.jacobian
    second = second_derivatives(here)
    by_state = np.array(
        [second[0, k, 0] * s + p * second[1, 1, k] - second[0, 1, k] * r - q * second[1, k, 0] for k in (0, 1)]
    )
    matrix = np.array([across @ here.jacobian, by_state])
    inverse = inverse_of(matrix)
    return None if inverse is None else -inverse @ np.array([across @ here.value, p * s - q * r])


def _clusters(leaves: list[tuple[FloatArray, FloatArray]]) -> list[tuple[FloatArray, FloatArray]]:
    """Join boxes that touch, and return the hull (low, high) of each group."""
    hulls: list[tuple[FloatArray, FloatArray]] = []
    for center, half in leaves:
        low, high = center - half, center + half
        slack = half + 4.0 * UNIT_ROUNDOFF * np.abs(center)
        while True:
            touching = [h for h in hulls if (h[0] <= high + slack).all() and (low - slack <= h[1]).all()]
            if not touching:
                break
            hulls = [h for h in hulls if not any(h is t for t in touching)]
            low = np.min([low, *(t[0] for t in touching)], axis=0)
            high = np.max([high, *(t[1] for t in touching)], axis=0)
        hulls.append((low, high))
    return hulls

"""A planar system at a held parameter in units of a box of interest, with its equilibria: where orbits are followed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind, kind_of
from finback.dynamics.planar.capture import planar_captures
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.field import PlanarField
from finback.dynamics.planar.orbit import Limits
from finback.dynamics.planar.system import PlanarScale, PlanarSystem
from finback.errors import InputError, RefusedError

_REACH: Final = 1.5
_NEWTON: Final = 30
_STILL: Final = 1e-16
_SHORTEST: Final = 2.0**-6  # of the way to other coefficients
_NEUTRAL: Final = 1e-9  # of the Jacobian: a smaller trace makes neither sink nor source
_NEARBY: Final = 0.2  # half-widths of the box


@final
@dataclass(frozen=True, slots=True, eq=False)
class PlanarSetting:
    """A field in units of the box: the half-widths of the box are 1, the fastest eigenvalue in it is 1.

    Attributes:
        system: the system.
        parameter: held.
        scale: the units.
        field: the field in these units.
        box: low and high of x and y, in these units, shape (2, 2).
        points: equilibria in these units, shape (n, 2).
        kinds: what they are.
        attracting: a row of ``planar_capture`` for each sink, shape (k, 5).
        repelling: the same for each source, backward in time.
    """

    system: PlanarSystem
    parameter: float
    scale: PlanarScale
    field: PlanarField
    box: FloatArray
    points: FloatArray
    kinds: tuple[Kind, ...]
    attracting: FloatArray
    repelling: FloatArray

    @property
    def units(self) -> FloatArray:
        """Units of both states, shape (2,)."""
        return np.array([self.scale.first, self.scale.second])

    def limits(self, *, forward: bool, around: float = 1.0) -> Limits:
        """Return where an orbit ends that cannot be part of anything that lies in so many times the box."""
        far = _REACH * around * float(np.abs(self.box).max())
        return Limits(self.attracting if forward else self.repelling, far)

    def holds(self, states: FloatArray) -> bool:
        """Tell whether all states of shape (..., 2), in these units, lie in the box."""
        return bool(((self.box[:, 0] <= states) & (states <= self.box[:, 1])).all())

    def supports(self, states: FloatArray) -> bool:
        """Tell whether all states of shape (n, 2), in these units, lie where data supported the system."""
        inside = self.system.supported
        point = states * self.units
        known = (inside[:2, 0] <= point) & (point <= inside[:2, 1])
        return bool(known.all()) and bool(inside[2, 0] <= self.parameter <= inside[2, 1])


def planar_setting(system: PlanarSystem, parameter: float, box: ArrayLike) -> PlanarSetting:
    """Find the equilibria at a held parameter and measure the field by them and by a box.

    Args:
        system: the system.
        parameter: held.
        box: low and high of both states, in SI, shape (2, 2).

    Raises:
        InputError: the box is none.
        RefusedError: the equilibria cannot be found (``planar_equilibria``), or coefficients overflow.
    """
    sides = checked_box(box)
    found = planar_equilibria(system, parameter)
    width = 0.5 * (sides[:, 1] - sides[:, 0])
    inside = [p for p in found if ((sides[:, 0] <= p.state) & (p.state <= sides[:, 1])).all()]
    fastest = max((np.hypot(p.eigenvalues_real, p.eigenvalues_imag).max() for p in inside), default=0.0)
    scale = PlanarScale(
        first=float(width[0]), second=float(width[1]), time=1.0 / float(fastest) if fastest > 0.0 else 1.0
    )
    points = np.array([point.state for point in found]).reshape(-1, 2) / width
    kinds = tuple(point.kind for point in found)
    return _setting(system, parameter, scale, sides / width[:, np.newaxis], points, kinds)


def continued(setting: PlanarSetting, parameter: float, guess: FloatArray) -> PlanarSetting:
    """Return the setting at another parameter, in the same units, with equilibria of the same kinds near a guess.

    Args:
        setting: where the kinds are known.
        parameter: the other parameter; no fold may lie between.
        guess: the equilibria there, roughly, shape (n, 2).

    Raises:
        RefusedError: Newton's method does not come to equilibria near the guess.
    """
    field = PlanarField.of(setting.system.at(parameter, setting.scale))
    return _setting(
        setting.system, parameter, setting.scale, setting.box, _followed(field, guess), setting.kinds, field
    )


def _followed(field: PlanarField, guess: FloatArray) -> FloatArray:
    points = []
    for start in guess:
        x, y = start.tolist()
        for _ in range(_NEWTON):
            p, q = field.flow.velocity(x, y)
            (a, b), (c, d) = field.jacobian(x, y).tolist()
            determinant = a * d - b * c or math.nan
            u, v = (d * p - b * q) / determinant, (a * q - c * p) / determinant
            x, y = x - u, y - v
            if not abs(u) + abs(v) > _STILL * (1.0 + abs(x) + abs(y)):
                break
        if not math.hypot(x - start[0], y - start[1]) < _NEARBY:
            raise RefusedError("an equilibrium cannot be followed from one parameter to the next")
        points.append((x, y))
    return np.array(points).reshape(-1, 2)


def moved_setting(setting: PlanarSetting, change: FloatArray, parameter: float) -> PlanarSetting:
    """Return the setting of a system whose θ is changed, at another parameter, by steps as short as it takes.

    Args:
        setting: of the system as it is.
        change: of θ, shape (p,).
        parameter: the other parameter.

    Raises:
        RefusedError: an equilibrium vanishes on the way, or moves too fast to be followed.
    """
    points, kinds, field = setting.points, setting.kinds, setting.field
    system, share, step = setting.system, 0.0, 1.0
    while share < 1.0:
        ahead = min(share + step, 1.0)
        there = setting.parameter + ahead * (parameter - setting.parameter)
        try:
            system = setting.system.moved(ahead * change)
            field = PlanarField.of(system.at(there, setting.scale))
            points, kinds = _of_the_same(field, points, setting.kinds)
            share = ahead
        except RefusedError:
            step *= 0.5
            if step < _SHORTEST:
                raise
    return _setting(system, parameter, setting.scale, setting.box, points, kinds, field)


def _of_the_same(field: PlanarField, guess: FloatArray, known: tuple[Kind, ...]) -> tuple[FloatArray, tuple[Kind, ...]]:
    """Return equilibria near a guess and their kinds, of which stability alone may be another.

    Raises:
        RefusedError: Newton's method does not come to them, or a saddle has become something else.
    """
    points = _followed(field, guess)
    kinds = tuple(_kind(field, x, y) for x, y in points.tolist())
    if [kind is Kind.SADDLE for kind in kinds] != [kind is Kind.SADDLE for kind in known]:
        raise RefusedError("an equilibrium vanishes on the way to other coefficients")
    return points, kinds


def _kind(field: PlanarField, x: float, y: float) -> Kind:
    (a, b), (c, d) = field.jacobian(x, y).tolist()
    trace, size = a + d, abs(a) + abs(b) + abs(c) + abs(d)
    return kind_of(trace if abs(trace) > _NEUTRAL * size else 0.0, a * d - b * c)


def _setting(  # noqa: PLR0913, PLR0917 - the fields of the result
    system: PlanarSystem,
    parameter: float,
    scale: PlanarScale,
    box: FloatArray,
    points: FloatArray,
    kinds: tuple[Kind, ...],
    known: PlanarField | None = None,
) -> PlanarSetting:
    field = PlanarField.of(system.at(parameter, scale)) if known is None else known
    sinks = [(x, y) for (x, y), kind in zip(points.tolist(), kinds, strict=True) if kind.stable]
    sources = [(x, y) for (x, y), kind in zip(points.tolist(), kinds, strict=True) if is_source(kind)]
    return PlanarSetting(
        system,
        parameter,
        scale,
        field,
        box,
        points,
        kinds,
        planar_captures(field, sinks, forward=True),
        planar_captures(field, sources, forward=False),
    )


def checked_box(box: ArrayLike) -> FloatArray:
    """Return a box as an array of shape (2, 2).

    Raises:
        InputError: it is none.
    """
    sides = np.array(box, dtype=np.float64)
    if sides.shape != (2, 2) or not np.isfinite(sides).all() or not (sides[:, 0] < sides[:, 1]).all():
        raise InputError(
            f"a box is two finite intervals, one for each state, got {sides.tolist()}",
            hint="give [[low, high], [low, high]]",
        )
    return sides


def is_source(kind: Kind) -> bool:
    """Tell whether both eigenvalues have positive real parts."""
    return kind in (Kind.UNSTABLE_FOCUS, Kind.UNSTABLE_NODE)

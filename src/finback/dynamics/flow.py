"""The autonomous field of a Liénard system at a held elevator, in units of its own size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.equilibrium import Kind, eigenvalues, kind_of
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import real_roots, sign_across
from finback.errors import InputError, RefusedError

_TOO_LARGE: Final = "the coefficients of the model are too large for double precision"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Units in which the numbers of a field are near 1, so that no magnitude of a model overflows a power series.

    Attributes:
        length_rad: unit of angle.
        time_s: unit of time.
    """

    length_rad: float
    time_s: float

    @property
    def speed_rad_s(self) -> float:
        """Unit of dα/dt."""
        return self.length_rad / self.time_s


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """x' = y, y' = f(x) y + g(x), numbers without a unit.

    Attributes:
        damping: coefficients of f by rising power.
        force: coefficients of g by rising power, the effect of the elevator included.
        force_sizes: what each coefficient of g was summed from, for the rounding of its roots.
    """

    damping: tuple[float, ...]
    force: tuple[float, ...]
    force_sizes: tuple[float, ...]

    def acceleration(self, x: float, y: float) -> float:
        """Return y'."""
        return horner(self.damping, x) * y + horner(self.force, x)

    def in_units(self, length: float, time: float) -> Flow:
        """Return the same flow with x counted in another unit of length and t in another unit of time.

        Raises:
            RefusedError: a coefficient leaves the range of double precision.
        """
        try:
            by_f = [time * length**k for k in range(len(self.damping))]
            by_g = [time * time * length ** (k - 1) for k in range(len(self.force))]
        except OverflowError as error:  # what a power of a float gives, where a product gives inf
            raise RefusedError(_TOO_LARGE) from error
        flow = Flow(
            damping=tuple(c * unit for c, unit in zip(self.damping, by_f, strict=True)),
            force=tuple(c * unit for c, unit in zip(self.force, by_g, strict=True)),
            force_sizes=tuple(c * unit for c, unit in zip(self.force_sizes, by_g, strict=True)),
        )
        if not all(map(math.isfinite, (*flow.damping, *flow.force))):
            raise RefusedError(_TOO_LARGE)
        return flow


def plain_flow(damping: Sequence[float], force: Sequence[float]) -> Flow:
    """Return the flow of given coefficients, by rising power, each exact by definition."""
    rows = tuple(map(float, damping)), tuple(map(float, force))
    if not all(row and all(map(math.isfinite, row)) for row in rows):
        raise InputError(f"damping and force need one finite coefficient or more each, got {damping} and {force}")
    return Flow(damping=rows[0], force=rows[1], force_sizes=tuple(map(abs, rows[1])))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """An equilibrium of a flow.

    Attributes:
        x: where; y is 0.
        kind: by the eigenvalues.
        eigenvalues_real: the larger first.
    """

    x: float
    kind: Kind
    eigenvalues_real: tuple[float, float]


def flow_at(system: LienardSystem, elevator_rad: float, scale: Scale) -> Flow:
    """Return the field at a held elevator in units of ``scale``."""
    force = system.force.ascending.tolist()
    effect = system.elevator_gain * elevator_rad
    sizes = [abs(c) for c in force]
    force[0] += effect
    sizes[0] += abs(effect)
    plain = Flow(damping=tuple(system.damping.ascending.tolist()), force=tuple(force), force_sizes=tuple(sizes))
    return plain.in_units(scale.length_rad, scale.time_s)


def rests(flow: Flow) -> tuple[Rest, ...]:
    """Return all equilibria by rising x."""
    slope = derivative(flow.force)
    found = []
    for root in real_roots(flow.force, magnitudes=flow.force_sizes):
        trace, determinant = horner(flow.damping, root.value), -horner(slope, root.value)
        known = root.resolved and sign_across(slope, root.bracket) != 0
        traced = sign_across(flow.damping, root.bracket) != 0
        kind = kind_of(trace if traced else 0.0, determinant if known else 0.0)
        found.append(Rest(x=root.value, kind=kind, eigenvalues_real=eigenvalues(trace, determinant)[0]))
    return tuple(found)


def natural_scale(system: LienardSystem, elevator_rad: float) -> tuple[Scale, tuple[Kind, ...]]:
    """Return units in which the outer equilibria lie 2 apart and the fastest eigenvalue is about 1, and all kinds.

    The units are 1 rad and 1 s where there are not two distinct equilibria to measure by.
    """
    plain = Scale(length_rad=1.0, time_s=1.0)
    flow = flow_at(system, elevator_rad, plain)
    points = rests(flow)
    slope = derivative(flow.force)
    length = 0.5 * (points[-1].x - points[0].x) if points else 0.0
    fastest = max((abs(horner(slope, point.x)) for point in points), default=0.0)
    found = Scale(length_rad=length, time_s=fastest**-0.5) if length > 0.0 and fastest > 0.0 else plain
    return found, tuple(point.kind for point in points)


def horner(ascending: Sequence[float], x: float) -> float:
    """Evaluate a polynomial given by rising power."""
    total = 0.0
    for coefficient in reversed(ascending):
        total = total * x + coefficient
    return total


def derivative(ascending: Sequence[float]) -> tuple[float, ...]:
    """Return the derivative of a polynomial given by rising power."""
    return tuple(k * c for k, c in enumerate(ascending))[1:] or (0.0,)


def shifted(ascending: Sequence[float], x: float) -> list[float]:
    """Return the coefficients of p(x + u) by rising power of u (repeated synthetic division)."""
    row = list(ascending)
    for start in range(len(row) - 1):
        for k in range(len(row) - 2, start - 1, -1):
            row[k] += x * row[k + 1]
    return row

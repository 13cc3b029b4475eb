"""How many equilibria and limit cycles a family has at one place of its plane, of what kind, and in which region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.cycle.flow_cycle import FlowCycles, flow_cycles
from finback.dynamics.equilibrium import Kind
from finback.dynamics.family import Family
from finback.dynamics.flow import Rest, rests
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.normal_form.cubic_region import RegionAnswer, exact_curves, region

_HINDERED: Final = "followed"
"""In the finding of a search that met an obstacle."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesAround:
    """The limit cycles around one group of equilibria.

    Attributes:
        enclosed: the equilibria inside, counted from 0 by rising x.
        stable: of each cycle, outward, whether it attracts.
    """

    enclosed: tuple[int, ...]
    stable: tuple[bool, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """What there is at one place of the plane.

    Attributes:
        mu: the place.
        lam: the place.
        equilibria: kinds, by rising x.
        cycles: by the equilibria inside, each group that has any.
        unsure: groups of equilibria around which larger or smaller cycles could not be looked for.
    """

    mu: float
    lam: float
    equilibria: tuple[Kind, ...]
    cycles: tuple[CyclesAround, ...]
    unsure: tuple[tuple[int, ...], ...] = ()

    def around(self, *enclosed: int) -> tuple[bool, ...]:
        """Return of each cycle around exactly these equilibria, outward, whether it attracts."""
        return next((group.stable for group in self.cycles if group.enclosed == enclosed), ())

    @property
    def total(self) -> int:
        """The number of limit cycles."""
        return sum(len(group.stable) for group in self.cycles)

    @property
    def wells(self) -> tuple[int, int, int]:
        """Cycles around the left, the right, and both of two wells with a saddle between; (n, 0, 0) for one well."""
        return len(self.around(0)), len(self.around(2)), len(self.around(0, 1, 2))


def counts(family: Family, mu: float, lam: float) -> Counts:
    """Count equilibria and limit cycles at one place, by finding all of them.

    The number of cycles is measured, not proven (see ``flow_cycles``).

    Raises:
        RefusedError: two equilibria meet within rounding; the force is zero everywhere.
    """
    flow = family.at(mu, lam)
    return counted(mu, lam, rests(flow), flow_cycles(flow))


def counted(mu: float, lam: float, points: Sequence[Rest], found: FlowCycles) -> Counts:
    """Return the counts of equilibria and cycles that are known already."""

    def indices(places: tuple[float, ...]) -> tuple[int, ...]:
        return tuple(min(range(len(points)), key=lambda k: abs(points[k].x - x)) for x in places)

    groups: dict[tuple[int, ...], list[bool]] = {}
    for cycle in found.cycles:
        groups.setdefault(indices(cycle.enclosed), []).append(cycle.stable)
    return Counts(
        mu=mu,
        lam=lam,
        equilibria=tuple(point.kind for point in points),
        cycles=tuple(CyclesAround(enclosed=key, stable=tuple(flags)) for key, flags in sorted(groups.items())),
        unsure=tuple(indices(search.enclosed) for search in found.searched if _HINDERED in search.finding),
    )


def exact_region(cubic: Cubic) -> RegionAnswer:
    """Return the region I-V of a cubic system by its own loop and its own fold of cycles.

    Raises:
        RefusedError: the system is not in normal form with b2 = 1, the origin is no focus or node between saddles, or
            there are more folds of cycles than five regions know.
    """
    return region(cubic, exact_curves(cubic))

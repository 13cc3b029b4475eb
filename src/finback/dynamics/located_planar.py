"""Located objects of a planar field in the layout that all share; names and units are those of its variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.located import NOT_STATED, Bracket, Estimate, Located, Parameter, Quantity, walk
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.planar.analysis_cycles import ParameterCycles
from finback.dynamics.planar.branch import PlanarBranches
from finback.dynamics.planar.branch_point import PlanarBranchPoint
from finback.dynamics.planar.connection import PlanarHeteroclinic, PlanarHomoclinic
from finback.dynamics.planar.connection_search import PlanarConnections
from finback.dynamics.planar.cycle import PlanarCycle
from finback.dynamics.planar.cycle_family import PlanarCycleFamily, PlanarCycleFold
from finback.dynamics.planar.equilibrium import PlanarEquilibrium
from finback.dynamics.planar.fold import PlanarCusp, PlanarFold
from finback.dynamics.planar.hopf import PlanarBogdanovTakens, PlanarHopf, PlanarNeutralSaddle
from finback.dynamics.planar.system import PlanarSystem
from finback.units import quantity_of, quotient, unit_of

CONTAINERS: Final[Mapping[type, tuple[str, ...]]] = {
    PlanarAnalysis: ("equilibria", "found", "connections", "limit_cycles"),
    PlanarBranches: (
        "folds",
        "cusps",
        "hopf_points",
        "neutral_saddles",
        "bogdanov_takens",
        "branch_points",
    ),
    PlanarConnections: ("heteroclinics", "homoclinics"),
    ParameterCycles: ("cycles", "families"),
    PlanarCycleFamily: ("folds",),
}
"""Result -> its fields that hold located objects, or further results."""


def located_planar(analysis: PlanarAnalysis) -> tuple[Located, ...]:
    """Return every located object of an analysis, in the order of its fields."""
    naming = _Naming(analysis.system)
    return tuple(DESCRIPTIONS[type(found)](found, naming) for found in walk(analysis, tuple(DESCRIPTIONS), CONTAINERS))


class _Point(Protocol):
    """What all points of a planar field have."""

    @property
    def parameter(self) -> float: ...
    @property
    def state(self) -> FloatArray: ...
    @property
    def in_domain(self) -> bool: ...


@final
@dataclass(frozen=True, slots=True)
class _Naming:
    """Names and units of a system's variables, of its rates and of its time."""

    system: PlanarSystem

    @property
    def timed(self) -> bool:
        """Whether time is in seconds; a field of pure numbers may have a time without unit."""
        curves = (self.system.first, self.system.second)
        return any(curve.polynomial.value_unit != "1" for curve in curves)

    def per_time(self, power: int = 1) -> str:
        """Return the unit of an eigenvalue, or of a product of two."""
        return f"1_s{power if power > 1 else ''}" if self.timed else "1"

    def parameter(self, value: float, interval: FloatArray) -> Parameter:
        name = self.system.variables[2]
        return Parameter(name=quantity_of(name), value=value, unit=unit_of(name), interval=interval)

    def state(self, values: FloatArray, intervals: FloatArray) -> dict[str, Estimate]:
        """Return both states; ``intervals`` has shape (2, 2), or (0,) where none are stated."""
        rows = intervals if intervals.size else (NOT_STATED, NOT_STATED)
        return {
            quantity_of(name): Estimate(value=value, unit=unit_of(name), interval=row)
            for name, value, row in zip(self.system.variables[:2], values.tolist(), rows, strict=True)
        }

    def extent(
        self, low: FloatArray, high: FloatArray, low_interval: FloatArray, high_interval: FloatArray
    ) -> dict[str, Estimate]:
        """Return the least and the greatest value of both states; intervals as for ``state``."""
        ends = {"min": self.state(low, low_interval), "max": self.state(high, high_interval)}
        return {
            f"{quantity_of(name)}_{end}": values[quantity_of(name)]
            for name in self.system.variables[:2]
            for end, values in ends.items()
        }

    def gap(self, values: FloatArray) -> dict[str, Quantity]:
        """Return by how much two states differ."""
        return {
            f"{quantity_of(name)}_gap": Quantity(value=value, unit=unit_of(name))
            for name, value in zip(self.system.variables[:2], values.tolist(), strict=True)
        }

    def brackets(self, points: FloatArray) -> tuple[Bracket, ...]:
        """Return the box that two points (states, and parameter if they have one) span, shape (2, 2) or (2, 3)."""
        return tuple(
            Bracket(name=quantity_of(name), unit=unit_of(name), low=low, high=high)
            for name, low, high in zip(
                self.system.variables, points.min(axis=0).tolist(), points.max(axis=0).tolist(), strict=False
            )
        )

    def parameter_bracket(self, ends: FloatArray) -> tuple[Bracket, ...]:
        """Return a bracket of the parameter, shape (2,)."""
        name = self.system.variables[2]
        return (Bracket(name=quantity_of(name), unit=unit_of(name), low=float(ends[0]), high=float(ends[1])),)

    def located(  # noqa: PLR0913 - the parts of the layout
        self,
        kind: str,
        point: _Point,
        *,
        residual: Mapping[str, Quantity],
        properties: Mapping[str, Estimate] | None = None,
        words: Mapping[str, str] | None = None,
        parameter_interval: FloatArray = NOT_STATED,
        state_interval: FloatArray = NOT_STATED,
        bracket: FloatArray = NOT_STATED,
    ) -> Located:
        return Located(
            kind=kind,
            parameter=self.parameter(point.parameter, parameter_interval),
            state=self.state(point.state, state_interval),
            properties=properties or {},
            words=words or {},
            residual=residual,
            brackets=self.brackets(bracket) if bracket.size else (),
            in_domain=point.in_domain,
        )


def _known(value: float, unit: str, interval: FloatArray = NOT_STATED) -> Estimate:
    return Estimate(value=value, unit=unit, interval=interval)


def _equilibrium(point: PlanarEquilibrium, naming: _Naming) -> Located:
    unit = naming.per_time()
    curves = (naming.system.first, naming.system.second)
    return naming.located(
        "equilibrium",
        point,
        residual={
            f"{quantity_of(name)}_dot": Quantity(value=value, unit=curve.polynomial.value_unit)
            for name, value, curve in zip(naming.system.variables[:2], point.residual.tolist(), curves, strict=True)
        },
        properties={
            f"eigenvalue_{i}_{part}": _known(float(values[i - 1]), unit)
            for i in (1, 2)
            for part, values in (("real", point.eigenvalues_real), ("imag", point.eigenvalues_imag))
        },
        words={"stability": point.kind.value},
        parameter_interval=frozen_array([point.parameter] * 2),
        state_interval=point.state_interval,
    )


def _fold(point: PlanarFold, naming: _Naming) -> Located:
    return naming.located(
        "fold",
        point,
        residual={"determinant": Quantity(value=point.residual, unit=naming.per_time(2))},
        properties={"other_eigenvalue": _known(point.other_eigenvalue, naming.per_time())},
        words={"equilibria": "above" if point.curvature > 0.0 else "below"},
        parameter_interval=point.parameter_interval,
        state_interval=point.state_interval,
        bracket=point.bracket,
    )


def _cusp(point: PlanarCusp, naming: _Naming) -> Located:
    residual = {"determinant": Quantity(value=point.residual, unit=naming.per_time(2))}
    return naming.located("cusp", point, residual=residual)


def _hopf(point: PlanarHopf, naming: _Naming) -> Located:
    first, _, parameter = (unit_of(name) for name in naming.system.variables)
    rate = naming.per_time()
    return naming.located(
        "hopf",
        point,
        residual={"trace": Quantity(value=point.residual, unit=rate)},
        properties={
            "frequency": _known(point.frequency, "rad_s" if naming.timed else "1", point.frequency_interval),
            "first_lyapunov_coefficient": _known(
                point.lyapunov, quotient(quotient(rate, first), first), point.lyapunov_interval
            ),
            "crossing_speed": _known(point.crossing_speed, quotient(rate, parameter)),
        },
        words={"criticality": point.criticality.value},
        parameter_interval=point.parameter_interval,
        state_interval=point.state_interval,
        bracket=point.bracket,
    )


def _neutral_saddle(point: PlanarNeutralSaddle, naming: _Naming) -> Located:
    return naming.located(
        "neutral-saddle",
        point,
        residual={"trace": Quantity(value=point.residual, unit=naming.per_time())},
        properties={"eigenvalue": _known(point.eigenvalue, naming.per_time())},
        parameter_interval=point.parameter_interval,
        state_interval=point.state_interval,
        bracket=point.bracket,
    )


def _bogdanov_takens(point: PlanarBogdanovTakens, naming: _Naming) -> Located:
    trace, determinant = point.residual.tolist()
    return naming.located(
        "bogdanov-takens",
        point,
        residual={
            "trace": Quantity(value=trace, unit=naming.per_time()),
            "determinant": Quantity(value=determinant, unit=naming.per_time(2)),
        },
    )


def _branch_point(point: PlanarBranchPoint, naming: _Naming) -> Located:
    return naming.located(
        "branch-point",
        point,
        residual={"largest_minor": Quantity(value=point.residual, unit="1")},
        properties={"other_eigenvalue": _known(point.other_eigenvalue, naming.per_time())},
        words={"crossing": point.crossing.value},
    )


def _heteroclinic(orbit: PlanarHeteroclinic, naming: _Naming) -> Located:
    source, target = (naming.state(state, NOT_STATED) for state in (orbit.from_state, orbit.to_state))
    return Located(
        kind="heteroclinic",
        parameter=naming.parameter(orbit.parameter, orbit.parameter_interval),
        state={
            **{f"from_{name}": value for name, value in source.items()},
            **{f"to_{name}": value for name, value in target.items()},
        },
        properties={},
        words={},
        residual=naming.gap(orbit.residual),
        brackets=naming.parameter_bracket(orbit.bracket),
        in_domain=orbit.in_domain,
    )


def _homoclinic(orbit: PlanarHomoclinic, naming: _Naming) -> Located:
    return Located(
        kind="homoclinic",
        parameter=naming.parameter(orbit.parameter, orbit.parameter_interval),
        state=naming.state(orbit.state, NOT_STATED),
        properties={"saddle_trace": _known(orbit.divergence, naming.per_time())},
        words={},
        residual=naming.gap(orbit.residual),
        brackets=naming.parameter_bracket(orbit.bracket),
        in_domain=orbit.in_domain,
    )


def _cycle(cycle: PlanarCycle, naming: _Naming) -> Located:
    return Located(
        kind="cycle",
        parameter=naming.parameter(cycle.parameter, frozen_array([cycle.parameter] * 2)),
        state=naming.extent(cycle.low, cycle.high, cycle.low_interval, cycle.high_interval),
        properties={
            "period": _known(cycle.period, "s" if naming.timed else "1", cycle.period_interval),
            "multiplier": _known(cycle.multiplier, "1"),
            "log_multiplier": _known(cycle.log_multiplier, "1", cycle.log_multiplier_interval),
            "enclosed_equilibria": _known(len(cycle.enclosed), "1"),
        },
        words={"stability": "stable" if cycle.stable else "unstable"},
        residual=naming.gap(cycle.residual),
        brackets=naming.brackets(cycle.bracket),
        in_domain=cycle.in_domain,
    )


def _cycle_fold(fold: PlanarCycleFold, naming: _Naming) -> Located:
    return Located(
        kind="cycle-fold",
        parameter=naming.parameter(fold.parameter, fold.parameter_interval),
        state=naming.extent(fold.low, fold.high, NOT_STATED, NOT_STATED),
        properties={"period": _known(fold.period, "s" if naming.timed else "1")},
        words={"resolved": "resolved" if fold.resolved else "unresolved"},
        residual={"log_multiplier": Quantity(value=fold.residual, unit="1")},
        brackets=naming.brackets(fold.bracket),
        in_domain=fold.in_domain,
    )


DESCRIPTIONS: Final[Mapping[type, Callable[[Any, _Naming], Located]]] = {
    PlanarEquilibrium: _equilibrium,
    PlanarFold: _fold,
    PlanarCusp: _cusp,
    PlanarHopf: _hopf,
    PlanarNeutralSaddle: _neutral_saddle,
    PlanarBogdanovTakens: _bogdanov_takens,
    PlanarBranchPoint: _branch_point,
    PlanarHeteroclinic: _heteroclinic,
    PlanarHomoclinic: _homoclinic,
    PlanarCycle: _cycle,
    PlanarCycleFold: _cycle_fold,
}
"""Class of an object -> how it is described."""

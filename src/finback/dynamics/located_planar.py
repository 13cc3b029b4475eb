"""Located objects of a planar field in the layout that all share; names and units are those of its variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.located import NOT_STATED, Bracket, Estimate, Located, Parameter, Quantity, walk
from finback.dynamics.planar import PlanarSystem
from finback.dynamics.planar_analysis import PlanarAnalysis
from finback.dynamics.planar_branch import PlanarBranches
from finback.dynamics.planar_branch_point import PlanarBranchPoint
from finback.dynamics.planar_equilibrium import PlanarEquilibrium
from finback.dynamics.planar_fold import PlanarCusp, PlanarFold
from finback.dynamics.planar_hopf import PlanarBogdanovTakens, PlanarHopf, PlanarNeutralSaddle
from finback.units import quantity_of, quotient, unit_of

CONTAINERS: Final = (PlanarAnalysis, PlanarBranches)
"""Results that hold located objects in their fields."""


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

    def brackets(self, points: FloatArray) -> tuple[Bracket, ...]:
        """Return the box that two points (first state, second state, parameter) span, shape (2, 3)."""
        return tuple(
            Bracket(name=quantity_of(name), unit=unit_of(name), low=low, high=high)
            for name, low, high in zip(
                self.system.variables, points.min(axis=0).tolist(), points.max(axis=0).tolist(), strict=True
            )
        )

    def located(  # noqa: PLR0913 - the parts of the layout
        self,
        kind: str,
        point: _Point,
        *,
        residual: Mapping[str, Quantity],
        properties: Mapping[str, Quantity] | None = None,
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
            f"eigenvalue_{i}_{part}": Quantity(value=float(values[i - 1]), unit=unit)
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
        properties={"other_eigenvalue": Quantity(value=point.other_eigenvalue, unit=naming.per_time())},
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
            "frequency": Quantity(value=point.frequency, unit="rad_s" if naming.timed else "1"),
            "first_lyapunov_coefficient": Quantity(value=point.lyapunov, unit=quotient(quotient(rate, first), first)),
            "crossing_speed": Quantity(value=point.crossing_speed, unit=quotient(rate, parameter)),
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
        properties={"eigenvalue": Quantity(value=point.eigenvalue, unit=naming.per_time())},
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
        properties={"other_eigenvalue": Quantity(value=point.other_eigenvalue, unit=naming.per_time())},
        words={"crossing": point.crossing.value},
    )


DESCRIPTIONS: Final[Mapping[type, Callable[[Any, _Naming], Located]]] = {
    PlanarEquilibrium: _equilibrium,
    PlanarFold: _fold,
    PlanarCusp: _cusp,
    PlanarHopf: _hopf,
    PlanarNeutralSaddle: _neutral_saddle,
    PlanarBogdanovTakens: _bogdanov_takens,
    PlanarBranchPoint: _branch_point,
}
"""Class of an object -> how it is described."""

"""Every located object in one layout: kind, parameter, state, interval, bracket, residual, inside the data or not.

The classes of the objects themselves (``Fold``, ``Hopf``, …) say what each number means; this layout is for those who
read results without knowing the classes: JSON, tables. A new kind of object needs one function and a line in the table
at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.analysis import Analysis
from finback.dynamics.analysis_cycles import ElevatorCycles
from finback.dynamics.connection.connection import Heteroclinic, Homoclinic
from finback.dynamics.connection.search import Connections
from finback.dynamics.cycle.cycle import Cycle
from finback.dynamics.cycle.family import CycleFamily, ElevatorCycleFold
from finback.dynamics.equilibrium import Equilibrium
from finback.dynamics.fold import Fold
from finback.dynamics.hopf import BogdanovTakens, Hopf, NeutralSaddle

CONTAINERS: Final[Mapping[type, tuple[str, ...]]] = {
    Analysis: (
        "equilibria",
        "folds",
        "hopf_points",
        "neutral_saddles",
        "bogdanov_takens",
        "connections",
        "limit_cycles",
    ),
    Connections: ("heteroclinics", "homoclinics"),
    ElevatorCycles: ("cycles", "families"),
    CycleFamily: ("folds",),  # a family is a curve, as a branch of equilibria is: its other cycles are its points
}
"""Result -> its fields that hold located objects, or further results."""

NOT_STATED: Final = frozen_array([])
"""The interval of a number that states none."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A number and its unit.

    Attributes:
        value: in SI.
        unit: unit suffix, such as ``rad_s``; ``1_s_rad2`` is 1/(s rad²), every part after the first divides.
    """

    value: float
    unit: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number, its unit and what the covariance of the model leaves open.

    Attributes:
        value: in SI.
        unit: unit suffix.
        interval: 95 % interval by the delta method, shape (2,); infinite where linear propagation says nothing; of no
            width for a held value or an exact model; shape (0,) where the object states none.
    """

    value: float
    unit: str
    interval: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "interval", frozen_array(self.interval))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """The parameter at which an object exists.

    Attributes:
        name: without unit, such as ``elevator``.
        value: in SI; held, for an equilibrium.
        unit: unit suffix.
        interval: as of an ``Estimate``.
    """

    name: str
    value: float
    unit: str
    interval: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "interval", frozen_array(self.interval))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bracket:
    """Two values between which the object provably lies.

    Attributes:
        name: of the variable that is bracketed.
        unit: unit suffix.
        low: the lower value, in SI.
        high: the upper.
    """

    name: str
    unit: str
    low: float
    high: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """One located object.

    Attributes:
        kind: what it is, such as ``fold`` or ``hopf``.
        parameter: where it exists.
        state: name -> where in the plane of states; with ``from_`` and ``to_`` for an orbit between two points.
        properties: name -> what else is known of it.
        words: name -> what is known of it in a word, such as its stability.
        residual: name -> what is zero there by definition, as evaluated.
        brackets: what encloses it; empty if its class states none.
        in_domain: whether it lies where data supported the model; if not, it is extrapolated.
    """

    kind: str
    parameter: Parameter
    state: Mapping[str, Estimate]
    properties: Mapping[str, Estimate]
    words: Mapping[str, str]
    residual: Mapping[str, Quantity]
    brackets: tuple[Bracket, ...]
    in_domain: bool


def located(analysis: Analysis) -> tuple[Located, ...]:
    """Return every located object of an analysis, in the order of its fields."""
    return tuple(DESCRIPTIONS[type(found)](found) for found in walk(analysis, tuple(DESCRIPTIONS), CONTAINERS))


def walk(value: Any, kinds: tuple[type, ...], containers: Mapping[type, tuple[str, ...]]) -> Iterator[Any]:
    """Yield every object of these kinds, wherever it stands in tuples and in the named fields of containers."""
    if isinstance(value, kinds):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from walk(item, kinds, containers)
    else:
        for name in containers[type(value)]:
            yield from walk(getattr(value, name), kinds, containers)


# kinds over the elevator


class _Point(Protocol):
    """What all points on the curve of equilibria have."""

    @property
    def elevator_rad(self) -> float: ...
    @property
    def alpha_rad(self) -> float: ...
    @property
    def q_rad_s(self) -> float: ...
    @property
    def elevator_interval_rad(self) -> FloatArray: ...
    @property
    def alpha_interval_rad(self) -> FloatArray: ...
    @property
    def bracket_rad(self) -> FloatArray: ...
    @property
    def in_domain(self) -> bool: ...


def _elevator(value: float, interval: FloatArray) -> Parameter:
    return Parameter(name="elevator", value=value, unit="rad", interval=interval)


def _alpha(value: float, interval: FloatArray = NOT_STATED) -> Estimate:
    return Estimate(value=value, unit="rad", interval=interval)


def _q(value: float, interval: FloatArray = NOT_STATED) -> Estimate:
    return Estimate(value=value, unit="rad_s", interval=interval)


def _bracket(name: str, ends: FloatArray) -> tuple[Bracket, ...]:
    return (Bracket(name=name, unit="rad", low=float(ends[0]), high=float(ends[1])),)


def _quantities(**numbers: tuple[float, str]) -> dict[str, Quantity]:
    return {name: Quantity(value=value, unit=unit) for name, (value, unit) in numbers.items()}


def _known(**numbers: tuple[float, str] | tuple[float, str, FloatArray]) -> dict[str, Estimate]:
    return {
        name: Estimate(value=value, unit=unit, interval=interval[0] if interval else NOT_STATED)
        for name, (value, unit, *interval) in numbers.items()
    }


def _on_the_branch(
    kind: str,
    point: _Point,
    *,
    residual: Mapping[str, Quantity],
    properties: Mapping[str, Estimate],
    words: Mapping[str, str],
    q_interval: FloatArray = NOT_STATED,
) -> Located:
    return Located(
        kind=kind,
        parameter=_elevator(point.elevator_rad, point.elevator_interval_rad),
        state={"alpha": _alpha(point.alpha_rad, point.alpha_interval_rad), "q": _q(point.q_rad_s, q_interval)},
        properties=properties,
        words=words,
        residual=residual,
        brackets=_bracket("alpha", point.bracket_rad),
        in_domain=point.in_domain,
    )


def _equilibrium(point: Equilibrium) -> Located:
    (re1, re2), (im1, im2) = point.eigenvalues_real_1_s.tolist(), point.eigenvalues_imag_1_s.tolist()
    held = frozen_array([point.elevator_rad] * 2)
    return Located(
        kind="equilibrium",
        parameter=_elevator(point.elevator_rad, held),
        state={"alpha": _alpha(point.alpha_rad, point.alpha_interval_rad), "q": _q(point.q_rad_s)},
        properties=_known(
            eigenvalue_1_real=(re1, "1_s"),
            eigenvalue_1_imag=(im1, "1_s"),
            eigenvalue_2_real=(re2, "1_s"),
            eigenvalue_2_imag=(im2, "1_s"),
        ),
        words={"stability": point.kind.value},
        residual=_quantities(force=(point.residual, "rad_s2")),
        brackets=_bracket("alpha", point.bracket_rad),
        in_domain=point.in_domain,
    )


def _fold(point: Fold) -> Located:
    return _on_the_branch(
        "fold",
        point,
        residual=_quantities(force_slope=(point.residual, "1_s2")),
        properties=_known(other_eigenvalue=(point.divergence_1_s, "1_s")),
        words={},
        q_interval=point.q_interval_rad_s,
    )


def _hopf(point: Hopf) -> Located:
    return _on_the_branch(
        "hopf",
        point,
        residual=_quantities(trace=(point.residual, "1_s")),
        properties=_known(
            frequency=(point.frequency_rad_s, "rad_s"),
            first_lyapunov_coefficient=(point.lyapunov_1_s, "1_s_rad2", point.lyapunov_interval_1_s),
            crossing_speed=(point.crossing_speed_1_s, "1_s_rad"),
        ),
        words={"criticality": point.criticality.value},
    )


def _neutral_saddle(point: NeutralSaddle) -> Located:
    return _on_the_branch(
        "neutral-saddle",
        point,
        residual=_quantities(trace=(point.residual, "1_s")),
        properties=_known(eigenvalue=(point.eigenvalue_1_s, "1_s")),
        words={},
    )


def _bogdanov_takens(point: BogdanovTakens) -> Located:
    return _on_the_branch(
        "bogdanov-takens",
        point,
        residual=_quantities(trace=(point.residual, "1_s"), determinant=(point.determinant_1_s2, "1_s2")),
        properties=_known(
            force_curvature=(point.force_curvature_1_s2, "1_s2_rad"),
            damping_slope=(point.damping_slope_1_s, "1_s_rad"),
        ),
        words={},
    )


def _heteroclinic(orbit: Heteroclinic) -> Located:
    return Located(
        kind="heteroclinic",
        parameter=_elevator(orbit.elevator_rad, orbit.elevator_interval_rad),
        state={"from_alpha": _alpha(orbit.from_alpha_rad), "to_alpha": _alpha(orbit.to_alpha_rad)},
        properties=_known(turns=(orbit.turns_alpha_rad.size, "1")),
        words={"direction": orbit.direction.value, "resolved": _resolved(resolved=orbit.resolved)},
        residual=_quantities(gap=(orbit.residual_rad_s, "rad_s")),
        brackets=_bracket("elevator", orbit.bracket_rad),
        in_domain=orbit.in_domain,
    )


def _homoclinic(orbit: Homoclinic) -> Located:
    return Located(
        kind="homoclinic",
        parameter=_elevator(orbit.elevator_rad, orbit.elevator_interval_rad),
        state={"alpha": _alpha(orbit.alpha_rad), "turn_alpha": _alpha(orbit.turn_alpha_rad)},
        properties=_known(saddle_trace=(orbit.divergence_1_s, "1_s"), turns=(orbit.turns_alpha_rad.size, "1")),
        words={"direction": orbit.direction.value, "resolved": _resolved(resolved=orbit.resolved)},
        residual=_quantities(gap=(orbit.residual_rad, "rad")),
        brackets=_bracket("elevator", orbit.bracket_rad),
        in_domain=orbit.in_domain,
    )


def _resolved(*, resolved: bool) -> str:
    return "resolved" if resolved else "unresolved"


# limit cycles


def _cycle(cycle: Cycle) -> Located:
    return Located(
        kind="cycle",
        parameter=_elevator(cycle.elevator_rad, frozen_array([cycle.elevator_rad] * 2)),
        state=_extent(cycle),
        properties=_known(
            amplitude=(cycle.amplitude_rad, "rad", cycle.amplitude_interval_rad),
            period=(cycle.period_s, "s", cycle.period_interval_s),
            multiplier=(cycle.multiplier, "1"),
            log_multiplier=(cycle.log_multiplier, "1"),
            enclosed_equilibria=(cycle.enclosed_alpha_rad.size, "1"),
        ),
        words={"stability": "stable" if cycle.stable else "unstable"},
        residual=_quantities(miss=(cycle.residual_rad, "rad")),
        brackets=_bracket("alpha_max", cycle.bracket_rad),
        in_domain=cycle.in_domain,
    )


def _cycle_fold(fold: ElevatorCycleFold) -> Located:
    return Located(
        kind="cycle-fold",
        parameter=_elevator(fold.elevator_rad, fold.elevator_interval_rad),
        state=_extent(fold.cycle),
        properties=_known(
            amplitude=(fold.cycle.amplitude_rad, "rad"),
            period=(fold.cycle.period_s, "s"),
            enclosed_equilibria=(fold.cycle.enclosed_alpha_rad.size, "1"),
        ),
        words={},
        residual=_quantities(log_multiplier=(fold.residual, "1")),
        brackets=_bracket("alpha_max", fold.bracket_rad),
        in_domain=fold.in_domain,
    )


def _extent(cycle: Cycle) -> dict[str, Estimate]:
    return {
        "alpha_min": _alpha(cycle.alpha_min_rad),
        "alpha_max": _alpha(cycle.alpha_max_rad),
        "q_min": _q(cycle.q_min_rad_s),
        "q_max": _q(cycle.q_max_rad_s),
    }


DESCRIPTIONS: Final[Mapping[type, Callable[[Any], Located]]] = {
    Equilibrium: _equilibrium,
    Fold: _fold,
    Hopf: _hopf,
    NeutralSaddle: _neutral_saddle,
    BogdanovTakens: _bogdanov_takens,
    Heteroclinic: _heteroclinic,
    Homoclinic: _homoclinic,
    Cycle: _cycle,
    ElevatorCycleFold: _cycle_fold,
}
"""Class of an object -> how it is described."""

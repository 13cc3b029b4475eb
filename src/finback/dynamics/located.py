"""Every located object in one layout: kind, parameter, state, interval, bracket, residual, inside the data or not.

The classes of the objects themselves (``Fold``, ``Hopf``, …) say what each number means; this layout is for those who
read results without knowing the classes: JSON, tables. A new kind of object needs one function and a line in the table
at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Final, Protocol, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.analysis import Analysis
from finback.dynamics.connection import Heteroclinic, Homoclinic
from finback.dynamics.connection_search import Connections
from finback.dynamics.equilibrium import Equilibrium
from finback.dynamics.fold import Fold
from finback.dynamics.hopf import BogdanovTakens, Hopf, NeutralSaddle

CONTAINERS: Final = (Analysis, Connections)
"""Results that hold located objects in their fields."""

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
    properties: Mapping[str, Quantity]
    words: Mapping[str, str]
    residual: Mapping[str, Quantity]
    brackets: tuple[Bracket, ...]
    in_domain: bool


def located(analysis: Analysis) -> tuple[Located, ...]:
    """Return every located object of an analysis, in the order of its fields."""
    return tuple(DESCRIPTIONS[type(found)](found) for found in walk(analysis, tuple(DESCRIPTIONS), CONTAINERS))


def walk(value: Any, kinds: tuple[type, ...], containers: tuple[type, ...]) -> Iterator[Any]:
    """Yield every object of these kinds, wherever it stands in tuples and in fields of containers."""
    if isinstance(value, kinds):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from walk(item, kinds, containers)
    elif is_dataclass(value) and isinstance(value, containers):
        for member in fields(value):
            yield from walk(getattr(value, member.name), kinds, containers)


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


def _on_the_branch(
    kind: str,
    point: _Point,
    *,
    residual: Mapping[str, Quantity],
    properties: Mapping[str, Quantity],
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
        properties=_quantities(
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
        properties=_quantities(other_eigenvalue=(point.divergence_1_s, "1_s")),
        words={},
        q_interval=point.q_interval_rad_s,
    )


def _hopf(point: Hopf) -> Located:
    return _on_the_branch(
        "hopf",
        point,
        residual=_quantities(trace=(point.residual, "1_s")),
        properties=_quantities(
            frequency=(point.frequency_rad_s, "rad_s"),
            first_lyapunov_coefficient=(point.lyapunov_1_s, "1_s_rad2"),
            crossing_speed=(point.crossing_speed_1_s, "1_s_rad"),
        ),
        words={"criticality": point.criticality.value},
    )


def _neutral_saddle(point: NeutralSaddle) -> Located:
    return _on_the_branch(
        "neutral-saddle",
        point,
        residual=_quantities(trace=(point.residual, "1_s")),
        properties=_quantities(eigenvalue=(point.eigenvalue_1_s, "1_s")),
        words={},
    )


def _bogdanov_takens(point: BogdanovTakens) -> Located:
    return _on_the_branch(
        "bogdanov-takens",
        point,
        residual=_quantities(trace=(point.residual, "1_s"), determinant=(point.determinant_1_s2, "1_s2")),
        properties=_quantities(
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
        properties={},
        words={"direction": orbit.direction.value},
        residual=_quantities(gap=(orbit.residual_rad_s, "rad_s")),
        brackets=_bracket("elevator", orbit.bracket_rad),
        in_domain=orbit.in_domain,
    )


def _homoclinic(orbit: Homoclinic) -> Located:
    return Located(
        kind="homoclinic",
        parameter=_elevator(orbit.elevator_rad, orbit.elevator_interval_rad),
        state={"alpha": _alpha(orbit.alpha_rad), "turn_alpha": _alpha(orbit.turn_alpha_rad)},
        properties=_quantities(saddle_trace=(orbit.divergence_1_s, "1_s")),
        words={"direction": orbit.direction.value},
        residual=_quantities(gap=(orbit.residual_rad, "rad")),
        brackets=_bracket("elevator", orbit.bracket_rad),
        in_domain=orbit.in_domain,
    )


DESCRIPTIONS: Final[Mapping[type, Callable[[Any], Located]]] = {
    Equilibrium: _equilibrium,
    Fold: _fold,
    Hopf: _hopf,
    NeutralSaddle: _neutral_saddle,
    BogdanovTakens: _bogdanov_takens,
    Heteroclinic: _heteroclinic,
    Homoclinic: _homoclinic,
}
"""Class of an object -> how it is described."""

"""What stands in a study file, table by table: keys end in the unit of the file.

Each kind of quantity has its range, far beyond what any aircraft flies and far inside what arithmetic bears: a number
outside is a slip of the pen, and is told so by its key before anything flies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from finback.errors import InputError
from finback.flight.excitation import Doublet, Hold, Maneuver, Ramp, Release, Step, ThreeTwoOneOne
from finback.flight.oscillation import LinearSweep, LogSweep, MultisineInput
from finback.flight.plan import FIDELITIES
from finback.flight.pulse import matched_three_two_one_one
from finback.identification.method import Method
from finback.identification.options import HIGHEST_ORDER
from finback.units import quantity_of, si_unit, to_si, unit_of


def _ordered(limits: list[float]) -> list[float]:
    if limits[0] >= limits[1]:
        raise ValueError("the lower limit must come first and be smaller than the upper one")
    return limits


def known_fidelity(fidelity: str) -> str:
    """Return a fidelity that is built, or raise ValueError."""
    if fidelity not in FIDELITIES:
        raise ValueError(f"must be one of: {', '.join(FIDELITIES)}")
    return fidelity


def _known_method(method: str) -> str:
    if method not in set(Method):
        raise ValueError(f"must be one of: {', '.join(Method)}")
    return method


def as_list(value: object) -> object:
    """Return a lone value as a list of one."""
    return value if isinstance(value, list) else [value]


def _first_version(version: int) -> int:
    if version != 1:
        raise ValueError("must be 1")
    return version


Angle = Annotated[float, Field(ge=-180.0, le=180.0)]
Width = Annotated[float, Field(ge=1e-6, le=180.0)]
"""Of a step, a margin or a bracket, in deg."""
AngleNoise = Annotated[float, Field(ge=0.0, le=180.0)]
PitchRate = Annotated[float, Field(ge=-1e4, le=1e4)]
Speed = Annotated[float, Field(ge=1e-6, le=1e4)]
"""Of the elevator, in deg/s."""
RateNoise = Annotated[float, Field(ge=0.0, le=1e4)]


def _up_to(most: float) -> Callable[[float], float]:
    def checked(size: float) -> float:
        if most < size < math.inf:
            raise ValueError(f"must be at most {most:g}, or inf where nothing is known")
        return size

    return checked


BiasOfAngle = Annotated[float, Field(ge=0.0, allow_inf_nan=True), AfterValidator(_up_to(180.0))]
BiasOfRate = Annotated[float, Field(ge=0.0, allow_inf_nan=True), AfterValidator(_up_to(1e4))]
Delay = Annotated[float, Field(ge=0.0, allow_inf_nan=True), AfterValidator(_up_to(14_400.0))]
Time = Annotated[float, Field(ge=1e-4, le=14_400.0)]
"""Up to four hours, in s."""
TimeOrNone = Annotated[float, Field(ge=0.0, le=14_400.0)]
Frequency = Annotated[float, Field(ge=1.0, le=1e4)]
Limits = Annotated[list[Angle], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
Band = Annotated[
    list[Annotated[float, Field(ge=1e-4, le=1e4)]], Field(min_length=2, max_length=2), AfterValidator(_ordered)
]
AnyAngle = Annotated[list[Angle], Field(min_length=1), BeforeValidator(as_list)]
AnyPitchRate = Annotated[list[PitchRate], Field(min_length=1), BeforeValidator(as_list)]
AnySpeed = Annotated[list[Speed], Field(min_length=1), BeforeValidator(as_list)]
AnyTime = Annotated[list[Time], Field(min_length=1), BeforeValidator(as_list)]
Cycles = Annotated[float, Field(ge=1e-4, le=1e3)]
"""Of an elevator that oscillates, in hertz."""
ModeFrequency = Annotated[float, Field(ge=1e-3, le=1e3)]
DampingRatio = Annotated[float, Field(ge=0.0, lt=1.0)]
AnyCycles = Annotated[list[Cycles], Field(min_length=1), BeforeValidator(as_list)]
AnyTimeOrNone = Annotated[list[TimeOrNone], Field(min_length=1), BeforeValidator(as_list)]


class Table(BaseModel):
    """Base of all tables: unknown keys, wrong types and non-finite numbers are faults."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=False)


class HeadTable(Table):
    """The keys before the first table."""

    version: Annotated[int, AfterValidator(_first_version)] = Field(alias="schema")
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=100)]
    aircraft: Annotated[str, Field(min_length=1)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]


class ConditionTable(Table):
    """``[condition]``: the reference flight."""

    airspeed_m_s: Annotated[float, Field(ge=1.0, le=1e4)]
    density_kg_m3: Annotated[float, Field(ge=1e-6, le=100.0)]
    gravity_m_s2: Annotated[float, Field(ge=0.0, le=100.0)]
    altitude_m: Annotated[float, Field(ge=-500.0, le=1e5)]


class FlightTable(Table):
    """``[flight]``: how every flight is flown."""

    fidelity: Annotated[str, AfterValidator(known_fidelity)]
    step_hz: Frequency
    sample_hz: Frequency
    alpha_limits_deg: Limits
    elevator_limits_deg: Limits
    elevator_rate_deg_s: Speed


class SensorsTable(Table):
    """``[sensors]`` without the tables of channels: white noise, and where alpha is measured."""

    alpha_noise_deg: AngleNoise
    q_noise_deg_s: RateNoise
    vane_forward_m: Annotated[float, Field(ge=-100.0, le=100.0)] = 0.0


class SelectTable(Table):
    """``[identification.select]``: candidates, in place of fixed terms."""

    variables: Annotated[list[str], Field(min_length=1)] = Field(default=["alpha", "q", "elevator"])
    degree: Annotated[int, Field(ge=1, le=HIGHEST_ORDER)] = 3
    terms: list[str] = Field(default=[])
    q_dot_terms: list[str] = Field(default=[])
    false_alarm: Annotated[float, Field(gt=0.0, le=0.5)] = 0.01
    bootstraps: Annotated[int, Field(ge=0, le=10_000)] = 50
    prediction: list[str] = Field(default=[])


class IdentificationTable(Table):
    """``[identification]``."""

    alpha_window_deg: Limits
    alpha_dot_order: Annotated[int, Field(ge=1, le=HIGHEST_ORDER)] | None = None
    q_dot_order: Annotated[int, Field(ge=1, le=HIGHEST_ORDER)] | None = None
    half_width_s: Time
    spacing_s: Time
    minimum_duration_s: TimeOrNone
    method: Annotated[str, AfterValidator(_known_method)] = Method.WEAK_FORM.value
    alpha_dot_terms: list[str] = Field(default=[])
    q_dot_terms: list[str] = Field(default=[])
    band_hz: Band = Field(default=[0.05, 2.0])
    alpha_bias_deg: BiasOfAngle = 0.0
    q_bias_deg_s: BiasOfRate = 0.0
    elevator_bias_deg: BiasOfAngle = 0.0
    elevator_delay_s: Delay = 0.0
    constants_per_flight: bool = False
    fixed: dict[str, Any] = Field(default={})
    bounded: dict[str, Any] = Field(default={})
    select: dict[str, Any] | None = None


class AnalysisTable(Table):
    """``[analysis]``."""

    elevator_range_deg: Limits
    elevator_step_deg: Width
    alpha_range_deg: Limits


class ValidationTable(Table):
    """``[validation]``, without its sub-tables."""

    equilibrium_elevator_deg: Annotated[list[Angle], Field(min_length=1)]


class FoldTable(Table):
    """``[validation.fold]``: how the simulator's folds are flown."""

    ramp_rate_deg_s: Annotated[list[Speed], Field(min_length=1)]
    margin_deg: Width
    start_offset_deg: Width
    hold_s: Time
    approach_s: Time
    resolution_deg: Width


class ToleranceTable(Table):
    """One entry of ``[validation.tolerance]``."""

    value: Annotated[float, Field(ge=1e-9, le=1e6)]
    source: Annotated[str, Field(pattern=r"\S")]


class TolerancesTable(Table):
    """``[validation.tolerance]``: each entry is a ``ToleranceTable`` in the unit of its key."""

    alpha_rmse_deg: dict[str, Any]
    q_rmse_deg_s: dict[str, Any]
    theil: dict[str, Any]
    fold_elevator_deg: dict[str, Any]
    ramp_fold_elevator_deg: dict[str, Any]
    equilibrium_alpha_deg: dict[str, Any]


class StepTable(Table):
    """A maneuver of kind ``step``."""

    elevator_deg: AnyAngle
    amplitude_deg: AnyAngle
    lead_s: AnyTimeOrNone
    duration_s: AnyTime


class MultistepTable(Table):
    """A maneuver of kind ``doublet`` or ``three-two-one-one``."""

    elevator_deg: AnyAngle
    amplitude_deg: AnyAngle
    unit_s: AnyTime
    lead_s: AnyTimeOrNone
    duration_s: AnyTime


class MatchedTable(Table):
    """A maneuver of kind ``matched-three-two-one-one``: its unit comes from a mode."""

    elevator_deg: AnyAngle
    amplitude_deg: AnyAngle
    frequency_rad_s: Annotated[list[ModeFrequency], Field(min_length=1), BeforeValidator(as_list)]
    damping_1: Annotated[list[DampingRatio], Field(min_length=1), BeforeValidator(as_list)]
    lead_s: AnyTimeOrNone
    duration_s: AnyTime


class RampTable(Table):
    """A maneuver of kind ``ramp``."""

    elevator_deg: AnyAngle
    to_elevator_deg: AnyAngle
    rate_deg_s: AnySpeed
    lead_s: AnyTimeOrNone
    duration_s: AnyTime


class HoldTable(Table):
    """A maneuver of kind ``hold``."""

    elevator_deg: AnyAngle
    duration_s: AnyTime


class ReleaseTable(Table):
    """A maneuver of kind ``release``."""

    elevator_deg: AnyAngle
    alpha_deg: AnyAngle
    q_deg_s: AnyPitchRate
    duration_s: AnyTime


class SweepTable(Table):
    """A maneuver of kind ``linear-sweep`` or ``log-sweep``."""

    elevator_deg: AnyAngle
    amplitude_deg: AnyAngle
    from_hz: AnyCycles
    to_hz: AnyCycles
    sweep_s: AnyTime
    lead_s: AnyTimeOrNone
    duration_s: AnyTime


class MultisineTable(Table):
    """A maneuver of kind ``multisine``."""

    elevator_deg: AnyAngle
    amplitude_deg: AnyAngle
    lowest_hz: AnyCycles
    highest_hz: AnyCycles
    period_s: AnyTime
    lead_s: AnyTimeOrNone
    duration_s: AnyTime


KINDS: Final[Mapping[str, tuple[type[Table], Callable[..., Maneuver]]]] = {
    "step": (StepTable, Step),
    "doublet": (MultistepTable, Doublet),
    "three-two-one-one": (MultistepTable, ThreeTwoOneOne),
    "matched-three-two-one-one": (MatchedTable, matched_three_two_one_one),
    "ramp": (RampTable, Ramp),
    "linear-sweep": (SweepTable, LinearSweep),
    "log-sweep": (SweepTable, LogSweep),
    "multisine": (MultisineTable, MultisineInput),
    "hold": (HoldTable, Hold),
    "release": (ReleaseTable, Release),
}
"""Kind of a maneuver -> its table in the file, and what it becomes."""

TABLES: Final = (
    "condition",
    "flight",
    "turbulence",
    "sensors",
    "sweep",
    "campaign",
    "identification",
    "analysis",
    "validation",
)
"""What stands below the head of a study."""


def in_si(table: Table) -> dict[str, Any]:
    """Return the table with every key that names a unit converted: ``q_deg_s`` -> ``q_rad_s``."""
    converted: dict[str, Any] = {}
    for key, value in table:
        try:
            unit = unit_of(key)
        except InputError:
            converted[key] = value
            continue
        name = f"{quantity_of(key)}_{si_unit(unit)}"
        converted[name] = tuple(to_si(item, unit) for item in value) if isinstance(value, list) else to_si(value, unit)
    return converted

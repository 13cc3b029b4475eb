"""What stands in a study file, table by table: keys end in the unit of the file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from finback.errors import InputError
from finback.flight.excitation import Doublet, Hold, Maneuver, Ramp, Release, Step, ThreeTwoOneOne
from finback.flight.plan import FIDELITIES
from finback.identification.options import HIGHEST_ORDER
from finback.units import quantity_of, si_unit, to_si, unit_of


def _ordered(limits: list[float]) -> list[float]:
    if limits[0] >= limits[1]:
        raise ValueError("the lower limit must come first and be smaller than the upper one")
    return limits


def _known_fidelity(fidelity: str) -> str:
    if fidelity not in FIDELITIES:
        raise ValueError(f"must be one of: {', '.join(FIDELITIES)}")
    return fidelity


def _as_list(value: object) -> object:
    return value if isinstance(value, list) else [value]


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Limits = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
AnyNumber = Annotated[list[float], Field(min_length=1), BeforeValidator(_as_list)]
AnyPositive = Annotated[list[Positive], Field(min_length=1), BeforeValidator(_as_list)]
AnyNotNegative = Annotated[list[NotNegative], Field(min_length=1), BeforeValidator(_as_list)]


class Table(BaseModel):
    """Base of all tables: unknown keys, wrong types and non-finite numbers are faults."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=False)


class HeadTable(Table):
    """The keys before the first table."""

    version: Literal[1] = Field(alias="schema")
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=100)]
    aircraft: Annotated[str, Field(min_length=1)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]


class ConditionTable(Table):
    """``[condition]``: the reference flight."""

    airspeed_m_s: Positive
    density_kg_m3: Positive
    gravity_m_s2: NotNegative
    altitude_m: float


class FlightTable(Table):
    """``[flight]``: how every flight is flown."""

    fidelity: Annotated[str, AfterValidator(_known_fidelity)]
    step_hz: Positive
    sample_hz: Positive
    alpha_limits_deg: Limits
    elevator_limits_deg: Limits
    elevator_rate_deg_s: Positive


class SensorsTable(Table):
    """``[sensors]``: standard deviations of white noise."""

    alpha_noise_deg: NotNegative
    q_noise_deg_s: NotNegative


class IdentificationTable(Table):
    """``[identification]``."""

    alpha_window_deg: Limits
    alpha_dot_order: Annotated[int, Field(ge=1, le=HIGHEST_ORDER)]
    q_dot_order: Annotated[int, Field(ge=1, le=HIGHEST_ORDER)]
    half_width_s: Positive
    spacing_s: Positive
    minimum_duration_s: NotNegative


class AnalysisTable(Table):
    """``[analysis]``."""

    elevator_range_deg: Limits
    elevator_step_deg: Positive
    alpha_range_deg: Limits


class ValidationTable(Table):
    """``[validation]``, without its sub-tables."""

    equilibrium_elevator_deg: Annotated[list[float], Field(min_length=1)]


class FoldTable(Table):
    """``[validation.fold]``: how the simulator's folds are flown."""

    ramp_rate_deg_s: Annotated[list[Positive], Field(min_length=1)]
    margin_deg: Positive
    start_offset_deg: Positive
    hold_s: Positive
    approach_s: Positive
    resolution_deg: Positive


class ToleranceTable(Table):
    """One entry of ``[validation.tolerance]``."""

    value: Positive
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

    elevator_deg: AnyNumber
    amplitude_deg: AnyNumber
    lead_s: AnyNotNegative
    duration_s: AnyPositive


class MultistepTable(Table):
    """A maneuver of kind ``doublet`` or ``three-two-one-one``."""

    elevator_deg: AnyNumber
    amplitude_deg: AnyNumber
    unit_s: AnyPositive
    lead_s: AnyNotNegative
    duration_s: AnyPositive


class RampTable(Table):
    """A maneuver of kind ``ramp``."""

    elevator_deg: AnyNumber
    to_elevator_deg: AnyNumber
    rate_deg_s: AnyPositive
    lead_s: AnyNotNegative
    duration_s: AnyPositive


class HoldTable(Table):
    """A maneuver of kind ``hold``."""

    elevator_deg: AnyNumber
    duration_s: AnyPositive


class ReleaseTable(Table):
    """A maneuver of kind ``release``."""

    elevator_deg: AnyNumber
    alpha_deg: AnyNumber
    q_deg_s: AnyNumber
    duration_s: AnyPositive


KINDS: Final[Mapping[str, tuple[type[Table], Callable[..., Maneuver]]]] = {
    "step": (StepTable, Step),
    "doublet": (MultistepTable, Doublet),
    "three-two-one-one": (MultistepTable, ThreeTwoOneOne),
    "ramp": (RampTable, Ramp),
    "hold": (HoldTable, Hold),
    "release": (ReleaseTable, Release),
}
"""Kind of a maneuver -> its table in the file, and what it becomes."""

TABLES: Final = ("condition", "flight", "sensors", "sweep", "identification", "analysis", "validation")
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

"""The section ``[validation]`` of a study: what is flown against the model, and what is tolerated."""

from __future__ import annotations

import math

from finback.flight.excitation import Maneuver
from finback.flight.plan import FlightOptions
from finback.study.reading import Reader
from finback.study.tables import FoldTable, TolerancesTable, ToleranceTable, ValidationTable, in_si
from finback.units import quantity_of, to_si, unit_of
from finback.validation.metric import Tolerance
from finback.validation.options import MINIMUM_RATES, FoldOptions, Tolerances, ValidationOptions


def read_validation(
    reader: Reader, flight: FlightOptions | None, maneuvers: tuple[Maneuver, ...], seed: int
) -> ValidationOptions | None:
    """Read the section, or add its faults.

    Args:
        reader: of the whole file.
        flight: limits and steps; None if these are missing.
        maneuvers: of the sweep; none of them may be held out.
        seed: of the study.
    """
    root = reader.root.get("validation")
    if not isinstance(root, dict):
        reader.table(ValidationTable, "validation")
        return None
    parts = ("holdout", "fold", "tolerance")
    rest = {key: value for key, value in root.items() if key not in parts}
    table = reader.parse(ValidationTable, rest, "validation", others=parts)
    holdout = reader.maneuvers(root.get("holdout"), "validation.holdout", flight)
    for again in sorted(set(maneuvers) & set(holdout), key=repr):
        reader.fault(
            "validation.holdout", f"a {again.kind} of the sweep stands here too; hold-outs are never in the fit"
        )
    fold = _fold(reader, root.get("fold", {}), flight)
    tolerances = _tolerances(reader, root.get("tolerance", {}))
    if table is None:
        return None
    elevators = in_si(table)["equilibrium_elevator_rad"]
    if flight is not None:
        place = "validation.equilibrium_elevator_deg"
        reader.inside(place, elevators, flight.elevator_limits_rad, "flight.elevator_limits_deg")
    if fold is None or tolerances is None:
        return None
    return reader.make(
        "validation",
        lambda: ValidationOptions(
            holdout=holdout, equilibrium_elevators_rad=elevators, fold=fold, tolerances=tolerances, seed=seed
        ),
    )


def _fold(reader: Reader, value: object, flight: FlightOptions | None) -> FoldOptions | None:
    """Read ``[validation.fold]``."""
    place = "validation.fold"
    table = reader.parse(FoldTable, value, place)
    if table is None:
        return None
    few, wide = len(set(table.ramp_rate_deg_s)) < MINIMUM_RATES, table.resolution_deg >= table.start_offset_deg
    if few:
        rates = len(set(table.ramp_rate_deg_s))
        reader.fault(f"{place}.ramp_rate_deg_s", f"needs at least {MINIMUM_RATES} different rates, got {rates}")
    if wide:
        reader.fault(f"{place}.resolution_deg", f"must be smaller than start_offset_deg ({table.start_offset_deg:g})")
    if flight is not None:
        _affordable(reader, table, flight)
    if few or wide:
        return None
    values = in_si(table)
    ramps = values.pop("ramp_rate_rad_s")
    return reader.make(place, lambda: FoldOptions(ramp_rates_rad_s=ramps, **values))


def _affordable(reader: Reader, table: FoldTable, flight: FlightOptions) -> None:
    place = "validation.fold"
    if reader.sound(f"{place}.start_offset_deg"):
        for index, rate in enumerate(table.ramp_rate_deg_s):  # from the offset before the fold to that behind it
            reader.affordable(f"{place}.ramp_rate_deg_s[{index}]", 2 * table.start_offset_deg / rate, flight)
    if reader.sound(f"{place}.start_offset_deg", f"{place}.resolution_deg"):
        ratio = max(1.0, table.start_offset_deg / table.resolution_deg)
        approaches = 1 + math.log(ratio)  # exponential, to the resolution
        reader.affordable(f"{place}.approach_s", table.approach_s * approaches, flight)
    reader.affordable(f"{place}.hold_s", table.hold_s, flight)


def _tolerances(reader: Reader, value: object) -> Tolerances | None:
    """Read ``[validation.tolerance]``."""
    place = "validation.tolerance"
    table = reader.parse(TolerancesTable, value, place)
    if table is None:
        return None
    read: dict[str, Tolerance] = {}
    for key, item in table:
        one = reader.parse(ToleranceTable, item, f"{place}.{key}")
        if one is None:
            continue
        unit = "1" if key == "theil" else unit_of(key)
        name = key if key == "theil" else quantity_of(key)
        read[name] = Tolerance(value=to_si(one.value, unit), source=one.source)
    if len(read) < len(TolerancesTable.model_fields):
        return None
    return Tolerances(**read)

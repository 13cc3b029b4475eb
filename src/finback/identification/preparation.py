"""A record made fit for estimation, step by step, with a plain statement of everything that was changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, final

from finback.errors import RefusedError
from finback.identification.clock import Evidence, evidence_of
from finback.identification.compatibility.check import Compatibility, check_compatibility
from finback.identification.compatibility.correct import corrected
from finback.identification.compatibility.fault import CompatibilityOptions
from finback.identification.compatibility.judgement import LEVEL, Knowledge, hanging_together
from finback.identification.outlier import OutlierOptions, without_outliers
from finback.identification.position import SensorPlaces, at_center_of_gravity
from finback.identification.sampling import as_sampled, without_repeats, without_turns
from finback.identification.uniform import uniform
from finback.records import FlightRecord

_WRONG: Final = f": one of them is wrong (the check says so of {LEVEL:.0%} of faultless flights)"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PreparationOptions:
    """What is done to a record before a model is fitted, in this order.

    Attributes:
        outliers: what counts as one.
        interval_s: of the uniform time base; 0 for the record's own.
        longest_gap_s: longest gap that is interpolated; 0 for three of each column's own intervals.
        places: where the sensors are.
        correct_instruments: take out those biases, scales and delays that the kinematics determine and that are
            significant; False only reports them. Off, because a correction makes the instruments agree with the
            flight's own rates and forces, not with the truth: whoever asks for it has read the findings. Faults that
            are known only together are never taken out.
        compatibility: what is known of the instruments beforehand.
        same_instruments: all flights were measured by the same instruments, which are checked by all of them together.
    """

    outliers: OutlierOptions = field(default_factory=OutlierOptions)
    interval_s: float = 0.0
    longest_gap_s: float = 0.0
    places: SensorPlaces = field(default_factory=SensorPlaces)
    correct_instruments: bool = False
    compatibility: CompatibilityOptions = field(default_factory=CompatibilityOptions)
    same_instruments: bool = False


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Preparation:
    """A prepared record.

    Attributes:
        record: what estimators get.
        statements: what was changed, one sentence each, in order; empty if nothing was.
        findings: what was seen and not changed: faults of instruments that were only reported, checks that could not
            be made.
        compatibility: the check in numbers; empty if it could not be made.
    """

    record: FlightRecord
    statements: tuple[str, ...]
    findings: tuple[str, ...]
    compatibility: tuple[Compatibility, ...] = ()


def prepare(record: FlightRecord, options: PreparationOptions) -> Preparation:
    """Prepare one flight; see ``prepare_all``."""
    return prepare_all([record], options)[0]


def prepare_all(records: Sequence[FlightRecord], options: PreparationOptions) -> tuple[Preparation, ...]:
    """Make each record fit for estimation: the steps of ``PreparationOptions``, in their order.

    The instruments are checked flight by flight, or, if the options say that all flights have the same, together.

    Raises:
        RefusedError: a step needs a channel that is missing, or a record is too short.
    """
    cleaned = [_cleaned(record, options) for record in records]
    evidence = evidence_of([record for record, _ in cleaned], interval_s=options.interval_s)
    laid = [_laid_out(record, said, evidence, options) for record, said in cleaned]
    if not options.same_instruments:
        return tuple(_checked([item], options)[0] for item in laid)
    return _checked(laid, options)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _LaidOut:
    """A record before its instruments are checked: as estimators get it, as the check does, and what was changed."""

    record: FlightRecord
    sampled: FlightRecord
    said: tuple[str, ...]


def _cleaned(record: FlightRecord, options: PreparationOptions) -> tuple[FlightRecord, tuple[str, ...]]:
    """Leave out what no instrument measured."""
    record, turned = without_turns(record)
    record, left_out = without_outliers(record, options.outliers)
    record, held = without_repeats(record)
    return record, (*turned, *left_out, *held)


def _laid_out(before: FlightRecord, said: tuple[str, ...], evidence: Evidence, options: PreparationOptions) -> _LaidOut:
    """Do everything else that needs no check of the instruments."""
    record, gridded = uniform(
        before, interval_s=options.interval_s, longest_gap_s=options.longest_gap_s, evidence=(evidence,)
    )
    record, moved = at_center_of_gravity(record, options.places)
    return _LaidOut(record=record, sampled=as_sampled(record, before), said=(*said, *gridded, *moved))


def _checked(laid: Sequence[_LaidOut], options: PreparationOptions) -> tuple[Preparation, ...]:
    """Check the instruments of flights together, and correct them if that is asked for."""
    try:
        found = check_compatibility([item.sampled for item in laid], options.compatibility)
    except RefusedError as refusal:  # other steps do not need what this one does
        return tuple(
            Preparation(record=item.record, statements=item.said, findings=(f"not checked: {refusal.message}",))
            for item in laid
        )
    prepared = []
    for item in laid:
        changed, significant = corrected(item.record, found)
        correct = options.correct_instruments
        faults = tuple(f"{error.sentence()} {'taken out' if correct else 'left in'}" for error in significant)
        prepared.append(
            Preparation(
                record=changed if correct else item.record,
                statements=(*item.said, *(faults if correct else ())),
                findings=(*(() if correct else faults), *_findings(found)),
                compatibility=(found,),
            )
        )
    return tuple(prepared)


def _findings(found: Compatibility) -> tuple[str, ...]:
    """Return what the check says beside faults that can be taken out."""
    unknown = [error.name for error in found.errors if error.knowledge is Knowledge.UNKNOWN]
    return (
        *(f"not checked: {reason}" for reason in found.not_checked),
        *(f"{sum_.sentence()}{_WRONG if sum_.significant else ''}" for sum_ in found.combinations),
        *hanging_together(found.correlated),
        *((f"the record cannot tell: {', '.join(unknown)}",) if unknown else ()),
        *((found.air.sentence(),) if found.air.moved else ()),
    )

"""One comparison of a prediction with the simulator, and the verdict over many.

With E = simulated − predicted and U95 the combined 95 % uncertainty of both sides, the model error lies in E ± U95 (the
idea of ASME V&V 20-2009). A tolerance comes from a source, never from the result.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

from finback.errors import InputError
from finback.units import si_unit


@final
class Judgement(StrEnum):
    """What a comparison says about the model."""

    AGREES = "agrees"
    """the error lies within the tolerance, uncertainty included"""
    DISAGREES = "disagrees"
    """the error exceeds the tolerance, uncertainty allowed for"""
    INCONCLUSIVE = "inconclusive"
    """the uncertainty is too large to tell"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How large an error may be, and who says so.

    Attributes:
        value: the largest error that still agrees, in SI, > 0 and finite.
        source: rule, standard or requirement that the value comes from; not empty.
    """

    value: float
    source: str

    def __post_init__(self) -> None:
        """Check the value, and that it has a source."""
        if not (math.isfinite(self.value) and self.value > 0.0):
            raise InputError(f"a tolerance must be finite and > 0, got {self.value}")
        if not self.source.strip():
            raise InputError("a tolerance needs a source", hint="name the rule, standard or requirement it comes from")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """One number of the simulator beside the predicted one.

    For a measure of difference (RMSE, Theil's coefficient) ``simulated`` is 0, the value of a perfect prediction.

    Attributes:
        name: what is compared, unique within a validation.
        unit: SI unit suffix of the four numbers, such as ``rad``; ``1`` for pure numbers.
        simulated: the simulator's value.
        predicted: the model's value; NaN where the model predicts nothing.
        uncertainty: U95, the combined 95 % uncertainty of both, >= 0; infinite where nothing is known.
        tolerance: the largest error that still agrees, > 0.
        source: where the tolerance comes from.
        counted: whether the verdict of the run counts it (an extrapolation is never counted).
        note: what a reader must know, such as why it is not counted; may be empty.
    """

    name: str
    unit: str
    simulated: float
    predicted: float
    uncertainty: float
    tolerance: float
    source: str
    counted: bool = True
    note: str = ""

    def __post_init__(self) -> None:
        """Check unit, uncertainty, tolerance, and that the reason for not counting is given."""
        if si_unit(self.unit) != self.unit:
            raise InputError(f"metric '{self.name}' is in '{self.unit}', expected the SI unit '{si_unit(self.unit)}'")
        if not self.uncertainty >= 0.0:
            raise InputError(f"metric '{self.name}' has an uncertainty of {self.uncertainty}, expected >= 0")
        Tolerance(value=self.tolerance, source=self.source)
        if not (self.counted or self.note):
            raise InputError(f"metric '{self.name}' is not counted and does not say why")

    @property
    def error(self) -> float:
        """E = simulated − predicted, in ``unit``."""
        return self.simulated - self.predicted

    @property
    def judgement(self) -> Judgement:
        """Agrees iff |E| + U95 <= tolerance; disagrees iff |E| − U95 > tolerance, or E is not finite.

        What is not counted proves nothing, whatever its numbers: it is inconclusive.
        """
        if not self.counted:
            return Judgement.INCONCLUSIVE
        size = abs(self.error)
        if not math.isfinite(size):
            return Judgement.DISAGREES
        if size + self.uncertainty <= self.tolerance:
            return Judgement.AGREES
        if size - self.uncertainty > self.tolerance:
            return Judgement.DISAGREES
        return Judgement.INCONCLUSIVE


_RANK: Final = {Judgement.AGREES: 0, Judgement.INCONCLUSIVE: 1, Judgement.DISAGREES: 2}


def worst(metrics: Iterable[Metric]) -> Metric:
    """Return the metric that speaks most against the model: by judgement, then by |E| + U95 over the tolerance."""

    def size(metric: Metric) -> float:
        share = (abs(metric.error) + metric.uncertainty) / metric.tolerance
        return share if math.isfinite(share) else math.inf

    return max(metrics, key=lambda metric: (_RANK[metric.judgement], size(metric)))


def verdict(metrics: Iterable[Metric]) -> Judgement:
    """Return the verdict of a run: any disagreement wins, then anything inconclusive; nothing counted tells nothing."""
    judgements = {metric.judgement for metric in metrics if metric.counted}
    if Judgement.DISAGREES in judgements:
        return Judgement.DISAGREES
    if judgements == {Judgement.AGREES}:
        return Judgement.AGREES
    return Judgement.INCONCLUSIVE

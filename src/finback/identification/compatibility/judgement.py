"""What a record tells of each fault: by itself, only together with others, or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, final

import numpy as np
from scipy.special import ndtr

from finback.arrays import FloatArray
from finback.dynamics.lienard import NORMAL_95
from finback.identification.compatibility.fault import ALL, Fault
from finback.identification.compatibility.wording import weight_read, with_error

LEVEL: Final = 0.05
"""Of flights without a fault, the part in which a check shows one."""
_TOLD: Final = 0.3
"""Of its usual size: a fault whose standard error is larger is not determined. At this share the pull of what is usual
moves an estimate by at most 0.3 standard errors for a fault of the usual size."""
_CLOSE: Final = 0.9
"""Correlation beyond which two estimates are said to hang together (Klein & Morelli 2006, section 5.1)."""
_MANY: Final = 4  # faults, whose weights nobody reads
_NEGLIGIBLE: Final = 0.02
"""Part of a combination, of the largest, that is not worth naming."""


@final
class Knowledge(StrEnum):
    """What the record tells of a fault."""

    DETERMINED = "determined"
    TOGETHER = "only together with others"
    UNKNOWN = "not determined"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentError:
    """One fault of one instrument.

    The measured value is (1 + scale) · true(t − delay) + bias; delays are against q.

    Attributes:
        name: such as ``alpha bias``, ``alpha scale``, ``theta delay``.
        unit: SI unit suffix of the two numbers.
        value: the estimate; of a scale, what it differs from 1. 0 unless it is determined.
        standard_error: all other faults being as unknown as they are, colored residuals allowed for; infinite unless
            it is determined.
        knowledge: what the record tells of it.
        significant: whether it is known and not 0, judged among all numbers of the check; see ``Judged``.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    knowledge: Knowledge
    significant: bool = False

    @property
    def known(self) -> bool:
        """Whether the record tells it from all others."""
        return self.knowledge is Knowledge.DETERMINED

    def sentence(self) -> str:
        """Say the estimate."""
        return f"{self.name}: {with_error(self.value, NORMAL_95 * self.standard_error, self.unit)}"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Combination:
    """Faults of which only a weighted sum is known.

    Attributes:
        names: of the faults; the weight of the first is 1.
        weights: shape (faults,), each in the unit of the first over its own.
        unit: SI unit suffix of the sum.
        value: of the sum.
        standard_error: of the sum.
        significant: whether one of the faults is there, judged among all numbers of the check; see ``Judged``.
    """

    names: tuple[str, ...]
    weights: tuple[float, ...]
    unit: str
    value: float
    standard_error: float
    significant: bool = False

    def sentence(self) -> str:
        """Say what is known; of many faults, only which."""
        if len(self.names) > _MANY:
            return f"known only together, {len(self.names)} of them: {', '.join(self.names)}"
        units = {fault.name: fault.unit for fault in ALL}
        weights = [
            weight_read(weight, self.unit, units[name]) for name, weight in zip(self.names, self.weights, strict=True)
        ]
        parts = [self.names[0]] + [
            f"{'−' if weight < 0 else '+'} {abs(weight):.3g} × {name}"
            for name, weight in zip(self.names[1:], weights[1:], strict=True)
        ]
        size = with_error(self.value, NORMAL_95 * self.standard_error, self.unit)
        return f"known only together: {' '.join(parts)} = {size}"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Faults and combinations.

    Of flights without any fault, one in twenty shows a significant one: the level holds for all determined faults and
    all sums of a check together (Holm 1979, Scandinavian Journal of Statistics 6, 65). Intervals are of 95 % each.

    Attributes:
        errors: every fault, in order.
        combinations: what is known of those that are known only together.
        correlated: pairs of determined faults that hang together, with their correlation.
    """

    errors: tuple[InstrumentError, ...]
    combinations: tuple[Combination, ...]
    correlated: tuple[tuple[str, str, float], ...]


def judged(faults: tuple[Fault, ...], values: FloatArray, covariance: FloatArray, sizes: FloatArray) -> Judged:
    """Tell what is determined, from a covariance in which all faults are free at once, each held by its usual size.

    Nothing is left out of the estimate because it is not determined: its whole freedom stands in the errors of the
    others, so that none is explained by another.

    Args:
        faults: what was estimated.
        values: in SI, shape (faults,).
        covariance: shape (faults, faults).
        sizes: usual sizes, shape (faults,).
    """
    scaled = covariance / np.outer(sizes, sizes)
    deviation = np.sqrt(np.diag(scaled))
    alone = 1.0 / np.sqrt(np.diag(np.linalg.inv(scaled)))
    knowledge = [
        Knowledge.DETERMINED if free <= _TOLD else Knowledge.TOGETHER if fixed <= _TOLD else Knowledge.UNKNOWN
        for free, fixed in zip(deviation.tolist(), alone.tolist(), strict=True)
    ]
    errors = tuple(
        InstrumentError(
            name=fault.name,
            unit=fault.unit,
            value=float(values[k]) if knowledge[k] is Knowledge.DETERMINED else 0.0,
            standard_error=float(deviation[k] * sizes[k]) if knowledge[k] is Knowledge.DETERMINED else np.inf,
            knowledge=knowledge[k],
        )
        for k, fault in enumerate(faults)
    )
    combinations = _combinations(faults, values, scaled, sizes, knowledge, alone)
    numbers = [(item.value, item.standard_error) for item in errors if item.known]
    numbers += [(item.value, item.standard_error) for item in combinations]
    chances = [_chance(*number) for number in numbers]
    largest = _largest_told(chances)
    return Judged(
        errors=tuple(
            replace(item, significant=item.known and _chance(item.value, item.standard_error) <= largest)
            for item in errors
        ),
        combinations=tuple(
            replace(item, significant=_chance(item.value, item.standard_error) <= largest) for item in combinations
        ),
        correlated=_correlated(faults, scaled, knowledge),
    )


def _chance(value: float, standard_error: float) -> float:
    """Return how likely a number is as far from 0 without any fault."""
    return float(2.0 * ndtr(-abs(value) / standard_error))


def _largest_told(chances: Sequence[float]) -> float:
    """Return the largest chance that is small enough among all of them, by Holm; -1 if none is."""
    told = -1.0
    for rank, one in enumerate(sorted(chances)):
        if one > LEVEL / (len(chances) - rank):
            break
        told = one
    return told


def _combinations(
    faults: tuple[Fault, ...],
    values: FloatArray,
    scaled: FloatArray,
    sizes: FloatArray,
    knowledge: list[Knowledge],
    alone: FloatArray,
) -> tuple[Combination, ...]:
    """Say for each fault that is known only together with which others, those that are named already left out."""
    found: list[Combination] = []
    named: set[int] = set()
    for index in np.argsort(alone).tolist():
        if knowledge[index] is not Knowledge.TOGETHER or index in named:
            continue
        others = _partners(index, scaled)
        weights = -np.linalg.solve(scaled[np.ix_(others, others)], scaled[others, index])
        kept = [k for k, weight in enumerate(weights) if abs(weight) > _NEGLIGIBLE * max(1.0, np.abs(weights).max())]
        members = [index, *(others[k] for k in kept)]
        share = np.concatenate([np.ones(1), weights[kept]])
        named |= set(members)
        inside = share * (sizes[index] / sizes[members])
        found.append(
            Combination(
                names=tuple(faults[k].name for k in members),
                weights=tuple(inside.tolist()),
                unit=faults[index].unit,
                value=float(inside @ values[members]),
                standard_error=float(sizes[index] * np.sqrt(share @ scaled[np.ix_(members, members)] @ share)),
            )
        )
    return tuple(found)


def _partners(index: int, scaled: FloatArray) -> list[int]:
    """Return the fewest faults, found one by one, whose knowledge would determine this one."""
    chosen: list[int] = []
    while True:
        left = {
            other: _deviation_given(index, [*chosen, other], scaled)
            for other in range(len(scaled))
            if other != index and other not in chosen
        }
        best = min(left, key=lambda other: left[other])
        chosen.append(best)
        if left[best] <= _TOLD or len(left) == 1:
            return chosen


def _deviation_given(index: int, known: list[int], scaled: FloatArray) -> float:
    across = scaled[known, index]
    explained = across @ np.linalg.solve(scaled[np.ix_(known, known)], across)
    return float(np.sqrt(max(scaled[index, index] - explained, 0.0)))


def _correlated(
    faults: tuple[Fault, ...], scaled: FloatArray, knowledge: list[Knowledge]
) -> tuple[tuple[str, str, float], ...]:
    deviation = np.sqrt(np.diag(scaled))
    correlation = scaled / np.outer(deviation, deviation)
    told = [k for k, word in enumerate(knowledge) if word is Knowledge.DETERMINED]
    return tuple(
        (faults[i].name, faults[j].name, float(correlation[i, j]))
        for position, i in enumerate(told)
        for j in told[position + 1 :]
        if abs(correlation[i, j]) > _CLOSE
    )


def hanging_together(correlated: Sequence[tuple[str, str, float]]) -> tuple[str, ...]:
    """Say which estimates hang together, one sentence a group: each in it with some other."""
    groups: list[tuple[dict[str, None], list[float]]] = []
    for one, other, value in correlated:
        joined: tuple[dict[str, None], list[float]] = ({one: None, other: None}, [value])
        apart = []
        for group in groups:
            if one in group[0] or other in group[0]:
                joined = ({**group[0], **joined[0]}, [*group[1], *joined[1]])
            else:
                apart.append(group)
        groups = [*apart, joined]
    return tuple(
        f"{', '.join([*names][:-1])} and {[*names][-1]} hang together (correlation "
        + (f"{values[0]:.3f})" if len(values) == 1 else f"{min(map(abs, values)):.3f} to {max(map(abs, values)):.3f})")
        for names, values in groups
    )

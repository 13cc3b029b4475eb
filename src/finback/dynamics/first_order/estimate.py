"""A number known to some order only, so that it cannot be taken for an exact one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

FIRST_ORDER: Final = "O(eps^4) in a0, eps = sqrt(|b0|), at fixed a1/eps and b1/eps"
"""What a Melnikov integral of a cubic system in normal form leaves out."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The leading terms of an expansion.

    Attributes:
        value: the estimate.
        order: what was left out, in words and orders of the small parameter.
        caution: where it is known to mislead, if it is so here; empty if nothing is known against it.
    """

    value: float
    order: str
    caution: str = ""


def estimate_in_eps(value: float, *, eps: float, order: str, cautions: tuple[str, ...] = ()) -> Estimate:
    """Return an estimate in powers of ``eps``, with a caution of its own where that is not below 1."""
    size = (f"eps = {eps:.3g} is not small",) if eps >= 1.0 else ()
    return Estimate(value=value, order=order, caution="; ".join((*cautions, *size)))

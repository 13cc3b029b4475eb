"""A number known to some order only, so that it cannot be taken for an exact one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


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

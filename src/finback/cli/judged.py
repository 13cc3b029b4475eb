"""How a judgement looks on a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from finback.validation.metric import Judgement

JUDGED: Final[Mapping[Judgement, str]] = MappingProxyType(
    {Judgement.AGREES: "green", Judgement.DISAGREES: "bold red", Judgement.INCONCLUSIVE: "yellow"}
)
"""Judgement -> style of rich."""

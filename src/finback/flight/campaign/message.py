"""What a campaign's workers and their owner say to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from finback.errors import FinbackError

FOLDER: Final = "finback-campaign-"
"""How the name of the temporary folder begins that a fleet's workers share."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Neighboring flights, flown by one worker.

    Attributes:
        first: number of the first.
        count: how many.
    """

    first: int
    count: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ready:
    """A worker can fly.

    Attributes:
        provenance: fidelity -> what is flown, with versions.
    """

    provenance: dict[str, dict[str, str]]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """A worker cannot go on.

    Attributes:
        error: the mistake, if it is one that Finback names; ``RuntimeError`` with the traceback as text else.
    """

    error: FinbackError | RuntimeError

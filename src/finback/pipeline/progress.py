"""Who wants to know how far a stage is."""

from __future__ import annotations

from typing import Final, Protocol, final


class Progress(Protocol):
    """Whoever wants to know how far a stage is."""

    def begin(self, stage: str, steps: int) -> None:
        """A stage begins; ``steps`` calls of ``step`` are expected, 0 if nobody knows."""

    def step(self, what: str) -> None:
        """One thing is done or, where their number is unknown, begun: a flight's name or a short sentence."""


@final
class Silence:
    """Progress that nobody watches."""

    def begin(self, stage: str, steps: int) -> None:
        """Say nothing."""

    def step(self, what: str) -> None:
        """Say nothing."""


SILENCE: Final = Silence()

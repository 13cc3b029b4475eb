"""What the sections of a study need of its reader."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Protocol, TypeVar

from finback.flight.excitation import Maneuver
from finback.flight.plan import FlightOptions
from finback.study.tables import Table

T = TypeVar("T", bound=Table)
V = TypeVar("V")


class Reader(Protocol):
    """The study's reader: every method adds a fault where it finds one, or gives nothing.

    Attributes:
        root: the whole file.
        faults: those found so far.
    """

    root: dict[str, Any]
    faults: list[str]

    def fault(self, place: str, message: str) -> None:
        """Add a fault."""

    def parse(self, kind: type[T], value: object, place: str, others: tuple[str, ...] = ()) -> T | None:
        """Read one table."""

    def table(self, kind: type[T], name: str) -> T | None:
        """Read a table of the root."""

    def make(self, place: str, build: Callable[[], V]) -> V | None:
        """Build a value whose own checks may find what the checks here did not."""

    def sound(self, *places: str) -> bool:
        """Tell whether all these keys are as they stand in the file."""

    def maneuvers(self, tables: object, place: str, flight: FlightOptions | None) -> tuple[Maneuver, ...]:
        """Read an array of maneuvers."""

    def combinations(self, table: object, place: str, flight: FlightOptions | None) -> list[Maneuver]:
        """Read a maneuver whose numbers are lists."""

    def affordable(self, place: str, duration_s: float, flight: FlightOptions) -> None:
        """Check that a flight so long takes no more steps than anybody waits for."""

    def inside(self, place: str, angles_rad: Iterable[float], limits_rad: tuple[float, float], name: str) -> None:
        """Check that angles lie inside limits that stand elsewhere."""

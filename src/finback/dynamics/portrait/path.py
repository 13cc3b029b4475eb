"""What a phase portrait is made of: polylines in the plane (x, y), cut to a box."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.flow_cycle import FlowCycle
from finback.dynamics.flow import Flow, Rest
from finback.errors import InputError


class PathEnd(StrEnum):
    """How a drawn orbit ends."""

    BOX = "box"
    """it leaves the box, not to be drawn again"""
    REST = "rest"
    """it comes to an equilibrium, within what a figure shows"""
    CYCLE = "cycle"
    """it comes to a limit cycle, within what a figure shows"""
    LONG = "long"
    """it is drawn for as long as was asked"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Orbit:
    """An orbit, in the direction in which it was followed.

    It may leave the box and come back: then it has several pieces.

    Attributes:
        start: x and y where it begins, shape (2,).
        forward: whether it was followed forward in time.
        pieces: parts inside the box, each of shape (n, 2): x and y.
        end: how it ends.
        to_x: the equilibrium it ends at; nan if it ends otherwise.
    """

    start: FloatArray
    forward: bool
    pieces: tuple[FloatArray, ...]
    end: PathEnd
    to_x: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "start", frozen_array(self.start))
        object.__setattr__(self, "pieces", tuple(frozen_array(piece) for piece in self.pieces))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Separatrix:
    """One branch of a manifold of a saddle, from the saddle outward (a stable one backward in time).

    Attributes:
        saddle_x: the saddle.
        side: to which side of it the branch begins, -1 or 1.
        stable: whether it runs into the saddle; else out of it.
        orbit: the branch, followed away from the saddle.
    """

    saddle_x: float
    side: int
    stable: bool
    orbit: Orbit


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnCycle:
    """A limit cycle as a closed polyline.

    Attributes:
        cycle: the cycle: period, multiplier, stability.
        pieces: its parts inside the box, shape (n, 2); if it lies inside the box there is one, whose last point is its
            first.
    """

    cycle: FlowCycle
    pieces: tuple[FloatArray, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "pieces", tuple(frozen_array(piece) for piece in self.pieces))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """The rectangle of a portrait, in units of the flow.

    Attributes:
        x_low: left edge.
        x_high: right edge.
        y_low: lower edge.
        y_high: upper edge.
    """

    x_low: float
    x_high: float
    y_low: float
    y_high: float

    def __post_init__(self) -> None:
        """Refuse what is no rectangle."""
        if not (self.x_low < self.x_high and self.y_low < self.y_high):
            raise InputError(
                f"no box: x from {self.x_low} to {self.x_high}, y from {self.y_low} to {self.y_high}",
                hint="low must be below high",
            )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Portrait:
    """All that is drawn of a flow; x and y in units of the flow (of a Liénard system: α in rad, dα/dt in rad/s).

    Attributes:
        flow: the flow.
        box: the rectangle.
        equilibria: all, also outside the box, with their kinds.
        separatrices: the four branches of every saddle: stable and unstable, to both sides.
        cycles: all limit cycles.
        orbits: some other orbits, two or so in each region that the separatrices and cycles cut out.
        nullclines: where y' = 0, i.e. y = −g/f, cut to the box, each of shape (n, 2); x' = 0 is the axis y = 0.
        notes: what could not be followed; empty if there is nothing to be said.
    """

    flow: Flow
    box: Box
    equilibria: tuple[Rest, ...]
    separatrices: tuple[Separatrix, ...]
    cycles: tuple[DrawnCycle, ...]
    orbits: tuple[Orbit, ...]
    nullclines: tuple[FloatArray, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "nullclines", tuple(frozen_array(piece) for piece in self.nullclines))

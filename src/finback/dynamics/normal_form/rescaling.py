"""Changes of coordinates that keep the form x' = y, y' = f(x) y + g(x)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from finback.arrays import FloatArray
from finback.dynamics.flow import Flow, shifted
from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rescaling:
    """Old x = shift + length X, old t = time T; so old y = (length / time) Y.

    The new field is F(X) = time · f(x), G(X) = (time² / length) · g(x). A negative length mirrors the plane; a
    negative time reverses time, which makes sinks of sources and mirrors Y.

    Attributes:
        length: old units of x in one new unit, not 0.
        time: old units of t in one new unit, not 0.
        shift: old place of the new origin.
    """

    length: float = 1.0
    time: float = 1.0
    shift: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what has no inverse."""
        if not all(map(math.isfinite, (self.length, self.time, self.shift))) or 0.0 in (self.length, self.time):
            raise InputError(
                f"length {self.length}, time {self.time}, shift {self.shift} are no change of coordinates",
                hint="length and time must be finite and not 0",
            )

    @property
    def reverses_time(self) -> bool:
        """Whether time runs backward in the new coordinates."""
        return self.time < 0.0

    def to_new(self, x: FloatArray | float, y: FloatArray | float) -> tuple[FloatArray | float, FloatArray | float]:
        """Return the new coordinates of old states."""
        return (x - self.shift) / self.length, y * self.time / self.length

    def to_old(self, x: FloatArray | float, y: FloatArray | float) -> tuple[FloatArray | float, FloatArray | float]:
        """Return the old coordinates of new states."""
        return self.shift + self.length * x, y * self.length / self.time

    def damping(self, ascending: tuple[float, ...]) -> tuple[float, ...]:
        """Return the new f, by rising power."""
        return tuple(c * self.time * self.length**k for k, c in enumerate(shifted(ascending, self.shift)))

    def force(self, ascending: tuple[float, ...]) -> tuple[float, ...]:
        """Return the new g, by rising power."""
        unit = self.time * self.time
        return tuple(c * unit * self.length ** (k - 1) for k, c in enumerate(shifted(ascending, self.shift)))

    def flow(self, flow: Flow) -> Flow:
        """Return the new field; the sizes of its force bound what the shift summed."""
        sizes = shifted(flow.force_sizes, abs(self.shift))
        unit = self.time * self.time
        return Flow(
            damping=self.damping(flow.damping),
            force=self.force(flow.force),
            force_sizes=tuple(c * unit * abs(self.length) ** (k - 1) for k, c in enumerate(sizes)),
        )

    def inverse(self) -> Rescaling:
        """Return the change back: its old coordinates are this one's new ones."""
        return Rescaling(length=1.0 / self.length, time=1.0 / self.time, shift=-self.shift / self.length)

    def then(self, later: Rescaling) -> Rescaling:
        """Return this change followed by another one of its new coordinates."""
        return Rescaling(
            length=self.length * later.length,
            time=self.time * later.time,
            shift=self.shift + self.length * later.shift,
        )

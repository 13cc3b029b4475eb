"""The loop of every flight: a command, a step, the limits, a row where one is due; nothing else between two steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from operator import call
from typing import Final, final

from finback.flight.ending import RATE_LIMIT_RAD_S
from finback.flight.recorder import Recorder

NOWHERE: Final = -1
"""Of a column: there is none."""


@final
class Stop(Enum):
    """Why a loop ended."""

    COMMANDS = auto()
    """all commands were flown"""
    LIMITS = auto()
    """alpha or q left their limits"""
    NOT_FINITE = auto()
    """a row was no longer finite; it is not kept"""
    GROUND = auto()
    """a row is not above the ground; it is not kept"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """How a vehicle makes one step.

    Attributes:
        drive: takes the command of the time that the step goes to.
        run: makes the step.
        alpha: reads alpha, in rad.
        q: reads q, in rad/s.
    """

    drive: Callable[[float], object]
    run: Callable[[], bool]
    alpha: Callable[[], float]
    q: Callable[[], float]

    def advance(self, commands: Sequence[float], limits_rad: tuple[float, float]) -> int:
        """Make a step for each command; return the number of the step that left the limits, 0 if none did."""
        drive, run, alpha, q, limit = self.drive, self.run, self.alpha, self.q, RATE_LIMIT_RAD_S
        low, high = limits_rad
        for step, command in enumerate(commands, start=1):
            drive(command)
            run()
            if not (low < alpha() < high and -limit < q() < limit):  # a NaN in q fails this too
                return step
        return 0

    def record(
        self,
        commands: Sequence[float],
        limits_rad: tuple[float, float],
        recorder: Recorder,
        *,
        stride: int,
        altitude: int = NOWHERE,
    ) -> tuple[Stop, int]:
        """Make a step for each command and keep a row after every ``stride`` of them.

        Args:
            commands: one for each step.
            limits_rad: of alpha; the loop ends at the step that leaves them.
            recorder: of the rows.
            stride: steps from row to row, > 0.
            altitude: index of the column that must stay above 0, if any.

        Returns:
            Why the loop ended, and after how many steps.
        """
        drive, run, alpha, q, limit = self.drive, self.run, self.alpha, self.q, RATE_LIMIT_RAD_S
        columns, pack, keep, isfinite = recorder.columns, recorder.pack, recorder.keep, math.isfinite
        low, high = limits_rad
        due = stride
        for step, command in enumerate(commands, start=1):
            drive(command)
            run()
            if not (low < alpha() < high and -limit < q() < limit):  # as above
                return Stop.LIMITS, step
            if step == due:
                row = tuple(map(call, columns))
                if not isfinite(sum(row)):
                    return Stop.NOT_FINITE, step
                if altitude >= 0 and row[altitude] <= 0.0:
                    return Stop.GROUND, step
                keep(pack(*row))
                due += stride
        return Stop.COMMANDS, len(commands)

"""The elevator's schedule as commands, one a step, and the stick that brings the elevator there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.records import Schedule
from finback.units import from_si

ON_GRID: Final = 1e-6  # of a step: rounding of decimal times
_SHOWN: Final = 8  # of the commands, every so many are told
_COMMANDS: Final = 65  # an odd number: 0 is among them, where scales often have their corner


def commands_of(schedule: Schedule, steps: int, step_s: float) -> list[float]:
    """Return the elevator of each step in rad, the start included; times are counted in steps, none is off by an ulp.

    Raises:
        InputError: the elevator jumps off the step.
    """
    knots = schedule.time_s / step_s
    nearest = np.round(knots)
    jumps = np.flatnonzero(np.diff(knots) == 0)
    if (np.abs(knots - nearest)[jumps] > ON_GRID).any():
        raise InputError(
            f"the elevator jumps at {schedule.time_s[jumps]} s, off the step of {step_s:g} s",
            hint="put jumps on whole steps",
        )
    counted = Schedule(
        time_s=np.where(np.abs(knots - nearest) < ON_GRID, nearest, knots), elevator_rad=schedule.elevator_rad
    )
    commands = counted.drive(np.arange(steps + 1))
    commands[0] = counted.value(0.0)  # the flight begins after a jump at its start
    values: list[float] = commands.tolist()
    return values


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stick:
    """What is written to bring the elevator to an angle.

    Attributes:
        command_norm: values of what is written, rising or falling, shape (n,); empty if it is the angle itself.
        elevator_rad: where they bring the elevator, increasing, shape (n,).
        drive: how surfaces move, in words.
    """

    command_norm: FloatArray
    elevator_rad: FloatArray
    drive: str

    def command(self, elevator_rad: float) -> float:
        """Return what is written for an angle.

        Raises:
            InputError: the flight control does not bring the elevator there.
        """
        if not self.command_norm.size:
            return elevator_rad
        low, high = float(self.elevator_rad[0]), float(self.elevator_rad[-1])
        slack = ON_GRID * (high - low)
        if not low - slack <= elevator_rad <= high + slack:
            raise InputError(
                f"the elevator shall go to {from_si(elevator_rad, 'deg'):.6g} deg, the aircraft's flight control"
                f" brings it to {from_si(low, 'deg'):.6g}…{from_si(high, 'deg'):.6g} deg",
                hint="drive it directly, or choose another mode of the flight control among the properties",
            )
        return float(np.interp(elevator_rad, self.elevator_rad, self.command_norm))


def direct_stick() -> Stick:
    """Return the stick that writes the surface's position itself."""
    return Stick(command_norm=np.zeros(0), elevator_rad=np.zeros(0), drive="surfaces driven directly")


def flight_control_stick(moved: Callable[[float], float], *, place: str) -> Stick:
    """Return the stick of an aircraft's own flight control, which has commands from -1 to 1.

    In flight a control that feeds back the motion moves the elevator on from there; a record has where it stood.

    Args:
        moved: where the elevator comes to rest at a command, in the reference flight, in rad.
        place: the aircraft's file.

    Raises:
        RefusedError: two commands bring it to the same place: the way back is not told.
    """
    commands = np.linspace(-1.0, 1.0, _COMMANDS)
    angles = np.array([moved(command) for command in commands.tolist()])
    moving = np.flatnonzero(np.diff(angles))  # at both ends it may stand on a stop
    inner = slice(moving[0], moving[-1] + 2) if moving.size else slice(0)
    commands, angles = commands[inner], angles[inner]
    change = np.diff(angles)
    if not (change.size and ((change > 0).all() or (change < 0).all())):
        shown = ", ".join(f"{angle:.4g}" for angle in from_si(angles[::_SHOWN], "deg"))
        raise RefusedError(
            f"{place}: in the reference flight its flight control does not bring the elevator to one place for each"
            f" command: {shown} deg",
            hint="drive the surfaces directly (drive = 'direct')",
        )
    order = np.argsort(angles)
    return Stick(
        command_norm=frozen_array(commands[order]),
        elevator_rad=frozen_array(angles[order]),
        drive="the aircraft's flight control and actuators",
    )

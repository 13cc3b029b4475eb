"""A stretch without the biases and the delay of its instruments, and how these move the equations of error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.identification.field import Field
from finback.identification.stretch import Stretch
from finback.records import Hold


def corrected(stretch: Stretch, extras: FloatArray) -> Stretch:
    """Take the biases off and let the elevator act later.

    A held elevator that jumps between two samples is given its mean over each interval: its integral is right, and what
    that leaves of alpha, interval² times the jump of its acceleration, is far below any noise.

    Args:
        stretch: as recorded.
        extras: biases of alpha, q and the elevator, and the delay, in SI, shape (4,).
    """
    if not extras.any():
        return stretch
    elevator = stretch.elevator_rad
    whole = math.floor(extras[3] / stretch.interval_s)
    share = extras[3] / stretch.interval_s - whole
    last = elevator.size - 1
    sample = np.arange(elevator.size) - whole
    # Before the first sample the elevator stands still, and after the last.
    late = (1.0 - share) * elevator[np.clip(sample, 0, last)] + share * elevator[np.clip(sample - 1, 0, last)]
    return replace(
        stretch,
        measured=frozen_array(stretch.measured - extras[:2]),
        elevator_rad=frozen_array(late - extras[2]),
    )


def elevator_by_delay(stretch: Stretch) -> FloatArray:
    """Return the derivative of a corrected stretch's elevator by the delay, at the samples, in rad/s, shape (n,)."""
    elevator = stretch.elevator_rad
    if stretch.hold is Hold.ZOH:  # a jump belongs to the sample at which it comes
        return -np.diff(elevator, prepend=elevator[:1]) / stretch.interval_s
    slope: FloatArray = -np.gradient(elevator, stretch.interval_s)
    return slope


def signals_of_extras(stretch: Stretch, rates: Field) -> FloatArray:
    """Return what an equation error has to hold, under its test function, for each extra, shape (n, 2, 4).

    The equations are d(z - b)/dt = F(z - b, δ - b_e). A bias of alpha or q moves the right side by its Jacobian; the
    left side knows nothing of a constant, because test functions vanish at both ends.

    Args:
        stretch: corrected by the present extras.
        rates: the right sides along it.
    """
    late = rates.elevator * elevator_by_delay(stretch)[:, np.newaxis]
    return np.concatenate([-rates.jacobian, -rates.elevator[:, :, np.newaxis], late[:, :, np.newaxis]], axis=2)

"""Stall hysteresis in the lift itself: the normal acceleration at the same alpha, as alpha rises and as it falls.

This needs no model and no fit, only records with normal acceleration and airspeed: so it also judges slow stalls, from
which no polynomial at one airspeed can be fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from finback.arrays import FloatArray
from finback.identification.stretch import split_at_gaps
from finback.identification.suspicions.finding import Suspect, Suspicion
from finback.identification.suspicions.signals import hats
from finback.identification.suspicions.significance import explained, orthonormal
from finback.identification.uniform import uniform
from finback.records import FlightRecord

NEEDED: Final = ("time_s", "alpha_rad", "q_rad_s", "elevator_rad", "airspeed_m_s", "az_m_s2")
_STEP_S: Final = 0.1  # between the rows of the test
_SMOOTH_S: Final = 0.1  # standard deviation of the kernel that smooths signals and takes dα/dt
_MEMORY: Final = 20  # rows, 2 s: over which residuals may be correlated
_NODES, _UNSTEADY_NODES = 25, 5  # over the range of alpha: a stall may be a degree wide
_SIGNIFICANT: Final = 1e-3
_SHARE: Final = 0.05
"""Of the residuals' squares: with 500 rows and 5 signals chance explains 0.01, some times that with colored noise."""
_LOOP: Final = 0.006
"""Of the lift's own standard deviation: damping that changes with alpha was seen to make 0.004 on an attached F-16."""
_DOWNWASH: Final = 0.02
"""Standard deviation of what dα/dt adds to -az / V² by downwash, in 1/V: ρ S c / 4m times CL of dα/dt c / 2V."""
_FEWEST: Final = 100  # rows


def lift_hysteresis(records: Sequence[FlightRecord]) -> tuple[Suspicion, ...]:
    """Look for dα/dt in the lift at the same alpha; return one finding, or none where no record has what is needed.

    The normal acceleration over the dynamic pressure is a broken line over alpha, and linear in q c / V, dα/dt c / V
    (downwash that lags), the elevator, and what a constant bias or thrust adds in each flight. What dα/dt explains
    beside that, as it changes with alpha, is a flow that lags where it separates. Damping that changes with alpha
    looks alike, and is less.
    """
    used = [_rows(record) for record in records if all(name in record.columns for name in NEEDED)]
    used = [rows for rows in used if len(rows) > 1]
    count = sum(len(rows) for rows in used)
    if count < _FEWEST:
        return ()
    alpha, rate, q, elevator, speed, normal = np.concatenate(used).T
    scale = float(np.mean(speed**2))
    nodes = np.linspace(alpha.min(), alpha.max(), _NODES)
    curve = hats(alpha, nodes)
    flight = np.repeat(np.arange(len(used)), [len(rows) for rows in used])
    constant = (flight[:, np.newaxis] == np.arange(len(used))) * (scale / speed**2)[:, np.newaxis]
    calm = np.column_stack([curve, q / speed, alpha * q / speed, elevator, alpha * elevator, constant])
    # Rows count as they are known: the coefficient of a slow flight is known less.
    weight = (speed**2 / scale)[:, np.newaxis]
    lift = -normal * scale / speed**2
    lagging = hats(alpha, np.linspace(alpha.min(), alpha.max(), _UNSTEADY_NODES)) * (rate / speed)[:, np.newaxis]
    target = lift * weight[:, 0]
    noise = float(np.sqrt(np.mean(_free(target, orthonormal(calm * weight)) ** 2)))
    # One more equation: what downwash makes of dα/dt is small. Without it dα/dt - q, which is the normal acceleration
    # itself over the airspeed, would explain all.
    calm = np.vstack([np.column_stack([calm, rate / speed]) * weight, np.zeros(calm.shape[1] + 1)])
    calm[-1, -1] = noise / (_DOWNWASH * scale)
    basis = orthonormal(calm)
    columns = _free(np.vstack([lagging * weight, np.zeros(_UNSTEADY_NODES)]), basis)
    left = _free(np.append(target, 0.0), basis)
    probability, share = explained(left, columns, spent=basis.shape[1], memory=_MEMORY)
    loop = float(np.sqrt(share * np.mean(left**2)) / np.std(lift))
    raised = probability < _SIGNIFICANT and share > _SHARE and loop > _LOOP
    said = (
        f"dα/dt at the same alpha moves the lift by {100 * loop:.2g} % of its changes ({100 * share:.2g} % of what its "
        f"curve leaves){': stall hysteresis' if raised else ''}"
    )
    return (
        Suspicion(
            suspect=Suspect.HYSTERESIS, judged=True, raised=raised, probability=probability, size=share, statement=said
        ),
    )


def _free(values: FloatArray, basis: FloatArray) -> FloatArray:
    """Return what is left of values, shape (n,) or (n, k), when an orthonormal basis has explained what it can."""
    return np.asarray(values - basis @ (basis.T @ values))


def _rows(record: FlightRecord) -> FloatArray:
    """Return smoothed alpha, dα/dt, q, elevator, airspeed and normal acceleration each 0.1 s, shape (n, 6).

    Single samples that are missing are interpolated; nothing is smoothed or derived across a longer gap.
    """
    if len(record) < _FEWEST:
        return np.empty((0, 6))
    even, _ = uniform(record)
    table = np.column_stack([even[name] for name in NEEDED])
    table = table[np.isfinite(table).all(axis=1)]
    if len(table) < _FEWEST:
        return np.empty((0, 6))
    interval = float(np.median(np.diff(table[:, 0])))
    return np.concatenate([_smoothed(piece, interval) for piece in split_at_gaps(table)])


def _smoothed(piece: FloatArray, interval_s: float) -> FloatArray:
    """Return the rows of samples without a gap: none of those whose kernel reaches beyond either end."""
    width = max(_SMOOTH_S / interval_s, 0.5)
    edge = int(np.ceil(4.0 * width))
    if len(piece) <= 2 * edge:
        return np.empty((0, 6))
    smooth = gaussian_filter1d(piece[:, 1:], width, axis=0, mode="nearest")
    rate = gaussian_filter1d(piece[:, 1], width, order=1, mode="nearest") / interval_s
    rows = np.column_stack([smooth[:, 0], rate, smooth[:, 1:]])
    return np.asarray(rows[edge : len(rows) - edge : max(1, round(_STEP_S / interval_s))])

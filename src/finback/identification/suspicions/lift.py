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
from finback.identification.coefficient.atmosphere import density_ratio
from finback.identification.stretch import split_at_gaps
from finback.identification.suspicions.finding import STRAIGHT, VISIBLE, VISIBLE_LAG_S, Suspect, Suspicion, unjudged
from finback.identification.suspicions.signals import hats
from finback.identification.suspicions.significance import explained, orthonormal
from finback.identification.uniform import uniform
from finback.records import FlightRecord

NEEDED: Final = ("time_s", "alpha_rad", "q_rad_s", "elevator_rad", "airspeed_m_s", "az_m_s2")
_STEP_S: Final = 0.2  # between the rows of the test: nearer ones have the same noise, as it is smoothed
_SMOOTH_S: Final = 0.1  # standard deviation of the kernel that smooths signals and takes dα/dt
_MEMORY: Final = 10  # rows, 2 s: over which residuals may be correlated
_NODES, _UNSTEADY_NODES = 25, 5  # over the range of alpha: a stall may be a degree wide
_ROWS_A_NODE: Final = 12  # at least: a curve with more nodes would follow the noise
_SIGNIFICANT: Final = 1e-3
_SHARE: Final = 0.03
"""Of the residuals' squares: with 500 rows and 5 signals chance explains 0.01, some times that with colored noise."""
_LOOP: Final = 0.006
"""Of the lift's own standard deviation: damping that changes with alpha was seen to make 0.004 on an attached F-16."""
_DOWNWASH: Final = 0.02
"""Standard deviation of what dα/dt adds to -az / V² by downwash, in 1/V: ρ S c / 4m times CL of dα/dt c / 2V."""
_FEWEST: Final = 60  # rows
_LEAST: Final = 8  # samples of a record that has rows at all
_PARTS: Final = 6  # of the range of alpha, in which the slope of the lift is taken
_LOW: Final = 4  # those that may be attached, from below: the steepest has the slope of attached flow
_SURE: Final = 2.0  # standard errors of the difference of the slopes
_COMMON: Final = 2.0  # variance of a mean of rows over that of independent ones, as they are smoothed
_FEW: Final = 0.02  # of all rows, that a part must have


def lift_hysteresis(records: Sequence[FlightRecord]) -> tuple[Suspicion, ...]:
    """Look for dα/dt in the lift at the same alpha; return one finding, or none where no record has what is needed.

    The normal acceleration over the dynamic pressure is a broken line over alpha, and linear in q c / V, dα/dt c / V
    (downwash that lags), the elevator, and what a constant bias, thrust or mass adds in each flight. What dα/dt
    explains beside that, as it changes with alpha, is a flow that lags where it separates, if the curve loses its
    slope at high alpha. Damping that changes with alpha looks alike, and is less. The density is the record's, by its
    column or by its altitude, or that of its condition.
    """
    used = [_rows(record) for record in records if all(name in record.columns for name in NEEDED)]
    used = [rows for rows in used if len(rows) > 1]
    count = sum(len(rows) for rows in used)
    if not used:
        return ()
    if count < _FEWEST:
        seconds = f"{count * _STEP_S:.3g} s"
        return (unjudged(Suspect.HYSTERESIS, f"{seconds} of normal acceleration are too short to see a lag of lift"),)
    return (_judged(used),)


def _judged(used: Sequence[FloatArray]) -> Suspicion:
    """Judge the rows of all flights, shape (n, 7) each."""
    alpha, rate, q, elevator, speed, normal, density = np.concatenate(used).T
    head = speed**2 * density / density.mean()  # dynamic pressure, in units of half the mean density
    scale = float(np.mean(head))
    flight = np.repeat(np.arange(len(used)), [len(rows) for rows in used])[:, np.newaxis] == np.arange(len(used))
    constant = flight * (scale / head)[:, np.newaxis]
    # Mass differs from flight to flight, and biases of alpha do: each flight has a straight part of its own.
    own = np.column_stack([flight[:, 1:], flight[:, 1:] * alpha[:, np.newaxis]])
    beside = np.column_stack([q / speed, alpha * q / speed, elevator, alpha * elevator, constant, own])
    curve = hats(alpha, _nodes(alpha, int(np.clip(alpha.size // _ROWS_A_NODE, 4, _NODES))))
    calm = np.column_stack([curve, beside])
    # Rows count as they are known: the coefficient of a slow flight is known less.
    weight = (head / scale)[:, np.newaxis]
    lift = -normal * scale / head
    lagging = hats(alpha, _nodes(alpha, _UNSTEADY_NODES)) * (rate / speed)[:, np.newaxis]
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
    seen = probability < _SIGNIFICANT and share > _SHARE and loop > _LOOP
    slope = float(np.polyfit(alpha, lift, 1)[0])
    lags = slope * VISIBLE_LAG_S * columns * speed.mean()  # they are dα/dt / V
    if not seen and float(np.sum(lags**2, axis=0).max()) < VISIBLE * _COMMON * float(np.mean(left**2)):
        said = f"alpha moves too little for a lag of {VISIBLE_LAG_S:g} s to be seen in the lift"
        return unjudged(Suspect.HYSTERESIS, said)
    raised = seen and _broken(alpha, target, beside * weight, weight)
    said = (
        f"dα/dt at the same alpha moves the lift by {100 * loop:.2g} % of its changes ({100 * share:.0f} % of what its "
        f"curve leaves){': stall hysteresis' if raised else '; the lift is straight: attached flow' if seen else ''}"
    )
    return Suspicion(
        suspect=Suspect.HYSTERESIS, judged=True, raised=raised, probability=probability, size=share, statement=said
    )


def _nodes(alpha: FloatArray, count: int) -> FloatArray:
    return np.linspace(alpha.min(), alpha.max(), count)


def _broken(alpha: FloatArray, target: FloatArray, beside: FloatArray, weight: FloatArray) -> bool:
    """Return whether the lift loses slope as alpha rises, as it must where flow separates.

    Args:
        alpha: in rad, shape (n,).
        target: lift, weighted, shape (n,).
        beside: what moves it beside alpha, weighted, shape (n, k).
        weight: of the rows, shape (n, 1).
    """
    nodes = _nodes(alpha, _PARTS + 1)
    columns = np.column_stack([hats(alpha, nodes) * weight, beside])
    length = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(np.float64).tiny)
    inverse = np.linalg.pinv(columns / length) / length[:, np.newaxis]
    left = target - columns @ (inverse @ target)
    # Neighbors have a part of their noise in common.
    variance = float(left @ left) / target.size * _COMMON
    difference = np.diff(np.eye(_PARTS + 1, columns.shape[1]), axis=0) / (nodes[1] - nodes[0])
    slope = difference @ inverse @ target
    spread = variance * (difference @ inverse) @ (difference @ inverse).T
    rows = np.histogram(alpha, nodes)[0]
    there = np.flatnonzero(rows > _FEW * alpha.size)
    low = there[there < _LOW]
    if not low.size:
        return False
    # The flow separates above where the lift is steepest; far beyond the stall, the lift may rise again.
    steep = low[np.argmax(slope[low])]
    above = there[there > steep]
    if not above.size:
        return False
    flat = above[np.argmin(slope[above])]
    error = np.sqrt(max(0.0, spread[steep, steep] + spread[flat, flat] - 2.0 * spread[steep, flat]))
    return bool(slope[flat] < STRAIGHT * slope[steep] and slope[steep] - slope[flat] > _SURE * error)


def _free(values: FloatArray, basis: FloatArray) -> FloatArray:
    """Return what is left of values, shape (n,) or (n, k), when an orthonormal basis has explained what it can."""
    return np.asarray(values - basis @ (basis.T @ values))


def _rows(record: FlightRecord) -> FloatArray:
    """Return smoothed alpha, dα/dt, q, elevator, airspeed, normal acceleration, density each 0.2 s, shape (n, 7).

    Single samples that are missing are interpolated; nothing is smoothed or derived across a longer gap.
    """
    if len(record) < _LEAST:
        return np.empty((0, 7))
    even, _ = uniform(record)
    table = np.column_stack([*(even[name] for name in NEEDED), _density(even)])
    table = table[np.isfinite(table).all(axis=1)]
    if len(table) < _LEAST:
        return np.empty((0, 7))
    interval = float(np.median(np.diff(table[:, 0])))
    return np.concatenate([_smoothed(piece, interval) for piece in split_at_gaps(table)])


def _density(record: FlightRecord) -> FloatArray:
    """Return the density of the air in kg/m³: as recorded, by the altitude, or that of the condition, shape (n,)."""
    for name in ("density_kg_m3", "altitude_m"):
        there = np.isfinite(record[name]) if name in record.columns else np.zeros(1, dtype=np.bool_)
        if there.any():
            found = np.interp(record["time_s"], record["time_s"][there], record[name][there])
            condition = record.condition
            if name == "altitude_m":
                found = condition.density_kg_m3 * density_ratio(found, condition.altitude_m)
            return np.asarray(found)
    return np.full(len(record), record.condition.density_kg_m3)


def _smoothed(piece: FloatArray, interval_s: float) -> FloatArray:
    """Return the rows of samples without a gap: none of those whose kernel reaches beyond either end."""
    width = max(_SMOOTH_S / interval_s, 0.5)
    edge = int(np.ceil(4.0 * width))
    if len(piece) <= 2 * edge:
        return np.empty((0, 7))
    smooth = gaussian_filter1d(piece[:, 1:], width, axis=0, mode="nearest")
    rate = gaussian_filter1d(piece[:, 1], width, order=1, mode="nearest") / interval_s
    rows = np.column_stack([smooth[:, 0], rate, smooth[:, 1:]])
    return np.asarray(rows[edge : len(rows) - edge : max(1, round(_STEP_S / interval_s))])

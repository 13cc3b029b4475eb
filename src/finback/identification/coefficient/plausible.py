"""Whether channels of a flight can be what they are called, before anything is fitted to them.

A channel that does not move while the elevator does is dead. Where nothing turns by more than the noise of q,
likelihood has no motion to follow: its maximum is wherever the noise puts it. Specific forces must be those that turn
the recorded motion: with u = V cos α and w = V sin α, ax = du/dt + q w + g sin θ and az = dw/dt - q u - g cos θ. A sign
or a unit that is wrong fits the equations of motion with numbers that are wrong by as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.identification.bump import bump
from finback.identification.coefficient.track import SPEED_CHANNEL, THETA, Track
from finback.identification.noise import noise_deviation
from finback.identification.stretch import half_width_samples
from finback.records import FlightRecord
from finback.units import to_si

_MOVED_RAD: Final = to_si(0.2, "deg")
"""Of an elevator, from which on nothing else stands still to the last digit."""
_STILL: Final = 1.1
"""Of q over its noise, within a flight: less is motion of less than half the noise."""
_SURE: Final = 5.0
"""Standard errors, and differences of twice the log-likelihood of 25."""
_ALLOWED_M_S2: Final = 2.0
"""Of the mean of a force: biases, gravity of a bank of 35 deg, a center of gravity aside."""
_BANK_RAD: Final = to_si(35.0, "deg")
_HALF_WIDTH_S: Final = 0.5
"""Of the means of which variations are compared: long enough that gusts and noise leave rates of V and α alone."""
_FEWEST: Final = 8
"""Means of a flight."""
_NEAR: Final = 0.25
"""How far, as a share, a ratio of means may be from that of a cause that is named."""
_G: Final = 9.80665
_FOOT: Final = to_si(1.0, "ft_s2")
_CAUSES: Final = {-1.0: "the sign is wrong", _G: "it is in g", _FOOT: "it is in ft/s²"}
"""Factor that would mend a channel -> what is said."""


def check_channels(records: Sequence[FlightRecord], used: Sequence[Track]) -> None:
    """Check every flight.

    Args:
        records: the flights.
        used: their stretches.

    Raises:
        InputError: a channel stands still, or a specific force is not that of the motion; with its likely cause.
    """
    for record in records:
        pieces = [track for track in used if track.flight == record.name]
        if not pieces:
            continue
        _check_alive(record.name, pieces)
        if np.nanmax(np.abs(record.or_zero("phi_rad"))) < _BANK_RAD:
            _check_forces(record.name, pieces)


def _check_alive(flight: str, pieces: Sequence[Track]) -> None:
    """Raise InputError where an output stands still; an airspeed may be that of the condition."""
    elevator = np.concatenate([track.inputs[:, 0] for track in pieces])
    if np.ptp(elevator) < _MOVED_RAD:
        return
    measured = np.concatenate([track.measured for track in pieces])
    dead = [
        f"{name} ({measured[0, k]:.4g})"
        for k, name in enumerate(pieces[0].outputs)
        if name != SPEED_CHANNEL and not np.ptp(measured[:, k])
    ]
    if dead:
        raise InputError(
            f"flight '{flight}': {', '.join(dead)} stands still while the elevator moves: the channel is dead",
            hint="leave the channel out by 'outputs', or the flight",
        )


def _check_forces(flight: str, pieces: Sequence[Track]) -> None:
    """Raise InputError where a specific force is not that of the motion."""
    known = THETA in pieces[0].outputs and any(np.ptp(track.states[:, 0]) > 0.0 for track in pieces)
    for force in ("az_m_s2", "ax_m_s2"):
        if force not in pieces[0].outputs or (force == "ax_m_s2" and not known):
            continue
        said = _contradicted(pieces, force)
        if said:
            raise InputError(
                f"flight '{flight}': {force} is not the force that turns the motion: {said}",
                hint="x is forward and z down; in level flight az is about -9.81 m/s² and ax is g sin(theta), as "
                "accelerometers feel it; mend the column, or leave it out by 'outputs'",
            )


def check_motion(used: Sequence[Track]) -> None:
    """Raise RefusedError where no flight turns by more than the noise of its pitch rate.

    Args:
        used: the data.
    """
    rates = [track.states[:, 3] for track in used]
    noise = noise_deviation(rates)
    if all(float(np.std(rate)) < _STILL * noise for rate in rates):
        raise RefusedError(
            "no flight moves in pitch beyond the noise of q: steady flights fix the numbers only up to a common factor",
            hint="take flights in which the elevator moves",
        )


def _contradicted(pieces: Sequence[Track], force: str) -> str:
    """Return what is wrong with a specific force; nothing if it may be right."""
    time = sum((len(track) - 1) * track.interval_s for track in pieces)
    felt = sum(float(np.trapezoid(track.column(force), dx=track.interval_s)) for track in pieces) / time
    due, aside = 0.0, 0.0
    for track in pieces:
        speed, other = _along(track, force)
        due += float(speed[-1] - speed[0] + np.trapezoid(other, dx=track.interval_s)) / time
        aside += 2.0 * float(np.var(speed)) / time**2
    if abs(felt - due) > _ALLOWED_M_S2 + _SURE * np.sqrt(aside):
        return f"it is {felt:.4g} m/s² on average, V, alpha, q and theta say {due:.4g} m/s²; {_cause(felt, due, force)}"
    pairs = np.concatenate([_means(track, force) for track in pieces])
    if len(pairs) < _FEWEST:
        return ""
    wanted, had = pairs.T
    right = float(np.var(wanted - had))
    for factor in (-1.0, _G):
        wrong = float(np.var(wanted - factor * had))
        if len(pairs) * np.log(right / max(wrong, np.finfo(np.float64).tiny)) > _SURE**2:
            return f"it moves against V, alpha, q and theta; likely {_CAUSES[factor]}"
    return ""


def _cause(felt: float, due: float, force: str) -> str:
    """Return what may be wrong with a force, by its mean and what that should be."""
    gravity = force == "az_m_s2" and abs(felt - due - _G) < _NEAR * _G
    for factor, said in _CAUSES.items():
        # Small readings in g and none at all look alike where gravity was taken off.
        if abs(factor * felt - due) < _NEAR * abs(due) and not (gravity and abs(felt) < 0.05 * _G):
            return f"likely {said}"
    return "likely gravity was taken off" if gravity else "likely another unit, an offset, or a channel that is dead"


def _along(track: Track, force: str) -> tuple[FloatArray, FloatArray]:
    """Return the velocity that a force changes, in m/s, and what it makes beside it, in m/s², both of shape (n,)."""
    speed, alpha, theta, q = track.states.T
    forward, down = speed * np.cos(alpha), speed * np.sin(alpha)
    if force == "ax_m_s2":
        return forward, q * down + track.gravity_m_s2 * np.sin(theta)
    return down, -q * forward - track.gravity_m_s2 * np.cos(theta)


def _means(track: Track, force: str) -> FloatArray:
    """Return means of what a force should be and of what it is, under bumps side by side, shape (K, 2)."""
    reach = max(3, half_width_samples(_HALF_WIDTH_S, track.interval_s))
    weights = bump(reach, track.interval_s, track.hold)
    area = float(weights.value.sum())
    speed, other = _along(track, force)
    found = []
    for start in range(0, len(track) - 2 * reach, reach):
        seen = slice(start, start + 2 * reach + 1)
        due = (weights.value @ other[seen] - weights.slope @ speed[seen]) / area
        found.append((due, weights.value @ track.column(force)[seen] / area))
    means: FloatArray = np.array(found).reshape(-1, 2)
    return means

"""What the flights of a campaign may be given, and what they record, in each fidelity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Final, get_args

from finback.errors import InputError
from finback.flight.excitation import Maneuver, Release
from finback.flight.loading import Loading
from finback.flight.plan import FIDELITIES
from finback.flight.power import FixedThrust
from finback.flight.start import FreeStart, SymmetricStart

MANEUVERS: Final[Mapping[str, type[Maneuver]]] = {kind.kind: kind for kind in get_args(Maneuver)}
"""Kind of a maneuver -> its class."""
LOADING: Final = tuple(part.name for part in fields(Loading))
"""Names of numbers of the loading."""
SYMMETRIC_START: Final = tuple(part.name for part in fields(SymmetricStart))
"""Names of numbers of the start that fidelity ``symmetric`` has."""
FREE_START: Final = tuple(part.name for part in fields(FreeStart))
"""Names of numbers of the start that fidelity ``free`` has."""
THRUST: Final = tuple(part.name for part in fields(FixedThrust))
"""The name of a constant thrust."""
THROTTLE: Final = ("throttle",)
"""The name of the throttle's setting."""
GUSTS: Final = ("intensity_m_s", "length_m")
"""Names of numbers of Dryden turbulence."""

_ALLOWED: Final[Mapping[str, tuple[str, ...]]] = {
    "rig": LOADING,
    "symmetric": (*LOADING, *SYMMETRIC_START, *THRUST, *THROTTLE),
    "free": (*LOADING, *FREE_START, *THRUST, *THROTTLE, *GUSTS),
}
"""Fidelity -> what may be given beside the maneuver."""
_IN_PLANE: Final = (
    "time_s",
    "elevator_rad",
    "alpha_rad",
    "q_rad_s",
    "theta_rad",
    "airspeed_m_s",
    "altitude_m",
    "alpha_dot_rad_s",
    "q_dot_rad_s2",
)
_BESIDE: Final = ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "psi_rad", "aileron_rad", "rudder_rad")
RECORDED: Final[Mapping[str, tuple[str, ...]]] = {
    "rig": _IN_PLANE,
    "symmetric": (*_IN_PLANE, *_BESIDE),
    "free": (*_IN_PLANE, *_BESIDE),
}
"""Fidelity -> the channels of its flights; in turbulence there is no rate of alpha."""


def check_numbers(kind: str, names: Sequence[str], fidelities: Sequence[str]) -> None:
    """Check that every flight has the numbers it needs, and none that its fidelity has no use for.

    Args:
        kind: of the maneuver.
        names: of the numbers: those of the maneuver, in the order of its fields, then any others.
        fidelities: of the flights.

    Raises:
        InputError: kind or fidelity are unknown, a number is missing, or one is too many.
    """
    if kind not in MANEUVERS:
        raise InputError(f"campaign: unknown kind '{kind}'", hint=f"known: {', '.join(MANEUVERS)}")
    wanted = tuple(part.name for part in fields(MANEUVERS[kind]))
    own, others = tuple(names[: len(wanted)]), tuple(names[len(wanted) :])
    if own != wanted or len(set(names)) < len(names):
        raise InputError(f"campaign: a {kind} needs {', '.join(wanted)}, got {', '.join(names)}")
    for fidelity in fidelities:
        _check_fidelity(fidelity)
        for name in others:
            if name not in _ALLOWED[fidelity]:
                raise InputError(
                    f"campaign: fidelity '{fidelity}' has no {name}",
                    hint=f"beside the maneuver it has: {', '.join(_ALLOWED[fidelity])}",
                )
    if others and kind != Release.kind:
        raise InputError(
            f"campaign: a {kind} starts at the trim of the reference flight, which fixes {', '.join(others)}",
            hint="use kind 'release', which starts anywhere",
        )
    if set(others) >= {*THRUST, *THROTTLE}:
        raise InputError("campaign: a flight has a fixed thrust or a throttle, not both")
    if len(set(GUSTS) & set(others)) == 1:
        raise InputError(f"campaign: turbulence needs {' and '.join(GUSTS)}")


def check_recorded(channels: Sequence[str], fidelities: Sequence[str]) -> None:
    """Check that somebody records each channel.

    Raises:
        InputError: one is recorded in no fidelity.
    """
    known = tuple(dict.fromkeys(name for fidelity in fidelities for name in RECORDED[_check_fidelity(fidelity)]))
    missing = [name for name in channels if name not in known]
    if missing and known:
        raise InputError(
            f"flights of fidelity {' and '.join(fidelities)} record no {', '.join(missing)}",
            hint=f"they record: {', '.join(known)}",
        )


def _check_fidelity(fidelity: str) -> str:
    if fidelity not in FIDELITIES:
        raise InputError(f"unknown fidelity '{fidelity}'", hint=f"known: {', '.join(FIDELITIES)}")
    return fidelity

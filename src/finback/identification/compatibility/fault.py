"""Faults of instruments: what may be wrong with which channel, and how large it usually is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import StrEnum
from types import MappingProxyType
from typing import Final, final

from finback.errors import InputError
from finback.units import quantity_of, unit_of

RATES: Final = ("p_rad_s", "q_rad_s", "r_rad_s")
FORCES: Final = ("ax_m_s2", "ay_m_s2", "az_m_s2")
ATTITUDES: Final = ("phi_rad", "theta_rad", "psi_rad")
FLOW: Final = ("airspeed_m_s", "alpha_rad", "beta_rad")
OUTPUTS: Final = (*FLOW, *ATTITUDES, "altitude_m")
CLOCK: Final = "q_rad_s"
"""All delays are against this channel: one delay common to all instruments shows in no motion."""


@final
class Kind(StrEnum):
    """measured(t) = (1 + scale) · true(t − delay) + bias."""

    BIAS = "bias"
    SCALE = "scale"
    DELAY = "delay"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault of one channel.

    Attributes:
        channel: the channel's name.
        kind: what is wrong.
    """

    channel: str
    kind: Kind

    @property
    def name(self) -> str:
        """In words: ``alpha bias``."""
        return f"{quantity_of(self.channel)} {self.kind}"

    @property
    def unit(self) -> str:
        """SI unit suffix of its size."""
        return {Kind.SCALE: "1", Kind.DELAY: "s"}.get(self.kind) or unit_of(self.channel)


_ALL_KINDS: Final = (Kind.BIAS, Kind.SCALE, Kind.DELAY)
_KINDS: Final[Mapping[str, tuple[Kind, ...]]] = {
    CLOCK: (Kind.BIAS, Kind.SCALE),
    # Where north is, and where the ground, nothing else in a record says: the start takes up the bias.
    "psi_rad": (Kind.DELAY,),
    "altitude_m": (Kind.SCALE, Kind.DELAY),
}
_BIASES: Final[Mapping[str, float]] = {
    **dict.fromkeys(RATES, 0.025),
    **dict.fromkeys(FORCES, 1.0),
    **dict.fromkeys(ATTITUDES, 0.05),
    "alpha_rad": 0.05,
    "beta_rad": 0.05,
    "airspeed_m_s": 10.0,
}
_SCALES: Final[Mapping[str, float]] = {
    **dict.fromkeys(RATES, 0.1),
    **dict.fromkeys(FORCES, 0.1),
    **dict.fromkeys(ATTITUDES, 0.1),
    "alpha_rad": 0.25,
    "beta_rad": 0.25,
    "airspeed_m_s": 0.15,
    "altitude_m": 0.05,
}
_DELAYS: Final[Mapping[str, float]] = {"airspeed_m_s": 0.3, "altitude_m": 0.3}
_DELAY: Final = 0.15


def faults_of(channel: str) -> tuple[Fault, ...]:
    """Return every fault that is looked for in a channel."""
    return tuple(Fault(channel=channel, kind=kind) for kind in _KINDS.get(channel, _ALL_KINDS))


ALL: Final = tuple(fault for channel in (*RATES, *FORCES, *OUTPUTS) for fault in faults_of(channel))
"""Every fault that can be looked for."""


def usual_size(fault: Fault) -> float:
    """Return the standard deviation, in SI, of a fault among instruments that fly: two in three are smaller.

    They are wide on purpose (3 deg of a vane, 0.1 g of an accelerometer, 0.15 s): a fault of three times the size is
    still found, while one that a record tells no better than to 0.3 of it is called undetermined.
    """
    if fault.kind is Kind.BIAS:
        return _BIASES[fault.channel]
    return _SCALES[fault.channel] if fault.kind is Kind.SCALE else _DELAYS.get(fault.channel, _DELAY)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CompatibilityOptions:
    """What is known of the instruments beforehand.

    Attributes:
        sizes: name of a fault (``theta bias``) -> its usual size in SI, in place of ``usual_size``; 0 says that the
            instrument has none. A laboratory calibration belongs here: it separates what the flight cannot.
    """

    sizes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check names and sizes."""
        known = [fault.name for fault in ALL]
        for name, size in self.sizes.items():
            if name not in known:
                near = get_close_matches(name, known, n=3, cutoff=0.4)
                raise InputError(
                    f"no instrument has a fault '{name}'",
                    hint=f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(known)}",
                )
            if not (math.isfinite(size) and size >= 0.0):
                raise InputError(f"the size of '{name}' is {size}, expected a number >= 0")
        object.__setattr__(self, "sizes", MappingProxyType(dict(self.sizes)))

    def size(self, fault: Fault) -> float:
        """Return the usual size of a fault in SI; 0 if the instrument has none."""
        return self.sizes.get(fault.name, usual_size(fault))

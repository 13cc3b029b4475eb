"""The catalogue of channels: every quantity that a record may hold, with unit, sign and frame, once.

Columns of a record are channel names, always in SI: ``alpha_rad``, ``q_rad_s``. Signs: x forward, y right, z down;
elevator > 0 is trailing edge down, nose down (Cm_elevator < 0, CL_elevator > 0); aileron > 0 rolls right; rudder > 0
yaws left. ``alpha`` is the angle of the body x-axis to the airflow. ``alpha_dot`` is not q.
"""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, final

from finback.errors import InputError
from finback.units import quantity_of, unit_of


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One quantity of a record.

    Attributes:
        name: quantity and SI unit, ``alpha_rad``; the column's name everywhere.
        meaning: what it is, its sign and frame.
        label: how a plot writes the quantity, without unit.
        display_unit: the unit that plots and terminal use (a suffix of ``units``).
        jsbsim_property: the property that JSBSim gives it under; empty if it has none.
        jsbsim_unit: the unit of that property.
    """

    name: str
    meaning: str
    label: str
    display_unit: str
    jsbsim_property: str = ""
    jsbsim_unit: str = "1"

    @property
    def quantity(self) -> str:
        """The name without its unit."""
        return quantity_of(self.name)

    @property
    def unit(self) -> str:
        """The SI unit suffix of the name."""
        return unit_of(self.name)


def _channel(name: str, label: str, display_unit: str, meaning: str, jsbsim: str = "", unit: str = "1") -> Channel:
    return Channel(
        name=name,
        meaning=meaning,
        label=label,
        display_unit=display_unit,
        jsbsim_property=jsbsim,
        jsbsim_unit=unit,
    )


_ALL: Final = (
    _channel("time_s", "t", "s", "time since the start of the flight"),
    _channel("alpha_rad", "α", "deg", "angle of attack of the body x-axis, nose up > 0", "aero/alpha-rad", "rad"),
    _channel("beta_rad", "β", "deg", "sideslip, wind from the right > 0", "aero/beta-rad", "rad"),
    _channel("p_rad_s", "p", "deg_s", "roll rate, body x, right wing down > 0", "velocities/p-rad_sec", "rad_s"),
    _channel("q_rad_s", "q", "deg_s", "pitch rate, body y, nose up > 0", "velocities/q-rad_sec", "rad_s"),
    _channel("r_rad_s", "r", "deg_s", "yaw rate, body z, nose right > 0", "velocities/r-rad_sec", "rad_s"),
    _channel("phi_rad", "φ", "deg", "roll angle, right wing down > 0", "attitude/phi-rad", "rad"),
    _channel("theta_rad", "θ", "deg", "pitch angle, nose up > 0", "attitude/theta-rad", "rad"),
    _channel("psi_rad", "ψ", "deg", "heading, from north to east > 0", "attitude/psi-rad", "rad"),
    _channel("airspeed_m_s", "V", "m_s", "true airspeed", "velocities/vtrue-fps", "ft_s"),
    _channel("ax_m_s2", "ax", "m_s2", "specific force along body x at the center of gravity, forward > 0"),
    _channel("ay_m_s2", "ay", "m_s2", "specific force along body y at the center of gravity, right > 0"),
    _channel(
        "az_m_s2", "az", "m_s2", "specific force along body z at the center of gravity, down > 0 (−g in level flight)"
    ),
    _channel("altitude_m", "h", "m", "geometric altitude above the reference sphere", "position/h-sl-ft", "ft"),
    _channel(
        "elevator_rad",
        "δe",
        "deg",
        "elevator or stabilator, trailing edge down > 0",
        "fcs/elevator-pos-rad",
        "rad",
    ),
    _channel("canard_rad", "δc", "deg", "canard, trailing edge down > 0"),
    _channel("aileron_rad", "δa", "deg", "aileron, rolls right > 0", "fcs/left-aileron-pos-rad", "rad"),
    _channel("rudder_rad", "δr", "deg", "rudder, yaws left > 0", "fcs/rudder-pos-rad", "rad"),
    _channel("alpha_dot_rad_s", "dα/dt", "deg_s", "rate of alpha (not q)", "aero/alphadot-rad_sec", "rad_s"),
    _channel(
        "q_dot_rad_s2",
        "dq/dt",
        "deg_s2",
        "pitch acceleration, body y",
        "accelerations/qdot-rad_sec2",
        "rad_s2",
    ),
    _channel("thrust_n", "T", "n", "thrust of all engines along its line, forward > 0"),
    _channel("density_kg_m3", "ρ", "kg_m3", "density of the air"),
)

CHANNELS: Final[dict[str, Channel]] = {channel.name: channel for channel in _ALL}
"""Channel name -> channel."""

SURFACES: Final = frozenset({"elevator_rad", "canard_rad", "aileron_rad", "rudder_rad"})
"""Inputs that move between samples as a record's hold says; everything else goes straight."""

CIRCULAR: Final = frozenset({"alpha_rad", "phi_rad", "psi_rad", "longitude_rad"})
"""Angles that come round, as −180° and 180° or 0° and 360° are the same; so are differences of them taken."""


def channel(name: str) -> Channel:
    """Return the channel called ``name``.

    Raises:
        InputError: no such channel; the message names the nearest ones.
    """
    try:
        return CHANNELS[name]
    except KeyError:
        near = get_close_matches(name, CHANNELS, n=3, cutoff=0.4)
        raise InputError(
            f"unknown channel '{name}'", hint=f"did you mean {' or '.join(near)}?" if near else ""
        ) from None

"""What is recorded of a case flown as it is: names and units of ours for properties of JSBSim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from finback.channels import CHANNELS
from finback.errors import InputError
from finback.units import si_unit, unit_of


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CaseColumn:
    """One column of a flown case.

    Attributes:
        name: quantity and SI unit.
        jsbsim_property: where JSBSim has it.
        jsbsim_unit: the property's unit.
    """

    name: str
    jsbsim_property: str
    jsbsim_unit: str

    def __post_init__(self) -> None:
        """Check that the name ends in the SI unit of what the property measures."""
        if unit_of(self.name) != si_unit(self.jsbsim_unit):
            raise InputError(
                f"'{self.name}' does not end in the SI unit of '{self.jsbsim_unit}'",
                hint=f"end the name in '_{si_unit(self.jsbsim_unit)}'",
            )


_BEYOND_CHANNELS: Final = (
    # position, WGS 84 or the planet that was loaded
    ("latitude_rad", "position/lat-geod-rad", "rad"),  # geodetic
    ("geocentric_latitude_rad", "position/lat-gc-rad", "rad"),
    ("longitude_rad", "position/long-gc-rad", "rad"),
    ("geodetic_altitude_m", "position/geod-alt-ft", "ft"),
    ("ecef_x_m", "position/ecef-x-ft", "ft"),
    ("ecef_y_m", "position/ecef-y-ft", "ft"),
    ("ecef_z_m", "position/ecef-z-ft", "ft"),
    ("eci_x_m", "position/eci-x-ft", "ft"),
    ("eci_y_m", "position/eci-y-ft", "ft"),
    ("eci_z_m", "position/eci-z-ft", "ft"),
    # velocity relative to the planet
    ("velocity_north_m_s", "velocities/v-north-fps", "ft_s"),
    ("velocity_east_m_s", "velocities/v-east-fps", "ft_s"),
    ("velocity_down_m_s", "velocities/v-down-fps", "ft_s"),
    ("climb_rate_m_s", "velocities/h-dot-fps", "ft_s"),
    ("u_m_s", "velocities/u-fps", "ft_s"),
    ("v_m_s", "velocities/v-fps", "ft_s"),
    ("w_m_s", "velocities/w-fps", "ft_s"),
    ("mach_1", "velocities/mach", "1"),
    # rates relative to inertial space (p, q, r of the channels are relative to the planet)
    ("inertial_p_rad_s", "velocities/pi-rad_sec", "rad_s"),
    ("inertial_q_rad_s", "velocities/qi-rad_sec", "rad_s"),
    ("inertial_r_rad_s", "velocities/ri-rad_sec", "rad_s"),
    # air and gravity
    ("density_kg_m3", "atmosphere/rho-slugs_ft3", "slug_ft3"),
    ("pressure_pa", "atmosphere/P-psf", "psf"),
    ("temperature_k", "atmosphere/T-R", "degr"),
    ("speed_of_sound_m_s", "atmosphere/a-fps", "ft_s"),
    ("dynamic_pressure_pa", "aero/qbar-psf", "psf"),
    ("gravity_m_s2", "accelerations/gravity-ft_sec2", "ft_s2"),
    # aerodynamic forces and moments, body axes x forward, y right, z down
    ("aero_force_x_n", "forces/fbx-aero-lbs", "lbf"),
    ("aero_force_y_n", "forces/fby-aero-lbs", "lbf"),
    ("aero_force_z_n", "forces/fbz-aero-lbs", "lbf"),
    ("aero_moment_l_nm", "moments/l-aero-lbsft", "ftlbf"),
    ("aero_moment_m_nm", "moments/m-aero-lbsft", "ftlbf"),
    ("aero_moment_n_nm", "moments/n-aero-lbsft", "ftlbf"),
    # commands, -1 to 1, and the wind, where it blows to
    ("elevator_command_1", "fcs/elevator-cmd-norm", "1"),
    ("aileron_command_1", "fcs/aileron-cmd-norm", "1"),
    ("rudder_command_1", "fcs/rudder-cmd-norm", "1"),
    ("throttle_command_1", "fcs/throttle-cmd-norm", "1"),
    ("wind_north_m_s", "atmosphere/total-wind-north-fps", "ft_s"),
    ("wind_east_m_s", "atmosphere/total-wind-east-fps", "ft_s"),
    ("wind_down_m_s", "atmosphere/total-wind-down-fps", "ft_s"),
    ("mass_kg", "inertia/mass-slugs", "slug"),
)

CASE_COLUMNS: Final = (
    *(
        CaseColumn(name=one.name, jsbsim_property=one.jsbsim_property, jsbsim_unit=one.jsbsim_unit)
        for one in CHANNELS.values()
        if one.jsbsim_property
    ),
    *(CaseColumn(name=name, jsbsim_property=place, jsbsim_unit=unit) for name, place, unit in _BEYOND_CHANNELS),
)
"""What is recorded of every case, as far as its aircraft has it: the channels, and what check cases compare."""

"""What stands in for a key with a fault, so that everything else in its table is still checked."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from finback.units import STANDARD_GRAVITY_M_S2

STAND_INS: Final[Mapping[str, object]] = MappingProxyType(
    {
        "schema": 1,
        "name": "study",
        "aircraft": "aircraft",
        "seed": 0,
        "airspeed_m_s": 100.0,
        "density_kg_m3": 1.0,
        "gravity_m_s2": STANDARD_GRAVITY_M_S2,
        "altitude_m": 0.0,
        "fidelity": "free",  # which forbids nothing
        "step_hz": 100.0,
        "sample_hz": 100.0,
        "alpha_limits_deg": [-179.0, 179.0],
        "elevator_limits_deg": [-179.0, 179.0],
        "elevator_rate_deg_s": 1e4,
        "alpha_noise_deg": 0.0,
        "q_noise_deg_s": 0.0,
        "intensity_m_s": 0.0,
        "length_m": 100.0,
        "alpha_window_deg": [-1.0, 1.0],
        "half_width_s": 1.0,
        "spacing_s": 1e-4,
        "minimum_duration_s": 0.0,
        "elevator_range_deg": [-1.0, 1.0],
        "elevator_step_deg": 1.0,
        "alpha_range_deg": [-180.0, 180.0],
        "equilibrium_elevator_deg": [0.0],
        "ramp_rate_deg_s": [0.1, 0.2, 0.3, 0.4],
        "margin_deg": 5.0,
        "start_offset_deg": 180.0,
        "hold_s": 1.0,
        "approach_s": 1.0,
        "resolution_deg": 1e-3,
        "alpha_rmse_deg": {"value": 1.0, "source": "none"},
        "q_rmse_deg_s": {"value": 1.0, "source": "none"},
        "theil": {"value": 1.0, "source": "none"},
        "fold_elevator_deg": {"value": 1.0, "source": "none"},
        "ramp_fold_elevator_deg": {"value": 1.0, "source": "none"},
        "equilibrium_alpha_deg": {"value": 1.0, "source": "none"},
        "value": 1.0,
        "source": "none",
    }
)
"""Key of a study file -> a value without a fault. A study with faults is never flown, so nobody meets it."""

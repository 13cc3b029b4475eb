"""Putting an aircraft on the rig: try it, derive the copy, try that, load it, check that it is the same aircraft."""

from __future__ import annotations

import math
import platform
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.errors import AircraftError, FinbackError, InputError
from finback.flight.aircraft import Aircraft
from finback.flight.derivation import (
    INERTIA,
    MASS_PROPERTIES,
    WEIGHT,
    Source,
    center_in,
    inertia_slug_ft2,
    late_properties,
    read_source,
    replaced,
    rig_model,
)
from finback.flight.simulator import INTEGRATOR, Simulator, jsbsim_version, native_properties
from finback.flight.trial import Trial, fly_trial
from finback.records import Condition
from finback.units import from_si, to_si

_GEAR_POSITION: Final = "gear/gear-pos-norm"
_SURFACES: Final = ("fcs/", "gear/")  # that only the dropped flight control would move; the read-only ones follow these
_EMPTY: Final = "inertia/empty-weight-lbs"
_MASS: Final = "inertia/mass-slugs"
_SAME: Final = 1e-12  # relative; the copy's mass properties differ from the original's by rounding only


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mounted:
    """An aircraft on the rig.

    Attributes:
        simulator: JSBSim with the derived copy, density held.
        surfaces: other surfaces -> position, in JSBSim's units; to be written after every reset.
        provenance: what the copy replaced and holds.
    """

    simulator: Simulator
    surfaces: Mapping[str, float]
    provenance: Mapping[str, str]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Copy:
    """The rig's copy of an aircraft, tried.

    Attributes:
        path: its XML file.
        source: the original.
        loaded: what the original reads at the reference flight, in JSBSim's units.
        native: those of the properties read that JSBSim itself defines.
        constants: properties that only a dropped part defined -> their value.
        initial: property -> value at the start.
        density_slug_ft3: the density held.
    """

    path: Path
    source: Source
    loaded: Mapping[str, float]
    native: frozenset[str]
    constants: Mapping[str, float]
    initial: Mapping[str, float]
    density_slug_ft3: float


def try_mounting(aircraft: Aircraft, condition: Condition) -> tuple[str, ...]:
    """Derive the rig's copy of an aircraft and start both in child processes; return the fault found, if any."""
    try:
        with tempfile.TemporaryDirectory(prefix="finback-rig-") as folder:
            _derive(aircraft, condition, Path(folder))
    except FinbackError as error:
        return (str(error),)
    return ()


def mount(aircraft: Aircraft, condition: Condition, *, step_s: float, folder: Path) -> Mounted:
    """Put an aircraft on the rig.

    Surfaces that only the dropped flight control moved stay where it puts them at the reference flight, at alpha 0
    with all commands neutral; the landing gear is up.

    Args:
        aircraft: the aircraft.
        condition: the reference flight.
        step_s: integration step.
        folder: where the derived copy is written.

    Raises:
        AircraftError: the aircraft or its copy does not load without a warning.
    """
    copy = _derive(aircraft, condition, folder)
    simulator = Simulator(copy.path, step_s=step_s, freeze_position=True)
    simulator.override_density(copy.density_slug_ft3)  # before the first start; it outlives resets
    surfaces = {
        name: 0.0 if name == _GEAR_POSITION else copy.loaded[name]
        for name in sorted(copy.native)
        if name.startswith(_SURFACES) and simulator.writable(name)
    }
    simulator.write({**copy.initial, **surfaces})
    simulator.start()
    _check_copied(simulator, copy)
    held = {**copy.constants, **surfaces}
    provenance = {
        "aircraft": aircraft.name,
        "aircraft_sha256": aircraft.sha256,
        "mass_kg": repr(to_si(copy.loaded[_MASS], "slug")),
        "held": ", ".join(f"{name} = {value:.9g}" for name, value in held.items()) or "nothing",
        "replaced": ", ".join(replaced(copy.source, copy.loaded)),
        "frame_late": ", ".join(late_properties(copy.source)) or "nothing",
        **_machinery(step_s),
    }
    return Mounted(simulator=simulator, surfaces=surfaces, provenance=provenance)


def _derive(aircraft: Aircraft, condition: Condition, folder: Path) -> _Copy:
    """Try the aircraft at the reference flight, write the rig's copy into ``folder``, and try that."""
    _check_condition(condition)
    source = read_source(aircraft.path)
    initial = {
        "ic/h-sl-ft": from_si(condition.altitude_m, "ft"),
        "ic/u-fps": from_si(condition.airspeed_m_s, "ft_s"),
    }
    density = from_si(condition.density_kg_m3, "slug_ft3")
    loaded = _try(aircraft.path, initial, density, (*MASS_PROPERTIES, _EMPTY, _MASS, *source.reads), what="it").values
    _check_mass(aircraft.path, loaded)
    native = native_properties(source.reads)
    constants = {name: loaded[name] for name in source.reads if name in loaded and name not in native}
    normal_force = loaded[_MASS] * from_si(condition.gravity_m_s2, "ft_s2")
    path = folder / f"{aircraft.name}.xml"
    path.write_text(rig_model(source, loaded, normal_force_lbs=normal_force, constants=constants), encoding="utf-8")
    _try(path, initial, density, (), what="the rig's copy of it")
    return _Copy(
        path=path,
        source=source,
        loaded=loaded,
        native=frozenset(native),
        constants=constants,
        initial=initial,
        density_slug_ft3=density,
    )


def _machinery(step_s: float) -> dict[str, str]:
    return {
        "fidelity": "rig",
        "step_s": repr(float(step_s)),
        "integrator": f"{INTEGRATOR} for rates and attitude, position frozen",
        "jsbsim": jsbsim_version(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _check_condition(condition: Condition) -> None:
    for name, value, low in (
        ("airspeed_m_s", condition.airspeed_m_s, 0.0),
        ("density_kg_m3", condition.density_kg_m3, 0.0),
        ("gravity_m_s2", condition.gravity_m_s2, -math.ulp(0.0)),
        ("altitude_m", condition.altitude_m, -math.inf),
    ):
        if not (math.isfinite(value) and value > low):
            raise InputError(f"the rig cannot hold {name} = {value}", hint="give a positive number")


def _try(path: Path, initial: Mapping[str, float], density: float, read: tuple[str, ...], *, what: str) -> Trial:
    trial = fly_trial(path, initial=initial, read=read, density_slug_ft3=density)
    if trial.faults:
        raise AircraftError(f"{path}: {what} cannot be flown: {'; '.join(trial.faults)}")
    return trial


def _check_mass(path: Path, loaded: Mapping[str, float]) -> None:
    """Check that forces and moments can move it at all: mass and pitch inertia are positive."""
    for what, key, value, unit in (
        ("empty weight", "emptywt", loaded[_EMPTY], "lbs"),
        ("weight", "emptywt", loaded[WEIGHT], "lbs"),
        ("pitch moment of inertia", "iyy", loaded[INERTIA[1]], "slug ft²"),
    ):
        if not (math.isfinite(value) and value > 0):
            raise AircraftError(
                f"{path}: its {what} is {value:.6g} {unit}, it must be positive", hint=f"mend <{key}> in <mass_balance>"
            )


def _check_copied(simulator: Simulator, copy: _Copy) -> None:
    """Check that the copy weighs, balances and turns like the original."""
    now = simulator.read(MASS_PROPERTIES)
    wanted = (copy.loaded[WEIGHT], *center_in(copy.loaded), *inertia_slug_ft2(copy.loaded))
    scale = max(abs(value) for value in wanted)
    for name, value in zip(MASS_PROPERTIES, wanted, strict=False):
        if abs(now[name] - value) > _SAME * max(abs(value), scale):
            raise AircraftError(
                f"{copy.source.root.get('name')}: the rig's copy has {name} {now[name]!r}, not {value!r}"
            )

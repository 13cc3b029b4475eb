"""Making an aircraft fly in a fidelity: try it, derive the copy, try that, load it, check that it is the same aircraft.

Both trials run in child processes. What passed them is loaded here, again for each other loading.
"""

from __future__ import annotations

import math
import platform
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import call
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.errors import AircraftError, FinbackError, InputError
from finback.flight.aircraft import Aircraft
from finback.flight.derivation import (
    CENTER,
    INERTIA,
    MASS_PROPERTIES,
    WEIGHT,
    Source,
    late_properties,
    read_source,
    symmetric_mass,
)
from finback.flight.derived_model import direct_model, original_model, replaced, rig_model
from finback.flight.loading import AS_LOADED, Loading
from finback.flight.simulator import INTEGRATOR, Simulator, jsbsim_version, native_properties
from finback.flight.table_axis import TableAxis, table_axes
from finback.flight.trial import Trial, fly_trial
from finback.records import Condition
from finback.units import from_si, to_si

_GEAR_POSITION: Final = "gear/gear-pos-norm"
_SURFACES: Final = ("fcs/", "gear/")  # that only the dropped flight control would move; the read-only ones follow these
_EMPTY: Final = "inertia/empty-weight-lbs"
_MASS: Final = "inertia/mass-slugs"
_SAME: Final = 1e-12  # relative; the copy's mass properties differ from the original's by rounding only
_WEIGHINGS: Final = 6  # two make tanks and body together what the aircraft is, the rest is rounding
_KEPT: Final = 2  # loaded copies kept at a time
_INCH_FT: Final = 12.0
_AREA: Final = "metrics/Sw-sqft"
_CHORD: Final = "metrics/cbarw-ft"
_REFERENCE_POINT: Final = ("metrics/aero-rp-x-in", "metrics/aero-rp-z-in")
_METRICS: Final = (_AREA, _CHORD, *_REFERENCE_POINT)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What a copy is derived for.

    Attributes:
        fidelity: ``rig``, ``symmetric`` or ``free``.
        direct: surfaces are driven directly, in place of the aircraft's flight control; always on the first two.
        step_s: integration step.
    """

    fidelity: str
    direct: bool
    step_s: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Copy:
    """A copy of an aircraft, tried.

    Attributes:
        path: its XML file.
        source: the original.
        loaded: what the original reads at the reference flight, in JSBSim's units.
        mass: ``MASS_PROPERTIES`` of it as the fidelity takes them.
        native: those of the properties read that JSBSim itself defines.
        constants: properties that only a dropped part defined -> their value.
        initial: property -> value at the start.
        density_slug_ft3: the density held; 0 for the standard atmosphere.
        gravity_ft_s2: of the reference flight.
    """

    path: Path
    source: Source
    loaded: Mapping[str, float]
    mass: Mapping[str, float]
    native: frozenset[str]
    constants: Mapping[str, float]
    initial: Mapping[str, float]
    density_slug_ft3: float
    gravity_ft_s2: float


def try_mounting(aircraft: Aircraft, condition: Condition, fidelity: str = "rig") -> tuple[str, ...]:
    """Derive an aircraft's copy, surfaces driven directly, and start both in child processes; return the fault found.

    Returns:
        No fault, or the one that ended it.
    """
    surroundings = Surroundings(fidelity=fidelity, direct=True, step_s=1.0)
    try:
        with tempfile.TemporaryDirectory(prefix="finback-copy-") as folder:
            _derive(aircraft, condition, surroundings, Path(folder))
    except FinbackError as error:
        return (str(error),)
    return ()


@final
class Mounting:
    """A tried copy of an aircraft, loaded in this process for any loading.

    Surfaces that only the dropped flight control moved stay where it puts them at the reference flight, at alpha 0
    with all commands neutral; the landing gear is up.

    Args:
        aircraft: the aircraft.
        condition: the reference flight.
        surroundings: what the copy is for.
        folder: where the derived copy is written.

    Attributes:
        surfaces: other surfaces -> position, in JSBSim's units; to be written after every reset.
        provenance: what the copy replaced and holds.

    Raises:
        AircraftError: the aircraft or its copy does not load without a warning.
        InputError: the condition cannot be held.
    """

    def __init__(self, aircraft: Aircraft, condition: Condition, surroundings: Surroundings, folder: Path) -> None:
        self._surroundings = surroundings
        self._copy = _derive(aircraft, condition, surroundings, folder)
        self._loaded: dict[Loading, Simulator] = {}
        self.surfaces: Mapping[str, float] = {}
        simulator = self.simulator(AS_LOADED)
        if surroundings.direct:
            self.surfaces = {
                name: 0.0 if name == _GEAR_POSITION else self._copy.loaded[name]
                for name in sorted(self._copy.native)
                if name.startswith(_SURFACES) and simulator.writable(name)
            }
            simulator.write(self.surfaces)
            simulator.start()
        self.provenance = self._provenance(aircraft)

    @property
    def mass(self) -> Mapping[str, float]:
        """``MASS_PROPERTIES`` of the aircraft as loaded, as the fidelity takes them."""
        return self._copy.mass

    @property
    def late(self) -> tuple[str, ...]:
        """What the copy's aerodynamics read that JSBSim gives a frame late."""
        return late_properties(self._copy.source)

    def _told_late(self, simulator: Simulator) -> tuple[str, ...]:
        """Return what depends on the frame before: an own flight control, which runs first, reads the air of that."""
        if self._surroundings.direct:
            return self.late
        return tuple(name for name in self._copy.source.reads if simulator.has(name))

    def tables(self, simulator: Simulator) -> tuple[tuple[TableAxis, ...], Callable[[], tuple[float, ...]]]:
        """Return what the tables of the copy's aerodynamics are looked up by, and what reads that in a simulator."""
        axes = tuple(axis for axis in table_axes(self._copy.source.aerodynamics) if simulator.has(axis.name))
        getters = tuple(simulator.getter(axis.name) for axis in axes)
        return axes, lambda: tuple(map(call, getters))

    def simulator(self, loading: Loading) -> Simulator:
        """Return JSBSim with the copy, so loaded, started once at the reference flight."""
        if loading not in self._loaded:
            for old in [known for known in self._loaded if known != AS_LOADED][: len(self._loaded) + 1 - _KEPT]:
                del self._loaded[old]
            self._loaded[loading] = self._load(loading)
        return self._loaded[loading]

    def forget(self, loading: Loading) -> None:
        """Load the copy anew when it is next asked for."""
        self._loaded.pop(loading, None)

    def _load(self, loading: Loading) -> Simulator:
        copy, total = self._copy, _loaded_otherwise(self._copy.mass, loading)

        def started(base: Mapping[str, float]) -> Simulator:
            copy.path.write_text(_model(copy, base, total, loading, direct=self._surroundings.direct), encoding="utf-8")
            freeze = copy.source.fidelity == "rig"
            simulator = Simulator(copy.path, step_s=self._surroundings.step_s, freeze_position=freeze)
            if copy.density_slug_ft3:
                simulator.override_density(copy.density_slug_ft3)  # before the first start; it outlives resets
            simulator.write({**copy.initial, **self.surfaces})
            simulator.start()
            simulator.settle(self._told_late(simulator))
            return simulator

        if loading == AS_LOADED and not self._surroundings.direct:
            return started(total)  # its mass balance is its own
        return _balanced(started, total, copy.source)

    def _provenance(self, aircraft: Aircraft) -> dict[str, str]:
        copy, surroundings = self._copy, self._surroundings
        held = {**copy.constants, **self.surfaces}
        original = not surroundings.direct
        return {
            "aircraft": aircraft.name,
            "aircraft_sha256": aircraft.sha256,
            **_airframe(copy),
            "held": ", ".join(f"{name} = {value:.9g}" for name, value in held.items()) or "nothing",
            "replaced": ", ".join(replaced(copy.source, copy.loaded, copy.mass, original=original)) or "nothing",
            "frame_late": ", ".join(self.late) or "nothing",
            **_machinery(surroundings),
        }


def _derive(aircraft: Aircraft, condition: Condition, surroundings: Surroundings, folder: Path) -> _Copy:
    """Try the aircraft at the reference flight, write its copy below ``folder``, and try that."""
    check_condition(condition)
    fidelity = surroundings.fidelity
    source = read_source(aircraft.path, fidelity)
    initial = {
        "ic/h-sl-ft": from_si(condition.altitude_m, "ft"),
        "ic/u-fps": from_si(condition.airspeed_m_s, "ft_s"),
    }
    density = from_si(condition.density_kg_m3, "slug_ft3") if fidelity == "rig" else 0.0
    read = (*MASS_PROPERTIES, *_METRICS, _EMPTY, _MASS, *source.reads)
    loaded = _try(aircraft.path, initial, density, read, what="it", place=aircraft.path).values
    _check_mass(aircraft.path, loaded)
    native = native_properties(source.reads)
    # Engines and tanks define properties of their own; where they are kept these are no constants.
    of_engines = () if not source.powered else ("propulsion/", "forces/", "moments/")
    foreign = (name for name in source.reads if name in loaded and name not in native)
    constants = {name: loaded[name] for name in foreign if not name.startswith(of_engines)}
    copy = _Copy(
        path=_shelf(aircraft.path, folder) / f"{aircraft.name}.xml",
        source=source,
        loaded=loaded,
        mass={name: loaded[name] for name in MASS_PROPERTIES} if fidelity == "free" else symmetric_mass(loaded),
        native=native,
        constants=constants,
        initial=initial,
        density_slug_ft3=density,
        gravity_ft_s2=from_si(condition.gravity_m_s2, "ft_s2"),
    )
    copy.path.write_text(_model(copy, copy.mass, copy.mass, AS_LOADED, direct=surroundings.direct), encoding="utf-8")
    _try(copy.path, initial, density, (), what=f"the copy of it for {fidelity}", place=aircraft.path)
    return copy


def _shelf(original: Path, folder: Path) -> Path:
    """Return a folder where JSBSim finds what lies beside the original: engines, systems, included files."""
    shelf = folder / "aircraft" / original.parent.name
    shelf.mkdir(parents=True)
    for entry in original.parent.iterdir():
        if entry.name != original.name:
            (shelf / entry.name).symlink_to(entry.resolve())
    for name in ("engine", "systems"):
        shared = original.resolve().parent.parent.parent / name
        if shared.is_dir():
            (folder / name).symlink_to(shared)
    return shelf


def _model(
    copy: _Copy, base: Mapping[str, float], total: Mapping[str, float], loading: Loading, *, direct: bool
) -> str:
    if copy.source.fidelity == "rig":
        force = copy.loaded[_MASS] * copy.gravity_ft_s2 * loading.mass_ratio
        return rig_model(copy.source, base, normal_force_lbs=force, constants=copy.constants)
    if direct:
        return direct_model(copy.source, base, total, constants=copy.constants)
    return original_model(copy.source, total, () if loading == AS_LOADED else (base,))


def _loaded_otherwise(mass: Mapping[str, float], loading: Loading) -> dict[str, float]:
    total = dict(mass)
    total[WEIGHT] *= loading.mass_ratio
    for name in INERTIA:
        total[name] *= loading.inertia_ratio
    total[CENTER[0]] += _INCH_FT * from_si(loading.center_aft_m, "ft")
    total[CENTER[2]] += _INCH_FT * from_si(loading.center_up_m, "ft")
    return total


def _balanced(
    started: Callable[[Mapping[str, float]], Simulator], total: Mapping[str, float], source: Source
) -> Simulator:
    """Return the copy whose body is such that, with what its tanks hold, it weighs, balances and turns as it should.

    Weight and first moment are linear in the body's; the inertia is, once the center of gravity is right.
    """
    base = {name: total[name] for name in (WEIGHT, *CENTER, *INERTIA)}
    scale = max(abs(value) for value in base.values())
    for _ in range(_WEIGHINGS):
        simulator = started(base)
        now = simulator.read(base)
        if all(abs(now[name] - total[name]) <= _SAME * max(abs(total[name]), scale) for name in base):
            return simulator
        weight = base[WEIGHT] + total[WEIGHT] - now[WEIGHT]
        if not weight > 0:
            raise AircraftError(
                f"{source.path}: its tanks alone weigh {now[WEIGHT] - base[WEIGHT]:.6g} lbs, the loading asks for"
                f" {total[WEIGHT]:.6g} lbs in all"
            )
        for name in CENTER:
            moment = base[WEIGHT] * base[name] + total[WEIGHT] * total[name] - now[WEIGHT] * now[name]
            base[name] = moment / weight
        for name in INERTIA:
            base[name] += total[name] - now[name]
        base[WEIGHT] = weight
    odd = ", ".join(f"{name} {now[name]!r} for {total[name]!r}" for name in base if now[name] != total[name])
    raise AircraftError(f"{source.path}: its copy for {source.fidelity} cannot be loaded as it should be: {odd}")


def _airframe(copy: _Copy) -> dict[str, str]:
    """Return what turns forces into motion, as ``[airframe]`` of ``finback coefficients`` calls it.

    Of the structural frame x is aft and z up; the reference point is told forward of and below the center of gravity.
    """
    loaded = copy.loaded
    x, z = (
        to_si((loaded[center] - loaded[point]) / _INCH_FT, "ft")
        for center, point in zip((CENTER[0], CENTER[2]), _REFERENCE_POINT, strict=True)
    )
    numbers = {
        "mass_kg": to_si(loaded[_MASS], "slug"),
        "pitch_inertia_kg_m2": to_si(loaded[INERTIA[1]], "slug_ft2"),
        "wing_area_m2": to_si(loaded[_AREA], "ft2"),
        "chord_m": to_si(loaded[_CHORD], "ft"),
        "reference_x_m": x + 0.0,
        "reference_z_m": z + 0.0,
    }
    return {name: repr(value) for name, value in numbers.items()}


def _machinery(surroundings: Surroundings) -> dict[str, str]:
    frozen = ", position frozen" if surroundings.fidelity == "rig" else " and position"
    return {
        "fidelity": surroundings.fidelity,
        "step_s": repr(float(surroundings.step_s)),
        "integrator": f"{INTEGRATOR} for rates and attitude{frozen}",
        "jsbsim": jsbsim_version(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def check_condition(condition: Condition) -> None:
    """Raise InputError unless an aircraft can fly there."""
    for name, value, low in (
        ("airspeed_m_s", condition.airspeed_m_s, 0.0),
        ("density_kg_m3", condition.density_kg_m3, 0.0),
        ("gravity_m_s2", condition.gravity_m_s2, -math.ulp(0.0)),
        ("altitude_m", condition.altitude_m, -math.inf),
    ):
        if not (math.isfinite(value) and value > low):
            raise InputError(f"no reference flight has {name} = {value}", hint="give a positive number")


def _try(
    path: Path, initial: Mapping[str, float], density: float, read: tuple[str, ...], *, what: str, place: Path
) -> Trial:
    trial = fly_trial(path, initial=initial, read=read, density_slug_ft3=density)
    if trial.faults:
        raise AircraftError(f"{place}: {what} cannot be flown: {'; '.join(trial.faults)}")
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

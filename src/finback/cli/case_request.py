"""What ``finback fly`` is asked, read into a case, and what it answers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.cli import terminal
from finback.cli.numbers import display_unit, plain, shown, written
from finback.digits import decimals
from finback.errors import InputError
from finback.flight.aircraft import find_aircraft
from finback.flight.case import Attitude, Case, CaseEngine, FlownCase, is_script
from finback.flight.case_column import CaseColumn
from finback.flight.case_drive import Drive, named_drive
from finback.flight.case_start import case_start
from finback.flight.case_wind import WindProfile
from finback.formats.text_table import read_text_table
from finback.records import Hold
from finback.study.schedules import read_schedules
from finback.units import quantity_of, si_unit, to_si, unit_named, unit_of

_STEP_HZ: Final = 400.0
_TIME: Final = "time_s"
_WIND_COLUMNS: Final = {"altitude": "m", "wind_north": "m_s", "wind_east": "m_s"}
_NOISE: Final = 1e-12  # of the greatest value, or of 1 in SI: what rounding leaves of a zero
_SHOWN: Final = ("altitude_m", "airspeed_m_s", "alpha_rad", "beta_rad", "phi_rad", "theta_rad", "q_rad_s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRequest:
    """The options of ``finback fly`` as they were typed; 0 and empty for what was not given."""

    source: str
    initial: Sequence[str]
    settings: Sequence[str]
    schedules: Sequence[str]
    records: Sequence[str]
    duration_s: float
    step_hz: float
    sample_hz: float
    planet: Path | None
    attitude: str
    hold: str
    winds: Sequence[str]
    engines: str = "as-loaded"

    def case(self) -> Case:
        """Return the case that the options describe.

        Raises:
            InputError: an option cannot be read; it is named.
            AircraftError: there is no such aircraft or script.
        """
        path = Path(self.source)
        if path.suffix == ".xml" and path.is_file():
            path = path.resolve()
        else:
            path = find_aircraft(self.source, near=Path.cwd()).path
        if self.attitude not in set(Attitude):
            raise InputError(f"--attitude {self.attitude}", hint=f"one of: {', '.join(Attitude)}")
        if self.engines not in set(CaseEngine):
            raise InputError(f"--engines {self.engines}", hint=f"one of: {', '.join(CaseEngine)}")
        if len(self.winds) > 1:
            raise InputError(f"--wind names {len(self.winds)} files: {', '.join(self.winds)}", hint="name one")
        rates = (("--duration", self.duration_s), ("--step-hz", self.step_hz), ("--sample-hz", self.sample_hz))
        for name, value in rates:
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name} is {value}, expected a number > 0")
        step = self.step_hz or (0.0 if is_script(path) else _STEP_HZ)
        given = [_named_number("--ic", text) for text in self.initial if "=" in text]
        raw = [(name, value) for name, value in given if "/" in name]  # properties of JSBSim, in their own units
        if twice := [name for name, _ in raw if [other for other, _ in raw].count(name) > 1]:
            raise InputError(f"'{twice[0]}' is given twice")
        return Case(
            source=path,
            settings=(*(_named_number("--set", text) for text in self.settings), *raw),
            start=case_start([(name, value) for name, value in given if "/" not in name]),
            initial_file=self._initial_file(path.parent),
            planet_file=_existing(str(self.planet), "--planet") if self.planet is not None else "",
            drives=self._drives(),
            wind=tuple(_wind(Path(file)) for file in self.winds),
            duration_s=self.duration_s,
            step_s=1.0 / step if step else 0.0,
            sample_interval_s=1.0 / self.sample_hz if self.sample_hz else 0.0,
            attitude=Attitude(self.attitude),
            columns=tuple(_column(text) for text in self.records),
            engines=CaseEngine(self.engines),
        )

    def _drives(self) -> tuple[Drive, ...]:
        if self.hold not in {Hold.FOH, Hold.ZOH}:
            raise InputError(f"--hold {self.hold}", hint="one of: foh, zoh")
        hold = Hold(self.hold)
        found = [
            drive
            for text in self.schedules
            for drive in (_drives_of_text(text, hold) if "=" in text else _drives_of_file(Path(text), hold))
        ]
        names = [drive.jsbsim_property for drive in found]
        if twice := [name for name in names if names.count(name) > 1]:
            raise InputError(f"'{twice[0]}' has two schedules", hint="give it one")
        return tuple(found)

    def _initial_file(self, folder: Path) -> str:
        """Return the initialization file: as it is named, or of the aircraft's folder, as JSBSim names its own."""
        files = [text for text in self.initial if "=" not in text]
        if len(files) > 1:
            raise InputError(f"--ic names {len(files)} files: {', '.join(files)}", hint="name one")
        if not files:
            return ""
        own = [folder / files[0], folder / f"{files[0]}.xml"]
        return next((str(path) for path in own if not Path(files[0]).is_file() and path.is_file()), "") or _existing(
            files[0], "--ic"
        )


def _existing(file: str, option: str) -> str:
    if not Path(file).is_file():
        raise InputError(f"{option} {file}: there is no such file", hint="--ic NAME=VALUE gives a single value")
    return file


def _named_number(option: str, text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise InputError(f"{option} {text}: '{value}' is no number", hint=f"{option} NAME=VALUE") from None


def _drives_of_file(path: Path, hold: Hold) -> list[Drive]:
    if path.suffix == ".toml":
        return list(read_schedules(path))
    table = read_text_table(path)
    time = table.numbers(_TIME)
    return [named_drive(name, time, table.numbers(name), hold) for name in table.cells if name != _TIME]


def _drives_of_text(text: str, hold: Hold) -> list[Drive]:
    """Return the schedules of ``NAME=T:V,T:V,NAME=T:V``: a point that has a name begins the next one."""
    points: dict[str, list[tuple[float, ...]]] = {}
    name = ""
    try:
        for piece in text.split(","):
            before, equals, point = piece.rpartition("=")
            if equals:
                name = before.strip()
                if name in points:
                    raise InputError(f"--schedule {text}: '{name}' is given twice")
            time, value = point.split(":")
            points.setdefault(name, []).append((float(time), float(value)))
    except ValueError:
        raise InputError(
            f"--schedule {text}: cannot be read",
            hint="NAME=TIME:VALUE,TIME:VALUE (NAME: elevator, throttle … or a property), or FILE.csv or FILE.toml",
        ) from None
    return [
        named_drive(name, np.array([time for time, _ in pairs]), np.array([value for _, value in pairs]), hold)
        for name, pairs in points.items()
    ]


def _wind(path: Path) -> WindProfile:
    table = read_text_table(path)
    found: dict[str, FloatArray] = {}
    for name in table.cells:
        quantity = quantity_of(name)
        expected = _WIND_COLUMNS.get(quantity, "")
        if not expected or si_unit(unit_of(name)) != expected:
            raise InputError(
                f"{path}: column '{name}' is no part of a wind", hint="altitude_ft, wind_north_ft_s and wind_east_ft_s"
            )
        found[quantity] = to_si(table.numbers(name), unit_of(name))
    if "altitude" not in found:
        raise InputError(f"{path}: a wind needs a column of altitude", hint="as in 'altitude_ft'")
    still = np.zeros(found["altitude"].size)
    return WindProfile(
        altitude_m=found["altitude"],
        north_m_s=found.get("wind_north", still),
        east_m_s=found.get("wind_east", still),
    )


def _column(text: str) -> CaseColumn:
    place, _, name = text.partition("=")
    place, _, unit = place.rpartition(":")
    if not (place and unit and name):
        raise InputError(f"--record {text}: cannot be read", hint="PROPERTY:UNIT=NAME, as in aero/alpha-deg:deg=a_rad")
    return CaseColumn(name=name.strip(), jsbsim_property=place.strip(), jsbsim_unit=unit_named(unit))


def show(flown: FlownCase, paths: Sequence[Path]) -> None:
    """Print how it ended, the state at both ends, and the files."""
    console = terminal.open_console()
    terminal.print_line(console, f"outcome  {flown.outcome.value}: {flown.note}")
    checked = bool(flown.step_error)
    table = terminal.new_table("", "unit", "start", "end", "least", "greatest", *(["step error"] if checked else []))
    for name in _SHOWN:
        if name in flown.columns:
            unit, values = unit_of(name), flown.columns[name]
            error = flown.step_error.get(name, 0.0)
            noise = _NOISE * max(1.0, float(np.abs(values).max()))
            cells = [_cell(values[0], 0.0, noise, unit)]  # the start is none of the step's
            cells += [_cell(x, error, noise, unit) for x in (values[-1], values.min(), values.max())]
            table.add_row(
                name.removesuffix(f"_{unit}"),
                written(display_unit(unit)),
                *cells,
                *([f"{shown(flown.step_error[name], unit):.1e}"] if checked else []),
            )
    terminal.print_table(console, table)
    if "step_check" in flown.provenance:
        terminal.print_line(console, f"step     {flown.provenance['step_check']}")
    for path in paths:
        terminal.print_line(console, f"file     {path}")


def _cell(value: float, error: float, noise: float, unit: str) -> str:
    """Write an SI value in the unit of people: nothing beyond two digits of its error, 0 for what is only rounding."""
    if abs(value) < max(noise, error if math.isfinite(error) else 0.0):
        return "0"
    spread = shown(error, unit)
    known = 0.0 < spread < math.inf and math.isfinite(value)
    return plain(round(shown(float(value), unit), decimals(spread)) if known else shown(float(value), unit))

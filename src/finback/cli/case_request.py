"""What ``finback fly`` is asked, read into a case, and what it answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.cli import terminal
from finback.cli.numbers import display_unit, plain, shown, written
from finback.errors import InputError
from finback.flight.aircraft import find_aircraft
from finback.flight.case import Attitude, Case, Drive, FlownCase, is_script
from finback.flight.case_column import CaseColumn
from finback.flight.case_start import start_settings
from finback.formats.text_table import read_text_table
from finback.units import unit_of

_STEP_HZ: Final = 400.0
_TIME: Final = "time_s"
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
        rates = (("--duration", self.duration_s), ("--step-hz", self.step_hz), ("--sample-hz", self.sample_hz))
        for name, value in rates:
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name} is {value}, expected a number > 0")
        step = self.step_hz or (0.0 if is_script(path) else _STEP_HZ)
        starts = start_settings([_named_number("--ic", text) for text in self.initial if "=" in text])
        return Case(
            source=path,
            settings=(*(_named_number("--set", text) for text in self.settings), *starts),
            initial_file=self._initial_file(),
            planet_file=_existing(str(self.planet), "--planet") if self.planet is not None else "",
            drives=tuple(drive for text in self.schedules for drive in _drives(text)),
            duration_s=self.duration_s,
            step_s=1.0 / step if step else 0.0,
            sample_interval_s=1.0 / self.sample_hz if self.sample_hz else 0.0,
            attitude=Attitude(self.attitude),
            columns=tuple(_column(text) for text in self.records),
        )

    def _initial_file(self) -> str:
        files = [text for text in self.initial if "=" not in text]
        if len(files) > 1:
            raise InputError(f"--ic names {len(files)} files: {', '.join(files)}", hint="name one")
        return _existing(files[0], "--ic") if files else ""


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


def _drives(text: str) -> list[Drive]:
    if "=" not in text:
        table = read_text_table(Path(text))
        time = table.numbers(_TIME)
        return [
            Drive(jsbsim_property=name, time_s=time, values=table.numbers(name))
            for name in table.cells
            if name != _TIME
        ]
    name, _, points = text.partition("=")
    try:
        pairs = [tuple(map(float, point.split(":"))) for point in points.split(",")]
        times, values = zip(*pairs, strict=True)
    except ValueError:
        raise InputError(
            f"--schedule {text}: cannot be read", hint="PROPERTY=TIME:VALUE,TIME:VALUE or FILE.csv with 'time_s'"
        ) from None
    return [Drive(jsbsim_property=name.strip(), time_s=np.array(times), values=np.array(values))]


def _column(text: str) -> CaseColumn:
    place, _, name = text.partition("=")
    place, _, unit = place.rpartition(":")
    if not (place and unit and name):
        raise InputError(f"--record {text}: cannot be read", hint="PROPERTY:UNIT=NAME, as in aero/alpha-deg:deg=a_rad")
    return CaseColumn(name=name.strip(), jsbsim_property=place.strip(), jsbsim_unit=unit.strip())


def show(flown: FlownCase, paths: Sequence[Path]) -> None:
    """Print how it ended, the state at both ends, and the files."""
    console = terminal.open_console()
    terminal.print_line(console, f"outcome  {flown.outcome.value}: {flown.note}")
    table = terminal.new_table("", "unit", "start", "end", "least", "greatest")
    for name in _SHOWN:
        if name in flown.columns:
            unit, values = unit_of(name), flown.columns[name]
            cells = (values[0], values[-1], values.min(), values.max())
            table.add_row(
                name.removesuffix(f"_{unit}"),
                written(display_unit(unit)),
                *(plain(shown(float(x), unit)) for x in cells),
            )
    terminal.print_table(console, table)
    for path in paths:
        terminal.print_line(console, f"file     {path}")

"""A script of JSBSim: what it flies, from when to when, and its text as it is given to JSBSim."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError, InputError
from finback.flight.quiet_copy import quiet_text

_RUN: Final = re.compile(rb"<run(?=[\s/>])")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Script:
    """A script, read.

    Attributes:
        aircraft: the name of the aircraft that it uses.
        start_s: time at which it begins.
        end_s: time at which it ends; infinite if it does not say.
        content: its text without inputs and outputs, with an end.
        left_out: the inputs and outputs that are not in it any more.
    """

    aircraft: str
    start_s: float
    end_s: float
    content: bytes
    left_out: tuple[str, ...]


def read_script(path: Path, *, stand_in: str) -> Script:
    """Read a script.

    Args:
        path: of its XML.
        stand_in: what takes the place of each output (``quiet_text``).

    Raises:
        AircraftError: it cannot be read, or uses no aircraft.
        InputError: its times are no numbers, or end before they begin.
    """
    text = quiet_text(path, stand_in=stand_in)
    root = ET.fromstring(text.content)  # noqa: S314 - JSBSim itself will read the file
    used, run = root.find("use"), root.find("run")
    aircraft = "" if used is None else used.get("aircraft", "").strip()
    if not aircraft:
        raise AircraftError(f"{path}: the script uses no aircraft", hint='<use aircraft="…" initialize="…"/> names it')
    if run is None:
        raise AircraftError(f"{path}: the script has no element 'run'", hint='as in <run start="0" end="10" dt="0.01">')
    said = next((name for name in ("end", "duration") if name in run.attrib), "")
    start = _time(path, run, "start") if "start" in run.attrib else 0.0
    end = _time(path, run, said) if said else math.inf
    if end <= start:
        raise InputError(f"{path}: the script begins at {start:.9g} s and ends at {end:.9g} s")
    content = text.content
    if not said:  # JSBSim wants one; whoever flies it says how long
        content = _RUN.sub(b'<run end="1e99"', content, count=1)
    return Script(aircraft=aircraft, start_s=start, end_s=end, content=content, left_out=text.left_out)


def _time(path: Path, run: ET.Element, name: str) -> float:
    try:
        value = float(run.attrib[name])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}: run: {name} is '{run.attrib[name]}', expected a number of seconds")
    return value

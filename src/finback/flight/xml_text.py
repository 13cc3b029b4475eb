"""An aircraft's XML as elements: reading files, and who reads and defines which property."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from finback.errors import AircraftError


def parse(path: Path) -> ET.Element:
    """Return the root of a file.

    Raises:
        AircraftError: it cannot be read, or is malformed (with line and column).
    """
    try:
        return ET.parse(path).getroot()  # noqa: S314 - the user's own aircraft, which JSBSim will read as well
    except ET.ParseError as error:
        raise AircraftError(f"{path}: malformed XML: {error}") from None
    except OSError as error:
        raise AircraftError(f"{path}: cannot be read: {error.strerror}") from None


def included(element: ET.Element, folder: Path) -> ET.Element:
    """Return the element, or the root of the file that it names by its attribute ``file``, relative to the folder."""
    if "file" not in element.attrib:
        return element
    file = folder / element.attrib["file"]
    return parse(file if file.suffix == ".xml" else file.with_name(f"{file.name}.xml"))


def child(parent: ET.Element, tag: str, text: str = "", **attributes: str) -> ET.Element:
    """Add an element and return it."""
    added = ET.SubElement(parent, tag, attributes)
    added.text = text or None
    return added


def name_of(element: ET.Element) -> str:
    """Return the property that an element reads, without its sign."""
    return (element.text or "").strip().removeprefix("-")


def readers(element: ET.Element) -> list[ET.Element]:
    """Return the parts that read a property."""
    return [part for tag in ("property", "p", "independentVar") for part in element.iter(tag)]


def reads(element: ET.Element) -> set[str]:
    """Return the properties that an element and its parts read."""
    return {name_of(part) for part in readers(element)}


def defined(element: ET.Element) -> set[str]:
    """Return the properties that functions and tables below an element define."""
    return {part.get("name", "") for tag in ("function", "table") for part in element.iter(tag)} - {""}

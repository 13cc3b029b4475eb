"""Aircraft and scripts without the elements by which JSBSim opens files and sockets of its own.

JSBSim creates the files that ``<output>`` names when it loads or starts a model, switched off or not, and listens or
connects to the sockets of ``<input>`` and ``<output>``. Whoever flies here is asked what to write where, so these
elements are taken out of a copy before JSBSim sees them. Line numbers stay: JSBSim's messages name them.
"""

from __future__ import annotations

import codecs
import re
import tempfile
import xml.parsers.expat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError

_SPEAKING: Final = ("input", "output")
_DEPTH: Final = 2  # of these elements: children of the root
_TOLD: Final = ("name", "file", "type", "port", "protocol")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class QuietText:
    """The text of a file without its inputs and outputs.

    Attributes:
        content: as bytes, in an encoding that XML knows; as many lines as before.
        left_out: what was taken out, as it stood there, shortened; empty if there was nothing.
    """

    content: bytes
    left_out: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class QuietAircraft:
    """An aircraft that opens nothing.

    Attributes:
        path: of its XML, the original if that opens nothing.
        left_out: as in ``QuietText``.
    """

    path: Path
    left_out: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """An element: its tag, what to say of it, and its bytes ``[start, end)``."""

    tag: str
    said: str
    start: int
    end: int


def quiet_text(path: Path, *, stand_in: str = "") -> QuietText:
    """Read an XML file and take its inputs and outputs out.

    Args:
        path: of an aircraft or a script.
        stand_in: what is put in the place of each output, such as one that writes where nobody minds; ``{}`` in it is
            the output's number.

    Raises:
        AircraftError: it cannot be read as XML.
    """
    try:
        content = _plain(path.read_bytes())
        found = _speaking(content)
    except (OSError, UnicodeError, xml.parsers.expat.ExpatError) as error:
        raise AircraftError(f"{path}: cannot be read as XML: {error}") from None
    pieces, done, outputs = [], 0, 0
    for one in found:
        taken = content[one.start : one.end]
        put = b""
        if one.tag == "output":
            put = stand_in.replace("{}", str(outputs)).encode()
            outputs += 1
        pieces += [content[done : one.start], put, b"\n" * taken.count(b"\n")]
        done = one.end
    return QuietText(content=b"".join([*pieces, content[done:]]), left_out=tuple(one.said for one in found))


def _plain(content: bytes) -> bytes:
    """Return text of 16 bits a letter as UTF-8; other encodings write ``<`` and line ends as ASCII does."""
    if not content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content
    return re.sub(r"(<\?xml[^>]*?)\s+encoding=(\"[^\"]*\"|'[^']*')", r"\1", content.decode("utf-16"), count=1).encode()


def _refuse(name: str, *_: object) -> None:
    """Refuse what stands for other text: it may be anything, and JSBSim would put it in."""
    raise UnicodeError(f"it declares the entity '{name}'")


def _speaking(content: bytes) -> list[_Found]:
    """Return the inputs and outputs among the children of the root, in the order of the file."""
    parser = xml.parsers.expat.ParserCreate()
    found: list[_Found] = []
    depth = 0
    begun: tuple[str, str, int] | None = None  # of the element that is read: tag, what is said of it, first byte
    ended = False  # whether that element has ended, and whatever comes next shows where

    def here() -> None:
        nonlocal begun, ended
        if begun is not None and ended:
            found.append(_Found(tag=begun[0], said=begun[1], start=begun[2], end=parser.CurrentByteIndex))
            begun, ended = None, False

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, begun
        here()
        depth += 1
        if depth == _DEPTH and tag in _SPEAKING:
            told = "".join(f' {name}="{attributes[name]}"' for name in _TOLD if name in attributes)
            begun = (tag, f"<{tag}{told}>", parser.CurrentByteIndex)

    def end(_: str) -> None:
        nonlocal depth, ended
        here()
        ended = begun is not None and depth == _DEPTH
        depth -= 1

    def other(_: str) -> None:
        here()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = parser.DefaultHandler = other
    parser.EntityDeclHandler = _refuse
    parser.Parse(content, True)
    return found


@contextmanager
def quiet_aircraft(path: Path, *, stand_in: str = "") -> Iterator[QuietAircraft]:
    """Give an aircraft that opens nothing, for as long as JSBSim needs to load it.

    What lies beside the aircraft's file is found beside the copy's, and two folders up as well: ``engine``, ``systems``
    and other aircraft.

    Args:
        path: of its XML.
        stand_in: as in ``quiet_text``.

    Raises:
        AircraftError: it cannot be read as XML.
    """
    text = quiet_text(path, stand_in=stand_in)
    if not text.left_out:
        yield QuietAircraft(path=path, left_out=())
        return
    own = path.resolve()
    with tempfile.TemporaryDirectory(prefix="finback-quiet-") as folder:
        place = Path(folder).resolve()
        above, around = own.parent.parent.name or "around", own.parent.name or "own"  # nameless: the file system's root
        for beside, kept in ((own.parent.parent.parent, above), (own.parent.parent, around)):
            _link_all(beside, place, but=kept)
            place /= kept
            place.mkdir()
        _link_all(own.parent, place, but=own.name)
        copy = place / path.name
        copy.write_bytes(text.content)
        yield QuietAircraft(path=copy, left_out=text.left_out)


def _link_all(folder: Path, place: Path, *, but: str) -> None:
    """Put links to everything of a folder, except one name, into another one."""
    try:
        entries = list(folder.iterdir())
    except OSError:  # a folder above that may not be read: nothing of it can be meant
        return
    for entry in entries:
        if entry.name != but:
            (place / entry.name).symlink_to(entry)

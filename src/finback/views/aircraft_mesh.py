"""A slender delta-wing jet made of triangles, so that an attitude can be seen. It is drawn, never measured.

Body axes: x forward, y right, z down, origin at the center of gravity, meters. The proportions are those of a
two-engine interceptor with a 60 deg delta wing and a low all-moving tail; no result depends on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array

Rgb = tuple[int, int, int]
Point = tuple[float, float, float]

_SKIN: Final[Rgb] = (190, 198, 208)
_WING: Final[Rgb] = (166, 176, 190)
_GLASS: Final[Rgb] = (62, 92, 128)
_METAL: Final[Rgb] = (72, 74, 80)
_INTAKE: Final[Rgb] = (40, 42, 46)
_TAIL: Final[Rgb] = (230, 159, 0)  # the color of the elevator's curve, so that the eye connects the two
_RING: Final = 24  # points around a body; finer cannot be seen
# Rings of a body, front to back: x, half width, half height, z of the center, all in m.
_FUSELAGE: Final = (
    (10.9, 0.02, 0.02, 0.25),
    (9.8, 0.26, 0.26, 0.2),
    (8.6, 0.47, 0.48, 0.13),
    (7.2, 0.66, 0.7, 0.05),
    (5.6, 0.78, 0.9, 0.0),
    (3.6, 0.84, 0.98, 0.0),
    (1.0, 1.0, 1.0, 0.0),
    (-3.0, 1.15, 0.95, 0.0),
    (-6.5, 1.18, 0.85, 0.0),
    (-9.0, 1.12, 0.7, 0.0),
)
_CANOPY: Final = (
    (7.3, 0.02, 0.02, -0.6),
    (6.4, 0.34, 0.4, -0.72),
    (5.2, 0.4, 0.5, -0.82),
    (3.8, 0.36, 0.42, -0.78),
    (2.4, 0.05, 0.05, -0.85),
)
_INTAKE_DUCT: Final = ((4.1, 0.3, 0.72, 0.0), (2.0, 0.42, 0.8, 0.0), (-2.0, 0.4, 0.74, 0.0), (-6.0, 0.2, 0.4, 0.0))
_NOZZLE: Final = ((-8.6, 0.56, 0.6, 0.0), (-9.6, 0.53, 0.53, 0.0), (-10.4, 0.44, 0.44, 0.0))

TAIL_HINGE: Final[Point] = (-8.3, 0.0, 0.25)
"""Where the all-moving tail turns, body axes, m."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Triangles with normals and colors.

    Attributes:
        positions: corners, shape (n, 3), body axes, m.
        normals: unit outward normal at each corner, shape (n, 3).
        triangles: three rows of ``positions`` each, shape (m, 3), counterclockwise seen from outside.
        colors: red, green, blue (0..255) of each corner, shape (n, 3).
    """

    positions: FloatArray
    normals: FloatArray
    triangles: IntArray
    colors: IntArray


def aircraft_mesh() -> Mesh:
    """Return the aircraft without its all-moving tail."""
    fuselage, canopy = _body(_FUSELAGE, _SKIN), _body(_CANOPY, _GLASS)
    sides = [_side_parts(side) for side in (1.0, -1.0)]
    fin = _panel(((-3.0, 0, -0.8), (-9.3, 0, -0.65)), ((-8.0, 0, -3.9), (-9.9, 0, -3.9)), 0.05, _WING)
    ventral = _panel(((-5.4, 0, 0.75), (-8.9, 0, 0.65)), ((-7.0, 0, 1.75), (-8.9, 0, 1.65)), 0.05, _WING)
    return _joined([fuselage, canopy, fin, ventral, *(part for parts in sides for part in parts)])


def tail_mesh() -> Mesh:
    """Return the all-moving tail at zero deflection, relative to ``TAIL_HINGE``."""
    halves = []
    for side in (1.0, -1.0):
        root = ((1.6, 1.05 * side, 0.0), (-1.2, 1.05 * side, 0.0))
        tip = ((-1.3, 3.5 * side, 0.0), (-1.95, 3.5 * side, 0.0))
        halves.append(_panel(root, tip, 0.05, _TAIL))
    return _joined(halves)


def _side_parts(side: float) -> list[Mesh]:
    """Return wing, intake and nozzle of one side: +1 right, -1 left."""
    root = ((2.6, 0.9 * side, 0.15), (-4.6, 0.9 * side, 0.15))
    tip = ((-4.05, 4.7 * side, 0.28), (-4.6, 4.7 * side, 0.28))
    wing = _panel(root, tip, 0.035, _WING)
    intake = _body(_INTAKE_DUCT, _SKIN, center_y=0.98 * side, exponent=5.0, front=_INTAKE)
    nozzle = _body(_NOZZLE, _METAL, center_y=0.56 * side, back=_INTAKE)
    return [wing, intake, nozzle]


def _body(
    stations: Sequence[tuple[float, float, float, float]],
    color: Rgb,
    *,
    center_y: float = 0.0,
    exponent: float = 2.0,
    front: Rgb | None = None,
    back: Rgb | None = None,
) -> Mesh:
    """Loft rings (x, half width, half height, center z), front to back, with smooth normals and flat ends."""
    angle = np.linspace(0.0, 2.0 * np.pi, _RING, endpoint=False)
    # Rounded, because the root of a zero that is 1e-16 is not nearly zero.
    across, down = (np.sign(x) * np.abs(x) ** (2.0 / exponent) for x in np.round([np.cos(angle), np.sin(angle)], 12))
    rings = np.array(
        [
            np.column_stack([np.full(_RING, x), center_y + width * across, z + height * down])
            for x, width, height, z in stations
        ]
    )
    here = np.arange(_RING)
    there = (here + 1) % _RING
    faces = []
    for row in range(len(stations) - 1):
        near, far = row * _RING, (row + 1) * _RING
        faces += [np.column_stack([near + here, far + here, near + there])]
        faces += [np.column_stack([near + there, far + here, far + there])]
    triangles = np.vstack(faces)
    positions = rings.reshape(-1, 3)
    side = _mesh(positions, _smooth_normals(positions, triangles), triangles, color)
    fan = np.column_stack([np.zeros(_RING - 2, dtype=np.int64), here[1:-1], here[2:]])
    ends = []
    for ring, corners, forward, tint in ((rings[0], fan, 1.0, front), (rings[-1], fan[:, ::-1], -1.0, back)):
        ends.append(_mesh(ring, np.tile([forward, 0.0, 0.0], (_RING, 1)), corners, tint or color))
    return _joined([side, *ends])


def _panel(root: tuple[Point, Point], tip: tuple[Point, Point], thickness: float, color: Rgb) -> Mesh:
    """Return a thin double wedge between a root and a tip chord (each leading edge, trailing edge); flat faces.

    ``thickness`` is relative to the chord.
    """
    sections = []
    span = np.subtract(tip[0], root[0])
    for leading, trailing in (root, tip):
        chord = np.subtract(trailing, leading)
        normal = np.cross(chord, span)
        half = 0.5 * thickness * np.linalg.norm(chord) * normal / np.linalg.norm(normal)
        crest = np.add(leading, 0.45 * chord)
        sections.append([np.asarray(leading), crest + half, np.asarray(trailing), crest - half])
    inner, outer = sections
    middle = np.mean([*inner, *outer], axis=0)
    quads = [(inner[k], inner[(k + 1) % 4], outer[(k + 1) % 4], outer[k]) for k in range(4)]
    quads += [(outer[0], outer[1], outer[2], outer[3])]
    return _joined([_facet(np.array(quad), middle, color) for quad in quads])


def _facet(corners: FloatArray, inside: FloatArray, color: Rgb) -> Mesh:
    """Return a flat four-cornered face that looks away from ``inside``."""
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    if normal @ (corners.mean(axis=0) - inside) < 0:
        corners, normal = corners[::-1], -normal
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    return _mesh(corners, np.tile(normal / np.linalg.norm(normal), (4, 1)), triangles, color)


def _smooth_normals(positions: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the area-weighted mean normal of the faces around each corner."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    normals = np.zeros_like(positions)
    for k in range(3):
        np.add.at(normals, triangles[:, k], face)
    return frozen_array(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _mesh(positions: FloatArray, normals: FloatArray, triangles: IntArray, color: Rgb) -> Mesh:
    return Mesh(
        positions=frozen_array(positions),
        normals=frozen_array(normals),
        triangles=np.asarray(triangles, dtype=np.int64),
        colors=np.tile(np.asarray(color, dtype=np.int64), (len(positions), 1)),
    )


def _joined(parts: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    return Mesh(
        positions=frozen_array(np.vstack([part.positions for part in parts])),
        normals=frozen_array(np.vstack([part.normals for part in parts])),
        triangles=np.vstack([part.triangles + start for part, start in zip(parts, starts, strict=True)]),
        colors=np.vstack([part.colors for part in parts]),
    )

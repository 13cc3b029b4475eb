"""Figures as a journal prints them: a sheet of panels, each drawn by a function that is given its axes."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from finback.errors import InputError
from finback.files import replacing, write_text
from finback.views import style

Canvas = Axes
"""What a panel is drawn into, for those who compose sheets and have nothing to do with the library behind it."""
Draw = Callable[[Axes], None]
"""Draws finished values into axes."""

_INDENT: Final = re.compile(r"\n +")  # a twentieth of a file with many ticks and arrows, and it says nothing
_LETTERS: Final = "abcdefghijkl"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One picture of a sheet.

    Attributes:
        draw: what draws it.
        title: what is said above it, after its letter.
    """

    draw: Draw
    title: str = ""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How panels are laid out.

    Attributes:
        columns: how many stand side by side.
        panel: inches of a panel, width and height, its labels included.
        same_x: whether panels above each other share their abscissa; the labels stand below only.
        same_y: whether panels side by side share their ordinate; the labels stand on the left only.
        heights: of the rows, relative to each other, instead of all equal; as many as there are rows, or none.
    """

    columns: int
    panel: tuple[float, float]
    same_x: bool = False
    same_y: bool = False
    heights: tuple[float, ...] = ()


ONE_COLUMN: Final = Layout(columns=1, panel=(style.COLUMN, 2.75))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A finished sheet.

    Attributes:
        name: its file name without suffix.
        svg: the picture, a whole SVG document.
        png: the same in pixels.
    """

    name: str
    svg: str
    png: bytes


def draw_sheet(name: str, panels: Sequence[Panel], layout: Layout = ONE_COLUMN) -> Sheet:
    """Draw panels row by row, with the letters (a), (b), … if there is more than one."""
    if not 0 < len(panels) <= len(_LETTERS):
        raise InputError(f"a sheet has 1 to {len(_LETTERS)} panels, not {len(panels)}")
    columns = min(layout.columns, len(panels))
    rows = -(-len(panels) // columns)
    with style.printed(name):
        figure = style.new_figure(rows * layout.panel[1], width=columns * layout.panel[0])
        grid = figure.subplots(
            rows,
            columns,
            squeeze=False,
            sharex="col" if layout.same_x else False,
            sharey="row" if layout.same_y else False,
            height_ratios=layout.heights or None,
        )
        every = grid.ravel()
        for axes, panel, letter in zip(every, panels, _LETTERS, strict=False):
            panel.draw(axes)
            for line in axes.get_lines():
                line.get_path().should_simplify = True  # by itself only a path of 128 points or more would be
            said = [f"({letter})"] if len(panels) > 1 and axes.axison else []
            axes.set_title(" ".join([*said, panel.title]).strip())
        for axes in every[len(panels) :]:
            axes.set_axis_off()
        _label_outside(grid, layout)
        return Sheet(name=name, svg=_INDENT.sub("\n", style.svg(figure)), png=style.png(figure))


def _label_outside(grid: NDArray[np.object_], layout: Layout) -> None:
    """Keep labels of shared axes where nothing that shares them lies below or on the left."""
    for (row, column), axes in np.ndenumerate(grid):
        if layout.same_x:
            lowest = row + 1 == len(grid) or not grid[row + 1, column].axison
            axes.tick_params(labelbottom=lowest)
            axes.xaxis.label.set_visible(lowest)
        if layout.same_y:
            axes.tick_params(labelleft=column == 0)
            axes.yaxis.label.set_visible(column == 0)


def save_sheet(folder: Path, sheet: Sheet) -> Path:
    """Write a sheet as ``<name>.svg`` and return that path; the folder is made if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{sheet.name}.svg"
    write_text(path, sheet.svg)
    return path


def save_pixels(folder: Path, sheet: Sheet) -> Path:
    """Write a sheet as ``<name>.png`` and return that path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{sheet.name}.png"
    with replacing(path) as new:
        new.write_bytes(sheet.png)
    return path

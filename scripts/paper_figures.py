"""Draw the figures of the paper, and those that it does not have, from the published model and the normal forms.

scripts/paper-figures            all
scripts/paper-figures 3 6 11     these
scripts/paper-figures --list     what there is
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import paper_aircraft
import paper_normal_forms

from finback.errors import FinbackError
from finback.views.sheet import Sheet, save_pixels, save_sheet

FOLDER: Final = Path(__file__).resolve().parent.parent / "docs" / "figures"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFigure:
    """A figure.

    Attributes:
        name: by which it is asked for: its number in the paper, or a word.
        title: what it shows.
        draw: computes and draws it.
    """

    name: str
    title: str
    draw: Callable[[], Sheet]


FIGURES: Final = (
    PaperFigure(name="1", title="portraits without damping", draw=paper_normal_forms.hamiltonian),
    PaperFigure(name="2", title="the curve R and lines that cut it", draw=paper_normal_forms.moment_curve),
    PaperFigure(name="3", title="diagrams of a0 against b0", draw=paper_normal_forms.saddles_plane),
    PaperFigure(name="4", title="portraits of regions I to V", draw=paper_normal_forms.saddles_portraits),
    PaperFigure(name="5", title="the force cut by the elevator", draw=paper_aircraft.force_cut),
    PaperFigure(name="6", title="the plane of δ and a0", draw=paper_aircraft.trace_plane),
    PaperFigure(name="7", title="portraits of the regions of that plane", draw=paper_aircraft.traces),
    PaperFigure(name="8", title="time histories", draw=paper_aircraft.histories),
    PaperFigure(name="9", title="separatrices and the regions between them", draw=paper_aircraft.separatrices),
    PaperFigure(name="10", title="orbits inside and outside S1", draw=paper_aircraft.orbits),
    PaperFigure(name="11", title="S1 in its three regimes", draw=paper_aircraft.regimes),
    PaperFigure(name="area", title="size of S1 over the elevator", draw=paper_aircraft.region_measures),
    PaperFigure(name="wells-plane", title="diagrams for b2 = −1", draw=paper_normal_forms.wells_plane),
    PaperFigure(name="wells-portraits", title="portraits for b2 = −1", draw=paper_normal_forms.wells_portraits),
)


def main(arguments: Sequence[str]) -> int:
    """Draw what is asked for; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="scripts/paper-figures", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="FIGURE", help="which; all if none is named")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder of the SVG files (default: docs/figures)")
    parser.add_argument("--png", type=Path, help="folder for PNG files, too, to look at")
    parser.add_argument("--list", action="store_true", help="only say what there is")
    asked = parser.parse_args(arguments)
    known = {figure.name: figure for figure in FIGURES}
    unknown = [name for name in asked.names if name not in known]
    if unknown:
        parser.error(f"no figure {', '.join(unknown)}; there are {', '.join(known)}")
    chosen = [known[name] for name in asked.names] or list(FIGURES)
    if asked.list:
        print("\n".join(f"{figure.name:16}{figure.title}" for figure in FIGURES))
        return 0
    for figure in chosen:
        try:
            sheet = figure.draw()
            print(save_sheet(asked.out, sheet))
            if asked.png:
                print(save_pixels(asked.png, sheet))
        except (FinbackError, OSError) as error:
            print(f"figure {figure.name}: {error}", file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

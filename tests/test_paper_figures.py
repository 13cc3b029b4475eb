"""The script that draws the paper's figures: its table is complete, and the gallery says of them what is so."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from finback.units import from_si

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "docs" / "figures"
GALLERY = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def script() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        import paper_figures

        yield paper_figures


def test_every_figure_of_the_paper_is_in_the_table(script: ModuleType) -> None:
    names = [figure.name for figure in script.FIGURES]
    assert names[:11] == [str(number) for number in range(1, 12)]
    assert len(set(names)) == len(names)
    assert {"area", "wells-plane", "wells-portraits"} <= set(names), "what the paper does not have"


def test_the_gallery_shows_every_figure_with_its_command(script: ModuleType) -> None:
    commands = re.findall(r"^`scripts/paper-figures (\S+)`$", GALLERY, flags=re.MULTILINE)
    assert commands == [figure.name for figure in script.FIGURES]
    shown = re.findall(r"^!\[(.+)\]\(figures/(.+)\)$", GALLERY, flags=re.MULTILINE)
    assert len(shown) == len(commands)
    assert {name for _, name in shown} == {path.name for path in FIGURES.iterdir()}
    assert all(len(words) > 20 for words, _ in shown), "words stand for every picture"


def test_the_gallery_leads_to_errata_that_exist() -> None:
    headings = re.findall(r"^## (.+)$", (ROOT / "docs" / "paper-errata.md").read_text(encoding="utf-8"), re.MULTILINE)
    anchors = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    linked = set(re.findall(r"paper-errata\.md#([^)]+)\)", GALLERY))
    assert linked
    assert linked <= anchors


@pytest.mark.parametrize("path", sorted(FIGURES.glob("*")), ids=lambda path: path.name)
def test_the_kept_figures_are_small_whole_pictures_without_date(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert ET.fromstring(text).tag.endswith("svg")  # noqa: S314 - our own picture
    assert len(text) < 180_000
    assert "<dc:date>" not in text


def test_figures_are_drawn_by_name_where_they_are_wanted(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script.main(["2", "5", "--out", str(tmp_path / "svg"), "--png", str(tmp_path / "png")]) == 0
    assert capsys.readouterr().out.split() == [
        str(tmp_path / kind / f"fig-{number}.{kind}") for number in ("02", "05") for kind in ("svg", "png")
    ]
    kept, drawn = (
        len(re.findall(r'\bd="', (folder / "fig-05.svg").read_text(encoding="utf-8")))
        for folder in (FIGURES, tmp_path / "svg")
    )
    assert kept == drawn, "the kept figure is that of the script"


def test_the_list_names_all_and_draws_none(script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main(["--list"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed] == [figure.name for figure in script.FIGURES]


def test_an_unknown_figure_is_refused_with_those_that_there_are(
    script: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        script.main(["12"])
    assert stopped.value.code == 2
    assert "no figure 12; there are 1, 2, 3" in capsys.readouterr().err


def test_the_numbers_in_the_gallery_are_those_of_the_figures(script: ModuleType) -> None:
    aircraft, forms = script.paper_aircraft, script.paper_normal_forms
    lower, upper = aircraft.connection_elevators_deg()
    corner = aircraft.two_saddle_point().parameter
    neutral = [point.mu for point in forms.plane_of(*forms.PLANE).points if point.kind == "neutral-loop"]
    greatest = aircraft.region_at(-9.94)
    area = greatest.area_rad2_s * from_si(1.0, "deg") * from_si(1.0, "deg_s")
    loops = aircraft.loop_curves()
    for number in (
        f"> {lower:.4f}°",
        f"< {upper:.4f}°",
        f"δe = {from_si(corner, 'deg'):.4f}°",
        f"δ = {aircraft.delta_deg_s2(corner).item():.3f} deg",
        f"b0 = {neutral[0]:.5f}",
        f"errs by {100.0 * np.abs(loops.estimate / loops.loop - 1.0).max():.1f} %",
        f"{area:,.0f} deg²/s".replace(",", " "),
        f"greatest, {from_si(aircraft.region_at(-10.0).escape_distance_rad, 'deg'):.1f}°",
        *(f"{from_si(fold.elevator_rad, 'deg'):.4f}°" for fold in aircraft.both_folds()),
    ):
        assert number.replace("-", "−") in GALLERY, number
    assert max(aircraft.region_at(value).area_rad2_s for value in (-10.2, -9.7)) < greatest.area_rad2_s


def test_a_file_that_cannot_be_written_is_reported(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "taken").write_text("", encoding="utf-8")
    assert script.main(["2", "--out", str(tmp_path / "taken")]) == 2
    assert capsys.readouterr().err.startswith("figure 2: ")

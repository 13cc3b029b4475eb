"""The report: everything is in it, nothing is fetched, and it is whole or not there."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from finback.errors import InputError
from finback.flight.accuracy import FlightAccuracy, SweepAccuracy
from finback.flight.reference import NoReference, Reference
from finback.identification.identify import identify
from finback.identification.nuisance import FlightNuisances, Nuisances
from finback.identification.propagation import PropagatedNumber
from finback.identification.selection.library import library as candidates, polynomial_terms
from finback.identification.selection.options import SelectionOptions
from finback.records import Outcome
from finback.units import from_si
from finback.validation.metric import Judgement
from finback.views import report
from finback.views.coefficients import equations
from finback.views.figures import draw_figures
from finback.views.labels import minus
from finback.views.point_rows import point_rows
from finback.views.report import MEANING, write_report
from finback.views.style import Drawing

VOID = {"meta", "link", "br", "hr", "img", "input"}


_SEEN = FlightAccuracy(
    flight="release-02",
    alpha_error_rad=2.5e-6,
    q_error_rad_s=1e-5,
    order=2,
    growth=3.0,
    sensitive=False,
    outcome=Outcome.COMPLETED,
    outcome_at_half_step=Outcome.COMPLETED,
    reference=Reference(
        alpha_error_rad=3.5e-6, q_error_rad_s=1e-5, uncertainty_rad=4e-8, corners={"aero/<alpha>-deg": 17}
    ),
)
ACCURACY = (
    SweepAccuracy(
        fidelity="free",
        step_s=0.0025,
        sample="3 of 40: the one that turns fastest, the others spread evenly",
        flights=(
            _SEEN,
            replace(_SEEN, flight="release-07", reference=NoReference(reason="a flight control <of its own>")),
            replace(_SEEN, flight="release-08", sensitive=True, growth=1e9, outcome_at_half_step=Outcome.DEPARTED),
        ),
        stilled=True,
    ),
)


class Page(HTMLParser):
    """What a browser would see: open and closed elements, attributes, texts."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.faults: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element without content."""
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        """Close an element, or note that it was not open."""
        if not self.open or self.open.pop() != tag:
            self.faults.append(tag)

    def handle_data(self, data: str) -> None:
        """Note a text, but no style sheet."""
        if self.open and self.open[-1] not in ("style", "script"):
            self.texts.append(data)

    @property
    def text(self) -> str:
        """All texts, with single spaces."""
        return re.sub(r"\s+", " ", " ".join(self.texts))


def parsed(path: Path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    page.close()
    return page


def written(folder: Path, results: Any, **changed: Any) -> Path:
    path = folder / "report.html"
    given = {
        **vars(results),
        "accuracy": ACCURACY,
        "study_name": "a study",
        "derived": (),
        "provenance": {"run": "run-1", "jsbsim": "1.3.3"},
        **changed,
    }
    write_report(path, **given)
    return path


@pytest.fixture(scope="module")
def drawn(results: Any) -> tuple[Drawing, ...]:
    return draw_figures(**vars(results))


@pytest.fixture
def quick(drawn: tuple[Drawing, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the figures from the shelf, for tests of the page around them."""
    monkeypatch.setattr(report, "draw_figures", lambda **_: drawn)


@pytest.fixture(scope="module")
def page(results: Any, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return parsed(written(tmp_path_factory.mktemp("report"), results))


def test_the_page_is_well_formed(page: Page) -> None:
    assert page.faults == []
    assert page.open == []


def test_nothing_is_fetched(page: Page) -> None:
    fetching = {"src", "href", "xlink:href", "data", "action", "poster", "srcset"}
    for tag, attributes in page.elements:
        assert tag not in {"script", "link", "iframe", "object", "embed", "img"}
        for name in fetching & attributes.keys():
            assert (attributes[name] or "").startswith("#"), f"{tag} {name}={attributes[name]}"
        assert "@import" not in (attributes.get("style") or "")
        assert not re.search(r"url\((?!#)", attributes.get("style") or "")


@pytest.mark.usefixtures("quick")
def test_the_style_sheet_fetches_nothing(results: Any, tmp_path: Path) -> None:
    source = written(tmp_path, results).read_text(encoding="utf-8")
    for sheet in re.findall(r"<style>(.*?)</style>", source, flags=re.DOTALL):
        assert "@import" not in sheet
        assert "url(" not in sheet
        assert "http" not in sheet


def test_every_reference_inside_the_page_has_its_target(page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.elements if attributes.get("id")]
    assert len(ids) == len(set(ids)), "an id stands twice"
    for _, attributes in page.elements:
        for name in ("href", "xlink:href"):
            if attributes.get(name):
                assert (attributes[name] or "")[1:] in ids
        for name in ("aria-labelledby", "aria-describedby"):
            if attributes.get(name):
                assert attributes[name] in ids
        for target in re.findall(r"url\(#([^)]+)\)", " ".join(value or "" for value in attributes.values())):
            assert target in ids


def test_every_metric_stands_there_with_judgement_and_source(page: Page, results: Any) -> None:
    for metric in results.validation.metrics:
        assert report.minus(metric.name) in page.text
        assert report.minus(metric.source) in page.text
    judged = page.text.count("✓ agrees") + page.text.count("✗ disagrees") + page.text.count("? inconclusive")
    assert judged == len(results.validation.metrics)


def test_every_flight_stands_there_with_its_outcome(page: Page, results: Any) -> None:
    for record in results.sweep.records:
        assert record.name in page.text
        assert report.minus(record.note) in page.text
    for holdout in results.validation.holdouts:
        assert holdout.record.name in page.text


def test_every_zero_of_the_damping_stands_there(page: Page, results: Any) -> None:
    rows = point_rows(results.analysis)
    assert len(rows) == len(results.analysis.hopf_points) + len(results.analysis.neutral_saddles) > 0
    for row in rows:
        assert row.name in page.text
        assert row.elevator in page.text
        assert "±" in row.alpha


def test_notes_and_provenance_stand_there(page: Page, results: Any) -> None:
    for note in (*results.validation.notes, *results.analysis.notes, *results.identification.warnings):
        assert report.minus(note) in page.text
    assert "jsbsim" in page.text
    assert "1.3.3" in page.text


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("verdict", list(Judgement))
def test_the_verdict_comes_first_and_is_explained(results: Any, tmp_path: Path, verdict: Judgement) -> None:
    changed = replace(results.validation, verdict=verdict)
    page = parsed(written(tmp_path, results, validation=changed))
    banner = next(attributes for tag, attributes in page.elements if tag == "section")
    assert banner["class"] == f"verdict {verdict.value}"
    assert MEANING[verdict] in page.text
    assert page.text.index(MEANING[verdict]) < page.text.index("All comparisons")


@pytest.mark.usefixtures("quick")
def test_the_banner_counts(results: Any, tmp_path: Path) -> None:
    metric = results.validation.metrics[0]
    wrong = replace(metric, name="a wrong one", simulated=1.0, predicted=1.0 + 10 * metric.tolerance, uncertainty=0.0)
    ignored = replace(wrong, name="an ignored one", counted=False, note="extrapolated")
    changed = replace(results.validation, metrics=(metric, wrong, ignored))
    text = parsed(written(tmp_path, results, validation=changed)).text
    assert "2 comparisons counted: 1 agree, 1 disagree, 0 inconclusive" in text
    assert "1 not counted" in text
    assert "not counted" in text[text.index("an ignored one") :]


def test_pictures_have_words_and_tables_have_captions(page: Page, results: Any) -> None:
    pictures = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(pictures) == 4 + len(results.validation.folds) + len(results.validation.holdouts)
    for picture in pictures:
        assert picture["role"] == "img"
        assert picture["aria-labelledby"]
        assert picture["aria-describedby"]
    tags = [tag for tag, _ in page.elements]
    assert tags.count("caption") == tags.count("table") > 0
    assert tags.count("h1") == 1
    headings = [int(tag[1]) for tag in tags if re.fullmatch("h[1-6]", tag)]
    assert all(after - before <= 1 for before, after in pairwise(headings))
    scopes = [attributes.get("scope") for tag, attributes in page.elements if tag == "th"]
    assert set(scopes) == {"row", "col"}
    assert dict(page.elements)["html"]["lang"] == "en"


@pytest.mark.usefixtures("quick")
def test_pictures_follow_the_page_into_the_dark(results: Any, tmp_path: Path) -> None:
    source = written(tmp_path, results).read_text(encoding="utf-8")
    first = source[source.index("<svg") : source.index("</svg>")]
    assert "var(--predicted)" in first
    assert "#0072b2" not in first
    named = set(re.findall(r"var\(--([a-z-]+)\)", source))
    defined = set(re.findall(r"--([a-z-]+):", source))
    assert named <= defined


@pytest.mark.usefixtures("quick")
def test_a_report_needs_no_provenance(results: Any, tmp_path: Path) -> None:
    page = parsed(written(tmp_path, results, provenance={}))
    assert page.faults == []
    assert "Run " not in page.text


@pytest.mark.usefixtures("quick")
def test_figures_stand_beside_the_page(results: Any, tmp_path: Path) -> None:
    written(tmp_path, results)
    assert {path.suffix for path in (tmp_path / "figures").iterdir()} == {".svg"}
    assert {path.name for path in tmp_path.iterdir()} == {"report.html", "figures"}


def test_texts_from_outside_are_escaped(bare: Any, tmp_path: Path) -> None:
    page = parsed(written(tmp_path, bare, study_name="<img src=http://example.org>"))
    assert not [tag for tag, _ in page.elements if tag in ("img", "script", "b")]
    assert "<script> & −3 deg" in page.text
    assert "unknown <b>&" in page.text
    assert page.faults == []


def test_a_report_of_hardly_anything_is_whole(bare: Any, tmp_path: Path) -> None:
    text = parsed(written(tmp_path, bare)).text
    assert "not predicted" in text
    assert "0 comparisons counted" in text
    assert "too short" in text
    alone = replace(bare.validation, folds=(), holdouts=())
    text = parsed(written(tmp_path, bare, validation=alone)).text
    assert "No fold of the simulator could be flown" in text
    assert "There are none." in text


@pytest.mark.usefixtures("quick")
def test_a_failure_leaves_the_old_report(results: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, results)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match="could not be written"):
        written(tmp_path, results, study_name="another")
    assert path.read_bytes() == before
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.usefixtures("quick")
def test_a_missing_folder_is_named(results: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="could not be written") as caught:
        written(tmp_path / "file", results)
    assert caught.value.hint


def test_coefficients_are_those_of_the_model_in_degrees(results: Any) -> None:
    """The other road: the model evaluated with one variable at one degree, the rest at zero."""
    model = results.identification.model
    table = {
        equation.title: {row.term: row for row in equation.coefficients}
        for equation in equations(results.identification, results.analysis)
    }
    degree = np.deg2rad(1.0)
    constant = float(model.alpha_dot(0.0, 0.0, 0.0))
    by_elevator = (float(model.alpha_dot(0.0, 0.0, degree)) - constant) / degree
    shown = table["dα/dt"]["δe"].value
    value, error = (float(part.replace("−", "-")) for part in shown.split(" ± "))
    assert abs(value - by_elevator) <= error
    cubic = table["dα/dt"]["α³"]
    assert cubic.unit == "1/(deg² s)"
    at = [float(model.alpha_dot(k * degree, 0.0, 0.0)) / degree for k in (-2.0, -1.0, 0.0, 1.0, 2.0)]
    third = (at[4] - 2 * at[3] + 2 * at[1] - at[0]) / 12.0
    mantissa, power = re.fullmatch(r"\((\S+) ± .*\)×10⁻(\S)", cubic.value).groups()  # type: ignore[union-attr]
    assert float(mantissa) * 10.0 ** -"⁰¹²³⁴⁵⁶⁷⁸⁹".index(power) == pytest.approx(third, rel=1e-3)  # four digits shown
    assert table["f(α)"]["α²"].unit == "1/(deg² s)"
    assert table["g(α) + c₁ δe"]["1"].unit == "deg/s²"


def test_fold_numbers_are_the_predicted_ones(page: Page, results: Any) -> None:
    for fold in results.analysis.folds:
        assert f"{from_si(fold.elevator_rad, 'deg'):.3f}".replace("-", "−") in page.text


def test_the_report_says_how_well_the_step_resolves_the_flights_by_both_roads(page: Page) -> None:
    for said in ("2.5e-06", "3.5e-06 ± 4e-08", "aero/<alpha>-deg (17)", "sensitive", "resolved"):
        assert said in page.text, said
    assert "Flights flown again, free, step 0.0025 s: 3 of 40: the one that turns fastest" in page.text
    assert "half the step alone: a flight control <of its own>" in page.text
    assert "'release-08' is completed, at half the step departed" in page.text
    assert "flown without turbulence" in page.text


def test_a_report_without_accuracy_says_that_nobody_looked(tmp_path: Path, results: Any) -> None:
    assert "Nobody looked" in parsed(written(tmp_path, results, accuracy=())).text


@pytest.mark.usefixtures("quick")
def test_the_page_says_how_the_terms_were_found_and_what_the_residuals_show(results: Any, tmp_path: Path) -> None:
    library = candidates(polynomial_terms(("alpha", "q", "elevator"), 2))
    asked = replace(results.identification.options, selection=(SelectionOptions(library=library, bootstraps=4),))
    found = identify(results.sweep, asked)
    bias = FlightNuisances(
        flight="release-01",
        start_s=0.5,
        alpha_bias_rad=0.01,
        alpha_bias_error_rad=0.001,
        q_bias_rad_s=0.0,
        q_bias_error_rad_s=0.0,
        elevator_bias_rad=0.0,
        elevator_bias_error_rad=0.0,
        elevator_delay_s=0.0,
        elevator_delay_error_s=0.0,
    )
    biased = replace(found, nuisances=(bias,), options=replace(found.options, nuisances=Nuisances(alpha_bias_rad=0.01)))
    known = PropagatedNumber(
        name="fold 1 elevator_rad",
        value=0.25,
        linear_error=0.001,
        linear_interval=np.array([0.248, 0.252]),
        sampled_interval=np.array([0.2479, 0.2521]),
        existing=1.0,
        determined=True,
    )
    vague = replace(known, name="hopf 1 lyapunov_1_s", existing=0.5, determined=False)
    page = parsed(written(tmp_path, replace(results, identification=biased), derived=(known, vague)))
    assert page.faults == []
    (selection,) = found.selection
    assert f"selected from {selection.options.library.size} candidates" in page.text
    assert all(step.term in page.text for step in selection.path)
    assert found.suspicions
    assert all(minus(one.statement) in page.text for one in found.suspicions)
    assert "0.573 ± 0.057" in page.text  # 0.01 and 0.001 rad in degrees
    assert "14.32 ± 0.11" in page.text
    assert "not determined" in page.text
    assert "exists in 50% of the models drawn" in page.text


@pytest.mark.usefixtures("quick")
def test_without_a_selection_the_page_says_nothing_of_one(results: Any, tmp_path: Path) -> None:
    page = parsed(written(tmp_path, results))
    assert "How the terms were found" not in page.text
    assert "the records were fitted as they are" in page.text
    assert "Not drawn by samples" in page.text

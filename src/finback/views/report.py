"""The report of a run: one page of HTML that needs nothing else, and its figures as files beside it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Final

import jinja2

from finback import __version__
from finback.dynamics.any_form import AnyAnalysis
from finback.errors import InputError
from finback.files import write_text
from finback.flight.accuracy import SweepAccuracy
from finback.identification.identify import Identification
from finback.identification.propagation import PropagatedNumber
from finback.records import Sweep
from finback.validation.metric import Judgement
from finback.validation.validate import Validation
from finback.views.accuracy_rows import accuracy_table
from finback.views.analysis_rows import analysis_rows
from finback.views.coefficients import equations
from finback.views.figures import draw_figures, save_figures
from finback.views.fold_figure import fold_cases
from finback.views.identification_rows import identification_rows
from finback.views.labels import minus
from finback.views.style import THEME, Drawing
from finback.views.tables import fit_rows, flight_rows, fold_row, metric_row, summary, tolerance_sources

FIGURES: Final = "figures"
MEANING: Final[dict[Judgement, str]] = {
    Judgement.AGREES: (
        "Every counted comparison lies within its tolerance, uncertainty included: where data supported it, the "
        "identified model predicts this simulator."
    ),
    Judgement.DISAGREES: (
        "At least one counted comparison lies outside its tolerance by more than its uncertainty: do not trust the "
        "model for what the rows marked “disagrees” compare."
    ),
    Judgement.INCONCLUSIVE: (
        "Nothing disagrees, but at least one comparison is too uncertain to tell, or nothing could be counted: more "
        "or better data are needed before the model can be believed."
    ),
}
"""What each verdict means, in a sentence."""

_IDS: Final = re.compile(r'(\bid="|url\(#|href="#)([^")]+)')
_SIZE: Final = re.compile(r'<svg ([^>]*?)\s*width="[^"]*"', flags=re.DOTALL)
_HEIGHT: Final = re.compile(r'\bheight="[^"]*pt"\s*')


def write_report(  # noqa: PLR0913 - a report is made of all results of a run
    path: Path,
    *,
    study_name: str,
    sweep: Sweep,
    accuracy: Sequence[SweepAccuracy],
    identification: Identification,
    analysis: AnyAnalysis,
    validation: Validation,
    derived: Sequence[PropagatedNumber],
    provenance: Mapping[str, str],
) -> None:
    """Write the report of a run, and its figures to ``figures/*.svg`` beside it.

    Args:
        path: the page to write; an earlier one is replaced when the new one is complete.
        study_name: its title.
        sweep: the flights.
        accuracy: how well the step resolves some of them.
        identification: the model.
        analysis: what it predicts.
        validation: what the simulator says about that.
        derived: numbers computed from the coefficients, with intervals by two roads; may be empty.
        provenance: text facts to list: versions, fingerprints, the run.

    Raises:
        InputError: the page or a figure cannot be written.
    """
    drawings = draw_figures(sweep=sweep, identification=identification, analysis=analysis, validation=validation)
    sources = tolerance_sources(validation)
    page = _template().render(
        study=study_name,
        provenance={**provenance, "finback": __version__},
        verdict=validation.verdict.value,
        meaning=MEANING[validation.verdict],
        counts=summary(validation),
        metrics=[metric_row(metric, sources) for metric in validation.metrics],
        sources=[minus(source) for source in sources],
        folds=[fold_row(case) for case in fold_cases(analysis, validation)],
        found=analysis_rows(analysis),
        figures={drawing.name: inlined(drawing) for drawing in drawings},
        drawings={drawing.name: drawing for drawing in drawings},
        fold_figures=[drawing.name for drawing in drawings if drawing.name.startswith("fold-")],
        holdout_figures=[holdout.record.name for holdout in validation.holdouts],
        equations=equations(identification, analysis),
        fit=fit_rows(identification),
        identified=identification_rows(identification, derived),
        flights=flight_rows(sweep, identification),
        accuracy=[accuracy_table(found) for found in accuracy],
        unused=[minus(reason) for reason in identification.unused],
        warnings=[minus(warning) for warning in identification.warnings],
        notes=[minus(note) for note in (*validation.notes, *analysis.notes)],
    )
    try:
        save_figures(path.parent / FIGURES, drawings)
        write_text(path, page)
    except OSError as error:
        raise InputError(
            f"{path}: the report could not be written: {error}", hint="is the folder there, writable, and not full?"
        ) from error


def inlined(drawing: Drawing) -> str:
    """Return a figure as part of a page: its own ids, the page's colors, and words for those who do not see it."""
    body = drawing.svg[drawing.svg.index("<svg") :]
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    body = _IDS.sub(rf"\1{drawing.name}-\2", body)
    body = _HEIGHT.sub("", _SIZE.sub(r"<svg \1 ", body, count=1), count=1)
    for color, name in THEME.items():
        body = body.replace(color, f"var(--{name})")
    title, words = f"{drawing.name}-title", f"{drawing.name}-words"
    opening = f'<svg role="img" aria-labelledby="{title}" aria-describedby="{words}" '
    said = f'<title id="{title}">{escape(drawing.title)}</title><desc id="{words}">{escape(drawing.alt)}</desc>'
    body = body.replace("<svg ", opening, 1)
    end = body.index(">") + 1
    return body[:end] + said + body[end:]


def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("finback", "views/templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html")

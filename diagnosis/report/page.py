"""The report: a result as text and tables, with charts of the runs, in one HTML page."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

import cosim

from ..assessment.covariates import EAST, NORTH
from ..execution.progress import Advance, silent
from ..predictors.evaluation import Evaluation
from . import formatting
from .content import coefficients, versions
from .glossary import linked
from .headline import (
    boundedness,
    cause,
    contradicted_by_tests,
    finding_sentence,
    first_sentences,
    gain_of_search,
    page_title,
    worse_than_constant_velocities,
)
from .pictures import figures, tracks
from .pictures.chart import data_uri, themed
from .pictures.shape import curves
from .report_data import USES, ReportData, error_changes, trial_rows
from .what_if import what_if

if TYPE_CHECKING:
    from markupsafe import Markup

PLACE = (NORTH.id, EAST.id)
NO_ORIGIN: Mapping[str, object] = {}


class Drawing(NamedTuple):
    """A picture of the page: its ``<svg>`` element, its caption, its name as a file, and the file."""

    svg: "Markup"
    caption: str
    key: str
    file: str


class Figure(Protocol):
    """A :class:`.pictures.chart.Chart`, or what else can be an SVG element of a page."""

    def svg(self, key: str, label: str) -> str: ...


def drawing(figure: Figure, key: str, caption: str, label: str = "") -> Drawing:
    """A picture for the page.

    Args:
        figure: what is drawn.
        key: name of the file, that no other picture of the page has.
        caption: text below.
        label: for screen readers; by default the caption.
    """
    from markupsafe import Markup

    svg = figure.svg(key, label or caption)
    return Drawing(Markup(themed(svg)), caption, key, data_uri(svg))


def write_report(
    path: str | Path,
    data: ReportData,
    advance: Advance = silent,
    origin: Mapping[str, object] = NO_ORIGIN,
) -> Path:
    """Write the report: one HTML file that needs no other.

    Args:
        path: of the file; an older one is replaced when the new one is complete.
        data: the result.
        advance: receives the name of each step when it begins.
        origin: what else the result was made with, such as the command line and the hashes of its files.

    Returns:
        The path.
    """
    path = Path(path)
    advance("report: figures")
    sections = (_growth, _free, _profiles, _shapes, _ranking)
    drawn = {section.__name__.strip("_"): [*section(data)] for section in sections}
    of_runs = [[*_of_run(data, k, e)] for k, e in enumerate(data.evaluations)]
    advance("report: page")
    made_with = [*_provenance(data), *origin.items()]
    write_page(
        path,
        "page.html",
        r=data,
        diagnosis=data.diagnosis,
        title=page_title(data, date.today().isoformat()),
        sentence=first_sentences(data),
        gain=gain_of_search(data),
        against=[*contradicted_by_tests(data), *worse_than_constant_velocities(data)],
        pictures=drawn,
        of_runs=of_runs,
        changes=[error_changes(data, k) for k in range(len(data.evaluations))],
        what_if=what_if(data),
        tiles=[*_tiles(data)],
        trials=[*trial_rows(data)],
        coefficients=[] if data.diagnosis is None else [*coefficients(data.diagnosis)],
        provenance=[(label, value) for label, value in made_with if value is not None],
    )
    return path


def write_page(path: Path, template: str, **values: object) -> None:
    """Write a page by a template of this folder, with the glossary of its terms.

    An older file is replaced when the page is complete.
    """
    text, terms = linked(rendered(template, **values))
    head, end, tail = text.rpartition("</main>")
    text = f"{head}{rendered('glossary.html', terms=terms) if terms else ''}{end}{tail}"
    with cosim.atomic_write(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def rendered(template: str, **values: object) -> str:
    """A page, or a part of one, by a template of this folder."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    f = formatting
    made.filters |= {
        x.__name__: x for x in (f.number, f.unit, f.percent, f.plain, finding_sentence, boundedness)
    }
    made.globals |= {"degrees": degrees(1.0)}
    return made.get_template(template).render(values)


def _provenance(r: ReportData) -> Iterator[tuple[str, object]]:
    """Label and value of all that the result was made with."""
    yield "files", r.files
    yield "runs", [e.name for e in r.evaluations]
    yield "model", r.model
    if r.diagnosis is not None:
        prior = r.diagnosis.prior
        yield "prior of the coefficients", "from the source of each value" if prior is None else prior
        yield "seed", r.diagnosis.seed
    yield "versions", versions()


def _of_run(r: ReportData, k: int, e: Evaluation) -> Iterator[Drawing]:
    """All pictures of one run."""
    name = r.called(e)
    yield drawing(tracks.track(e, r.learned), f"track-{k}", f"{name}.", f"Track of {e.name}")
    if worst := tracks.worst_window(e, r.learned):
        yield drawing(worst, f"worst-{k}", f"{name}: the worst window.")
    if heading := tracks.heading_bands(e):
        caption = f"{name}: heading in the worst window, with bands of 50 and 90 %."
        yield drawing(heading, f"heading-{k}", caption)
    if e.weak_windows.middle.size:
        figure = figures.model_error(e, r.comparison.omega_std[k], r.learned)
        yield drawing(figure, f"omega-{k}", f"{name}: the model error over time.")
        yield from _places(r, k, e)
    yield drawing(figures.residuals(e.smoothed), f"residuals-{k}", f"{name}: residuals of the pose.")


def _growth(r: ReportData) -> Iterator[Drawing]:
    for use, runs in _by_use(r):
        if known := [e for e in runs if e.windows is not None]:
            caption = f"Prediction error over time, {use}: median, and half of all samples."
            yield drawing(tracks.error_growth(known, r.learned), f"growth-{known[0].use}", caption)


def _by_use(r: ReportData) -> Iterator[tuple[str, list[Evaluation]]]:
    """The runs by what their data were used for."""
    for use in USES:
        if runs := [e for e in r.evaluations if e.use == use]:
            words = r.use(runs[0])
            yield f"{words} runs" if words else "all runs", runs


def _free(r: ReportData) -> Iterator[Drawing]:
    """The first run of which least was used."""
    e = r.least_used
    yield drawing(tracks.free(e, cause(r)), "free", f"{r.called(e)}: predicted as a whole.")


def _places(r: ReportData, k: int, e: Evaluation) -> Iterator[Drawing]:
    """A run in which something is found at a place or at a time, or that acts from outside."""
    name = r.called(e)
    placed = any(region.covariate.id in PLACE for region in r.comparison.before.regions)
    times: list[tuple[float, float]] = []
    if (d := r.diagnosis) is not None:
        effects = d.start.ship.effects
        placed = placed or any(effects[f.id].kind == "environment" for f in r.accepted)
        stretches = d.unrecorded.stretches
        times = [(s.start, s.end) for s in stretches if s.run == e.name and s.axis != "N"]
    if placed:
        caption = f"{name}: the model error along the track."
        yield drawing(tracks.place(e, r.learned), f"place-{k}", caption)
    if times:
        caption = f"{name}: times of disturbances, and the residual force."
        yield drawing(tracks.place(e, r.learned, times), f"disturbance-{k}", caption)


def _profiles(r: ReportData) -> Iterator[Drawing]:
    c = r.comparison
    after = c.after.profiles if r.learned else None
    for k, (covariate, label) in enumerate(figures.LABELS.items()):
        figure = figures.profile(covariate, c.before.profiles, after)
        yield drawing(figure, f"where-{k}", f"Model error by {label.partition(' [')[0]}.")


def _ranking(r: ReportData) -> Iterator[Drawing]:
    if r.ranking:
        shown = min(len(r.ranking), figures.MOST_RANKED)
        caption = f"The best {shown} of {len(r.ranking)} candidates."
        label = "Candidates in the order of their score"
        yield drawing(figures.ranking(r.ranking), "ranking", caption, label)


def _shapes(r: ReportData) -> Iterator[Drawing]:
    for k, c in enumerate(curves(r.accepted, r.evaluations)):
        caption = f"{c.id}: before and learned. Grey: hardly any data."
        yield drawing(figures.curve(c), f"curve-{k}", caption, f"Learned shape of {c.id}")


def _tiles(r: ReportData) -> Iterator[tuple[str, str, str]]:
    """Label, number and remark of the main numbers: over the runs of which least was used."""
    use, runs = [*_by_use(r)][-1]
    of = f"error of {formatting.number(r.lengths[0])} s predictions"
    position = [(e.before.position, e.after.position) for e in runs]
    heading = [(e.before.heading, e.after.heading) for e in runs]
    yield from _tile(f"position {of}", position, 1e3, "mm", use)
    yield from _tile(f"heading {of}", heading, degrees(1.0), "°", use)


def _tile(
    label: str, errors: Sequence[tuple[float, float]], factor: float, unit: str, remark: str
) -> Iterator[tuple[str, str, str]]:
    """The root mean square of errors before and after, where these are known and differ."""
    known = [pair for pair in errors if np.isfinite(pair[0])]
    if not known:
        return
    before, after = np.sqrt(np.mean(np.square(known), axis=0)).tolist()
    shown = formatting.number(before, factor=factor)
    if np.isfinite(after) and after != before:
        shown += f" → {formatting.number(after, factor=factor)}"
        less = after < before
        remark += f", {formatting.times(before, after)} less" if less else ", more than before"
    yield label, f"{shown} {unit}", remark

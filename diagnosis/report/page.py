"""The report: content of a JSON file as text and tables, with figures of the runs, in one HTML page."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import cosim

from ..assessment.covariates import EAST, NORTH
from ..execution.parallel import for_each
from ..execution.progress import Advance, silent
from ..predictors.evaluation import Evaluation
from . import figures, formatting, tracks
from .headline import told, verdict_title
from .profiles import QUANTITIES, binned_errors
from .result_keys import Change, ComparisonContent, DiagnosisContent, StabilityResult
from .shape import Curve, curves
from .svg import data_uri, inline, style
from .trial_rows import trial_rows

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.figure import Figure


PLACE = (NORTH.id, EAST.id)
NO_ORIGIN: Mapping[str, object] = {}


class Drawing(NamedTuple):
    """A figure of the page: its ``<svg>`` element, its caption, and its name as a file."""

    svg: "Markup"
    caption: str
    key: str


def write_report(
    path: str | Path,
    content: ComparisonContent | DiagnosisContent,
    evaluations: Sequence[Evaluation],
    omega_std: Sequence[np.ndarray] | None = None,
    advance: Advance = silent,
    origin: Mapping[str, object] = NO_ORIGIN,
) -> Path:
    """Write the report: one HTML file that needs no other.

    Args:
        path: of the file; an older one is replaced when the new one is complete.
        content: that of ``comparison.json`` or ``diagnosis.json``.
        evaluations: one for each run, in the order of ``content.errors``.
        omega_std: standard deviation (K, 3) [N, N, N m] of each run's model error; None if not known.
        advance: receives the name of each step when it begins.
        origin: what else the result was made with, such as the command line and the hashes of its files.

    Returns:
        The path.
    """
    path = Path(path)
    learned = any(e.after is not e.before for e in evaluations)
    diagnosis = content if isinstance(content, DiagnosisContent) else None
    advance("report: figures")
    makers: list[tuple[str, Callable[[], Iterator[Drawing]]]] = [
        # What takes longest comes first, so that no process waits for it at the end.
        ("free", lambda: _free(evaluations, learned)),
        ("where", lambda: _profiles(evaluations, omega_std, learned)),
        *(("tracks", partial(_tracks, k, e, learned)) for k, e in enumerate(evaluations)),
        ("omega", lambda: _omega(evaluations, omega_std, learned)),
        ("growth", lambda: _growth(evaluations, learned)),
        ("place", lambda: _places(content, evaluations, learned)),
        ("shapes", lambda: iter(()) if diagnosis is None else _shapes(diagnosis, evaluations)),
        ("ranking", lambda: iter(()) if diagnosis is None else _ranking(diagnosis)),
    ]
    drawn: dict[str, list[Drawing]] = {}
    with style():
        made = for_each(lambda maker: list(maker[1]()), makers)
    for (place, _), drawings in zip(makers, made, strict=True):
        drawn.setdefault(place, []).extend(drawings)
    advance("report: page")
    text = (
        environment()
        .get_template("page.html")
        .render(
            content=content,
            diagnosis=diagnosis,
            verdict="" if diagnosis is None else verdict_title(diagnosis),
            title="Model against measurements" if diagnosis is None else "Diagnosis",
            learned=learned,
            figures=drawn,
            tiles=list(_tiles(content, learned)),
            runs=[(e.name, e.held_out, e.smoothed.counts, e.smoothed.track.notes) for e in evaluations],
            provenance=[(k, v) for k, v in (*_provenance(content), *origin.items()) if v is not None],
            glossary=list(formatting.glossary(content.windows.prediction, content.windows.model_error)),
        )
    )
    with cosim.atomic_write(path) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return path


def environment() -> "Environment":
    """Templates of this folder, and the filters that they use."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    told_so = (told, data_uri, bounded)
    filters = (
        formatting.number,
        formatting.unit,
        formatting.percent,
        formatting.plain,
        trial_rows,
        *told_so,
    )
    made.filters |= {f.__name__: f for f in filters}
    made.globals["times"] = formatting.times
    return made


def _provenance(content: ComparisonContent | DiagnosisContent) -> Iterator[tuple[str, object]]:
    """Label and value of all that the result was made with."""
    yield "files", content.files
    yield "runs", content.runs
    yield "model", content.model
    if isinstance(content, DiagnosisContent):
        by_origin = "by where each value comes from"
        yield "prior of the coefficients", by_origin if content.prior is None else content.prior
        yield "seed", content.seed
    yield "versions", content.versions


def _draw(figure: "Figure", key: str, label: str, caption: str) -> Drawing:
    from markupsafe import Markup

    return Drawing(Markup(inline(figure, key, label)), caption, key)


def _label(e: Evaluation, learned: bool) -> str:
    part = "held out" if e.held_out else "training"
    return f"{e.name} ({part})" if learned else e.name


def _tracks(k: int, e: Evaluation, learned: bool) -> Iterator[Drawing]:
    name = _label(e, learned)
    yield _draw(tracks.track(e, learned), f"track-{k}", f"Track of {e.name}", f"{name}.")
    worst = tracks.worst_window(e, learned)
    if worst is not None:
        caption = f"{name}: the worst window."
        yield _draw(worst, f"worst-{k}", f"The worst window of {e.name}", caption)
    heading = tracks.heading_bands(e)
    if heading is not None:
        caption = f"{name}: heading in the worst window, with bands of 50 and 90 %."
        yield _draw(heading, f"heading-{k}", f"Heading in the worst window of {e.name}", caption)


def _growth(evaluations: Sequence[Evaluation], learned: bool) -> Iterator[Drawing]:
    for held_out in (False, True):
        runs = [e for e in evaluations if e.held_out == held_out and e.windows is not None]
        if not runs:
            continue
        part = "held-out" if held_out else ("training" if learned else "all")
        caption = f"Error of prediction over time, {part} runs: median, and half of all samples."
        figure = tracks.error_growth(runs, learned)
        yield _draw(figure, f"growth-{part}", caption, caption)


def _free(evaluations: Sequence[Evaluation], learned: bool) -> Iterator[Drawing]:
    """The first run of which nothing was learned, else the first one."""
    for e in sorted(evaluations, key=lambda e: not e.held_out)[:1]:
        caption = f"{_label(e, learned)}: predicted as a whole."
        yield _draw(tracks.free(e), "free", f"{e.name} predicted as a whole", caption)


def _places(
    content: ComparisonContent | DiagnosisContent, evaluations: Sequence[Evaluation], learned: bool
) -> Iterator[Drawing]:
    """The runs in which something is found at a place or at a time, or that acts from outside."""
    placed = any(r.by in PLACE for r in content.where.regions)
    pushes: dict[str, list[tuple[float, float]]] = {}
    if isinstance(content, DiagnosisContent):
        effects = evaluations[0].model.ship.effects
        placed = placed or any(effects[e.id].kind == "environment" for e in content.accepted)
        for s in content.unrecorded.stretches:
            if s.axis != "N":
                pushes.setdefault(s.run, []).append((s.start or 0.0, s.end or 0.0))
    for k, e in enumerate(evaluations):
        if not e.weak_windows.middle.size:
            continue
        name = _label(e, learned)
        if placed:
            caption = f"{name}: the missing force along the track."
            yield _draw(tracks.place(e, learned), f"place-{k}", f"Missing force, {e.name}", caption)
        if e.name in pushes:
            figure = tracks.place(e, learned, pushes[e.name])
            caption = f"{name}: where something pushed the ship, and the force that is left."
            yield _draw(figure, f"push-{k}", f"Pushes in {e.name}", caption)


def _omega(
    evaluations: Sequence[Evaluation], std: Sequence[np.ndarray] | None, learned: bool
) -> Iterator[Drawing]:
    for k, e in enumerate(evaluations):
        if not e.weak_windows.middle.size:
            continue
        figure = figures.model_error(e, None if std is None else std[k], learned)
        yield _draw(figure, f"omega-{k}", f"Model error over time, {e.name}", f"{_label(e, learned)}.")


def _profiles(
    evaluations: Sequence[Evaluation], std: Sequence[np.ndarray] | None, learned: bool
) -> Iterator[Drawing]:
    if not any(e.weak_windows.middle.size for e in evaluations):
        return
    for k, quantity in enumerate(QUANTITIES):
        figure = figures.profile(quantity, binned_errors(quantity, evaluations, std), learned)
        caption = f"Model error by {quantity.name}."
        yield _draw(figure, f"where-{k}", caption, caption)


def _ranking(d: DiagnosisContent) -> Iterator[Drawing]:
    ranked = [r for r in d.ranking if r.score is not None]
    if ranked:
        figure = figures.ranking(ranked)
        caption = f"The best of {len(ranked)} candidates."
        yield _draw(figure, "ranking", "Candidates in the order of their score", caption)


def _shapes(d: DiagnosisContent, evaluations: Sequence[Evaluation]) -> Iterator[Drawing]:
    learned = [e.model_dump(mode="json") for e in d.accepted]
    shapes: list[Curve] = curves(learned, evaluations)
    for k, c in enumerate(shapes):
        caption = f"{c.id}: before and learned. Grey: hardly any data."
        yield _draw(figures.curve(c), f"curve-{k}", f"Learned shape of {c.id}", caption)


def _tiles(
    content: ComparisonContent | DiagnosisContent, learned: bool
) -> Iterator[tuple[str, str, str]]:
    """Label, number and remark of the main numbers: over held-out runs if there are any."""
    held_out = [e for e in content.errors if e.held_out]
    chosen = held_out or content.errors
    part = "held-out" if held_out else ("training" if learned else "measured")
    position = [e.window_position_rmse for e in chosen]
    heading = [e.window_heading_rmse for e in chosen]
    length = formatting.number(content.windows.prediction)
    yield from _tile(f"position error of {length} s predictions", position, 1e3, "mm", part, learned)
    yield from _tile(
        f"heading error of {length} s predictions", heading, degrees(1.0), "°", part, learned
    )


def _tile(
    label: str, changes: Sequence[Change], factor: float, unit: str, part: str, learned: bool
) -> Iterator[tuple[str, str, str]]:
    pairs = [(c.before, c.after) for c in changes if c.before is not None]
    if not pairs:
        return
    before = float(np.sqrt(np.mean([b**2 for b, _ in pairs])))
    after = [a for _, a in pairs if a is not None]
    shown = formatting.number(before, factor=factor)
    remark = f"{part} runs"
    if learned and len(after) == len(pairs):
        last = float(np.sqrt(np.mean(np.square(after))))
        shown += f" → {formatting.number(last, factor=factor)}"
        remark += f", {formatting.times(before, last)} less" if last <= before else ", more than before"
    yield label, f"{shown} {unit}", remark


def bounded(stability: StabilityResult) -> str:
    """The verdict on the learned model in a simulation."""
    if stability.closed_loop:
        return (
            "Closed loops stay bounded" if stability.bounded else "A closed loop does not stay bounded"
        )
    how = "stays" if stability.bounded else "does not stay"
    return f"Without thrust its motion {how} bounded"

"""Puts the report together: what is in the JSON file in words and tables, and the figures."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import cosim

from ..evidence import Evidence
from . import figures, tracks, words
from .regions import QUANTITIES, regions
from .shape import Curve, curves
from .svg import inline, style

PROVENANCE = {
    "files": "files",
    "runs": "runs",
    "model": "model",
    "effects_file": "effects of the user",
    "prior": "doubt of the coefficients",
    "seed": "seed",
    "versions": "versions",
    "command": "command",
}


class Drawing(NamedTuple):
    """A figure of the page: its ``<svg>`` element, and what is written below it."""

    svg: Any
    caption: str


def write_report(
    path: str | Path,
    result: Mapping[str, Any],
    evidence: Sequence[Evidence],
    omega_std: Sequence[np.ndarray] | None = None,
    shapes: Sequence[Curve] | None = None,
    advance: Callable[[str], None] = lambda _: None,
) -> Path:
    """Write the report: one HTML file that needs nothing else.

    Args:
        path: of the file; an older one is replaced when the new one is whole.
        result: content of ``diagnosis.json``, or of ``comparison.json``; keys that are not there are
            left out of the page.
        evidence: of each run, in the order of ``result["errors"]``.
        omega_std: standard deviation (K, 3) [N, N, N m] of each run's omega; None if not known.
        shapes: learned shapes to draw; by default those of the effects that are one.
        advance: told what is being done.

    Returns:
        The path.
    """
    path = Path(path)
    learned = any(e.after is not e.before for e in evidence)
    advance("report: figures")
    if shapes is None:
        shapes = curves(result.get("effects") or (), evidence)
    with style():
        drawn = {
            "shapes": list(_shapes(shapes)),
            "ranking": list(_ranking(result)),
            "tracks": list(_tracks(evidence, learned)),
            "growth": list(_growth(evidence, learned)),
            "omega": list(_omega(evidence, omega_std, learned)),
            "where": list(_where(evidence, omega_std, learned)),
        }
    advance("report: page")
    text = _template().render(
        r=result,
        verdict=words.VERDICTS.get(result.get("verdict", ""), ""),
        title="Diagnosis" if "verdict" in result else "Model against measurements",
        learned=learned,
        figures=drawn,
        tiles=list(_tiles(result, learned)),
        runs=[(e.name, e.held_out, e.smoothed.counts, e.smoothed.track.notes) for e in evidence],
        where=words.sentences(result.get("where")),
        provenance=[(label, result[k]) for k, label in PROVENANCE.items() if result.get(k) is not None],
    )
    with cosim.whole(path) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return path


def _template() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    filters = (words.number, words.unit, words.percent, words.plain)
    environment.filters |= {f.__name__: f for f in filters}
    environment.globals["times"] = words.times
    return environment.get_template("page.html")


def _draw(figure: Any, key: str, label: str, caption: str) -> Drawing:
    from markupsafe import Markup

    return Drawing(Markup(inline(figure, key, label)), caption)


def _part(e: Evidence) -> str:
    return "held out" if e.held_out else "training"


def _named(e: Evidence, learned: bool) -> str:
    return f"{e.name} ({_part(e)})" if learned else e.name


def _tracks(evidence: Sequence[Evidence], learned: bool) -> Iterator[Drawing]:
    for k, e in enumerate(evidence):
        name = _named(e, learned)
        yield _draw(tracks.track(e, learned), f"track-{k}", f"Track of {e.name}", f"{name}.")
        closer = tracks.worst(e, learned)
        if closer is not None:
            caption = f"{name}: the worst window."
            yield _draw(closer, f"worst-{k}", f"The worst window of {e.name}", caption)


def _growth(evidence: Sequence[Evidence], learned: bool) -> Iterator[Drawing]:
    for held_out in (False, True):
        runs = [e for e in evidence if e.held_out == held_out and e.windows is not None]
        if not runs:
            continue
        part = "held-out" if held_out else ("training" if learned else "all")
        caption = f"Error of prediction over time, {part} runs: median, and half of all samples."
        figure = tracks.growth(runs, learned)
        yield _draw(figure, f"growth-{part}", caption, caption)


def _omega(
    evidence: Sequence[Evidence], std: Sequence[np.ndarray] | None, learned: bool
) -> Iterator[Drawing]:
    for k, e in enumerate(evidence):
        if not e.integrals.middle.size:
            continue
        figure = figures.model_error(e, None if std is None else std[k], learned)
        yield _draw(figure, f"omega-{k}", f"Model error over time, {e.name}", f"{_named(e, learned)}.")


def _where(
    evidence: Sequence[Evidence], std: Sequence[np.ndarray] | None, learned: bool
) -> Iterator[Drawing]:
    if not any(e.integrals.middle.size for e in evidence):
        return
    for k, quantity in enumerate(QUANTITIES):
        figure = figures.where(quantity, regions(quantity, evidence, std), learned)
        caption = f"Model error by {quantity.name}."
        yield _draw(figure, f"where-{k}", caption, caption)


def _ranking(result: Mapping[str, Any]) -> Iterator[Drawing]:
    ranked = [r for r in result.get("ranking") or () if r.get("score") is not None]
    if ranked:
        first = (result.get("effects") or [{}])[0]
        figure = figures.ranking(ranked, first.get("indistinguishable") or ())
        caption = f"The best of {len(ranked)} candidates."
        if first.get("confidence") is not None:
            share = words.percent(first["confidence"])
            caption += f" {first['id']} comes first in {share} of the data drawn again by chance."
        yield _draw(figure, "ranking", "Candidates in the order of their loss", caption)


def _shapes(shapes: Sequence[Curve]) -> Iterator[Drawing]:
    for k, c in enumerate(shapes):
        caption = f"{c.id}: before and learned. Grey: hardly any data."
        yield _draw(figures.curve(c), f"curve-{k}", f"Learned shape of {c.id}", caption)


def _tiles(result: Mapping[str, Any], learned: bool) -> Iterator[tuple[str, str, str]]:
    """Label, number and remark of the numbers that come first: over held-out runs if there are any."""
    errors = result.get("errors") or []
    chosen = [e for e in errors if e.get("held_out")] or errors
    part = (
        "held-out" if any(e.get("held_out") for e in errors) else ("training" if learned else "measured")
    )
    for key, label, factor, unit in (
        ("window_position_rmse", "position error of 8 s predictions", 1e3, "mm"),
        ("window_heading_rmse", "heading error of 8 s predictions", float(np.degrees(1.0)), "°"),
    ):
        pairs = [e[key] for e in chosen if e.get(key) and e[key].get("before") is not None]
        if not pairs:
            continue
        before = float(np.sqrt(np.mean([p["before"] ** 2 for p in pairs])))
        after = [p.get("after") for p in pairs]
        shown = words.number(before, factor=factor)
        remark = f"{part} runs"
        if learned and all(a is not None for a in after):
            last = float(np.sqrt(np.mean(np.square(after))))
            shown += f" → {words.number(last, factor=factor)}"
            remark += f", {words.times(before, last)} less" if last <= before else ", more than before"
        yield label, f"{shown} {unit}", remark

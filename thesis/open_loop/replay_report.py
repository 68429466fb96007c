"""A replay as results for people and programs: ``replay.json``, ``replay.csv`` and the page."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.report import (
    AFTER,
    BAND,
    BEFORE,
    Document,
    Plot,
    ReportSection,
    Table,
    number,
    numbers,
    percent,
)

from ..analysis.page_figure import PageFigure, figure_of
from .replayed import Replay, stretches
from .run_source import ASKED, COMMAND, ERRORS

POINTS = 1500  # of a line, so that the page stays small (chosen)
PANELS = 8  # most coefficients that are drawn; more are in the files
OMEGA = ("omega_hat_X", "omega_hat_Y", "omega_hat_N")


def estimates(r: Replay) -> list[str]:
    """Names of the estimated parameters that the controller shows."""
    return [n.partition(".")[2] for n in r.played.log if n.startswith("controller.phi_hat_")]


def content(r: Replay) -> dict[str, Any]:
    """The content of ``replay.json``."""
    played, log, time = r.played, r.played.log, r.time
    last = {name: float(log[f"controller.{name}"][-1]) for name in estimates(r)}
    sigma = log.get("controller.sigma_min")
    return {
        "run": played.source.name,
        "controller": played.loop.controller,
        "observer": played.loop.observer,
        "applied_force": played.loop.stated,
        "own_controller": played.loop.own,
        "step": played.source.step,
        "samples": played.source.time.size,
        "recovered": {name: int(gap.sum()) for name, gap in played.source.lost.items()},
        "agreement": r.agreement,
        "stored": {"count": r.stored.size, "times": r.stored},
        "blocked": {
            "share": float(r.blocked.mean()),
            "times": [[time[a], time[b]] for a, b in stretches(r.blocked)],
        },
        "spikes": {"count": r.spikes.size, "times": r.spikes},
        "spike_share": r.spike_share,
        "sigma_min": None if sigma is None else float(sigma[-1]),
        "phi_hat": last,
        "notes": played.notes,
    }


def write_series(path: Path, r: Replay) -> None:
    """Every signal at the samples of the run, named as in a log, and 1 where the run had lost it."""
    names = [*(f"controller.{n}" for n in (*ERRORS, *ASKED, *OMEGA, *estimates(r)))]
    names += [
        f"controller.{n}" for n in ("sigma_min", "stored", "stored_at", "beta", "by_store", "by_now")
    ]
    names += [f"thrusters.{n}" for n in COMMAND]
    there = [n for n in names if n in r.played.log]
    lost = r.played.source.lost
    columns = [r.played.source.track.run.time, *(r.played.at_samples(n) for n in there)]
    columns += [gap.astype(int) for gap in lost.values()]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *there, *(f"recovered.{name}" for name in lost)])
        writer.writerows(zip(*(c.tolist() for c in columns), strict=True))


def sentences(r: Replay) -> Iterator[str]:
    """What was found, a line each."""
    played = r.played
    lost = {name: int(gap.sum()) for name, gap in played.source.lost.items()}
    what = ", ".join(f"{name} {count}" for name, count in lost.items())
    yield f"Run {played.source.name}: {f'samples recovered: {what}' if lost else 'nothing was lost'}."
    worst = r.agreement
    if worst and played.loop.own:
        name = max(worst, key=lambda k: worst[k])
        yield (
            f"The replayed signals differ from those in the run by at most {number(worst[name])} "
            f"({name})."
        )
    elif not played.loop.own:
        yield "The run was made with another controller or observer, or does not name it."
    if "controller.stored" in played.log:
        share = r.spike_share
        yield (
            f"{r.stored.size} samples stored, learning blocked {percent(float(r.blocked.mean()))} "
            f"of the time; {r.spikes.size} spikes and jumps."
        )
        stated = [("of the time", "time"), ("of the stored samples", "stored")]
        stated += [("of the update by the store", "by_store"), ("by the present error", "by_now")]
        parts = [f"{percent(share[k])} {text}" for text, k in stated if np.isfinite(share[k])]
        yield f"Within a second after one: {', '.join(parts)}."
    yield from played.notes


def document(r: Replay) -> Document:
    """The page."""
    first, *rest = sentences(r)
    lost = r.played.source.lost
    sections = [
        ReportSection("Results", rest),
        ReportSection(
            "Errors and force",
            ["Lines: the replayed signals. Dots: the signals of the run, where it has lost samples."],
            [Table(["signal", "lost", "largest difference"], _rows(r))],
            [
                Plot(_signals(r, ERRORS[:3]), "z1 (Fig. 7.1)."),
                Plot(_signals(r, ERRORS[3:]), "z2."),
                Plot(_signals(r, COMMAND), "Force after clipping."),
            ],
        ),
    ]
    learning = [Plot(_over_time(r, OMEGA), "Estimated model error ω̂.")]
    names = estimates(r)
    for k in range(0, min(len(names), 2 * PANELS), PANELS):
        learning.append(Plot(_over_time(r, names[k : k + PANELS]), "Estimated parameters φ̂."))
    if "controller.sigma_min" in r.played.log:
        learning.append(
            Plot(_over_time(r, ("sigma_min", "by_store", "by_now")), "Store and rates of learning.")
        )
    text = ["Grey: learning was blocked. Marks on the axis: a sample was stored."]
    sections.append(ReportSection("Learning", text, (), learning))
    made = {
        "run": r.played.source.name,
        "controller": r.played.loop.controller["path"],
        "observer": r.played.loop.observer["path"],
        "lost": ", ".join(lost) or "nothing",
    }
    return Document("Replay", first, sections, made)


def _rows(r: Replay) -> list[list[Any]]:
    lost = r.played.source.lost
    differ = r.agreement
    return [
        [name, int(lost[name].sum()) if name in lost else 0, *numbers([differ.get(name, np.nan)])]
        for name in r.played.source.compared
    ]


def _signals(r: Replay, names: tuple[str, ...]) -> PageFigure:
    """Signals over time, with what the run has of those that it lost in part."""
    figure = figure_of(1.3 * len(names))
    panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    source = r.played.source
    rows = np.unique(np.linspace(0, source.time.size - 1, POINTS).astype(int))
    for panel, name in zip(panels, names, strict=True):
        if name in source.lost:
            there = rows[np.isfinite(source.compared[name][rows])]
            panel.plot(
                source.time[there], source.compared[name][there], ".", color=BEFORE, markersize=2.5
            )
        panel.plot(source.time[rows], r.signal(name)[rows], color=AFTER, linewidth=0.8)
        panel.set_ylabel(name, fontsize=7.0)
    panels[-1].set_xlabel("time [s]")
    return figure


def _over_time(r: Replay, names: "list[str] | tuple[str, ...]") -> PageFigure:
    """Signals of the controller over time, blocked stretches shaded, stored samples marked."""
    figure = figure_of(0.6 + 1.0 * len(names))
    panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    rows = np.unique(np.linspace(0, r.time.size - 1, POINTS).astype(int))
    for panel, name in zip(panels, names, strict=True):
        values = r.played.log[f"controller.{name}"]
        panel.plot(r.time[rows], values[rows], color=AFTER, linewidth=0.9)
        for a, b in stretches(r.blocked):
            panel.axvspan(r.time[a], r.time[b], color=BAND, alpha=0.3, linewidth=0.0)
        panel.plot(r.stored, np.full(r.stored.size, values.min()), "|", color=BEFORE, markersize=4.0)
        panel.set_ylabel(name, fontsize=7.0)
    panels[-1].set_xlabel("time [s]")
    return figure

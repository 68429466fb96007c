"""What ``watch_thrusters.fmu`` says of a measured run: ``watch.json`` and its page."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.report import AFTER, BAND, BEFORE, Document, Plot, ReportSection, Table, number, numbers

from ..analysis.page_figure import PageFigure, figure_of
from .playback import Played
from .replayed import stretches

WATCH = "watch_thrusters.fmu"
THRUSTERS = {"vsp": "the VSP", "bow": "the bow thruster"}
SURE = 0.5  # probability from which a failure is reported
# Alarms in an hour without a failure, by benchmarks.watch_delay (seed 2, 100 runs).
FALSE_ALARMS = 1.2
POINTS = 1500  # of a line (chosen)


@dataclass(frozen=True)
class Alarm:
    """A stretch in which a failure is reported.

    Attributes:
        thruster: ``vsp`` or ``bow``.
        since: when it began [s], as the detector estimates when it is surest.
        noticed, until: first and last time at which it is reported [s].
        confidence: largest probability.
        lost: share of the force that is lost, then.
    """

    thruster: str
    since: float
    noticed: float
    until: float
    confidence: float
    lost: float


def alarms(played: Played) -> list[Alarm]:
    """All stretches in which a failure is reported, the longest first."""
    log, start = played.log, float(played.source.track.run.time[0])
    time = log["time"] + start
    found = []
    for thruster in THRUSTERS:
        sure = log[f"controller.failed_{thruster}"]
        for a, b in stretches(sure > SURE):
            k = a + int(np.argmax(sure[a : b + 1]))
            since = float(log["controller.since"][k]) + start
            lost = float(log[f"controller.lost_{thruster}"][k])
            found.append(Alarm(thruster, since, time[a], time[b], float(sure[k]), lost))
    return sorted(found, key=lambda x: x.noticed - x.until)


def content(played: Played) -> dict[str, Any]:
    """The content of ``watch.json``."""
    every = alarms(played)
    first = every[0] if every else None
    return {
        "run": played.source.name,
        "observer": played.loop.observer,
        "thruster": first.thruster if first else None,
        "time": first.since if first else None,
        "noticed": first.noticed if first else None,
        "confidence": first.confidence if first else highest(played),
        "lost": first.lost if first else None,
        "false_alarms_per_hour": FALSE_ALARMS,
        "alarms": [vars(a) for a in every],
        "notes": played.notes,
    }


def highest(played: Played) -> float:
    """The largest probability of any failure."""
    return max(float(played.log[f"controller.failed_{t}"].max()) for t in THRUSTERS)


def sentences(played: Played) -> Iterator[str]:
    """What was found, a line each."""
    every = alarms(played)
    name = played.source.name
    if not every:
        yield (
            f"Run {name}: no failed thruster detected (probability at most {number(highest(played))})."
        )
    for a in every:
        yield (
            f"Run {name}: {THRUSTERS[a.thruster]} lost {number(100.0 * a.lost, 2)} % of its force "
            f"at {number(a.since, 4)} s (probability {number(a.confidence)}, detected at "
            f"{number(a.noticed, 4)} s, reported until {number(a.until, 4)} s)."
        )
    yield from played.notes


def document(played: Played) -> Document:
    """The page."""
    first, *rest = sentences(played)
    rows = [
        [THRUSTERS[a.thruster], *numbers([a.since, a.noticed, a.until, a.confidence, a.lost], 4)]
        for a in alarms(played)
    ]
    header = ["thruster", "since [s]", "noticed [s]", "until [s]", "probability", "share lost"]
    text = [
        *rest,
        "The detector learns the usual level for a velocity and a command for at least 50 s, then "
        "compares the last 10 s with it (7.2.5). It cannot detect the failure of a thruster "
        "without a command.",
        f"In simulated runs without a failure it reports {number(FALSE_ALARMS)} an hour "
        "(benchmarks.watch_delay).",
    ]
    sections = [
        ReportSection(
            "Failures",
            text,
            [Table(header, rows)] if rows else [],
            [
                Plot(_lines(played, "failed", "probability"), "Probability of a failure."),
                Plot(_lines(played, "lost", "share"), "Estimated lost share of the force (Fig. 7.3)."),
            ],
        )
    ]
    made = {"run": played.source.name, "observer": played.loop.observer["path"], "detector": WATCH}
    return Document("Thrusters", first, sections, made)


def _lines(played: Played, what: str, label: str) -> PageFigure:
    figure = figure_of(2.2)
    panel = figure.subplots()
    time = played.log["time"] + played.source.track.run.time[0]
    rows = np.unique(np.linspace(0, time.size - 1, POINTS).astype(int))
    for colour, (thruster, name) in zip((AFTER, BEFORE), THRUSTERS.items(), strict=True):
        values = played.log[f"controller.{what}_{thruster}"]
        panel.plot(time[rows], values[rows], color=colour, linewidth=1.0, label=name)
    panel.axhline(SURE if what == "failed" else 0.0, color=BAND, linewidth=0.7)
    panel.set(xlabel="time [s]", ylabel=label, ylim=(-0.1, 1.1))
    panel.legend()
    return figure

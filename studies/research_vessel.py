"""R/V Gunnerus in its sea trial of 27 October 2022: ``python -m studies.research_vessel DATA``.

DATA is the folder of ``trial_1.csv`` and ``trial_2.csv``, two stretches of the table that NTNU publishes
(NTNU-MCS/MCSim_python, ``RVG_ManeuveringTests.csv``, GPL-3.0-or-later), with its columns. It is not part
of this project. The log's own clock, scales and axes are repaired by its redundant channels first.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diagnosis
from diagnosis import Model
from diagnosis.execution.progress import silent
from diagnosis.predictors import free_runs, ship_with
from diagnosis.runs import Examined, Run, examine
from diagnosis.search import Method

from .ship_folds import ShipFold, folds_command, learn_folds, read, titled, write_folds
from .study_report import Report

HORIZON = 60.0  # s, of predictions: the ship goes ten lengths
BEFORE = 20.0  # s of the approach that are kept before each manoeuvre
AHEAD = 2.0  # m, of the velocity's place before the centre of gravity, the publication's guess
LAST = 0.5  # of a circle that counts as steady; chosen
# Column of the files -> signal, factor to SI. A positive angle of the azimuths turns the ship to port.
COLUMNS = {
    "tvec": ("time", 1.0),
    "N": ("x", 1.0),
    "E": ("y", 1.0),
    "psi": ("psi", np.pi / 180.0),
    "u": ("u", 1.0),
    "v": ("v", 1.0),
    "r": ("r", np.pi / 180.0),
    "Azi": ("azimuth.alpha", np.pi / 180.0),
    "RPM": ("azimuth.n", 1.0 / 60.0),
}


class Manoeuvre(NamedTuple):
    """A stretch of a trial, in seconds of its log."""

    name: str
    start: float
    end: float


MANOEUVRES: dict[str, tuple[Manoeuvre, ...]] = {
    "trial_1": (
        Manoeuvre("straight", 0.0, 489.0),
        Manoeuvre("circle to port, 31°", 489.0, 684.0),
        Manoeuvre("straight, 700 s", 700.0, 1215.0),
        Manoeuvre("circle to starboard, 30°", 1215.0, 1399.0),
        Manoeuvre("zig-zag 10/10", 1626.0, 1779.0),
        Manoeuvre("zig-zag 10/20", 1963.0, 2188.0),
        Manoeuvre("circle to starboard, 9°", 2317.0, 2557.0),
        Manoeuvre("zig-zag 5/10", 2720.0, 2892.0),
        Manoeuvre("circle to port, 11°", 2982.0, 3214.0),
        Manoeuvre("zig-zag 10/20, slow", 3353.0, 3662.0),
        Manoeuvre("zig-zag 5/10, slow", 3757.0, 4041.0),
    ),
    "trial_2": (
        Manoeuvre("straight, 5300 s", 5300.0, 5984.0),
        Manoeuvre("man overboard", 5984.0, 6184.0),
        Manoeuvre("straight, 6230 s", 6230.0, 6966.0),
        Manoeuvre("circle to port, 32°", 7109.0, 7369.0),
        Manoeuvre("circle to port, 20°", 7577.0, 7741.0),
        Manoeuvre("straight, 7780 s", 7780.0, 8237.0),
    ),
}


def cut(run: Run, examined: Examined, manoeuvres: Sequence[Manoeuvre]) -> Iterator[Run]:
    """The manoeuvres of a repaired trial, each as a run of the rows with a telegram, with its name."""
    kept = np.ones(run.time.size, bool)
    for f in examined.findings:
        if f.kind == "clock_gap":  # its rows are left out
            kept &= (run.time <= f.start) | (run.time >= f.end)
    log, telegram = run.time[kept], np.isfinite(examined.run.pose).all(axis=1)
    for m in manoeuvres:
        part = examined.run.rows(telegram & (log >= m.start - BEFORE) & (log <= m.end))
        yield replace(part, name=m.name)


def closure(run: Run) -> float:
    """Median distance [m] that integrated speed and heading miss the position by, over 60 s."""
    known = np.isfinite(run.pose).all(axis=1) & np.isfinite(run.measured["u"])
    t, (x, y, psi) = run.time[known], run.pose[known].T
    psi = np.unwrap(psi)
    u, v = run.measured["u"][known], run.measured["v"][known]
    ahead = np.column_stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
    steps = 0.5 * (ahead[1:] + ahead[:-1]) * np.diff(t)[:, None]
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    starts = np.arange(t[0], t[-1] - HORIZON, HORIZON)
    a, b = np.searchsorted(t, starts), np.searchsorted(t, starts + HORIZON)
    place = np.column_stack([x, y])
    return float(np.median(np.hypot(*(place[b] - place[a] - way[b] + way[a]).T)))


def steady(time: np.ndarray, pose: np.ndarray) -> tuple[float, float]:
    """Speed [m/s] and yaw rate [rad/s] of the last part of a track (n, 3) at times (n,) [s]."""
    late = time >= time[-1] - LAST * (time[-1] - time[0])
    last, psi = pose[late], np.unwrap(pose[late, 2])
    seconds = float(time[late][-1] - time[late][0])
    way = np.hypot(*np.diff(last[:, :2], axis=0).T).sum()
    return float(way / seconds), float(abs(psi[-1] - psi[0]) / seconds)


def circles(report: Report, folds: Sequence[ShipFold], model: Model) -> None:
    """Speed and yaw rate of the circles left out, from a free run with the measured commands."""
    rows = []
    for fold in folds:
        for e in fold.found.comparison.evaluations:
            if not e.held_out or not e.name.startswith("circle"):
                continue
            s = e.smoothed
            known = np.isfinite(s.eta).all(axis=1)
            time, free = free_runs(s, [model, fold.found.learned.model])
            tracks = [(s.time[known], s.eta[known]), *((time, pose) for pose in free)]
            rows.append((e.name, [steady(*track) for track in tracks]))
    report.heading("Circles")
    report.text(
        "Each with its measured commands from its initial state; the model was learned from other runs."
    )
    report.table(
        ["circle", "speed [m/s]: measured, before, after", "yaw rate [°/s]: measured, before, after"],
        [
            [
                name,
                ", ".join(f"{speed:.2f}" for speed, _ in three),
                ", ".join(f"{degrees(rate):.2f}" for _, rate in three),
            ]
            for name, three in rows
        ],
    )
    values = np.array([three for _, three in rows])  # (circles, 3, 2)
    if len(values):
        off = np.median(np.abs(values[:, 1:] / values[:, :1] - 1.0), axis=0)
        report.text(
            f"Median: speed off by {100.0 * off[0, 0]:.2g} % before, {100.0 * off[1, 0]:.2g} % after; "
            f"yaw rate by {100.0 * off[0, 1]:.2g} % and {100.0 * off[1, 1]:.2g} %."
        )
    report.result("circles", values)


def sensors(report: Report, trials: Sequence[tuple[Run, Examined]]) -> None:
    """What the sensors got wrong."""
    report.heading("Faults of the sensors")
    for run, examined in trials:
        rates = [f.value for f in examined.findings if f.kind == "clock_rate"]
        others = [f.sentence for f in examined.findings if f.kind != "clock_rate"]
        if rates:
            stated = f"{min(rates):.2f} to {max(rates):.2f} s pass in one second of the log"
            others.insert(0, f"the clock: {stated}, in {len(rates)} stretches")
        report.text(
            f"{run.name}: over {HORIZON:g} s integrated speed and heading differ from the position "
            f"by {closure(run):.3g} m (median) as logged, by {closure(examined.run):.3g} m as "
            "repaired."
        )
        report.items([*others, *examined.notes])


Trials = list[tuple[Run, Examined]]


def manoeuvres(data: Path) -> tuple[list[Run], Model, Trials]:
    """The manoeuvres of the repaired trials, the ship with the place of its antenna, and the trials."""
    ship = ship_with((), "gunnerus")
    trials = []
    for name in MANOEUVRES:
        run = read(data / f"{name}.csv", COLUMNS, Model(ship=ship))
        trials.append((run, examine(run, ship.scale)))
    places = [f.value for _, e in trials for f in e.findings if (f.channel, f.kind) == ("x", "place")]
    ahead = AHEAD + (float(np.mean(places)) if places else 0.0)
    parts = [p for run, e in trials for p in cut(run, e, MANOEUVRES[run.name])]
    return parts, Model(vessel={"marker_offset_dx": ahead}, ship=ship), trials


def study(data: Path, out: Path, folds: int | None, by: str | Method, quick: bool) -> Path:
    """Repair the trials, learn from their manoeuvres, some left out in turn, and write what came out."""
    parts, model, trials = manoeuvres(data)
    ahead = model.vessel["marker_offset_dx"]
    parts = parts[::3] if quick else parts
    runs = diagnosis.gather(parts, model=model, anyway=True, horizon=HORIZON)
    report = Report(out, titled("R/V Gunnerus: sea trial", by))
    report.text(
        f"{len(runs)} manoeuvres; the nominal model is the published one (`ships/gunnerus.toml`), the "
        f"position measured {ahead:.3g} m ahead of the centre of gravity. Predictions over "
        f"{HORIZON:g} s; model error in windows of {runs[0].width:.3g} s."
    )
    sensors(report, trials)
    found = list(learn_folds(runs, folds, model, by, silent))
    write_folds(report, found)
    circles(report, found, model)
    return report.write()


def main() -> None:
    """Command line; leaves with an exit code."""
    folds_command(
        "research_vessel",
        "Learn the missing effects of R/V Gunnerus from its sea trial.",
        "~/gunnerus",
        "folder of the two trials",
        "manoeuvre",
        study,
    )


if __name__ == "__main__":
    main()

"""A described ship on its measured runs: each run predicted by what was learned of others.

The runs are dealt into folds; each fold is left out in turn. With as many folds as runs each run is left
out alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import degrees
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import diagnosis
from cosim import InputError
from diagnosis import Content, Diagnosis, Model, WeakWindows, diagnosis_content
from diagnosis.execution.progress import Advance
from diagnosis.predictors import omega
from diagnosis.runs import Run, read_frame
from diagnosis.search import DEFAULT, Findings, Method, Prior

from .study_command import run_study, study_parser
from .study_report import Report


class ShipFold(NamedTuple):
    """What was learned without some runs: names of those, the diagnosis, and its content."""

    left_out: Sequence[str]
    found: Diagnosis
    content: Content

    @property
    def errors(self) -> list[Any]:
        """Of the runs left out."""
        return [e for e in self.content.errors if e.held_out]


class NoSearch:
    """No effect is searched for: what calibration alone gives."""

    name = "calibration"

    def fit(
        self, runs: Sequence[WeakWindows], model: Model, prior: Prior, advance: Advance, seed: int
    ) -> Findings:
        error = np.concatenate([omega(w, model) for w in runs])
        return Findings(model=model, sigma=np.sqrt(np.mean(error**2, axis=0)))


def read(path: Path, columns: Mapping[str, tuple[str, float]], model: Model) -> Run:
    """A run of a ship from a table with columns of its own.

    Args:
        path: CSV.
        columns: of the file -> signal, factor to SI.
        model: of the ship.

    Raises:
        InputError: it is absent, or has other columns.
    """
    if not path.is_file():
        raise InputError(f"no trial '{path}'")
    table = pd.read_csv(path)
    missing = [name for name in columns if name not in table]
    if missing:
        raise InputError(f"'{path}' has no column '{missing[0]}'")
    signals = {signal: factor * table[name] for name, (signal, factor) in columns.items()}
    return read_frame(pd.DataFrame(signals), path.stem, model.ship)


def folds_command(
    name: str, description: str, example: str, data: str, one: str, study: Callable[..., Path]
) -> None:
    """Command line of a study of a ship's measured runs; leaves with an exit code.

    Args:
        name, description: of the study.
        example: a folder of the data.
        data: what that folder is.
        one: what a fold leaves out at the least.
        study: ``study(data, out, folds, by, quick)``, by the method of identification.
    """
    command = f"  python -m studies.{name} {example}"
    parser = study_parser(
        f"studies.{name}", description, f"{command}\n{command} --folds 3", seeds=None, jobs=False
    )
    parser.add_argument("data", type=Path, metavar="DATA", help=data)
    parser.add_argument(
        "--folds",
        type=int,
        metavar="N",
        help=f"number of folds that are left out (default: one for each {one})",
    )
    parser.add_argument("--calibrate", action="store_true", help="search no effects: calibration only")
    options = parser.parse_args()
    by = NoSearch() if options.calibrate else DEFAULT
    folds = 2 if options.quick else options.folds
    run_study(partial(study, options.data, options.out, folds, by, options.quick))


def titled(title: str, by: str | Method) -> str:
    """The title of a report, with the method where it is not the usual one."""
    return title if isinstance(by, str) else f"{title}, by {by.name} alone"


def learn_folds(
    runs: Sequence[WeakWindows],
    folds: int | None,
    model: Model,
    by: str | Method,
    advance: Advance,
) -> Iterator[ShipFold]:
    """Learn from the runs of all folds but one, for each fold.

    Args:
        runs: two or more.
        folds: how many; None: one for each run.
        model: the nominal one of the ship.
        by: method of identification, or its name.
        advance: receives the name of each step when it begins.

    Raises:
        InputError: there are too few runs.
    """
    count = min(folds or len(runs), len(runs))
    if count < 2:
        raise InputError(f"{len(runs)} runs in {count} folds: no training data is left")
    for k in range(count):
        out = [w for i, w in enumerate(runs) if i % count == k]
        rest = [w for i, w in enumerate(runs) if i % count != k]
        found = diagnosis.diagnose(rest, out, model=model, advance=advance, by=by)
        yield ShipFold([w.run.name for w in out], found, diagnosis_content(found, None, []))


def write_folds(report: Report, folds: Sequence[ShipFold]) -> None:
    """Tables of errors before and after on the runs left out, and of what was found each time."""
    errors = [e for fold in folds for e in fold.errors]
    report.heading("Runs left out in turn")
    outputs = sorted({name for e in errors for name in e.measured})
    forces = ["X [N]", "Y [N]", "N [N m]"]
    header = ["run", "position [m]", "heading [°]", *forces, *(f"{name} [N]" for name in outputs)]
    rows = np.array([_numbers(e, outputs) for e in errors])  # (runs, quantities, 2)
    names = [e.run for e in errors]
    for stated, pair in zip(names, rows, strict=True):
        report.result(stated, pair)
    overall = {"root mean square": np.sqrt(np.mean(rows**2, axis=0)), "median": np.median(rows, axis=0)}
    report.table(
        header,
        [[n, *map(_change, r)] for n, r in (*zip(names, rows, strict=True), *overall.items())],
    )
    report.result("overall", overall)
    report.text(_windows(report, folds))
    report.heading("Findings of each fold")
    report.table(
        ["left out", "verdict", "in the model", "rejected", "identifiable only together"],
        [
            [
                ", ".join(fold.left_out),
                fold.content.verdict,
                ", ".join(f"{e.id} ({_share(e.confidence)})" for e in fold.content.accepted) or "–",
                ", ".join(w.id for w in fold.content.withdrawn) or "–",
                "; ".join(", ".join(group) for group in fold.content.correlation.together) or "–",
            ]
            for fold in folds
        ],
        words=True,
    )
    report.heading("Effects that these runs cannot discriminate")
    report.items(dict.fromkeys(_open(folds)))


def _windows(report: Report, folds: Sequence[ShipFold]) -> str:
    """The medians over all windows of the runs left out, before and after."""
    found = []
    for e in (e for fold in folds for e in fold.found.comparison.evaluations if e.held_out):
        for k, of in enumerate((e.before.errors, e.after.errors)):
            if of is not None:
                found += [(k, p, degrees(h)) for p, h in zip(of.position, of.heading, strict=True)]
    every = np.array(found)
    medians = [np.median(every[every[:, 0] == k, 1:], axis=0) for k in (0, 1)]
    report.result("medians of windows", medians)
    (p, h), (q, i) = medians
    return f"Median of all windows: position {p:.3g} → {q:.3g} m, heading {h:.3g} → {i:.3g}°."


def _numbers(e: Any, outputs: Sequence[str]) -> list[tuple[float, float]]:
    """Before and after of every column of the table."""
    p, h, w = e.window_position_rmse, e.window_heading_rmse, e.omega_rms
    measured = [(e.measured[n].rms_before, e.measured[n].rms_after) for n in outputs]
    pairs = [(p.before, p.after), (h.before, h.after), *zip(w.before, w.after, strict=True), *measured]
    found = [tuple(np.nan if x is None else float(x) for x in pair) for pair in pairs]
    found[1] = (degrees(found[1][0]), degrees(found[1][1]))
    return [(a, b) for a, b in found]


def _change(pair: Sequence[float]) -> str:
    return f"{pair[0]:.3g} → {pair[1]:.3g}"


def _share(confidence: float | None) -> str:
    return "–" if confidence is None else f"{100.0 * confidence:.0f} %"


def _open(folds: Sequence[ShipFold]) -> Iterator[str]:
    """What the data leave open, a sentence each."""
    for fold in folds:
        yield from fold.content.inseparable
        for e in fold.content.accepted:
            if e.indistinguishable:
                yield f"{e.id} and {', '.join(e.indistinguishable)}: {e.advice}"

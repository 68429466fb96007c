"""The tanker Esso Osaka on its free-running tests in wind: ``python -m studies.low_speed_tanker DATA``.

DATA is the folder of the files that NAOE-5thLab publishes as FRT-DS-ESSO (CC BY-NC 4.0), one CSV file a
test, ``KIND_DATE_TIME.csv``, with the columns named below. It is not part of this project.
"""

import re
from collections.abc import Callable, Sequence
from functools import partial
from math import degrees, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import diagnosis
from cosim import InputError
from diagnosis import Model, Smoothed, WeakWindows, Windows
from diagnosis.execution.progress import silent
from diagnosis.predictors import ship_with
from fmus.ship import ship

from .ship_folds import read
from .study_command import run_study, study_parser
from .study_report import Report

# Column of the files -> signal, factor to SI. Speeds and yaw rate are later than the pose and left out.
COLUMNS = {
    "t [s]": ("time", 1.0),
    "x_position_mid [m]": ("x", 1.0),
    "y_position_mid [m]": ("y", 1.0),
    "psi_hat [rad]": ("psi", 1.0),
    "n_prop [rps]": ("propeller.n", 1.0),
    "delta_rudder [rad]": ("rudder.delta", 1.0),
    "wind_velo_true [m/s]": ("wind_speed", 1.0),
    "wind_dir_true [rad]": ("wind_direction", 1.0),
}
KINDS = ("turn", "zigzag", "random", "berthing")
HORIZONS = (20.0, 60.0)  # s, of the windows that publications on these tests have
MOVED = 1.5  # prior standard deviations from which on a coefficient is named; chosen


def kind_of(run: str) -> str:
    """The kind of a test, by its name."""
    return run.partition("_")[0]


def log_of(run: str) -> str:
    """The log that a test is cut from; several of a log differ by a number at the end."""
    return re.sub(r"(\d\d_\d\d_\d\d)_\d+$", r"\1", run)


def dealt(runs: Sequence[WeakWindows], folds: int) -> list[list[WeakWindows]]:
    """The runs in folds, of each kind about as many in each, and those of one log together."""
    found: list[list[WeakWindows]] = [[] for _ in range(folds)]
    for kind in KINDS:
        logs = dict.fromkeys(log_of(w.run.name) for w in runs if kind_of(w.run.name) == kind)
        for k, log in enumerate(logs):
            found[k % folds] += [w for w in runs if log_of(w.run.name) == log]
    return found


class LearnedFit(NamedTuple):
    """A learned model, and what gives the bands about its predictions of a run in some windows."""

    model: Model
    bands: Callable[[Smoothed, Windows], Any]


Errors = dict[str, list[tuple[float, float, float]]]  # see :func:`errors`


def errors(runs: Sequence[WeakWindows], model: Model, fit: LearnedFit | None = None) -> Errors:
    """What a model misses by in the windows of each run, of each horizon.

    Args:
        runs: all are predicted at once.
        model: that predicts.
        fit: what gives it its bands; None: it has none.

    Returns:
        Of each run, by horizon: position [m], heading [deg], share of the samples inside the 90 % bands;
        NaN where it has no window.
    """
    found: Errors = {w.run.name: [] for w in runs}
    for seconds in HORIZONS:
        together = diagnosis.Windows([w.smoothed for w in runs], seconds)
        left = together.residuals(model)
        summary, of = together.summary(left), together.run[together.sample_window]
        for k, w in enumerate(runs):
            position, heading = summary.over_all(k)
            inside = nan
            if fit is not None and (of == k).any():
                own = diagnosis.Windows([w.smoothed], seconds)
                bands = fit.bands(w.smoothed, own)
                inside = nan if bands is None else bands.coverage(left[of == k])
            found[w.run.name].append((float(position), degrees(float(heading)), inside))
    return found


def table(report: Report, name: str, found: Errors) -> np.ndarray:
    """Geometric means over the tests, by kind and of all; returns those of all (horizons, 2).

    Args:
        report: that gets the table, and every number in its results.
        name: of the model.
        found: its errors.
    """
    values, kinds = np.array([*found.values()]), np.array([kind_of(run) for run in found])
    has_bands = bool(np.isfinite(values[..., 2]).any())
    rows, means = [], np.zeros((len(HORIZONS), 2))
    for kind in (*KINDS, ""):
        chosen = values[(kinds == kind) | (kind == "")]
        if not len(chosen):
            continue
        means = np.exp(np.nanmean(np.log(chosen[..., :2]), axis=0))
        cells = [f"{x:.3g}" for pair in means for x in pair]
        if has_bands:
            cells += [f"{100.0 * x:.0f}" for x in np.nanmean(chosen[..., 2], axis=0)]
        rows.append([kind or "all", len(chosen), *cells])
    what = ("position", "m"), ("heading", "°")
    units = [f"{name}, {seconds:.0f} s [{unit}]" for seconds in HORIZONS for name, unit in what]
    bands = [f"in the bands, {seconds:.0f} s [%]" for seconds in HORIZONS] if has_bands else []
    report.table(["kind", "tests", *units, *bands], rows)
    report.result(name, found)
    return means


def compare_tests(report: Report, runs: Sequence[WeakWindows], before: Errors, after: Errors) -> None:
    """Of each test the errors after over those before, and in how many tests they are larger.

    Args:
        report: that gets the table.
        runs: the tests.
        before, after: errors of two models on them.
    """
    together = [diagnosis.Windows([w.smoothed for w in runs], h).run for h in HORIZONS]
    counts = np.stack([np.bincount(run, minlength=len(runs)) for run in together], axis=1)
    ratios = np.array([after[w.run.name] for w in runs]) / np.array([before[w.run.name] for w in runs])
    quantities = [f"{what}, {h:.0f} s" for h in HORIZONS for what in ("position", "heading")]
    pairs = ratios[..., :2].reshape(len(runs), -1)
    rows = [
        [w.run.name, *(str(n) for n in count), *(f"{x:.2f}" for x in pair)]
        for w, count, pair in zip(runs, counts, pairs, strict=True)
    ]
    windows = [f"windows of {h:.0f} s" for h in HORIZONS]
    report.table(["test", *windows, *quantities], rows)
    stated = (f"{n} in {q}" for n, q in zip((pairs > 1.0).sum(axis=0), quantities, strict=True))
    report.text(
        f"Of {len(runs)} tests, the errors are larger than the published model's: {'; '.join(stated)}."
    )


def learn(rest: Sequence[WeakWindows], model: Model, search: bool) -> tuple[LearnedFit, str]:
    """What some tests say of a model, with the search for effects or as ``learn --quick``; in words."""
    if search:
        found = diagnosis.diagnose(rest, model=model, advance=silent)
        chosen = found.learned.model if found.changed else model
        effects = ", ".join(f.id for f in found.learned.effects) or "no effect"
        return LearnedFit(chosen, found.bands), f"{found.verdict}, {effects}"
    fit = diagnosis.begin(rest, model=model).calibration
    if fit is None:
        raise InputError("these tests do not determine the coefficients")
    moved = {n: x for n, x in fit.findings.moved.items() if abs(x) > MOVED}
    stated = ", ".join(f"{n} {x:+.1f}" for n, x in sorted(moved.items(), key=lambda m: -abs(m[1])))
    return LearnedFit(fit.findings.model, fit.bands), stated


def study(data: Path, out: Path, folds: int, search: bool, quick: bool) -> Path:
    """The description on all tests, and what is learned of it on those left out in turn."""
    files = [f for kind in KINDS for f in sorted(data.glob(f"{kind}_*.csv"))[:: 4 if quick else 1]]
    if not files:
        raise InputError(f"no tests KIND_DATE_TIME.csv in '{data}'; kinds are {', '.join(KINDS)}")
    model = Model(ship=ship_with((), "esso_osaka"))
    unaware = ship(description=model.ship.description._replace(wind_measured=False))
    read_runs = [read(f, COLUMNS, model) for f in files]
    runs = diagnosis.gather(read_runs, model=model, anyway=True, horizon=HORIZONS[-1])
    report = Report(out, "Esso Osaka, a tanker of 3 m: free-running tests in wind")
    report.text(
        f"{len(runs)} tests. Each number is the geometric mean, over the tests of a kind, of the root "
        "mean square prediction error in consecutive windows that start from the smoothed state. "
        "Data: Wakita et al. (2022), Miyauchi et al. (2022), CC BY-NC 4.0."
    )
    report.heading("The published model")
    report.text("The description is the published model, term by term, from the same initial states.")
    published = errors(runs, model)
    first = table(report, "description", published)
    report.heading("The same without the measured wind")
    table(report, "no wind", errors(runs, Model(ship=unaware)))
    if folds:
        report.heading("Learned, with tests left out in turn")
        report.text(
            "With the search for effects: the verdict of each fold."
            if search
            else "Coefficients alone, as `learn --quick`. After each fold: those that move by more than "
            f"{MOVED:g} standard deviations of their prior, and by how many."
        )
        after: Errors = {}
        for left_out in dealt(runs, folds):
            fit, stated = learn([w for w in runs if w not in left_out], model, search)
            after |= errors(left_out, fit.model, fit)
            report.text(f"Without {', '.join(w.run.name for w in left_out)}: {stated}.")
        ratios = table(report, "learned", after) / first
        stated = (
            f"{r[0]:.2f} in position and {r[1]:.2f} in heading over {seconds:.0f} s"
            for r, seconds in zip(ratios, HORIZONS, strict=True)
        )
        report.text(f"Relative to the published model, all tests: {'; '.join(stated)}.")
        report.heading("Test by test")
        report.text("Errors of each test, left out, over those of the published model.")
        compare_tests(report, runs, published, after)
    return report.write()


def main() -> None:
    """Command line; leaves with an exit code."""
    command = "  python -m studies.low_speed_tanker ~/esso_osaka"
    parser = study_parser(
        "studies.low_speed_tanker",
        "Predict the free-running tests of the Esso Osaka with its published description.",
        f"{command}\n{command} --folds 4 --calibrate",
        seeds=None,
        jobs=False,
    )
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of the files")
    parser.add_argument(
        "--folds",
        type=int,
        metavar="N",
        default=0,
        help="learn, and leave out this number of folds in turn (0: no)",
    )
    parser.add_argument(
        "--calibrate", action="store_true", help="search no effects: coefficients only, as learn --quick"
    )
    options = parser.parse_args()
    search = not options.calibrate
    run_study(partial(study, options.data, options.out, options.folds, search, options.quick))


if __name__ == "__main__":
    main()

"""The tanker Esso Osaka on its free-running tests in wind: ``python -m studies.low_speed_tanker DATA``.

DATA is the folder of the files that NAOE-5thLab publishes as FRT-DS-ESSO (CC BY-NC 4.0), one CSV file a
test, ``KIND_DATE_TIME.csv``, with the columns named below. It is not part of this project.
"""

import re
from collections.abc import Sequence
from functools import partial
from math import degrees
from pathlib import Path

import numpy as np

import diagnosis
from cosim import InputError
from diagnosis import Model, WeakWindows
from diagnosis.execution.progress import silent
from diagnosis.predictors import ship_with
from fmus.ship import ship

from .ship_folds import NoSearch, read
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


def errors(w: WeakWindows, model: Model) -> list[tuple[float, float]]:
    """Position [m] and heading [deg] in the windows of a run, of each horizon; NaN where it has none."""
    found = []
    for seconds in HORIZONS:
        try:
            windows = diagnosis.Windows([w.smoothed], seconds)
        except InputError:
            found.append((np.nan, np.nan))
            continue
        position, heading = windows.errors(model).over_all()
        found.append((float(position), degrees(float(heading))))
    return found


def table(report: Report, name: str, found: dict[str, list[tuple[float, float]]]) -> None:
    """Geometric means over the tests, by kind and of all."""
    rows, values = [], np.array(list(found.values()))  # (runs, horizons, 2)
    kinds = np.array([kind_of(run) for run in found])
    for kind in (*KINDS, ""):
        chosen = values[(kinds == kind) | (kind == "")]
        if not len(chosen):
            continue
        means = np.exp(np.nanmean(np.log(chosen), axis=0))
        cells = [f"{x:.3g}" for pair in means for x in pair]
        rows.append([kind or "all", len(chosen), *cells])
        report.result(f"{name}, {kind or 'all'}", means)
    what = ("position", "m"), ("heading", "°")
    units = [f"{name}, {seconds:.0f} s [{unit}]" for seconds in HORIZONS for name, unit in what]
    report.table(["kind", "tests", *units], rows)


def study(data: Path, out: Path, folds: int, quick: bool) -> Path:
    """The description on all tests, and what calibration makes of it on those left out in turn."""
    files = [f for kind in KINDS for f in sorted(data.glob(f"{kind}_*.csv"))[:: 4 if quick else 1]]
    if not files:
        raise InputError(f"no tests KIND_DATE_TIME.csv in '{data}'; kinds are {', '.join(KINDS)}")
    model = Model(ship=ship_with((), "esso_osaka"))
    unaware = ship(description=model.ship.description._replace(wind_measured=False))
    runs = diagnosis.gather([read(f, COLUMNS, model) for f in files], model=model, anyway=True)
    report = Report(out, "Esso Osaka, a tanker of 3 m: free-running tests in wind")
    report.text(
        f"{len(runs)} tests. Each number is the geometric mean, over the tests of a kind, of the root "
        "mean square prediction error in consecutive windows that start from the smoothed state. "
        "Data: Wakita et al. (2022), Miyauchi et al. (2022), CC BY-NC 4.0."
    )
    report.heading("The published description")
    table(report, "description", {w.run.name: errors(w, model) for w in runs})
    report.heading("The same without the measured wind")
    table(report, "no wind", {w.run.name: errors(w, Model(ship=unaware)) for w in runs})
    if folds:
        report.heading("Calibrated, with tests left out in turn")
        after = {}
        for k, left_out in enumerate(dealt(runs, folds)):
            rest = [w for w in runs if w not in left_out]
            learned = diagnosis.diagnose(
                rest, left_out, model=model, advance=silent, by=NoSearch()
            ).model
            after |= {w.run.name: errors(w, learned) for w in left_out}
            report.text(f"Fold {k + 1} leaves out {', '.join(w.run.name for w in left_out)}.")
        table(report, "calibrated", after)
    return report.write()


def main() -> None:
    """Command line; leaves with an exit code."""
    command = "  python -m studies.low_speed_tanker ~/esso_osaka"
    parser = study_parser(
        "studies.low_speed_tanker",
        "Predict the free-running tests of the Esso Osaka with its published description.",
        f"{command}\n{command} --folds 3",
        seeds=None,
        jobs=False,
    )
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of the files")
    parser.add_argument(
        "--folds",
        type=int,
        metavar="N",
        default=0,
        help="calibrate, and leave out this number of folds in turn (0: no)",
    )
    options = parser.parse_args()
    run_study(partial(study, options.data, options.out, options.folds, options.quick))


if __name__ == "__main__":
    main()

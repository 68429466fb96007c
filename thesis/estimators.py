"""Estimator tests of the thesis, 6.3.3 and Figs. 6.6, 6.8, 6.9: ``python -m thesis.estimators``.

Every observer runs open loop over the same logs: simulated ones, where the truth is known, and measured
ones where ``--data`` gives them.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import cosim
from cosim.dispatch import FinishedRun
from cosim.process import scratch_folder
from studies.measured.data_folder import measured_files
from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report

from .monte_carlo import SampleMean, interval, run_all, shipped, vary, without
from .observers import basin, claims, pictures
from .observers.estimates_replayed import (
    LOGGED,
    OBSERVERS,
    SIGNALS,
    UNITS,
    freezes,
    measures,
    observer,
    replay,
)

STOP, QUICK_STOP, QUICK_SEEDS = 120.0, 60.0, 2
POSE = ["observer.x_m", "observer.y_m", "observer.psi_m"]
# Tracking lost, a marker taken for another one far away, and millimetres taken for metres.
UPSETS = [
    {"kind": "dropout", "signals": POSE, "at": [20.0, 35.0], "duration": 0.5, "value": "nan"},
    {"kind": "dropout", "signals": POSE, "at": [25.0], "duration": 0.5, "value": "zero"},
    {"kind": "spikes", "signals": POSE, "at": [30.0], "size": 10.0},
    {"kind": "spikes", "signals": POSE, "at": [40.0], "size": 1000.0},
]
HIDDEN = {
    "drag": {"vessel.delta_X_u": -4.0},
    "damping": {"vessel.delta_Y_r": 7.25, "vessel.delta_N_r": 1.0},
    "weak thrusters": {"thrusters.plant_F_vsp": 0.8, "thrusters.plant_F_bow": 1.8},
}

Found = dict[str, dict[str, float]]


def variants(stop: float) -> dict[str, dict[str, Any]]:
    """The simulated runs: three paths with and without freezes, upsets, and hidden model errors."""
    found = {}
    for name in ("ellipse", "eight", "rich"):
        content = vary(shipped(name), stop=stop, log={"signals": LOGGED}, metrics={})
        found[name] = content
        found[f"{name}, no freezes"] = vary(content, faults=without(content["faults"], "freeze"))
    upset = found["ellipse, no freezes"]
    found["ellipse, upsets"] = vary(upset, faults=upset["faults"] + UPSETS)
    for name, change in HIDDEN.items():
        for condition in ("", ", no freezes"):
            found[f"rich{condition}, {name}"] = vary(found[f"rich{condition}"], parameters=change)
    return found


def analyse(run: FinishedRun) -> Found:
    """Measures of every observer on one run."""
    run.demand()
    log = run.log
    return {name: measures(log, replay(observer(name), log)) for name in OBSERVERS}


def over_seeds(found: Sequence[Found]) -> dict[str, dict[str, SampleMean]]:
    """Observer -> measure -> mean over the runs, with its interval."""
    return {
        name: {key: interval([run[name][key] for run in found]) for key in found[0][name]}
        for name in OBSERVERS
    }


def error_tables(report: Report, tables: Mapping[str, Mapping[str, Mapping[str, SampleMean]]]) -> None:
    """One table of RMS errors for each simulated run; the least of a column is bold."""
    report.heading("Errors on simulated runs")
    report.text(
        "RMS of estimate minus truth after 10 s; mean over the seeds with its 95 % interval "
        "(Student's t). The least of each column is bold. Noise 0.2 mm and 0.3 mrad."
    )
    header = ["observer", *(f"{name} [{UNITS[name]}]" for name in SIGNALS)]
    for variant, table in tables.items():
        least = {s: min(table[o][f"rms_{s}"].mean for o in OBSERVERS) for s in SIGNALS}
        rows = []
        for o in OBSERVERS:
            cells = [table[o][f"rms_{s}"] for s in SIGNALS]
            marks = [c.mean == least[s] for s, c in zip(SIGNALS, cells, strict=True)]
            rows.append([o, *(f"**{c}**" if m else str(c) for c, m in zip(cells, marks, strict=True))])
        report.text(f"**{variant}**")
        report.table(header, rows)


def examples(report: Report, stop: float) -> None:
    """The pictures of the thesis, from one run with freezes and one with a wrap."""
    logs = {}
    for name in ("rich", "ellipse"):
        scenario = cosim.load_scenario({**variants(stop)[name], "seed": 0})
        with scratch_folder() as folder:
            log = cosim.read_log(cosim.simulate(scenario, folder).folder)
        logs[name] = log, {o: replay(observer(o), log) for o in OBSERVERS}
    report.heading("Pictures")
    log, estimates = logs["rich"]
    report.figure(
        "compared", pictures.compared(log, estimates), "Velocities by every observer, Fig. 6.6"
    )
    longest = max(freezes(log), key=lambda f: f[1] - f[0], default=None)
    if longest is not None:
        figure = pictures.freeze(log, estimates, *longest)
        report.figure(
            "freeze", figure, "Through the longest freeze (grey), Fig. 6.8; cut off at the edges"
        )
    log, estimates = logs["ellipse"]
    figure = pictures.wrap(log, estimates)
    if figure is not None:
        caption = "Pose (6.9a) and yaw rate (6.9b) through a wrap of the heading; cut off at the edges"
        report.figure("wrap", figure, caption)


def measured(report: Report, files: Sequence[Path]) -> dict[str, Any]:
    """The observers on measured runs."""
    report.heading("Measured runs")
    report.text(
        "There is no truth: estimates are compared with a smoother that uses later samples (a "
        "cubic fitted to the pose within 0.5 s on either side, without frozen and lost samples). "
        "The table gives the median and, after the stroke, the RMS of the difference; a few "
        "losses of tracking cause most of the RMS. Prediction: median distance to the pose that "
        "the estimate predicts one sample and 0.5 s ahead, which needs no reference. tau follows "
        "from the five commands by the nominal thrusters. The first 10 s are left out."
    )
    found: dict[str, Any] = {}
    header = ["observer", *(f"{n} [{UNITS[n]}]" for n in SIGNALS), "one sample [mm]", "0.5 s [mm]"]
    for path in files:
        log = basin.read(path)
        h = float(np.median(np.diff(log["time"])))
        estimates = {o: replay(observer(o), log, measurement_period=h) for o in OBSERVERS}
        found[path.stem] = table = {o: basin.measures(log, estimates[o]) for o in OBSERVERS}
        lost = 100.0 * float(np.mean(~basin.valid(log)))
        report.text(
            f"**{path.stem}**: {log['time'][-1]:.0f} s, {lost:.1f} % of the samples frozen or lost"
        )
        report.table(
            header,
            [
                [
                    o,
                    *(f"{row[f'median_{n}']:.2g} / {row[f'rms_{n}']:.2g}" for n in SIGNALS),
                    1e3 * row["one_sample"],
                    1e3 * row["half_second"],
                ]
                for o, row in table.items()
            ],
        )
        figure = pictures.compared(log, estimates, basin.reference(log))
        report.figure(f"measured_{path.stem}", figure, f"{path.stem}: estimates and smoother")
    return found


def study(out: Path, seeds: int, jobs: int | None, quick: bool, data: Path | None) -> Path:
    """Run everything, and the observers on the measured runs of a folder; write the report."""
    files = measured_files(data) if data else []
    chosen = list(range(min(seeds, QUICK_SEEDS) if quick else seeds))
    stop = QUICK_STOP if quick else STOP
    runs = variants(stop)
    report = Report(out, "Estimator tests, 6.3.3", chosen)
    with progress(len(runs) * len(chosen), "runs") as advance:
        found = run_all(runs, chosen, analyse, processes=jobs, advance=advance)
    tables = {name: over_seeds(values) for name, values in found.items()}
    report.text(
        f"The observers {', '.join(OBSERVERS)} run open loop over the measurements and commanded "
        f"forces of the same logs, {stop:g} s each, in which the mdf was in the loop."
    )
    claims.write(report, found)
    error_tables(report, tables)
    examples(report, stop)
    report.result("simulated", tables)
    if files:
        report.result("measured", measured(report, files))
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.estimators",
        "Run the observers open loop on the same logs: errors, lags, freezes, wraps.",
        "  python -m thesis.estimators\n"
        "  python -m thesis.estimators --quick --out /tmp/estimators\n"
        "  python -m thesis.estimators --data ~/cse1",
    )
    parser.add_argument("--data", type=Path, metavar="DIR", help="measured runs, *.mat (default: none)")
    options = parser.parse_args(arguments)
    run_study(partial(study, options.out, options.seeds, options.jobs, options.quick, options.data))


if __name__ == "__main__":
    main()

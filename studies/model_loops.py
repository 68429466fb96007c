"""Models of the model error back in the ship: the runs (a) to (d) of 7.4, and the check before them."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from cosim.dispatch import FinishedRun
from diagnosis import analysis
from diagnosis.analysis import Regressed
from diagnosis.model import Model

from .monte_carlo import Content, run_all, vary
from .study_report import Report
from .trials import CLE, CLZ, LOST, RBS, TRIALS, scenario

SLOW, EIGHT = TRIALS[0], TRIALS[1]
TRACK = ["vessel.x", "vessel.y", "guidance.x_t", "guidance.y_t", "controller.z1_x", "controller.z1_y"]
# Run -> trial, controller, with the guidance fault: 7.4 (a) to (d).
RUNS = {
    "RBS, ellipse, fault": (SLOW, RBS, True),
    "RBS, ellipse": (SLOW, RBS, False),
    "CLZ, ellipse": (SLOW, CLZ, False),
    "CLE, ellipse": (SLOW, CLE, False),
    "RBS, eight": (EIGHT, RBS, False),
}


class Loop(NamedTuple):
    """Distance to the target, RMS [m], mean z1_x over the second half [m], and the track."""

    position: float
    lag: float
    x: np.ndarray
    y: np.ndarray
    x_t: np.ndarray
    y_t: np.ndarray


def loop(run: FinishedRun) -> Loop:
    """The numbers of a run; of one that broke off, what there is."""
    log = run.log
    track = [log[n] for n in TRACK[:4]]
    distance = np.hypot(track[0] - track[2], track[1] - track[3])
    half = log["time"] >= 0.5 * log["time"][-1]
    position = float(np.sqrt(np.mean(distance**2))) if run.status != "failed" else float("nan")
    return Loop(position, float(log["controller.z1_x"][half].mean()), *(x[::10] for x in track))


def eigenvalues(found: Regressed) -> str:
    """Those of I + B_tau, in words."""
    values = ", ".join(f"{x:.3f}" for x in sorted(np.real(analysis.thrust_of(found).eigenvalues)))
    return values if analysis.goes_into_the_plant(found.columns) else "–"


def parameters_of(model: Model) -> dict[str, float]:
    """The model as ``instance.parameter`` -> value."""
    parts = (("vessel", model.vessel), ("thrusters", model.thrusters))
    return {f"{part}.{name}": x for part, given in parts for name, x in given.items()}


def ships(found: Mapping[str, Regressed]) -> dict[str, Model]:
    """The rows of Table 7.1, the regressions that the plant can have, and PLS2 made stable."""
    made = {name: analysis.plant(analysis.row(name)) for name in analysis.TABLE_7_1}
    for name, r in found.items():
        if analysis.goes_into_the_plant(r.columns):
            made[name] = analysis.as_model(r.c, r.B, r.columns)
    wide = found["PLS2"]
    stable = analysis.nearest_stable(wide.X, wide.samples.omega, wide.columns, wide.B)
    made["PLS2, nearest stable"] = analysis.as_model(stable.c, stable.B, wide.columns)
    return made


def contents(models: Mapping[str, Model], seconds: float | None) -> dict[str, Content]:
    """``model|run`` -> scenario: noise and freezes, no spikes, gains of Table 6.4."""
    made = {}
    for name, model in models.items():
        for run, (trial, controller, faulty) in RUNS.items():
            t = trial if seconds is None else trial._replace(seconds=seconds)
            content = scenario(t, controller, faulty, spikes=False, plant=parameters_of(model))
            made[f"{name}|{run}"] = vary(content, log={"signals": TRACK})
    return made


def write_loops(
    report: Report, found: Mapping[str, Regressed], seconds: float | None, jobs: int | None
) -> None:
    """Tables and pictures of 7.4 (Figs. 7.11 to 7.16)."""
    models = ships(found)
    runs = {k: o[0] for k, o in run_all(contents(models, seconds), [0], loop, None, jobs).items()}
    report.heading("Models back in the ship (7.4)")
    rows = []
    for name in models:
        r = found.get(name)
        check = ("yes" if analysis.thrust_of(r).holds else "no") if r is not None else ""
        cells = []
        for run in RUNS:
            o = runs[f"{name}|{run}"]
            lost = "lost, " if not o.position < LOST else ""
            cells.append(f"{lost}{o.position:.3g} ({o.lag:.3g})")
        rows.append([name, "" if r is None else eigenvalues(r), check, *cells])
    report.table(["model in the plant", "eigenvalues of I + B_τ", "check", *RUNS], rows)
    report.text(
        "RMS distance to the target and, in brackets, mean z1_x over the second half [m]; gains of "
        "Table 6.4, noise and freezes, seed 0. `check`: sym(I + B_τ) ≥ 0.05 I, known before the "
        "simulation. SYSID4 is hidden in the runs that the regressions were made of: its line is the "
        "measured ship of Figs. 7.11 and 7.12, that of PLS3 the simulated one."
    )
    for run, figure in (
        ("RBS, ellipse, fault", "Figs. 7.11, 7.12"),
        ("CLZ, ellipse", "Figs. 7.13 to 7.15"),
        ("RBS, ellipse", "Fig. 7.16"),
    ):
        names = [n for n in ("SYSID1", "SYSID4", "PLS2", "PLS3", "PLS4") if n in models]
        chosen = {n: runs[f"{n}|{run}"] for n in names}
        label = run.replace(", ", "_")
        report.figure(f"loop_{label}", tracks(chosen), f"{run}: tracks ({figure}).")


def tracks(runs: Mapping[str, Loop]) -> Figure:
    """The paths of several ships, and that of the target."""
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots()
    first = next(iter(runs.values()))
    axes.plot(first.y_t, first.x_t, "k--", linewidth=1.0, label="target")
    for name, run in runs.items():
        axes.plot(run.y, run.x, linewidth=1.0, label=name)
    axes.set(xlabel="east [m]", ylabel="north [m]")
    axes.set_aspect("equal")
    axes.legend(fontsize=7, ncols=2)
    axes.grid(alpha=0.3)
    return figure

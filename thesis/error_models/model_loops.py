"""Models of the model error back in the ship: the runs (a) to (d) of 7.4, and the check before them."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from cosim.dispatch import FinishedRun
from diagnosis.predictors import Model
from studies.study_report import Report, Verdict

from .. import analysis
from ..analysis import Regressed
from ..basin_trials.trials import CLE, CLZ, RBS, TRIALS, scenario
from ..monte_carlo import Content, run_all, vary
from ..tracking.outcome import LEARNED_FROM, Log, rms
from .lap_pictures import errors_picture, force_picture
from .model_statements import LoopResult, alike, controlled, reacting

SLOW, EIGHT = TRIALS[0], TRIALS[1]
TRACK = ["vessel.x", "vessel.y", "guidance.x_t", "guidance.y_t"]
SIGNALS = [*TRACK, *(f"controller.z1_{n}" for n in ("x", "y", "psi")), *LEARNED_FROM]
# Run -> trial, controller, with the guidance fault: 7.4 (a) to (d).
RUNS = {
    "RBS, ellipse, fault": (SLOW, RBS, True),
    "RBS, ellipse": (SLOW, RBS, False),
    "CLZ, ellipse": (SLOW, CLZ, False),
    "CLE, ellipse": (SLOW, CLE, False),
    "RBS, eight": (EIGHT, RBS, False),
}


def loop(run: FinishedRun) -> LoopResult:
    """The numbers of a run; of one that broke off, what there is."""
    log = run.log
    distance = np.hypot(log["vessel.x"] - log["guidance.x_t"], log["vessel.y"] - log["guidance.y_t"])
    half = log["time"] >= 0.5 * log["time"][-1]
    position = rms(distance) if run.status != "failed" else float("nan")
    return LoopResult(
        position, float(log["controller.z1_x"][half].mean()), {n: x[::10] for n, x in log.items()}
    )


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
            made[f"{name}|{run}"] = vary(content, log={"signals": SIGNALS})
    return made


def unstable(lost: Mapping[str, int], holds: Mapping[str, bool], numbers: str) -> list[Verdict]:
    """Which regressions lose the ship, and whether the check before the simulation tells which."""
    runs = ", ".join(f"{n} {k} of {len(RUNS)}" for n, k in lost.items())
    return [
        Verdict(
            "With PLS3 (SYSMV3; SYSMV4 in the caption) in the plant the ship is lost (7.4, Fig. 7.16)",
            lost["PLS3"] > 0,
            f"runs lost: {runs}. {numbers}",
        ),
        Verdict(
            "(goal) the check before the simulation predicts which regressions lose the ship",
            all(holds[name] == (not count) for name, count in lost.items()),
            f"runs lost: {runs}; check: {', '.join(f'{n} {x}' for n, x in holds.items())}",
        ),
    ]


def why(found: Mapping[str, Regressed]) -> str:
    """What the regressions make of the surge force, and whether the speed hides it."""
    x = next(iter(found.values())).samples.x
    parts = [
        f"{n} ({r.by_axis('factors')['X']} factors) {r.B[0, r.columns.index('tau_X')]:.2f}"
        for n, r in found.items()
        if "tau_X" in r.columns
    ]
    return (
        f"Force in X by unit of τ_X: {', '.join(parts)}. u and τ_X of these runs correlate by "
        f"{np.corrcoef(x[:, 0], x[:, 3])[0, 1]:.2f}; the coefficients of few factors are shrunk"
    )


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
        each = [runs[f"{name}|{run}"] for run in RUNS]
        cells = [f"{'lost, ' if o.lost else ''}{o.position:.3g} ({o.lag:.3g})" for o in each]
        rows.append([name, "" if r is None else eigenvalues(r), check, *cells])
    report.table(["model in the plant", "eigenvalues of I + B_τ", "check", *RUNS], rows)
    report.text(
        "RMS distance to the target and, in brackets, mean z1_x over the second half [m]; gains of "
        "Table 6.4, noise and freezes, seed 0. `check`: sym(I + B_τ) ≥ 0.05 I, known before the "
        "simulation. SYSID4 is hidden in the runs that the regressions were made of: its line is the "
        "measured ship of Figs. 7.11 and 7.12, that of PLS3 the simulated one."
    )
    tried = {n: r for n, r in found.items() if n in models}
    lost = unstable(
        {n: sum(runs[f"{n}|{run}"].lost for run in RUNS) for n in tried},
        {n: analysis.thrust_of(r).holds for n, r in tried.items()},
        why(found),
    )
    hydrodynamic = ("SYSID1", "SYSID4", "PLS4")

    def of(run: str, *names: str) -> dict[str, LoopResult]:
        return {n: runs[f"{n}|{run}"] for n in names}

    learning = of("CLE, ellipse", *hydrodynamic)
    others = {n: r for n, r in learning.items() if n != "SYSID4"}
    verdicts = [
        alike(*of("RBS, ellipse, fault", "SYSID4", "PLS3").values()),
        *controlled(of("RBS, ellipse", *hydrodynamic), learning),
        reacting(learning["SYSID4"], others, "PLS4"),
        *lost,
    ]
    report.verdicts("loops", verdicts)
    for run, names, draw, what in (
        ("RBS, ellipse, fault", ("SYSID4", "PLS3"), tracks, "tracks (Fig. 7.11)"),
        ("RBS, ellipse, fault", ("SYSID4", "PLS3"), errors_picture, "errors (Fig. 7.12a, b)"),
        ("RBS, ellipse, fault", ("SYSID4", "PLS3"), force_picture, "model error (Fig. 7.12c, d)"),
        ("CLE, ellipse", hydrodynamic, tracks, "tracks (Fig. 7.13)"),
        ("CLE, ellipse", hydrodynamic, errors_picture, "errors (Fig. 7.14a)"),
        ("CLE, ellipse", hydrodynamic, force_picture, "model error and estimate (Figs. 7.14b, 7.15)"),
        ("RBS, ellipse", ("SYSID4", "PLS2", "PLS3"), tracks, "tracks (Fig. 7.16)"),
    ):
        shown = draw({n: runs[f"{n}|{run}"].log for n in names if n in models})
        file = f"loop_{run}_{what.split(' (')[0]}".replace(", ", "_").replace(" ", "_")
        report.figure(file, shown, f"{run}: {what}.")


def tracks(logs: Mapping[str, Log]) -> Figure:
    """The paths of several ships, and that of the target."""
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots()
    first = next(iter(logs.values()))
    axes.plot(first["guidance.y_t"], first["guidance.x_t"], "k--", linewidth=1.0, label="target")
    for name, log in logs.items():
        axes.plot(log["vessel.y"], log["vessel.x"], linewidth=1.0, label=name)
    axes.set(xlabel="east [m]", ylabel="north [m]")
    axes.set_aspect("equal")
    axes.legend(fontsize=7, ncols=2)
    axes.grid(alpha=0.3)
    return figure

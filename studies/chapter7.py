"""The analysis of chapter 7 again: ``python -m studies.chapter7``.

The ellipse at 0.08 m/s with SYSID4 in the plant, the gains of Table 6.4, the guidance fault and spikes,
by the four controllers of chapter 6: PCA and PLS of these runs in a row with the thesis' derivative
filter, SysID of a run with the ship's true states, and the models of PLS back in the ship.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

import cosim
from cosim.dispatch import FinishedRun
from diagnosis import analysis
from diagnosis.analysis import Regressed, Samples
from diagnosis.model import write_model

from . import sysid4
from .monte_carlo import Content, run_all, shipped, vary
from .outcome import AXES
from .study_command import progress, run_study, study_parser
from .study_report import Report
from .trials import CONTROLLERS, LABELS, TRIALS, scenario

STATE = [f"vessel.{n}" for n in ("u", "v", "r", "u_dot", "v_dot", "r_dot")]
FORCE = [f"thrusters.tau_cmd_{a}" for a in AXES]
SEEN = [f"observer.{n}_m" for n in ("x", "y", "psi")]
TRACK = ["vessel.x", "vessel.y", "vessel.psi", "guidance.x_t", "guidance.y_t", "guidance.psi_t"]
LOG = {"signals": [*STATE, *FORCE, *SEEN, *TRACK], "every": 1}
MODELS = ("PLS1", "PLS2", "PLS3", "PLS4")


def logged(content: Content, seconds: float | None) -> Content:
    """A scenario with what the analysis needs in its log, cut short if ``seconds`` says so."""
    stop = content["stop"] if seconds is None else seconds
    return vary(content, log=LOG, stop=stop)


def scenarios(seconds: float | None) -> dict[str, Content]:
    """The runs of the basin by controller, and ``true``: backstepping without faults."""
    made = {c: scenario(TRIALS[0], c, faulty=True) for c in CONTROLLERS}
    made["true"] = {**scenario(TRIALS[0], CONTROLLERS[0], spikes=False), "faults": []}
    return {name: logged(c, seconds) for name, c in made.items()}


def folder(run: FinishedRun) -> str:
    """Where a run lies; it must have gone through."""
    run.demand()
    return str(run.folder)


def true_samples(run: Path) -> Samples:
    """Samples with the ship's true velocity and acceleration."""
    log = cosim.read_log(run)
    nu, nu_dot = (np.column_stack([log[n] for n in names]) for names in (STATE[:3], STATE[3:]))
    # The acceleration of a row is that by the force up to it.
    tau = np.column_stack([np.concatenate([log[n][:1], log[n][:-1]]) for n in FORCE])
    names = np.full(log["time"].size, "true", dtype=object)
    return Samples(names, log["time"], nu, nu_dot, tau, analysis.model_error(nu, nu_dot, tau))


def components(report: Report, samples: Samples) -> None:
    """PCA of model error, velocity and force."""
    names = [f"{s}_{a}" for s in ("omega", "nu", "tau") for a in AXES]
    X = np.hstack([samples.omega, samples.nu, samples.tau])
    m = analysis.fit_components(X, names, 4)
    bad = analysis.outliers(m, X)
    report.heading("Principal components (7.3)")
    report.text(
        f"Four components explain {100.0 * m.explained[3]:.1f} % of {samples.time.size} samples; limits "
        f"at 99 %: T² {m.t2_limit:.3g}, Q {m.q_limit:.3g}; {100.0 * bad.mean():.1f} % of the samples "
        "are beyond one."
    )


def closed_loop(found: Regressed, out: Path, seconds: float | None) -> float:
    """Position error [m] of backstepping on the ellipse with a model in the plant; NaN: it broke off."""
    file = out / f"{found.recipe.name}.ssv"
    write_model(file, analysis.as_model(found.c, found.B, found.columns))
    system = cosim.load_scenario(logged(shipped("ellipse_bs"), seconds))
    result = cosim.simulate(system, out / "logs" / found.recipe.name, parameters=[file])
    return result.metrics.get("e_pos_rms", float("nan"))


def regressions(report: Report, samples: Samples, out: Path, seconds: float | None) -> None:
    """PLS1 to PLS4, and each that the plant can have in the closed loop."""
    kept = analysis.without_outliers(samples)
    rows = []
    for name in MODELS:
        found = analysis.regressed(kept, analysis.recipe(name))
        shares = [found.by_axis(key) for key in ("r2", "q2")]
        cells = [" / ".join(f"{s[a]:.3f}" for s in shares) for a in AXES]
        if analysis.goes_into_the_plant(found.columns):
            thrust = analysis.thrust_of(found)
            values = ", ".join(f"{x:.3f}" for x in sorted(np.real(thrust.eigenvalues)))
            cells += [values, "yes" if thrust.holds else "no", closed_loop(found, out, seconds)]
        else:
            cells += ["–", "–", "–"]
        rows.append([name, *cells])
    report.heading("Partial least squares (Table 7.2) and the ship with it (7.4)")
    header = [
        "recipe",
        *(f"R² / Q² {a}" for a in AXES),
        "eigenvalues of I + B_τ",
        "check",
        "position [m]",
    ]
    report.table(header, rows)
    report.text(
        "`position`: RMS error of backstepping on the ellipse with that model in the plant, no fault of "
        "the guidance. `check`: sym(I + B_τ) ≥ 0.05 I, known before the simulation."
    )


def identification(report: Report, samples: Samples) -> None:
    """SysID by concurrent learning with the ship's true states."""
    found = analysis.identify([samples])
    r2 = analysis.explained([samples], found.phi)
    report.heading("SysID by concurrent learning (7.2), true states")
    rows = zip(analysis.NAMES, sysid4.PHI, found.phi, found.least_squares, strict=True)
    report.table(
        ["coefficient", "hidden", "found", "least squares"], [[n, *map(float, x)] for n, *x in rows]
    )
    report.text(
        f"{found.passes} passes; R² of ω in X, Y, N: {', '.join(f'{x:.4f}' for x in r2)}; condition "
        f"numbers {', '.join(f'{x:.3g}' for x in found.condition)}."
    )


def study(out: Path, seconds: float | None, jobs: int | None) -> Path:
    """Run everything and write the report; returns its path."""
    todo, logs = scenarios(seconds), out / "logs"
    with progress(len(todo), "chapter 7") as advance:
        run_all(todo, [0], folder, logs, jobs, advance)
    report = Report(out, "Chapter 7: the analysis of the model error", [0])
    runs = analysis.gather_samples([logs / c / "0" for c in CONTROLLERS], "mdf")
    samples = analysis.joined(runs)
    report.text(
        f"Runs in a row: {', '.join(LABELS[c] for c in CONTROLLERS)}; ellipse at 0.08 m/s, SYSID4 in "
        "the plant, gains of Table 6.4, guidance fault, spikes; velocities by the modified derivative "
        "filter."
    )
    components(report, samples)
    regressions(report, samples, out, seconds)
    identification(report, true_samples(logs / "true" / "0"))
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "chapter7",
        "Principal components, PLS and SysID of simulated basin runs, and their models in the ship.",
        "  python -m studies.chapter7\n  python -m studies.chapter7 --quick",
        seeds=None,
    )
    options = parser.parse_args(arguments)
    run_study(partial(study, options.out, 60.0 if options.quick else None, options.jobs))


if __name__ == "__main__":
    main()

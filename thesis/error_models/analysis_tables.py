"""The analysis of chapter 7 of some runs, simulated or measured, as parts of a report."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binom, norm

from studies.study_report import Report, Verdict

from .. import analysis
from ..analysis import NU, OMEGA, TAU, Regressed, Samples, correlations
from ..tracking.outcome import AXES, Log
from .model_statements import explaining, systematic

RECIPES = ("PLS1", "PLS2", "PLS3", "PLS4")
UNIT = dict(zip([*NU, *TAU], ("m/s", "m/s", "rad/s", "N", "N", "N m"), strict=True))
POINTS = 2000  # at most in a scatter plot; chosen
MOST = 8  # factors of the curve of Fig. 7.6a; chosen
NOTHING = 0.1  # Q² below which an axis has no model that factors could suffice for; chosen
CHANCE = 0.05  # 1, up to which more significant coefficients than expected may be chance; chosen
SUFFICES = 0.95  # of the best Q² that "suffices" means; chosen


def write_components(report: Report, s: Samples, name: str) -> None:
    """PCA of model error, velocity and force, and what it removes (7.3, Figs. 7.4, 7.5)."""
    found = analysis.analyse([s], 4)
    report.text(" ".join(analysis.sentences(found)))
    report.figure(f"{name}_scatter", scatter(s), "ω against ν (Fig. 7.4).")
    shown = analysis.before_and_after(s.nu, found.kept)
    report.figure(f"{name}_outliers", shown, "ν before and after the outliers went (Fig. 7.5).")


def scatter(s: Samples) -> Figure:
    """Each component of the model error against each of the velocity."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    panels = figure.subplots(3, 3)
    rows = slice(None, None, max(1, s.time.size // POINTS))
    for k, line in enumerate(panels):
        for j, panel in enumerate(line):
            panel.plot(s.nu[rows, j], s.omega[rows, k], ".", markersize=1.5)
            panel.set(xlabel=NU[j] if k == 2 else "", ylabel=OMEGA[k] if j == 0 else "")
    return figure


def regressions(s: Samples) -> dict[str, Regressed]:
    """PLS1 to PLS4 of samples without outliers."""
    kept = analysis.without_outliers(s)
    return {name: analysis.regressed(kept, analysis.recipe(name)) for name in RECIPES}


def shares(found: Regressed) -> list[str]:
    """R² / Q² of each axis, as cells."""
    r2, q2 = (found.by_axis(key) for key in ("r2", "q2"))
    return [f"{r2[a]:.3f} / {q2[a]:.3f}" for a in AXES]


def write_regressions(report: Report, found: Mapping[str, Regressed], name: str) -> None:
    """Pictures of the regressions (Figs. 7.6 to 7.10)."""
    for recipe, figure in (("PLS2", "7.6"), ("PLS3", "7.8"), ("PLS4", "7.9")):
        r = found[recipe]
        for part in r.parts:
            axes = "".join(AXES[k] for k in part.axes)
            shares = part.r2_by_factors.mean(axis=1), part.by_factors.mean(axis=1)
            shown = analysis.share_of_variance(*shares, part.factors, "factors")
            letter = "abc"[part.axes[0]] if len(part.axes) == 1 else "a"
            caption = f"{recipe}: explained variance, mean of {axes} (Fig. {figure}{letter})."
            report.figure(f"{name}_{recipe}_variance_{axes}", shown, caption)
        points, labels = correlations(r, r.parts[len(r.parts) // 2])
        if points.shape[1] > 1:
            shown = analysis.loadings(points, labels, "factor")
            report.figure(f"{name}_{recipe}_loadings", shown, f"{recipe}: loadings (Fig. {figure}).")
    r = found["PLS2"]
    part, scale = r.parts[0], r.X.std(axis=0, ddof=1)
    for k, axis in enumerate(AXES):
        bars = analysis.coefficient_bars(part.B[k] * scale, part.std[k] * scale, r.columns, axis)
        caption = f"PLS2: force by one standard deviation of each column, {axis} (Fig. 7.7)."
        report.figure(f"{name}_PLS2_{axis}", bars, caption)
    lap = slice(0, r.samples.time.size // 4)
    predicted = {n: each.predicted[lap] for n, each in found.items()}
    shown = analysis.model_error_over_time(r.samples.omega[lap], predicted, r.samples.time[lap])
    report.figure(f"{name}_PLS", shown, "ω and its prediction by the regressions (Fig. 7.10).")


def suffice(some: np.ndarray, best: np.ndarray) -> dict[str, bool | None]:
    """Whether Q² (3,) by some factors is as good as the best of more; None: nothing to explain."""
    return {
        axis: None if b < NOTHING else bool(a >= SUFFICES * b)
        for axis, a, b in zip(AXES, some, best, strict=True)
    }


def insignificant(B: np.ndarray, std: np.ndarray, sign_changes: np.ndarray) -> np.ndarray:
    """Coefficients within two standard deviations over the folds, or of changing sign."""
    return (np.abs(B) < 2.0 * std) | (sign_changes > 0)


def by_chance(unsure: np.ndarray) -> float:
    """Probability of as many significant coefficients as these by chance, at two standard deviations."""
    count = int((~unsure).sum())
    return float(binom.sf(count - 1, unsure.size, 2.0 * norm.sf(2.0)))


def unsystematic(q2: np.ndarray) -> bool:
    """Whether Q² in sway is less than half of that in surge and in yaw, which have a model."""
    return bool(min(q2[0], q2[2]) >= NOTHING and q2[1] < 0.5 * min(q2[0], q2[2]))


def findings(found: Mapping[str, Regressed]) -> list[Verdict]:
    """Which of the thesis' findings on the regressions hold: finding, here, numbers."""
    wide = found["PLS2"]
    most = analysis.regressed(wide.samples, replace(wide.recipe, factors=MOST))
    curve = most.parts[0].by_factors
    best, three = curve.max(axis=0), curve[2]
    by_v = [k for k, n in enumerate(wide.columns) if n.count("v") > 0 and "|" in n]
    part = wide.parts[0]
    unsure = insignificant(part.B[:, by_v], part.std[:, by_v], part.sign_changes[:, by_v])
    q2 = np.array([found["PLS4"].by_axis("q2")[a] for a in AXES])
    cells = ", ".join
    return [
        Verdict(
            "Three factors suffice (7.3, Fig. 7.6a)",
            suffice(three, best),
            f"Q² by 3 factors {cells(f'{x:.3f}' for x in three)}, the best of up to {MOST} "
            f"{cells(f'{x:.3f}' for x in best)}; enough: {100.0 * SUFFICES:g} % of the best, where that "
            f"is {NOTHING:g} or more",
        ),
        Verdict(
            "Products with v are insignificant (Fig. 7.7)",
            by_chance(unsure) > CHANCE,
            f"{int((~unsure).sum())} of {unsure.size} coefficients beyond two standard deviations over "
            f"the folds, and of one sign; as many by chance: {by_chance(unsure):.2g}, limit {CHANCE:g}",
        ),
        Verdict(
            "ω in sway is unsystematic, in surge and yaw it is systematic (7.3, Fig. 7.9)",
            unsystematic(q2),
            f"Q² of PLS4 in X, Y, N: {cells(f'{x:.3f}' for x in q2)}; limits: sway below half of both "
            f"others, these from {NOTHING:g}",
        ),
    ]


def write_findings(report: Report, found: Mapping[str, Regressed], name: str) -> None:
    """The findings as a table, each with the name of the runs."""
    report.verdicts(f"{name}_regressions", named(findings(found), name))


def named(rows: Sequence[Verdict], name: str) -> list[Verdict]:
    """Verdicts whose statements end with the name of the runs."""
    return [row._replace(thesis=f"{row.thesis}: {name}") for row in rows]


def write_eight(report: Report, s: Samples, ellipse: Mapping[str, Regressed]) -> None:
    """PCA and PLS of the basin runs on the eight, which the thesis leaves to others (7.4, 8)."""
    report.heading("The eight (7.4)")
    write_components(report, s, "eight")
    found = regressions(s)
    report.table(
        ["recipe", *(f"R² / Q² {a}" for a in AXES)], [[n, *shares(r)] for n, r in found.items()]
    )
    q2 = [np.array([f["PLS2"].by_axis("q2")[a] for a in AXES]) for f in (found, ellipse)]
    report.verdicts("eight_regressions", [*named(findings(found), "eight"), systematic(*q2)])


def write_table_7_1(report: Report, s: Samples, name: str) -> None:
    """R² of the rows of Table 7.1 on samples, and the passes' own (7.2.4, Fig. 7.2)."""
    runs = analysis.by_run(analysis.without_outliers(s))
    limits = analysis.fences(runs)
    own = {
        "identified, limits of Algorithm 4": analysis.identify(runs),
        "identified, limits of the data": analysis.identify(runs, limits),
    }
    table = {n: analysis.row(n) for n in analysis.TABLE_7_1}
    models = table | {n: found.phi for n, found in own.items()}
    first = next(iter(own.values()))
    models["least squares"] = first.least_squares
    rows = [
        [n, *(f"{x:.3f}" for x in analysis.explained(runs, phi)), *map(float, phi)]
        for n, phi in models.items()
    ]
    report.table(["model", *(f"R² {a}" for a in AXES), *analysis.NAMES], rows)
    passed = "; ".join(
        f"{n}: {f.passes} passes{'' if f.settled else ', not converged'}, the blocker lets "
        f"{', '.join(f'{100.0 * x:.0f}' for x in f.passed)} % of each run through"
        for n, f in own.items()
    )
    report.text(
        f"{passed}. Limits of the data (far fence of the quartiles): {limits.nu_dot_max:.3g} of ν̇, "
        f"{limits.nu_max:.3g} of ν, {limits.tau_max:.3g} of τ. Condition numbers "
        f"{', '.join(f'{x:.3g}' for x in first.condition)}. R² of ω about its mean, outliers removed; "
        "below zero where a model is worse than a constant."
    )
    r2 = {n: analysis.explained(runs, found.phi) for n, found in own.items()}
    statement = "The identified model has the main dynamics of the model error (7.2.4, Fig. 7.2)"
    report.verdicts(f"{name}_table_7_1", named([explaining(statement, r2)], name))
    caption = f"ω of {runs[0].names[0]} and Table 7.1 (Fig. 7.2)."
    report.figure(f"{name}_table_7_1", table_picture(runs[0]), caption)


def table_picture(s: Samples) -> Figure:
    """The model error of a run and the rows of Table 7.1 (Fig. 7.2)."""
    predicted = {n: analysis.regressors(s) @ analysis.row(n) for n in analysis.TABLE_7_1}
    return analysis.model_error_over_time(s.omega, predicted, s.time)


def write_shapes(report: Report, s: Samples, log: Log) -> None:
    """The shapes that PLS finds over each state, and a run organised as in 3.2 (Figs. 3.4, 3.5)."""
    found = analysis.regressed(analysis.without_outliers(s), analysis.recipe("continuous"))
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    panels = figure.subplots(3, 2)
    for panel, state in zip(panels.ravel(), [*NU, *TAU], strict=True):
        places = [k for k, n in enumerate(found.columns) if n.partition("=")[0] == state]
        nodes = [float(found.columns[k].partition("=")[2]) for k in places]
        for k, axis in enumerate(AXES):
            panel.plot(nodes, found.B[k, places], "o-", markersize=3.0, label=axis)
        panel.set(xlabel=f"{state} [{UNIT[state]}]", ylabel="force [N, N, N m]")
    panels[0, 0].legend()
    report.figure(
        "simulated_shapes", figure, "Continuous nominal PLS: force over each state (Fig. 3.1)."
    )
    report.figure("simulated_matrices", matrices(log), "A run as in 3.2 (Figs. 3.4, 3.5).")


def matrices(log: Log) -> Figure:
    """The states of Table 1 of a run as nominal and continuous nominal columns, from below up."""
    names = list(analysis.recipe("nominal").transformer().ranges)
    states = np.column_stack([states_of(log, name)[::20] for name in names])
    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    for panel, kind in zip(figure.subplots(2, 1), ("nominal", "continuous"), strict=True):
        columns = replace(analysis.recipe(kind), columns=names).transformer()
        panel.imshow(
            columns.fit_transform(states).T,
            aspect="auto",
            interpolation="nearest",
            origin="lower",
            cmap="jet",
            extent=(log["time"][0], log["time"][-1], 0, len(columns.get_feature_names_out())),
        )
        panel.set(xlabel="time [s]", ylabel=f"column, {kind}")
    return figure


def states_of(log: Log, name: str) -> np.ndarray:
    """A state of Table 1 in a log; the heading as the table has it, in one turn."""
    if name.startswith("tau"):
        return log[f"thrusters.{name.replace('tau_', 'tau_cmd_')}"]
    x = log[f"vessel.{name}"]
    return np.angle(np.exp(1j * x)) if name == "psi" else x

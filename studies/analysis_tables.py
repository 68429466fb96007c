"""The analysis of chapter 7 of some runs, simulated or measured, as parts of a report."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from diagnosis import analysis
from diagnosis.analysis import (
    NU,
    OMEGA,
    TAU,
    Regressed,
    Samples,
    correlations,
)

from .outcome import AXES
from .study_report import Report

RECIPES = ("PLS1", "PLS2", "PLS3", "PLS4")
POINTS = 2000  # at most in a scatter plot; chosen
MOST = 8  # factors of the curve of Fig. 7.6a; chosen
NAMES = [*OMEGA, *NU, *TAU]


def columns(s: Samples) -> np.ndarray:
    """Model error, velocity and force side by side (n, 9), as PCA takes them."""
    return np.hstack([s.omega, s.nu, s.tau])


def write_components(report: Report, s: Samples, name: str) -> None:
    """PCA of model error, velocity and force, and what it removes (7.3, Figs. 7.4, 7.5)."""
    X = columns(s)
    m = analysis.fit_components(X, NAMES, 4)
    bad = analysis.outliers(m, X)
    report.text(
        f"Four components explain {100.0 * m.explained[3]:.1f} % of {s.time.size} samples; "
        f"limits at 99 %: T² {m.t2_limit:.3g}, Q {m.q_limit:.3g}; "
        f"{100.0 * bad.mean():.1f} % of the samples are beyond one and are removed."
    )
    report.figure(f"{name}_scatter", scatter(s), "ω against ν (Fig. 7.4).")
    shown = analysis.before_and_after(s.nu, ~bad)
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
    for recipe, figure in (("PLS2", "7.6"), ("PLS3", "7.8")):
        r = found[recipe]
        part = r.parts[0]
        points, labels = correlations(r, part)
        shown = analysis.loadings(points, labels, "factor")
        report.figure(f"{name}_{recipe}_loadings", shown, f"{recipe}: loadings (Fig. {figure}).")
    r = found["PLS2"]
    part, scale = r.parts[0], r.X.std(axis=0, ddof=1)
    for k, axis in enumerate(AXES):
        bars = analysis.coefficient_bars(part.B[k] * scale, part.std[k] * scale, r.columns, axis)
        caption = f"PLS2: force by one standard deviation of each column, {axis} (Fig. 7.7)."
        report.figure(f"{name}_PLS2_{axis}", bars, caption)
    predicted = {n: found[n].predicted for n in ("PLS1", "PLS3", "PLS4")}
    lap = slice(0, r.samples.time.size // 4)
    shown = analysis.model_error_over_time(
        r.samples.omega[lap], {n: x[lap] for n, x in predicted.items()}, r.samples.time[lap]
    )
    report.figure(f"{name}_PLS", shown, "ω and what the regressions make of it (Fig. 7.10).")


def findings(found: Mapping[str, Regressed]) -> list[list[str]]:
    """Which of the thesis' findings on the regressions hold: finding, here, numbers."""
    wide = found["PLS2"]
    most = analysis.regressed(wide.samples, replace(wide.recipe, factors=MOST))
    curve = most.parts[0].by_factors
    best, three = curve.max(axis=0), curve[2]
    by_v = [k for k, n in enumerate(wide.columns) if n.count("v") > 0 and "|" in n]
    part = wide.parts[0]
    unsure = (np.abs(part.B[:, by_v]) < 2.0 * part.std[:, by_v]) | (part.sign_changes[:, by_v] > 0)
    q2 = np.array([found["PLS3"].by_axis("q2")[a] for a in AXES])
    cells = ", ".join
    return [
        [
            "Three factors suffice (7.3, Fig. 7.6a)",
            "yes" if (best - three < 0.02).all() else "no",
            f"Q² by 3 factors {cells(f'{x:.3f}' for x in three)}, the best of up to {MOST} "
            f"{cells(f'{x:.3f}' for x in best)}",
        ],
        [
            "Products with v are insignificant (Fig. 7.7)",
            "yes" if unsure.mean() > 0.5 else "no",
            f"{int(unsure.sum())} of {unsure.size} coefficients within two of their standard deviations "
            "over the folds, or of changing sign",
        ],
        [
            "ω in sway is unsystematic, in surge and yaw it is systematic (7.3)",
            "yes" if q2[1] < 0.5 * min(q2[0], q2[2]) else "no",
            f"Q² of PLS3 in X, Y, N: {cells(f'{x:.3f}' for x in q2)}",
        ],
    ]


def write_findings(report: Report, found: Mapping[str, Regressed]) -> None:
    report.table(["thesis", "here", "numbers"], findings(found), words=True)


def write_table_7_1(report: Report, s: Samples) -> None:
    """R² of the rows of Table 7.1 on samples, and the passes' own (7.2.4, Fig. 7.2)."""
    kept = analysis.without_outliers(s)
    own = analysis.identify([kept])
    models = {n: analysis.row(n) for n in analysis.TABLE_7_1} | {"identified": own.phi}
    rows = [
        [n, *(f"{x:.3f}" for x in analysis.explained([kept], phi)), *(float(x) for x in phi)]
        for n, phi in models.items()
    ]
    least = analysis.explained([kept], own.least_squares)
    rows.append(["least squares", *(f"{x:.3f}" for x in least), *map(float, own.least_squares)])
    report.table(["model", *(f"R² {a}" for a in AXES), *analysis.NAMES], rows)
    report.text(
        f"{own.passes} passes; condition numbers {', '.join(f'{x:.3g}' for x in own.condition)}. R² of "
        "ω about its mean, outliers removed; below zero where a model is worse than a constant."
    )


def write_shapes(report: Report, s: Samples, name: str) -> None:
    """The bases of 3.2 (Figs. 3.2 to 3.5), and the shapes that PLS finds over each state (Fig. 3.1)."""
    kept = analysis.without_outliers(s)
    found = analysis.regressed(kept, analysis.recipe("continuous"))
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    panels = figure.subplots(3, 2)
    for panel, state in zip(panels.ravel(), [*NU, *TAU], strict=True):
        places = [k for k, n in enumerate(found.columns) if n.partition("=")[0] == state]
        for k, axis in enumerate(AXES):
            panel.plot(range(len(places)), found.B[k, places], "o-", markersize=3.0, label=axis)
        panel.set(xlabel=f"node of {state}", ylabel="force")
    panels[0, 0].legend()
    report.figure(f"{name}_shapes", figure, "Continuous nominal PLS: force over each state (Fig. 3.1).")
    pictured = Figure(figsize=(8.0, 5.0), layout="constrained")
    top, bottom = pictured.subplots(2, 1)
    rows = slice(0, min(4000, kept.time.size))
    for panel, kind in ((top, "nominal"), (bottom, "continuous")):
        matrix = analysis.recipe(kind).transformer().fit_transform(kept.x[rows])
        panel.imshow(matrix.T, aspect="auto", interpolation="nearest")
        panel.set(xlabel="sample", ylabel=f"column, {kind}")
    report.figure(f"{name}_matrices", pictured, "The organised data (Figs. 3.4, 3.5).")

"""The tables and pictures of the real ship's study."""

from collections.abc import Sequence
from math import isfinite

import numpy as np
from matplotlib.figure import Figure

from diagnosis import Content, Evaluation, Model

from ..study_report import Report
from . import bollard
from .expected import AXES, BY_HAND, CURVE_WITHIN, STEERED, Fall, expectations, reason, wanted
from .leave_one_out import LeftOutRun, at_full_power, commanded, fall, steered

UNITS = ("N", "N", "N m")
RUNS_AWAY = "diverges"
HEADING = 2.0  # target: fall of the heading error over 8 s, geometric mean of the runs


def kind(fold: LeftOutRun) -> str:
    return STEERED if steered(fold.evaluation.weak_windows) else BY_HAND


def falls(fold: LeftOutRun) -> list[Fall]:
    """The fall of each axis, and what bounds it."""
    in_sample = np.full(3, np.nan) if fold.seen is None else fall(fold.seen)
    columns = zip(
        fold.fall, in_sample, fold.ceiling, *commanded(fold.evaluation, fold.model), strict=True
    )
    return [Fall(*map(float, row)) for row in columns]


def write_falls(report: Report, folds: Sequence[LeftOutRun]) -> None:
    """The model error before and after on the run left out, beside the target."""
    report.heading("Model error on the run left out")
    report.text(
        "RMS of the model error, in windows of 3 s with the thrusters at work. Before: the "
        "nominal model with the power settings that the run logged; in brackets with unknown "
        "power settings. After: with the model learned from the other runs. Last column: the "
        "reduction if this run is part of the training data."
    )
    rows, results = [], {}
    every = [(f, falls(f)) for f in folds]
    for f, of in every:
        unpowered, e = at_full_power(f.evaluation.weak_windows), f.evaluation
        results[f.name] = {"kind": kind(f), "axes": {}}
        for k, (axis, x) in enumerate(zip(AXES, of, strict=True)):
            before, after = float(e.before.omega_rms[k]), float(e.after.omega_rms[k])
            target = wanted(axis, kind(f))
            said = "–" if target is None else f"{target:g}×: {'' if x.out >= target else 'not '}reached"
            changes = f"{before:.3g} ({unpowered[k]:.3g})", f"{after:.3g}", f"{x.out:.2f}×"
            name = f"{f.name}, {kind(f)}"
            rows.append([name, f"{axis} [{UNITS[k]}]", *changes, said, _times(x.seen)])
            results[f.name]["axes"][axis] = {
                "before": before,
                "before_without_power": float(unpowered[k]),
                "after": after,
                "target": target,
                **x._asdict(),
            }
    header = ["run left out", "axis", "before", "after", "fall", "target", "training run"]
    report.table(header, rows)
    least = min(x.most for _, of in every for x in of)
    report.text(
        f"The noise of the measurement does not explain the residual: it allows {least:.0f}× or more."
    )
    worse = [
        f"{axis} of {f.name}" for f, of in every for axis, x in zip(AXES, of, strict=True) if x.out < 1.0
    ]
    if worse:
        report.text(f"The learned model is worse than the nominal one in {', '.join(worse)}.")
    missed = [
        f"{f.name}, {axis} ({x.out:.2f}× of {target:g}×): {reason(x, target)}."
        for f, of in every
        for axis, x in zip(AXES, of, strict=True)
        if (target := wanted(axis, kind(f))) is not None and x.out < target
    ]
    if missed:
        report.text("Not reached, with the reasons that the numbers show:")
        report.items(missed)
    report.result("falls", results)


def _times(x: float) -> str:
    return f"{x:.2f}×" if isfinite(x) else "–"


def window_error(value: float, scale: float) -> str:
    """An error of the windows of 8 s for people; inf is a model that runs away."""
    return f"{scale * value:.3g}" if isfinite(value) else RUNS_AWAY if np.isinf(value) else "–"


def write_windows(report: Report, folds: Sequence[LeftOutRun]) -> None:
    """Errors of prediction over 8 s."""
    report.heading("Prediction over 8 s on the run left out")

    def row(f: LeftOutRun) -> list[str]:
        errors = [f.evaluation.before, f.evaluation.after, f.seen.after if f.seen else None]
        position = ["–" if e is None else window_error(e.position, 1000.0) for e in errors]
        heading = ["–" if e is None else window_error(e.heading, 180.0 / np.pi) for e in errors]
        return [f.name, *position, *heading]

    when = ("before", "after", "training run")
    quantities = ("position [mm]", "heading [°]")
    header = ["run left out", *(f"{what}: {w}" for what in quantities for w in when)]
    report.table(header, [row(f) for f in folds])
    errors = [(f.name, f.evaluation.before, f.evaluation.after) for f in folds]
    farther = [name for name, before, after in errors if after.position > before.position]
    askew = [name for name, before, after in errors if after.heading > before.heading]
    for what, names in (("position", farther), ("heading", askew)):
        if names:
            report.text(
                f"The prediction error of the {what} is larger than with the nominal model in "
                f"{', '.join(names)}."
            )
    write_heading(report, folds)
    away = [f.name for f in folds if np.isinf(f.evaluation.after.position)]
    if away:
        report.text(f"In {', '.join(away)} the learned model diverges in one window or more.")


def write_heading(report: Report, folds: Sequence[LeftOutRun]) -> None:
    """How far the heading's error falls over 8 s, beside the target and with the run learned from."""
    seen = [f.seen for f in folds if f.seen is not None]
    if not seen:
        return

    def mean_fall(evaluations: Sequence[Evaluation]) -> float:
        return float(np.exp(np.mean([np.log(e.before.heading / e.after.heading) for e in evaluations])))

    out, learned = mean_fall([f.evaluation for f in folds]), mean_fall(seen)
    report.text(
        f"Geometric mean of the reduction of the heading error: {out:.2f}× left out, "
        f"{learned:.2f}× with the run in the training data; the target is {HEADING:g}×."
    )
    if learned < HEADING:
        report.text(
            "So no candidate explains the rotation of the ship over 8 s; the yaw moment that is "
            "reduced above is fast."
        )


def write_expected(report: Report, folds: Sequence[LeftOutRun]) -> None:
    """Expectations set before the study, and the result of each."""
    report.heading("Expected effects")
    rows = expectations([f.content for f in folds])
    header = ["expected", *(f"without {f.name}" for f in folds)]
    report.table(header, [[row.expected, *row.came] for row in rows], words=True)
    delays = {f.name: f.evaluation.smoothed.delay for f in folds}
    listed = ", ".join(
        f"{name} {seconds:.2f} s" for name, seconds in delays.items() if isfinite(seconds)
    )
    if listed:
        report.text(
            "Pose and commands alone, without any model of the ship, give the delay of the "
            f"commands: {listed}. The delay of the model is learned together with the other "
            "effects, which explain a part of it."
        )
    report.result("expected", rows)
    report.result("late", delays)


def write_findings(report: Report, name: str, d: Content) -> None:
    """The findings of one set of runs."""
    report.heading(name)

    def row(e: Content) -> list[str]:
        numbers = [f"{x:.2f}" for x in (e.confidence or 0.0, e.share_of_error or 0.0)]
        return [f"`{e.id}`", e.equation, *numbers, ", ".join(e.indistinguishable) or "none"]

    if d.accepted:
        header = [
            "effect",
            "with 95 % intervals",
            "confidence",
            "share of error",
            "indistinguishable",
        ]
        report.table(header, [row(e) for e in d.accepted], words=True)
    else:
        report.text("No effect was found.")
    suspects = [f"{s.name} = {s.value:.3g} (z = {s.z:.1f})" for s in d.suspect_coefficients]
    report.text(f"Nominal coefficients that are probably wrong: {', '.join(suspects) or 'none'}.")
    s = d.stability
    least = f"{s.learned_min_dissipation:.3g} 1/s (nominal {s.nominal_min_dissipation:.3g})"
    held = "holds" if s.bounded else "does not hold"
    report.text(
        f"A controller {held} the learned ship on ellipse and eight. Least dissipation {least}."
        + (f" Less than nominal: {s.region}." if s.region else "")
    )


def write_curve(report: Report, folds: Sequence[LeftOutRun], last: Model, pulls: bollard.Pulls) -> None:
    """The learned VSP beside bollard pulls."""
    report.heading("The VSP and bollard pulls")
    models = {"nominal": Model(), "all runs": last} | {f"without {f.name}": f.model for f in folds}
    found = {name: bollard.difference(m, pulls) for name, m in models.items()}
    rms = found["all runs"].rms
    said = "reached" if rms <= CURVE_WITHIN else "not reached"
    report.text(
        f"RMS difference to the pulls at |pitch| ≤ {bollard.WITHIN:g}: {rms:.3f} N learned from "
        f"all runs, {found['nominal'].rms:.3f} N nominal; the target was {CURVE_WITHIN:g} N: "
        f"{said}. The speed of the propellers in the pulls is not known: the force of the model is "
        "scaled by one factor, fitted to the pulls, so only the shape is compared."
    )
    header = ["learned from", "RMS [N]", "best factor", "RMS with it [N]"]
    report.table(header, [[name, *map(float, x)] for name, x in found.items()])
    figure = bollard.picture(pulls, last, {f.name: f.model for f in folds})
    report.figure("bollard", figure, "Surge force of one VSP at rest: learned, nominal, and measured.")
    forces = {name: bollard.surge_force(m, pulls.command) for name, m in models.items()}
    report.result("bollard", {"pulls": pulls, "forces": forces, "differences": found})


def model_error_picture(e: Evaluation) -> Figure:
    """The model error of a run over time, before and after."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    # A gap in time is a gap in the line.
    gaps = np.flatnonzero(np.diff(e.weak_windows.middle) > 3.0) + 1
    time = np.insert(e.weak_windows.middle, gaps, np.nan)
    for k, panel in enumerate(panels):
        for error, label, color in ((e.before, "before", "0.6"), (e.after, "after", "tab:blue")):
            panel.plot(
                time, np.insert(error.omega[:, k], gaps, np.nan), color=color, linewidth=0.9, label=label
            )
        panel.set_ylabel(f"{AXES[k]} [{UNITS[k]}]")
        panel.grid(alpha=0.3)
    panels[0].legend(loc="upper right")
    panels[-1].set_xlabel("time [s]")
    return figure

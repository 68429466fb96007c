"""Charts of the model error, of the ranking of candidates and of learned shapes."""

from collections.abc import Sequence

import numpy as np

from cosim.results import thin
from fmus.ops import wrap

from ...assessment.covariates import AXES, HEADING, SPEED, THRUST, YAW_RATE, Covariate
from ...assessment.regions import Profile
from ...predictors.evaluation import Evaluation
from ...runs import Smoothed
from ...runs.cleaning import Z95
from ...search.findings import Ranked
from ...search.shortlist import LENGTH, TIE
from ..formatting import percent
from .chart import AFTER, BAND, BEFORE, ROW, WIDTH, Chart, ChartAxis, Panel
from .shape import Curve

FORCES = ("ω X [N]", "ω Y [N]", "ω N [N·m]")
MOST_RANKED = 2 * LENGTH  # 1, candidates that are shown: the shortlist, and as many again
RESIDUALS = ("x [mm]", "y [mm]", "ψ [°]")
# Covariates that have a chart, with the labels of their axes.
LABELS = {
    SPEED: "surge speed [m/s]",
    YAW_RATE: "yaw rate [°/s]",
    THRUST: "thruster level [%]",
    HEADING: "heading [°]",
}


def interrupted(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Values (n, ...) with NaN between those of different groups (n,)."""
    return np.insert(values, np.flatnonzero(np.diff(group)) + 1, np.nan, axis=0)


def model_error(e: Evaluation, std: np.ndarray | None, learned: bool) -> Chart:
    """Model error over time of X, Y and N, with its uncertainty, and the part that is explained."""
    time = e.weak_windows.middle
    segment = np.concatenate([[0], np.cumsum(np.rint(np.diff(time) / e.weak_windows.every) > 1)])
    panels = []
    for axis, label in enumerate(FORCES):
        measured = e.before.omega[:, axis]
        rows = thin(np.arange(time.size), measured)[0]
        t, y = interrupted(np.column_stack([time, measured])[rows], segment[rows]).T
        panel = Panel(ChartAxis("time [s]", shown=axis == 2), ChartAxis(label), zero=True)
        if std is not None:
            half = Z95 * interrupted(std[rows, axis], segment[rows])
            panel.fill(t, y - half, y + half, BAND, "uncertainty, 95 %")
        panel.draw(t, y, BEFORE, "measured")
        if learned:
            explained = interrupted((measured - e.after.omega[:, axis])[rows], segment[rows])
            panel.draw(t, explained, AFTER, "explained")
        panels.append(panel)
    return Chart(WIDTH, panels)


def residuals(s: Smoothed) -> Chart:
    """Residuals of the measured pose against the smoothed one over time, outliers marked."""
    off = s.track.run.pose - s.eta
    off = np.column_stack([1e3 * off[:, :2], np.degrees(wrap(off[:, 2]))])
    unit = 1e3 * s.noise[:2], np.degrees(s.noise[2:])
    panels = []
    for k, (label, std) in enumerate(zip(RESIDUALS, np.concatenate(unit).tolist(), strict=True)):
        panel = Panel(ChartAxis("time [s]", shown=k == 2), ChartAxis(label), zero=True)
        right, wrong = s.agrees[:, k], s.track.fresh[:, k] & ~s.agrees[:, k] & np.isfinite(off[:, k])
        rows = np.flatnonzero(right & np.isfinite(off[:, k]))
        ends = s.time[rows[[0, -1]]] if rows.size else np.zeros(2)
        panel.fill(ends, np.full(2, -Z95 * std), np.full(2, Z95 * std), BAND, "noise, 95 %")
        shown = rows[thin(np.arange(rows.size), off[rows, k])[0]]
        panel.draw(s.time[shown], off[shown, k], BEFORE, "measured less smoothed")
        if wrong.any():
            most = max(np.abs(off[rows, k]).max(initial=0.0), Z95 * std)
            at = np.clip(off[wrong, k], -most, most)
            panel.draw(s.time[wrong], at, AFTER, "outliers, at most to the edge", dots=True)
        panels.append(panel)
    return Chart(WIDTH, panels)


def profile(
    covariate: Covariate, before: Sequence[Profile], after: Sequence[Profile] | None = None
) -> Chart:
    """RMS of the model error over a covariate.

    Args:
        covariate: one of :data:`LABELS`.
        before, after: of all axes, of the initial and of the learned model; None: nothing was learned.
    """
    panels = []
    for axis, force in zip(AXES, FORCES, strict=True):
        first, *last = (
            next(p for p in profiles if (p.axis, p.covariate.id) == (axis, covariate.id))
            for profiles in (before, after)
            if profiles is not None
        )
        # What never changes has one edge, and one bin.
        edges = covariate.display_factor * np.resize(first.edges, first.rms.size + 1)
        shown = axis == AXES[-1] or covariate is THRUST  # the thrust is that of the axis
        x = ChartAxis(LABELS[covariate], (edges[0], edges[-1]), shown=shown)
        panel = Panel(x, ChartAxis(force), zero=True)
        steps = np.repeat(edges, 2)[1:-1]
        panel.fill(steps, 0.0, np.repeat(first.uncertainty, 2), BAND, "noise")
        panel.draw(steps, np.repeat(first.rms, 2), BEFORE, "before" if last else "model error")
        for p in last:
            panel.draw(steps, np.repeat(p.rms, 2), AFTER, "after")
        panels.append(panel)
    return Chart(WIDTH, panels)


def ranking(ranked: Sequence[Ranked]) -> Chart:
    """Candidates by how much worse than the first they are, with the standard error of that difference.

    The percentage is the share of the model error that each explains beyond other values of the nominal
    coefficients, where a method tells that. Hollow: so near that only chance decides. Grey: further.
    """
    shown = ranked[:MOST_RANKED]
    behind = np.array([_behind(r, shown[0]) for r in shown])
    linear = TIE * float(np.median(behind[:, 1]))
    # Linear below what may be a tie, logarithmic far above.
    scale = (lambda x: np.arcsinh(x / linear)) if linear else None
    label = "score minus the best score, with its standard error [1]"
    label += "\nright: explained in addition to other coefficient values"
    names = ChartAxis(limits=(len(shown), -1), names=[r.id for r in shown])
    panel = Panel(ChartAxis(label, scale=scale), names)
    for k, (r, (x, std)) in enumerate(zip(shown, behind, strict=True)):
        colour = AFTER if (tied := x <= TIE * std) else BAND
        label = "best" if k == 0 else "not clearly worse" if tied else "clearly worse"
        panel.draw([x - std, x + std], [k, k], colour)
        panel.draw(x, k, colour, label, dots=True, hollow=tied and k > 0)
        share = r.beyond if np.isfinite(r.beyond) else r.q2
        panel.notes[k] = percent(max(share, 0.0)) if np.isfinite(share) else ""
    return Chart(WIDTH / 2 + ROW * len(shown), [panel])


def _behind(r: Ranked, first: Ranked) -> tuple[float, float]:
    """By how much a candidate's score is behind, and its standard error; 0 where a method has none."""
    if np.isfinite(r.behind):
        return r.behind, float(np.nan_to_num(r.behind_std))
    return r.score - first.score, 0.0


def curve(c: Curve) -> Chart:
    """A learned shape beside the nominal one."""
    panel = Panel(ChartAxis(c.over, (c.x[0], c.x[-1])), ChartAxis(c.what), zero=True)
    if c.sure is not None:
        panel.fill(c.x, *c.sure, AFTER)
    panel.draw(c.x, c.nominal, BEFORE, "before", dashed=True)
    panel.draw(c.x, c.learned, AFTER, "learned")
    panel.y.limits = panel.ends()[1]
    for begin, end in ((c.x[0], c.covered[0]), (c.covered[1], c.x[-1])):
        if end > begin:
            panel.fill([begin, end], *panel.y.limits, BAND)
    return Chart(WIDTH / 2, [panel])

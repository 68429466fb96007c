"""Charts of the model error, of the ranking of candidates and of learned shapes."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from cosim.results import thin

from ..assessment.covariates import AXES, HEADING, SPEED, THRUST, YAW_RATE, Covariate
from ..assessment.regions import Profile
from ..predictors.evaluation import Evaluation
from ..search.findings import Ranked
from ..search.shortlist import TIE
from .chart import AFTER, BAND, BEFORE, PT, Axis, Chart, Panel
from .report_data import Z95
from .shape import Curve

MAX_RANKED = 14  # candidates in the chart; chosen
LOG_SPREAD = 20.0  # standard errors from which on the axis of scores is logarithmic; chosen
GAP = 1.5  # times the spacing of windows, from which on a line is interrupted; chosen
STACK, SINGLE, ROW = 320.0, 230.0, 17.0  # pt, height of three panels, of one, of a candidate
FORCES = ("ω X [N]", "ω Y [N]", "ω N [N·m]")
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
    segment = np.concatenate([[0], np.cumsum(np.diff(time) > GAP * e.weak_windows.every)])
    panels = []
    for axis, label in enumerate(FORCES):
        measured = e.before.omega[:, axis]
        rows = thin(np.arange(time.size), measured)[0]
        t, y = interrupted(np.column_stack([time, measured])[rows], segment[rows]).T
        panel = Panel(Axis("time [s]", margin=0.01, shown=axis == 2), Axis(label), zero=True)
        if std is not None:
            half = Z95 * interrupted(std[rows, axis], segment[rows])
            panel.fill(t, y - half, y + half, BAND, "uncertainty, 95 %", opacity=0.45)
        panel.draw(t, y, BEFORE, "measured", width=1.8)
        if learned:
            explained = interrupted((measured - e.after.omega[:, axis])[rows], segment[rows])
            panel.draw(t, explained, AFTER, "explained", width=1.0)
        panels.append(panel)
    return Chart(STACK, panels)


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
        last_one, own = axis == AXES[-1], covariate is THRUST  # the thrust is that of the axis
        x = Axis(LABELS[covariate], (edges[0], edges[-1]), shown=own or last_one)
        panel = Panel(x, Axis(force), zero=True)
        steps = np.repeat(edges, 2)[1:-1]
        panel.fill(steps, 0.0, np.repeat(first.uncertainty, 2), BAND, "noise", opacity=0.45)
        panel.draw(
            steps, np.repeat(first.rms, 2), BEFORE, "before" if last else "model error", width=1.8
        )
        for p in last:
            panel.draw(steps, np.repeat(p.rms, 2), AFTER, "after", width=1.0)
        panels.append(panel)
    return Chart(STACK + (2.0 * PT.below if covariate is THRUST else 0.0), panels)


def ranking(ranked: Sequence[Ranked]) -> Chart:
    """Candidates by how much worse than the first they are, with the standard error of that difference.

    The percentage is the share of the model error that each explains beyond other values of the nominal
    coefficients, where a method tells that. Hollow: so near that only chance decides.
    """
    shown = ranked[:MAX_RANKED]
    behind = np.array([_behind(r, shown[0]) for r in shown])
    linear = float(behind[:, 1].max())
    far = behind[-1, 0] > LOG_SPREAD * linear > 0.0
    scale = partial(_from_linear, linear=TIE * linear) if far else None
    label = (
        "score behind the first, with its standard error [1]\n"
        "right: explained beyond other values of the coefficients"
    )
    names = Axis(limits=(len(shown) - 0.5, -0.5), names=[r.id for r in shown])
    panel = Panel(Axis(label, scale=scale), names)
    for k, (r, (x, std)) in enumerate(zip(shown, behind, strict=True)):
        tied = x <= TIE * std
        colour = AFTER if tied else BAND
        panel.draw([x - std, x + std], [k, k], colour)
        panel.draw(x, k, colour, radius=3.2 if tied else 2.6, hollow=tied and k > 0)
        panel.notes[k] = _explained(r.beyond if np.isfinite(r.beyond) else r.q2)
    height = PT.above + PT.below + PT.letter + ROW * len(shown)
    return Chart(height, [panel], right=PT.below)


def _from_linear(x: np.ndarray, linear: float) -> np.ndarray:
    """A scale that is linear below a value and logarithmic far above."""
    return np.arcsinh(x / linear)


def _behind(r: Ranked, first: Ranked) -> tuple[float, float]:
    """By how much a candidate's score is behind, and its standard error; 0 where a method has none."""
    if np.isfinite(r.behind):
        return r.behind, float(np.nan_to_num(r.behind_std))
    return r.score - first.score, 0.0


def _explained(share: float) -> str:
    """The share beside a candidate; a negative one without its size, which means nothing."""
    if not np.isfinite(share):
        return ""
    return f"{100.0 * share:.0f} %" if share >= 0.0 else "< 0 %"


def curve(c: Curve) -> Chart:
    """A learned shape beside the nominal one."""
    panel = Panel(Axis(c.over, (c.x[0], c.x[-1])), Axis(c.what), zero=True)
    if c.sure is not None:
        panel.fill(c.x, *c.sure, AFTER)
    panel.draw(c.x, c.nominal, BEFORE, "before", dashed=True)
    panel.draw(c.x, c.learned, AFTER, "learned", width=1.8)
    panel.y.limits = panel.ends()[1]
    for begin, end in ((c.x[0], c.covered[0]), (c.covered[1], c.x[-1])):
        if end > begin:
            panel.fill([begin, end], *panel.y.limits, BAND, opacity=0.25)
    return Chart(SINGLE, [panel])

"""The figures of a record: tracks with the predictions of a criterion, and the errors of its windows."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...execution.short_text import SHOWN
from ...predictors.evaluation import Evaluation
from ...report.document import Plot
from ...report.pictures.chart import AFTER, BAND, BEFORE, LINE, WIDTH, Chart, ChartAxis, Panel
from ...report.pictures.tracks import track
from ..criterion import Criterion
from ..judged_criterion import EXPANDED, JudgedErrors, Judgement
from ..predictions import Predictions


def figures(judgements: Sequence[Judgement], evaluations: Sequence[Evaluation]) -> Iterator[Plot]:
    """Of each criterion its errors, and of each horizon the tracks."""
    drawn: set[float] = set()
    by_name = {e.name: e for e in evaluations}
    for j in judgements:
        if j.found is None:
            continue
        c = j.criterion
        stated = f"{c.title}: error E = S − D of each of the {j.found.errors.size} windows that count"
        yield Plot(_errors(c, j.found), f"{stated}, the tolerance, and 2 u_val about zero.")
        if c.horizon in drawn or not evaluations:
            continue
        drawn.add(c.horizon)
        for p, rows in j.windows[:SHOWN]:
            more = f" (of {len(j.windows)} runs the first {SHOWN})" if len(j.windows) > SHOWN else ""
            stated = (
                f"{p.name}: measured track, and predictions over {c.horizon:g} s from the start of each "
                "window"
            )
            yield Plot(
                _track(by_name[p.name], p.predictions),
                f"{stated}, of which {int(rows.sum())} count{more}.",
            )


def _errors(c: Criterion, found: JudgedErrors) -> Chart:
    """The error in each window, by runs and time; the tolerance, and 2 u_val from zero."""
    errors, distance = found.errors / c.factor, c.quantity == "position"
    number, inside = np.arange(1, errors.size + 1), np.abs(errors) <= c.tolerance
    reach = EXPANDED * found.budget.u_val / c.factor
    ends, least = (0, errors.size + 1), 0.0 if distance else -1.0
    panel = Panel(ChartAxis("window", ends), ChartAxis(f"{c.quantity} [{c.unit}]"), zero=True)
    panel.fill(ends, least * reach, reach, BAND, "2 u_val")
    for k in np.flatnonzero(np.diff(found.run)):
        between = np.full(2, number[k : k + 2].mean())
        panel.draw(between, [least * c.tolerance, c.tolerance], BAND, width=LINE / 2)
    panel.draw(ends, [c.tolerance, c.tolerance], BEFORE, "tolerance")
    if not distance:
        panel.draw(ends, [-c.tolerance, -c.tolerance], BEFORE)
    panel.draw(number[inside], errors[inside], AFTER, "within", dots=True)
    panel.draw(number[~inside], errors[~inside], BEFORE, "beyond", dots=True, hollow=True)
    return Chart(WIDTH / 2, [panel])


def _track(e: Evaluation, p: Predictions) -> Chart:
    """The measured track of a run, and the predictions in the windows of a criterion."""
    judged = replace(e.before, residuals=p.residuals)
    return track(replace(e, windows=p.windows, before=judged), learned=False)

"""The errors of a criterion's windows beside its tolerance."""

import numpy as np

from ..report.chart import AFTER, BAND, BEFORE, LINE, WIDTH, Chart, ChartAxis, Panel
from .judged_criterion import EXPANDED, Judgement


def error_figure(j: Judgement) -> Chart:
    """Size of the error in each window, by runs and time; the tolerance, and 2 u_val from zero."""
    c = j.criterion
    size = np.abs(j.errors) / c.factor
    number, inside = np.arange(1, size.size + 1), size <= c.tolerance
    reach = 0.0 if j.budget is None else EXPANDED * j.budget.u_val / c.factor
    ends = (0, size.size + 1)
    panel = Panel(ChartAxis("window", ends), ChartAxis(f"{c.quantity} [{c.unit}]"), zero=True)
    if j.budget is not None:
        panel.fill(ends, 0.0, reach, BAND, "2 u_val")
    for k in np.flatnonzero(np.diff(j.run)):
        panel.draw(np.full(2, number[k : k + 2].mean()), [0.0, c.tolerance], BAND, width=LINE / 2)
    panel.draw(ends, [c.tolerance, c.tolerance], BEFORE, "tolerance")
    panel.draw(number[inside], size[inside], AFTER, "within", dots=True)
    panel.draw(number[~inside], size[~inside], BEFORE, "beyond", dots=True, hollow=True)
    return Chart(WIDTH / 2, [panel])

"""The errors of a criterion's windows beside its tolerance."""

import numpy as np

from ..report.chart import AFTER, BAND, BEFORE, PT, Axis, Chart, Panel
from .judged_criterion import EXPANDED, Judgement

HEIGHT = 173.0  # pt


def error_figure(j: Judgement) -> Chart:
    """Size of the error in each window, by runs and time; the tolerance, and 2 u_val from zero."""
    c = j.criterion
    size = np.abs(j.errors) / c.factor
    number, inside = np.arange(1, size.size + 1), size <= c.tolerance
    reach = 0.0 if j.budget is None else EXPANDED * j.budget.u_val / c.factor
    most = 1.05 * float(np.max([*size[np.isfinite(size)], c.tolerance, reach]))
    ends = (0.5, size.size + 0.5)
    panel = Panel(Axis("window", ends), Axis(f"{c.quantity} [{c.unit}]", (0.0, most)))
    if j.budget is not None:
        panel.fill(np.array(ends), 0.0, reach, BAND, "2 u_val", opacity=0.3)
    for k in np.flatnonzero(np.diff(j.run)):
        panel.draw([k + 1.5, k + 1.5], [0.0, most], BAND, width=PT.thin)
    panel.draw(ends, [c.tolerance, c.tolerance], BEFORE, "tolerance")
    panel.draw(number[inside], size[inside], AFTER, "within", radius=PT.dot)
    panel.draw(number[~inside], size[~inside], BEFORE, "beyond", radius=PT.dot, hollow=True)
    return Chart(HEIGHT, [panel])

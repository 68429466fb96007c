"""The errors of a criterion's windows beside its tolerance."""

from typing import TYPE_CHECKING

import numpy as np

from ..report.panels import legend, panels_of
from ..report.svg import AFTER, BAND, BEFORE
from .judged_criterion import EXPANDED, Judgement

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_figure(j: Judgement) -> "Figure":
    """Size of the error in each window, by runs and time; the tolerance, and 2 u_val from zero."""
    figure, (panel,) = panels_of(2.4)
    c = j.criterion
    size = np.abs(j.errors) / c.factor
    inside = size <= c.tolerance
    number = np.arange(1, size.size + 1)
    panel.plot(number[inside], size[inside], "o", ms=3.0, color=AFTER, label="within")
    panel.plot(number[~inside], size[~inside], "x", ms=4.0, color=BEFORE, label="beyond")
    panel.axhline(c.tolerance, color=BEFORE, lw=1.0, label="tolerance")
    if j.budget is not None:
        reach = EXPANDED * j.budget.u_val / c.factor
        panel.axhspan(0.0, reach, color=BAND, alpha=0.3, lw=0.0, label="2 u_val")
    for k in np.flatnonzero(np.diff(j.run)):
        panel.axvline(k + 1.5, color=BAND, lw=0.6)
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("window")
    panel.set_ylabel(f"{c.quantity} [{c.unit}]")
    legend(figure, panel, 4)
    return figure

"""The picture of a planned run: its track with the spread under every likely candidate."""

from pathlib import Path

import numpy as np

from cosim.results import hulls

from ..report.finding_text import SHOWN
from .designing import Designer
from .information import Knowledge
from .planned_motion import PlannedMotion
from .spread import Spread


def draw(d: Designer, k: Knowledge, motion: PlannedMotion, spread: Spread, path: Path) -> None:
    """Draw a run: basin, target, tracks under each likely hypothesis, outlines of the ship."""
    from matplotlib.figure import Figure

    eta = motion.eta
    basin = d.basin
    figure = Figure(figsize=(8.0, 6.0), dpi=120)
    axes = figure.add_subplot()
    (south, north), (west, east) = basin.north, basin.east
    axes.plot([west, east, east, west, west], [south, south, north, north, south], "k", label="basin")
    for colour, (n, tracks) in enumerate(zip(spread.ids, spread.eta, strict=True)):
        name = f"under {k.hypotheses[n].name}"
        for m, track in enumerate(tracks):
            label = "_" if m else name  # matplotlib leaves a label with an underscore out
            colour_of = {"color": f"C{colour}", "alpha": 0.4, "linewidth": 0.7}
            axes.plot(track[:, 1], track[:, 0], label=label, **colour_of)
    axes.plot(eta[:, 1], eta[:, 0], "k--", linewidth=0.8, label="target")
    for corners in hulls(eta[np.linspace(0, len(eta) - 1, 2 * SHOWN).astype(int)], d.outline):
        axes.plot(*np.vstack([corners, corners[:1]]).T, color="0.5", linewidth=0.5)
    axes.plot(eta[0, 1], eta[0, 0], "ko", markersize=4, label="start")
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
    figure.savefig(path, format="png", bbox_inches="tight")

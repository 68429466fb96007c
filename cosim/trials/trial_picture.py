"""The picture of a manoeuvring trial, as trial reports have it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..results.canvas import DPI, WIDTH, arrange, blank, grid, save, thin
from ..results.log import TRIAL_PICTURE
from ..results.picture_files import Drawn
from .ship_passage import executes
from .trial_outcome import TrialOutcome
from .yaw_stability import plateaus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT = 4.2  # in
BY_POINTS = {"textcoords": "offset points", "fontsize": 8, "ha": "center"}  # of a text next to a dot
SHIP, MARK = "blue", "0.4"  # colours of the ship's line, and of what is measured


def draw_trial(found: TrialOutcome) -> Drawn:
    """The picture of a trial: its track, and heading and order, or rate over order."""
    return Drawn(_figure(found))


def write_picture(found: TrialOutcome, folder: Path) -> None:
    """Write it as ``trial.png``."""
    save(_figure(found), folder / TRIAL_PICTURE, DPI)


def _figure(found: TrialOutcome) -> Figure:
    figure, draws = blank(WIDTH, HEIGHT), PANELS[found.kind]
    cells = figure.add_gridspec(len(draws), 2, height_ratios=[2] * (len(draws) > 1) + [1])
    left = figure.add_subplot(cells[:, 0])
    panels = [figure.add_subplot(cells[k, 1]) for k in range(len(draws))]
    for panel in (left, *panels):
        grid(panel)
    _track(left, found)
    for panel, draw in zip(panels, draws, strict=True):
        draw(panel, found)
    for panel in panels[:-1]:
        panel.sharex(panels[-1])
        panel.tick_params(labelbottom=False)
    return arrange(figure)


def _track(panel: Axes, found: TrialOutcome) -> None:
    """Track along and across the heading at the first execute, in metres or ship's lengths."""
    p = found.passage
    x_0, y_0, psi_0 = p.at(executes(p)[0])
    size, unit = (found.length, "L") if found.length > 0.0 else (1.0, "m")
    north, east = (p.x - x_0) / size, (p.y - y_0) / size
    ahead = np.cos(psi_0) * north + np.sin(psi_0) * east
    aside = np.cos(psi_0) * east - np.sin(psi_0) * north
    panel.plot(aside, ahead, color=SHIP, linewidth=1.4)
    panel.plot(0.0, 0.0, "o", markerfacecolor="white", markeredgecolor="black")
    panel.set(xlabel=f"to starboard [{unit}]", ylabel=f"ahead [{unit}]", aspect="equal")
    panel.set_adjustable("datalim")
    m = found.measures
    if "advance" in m:
        panel.axhline(m["advance"] / size, color=MARK, linewidth=0.8, dashes=(5, 4))
    if "tactical_diameter" in m:
        side = np.sign(aside[np.argmax(np.abs(aside))])
        panel.axvline(side * m["tactical_diameter"] / size, color=MARK, linewidth=0.8, dashes=(5, 4))


def _heading(panel: Axes, found: TrialOutcome) -> None:
    """Heading off the first one over time, with the overshoots of a zig-zag."""
    p = found.passage
    times = executes(p)
    time = p.time - times[0]
    panel.plot(*thin(time, np.degrees(p.psi - p.at(times[0])[2])), color=SHIP, linewidth=1.4)
    for instant in times:
        panel.axvline(instant - times[0], color=MARK, linewidth=0.6)
    for k, begin in enumerate(times[1:], 1):
        if (angle := found.measures.get(f"overshoot_{k}")) is not None:
            at = begin + found.measures[f"overshoot_time_{k}"]
            off = np.degrees(p.at(at)[2] - p.at(times[0])[2])
            panel.plot(at - times[0], off, "o", color="red", markersize=4.0)
            beside = {"xytext": (0, 5 * np.sign(off)), "va": "bottom" if off > 0.0 else "top"}
            panel.annotate(f"{np.degrees(angle):.3g}°", (at - times[0], off), **beside, **BY_POINTS)
    allowed = [f"{np.degrees(x):.3g}°" for n, x in found.limits.items() if n.startswith("overshoot")]
    named = [f"IMO limit of overshoots: {', '.join(allowed)}"] if allowed else found.without_limit
    panel.set_title("".join(named), loc="right", fontsize=8, color=MARK)
    panel.margins(y=0.15)
    panel.set_ylabel("heading [°]")


def _order(panel: Axes, found: TrialOutcome) -> None:
    """The order as a share of its largest over time."""
    p = found.passage
    time = p.time - executes(p)[0]
    panel.plot(*thin(time, p.order / np.abs(p.order).max()), color="red", linewidth=0.9)
    panel.set(ylim=(-1.2, 1.2), yticks=[-1.0, 0.0, 1.0], xlabel="time [s]", ylabel="order [1]")


def _speed(panel: Axes, found: TrialOutcome) -> None:
    """Speed over ground over time."""
    p = found.passage
    speed = np.hypot(np.gradient(p.x, p.time), np.gradient(p.y, p.time))
    panel.plot(*thin(p.time - executes(p)[0], speed), color=SHIP, linewidth=1.4)
    panel.set(xlabel="time [s]", ylabel="speed [m/s]")


def _rates(panel: Axes, found: TrialOutcome) -> None:
    """Steady rate over order, in the order of the plateaus."""
    held = plateaus(found.passage)[1:]
    panel.plot([h.order for h in held], [np.degrees(h.rate) for h in held], "o-", color=SHIP)
    panel.set(xlabel="order", ylabel="rate of turn [°/s]")


PANELS: Mapping[str, Sequence[Callable[[Axes, TrialOutcome], None]]] = {
    "circle": (_heading, _order),
    "zigzag": (_heading, _order),
    "stop": (_speed,),
    "spiral": (_rates,),
}

"""Pictures of a campaign: metrics against axes, heat maps, box plots, paired differences, bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import InputError
from ..results.canvas import blank, save
from ..results.canvas import grid as pale_grid
from ..results.drawing import LINES
from ..trials.measures import EVERY
from .comparison import differences

if TYPE_CHECKING:
    import pandas

    from .campaign_file import LoadedCampaign

NO_UNITS: Mapping[str, str] = {}
TIMES = ("step", "stop")  # of a scenario [s]
UNITS = {metric.name: metric.unit for metric in EVERY}
# Pairs of axes of which heat maps are drawn; chosen: three axes give three.
MOST_MAPS = 3
PANEL = (4.2, 3.2)  # size of one panel [inch]; taste
RUN = LINES[0][0]  # colour, as of a run
BANDS_SIZE = (10.0, 5.0)  # of the picture of an ensemble
CHANNELS = {"x": "north [m]", "y": "east [m]", "psi": "heading [°]"}  # of a member less the mean


def draw_campaign(
    made: pandas.DataFrame,
    axes: Sequence[str],
    over: Sequence[str],
    metrics: Sequence[str],
    folder: Path,
    compared: str | None = None,
    units: Mapping[str, str] = NO_UNITS,
) -> list[Path]:
    """Draw what the table holds.

    Args:
        made: the table of the campaign.
        axes: all axes.
        over: those over which a box plot spreads, as seeds.
        metrics: columns.
        folder: for the pictures.
        compared: axis whose paired differences are drawn.
        units: of axes, from :func:`axis_units`.

    Returns:
        Paths of the pictures.

    Raises:
        InputError: a metric that the table lacks, or nothing to compare.
    """
    for metric in metrics:
        if metric not in made.columns:
            raise InputError(f"no metric '{metric}' in the table")
    done = made.query("status == 'done'")
    choices = [name for name in axes if name not in over and len(set(done[name])) > 1]
    figures: dict[str, Figure] = {}
    if choices:
        figures["metrics"] = _against_axes(done, choices, metrics, units)
    numbers = [name for name in choices if _is_number(done, name)]
    for a, b in list(combinations(numbers, 2))[:MOST_MAPS]:
        figures[f"map_{a}_{b}"] = _maps(done, a, b, metrics, units)
    if compared is not None:
        figures[f"differences_{compared}"] = _differences(
            differences(made, axes, compared, metrics), compared, metrics
        )
    paths: list[Path] = []
    for name, figure in figures.items():
        stem = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
        path = folder / f"{stem}.png"
        save(figure, path)
        paths.append(path)
    return paths


def _is_number(made: pandas.DataFrame, name: str) -> bool:
    return made[name].dtype.kind in "if"


def _panels(rows: int, columns: int) -> tuple[Figure, np.ndarray]:
    figure = blank(PANEL[0] * columns, PANEL[1] * rows)
    figure.set_layout_engine("constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def axis_units(loaded: LoadedCampaign) -> dict[str, str]:
    """Axis -> unit, of those that set a parameter or a time of the scenario."""
    from ..system.preparation import prepare

    try:
        system = prepare(loaded.base)
    except InputError:  # only with values of the axes it can be run
        return {}
    found = {}
    for name, axis in loaded.campaign.axes.items():
        part, _, inside = axis.paths[0].removeprefix("fmus.").partition(".")
        variables = system.models[part].variables if part in system.models else {}
        variable = variables.get(inside.removeprefix("parameters."))
        if variable is not None and variable.unit is not None:
            found[name] = variable.unit.name
    system.close()
    return found | {n: "s" for n, axis in loaded.campaign.axes.items() if axis.paths[0] in TIMES}


def _labelled(name: str, unit: str | None) -> str:
    return f"{name} [{unit}]" if unit else name


def _named(axes: Axes, x: str, metric: str) -> None:
    axes.set(xlabel=x, ylabel=_labelled(metric, UNITS.get(metric)))


def _against_axes(
    done: pandas.DataFrame, choices: Sequence[str], metrics: Sequence[str], units: Mapping[str, str]
) -> Figure:
    """A row for each metric, a column for each axis: points over numbers, boxes over categories."""
    figure, panels = _panels(len(metrics), len(choices))
    for k, metric in enumerate(metrics):
        for j, name in enumerate(choices):
            panel: Axes = panels[k, j]
            pale_grid(panel)
            if _is_number(done, name):
                panel.plot(done[name], done[metric], ".", color=RUN, alpha=0.5)
                if done[name].nunique() <= len(done) // 2:  # several runs at each value
                    median = done.groupby(name)[metric].median()
                    panel.plot(median.index, median, "-", color=RUN, label="median")
                    panel.legend(fontsize=7)
            else:
                groups = {
                    str(value): part[metric].dropna() for value, part in done.groupby(name, sort=False)
                }
                panel.boxplot(list(groups.values()))
                panel.set_xticks(range(1, 1 + len(groups)), list(groups), fontsize=7, rotation=20)
            _named(panel, _labelled(name, units.get(name)), metric)
    return figure


def _maps(
    done: pandas.DataFrame, a: str, b: str, metrics: Sequence[str], units: Mapping[str, str]
) -> Figure:
    """Each metric over two axes of numbers: a map of medians where they form a grid, else points.

    On a grid the place of a value is its number, so that each cell is around its value.
    """
    figure, panels = _panels(1, len(metrics))
    for panel, metric in zip(panels[0], metrics, strict=True):
        grid = done.pivot_table(index=b, columns=a, values=metric, aggfunc="median")
        if grid.notna().to_numpy().all():
            shown = panel.imshow(grid.to_numpy(), origin="lower", aspect="auto")
            panel.set_xticks(range(len(grid.columns)), [f"{x:.4g}" for x in grid.columns])
            panel.set_yticks(range(len(grid.index)), [f"{y:.4g}" for y in grid.index])
            several = len(done) > grid.size
            title = f"{metric}, median" if several else metric
        else:
            shown = panel.scatter(done[a], done[b], c=done[metric])
            title = metric
        panel.set(xlabel=_labelled(a, units.get(a)), ylabel=_labelled(b, units.get(b)), title=title)
        figure.colorbar(shown, ax=panel, label=_labelled(metric, UNITS.get(metric)))
    return figure


def _differences(found: pandas.DataFrame, axis: str, metrics: Sequence[str]) -> Figure:
    """Mean paired differences with their intervals, a panel for each metric."""
    figure, panels = _panels(1, len(metrics))
    for panel, metric in zip(panels[0], metrics, strict=True):
        pale_grid(panel)
        part = found.query("metric == @metric")
        places = np.arange(len(part))
        panel.errorbar(part["difference"], places, xerr=part["half"], fmt="o", color=RUN, capsize=3)
        panel.axvline(0.0, color="k", lw=0.8)
        panel.set_yticks(places, list(part["value"]), fontsize=7)
        panel.set(title=f"{axis}: less {part['against'].iloc[0]}", ylim=(-0.5, len(part) - 0.5))
        panel.set_xlabel(_labelled(f"mean difference of {metric}", UNITS.get(metric)))
    return figure


def draw_bands(found: pandas.DataFrame, poses: np.ndarray) -> Figure:
    """Draw an ensemble: its tracks, and how far the members are from their mean against time.

    Args:
        found: the bands, from :func:`.ensemble.bands`.
        poses: (members, 3, n), north, east [m] and heading [rad].
    """
    figure = blank(*BANDS_SIZE)
    figure.set_layout_engine("constrained")
    panels = figure.subplot_mosaic([["track", name] for name in CHANNELS])
    for panel in panels.values():
        pale_grid(panel)
    track = panels["track"]
    for member in poses:
        track.plot(member[1], member[0], color=RUN, lw=0.5, alpha=0.3)
    track.plot(found["y_mean"], found["x_mean"], color="k", lw=1.0, label="mean")
    track.set(xlabel="east [m]", ylabel="north [m]", title=f"{len(poses)} members")
    track.set_aspect("equal", "datalim")
    track.legend(fontsize=7)
    for name, label in CHANNELS.items():
        panel, scale = panels[name], np.degrees(1.0) if name == "psi" else 1.0
        for low, high, shade in ((5, 95, 0.25), (25, 75, 0.45)):
            ends = (scale * (found[f"{name}_{q}"] - found[f"{name}_mean"]) for q in (low, high))
            panel.fill_between(
                found["time"], *ends, color=RUN, alpha=shade, lw=0.0, label=f"{high - low} %"
            )
        panel.axhline(0.0, color="k", lw=1.0, label="mean")
        panel.set_ylabel(label)
    panels["x"].set_title("from the mean")
    panels["x"].legend(fontsize=7)
    panels["psi"].set_xlabel("time [s]")
    return figure

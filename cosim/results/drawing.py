"""Pictures of one run, or of several laid over each other: the five of the thesis, 5.1."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .canvas import DrawnRun, Runs, save
from .lines import commands, errors, forces, metrics, model_error
from .log import Log
from .performance import MetricsError
from .picture_files import PictureOptions
from .run_options import RunOptions
from .track import trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Values beyond are left out, as those that are not finite; chosen: matplotlib's ticks fail far above.
LARGEST = 1e9

# The thesis' lines, 5.3, then matplotlib's colours.
LINES = (("blue", "-"), ("green", "--"), ("red", "--"), ("magenta", "-."))
MORE_COLORS = ("tab:orange", "tab:brown", "tab:cyan", "tab:olive", "tab:purple", "tab:gray")


COMMANDS = "commands"  # a picture, and the role of its columns
USUAL = PictureOptions()
NOTHING: Mapping[str, RunOptions] = MappingProxyType({})


class RunPicture(NamedTuple):
    """A picture.

    Attributes:
        choices: roles of the columns that it needs; the first whose columns are all there counts. The
            role ``commands`` is that of the actuators, which has as many columns as the run says.
        figure: draws the runs.
    """

    choices: Sequence[Sequence[str]]
    figure: Callable[[Runs], "Figure"]


# By file name.
PICTURES = {
    "trajectory": RunPicture((("pose", "target"), ("pose",)), trajectory),
    "errors": RunPicture((("pose", "target"),), errors),
    "metrics": RunPicture(
        (
            ("pose", "velocity", "target", "force"),
            ("pose", "velocity", "target", "requested_force"),
        ),
        metrics,
    ),
    "forces": RunPicture((("linear_force", "nonlinear_force", "requested_force"),), forces),
    COMMANDS: RunPicture(
        (("commands", "pose", "velocity", "target"), ("commands", "pose", "velocity")), commands
    ),
    "model_error": RunPicture(
        (("model_error", "estimate", "force", "acting_force"), ("model_error", "estimate")), model_error
    ),
}


def draw(
    runs: Mapping[str, Log],
    folder: str | Path,
    stated: Mapping[str, RunOptions] = NOTHING,
    options: PictureOptions = USUAL,
) -> list[Path]:
    """Draw every picture for which at least one log has the columns.

    Args:
        runs: label -> log; several logs are laid over each other.
        folder: for the files, made when missing.
        stated: label -> its columns, the part that its metrics cover, and its ship, where known; see
            :func:`~cosim.results.read_options`.
        options: format, size and style.

    Returns:
        The files written, among trajectory.png, errors.png, metrics.png, forces.png, commands.png and
        model_error.png.

    Raises:
        InputError: there is no such style, or no such size.
    """
    folder = Path(folder)
    written = []
    with options.applied():
        for name, figure in figures(runs, stated):
            folder.mkdir(parents=True, exist_ok=True)
            file = folder / f"{name}.{options.format}"
            save(options.sized(figure), file, options.dpi)
            written.append(file)
    return written


def figures(
    runs: Mapping[str, Log],
    stated: Mapping[str, RunOptions] = NOTHING,
    names: Sequence[str] = tuple(PICTURES),
) -> "Iterator[tuple[str, Figure]]":
    """Name and figure of the pictures for which at least one log has the columns; see :func:`draw`."""
    for name in names:
        picture = PICTURES[name]
        able: list[DrawnRun] = []
        for k, (label, log) in enumerate(runs.items()):
            own = stated.get(label, RunOptions())
            part = _usable(log, picture.choices, own)
            if part is not None:
                named = label.replace("$", r"\$")
                able.append(DrawnRun(named, part, _line(k), own))
        if not able:
            continue
        try:
            figure = picture.figure(able)
        except MetricsError:  # fewer than two rows in the window
            continue
        yield name, figure


def _line(k: int) -> dict[str, Any]:
    """Properties of the lines of the k-th run."""
    more = k - len(LINES)
    color, style = LINES[k] if more < 0 else (MORE_COLORS[more % len(MORE_COLORS)], "-")
    return {"color": color, "linestyle": style, "linewidth": 1.2}


def _usable(log: Log, choices: Sequence[Sequence[str]], own: RunOptions) -> Log | None:
    """The columns of the first choice that the log has, without rows that cannot be drawn."""
    for choice in choices:
        columns = own.roles.of(*(role for role in choice if role != COMMANDS))
        if COMMANDS in choice:
            columns = (*columns, *own.commands) if own.commands else (COMMANDS,)
        if all(name in log for name in columns):
            part = {name: np.asarray(log[name], float) for name in ("time", *columns)}
            good = np.all([np.abs(values) < LARGEST for values in part.values()], axis=0)
            if np.count_nonzero(good) < 2:
                return None
            return part if good.all() else {name: values[good] for name, values in part.items()}
    return None

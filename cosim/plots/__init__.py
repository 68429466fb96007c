"""Pictures of one run, or of several laid over each other: ``python -m cosim.plots DIR... --out DIR``.

The five of the thesis, 5.1.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..metrics import (
    OMEGA,
    OMEGA_HAT,
    POSE,
    TARGET,
    TAU,
    TAU_CMD,
    TAU_LIN,
    TAU_NONLIN,
    VELOCITY,
    Log,
    MetricsError,
)
from .canvas import Run, Runs, save, thin
from .lines import errors, forces, metrics, model_error
from .track import trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["PICTURES", "draw", "thin"]

LARGEST = 1e9  # values beyond are left out, as those that are not finite

# The thesis' lines, 5.3, then matplotlib's colours.
LINES = (("blue", "-"), ("green", "--"), ("red", "--"), ("magenta", "-."))
MORE_COLORS = ("tab:orange", "tab:brown", "tab:cyan", "tab:olive", "tab:purple", "tab:gray")


def draw(
    runs: Mapping[str, Log],
    folder: str | Path,
    start: float | None = None,
    stop: float | None = None,
) -> list[Path]:
    """Draw every picture for which at least one log has the columns.

    Args:
        runs: label -> log; several logs are laid over each other.
        folder: where the PNG files go, made when missing.
        start, stop: the part of the runs that the picture of the metrics covers [s]; None is all.

    Returns:
        The files written, among trajectory.png, errors.png, metrics.png, forces.png and
        model_error.png.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    window = {"start": start, "stop": stop}
    written = []
    for name, (choices, picture) in PICTURES.items():
        able = [
            Run(label.replace("$", r"\$"), part, _line(k))
            for k, (label, log) in enumerate(runs.items())
            if (part := _usable(log, choices)) is not None
        ]
        if not able:
            continue
        file = folder / f"{name}.png"
        try:
            figure = picture(able, **window) if picture is metrics else picture(able)
        except MetricsError:  # nothing happened in the window
            continue
        save(figure, file)
        written.append(file)
    return written


def _line(k: int) -> dict[str, Any]:
    """How the k-th run is drawn."""
    if k < len(LINES):
        color, style = LINES[k]
        return {"color": color, "linestyle": style, "linewidth": 1.2}
    return {
        "color": MORE_COLORS[(k - len(LINES)) % len(MORE_COLORS)],
        "linestyle": "-",
        "linewidth": 1.2,
    }


def _usable(log: Log, choices: Sequence[Sequence[str]]) -> Log | None:
    """The columns of the first choice that the log has, without rows that cannot be drawn."""
    for columns in choices:
        if all(name in log for name in columns):
            part = {name: np.asarray(log[name], float) for name in ("time", *columns)}
            good = np.all([np.abs(values) < LARGEST for values in part.values()], axis=0)
            if np.count_nonzero(good) < 2:
                return None
            return part if good.all() else {name: values[good] for name, values in part.items()}
    return None


# File name -> columns read (the first choice that is there), function.
PICTURES: dict[str, tuple[Sequence[Sequence[str]], Callable[[Runs], "Figure"]]] = {
    "trajectory": (((*POSE, *TARGET), POSE), trajectory),
    "errors": (((*POSE, *TARGET),), errors),
    "metrics": (
        ((*POSE, *VELOCITY, *TARGET, *TAU_CMD), (*POSE, *VELOCITY, *TARGET, *TAU)),
        metrics,
    ),
    "forces": (((*TAU_LIN, *TAU_NONLIN, *TAU),), forces),
    "model_error": (((*OMEGA, *OMEGA_HAT),), model_error),
}

"""What a measured run feeds to an observer and a controller, and what it has to compare with."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.controller.backstepping import Errors
from fmus.signals import Force, Target

from ..runs import Track, clean, in_order, other_columns, read

TARGET = Target._fields
ERRORS = Errors._fields
ASKED = Force._fields
COMMAND = ("tau_cmd_X", "tau_cmd_Y", "tau_cmd_N")
# Instances of our own logs in which a signal of that name is found.
FOUND_IN = {**dict.fromkeys(TARGET, "guidance"), **dict.fromkeys((*ERRORS, *ASKED), "controller")}
# Share of a step by which time stamps may be off a regular grid that is taken for one (chosen).
JITTER = 0.25
LAB_STEP = 0.01  # s; of a run whose samples are not regular: that of the thesis' laboratory


@dataclass(frozen=True, eq=False)
class Source:
    """A measured run as a source of signals.

    Attributes:
        track: the run with its samples judged.
        step: of the replay [s].
        time: of the rows, from zero [s].
        tau: (n, 3), commanded force [N, N, N m]; NaN where it was lost.
        target: (n, 9), of the signals of TARGET; NaN where it was lost; None if the run has none.
        compared: what the run has of the controller's signals, NaN where lost: name -> (n,).
    """

    track: Track
    step: float
    time: np.ndarray
    tau: np.ndarray
    target: np.ndarray | None
    compared: dict[str, np.ndarray]

    @property
    def name(self) -> str:
        """Of the run."""
        return self.track.run.name

    @property
    def lost(self) -> dict[str, np.ndarray]:
        """Signal -> (n,) where it is missing in the run, of those that are missing somewhere."""
        gaps = {name: ~np.isfinite(values) for name, values in self.compared.items()}
        return {name: gap for name, gap in gaps.items() if gap.any()}


def gather_source(path: str | Path) -> Source:
    """Read a run as a source of signals.

    Args:
        path: as :func:`diagnosis.read` takes it.

    Raises:
        InputError: it cannot be used.
    """
    run = read(path)
    names = {signal: (f"{where}.{signal}", signal) for signal, where in FOUND_IN.items()}
    is_log = Path(path).is_dir() or Path(path).name.startswith("log.")
    # In a plain file tau_X is the force after clipping, which is a signal of its own.
    found = other_columns(path, [n[0] if is_log else n[1] for s, n in names.items()])
    track = clean(run)
    kept = in_order(run.time)

    def column(signal: str) -> np.ndarray | None:
        values = found.get(names[signal][0], found.get(names[signal][1]))
        return None if values is None else values[kept]

    tau = track.run.tau_cmd.copy()
    if track.run.held is not None:
        tau[track.run.held] = np.nan
    time = track.run.time - track.run.time[0]
    regular = float(np.round((time[-1] - time[0]) / (time.size - 1), 9))
    grid = np.arange(time.size) * regular
    on_grid = bool((np.abs(time - grid) <= JITTER * regular).all())
    columns = [column(s) for s in TARGET]
    there = [c for c in columns if c is not None]
    asked = ASKED if is_log else ()
    compared = {s: c for s in (*ERRORS, *asked) if (c := column(s)) is not None}
    compared |= dict(zip(COMMAND, tau.T, strict=True))
    return Source(
        track,
        regular if on_grid else LAB_STEP,
        np.round(grid, 12) if on_grid else time,
        tau,
        np.column_stack(there) if len(there) == len(TARGET) else None,
        compared,
    )

"""What a measured run feeds to an observer and a controller, and what it has to compare with."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagnosis.runs import PreparedRun, Track, prepare
from fmus.controller.backstepping import Errors
from fmus.signals import Force, Target

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
        prepared: the run.
        step: of the replay [s].
        time: of the rows, from zero [s].
        tau: (n, 3), commanded force [N, N, N m]; NaN where it was lost.
        target: (n, 9), of the signals of TARGET; NaN where it was lost; None if the run has none.
        compared: what the run has of the controller's signals, NaN where lost: name -> (n,).
    """

    prepared: PreparedRun
    step: float
    time: np.ndarray
    tau: np.ndarray
    target: np.ndarray | None
    compared: dict[str, np.ndarray]

    @property
    def track(self) -> Track:
        """The run with its samples judged."""
        return self.prepared.track

    @property
    def name(self) -> str:
        """Of the run."""
        return self.track.run.name

    @property
    def lost(self) -> dict[str, np.ndarray]:
        """Signal -> (n,) where it is missing in the run, of those that are missing somewhere."""
        gaps = {name: ~np.isfinite(values) for name, values in self.compared.items()}
        return {name: gap for name, gap in gaps.items() if gap.any()}


def gather_source(path: str | Path, anyway: bool = False) -> Source:
    """Read a run as a source of signals: at the rows of its track, as all commands use it.

    Args:
        path: as :func:`diagnosis.read` takes it.
        anyway: see :func:`.runs.prepare`.

    Raises:
        InputError: it cannot be used.
    """
    if Path(path).is_dir() or Path(path).name.startswith("log."):
        names = {signal: f"{instance}.{signal}" for signal, instance in FOUND_IN.items()}
    else:  # there tau_X is the force after clipping
        names = {signal: signal for signal in FOUND_IN if signal not in ASKED}
    prepared = prepare(path, anyway=anyway, also=names.values())
    run = prepared.track.run
    found = {s: run.measured[name] for s, name in names.items() if name in run.measured}
    tau = run.tau_cmd.copy()
    if run.held is not None:
        tau[run.held.any(axis=1)] = np.nan
    time = run.time - run.time[0]
    regular = float(np.round((time[-1] - time[0]) / (time.size - 1), 9))
    grid = np.arange(time.size) * regular
    on_grid = bool((np.abs(time - grid) <= JITTER * regular).all())
    target = [found.pop(s) for s in TARGET if s in found]
    return Source(
        prepared,
        regular if on_grid else LAB_STEP,
        np.round(grid, 12) if on_grid else time,
        tau,
        np.column_stack(target) if len(target) == len(TARGET) else None,
        found | dict(zip(COMMAND, tau.T, strict=True)),
    )

"""Each measured run left out in turn: what is learned from the others, evaluated on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diagnosis
from cosim import InputError
from diagnosis import (
    Content,
    Diagnosis,
    Evaluation,
    Model,
    WeakWindows,
    diagnosis_content,
    omega,
)
from diagnosis.execution.progress import Advance
from diagnosis.predictors import Response
from diagnosis.search import Prior
from fmus.ship import ship

SAME = 1e-6
TOGETHER = 2  # blocks of 15 s: what counts as independent


@dataclass(frozen=True, eq=False)
class LeftOutRun:
    """What was learned without one run, and how it does there.

    Attributes:
        found: what was learned; its last evaluation is that of the run left out.
        seen: the same run when it is among the training runs.
    """

    found: Diagnosis
    seen: Evaluation | None = None

    @property
    def evaluation(self) -> Evaluation:
        return self.found.comparison.evaluations[-1]

    @property
    def name(self) -> str:
        return self.evaluation.name

    @cached_property
    def content(self) -> Content:
        """As in ``diagnosis.json``."""
        return diagnosis_content(self.found, None, [])

    @property
    def model(self) -> Model:
        return self.found.learned.model

    @property
    def fall(self) -> np.ndarray:
        """(3,): RMS of the model error before over that after."""
        return fall(self.evaluation)

    @property
    def ceiling(self) -> np.ndarray:
        """(3,): the fall at which only the measurement's own noise is left."""
        std = np.sqrt(np.mean(self.found.comparison.omega_std[-1] ** 2, axis=0))
        return self.evaluation.before.omega_rms / std


def fall(e: Evaluation) -> np.ndarray:
    """(3,): RMS of the model error before over that after."""
    return e.before.omega_rms / e.after.omega_rms


def leave_out(runs: Sequence[WeakWindows], k: int, prior: Prior, advance: Advance) -> LeftOutRun:
    """Learn from all runs but one.

    Args:
        runs: at least two.
        k: which one is left out.
        prior: of the nominal coefficients, as of :func:`diagnosis.diagnose`.
        advance: receives the name of each step when it begins.
    """
    others = [w for i, w in enumerate(runs) if i != k]
    return LeftOutRun(diagnosis.diagnose(others, [runs[k]], prior, advance=advance))


def gather(files: Sequence[Path], advance: Advance) -> list[WeakWindows]:
    """Measured runs, enough to leave one out.

    Raises:
        InputError: there is one only, or one cannot be used.
    """
    if len(files) < 2:
        raise InputError(f"'{files[0]}' is a single run and cannot be left out of training")
    return diagnosis.gather(files, advance)


def apart(w: WeakWindows) -> bool:
    """Whether each VSP has commands of its own."""
    return w.run.signals == ship().layouts[-1].commands and w.run.commands is not None


def steered(w: WeakWindows) -> bool:
    """Whether a controller steered for most of the time: both VSP then have one sway command."""
    given = w.run.commanded
    return apart(w) and bool(np.mean(np.abs(given["u2"] - given["u4"]) < SAME) > 0.5)


def at_full_power(w: WeakWindows) -> np.ndarray:
    """RMS (3,) of the nominal model error without the power settings of the run."""
    track = w.smoothed.track
    run = replace(track.run, power=None)
    at_full = replace(w, smoothed=replace(w.smoothed, track=replace(track, run=run)), memory={})
    return np.sqrt(np.mean(omega(at_full, Model()) ** 2, axis=0))


class CommandedShares(NamedTuple):
    """Shares (3,) of what is left, 0 to 1, that the commands of the VSP would explain on each axis.

    Attributes:
        both: the sums of the two VSP's commands, as in a model with one law for both.
        single: the commands of each.
    """

    both: np.ndarray
    single: np.ndarray


def commanded(e: Evaluation, model: Model) -> CommandedShares:
    """How much of what is left goes with the commands of the VSP, in any direction of the force.

    Fitted are commands and their sizes, delayed as in the model, and judged on blocks that were not
    fitted; where that is no better than nothing, the share is 0.

    Args:
        e: the run.
        model: the learned one.
    """
    w = e.weak_windows
    if not apart(w):
        return CommandedShares(np.zeros(3), np.zeros(3))
    power = 1.0 if w.run.power is None else w.run.power[:, :1]
    arriving = Response(w.run, model).between_samples[0]
    first, second = arriving[:2].T, arriving[2:4].T
    two, four = first + second, np.hstack([first, second])
    return CommandedShares(*(_explained(w, e.after.omega, power * c) for c in (two, four)))


def _explained(w: WeakWindows, left: np.ndarray, commands: np.ndarray) -> np.ndarray:
    """Cross-validated share (3,) of the squares of ``left`` (K, 3)."""
    columns = w.held @ np.hstack([commands, np.abs(commands)])
    fold = np.unique(w.block // TOGETHER, return_inverse=True)[1]
    missed = np.zeros(3)
    for k in range(fold.max() + 1):
        out = fold == k
        fitted = np.linalg.lstsq(columns[~out], left[~out], rcond=None)[0]
        missed += np.sum((left[out] - columns[out] @ fitted) ** 2, axis=0)
    return np.clip(1.0 - missed / np.sum(left**2, axis=0), 0.0, 1.0)

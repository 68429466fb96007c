"""From files to runs that can be judged: each prepared, two at a time, and cut into windows."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from cosim import InputError

from ..execution.parallel import for_each, one_thread
from ..execution.progress import Advance, silent
from ..predictors import Model, WeakWindows, weak_windows
from ..predictors.weak_form import BLOCK, WIDTH
from ..runs import PreparedRun, Run, Smoothed, prepare, read_each
from ..runs.columns.unit_check import GO_ON
from .command_check import idle, moves_on, without_force
from .plausibility import refuse_implausible
from .trial_errors import measured_passage


@one_thread()
def gather(
    paths: Sequence[str | Path | Run],
    advance: Advance = silent,
    anyway: bool = False,
    model: Model | None = None,
    horizon: float | None = None,
    meanwhile: Callable[[], object] | None = None,
) -> list[WeakWindows]:
    """Read and prepare measured runs, and refuse those whose files state something else than was meant.

    ``learn``, ``compare`` and :func:`diagnosis.load` get their runs here; see :func:`.runs.prepare`.

    Args:
        paths: files or folders of logs, see :func:`diagnosis.read`, or runs that were read.
        advance: progress callback.
        anyway: whether a run is accepted whose units, signs or columns seem to be other ones than
            stated, or whose channels contradict each other beyond repair.
        model: the initial one, by which that is judged, and of whose ship they are; the nominal one by
            default.
        horizon: length of the windows in which models predict the runs [s]; by default that of the ship.
        meanwhile: see :func:`.parallel.for_each`; done while a second process smooths.

    Returns:
        For each run its windows of the weak form; names are unique.

    Raises:
        InputError: a horizon that is not positive, longer than every run or shorter than a row; a run
            that cannot be used, is given twice by whatever name, or seems to be misread.
    """
    if not paths:
        raise InputError("there is no run to read")
    if horizon is not None and not 0.0 < horizon < inf:
        raise InputError(f"the horizon must be a positive time, not {horizon:g} s")
    model = model or Model()
    craft = model.ship
    advance("reading")
    runs = read_each(paths, craft)
    advance(f"smoothing {', '.join(run.name for run in runs)}")
    smoothed = for_each(lambda run: motion(prepare(run, craft, anyway)), runs, (), meanwhile)
    if not anyway:
        smoothed = [_with_known_commands(s, run, model) for s, run in zip(smoothed, runs, strict=True)]
    longest = max(float(np.ptp(s.track.run.time)) for s in smoothed)
    if horizon is not None and horizon > longest:
        raise InputError(
            f"the horizon, {horizon:g} s, is longer than every run; the longest has {longest:.4g} s"
        )
    rarest = max(s.track.period for s in smoothed)
    if horizon is not None and horizon < rarest:
        raise InputError(
            f"the horizon, {horizon:g} s, is shorter than the {rarest:.3g} s between two samples"
        )
    return usable(smoothed, model, anyway, horizon)


def _with_known_commands(s: Smoothed, run: Run, model: Model) -> Smoothed:
    """The motion of a run; zero commands are none where the ship goes on as before."""
    rows = idle(run, BLOCK * s.scale.time)  # in less the ship may not have forgotten its thrust
    if not rows.any() or rows.all():
        return s
    windows = weak_windows(s)
    line = moves_on(windows, model) if windows.middle.size else None
    if line is None:
        return s
    held = rows[:, None] if run.held is None else rows[:, None] | run.held
    return motion(prepare(replace(run, held=held, notes=(*run.notes, line)), model.ship))


def motion(prepared: PreparedRun) -> Smoothed:
    """The smoothed motion of a run that has a sample at least for each window of the weak form.

    Raises:
        InputError: they are rarer, or do not determine a motion.
    """
    track = prepared.track
    width = WIDTH * track.scale.time
    if track.period > width and not prepared.anyway:
        raise InputError(
            f"run '{track.run.name}': a measurement every {track.period:.3g} s is too rare "
            f"to average forces over {width:.3g} s; {GO_ON}"
        )
    return prepared.smoothed


def usable(
    smoothed: Sequence[Smoothed], model: Model, anyway: bool = False, horizon: float | None = None
) -> list[WeakWindows]:
    """Windows of smoothed runs, if these can be what their files state; see :func:`gather`.

    Raises:
        InputError: a run's thrusters are never at work, too much of it is missing, it is not the trial
            that it should be, or it seems to be misread.
    """
    windows = []
    for s in smoothed:
        name = s.track.run.name
        if not np.abs(s.track.run.tau_cmd).max() > 1e-6:
            raise InputError(f"run '{name}': {without_force(s.track.run, model)}")
        windows.append(weak_windows(s, horizon))
        if not windows[-1].middle.size:
            raise InputError(f"run '{name}': too many samples are missing while the thrusters act")
        if s.track.run.trial is not None:
            measured_passage(s, model.ship)  # refuses what is no trial
    return windows if anyway else refuse_implausible(windows, model)


def distinctly_named(data: Sequence[WeakWindows]) -> list[WeakWindows]:
    """Runs of which no two have the same name: those that had it are numbered."""
    found, seen = [], Counter[str]()
    for w in data:
        name, s = w.run.name, w.smoothed
        seen[name] += 1
        if seen[name] > 1:
            run = replace(w.run, name=f"{name} ({seen[name]})")
            w = replace(w, smoothed=replace(s, track=replace(s.track, run=run)))
        found.append(w)
    return found

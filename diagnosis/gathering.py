"""From files to runs that can be judged: read all, then clean and smooth, two at a time."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from cosim import InputError
from fmus.scale import Scale

from .assessment.plausibility import refuse_implausible
from .assessment.trial_errors import measured_passage
from .execution.parallel import for_each
from .execution.progress import Advance, silent
from .predictors import Model, WeakWindows, weak_windows
from .predictors.weak_form import WIDTH
from .runs import Examined, Run, Smoothed, Track, clean, examine, read, smooth, thinned
from .runs.columns.unit_check import GO_ON

# Samples in a window of the weak form. Derived: with so many its kernel's slope integrates a velocity
# that grows evenly to 2 %, with five to 3 %, with three to 23 %.
FEWEST = 6
MOST_SPIKES = 0.1  # of the samples; chosen: of a run of the real ship 7 % are spikes, and it can be used
# A part of a log tells less of its clock than the whole.
WHOLE_FIRST = "repair the whole log by its other channels (cybership repair) and take the part of that"


def gather(
    paths: Sequence[str | Path | Run],
    advance: Advance = silent,
    anyway: bool = False,
    model: Model | None = None,
    horizon: float | None = None,
    meanwhile: Callable[[], object] | None = None,
) -> list[WeakWindows]:
    """Read and smooth measured runs, and refuse those whose files say something else than was meant.

    Faults of the channels that the channels themselves repair are repaired, see :mod:`.sensors`.

    All commands, and :func:`diagnosis.load`, get their runs here.

    Args:
        paths: files or folders of logs, see :func:`diagnosis.read`, or runs that were read.
        advance: progress callback.
        anyway: whether a file is believed whose units, signs or columns seem to be other ones than said,
            or whose channels contradict each other beyond repair.
        model: the initial one, by which that is judged, and of whose ship they are; the nominal one by
            default.
        horizon: length of the windows in which models predict the runs [s]; by default that of the ship.
        meanwhile: see :func:`.parallel.for_each`; done while a second process smooths.

    Returns:
        For each run its windows of the weak form; names are unique.

    Raises:
        InputError: no positive horizon, or a run that cannot be used, is given twice by whatever name,
            or seems to be misread.
    """
    if not paths:
        raise InputError("there is no run to read")
    if horizon is not None and not 0.0 < horizon < inf:
        raise InputError(f"the horizon must be a positive time, not {horizon:g} s")
    model = model or Model()
    scale = model.ship.scale
    advance("reading")
    runs = [path if isinstance(path, Run) else read(path, of=model.ship) for path in paths]
    names = [path.name if isinstance(path, Run) else path for path in paths]
    _refuse_twice(runs, names)
    advance(f"smoothing {', '.join(run.name for run in runs)}")
    smoothed = for_each(lambda run: _smoothed(run, anyway, scale), _distinct(runs, names), (), meanwhile)
    windows = [_windows(s, anyway, horizon) for s in smoothed]
    for s in smoothed:
        if s.track.run.trial is not None:
            measured_passage(s, model.ship)  # refuses what is no trial
    if not anyway:
        refuse_implausible(windows, model)
    return windows


def _refuse_twice(runs: Sequence[Run], paths: Sequence[str | Path]) -> None:
    """The same measurement twice would count twice, and held out it would prove nothing."""
    known: dict[bytes, str | Path] = {}
    for run, path in zip(runs, paths, strict=True):
        content = np.column_stack([run.time, run.pose]).tobytes()
        if content in known:
            again = f"'{path}' is given twice"
            same = f"'{path}' holds the same measurement as '{known[content]}'"
            raise InputError(again if Path(path) == Path(known[content]) else same)
        known[content] = path


def _distinct(runs: Sequence[Run], paths: Sequence[str | Path]) -> list[Run]:
    """The runs, those of the same name with more of their path in it."""
    times = Counter(run.name for run in runs)
    return [
        run if times[run.name] == 1 else replace(run, name=Path(path).absolute().as_posix())
        for run, path in zip(runs, paths, strict=True)
    ]


def _smoothed(run: Run, anyway: bool, scale: Scale) -> Smoothed:
    """A run as far as its own channels repair it, judged and smoothed."""
    examined = examine(run, scale)
    if not anyway:
        _refuse_unrepaired(examined)
    repaired = replace(examined.run, notes=(*examined.run.notes, *examined.notes))
    track = clean(repaired, anyway, scale)
    if not anyway:
        _refuse_rare(track)
    smoothed = smooth(thinned(track), agreeing=examined.agreeing)
    return replace(smoothed, sensors=examined)


def _refuse_unrepaired(examined: Examined) -> None:
    """Refuse a run with a fault of its channels that these cannot repair.

    Raises:
        InputError: there is one.
    """
    for finding in examined.findings:
        if not finding.repaired:
            raise InputError(
                f"run '{examined.run.name}': {finding.sentence}; what else is measured does not tell "
                f"how to repair that; if it is a part of a log, {WHOLE_FIRST}; {GO_ON}"
            )


def _windows(smoothed: Smoothed, anyway: bool, horizon: float | None) -> WeakWindows:
    """Windows of a run, at least one.

    Raises:
        InputError: the thrusters are never at work, too much is missing or disagrees with the rest.
    """
    run = smoothed.track.run
    if not anyway:
        _refuse_spikes(smoothed)
    if not np.abs(run.tau_cmd).max() > 1e-6:
        raise InputError(f"run '{run.name}': its commands are zero throughout, which tells nothing")
    w = weak_windows(smoothed, horizon)
    if not w.middle.size:
        raise InputError(f"run '{run.name}': too much is missing while the thrusters are at work")
    return w


def _refuse_rare(track: Track) -> None:
    """Refuse samples that are too rare for the windows.

    Raises:
        InputError: they are.
    """
    width = WIDTH * track.scale.time
    if track.period > width / (FEWEST - 0.5):  # up to rounding
        raise InputError(
            f"run '{track.run.name}': a measurement every {track.period:.3g} s is too rare where forces "
            f"are averaged over {width:.3g} s; log one every {width / FEWEST:.3g} s or "
            f"more often; {GO_ON}"
        )


def _remedy(s: Smoothed) -> str:
    """What may be done with a run whose pose is not that of a ship."""
    if not s.track.run.measured:
        return "leave the cells of false samples empty"
    return WHOLE_FIRST


def _refuse_spikes(s: Smoothed) -> None:
    """Refuse a run of which too many samples are far from all others.

    Raises:
        InputError: they are.
    """
    fresh, spikes = int(s.track.valid.sum()), int(s.spikes.sum())
    if spikes > MOST_SPIKES * fresh:
        raise InputError(
            f"run '{s.track.run.name}': {spikes} of {fresh} samples ({spikes / fresh:.0%}) are more "
            "than five standard deviations from where all others say the ship is: something is wrong "
            f"with the pose or its time; {_remedy(s)}; {GO_ON}"
        )

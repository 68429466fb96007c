"""Rows at a rate that the analysis of a run can bear: of many fewer, and more where they are rare."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from fmus.ship import ship

from .cleaning import BRIEF, Track, long_gap
from .files.reading import Run
from .held_signal import Integral
from .run_constants import DIGITS, EVERY
from .smoothing.smoother import Smoothed

# 1, rows that are analysed as they are; chosen: of more, learning would take minutes and more than 2 GB.
MOST_ROWS = 100_000


def filled_up(track: Track) -> Track:
    """A run with more rows, without measurements, where its rows are rarer than windows of forces.

    There the smoothed motion leads from one sample to the next, and commands are held.
    """
    time = track.run.time
    steps = np.diff(time)
    row = float(np.median(steps))
    parts = np.ceil(steps / (EVERY * track.scale.time) - DIGITS)
    # A longer step is a gap.
    parts = np.where(steps < long_gap(row, track.scale), parts, 1.0).astype(int)
    if not (parts > 1).any():
        return track
    many = np.append(parts, 1)
    last = np.repeat(np.arange(time.size), many)
    within = np.arange(last.size) - np.repeat(np.cumsum(many) - many, many)
    new, track = within > 0, track.rows(last)
    run = track.run
    between = np.append(steps / parts, 0.0)[last] * within
    measured = {name: np.where(new, np.nan, values) for name, values in run.measured.items()}
    pose = np.where(new[:, None], np.nan, track.pose)
    return replace(
        track,
        run=replace(run, time=run.time + between, pose=pose, measured=measured),
        pose=pose,
        fresh=track.fresh & ~new[:, None],
        frozen=track.frozen & ~new,
        dropped=track.dropped & ~new,
        between=track.between | new,
    )


def thinned(track: Track) -> Track:
    """A run with fewer rows, if it has many: of each interval the median pose and the mean command.

    The median is over the valid samples, at the mean of their times, of what is left of them once the
    motion within the interval is taken off: it has less noise than a sample, and lets no spike through.
    The mean command over the time between two rows has the impulse that acted.

    Args:
        track: a run with its samples judged.
    """
    run = track.run
    row = float(np.median(np.diff(run.time)))
    factor = min(-(-run.time.size // MOST_ROWS), int(BRIEF * track.scale.time / row + DIGITS))
    if factor < 2:
        return track
    width = factor * row
    _, part = np.unique(np.floor((run.time - run.time[0]) / width + DIGITS), return_inverse=True)
    of_valid = _by(part, np.where(track.valid, run.time, np.nan)).mean()
    time = of_valid.fillna(_by(part, run.time).mean()).to_numpy()[:, 0]
    seen = track.pose  # NaN where it is not valid
    pose = _by(part, seen).median().to_numpy()
    moved = np.nan_to_num(np.gradient(pose, time, axis=0))[part] * (run.time - time[part])[:, None]
    pose = _by(part, seen - moved).median().to_numpy()
    fresh = ~np.isnan(pose)
    gone = ~fresh[:, 0]
    frozen = gone & _by(part, track.frozen).max().to_numpy()[:, 0]
    dropped = gone & ~frozen & _by(part, track.dropped).max().to_numpy()[:, 0]
    near = np.searchsorted(run.time, time).clip(0, run.time.size - 1)
    measured = {name: values[near] for name, values in run.measured.items()}
    commands = _mean_commands(run, time)
    held = None if run.held is None else _by(part, run.held).mean().to_numpy() > 0.5
    note = (
        f"{run.time.size} rows, {row:.3g} s apart, thinned to {time.size}, {width:.3g} s apart: "
        "medians of the pose, means of the commands"
    )
    run = replace(run, time=time, pose=pose, resolution=None, held=held, measured=measured, **commands)
    return replace(
        track,
        run=run,
        pose=pose,
        fresh=fresh,
        frozen=frozen,
        dropped=dropped,
        between=gone & ~frozen & ~dropped,
        period=max(track.period, width),
        notes=(*track.notes, note),
    )


def thinned_motion(smoothed: Smoothed) -> Smoothed:
    """A smoothed run with rows no closer than makes a difference to its motion, and mean commands.

    What counts its samples, or smooths them again, needs the whole run.
    """
    track, time = smoothed.track, smoothed.time
    width = BRIEF * smoothed.scale.time
    if width < (2.0 - DIGITS) * float(np.median(np.diff(time))):
        return smoothed
    part = np.floor((time - time[0]) / width + DIGITS)
    known = np.isfinite(smoothed.nu[:, 0])
    begins = np.diff(part, prepend=-1.0) != 0.0
    begins[1:] |= np.diff(known)
    begins[:-1] |= np.diff(known)
    begins[-1] = True
    fewer = smoothed.rows(begins)
    run = replace(fewer.track.run, **_mean_commands(track.run, fewer.time))
    return replace(fewer, track=replace(fewer.track, run=run))


def _mean_commands(run: Run, edges: np.ndarray) -> dict[str, np.ndarray]:
    """What a run has of commands, each the mean from an edge (m,) to the next; the last as it is."""
    means = {"tau_cmd": _mean(run.time, run.tau_cmd, edges)}
    if run.power is not None:
        means["power"] = _mean(run.time, run.power, edges)
    if run.commands is not None:
        means["commands"] = _mean_actuators(run, run.commands, edges)
    return means


def _mean_actuators(run: Run, commands: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The same of the commands (n, k) of a run's actuators.

    A propeller's thrust follows the square of its shaft speed, so that the mean of n |n| counts: a
    controller that answers noise changes n with each sample, and the mean of n has less thrust. A shaft
    behind a lag does not follow, and has the mean of n.
    """
    of = ship(description=run.ship)
    units, lags = of.form_of(commands).values(), of.layout_of(commands).lags
    angle = [unit == "rad" for unit in units]
    prompt = [unit == "1/s" and lag == 0.0 for unit, lag in zip(units, lags, strict=True)]
    turns = np.zeros_like(commands)
    turns[:, angle] = np.unwrap(commands[:, angle], axis=0) - commands[:, angle]
    row = np.searchsorted(run.time, edges, side="right") - 1
    means = _mean(run.time, commands + turns, edges) - turns[row]
    if any(prompt):
        n = commands[:, prompt]
        squares = _mean(run.time, n * np.abs(n), edges)
        means[:, prompt] = np.sign(squares) * np.sqrt(np.abs(squares))
    return means


def _by(part: np.ndarray, values: np.ndarray) -> Any:
    """Values (n,) or (n, k) grouped by the interval (n,) that they lie in."""
    table: Any = pd.DataFrame(values)
    return table.groupby(part)


def _mean(time: np.ndarray, values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Means from each edge (m,) to the next of values (n, k) that are held; the last as it is."""
    whole = Integral(time, values[:-1], values[0])(edges)
    return np.vstack([np.diff(whole, axis=0) / np.diff(edges)[:, None], values[-1:]])

"""The rows of a log in the order of time, each with a time of its own.

Stamps are explained before rows are left out: rows that were written late, the samples of one instant in
several rows, stamps that are coarser than the rows, a clock that was set back, a second run.
"""

from bisect import bisect_left
from dataclasses import replace

import numpy as np
from scipy import constants as c

from cosim import InputError
from cybership.message_text import counted
from fmus.scale import REFERENCE, Scale

from .files.reading import Run
from .run_constants import CHANCE, FEWEST, HORIZON, IN_A_ROW, LONG, NEGLIGIBLE

ON_GRID = (
    0.2  # 1, of a period, by which a sample may be off an even grid; 1 - this, of all that are on it
)
MOST_WRONG = 0.1  # 1, of the rows; chosen: of a run of the real ship 7 % are spikes, and it can be used


def ordered(run: Run, scale: Scale = REFERENCE) -> Run:
    """A run whose time grows from row to row.

    Returns:
        The run with the rows that have a time; ``left_out`` counts the others.

    Raises:
        InputError: more rows than can be wrong by chance have no time of their own.
    """
    if np.isfinite(run.time).all() and (np.diff(run.time) > 0.0).all():
        return _spread(_of_batches(run)) if in_bursts(run, scale) else run
    run = _without_empty(run)
    many = run.time.size
    found = _spread(_merged(continued(_begun_anew(by_stamps(run)), scale)))
    kept = in_order(found.time)
    lost = found.time.size - kept.size  # a sample that is there again is none
    if lost > MOST_WRONG * many:
        even = _even(run)
        if even is None:
            raise InputError(
                f"run '{run.name}': time does not increase in {lost} of {many} rows, and they are not "
                "evenly spaced; state a column whose time does"
            )
        return even
    out = found.left_out + lost
    note = (f"{counted(out, 'row')} left out: time missing, repeated or decreasing",) if out else ()
    return replace(found.rows(kept), left_out=out, notes=(*found.notes, *note))


def in_bursts(run: Run, scale: Scale = REFERENCE) -> bool:
    """Whether rows at increasing times are far closer than they are on average, gaps apart.

    So are the positions: rows of other channels a few milliseconds later, as each message has its own,
    are no burst.
    """

    def close(time: np.ndarray) -> bool:
        steps = np.minimum(np.diff(time), HORIZON * scale.time)
        return bool(time.size > 1 and NEGLIGIBLE * steps.sum() > np.median(np.diff(time)) * time.size)

    return close(run.time) and close(run.time[np.isfinite(run.pose[:, :2]).all(axis=1)])


def _of_batches(run: Run) -> Run:
    """A run whose rows were stamped when a batch of them was written, with the batch's first stamp.

    The ship moves as far within a batch as from one to the next: it is none of samples that were taken
    in a burst.
    """
    step = np.diff(run.time)
    begins = step > step.mean()
    moved = np.linalg.norm(np.diff(run.pose[:, :2], axis=0), axis=1)
    across, within = (moved[rows & np.isfinite(moved)] for rows in (begins, ~begins))
    if min(across.size, within.size) < LONG or across.mean() > LONG * within.mean():
        return run
    return replace(run, time=run.time[np.append(True, begins)][np.append(0, np.cumsum(begins))])


def _even(run: Run) -> Run | None:
    """The run with evenly spaced rows, about which its stamps jitter; None where they do not.

    All stamps are within some rows of the straight line through them.
    """
    row = np.arange(run.time.size)
    if run.time.size < 2 or not np.isfinite(run.time).all():
        return None
    period, first = np.polyfit(row, run.time, 1).tolist()
    off = run.time - (first + period * row)
    if not np.abs(off).max() < LONG * period:
        return None
    note = (
        f"its stamps jitter by {off.std():.2g} s (one standard deviation), more than its rows are "
        f"apart: these are taken as evenly spaced, {period:.4g} s apart"
    )
    return replace(run, time=first + period * row, notes=(*run.notes, note))


def whole_periods(step: np.ndarray, period: float) -> np.ndarray | None:
    """(n,), whole periods [s], at least 1, in steps of time (n,) [s]; None where they are not even."""
    counts = np.maximum(np.round(step / period), 1.0)
    even = np.mean(np.abs(step - counts * period) <= ON_GRID * period) >= 1.0 - ON_GRID
    return counts if even else None


def missing_rows(time: np.ndarray) -> np.ndarray:
    """(n - 1,), how many rows are missing between those at times (n,) [s]; 0 where they are not even."""
    step = np.diff(time)
    counts = whole_periods(step, float(np.median(step)))
    return np.zeros_like(step) if counts is None else counts - 1.0


def _without_empty(run: Run) -> Run:
    """The run without rows that have no time and no measured value, as at the end of a spreadsheet."""
    cells = np.column_stack([run.time, run.pose, *run.measured.values()])
    there = np.asarray(np.isfinite(cells).any(axis=1))
    if there.all():
        return run
    return replace(run.rows(there), left_out=run.left_out + int((~there).sum()))


def by_stamps(run: Run) -> Run:
    """The rows by their stamps, if the ship's way is likelier then than in the order of the file.

    Steps of the position are compared as ones of a Laplace distribution, which a few spikes do not rule.
    """
    rows = np.flatnonzero(np.isfinite(run.time))
    by_time = rows[np.argsort(run.time[rows], kind="stable")]
    if (by_time == rows).all():
        return run
    as_written, way = (_steps(run.pose[order, :2], run.time[order]) for order in (rows, by_time))
    if as_written.size:  # else the newest row comes first
        chance = np.exp(np.log(CHANCE) / as_written.size)
        if not (way.size and 0.0 < way.mean() < as_written.mean() * chance):
            return run
    moved = int((by_time != rows).sum())
    note = f"rows are not in the order of time, {moved} of {rows.size}: they are sorted by their stamps"
    # Rows without a stamp come last; they are left out.
    return replace(
        run.rows(np.append(by_time, np.flatnonzero(~np.isfinite(run.time)))), notes=(*run.notes, note)
    )


def _steps(position: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Distances of a position (n, 2) between successive rows that have one, if the time (n,) grows."""
    there = np.isfinite(position).all(axis=1) & (np.abs(position) > 0.0).any(axis=1)
    steps = np.linalg.norm(np.diff(position[there], axis=0), axis=1)
    return steps[np.diff(time[there]) > 0.0]


def continued(run: Run, scale: Scale = REFERENCE) -> Run:
    """A run whose clock was set back, as it would be if it had not been: all rows after that are later.

    A clock was set back where the times after it were there before, row by row, or where many rows go on
    with other times than all before, as after a restart. If the ship does not go on from where it was, a
    second run begins there: it follows after a gap.
    """
    time, notes = np.array(run.time), []
    with np.errstate(invalid="ignore", over="ignore"):  # false cells are infinite or missing
        step = np.linalg.norm(np.diff(run.pose[:, :2], axis=0), axis=1)
        later = np.flatnonzero(np.diff(time) < 0.0) + 1
        for row in later:
            ends = np.flatnonzero(~((np.diff(time[row:]) >= 0.0) & (time[row + 1 :] <= time[row - 1])))
            again = time[row : row + 1 + (ends[0] if ends.size else time.size)]
            there = (time[:row] >= again[0]) & (time[:row] <= again[-1])
            rows = sorted((int(there.sum()), again.size))
            steps = np.diff(again)
            usually = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else np.inf
            # Rows that come late, or after a false stamp, have a longer step at their end or before.
            about = np.diff(time[max(row - IN_A_ROW, 0) : row + again.size + 1])
            anew = rows[0] == 0 and rows[1] >= FEWEST and about.max() <= LONG * usually
            if rows[0] < max(LONG, 0.5 * rows[1]) and not anew:
                continue
            near = rows[0] or rows[1]
            usual = step[max(row - 1 - near, 0) : row + near]
            usual = usual[np.isfinite(usual)]
            if not usual.size:
                continue
            back = time[row - 1] - time[row] + usually
            if step[row - 1] <= LONG * np.median(usual):
                notes.append(f"the clock was set back by {back:.4g} s at {time[row - 1]:.4g} s")
            else:
                back += 2.0 * HORIZON * scale.time
                notes.append(
                    f"a second run begins in row {row + 1}: the time is {run.time[row]:.4g} s there, "
                    "and the ship is elsewhere; it follows after a gap"
                )
            time[row:] += back
    return replace(run, time=time, notes=(*run.notes, *notes)) if notes else run


def _begun_anew(run: Run) -> Run:
    """A run whose time of day began anew, as at midnight, with the time going on.

    It did where one period makes each step back one as long as steps between rows are.
    """
    step = np.diff(run.time)
    back = step < 0.0
    if not (back.any() and (step > 0.0).any()):
        return run
    longest = LONG * float(np.median(step[step > 0.0]))
    for period in (c.day, c.day / 2.0, c.hour, c.minute):
        on = step[back] + period
        if ((on > 0.0) & (on <= longest)).all():
            count = np.append(0, np.cumsum(back))
            note = f"the time begins anew after {period:.5g} s, {count[-1]} times: it goes on"
            return replace(run, time=run.time + period * count, notes=(*run.notes, note))
    return run


def _merged(run: Run) -> Run:
    """Rows of one stamp as one, where no channel has two values: messages of several topics."""
    first = np.concatenate([[True], np.diff(run.time) != 0.0])
    if first.all():
        return run
    group = np.cumsum(first) - 1
    channels = np.column_stack([run.pose, *run.measured.values()])
    there = np.isfinite(channels)
    row = np.arange(first.size)[:, None]
    many = group[-1] + 1
    newest = np.full((many, channels.shape[1]), -1)
    np.maximum.at(newest, group, np.where(there, row, -1))
    value = np.where(newest < 0, np.nan, np.take_along_axis(channels, np.maximum(newest, 0), axis=0))
    clash = np.zeros(many, bool)
    np.logical_or.at(clash, group, (there & (channels != value[group])).any(axis=1))
    last = np.append(first[1:], True)
    keep = clash[group] | last
    held = run.held
    if held is not None:  # not where a row of the stamp states the command
        stated = np.zeros((many, held.shape[1]), bool)
        np.logical_or.at(stated, group, ~held)
        held = held & ~(stated[group] & last[:, None])
    merged = replace(run, held=held).rows(keep)
    one = np.flatnonzero(~clash[group[keep]])
    filled = np.column_stack([merged.pose, *merged.measured.values()])
    filled[one] = value[group[keep][one]]
    # A row of which all is in another one of its stamp is a sample that repeats.
    twice = ~keep & there[:, :3].any(axis=1) & (there & (newest[group] != row)).any(axis=1)
    measured = dict(zip(run.measured, filled.T[3:], strict=True))
    return replace(
        merged, pose=filled[:, :3], measured=measured, left_out=run.left_out + int(twice.sum())
    )


def _spread(run: Run) -> Run:
    """Rows that share stamps because these are coarser, evenly over the time to the next stamp."""
    first = np.flatnonzero(np.concatenate([[True], np.diff(run.time) != 0.0]))
    if run.time.size - first.size <= MOST_WRONG * run.time.size:
        return run
    stamps = run.time[first]
    step = np.diff(stamps)
    many = np.diff(np.append(first, run.time.size))
    note = (
        f"its stamps are {np.median(step) if step.size else 0.0:.4g} s apart, with {many.mean():.3g} "
        "samples each: these are taken as evenly spaced"
    )
    if many.size > 2 and np.ptp(many[1:-1]):  # stamps that are rounded, or are no whole periods
        even = _even_below(run.time, float(np.median(step)))
        if even is not None:
            return replace(run, time=even, notes=(*run.notes, note))
    until = np.append(step, np.median(step) if step.size else 0.0)
    # A gap after a stamp is no part of it.
    until = np.where((until > 0.0) & (until < LONG * np.median(until)), until, np.median(until))
    within = np.arange(run.time.size) - np.repeat(first, many)
    apart = until / many
    if many.size > 2:  # the first stamp and the last one may have a part of their rows
        apart[[0, -1]] = np.minimum(apart[[0, -1]], np.median(apart[1:-1]))
    time = run.time + np.repeat(apart, many) * within
    time[: many[0]] += until[0] - apart[0] * many[0]
    return replace(run, time=time, notes=(*run.notes, note))


def _even_below(time: np.ndarray, step: float) -> np.ndarray | None:
    """Evenly spaced times (n,) whose stamps are these to a resolution [s]; None: none are."""
    row = np.arange(time.size)
    period, first = np.polyfit(row, time, 1).tolist()
    even = first + period * row
    off = time - even
    return even + off.max() if np.ptp(off) <= (1.0 + NEGLIGIBLE) * step else None


def in_order(time: np.ndarray) -> np.ndarray:
    """Rows of the longest part of some times [s] that grows strictly; non-finite ones are left out."""
    rows = np.flatnonzero(np.isfinite(time))
    if (np.diff(time[rows]) > 0.0).all():
        return rows
    ends: list[float] = []  # the smallest time at which a part of that length can end
    last: list[int] = []
    before = np.full(time.size, -1)
    for row in rows.tolist():
        place = bisect_left(ends, time[row])
        before[row] = last[place - 1] if place else -1
        ends[place : place + 1] = [float(time[row])]
        last[place : place + 1] = [row]
    found = [last[-1]]
    while before[found[-1]] >= 0:
        found.append(int(before[found[-1]]))
    return np.array(found[::-1])

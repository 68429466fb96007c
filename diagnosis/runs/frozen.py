"""Channels that are frozen alone: values that repeat to the bit while the ship moves."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .files.reading import Run
from .files.telegrams import groups_of
from .run_constants import CHANCE, DIGITS, FEWEST, IN_A_ROW, LONG


def repeated(pose: np.ndarray, there: np.ndarray) -> np.ndarray:
    """(n,): where a pose, or channels of it, (n, k), is to the bit the last one that was there."""
    rows = np.flatnonzero(there)
    repeats = np.zeros(there.size, bool)
    repeats[rows[1:]] = (np.diff(pose[rows], axis=0) == 0.0).all(axis=1)
    return repeats


def stuck(run: Run, seen: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Rows with one coordinate of the place frozen while the other one is measured.

    It repeats to the bit more often than noise does, and then jumps by more than 99 % of its own steps;
    a number without rounding that moved before may stay so until the end.

    Args:
        run: its rows in order.
        seen: (n,), rows in which the place was measured.

    Returns:
        (n,), and a line on each stretch.
    """
    found, lines, rows = np.zeros_like(seen), list[str](), np.flatnonzero(seen)
    for k in range(2):
        step, coarse = np.abs(np.diff(run.pose[rows, k])), run.coarse[rows, k]
        moves = step[step > 0.0]
        if not moves.size:
            continue
        usual = float(np.quantile(moves, 1.0 - CHANCE))
        for first, last in groups_of(step == 0.0):
            at_end = last == step.size
            jump = float(step[last]) if not at_end else np.inf if first and not coarse[last] else 0.0
            if last - first >= IN_A_ROW and jump > max(usual, 1.5 * coarse[last]):
                found[rows[first + 1 : last + 1]] = True
                begin, end = run.time[rows[[first, last]]]
                lines.append(
                    f"{'xy'[k]} is frozen for {end - begin:.3g} s, {begin - run.time[0]:.3g} s from the "
                    "start: the position is not used there"
                )
    return found, lines


def without_frozen(run: Run) -> Run:
    """A run without the values of channels beside the pose that are frozen, with a line on each stretch.

    A channel is constant for much longer than it is elsewhere, by rounding or by its own rate, and the
    position or the heading changes by more than between two samples. That a steady speed is left out
    there as well costs little.

    Args:
        run: its rows in order.
    """
    measured, notes = dict(run.measured), list(run.notes)
    for name, values in run.measured.items():
        values = np.array(values)
        for rows in _constant(values):
            if not _moves(run.pose[rows]):
                continue
            begin, end = run.time[rows[[0, -1]]]
            values[rows[1:]] = np.nan
            notes.append(
                f"{name} is constant for {end - begin:.3g} s, {begin - run.time[0]:.3g} s from the "
                "start, while the ship moves: it is not used there"
            )
        measured[name] = values
    return replace(run, measured=measured, notes=tuple(notes)) if len(notes) > len(run.notes) else run


def _constant(values: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of each stretch of values (n,) that repeat for much longer than the others do."""
    there = np.isfinite(values)
    rows = np.flatnonzero(there)
    new = np.flatnonzero(~repeated(values[:, None], there)[rows])
    lengths = np.diff(np.append(new, rows.size))
    if not lengths.size:
        return
    usual = np.sort(lengths)[: max(int((1.0 - CHANCE) * lengths.size), 1)].max()
    for first, length in zip(new.tolist(), lengths.tolist(), strict=True):
        if length > LONG * max(usual, IN_A_ROW):
            yield rows[first : first + length]


def _moves(pose: np.ndarray) -> bool:
    """Whether a pose (n, 3) changes by more than it does between two of its rows."""
    known = pose[np.isfinite(pose).all(axis=1)]
    if len(known) <= IN_A_ROW:
        return False
    known[:, 2] = np.unwrap(known[:, 2])
    return bool((np.ptp(known, axis=0) > LONG * np.abs(np.diff(known, axis=0)).max(axis=0)).any())


def goes_straight(run: Run, seen: np.ndarray, held: np.ndarray, least: float) -> np.ndarray:
    """Rows (n,) in which a heading repeats because the ship goes straight, in a log without noise.

    Its positions are then on a line to their last digit, which those of a receiver never are.

    Args:
        run: its rows in order.
        seen: (n,), rows with a new position.
        held: (n,), rows in which the heading repeats.
        least: length of a stretch of these rows from which on it is looked at [s].
    """
    found = np.zeros_like(held)
    for first, last in groups_of(held):
        rows = first + np.flatnonzero(seen[first:last])
        if run.time[last - 1] - run.time[first] < least or rows.size < IN_A_ROW:
            continue
        place = run.pose[rows, :2] - run.pose[rows, :2].mean(axis=0)
        along, across = np.ptp(place @ np.linalg.svd(place, full_matrices=False)[2].T, axis=0)
        digit = max(float(run.coarse[rows, :2].max()), DIGITS * along)
        found[first:last] = across <= 2.0 * digit < along / FEWEST
    return found

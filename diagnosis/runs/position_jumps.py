"""Jumps of the position: a part was cut out of the log, or a receiver began anew."""

from dataclasses import replace

import numpy as np

from fmus.scale import REFERENCE, Scale

from .files.reading import Run
from .frozen import repeated
from .run_constants import CHANCE, FAR, IN_A_ROW, LONG, WIDTH

Jump = tuple[int, complex]  # the row behind it, and its way to the north plus i times that to the east


def parted(run: Run, scale: Scale = REFERENCE) -> Run:
    """A run with a gap in its time where the position jumps and does not come back.

    The gap is as long as the ship needs for the jump at the highest speed that it has elsewhere.

    Args:
        run: its rows in order.
        scale: of the ship.
    """
    there = np.asarray(np.isfinite(run.pose[:, :2]).all(axis=1))
    rows = np.flatnonzero(there & ~repeated(run.pose[:, :2], there))
    if rows.size <= 2 * IN_A_ROW:
        return run
    time, place = run.time[rows], run.pose[rows, 0] + 1j * run.pose[rows, 1]
    speed = speeds(time, run.pose[rows, :2])
    highest = float(np.quantile(speed, 1.0 - IN_A_ROW * CHANCE))  # of all but one jump in a hundred rows
    if not highest > 0.0:
        return run
    time_of, notes = run.time.copy(), list(run.notes)
    shortest = LONG * WIDTH * scale.time
    for k, way in _lasting(_jumps(time, place, highest), time, place, shortest):
        row, gap = rows[k], max(abs(way) / highest, shortest)
        time_of[row:] += gap
        notes.append(
            f"the position jumps by {abs(way):.3g} m, {run.time[row] - run.time[0]:.4g} s from the "
            f"start: the run is parted there; if rows were cut out, about {gap:.3g} s of them"
        )
    return replace(run, time=time_of, notes=tuple(notes))


def speeds(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Speeds [m/s] from each row to that IN_A_ROW behind it; NaN where the time does not grow.

    Args:
        time: (n,) [s].
        position: (n, 2), north and east [m].
    """
    way = np.linalg.norm(position[IN_A_ROW:] - position[:-IN_A_ROW], axis=1)
    step = time[IN_A_ROW:] - time[:-IN_A_ROW]
    return way / np.where(step > 0.0, step, np.nan)


def _jumps(time: np.ndarray, place: np.ndarray, highest: float) -> list[Jump]:
    """Jumps between samples of a place (n,) [m] at times (n,) [s], beyond a highest speed [m/s].

    The lines through the samples before and behind are further apart than the ship goes meanwhile, and
    far more than the samples are from their lines.
    """
    found = []
    for k in np.flatnonzero(np.abs(np.diff(place)) > FAR * highest * np.diff(time)) + 1:
        sides = slice(k - IN_A_ROW, k), slice(k, k + IN_A_ROW)
        if not IN_A_ROW <= k <= time.size - IN_A_ROW or _is_stuck(place[sides[0]]):
            continue
        middle = 0.5 * (time[k - 1] + time[k])
        lines = [np.polyfit(time[side] - middle, place[side], 1) for side in sides]
        off = [
            np.abs(place[side] - np.polyval(line, time[side] - middle)).max()
            for side, line in zip(sides, lines, strict=True)
        ]
        way = lines[1][1] - lines[0][1]
        if abs(way) > max(highest * (time[k + IN_A_ROW - 1] - time[k - IN_A_ROW]), FAR * max(off)):
            found.append((int(k), complex(way)))
    return found


def _is_stuck(place: np.ndarray) -> bool:
    """Whether one coordinate alone of a place (n,) repeats: the jump behind is its own."""
    return any((np.diff(part) == 0.0).all() for part in (np.real(place), np.imag(place)))


def _lasting(jumps: list[Jump], time: np.ndarray, place: np.ndarray, brief: float) -> list[Jump]:
    """Jumps without those that the next one takes back, as of a receiver whose signal is reflected.

    Nor does one last that a single step takes back within a brief time [s], before it or behind, as of a
    tracker that lost the ship: such a step may be too small to be a jump by itself.
    """
    steps = np.diff(place, prepend=place[0])

    def alone(jump: Jump) -> bool:
        k, way = jump
        beside = np.abs(time - time[k]) < brief
        beside[k] = False
        return not (2.0 * np.abs(steps[beside] + way) < abs(way)).any()

    kept: list[Jump] = []
    for row, way in jumps:
        if kept and 2.0 * abs(kept[-1][1] + way) < abs(way):
            kept.pop()
        else:
            kept.append((row, way))
    return [jump for jump in kept if alone(jump)]

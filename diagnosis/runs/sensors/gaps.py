"""Jumps of the log's clock: between two samples the ship goes as far as it does in another time."""

import numpy as np

from ..cleaning import Z95
from ..files.telegrams import groups_of
from ..run_constants import EVERY, FAR, LONG
from ..thinning import MOST_ROWS
from .constants import LEAST
from .evidence import AGREED, ALIKE, FEWEST, LEAST_TURN, Evidence, spread_of
from .sensor_finding import SensorFinding

FAST = 3.0  # 1, times the log's step, or its inverse: what is less is a clock that runs fast (chosen)
AROUND = int(LONG)  # samples before and after, in which a spike returns, and whose speed counts


def gaps(e: Evidence) -> list[SensorFinding]:
    """Jumps of the clock, found by position and velocity: true time that passed, less the log's [s]."""
    if e.velocity is None:
        return []
    rows, time = e.rows, e.time[e.rows]
    place, psi, speed = e.run.pose[rows, :2], e.psi[rows], np.hypot(*e.velocity[rows].T)
    step, moved, said = np.diff(time), np.diff(place, axis=0), np.diff(e.gone[rows], axis=0)
    way = np.hypot(*moved.T)
    mean = 0.5 * (speed[1:] + speed[:-1])
    going = mean > 0.2 * float(np.median(speed))
    late = np.where(going, way / np.where(going, mean, 1.0) - step, 0.0)
    period = float(np.median(step))
    beyond = late * mean  # m; where a ship is slow, noise of the position is a long time
    noise = spread_of(beyond)
    aligned = (moved * said).sum(axis=1) > AGREED * way * np.hypot(*said.T)
    turned = np.diff(psi) - np.diff(e.turned[rows])
    least = FAR * spread_of(turned)
    # Position and heading jump together in time alone, however the ship went meanwhile. Of a time that
    # was not logged the speed is not known: there a clock is ahead only if the ship is where it was.
    silent = step > LONG * period
    missing = (late > FAST * step) & (aligned | (np.abs(turned) > max(least, LEAST_TURN))) & ~silent
    ahead = silent & (FAST * (late + step) < step) & (late + step < LONG * period)
    shortest = max(EVERY, 2.0 * period)
    jumps = (np.abs(beyond) > FAR * noise) & (np.abs(late) > shortest)
    jumps &= going & (missing | ahead)
    found = []
    for a, b in groups_of(jumps):
        before, after = max(0, a - AROUND), min(time.size - 1, b + AROUND)
        net = np.hypot(*(place[after] - place[before]))
        at = np.median(speed[before : a + 1]), np.median(speed[b : after + 1])
        u, arc = float(np.mean(at)), _arc(place[b] - place[a], psi[b] - psi[a])
        value = float(arc / u - (time[b] - time[a]))
        returns = value > 0.0 and net / u - (time[after] - time[before]) < 0.5 * value
        if abs(value) <= shortest or returns:  # a spike of the position
            continue
        reach = max(abs(value), 2.0 * period)
        near = (time > time[a] - reach) & (time < time[b] + reach)
        share = float(np.hypot((at[1] - at[0]) / 2.0, np.std(speed[near])) / u)
        share += 1.0 - float(np.exp(-0.5 * np.var(psi[near])))  # of a way that bends
        half = Z95 * float(np.hypot(noise / u, value * (share + LEAST)))
        low, high = value - half, value + half
        if value > 0.0:
            by_speed = value, max(low, 0.0), high
            likely = _elsewhere(e, speed, (a, b), value) or by_speed
            (value, low, high), other = sorted((likely, by_speed), key=lambda each: each[2] - each[1])
            if not (low <= other[0] <= high or other[1] <= value <= other[2]):  # one of them is wrong
                low, high = min(low, other[1]), max(high, other[2])
        start, end = float(time[a]), float(time[b])
        many = "are missing in" if value > 0.0 else "were never in"
        text = f"{abs(value):.3g} s {many} the log near {0.5 * (start + end):.1f} s"
        found.append(SensorFinding("time", "clock_gap", value, "s", (low, high), start, end, text))
    return found


def _arc(chord: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Length of an even bend with a chord (..., 2) [m], in which the heading turns (...) [rad]."""
    bent = np.where(np.abs(turn) < np.pi, np.sinc(turn / (2.0 * np.pi)), 1.0)
    return np.asarray(np.hypot(chord[..., 0], chord[..., 1]) / bent)


def _elsewhere(
    e: Evidence, speed: np.ndarray, jump: tuple[int, int], value: float
) -> tuple[float, float, float] | None:
    """Likeliest, shortest and longest time [s] that is missing, by how the ship goes elsewhere.

    A ship that winds goes less far than its speed says. A time is possible if windows of that length,
    which begin and end about as fast (k,) [m/s] and turn as much, would be taken as the jump between two
    rows is, whose way needs a value [s] at its speed. None: there are too few of these.
    """
    rows, time, (a, b) = e.rows, e.time[e.rows], jump
    ends = np.median(speed[max(0, a - AROUND) : a + 1]), np.median(speed[b : b + AROUND + 1])
    turn, step = float(e.psi[rows[b]] - e.psi[rows[a]]), float(time[b] - time[a])
    starts = np.arange(0, time.size, -(-time.size // MOST_ROWS))
    times = np.geomspace((value + step) / FAST, (value + step) * FAST)
    possible: list[tuple[float, float]] = []
    for seconds in times:
        last = np.searchsorted(time, time[starts] + seconds)
        inside = (last < time.size) & ((starts > a) | (last < b))
        i, j = starts[inside], last[inside]
        turned = e.psi[rows[j]] - e.psi[rows[i]]
        alike = np.abs(np.angle(np.exp(1j * (turned - turn)))) < max(LEAST_TURN, ALIKE * abs(turn))
        for k, end in zip((i, j), ends, strict=True):
            alike &= np.abs(speed[k] - end) < ALIKE * end
        i, j = i[alike], j[alike]
        if i.size < FEWEST:
            continue
        moved = e.run.pose[rows[j], :2] - e.run.pose[rows[i], :2]
        said = 2.0 * _arc(moved, turned[alike]) / (speed[i] + speed[j])
        if said.min() <= value + step <= said.max():
            possible.append((abs(float(np.median(said)) - value - step), float(seconds)))
    if len(possible) < 2:
        return None
    _, likeliest = min(possible)
    between = float(times[1] / times[0])
    shortest, longest = min(t for _, t in possible) / between, max(t for _, t in possible) * between
    return likeliest - step, shortest - step, longest - step

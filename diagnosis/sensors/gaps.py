"""Jumps of the log's clock: between two samples the ship goes as far as it does in another time."""

from typing import NamedTuple

import numpy as np

from .evidence import Evidence
from .sensor_finding import Z95, SensorFinding

FAR = 8.0  # robust standard deviations of how far steps differ from what the speed says (chosen)
SHORTEST = 0.5  # s; a shorter jump does no harm (chosen)
FAST = 3.0  # times the log's step: what is less is a clock that runs fast (chosen)
STAND = 0.75  # of the log's step that no motion fills, where the log jumps ahead (chosen)
LONG = 5.0  # sampling periods that the log's step has then; chosen
ALIGNED = 0.7  # cosine between the jump and the way that the velocity says (chosen)
AROUND = 5  # samples before and after, in which a spike returns, and whose speed counts (chosen)
SPEED = 0.01  # relative uncertainty of a speed that does not change (chosen)


class Gap(NamedTuple):
    """A jump of the clock.

    Attributes:
        start, end: the log's time before and after [s].
        missing: true time that passed, less the log's [s].
        std: its standard deviation.
    """

    start: float
    end: float
    missing: float
    std: float

    @property
    def finding(self) -> SensorFinding:
        """The same as a finding."""
        start, end, half = self.start, self.end, Z95 * self.std
        many = "are missing in" if self.missing > 0.0 else "were never in"
        text = f"{abs(self.missing):.3g} s {many} the log near {0.5 * (start + end):.1f} s"
        interval = self.missing - half, self.missing + half
        return SensorFinding(
            "time", "clock_gap", self.missing, "s", interval, self.start, self.end, text
        )


def gaps(e: Evidence) -> list[Gap]:
    """Jumps of the clock, found by position and velocity."""
    if e.velocity is None:
        return []
    rows, time = e.rows, e.time[e.rows]
    step, moved, said = (
        np.diff(time),
        np.diff(e.run.pose[rows, :2], axis=0),
        np.diff(e.gone[rows], axis=0),
    )
    speed = np.hypot(*e.velocity[rows].T)
    way = np.hypot(*moved.T)
    mean = 0.5 * (speed[1:] + speed[:-1])
    going = mean > 0.2 * float(np.median(speed))
    late = np.where(going, way / np.where(going, mean, 1.0) - step, 0.0)
    period = float(np.median(step))
    beyond = late * mean  # m; where a ship is slow, noise of the position is a long time
    noise = 1.4826 * float(np.median(np.abs(beyond - np.median(beyond))))
    aligned = (moved * said).sum(axis=1) > ALIGNED * way * np.hypot(*said.T)
    missing = (late > FAST * step) & aligned
    ahead = (late < -STAND * step) & (step > LONG * period)
    jumps = (np.abs(beyond) > FAR * noise) & (np.abs(late) > max(SHORTEST, 2.0 * period))
    jumps &= going & (missing | ahead)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], jumps, [0]]).astype(int)))
    found = []
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        before, after = max(0, a - AROUND), min(time.size - 1, b + AROUND)
        net = np.hypot(*(e.run.pose[rows[after], :2] - e.run.pose[rows[before], :2]))
        at = np.median(speed[before : a + 1]), np.median(speed[b : after + 1])
        u = float(np.mean(at))
        chord = np.hypot(*(e.run.pose[rows[b], :2] - e.run.pose[rows[a], :2]))
        half = 0.5 * abs(float(e.psi[rows[b]] - e.psi[rows[a]]))
        arc = chord * (half / np.sin(half) if 1e-6 < half < 1.5 else 1.0)
        value = float(arc / u - (time[b] - time[a]))
        if value > 0.0 and net / u - (time[after] - time[before]) < 0.5 * value:
            continue  # a spike of the position, which comes back
        reach = max(abs(value), 2.0 * period)
        near = (time > time[a] - reach) & (time < time[b] + reach)
        share = float(np.hypot((at[1] - at[0]) / 2.0, np.std(speed[near])) / u)
        share += 1.0 - float(np.exp(-0.5 * np.var(e.psi[rows[near]])))  # of a way that bends
        std = float(np.hypot(noise / u, value * (share + SPEED)))
        found.append(Gap(float(time[a]), float(time[b]), value, std))
    return found

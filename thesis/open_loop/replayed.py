"""A controller's learning in a replayed run: what was recovered, stored, blocked, and due to spikes."""

from dataclasses import dataclass

import numpy as np

from .playback import Played
from .run_source import COMMAND

WITHIN = 1.0  # s after a spike in which an observer's estimate still shows it, 7.1.1
INSTANCE = {**dict.fromkeys(COMMAND, "thrusters")}  # of what is not the controller's


@dataclass(frozen=True, eq=False)
class Replay:
    """A run replayed with a controller.

    Attributes:
        played: what the FMUs made of it.
        spikes: times of spikes, and of jumps at the end of a freeze or a gap [s].
        stored: times at which a sample was stored [s].
        blocked: (rows,), where the gate let nothing be learned.
    """

    played: Played
    spikes: np.ndarray
    stored: np.ndarray
    blocked: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """(rows,) [s]."""
        return self.played.log["time"]

    def near(self, times: np.ndarray) -> np.ndarray:
        """Which of the times [s] lie within a second after a spike."""
        k = np.searchsorted(self.spikes, times + 1e-9) - 1
        since = times - np.append(self.spikes, -np.inf)[k]
        return (k >= 0) & (since < WITHIN)

    @property
    def spike_share(self) -> dict[str, float]:
        """Shares within a second after a spike: of the time, the stored samples, and the updates by the
        store and by the present error; NaN where there are none."""
        near = self.near(self.time)
        found = {"time": float(near.mean()), "stored": float("nan")}
        if self.stored.size:
            found["stored"] = float(self.near(self.stored).mean())
        for name in ("by_store", "by_now"):
            rate = self.played.log.get(f"controller.{name}", np.zeros(near.size))
            total = float(rate.sum())
            found[name] = float(rate[near].sum()) / total if total > 0.0 else float("nan")
        return found

    @property
    def agreement(self) -> dict[str, float]:
        """Largest difference of each signal to what the run has of it."""
        found = {}
        for name, measured in self.played.source.compared.items():
            there = np.isfinite(measured)
            if there.any():
                found[name] = float(np.abs(self.signal(name) - measured)[there].max())
        return found

    def signal(self, name: str) -> np.ndarray:
        """A signal of controller or thrusters at the samples of the run."""
        return self.played.at_samples(f"{INSTANCE.get(name, 'controller')}.{name}")


def replayed(played: Played) -> Replay:
    """Learning in a played run.

    Raises:
        InputError: too little of the pose could be smoothed, by which spikes are found.
    """
    log, source = played.log, played.source
    track = source.track
    spikes = source.prepared.smoothed.spikes & track.valid
    gone = track.frozen | track.dropped
    after = np.flatnonzero(gone[:-1] & ~gone[1:]) + 1
    rows = np.union1d(np.flatnonzero(spikes), after).astype(int)
    newest = log.get("controller.stored_at", np.zeros(log["time"].size))
    stored = newest[1:][np.diff(newest) > 0.0]
    beta = log.get("controller.beta", np.ones(log["time"].size))
    return Replay(played, source.time[rows], stored, beta < 0.5)


def stretches(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and last row of each stretch where a mask holds."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(change[::2], change[1::2], strict=True)]

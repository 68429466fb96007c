"""What the diagnosis costs: time for four runs, memory for an hour at 100 Hz.

``python -m benchmarks.hidden_effects.cost FILE.csv...`` learns from measured runs in a process of
its own and prints seconds and megabytes.
"""

import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pandas as pd

from cosim import SimulationError
from diagnosis import Model, Run, clean, method, read, smooth, weak_windows
from diagnosis.progress import silent

from .manoeuvres import manoeuvres
from .simulated_runs import Hidden, sail

HIDDEN = Hidden({"delta_X_u": -1.0})
HOUR, RATE = 3600.0, 100.0
COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]


class Cost(NamedTuple):
    """Seconds for four runs, and megabytes at most for an hour at 100 Hz."""

    seconds: float
    megabytes: float


def measure(fmus: Path) -> Cost:
    """Make the runs, and let another process learn from them."""
    runs = [sail(m, HIDDEN, 4.0, k, fmus).measured for k, m in enumerate(manoeuvres(0))]
    with TemporaryDirectory() as folder:
        files = [_save(Path(folder) / f"{k}.csv", run) for k, run in enumerate(runs)]
        seconds, _ = _learned(files)
        _, megabytes = _learned([_save(Path(folder) / "hour.csv", hour(runs[2]))])
    return Cost(seconds, megabytes)


def hour(run: Run) -> Run:
    """A run of an hour at 100 Hz: there and back along the same measurement, again and again."""
    once = np.arange(run.time.size)
    there_and_back = np.concatenate([once, once[-2:0:-1]])
    time_100 = np.arange(round(HOUR * RATE)) / RATE
    place = np.mod(time_100 / np.median(np.diff(run.time)), there_and_back.size)
    rows = there_and_back[place.astype(int)]
    jitter = 1e-3 * np.random.default_rng(0).standard_normal((rows.size, 3))
    return Run("hour", time_100, run.pose[rows] + jitter, run.tau_cmd[rows])


def _save(path: Path, run: Run) -> Path:
    """A run as the CSV file that a laboratory would have."""
    columns = np.column_stack([run.time, run.pose, run.tau_cmd])
    pd.DataFrame(columns, columns=COLUMNS).to_csv(path, index=False)
    return path


def _learned(files: Sequence[Path]) -> tuple[float, float]:
    """Seconds and megabytes that another process takes."""
    command = [sys.executable, "-m", __name__, *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SimulationError(f"cannot learn from the runs: {done.stderr.strip()[-300:]}")
    seconds, megabytes = map(float, done.stdout.split())
    return seconds, megabytes


def main() -> None:
    begun = time.perf_counter()
    data = [weak_windows(smooth(clean(read(path)))) for path in sys.argv[1:]]
    method().fit(data, Model(), 0.1, silent, 0)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(time.perf_counter() - begun, peak)


if __name__ == "__main__":
    main()

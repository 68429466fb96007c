"""Commands that are measured: samples of what the actuators do, and not orders that are held."""

import numpy as np


def row_means(values: np.ndarray, time: np.ndarray, angle: bool = False) -> np.ndarray:
    """Samples (n,) at times (n,) [s] as their means from each row to the next; the last one stays.

    Between two rows they are on a straight line. An angle [rad] takes the shorter way.
    """
    order = np.argsort(time, kind="stable")
    steps = np.diff(values[order], append=np.nan)
    if angle:
        steps = np.arctan2(np.sin(steps), np.cos(steps))
    means = values.copy()
    means[order] += 0.5 * np.where(np.isfinite(steps), steps, 0.0)
    return means

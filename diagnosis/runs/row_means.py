"""Commands that are measured: samples of what the actuators do, and not orders that are held."""

import numpy as np

from fmus.ops import wrap


def row_means(
    values: np.ndarray, time: np.ndarray, angle: bool = False, sampled: np.ndarray | None = None
) -> np.ndarray:
    """Samples (n,) at times (n,) [s] as their means from each row to the next; the last one stays.

    Args:
        values: of which a missing one is NaN, and changes no other. Between two they are on a line.
        time: in any order.
        angle: whether they are angles [rad], which take the shorter way.
        sampled: (n,), whether a row has a sample, and does not repeat one; None: each has.
    """
    order = np.argsort(time, kind="stable")
    own = order if sampled is None else order[sampled[order]]
    steps = np.diff(values[own], append=np.nan)
    if angle:
        steps = wrap(steps)
    width = np.diff(time[own], append=np.inf)
    slope = np.where(np.isfinite(steps) & (width > 0.0), steps, 0.0) / np.where(width > 0.0, width, 1.0)
    at = np.searchsorted(time[own], time[order], side="right") - 1
    middle = 0.5 * (time[order] + np.append(time[order][1:], time[order][-1]))
    means = values.copy()
    means[order] += np.nan_to_num(slope[at] * (middle - time[own][at]))  # a row may have no time
    return means

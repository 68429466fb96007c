"""Whether commands are measured values of the actuators: runs read so are predicted better, or not.

A log may have orders, which act from their row to the next, or samples of what the actuators do, whose
mean acts. Both are usual, and they are half a row apart. Predictions of the data that decide have errors
e of position (two components) and heading in n windows and, with a normal distribution of unknown
standard deviation, the likelihood

    2 log L = -n (2 log mean e_position^2 + log mean e_heading^2).

Accelerations do not show it: a controller commands what its ship has just done, so that earlier commands
seem to explain them better. What the model lacks may do the same: half a row looks like too little drag.
Such a model is better still with commands of a whole row later. Commands are measured values only if
their means predict better than that, too.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fmus.ship import ship

from ..predictors import WeakWindows
from ..runs.cleaning import Track
from ..runs.columns.columns import TAU, log_of
from ..runs.files.reading import row_means
from ..runs.run_constants import NEGLIGIBLE
from ..search.significance import Losses


def with_measured_commands(w: WeakWindows, rows: float = 0.5) -> WeakWindows:
    """The windows of a run whose commands are measured values, but for those of which more is stated.

    The commands of a log of this project are orders.

    Args:
        w: windows in which commands are orders.
        rows: from how many rows later commands are taken, 1; half a row for means between samples.
    """
    run, of = w.run, ship(description=w.run.ship)
    if run.layout == log_of(of.commands):
        return w
    units = dict.fromkeys(TAU, "N") if run.commands is None else of.form_of(run.commands)
    means = run.given.copy()
    names, logged = [], _logged(w.smoothed.track, means)
    for k, (name, unit) in enumerate(units.items()):
        column = run.layout.column(name)
        if column.measured is None and not column.late and np.ptp(means[:, k]) > 0.0:
            mean = row_means(means[:, k], run.time, unit == "rad", logged)
            means[:, k] += 2.0 * rows * (mean - means[:, k])
            names.append(name)
    if not names:
        return w
    note = f"read as measured values, not as orders: {', '.join(names)}"
    other = w.commanded_as(run.with_given(means))
    track = other.smoothed.track
    track = replace(track, notes=(*track.notes, note))
    return replace(other, smoothed=replace(other.smoothed, track=track))


def _logged(track: Track, commands: np.ndarray) -> np.ndarray:
    """(n,), rows with commands (n, k) of their own: rows between two that are filled in have none."""
    new = np.any(np.diff(commands, axis=0, prepend=np.nan) != 0.0, axis=1)
    return new | ~track.between


def log_odds(orders: Losses, measured: Losses) -> float:
    """Logarithm of the odds that commands are measured values, and not orders, by paired losses."""
    total = 0.0
    for a, b, components in zip(orders[1:], measured[1:], (2.0, 1.0), strict=True):
        known = np.isfinite(a) & np.isfinite(b)
        if known.any():
            total += 0.5 * components * known.sum() * float(np.log(a[known].mean() / b[known].mean()))
    return total


def are_measured(others: Sequence[Losses], measured: Sequence[Losses]) -> bool:
    """Whether commands are measured values, by losses of the initial and of the calibrated model.

    Coefficients may make up for half a row, and effects that are not known yet may look like it. So both
    models have to predict better, and one of them so that less than NEGLIGIBLE is left to orders.
    """
    initial, calibrated = map(log_odds, others, measured)
    return bool(min(initial, calibrated) > 0.0 and max(initial, calibrated) > -np.log(NEGLIGIBLE))

"""RMS of the model error in bins of the ship's motion, for the figures of the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..predictors import WeakWindows
from ..predictors.evaluation import Evaluation

BINS = 9  # chosen
MIN_WINDOWS = 5  # in a bin, below which it is left empty; chosen
BINNED_QUANTILES = (0.01, 0.99)  # of the data, between which the bins lie; chosen
MIN_WIDTH = 1e-6  # of all bins together, in the unit of the quantity, where the data are constant
HEADING_BINS = 8  # of 45 degrees; chosen


class Quantity(NamedTuple):
    """A quantity that the model error may depend on.

    Attributes:
        name: in captions.
        labels: with the unit, one for each axis of the ship.
        values: (K,) or (K, 3), one for each axis, mean over each window of the weak form.
        edges: of the bins; None: between the quantiles of the data.
    """

    name: str
    labels: tuple[str, str, str]
    values: Callable[[WeakWindows], np.ndarray]
    edges: np.ndarray | None = None


def window_mean(w: WeakWindows, values: np.ndarray) -> np.ndarray:
    """Weighted mean (K, ...) of a smooth signal (n, ...) over each window."""
    return w.smooth @ np.where(np.isfinite(values), values, 0.0)


def surge_speed(w: WeakWindows) -> np.ndarray:
    """(K,) [m/s]."""
    return window_mean(w, w.smoothed.nu[:, 0])


def yaw_rate(w: WeakWindows) -> np.ndarray:
    """(K,) [deg/s]."""
    return window_mean(w, np.degrees(w.smoothed.nu[:, 2]))


def heading(w: WeakWindows) -> np.ndarray:
    """(K,) [deg], 0 to 360."""
    psi = w.smoothed.eta[:, 2]
    return np.degrees(np.arctan2(window_mean(w, np.sin(psi)), window_mean(w, np.cos(psi)))) % 360.0


def same_label(label: str) -> tuple[str, str, str]:
    """One label for all three axes."""
    return label, label, label


QUANTITIES = (
    Quantity("surge speed", same_label("surge speed u [m/s]"), surge_speed),
    Quantity(
        "yaw rate",
        same_label("yaw rate r [°/s]"),
        yaw_rate,
    ),
    Quantity(
        "thruster level",
        ("commanded X [N]", "commanded Y [N]", "commanded N [N·m]"),
        lambda w: w.held @ w.run.tau_cmd,
    ),
    Quantity("heading", same_label("heading ψ [°]"), heading, np.linspace(0.0, 360.0, HEADING_BINS + 1)),
)


@dataclass(frozen=True, eq=False)
class BinnedError:
    """RMS of the model error of one axis in each bin.

    Attributes:
        edges: (b + 1,), in the unit of the quantity.
        before, after: (b,) [N or N m]; NaN where there are few windows.
        uncertainty: (b,), RMS of its standard deviation [N or N m]; None if not known.
    """

    edges: np.ndarray
    before: np.ndarray
    after: np.ndarray
    uncertainty: np.ndarray | None


def binned_errors(
    quantity: Quantity, evaluations: Sequence[Evaluation], omega_std: Sequence[np.ndarray] | None
) -> list[BinnedError]:
    """The model error of X, Y and N in bins of a quantity, all runs together.

    Args:
        quantity: whose bins.
        evaluations: one for each run.
        omega_std: standard deviation (K, 3) [N, N, N m] of each run's model error; None if not known.
    """
    values = np.concatenate([quantity.values(e.weak_windows) for e in evaluations])
    columns = np.broadcast_to(values.reshape(len(values), -1), (len(values), 3))
    before = np.concatenate([e.before.omega for e in evaluations])
    after = np.concatenate([e.after.omega for e in evaluations])
    std = None if omega_std is None else np.concatenate(list(omega_std))
    found = []
    for axis in range(3):
        edges = quantity.edges
        if edges is None:
            low, high = np.quantile(columns[:, axis], BINNED_QUANTILES)
            edges = np.linspace(low, max(high, low + MIN_WIDTH), BINS + 1)
        place = np.digitize(columns[:, axis], edges) - 1
        bins = edges.size - 1
        noise = None if std is None else _rms(place, std[:, axis], bins)
        first, last = (_rms(place, errors[:, axis], bins) for errors in (before, after))
        found.append(BinnedError(edges, first, last, noise))
    return found


def _rms(place: np.ndarray, values: np.ndarray, bins: int) -> np.ndarray:
    """(bins,): root mean square of the values in each bin, NaN with fewer than MIN_WINDOWS."""
    inside = (place >= 0) & (place < bins)
    count = np.bincount(place[inside], minlength=bins)
    total = np.bincount(place[inside], values[inside] ** 2, minlength=bins)
    return np.sqrt(np.where(count >= MIN_WINDOWS, total / np.maximum(count, 1), np.nan))

"""Where a model fails: its error over what the ship was doing."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..evidence import Evidence
from ..weak import Integrals

BINS = 9
FEWEST = 5  # windows in a bin, below which nothing is said
COMMON = (0.01, 0.99)  # quantiles between which bins lie


class Quantity(NamedTuple):
    """What the error may depend on.

    Attributes:
        name: for people.
        labels: with the unit, one for each axis of the ship.
        values: (K,) or (K, 3), one for each axis, averaged over each window of the weak form.
        edges: of the bins; None: between the quantiles of the data.
    """

    name: str
    labels: tuple[str, str, str]
    values: Callable[[Integrals], np.ndarray]
    edges: np.ndarray | None = None


def mean(w: Integrals, values: np.ndarray) -> np.ndarray:
    """Weighted mean (K, ...) of a smooth signal (n, ...) over each window."""
    return w.smooth @ np.where(np.isfinite(values), values, 0.0)


def heading(w: Integrals) -> np.ndarray:
    """(K,) [deg], 0 to 360."""
    psi = w.smoothed.eta[:, 2]
    return np.degrees(np.arctan2(mean(w, np.sin(psi)), mean(w, np.cos(psi)))) % 360.0


def alike(label: str) -> tuple[str, str, str]:
    return label, label, label


QUANTITIES = (
    Quantity("surge speed", alike("surge speed u [m/s]"), lambda w: mean(w, w.smoothed.nu[:, 0])),
    Quantity("yaw rate", alike("yaw rate r [°/s]"), lambda w: mean(w, np.degrees(w.smoothed.nu[:, 2]))),
    Quantity(
        "thruster level",
        ("commanded X [N]", "commanded Y [N]", "commanded N [N·m]"),
        lambda w: w.held @ w.run.tau_cmd,
    ),
    Quantity("heading", alike("heading ψ [°]"), heading, np.linspace(0.0, 360.0, 9)),
)


@dataclass(frozen=True, eq=False)
class Region:
    """RMS model error of one axis, bin by bin.

    Attributes:
        edges: (b + 1,), in the unit of the quantity.
        before, after: (b,) [N or N m]; NaN where there are few windows.
        unsure: (b,), RMS of its uncertainty; None if not known.
    """

    edges: np.ndarray
    before: np.ndarray
    after: np.ndarray
    unsure: np.ndarray | None


def regions(
    quantity: Quantity, evidence: Sequence[Evidence], omega_std: Sequence[np.ndarray] | None
) -> list[Region]:
    """The model error of each axis over a quantity, all runs together.

    Args:
        quantity: what it is sorted by.
        evidence: of the runs.
        omega_std: standard deviation (K, 3) [N, N, N m] of each run's omega; None if not known.
    """
    values = np.concatenate([quantity.values(e.integrals) for e in evidence])
    columns = np.broadcast_to(values.reshape(len(values), -1), (len(values), 3))
    before = np.concatenate([e.before.omega for e in evidence])
    after = np.concatenate([e.after.omega for e in evidence])
    unsure = None if omega_std is None else np.concatenate(list(omega_std))
    found = []
    for axis in range(3):
        edges = quantity.edges
        if edges is None:
            low, high = np.quantile(columns[:, axis], COMMON)
            edges = np.linspace(low, max(high, low + 1e-6), BINS + 1)
        place = np.digitize(columns[:, axis], edges) - 1

        bins = edges.size - 1
        noise = None if unsure is None else _rms(place, unsure[:, axis], bins)
        first, last = (_rms(place, errors[:, axis], bins) for errors in (before, after))
        found.append(Region(edges, first, last, noise))
    return found


def _rms(place: np.ndarray, values: np.ndarray, bins: int) -> np.ndarray:
    """(bins,): root mean square of the values in each bin, NaN where there are few."""
    inside = (place >= 0) & (place < bins)
    count = np.bincount(place[inside], minlength=bins)
    total = np.bincount(place[inside], values[inside] ** 2, minlength=bins)
    return np.sqrt(np.where(count >= FEWEST, total / np.maximum(count, 1), np.nan))

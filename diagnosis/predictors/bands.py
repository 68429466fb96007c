"""How far to trust a prediction: bands about predicted positions and headings."""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from .windows import Windows

LEVELS = (0.5, 0.9)
POINTS = 41  # of an ellipse that is drawn; chosen


def quantile(level: float, dof: int) -> float:
    """Quantile of the chi-squared distribution; `scipy.stats` takes a while to import."""
    return 2.0 * float(gammaincinv(0.5 * dof, level))


@dataclass(frozen=True, eq=False)
class Bands:
    """The covariance of predictions in the windows of a run.

    Attributes:
        windows: of the run.
        since: (T,), time from a window's start [s], zero included.
        predicted: (w, T, 3), pose [m, m, rad].
        covariance: (w, T, 3, 3), of measured minus predicted pose.
    """

    windows: Windows
    since: np.ndarray
    predicted: np.ndarray
    covariance: np.ndarray

    @property
    def at_samples(self) -> np.ndarray:
        """(samples, 3, 3), covariance at each sample that is used, see :class:`Windows`."""
        place = self.windows.since / (self.since[1] - self.since[0])
        k = np.clip(np.floor(place).astype(int), 0, self.since.size - 2)
        share = (place - k)[:, None, None]
        window = self.windows.sample_window
        return (1.0 - share) * self.covariance[window, k] + share * self.covariance[window, k + 1]

    def inside(self, residuals: np.ndarray, level: float) -> np.ndarray:
        """(samples, 2), whether position and heading lie within a band.

        Args:
            residuals: (samples, 3), measured minus predicted pose, see :meth:`Windows.residuals`.
            level: probability of the band: of an ellipse about the position, an interval of heading.
        """
        V = self.at_samples
        place = residuals[:, :2, None]
        squares = np.swapaxes(place, 1, 2) @ np.linalg.solve(V[:, :2, :2], place)
        position = squares[:, 0, 0] <= quantile(level, 2)
        heading = residuals[:, 2] ** 2 <= quantile(level, 1) * V[:, 2, 2]
        return np.column_stack([position, heading])

    def ellipses(self, window: int, level: float) -> np.ndarray:
        """(T, POINTS, 2), closed lines about the predicted positions of a window [m]."""
        around = np.linspace(0.0, 2.0 * np.pi, POINTS)
        circle = np.sqrt(quantile(level, 2)) * np.column_stack([np.cos(around), np.sin(around)])
        factor = np.linalg.cholesky(self.covariance[window, :, :2, :2])
        return self.predicted[window, :, None, :2] + circle @ np.swapaxes(factor, -1, -2)

    def headings(self, window: int, level: float) -> np.ndarray:
        """(2, T), lower and upper end of the band about the predicted heading of a window [rad]."""
        reach = np.sqrt(quantile(level, 1) * self.covariance[window, :, 2, 2])
        return np.stack([-reach, reach]) + self.predicted[window, :, 2]

    def coverage(self, residuals: np.ndarray, level: float = LEVELS[1]) -> float:
        """Share of the samples, positions and headings alike, within a band; arguments as above."""
        return float(np.mean(self.inside(residuals, level)))

"""Velocity and yaw rate that were measured beside the pose, as derivatives of its channels."""

from collections.abc import Mapping

import numpy as np

from ..cleaning import Track, noise
from ..sensors.evidence import VELOCITIES, velocity_over_ground
from .penalised import Rates
from .spline import Knots, basis

# Channel -> standard deviation of what it says over a sampling period, in SI.
Agreeing = Mapping[str, float]
ALONE: Agreeing = {}


def measured_rates(
    track: Track, rows: np.ndarray, psi: np.ndarray, agreeing: Agreeing, grid: Knots
) -> tuple[np.ndarray, Rates] | None:
    """Measured derivatives at samples of the pose.

    Args:
        track: the run.
        rows: of the samples of the pose.
        psi: (n,), heading [rad].
        agreeing: channels that count, with their noise; no noise is less than that of third differences.
        grid: knots of the spline.

    Returns:
        The rows that have them all, and the derivatives; None: there are none.
    """
    run = track.run
    by = next((pair for pair in VELOCITIES if pair[0] in agreeing), None)
    names = [*(by or ()), *(["r"] if "r" in agreeing else [])]
    if not names:
        return None
    at = rows[np.all([np.isfinite(run.measured[name][rows]) for name in names], axis=0)]
    if not at.size:
        return None
    z, sigma = np.zeros((at.size, 3)), np.full(3, np.inf)
    if by is not None:
        z[:, :2] = velocity_over_ground(run.rows(at), by, psi[at])
        sigma[:2] = max(agreeing[by[0]], run.noise.get(by[0], 0.0))
    if "r" in agreeing:
        z[:, 2] = run.measured["r"][at]
        sigma[2] = max(agreeing["r"], run.noise.get("r", 0.0))
    sigma = np.maximum(sigma, noise(z))
    return at, Rates(z, basis(grid, run.time[at] - run.time[0], 1), sigma)

"""The covariance of predictions: by posterior, initial state, unrecorded force and noise."""

import numpy as np

from ...predictors import Model
from ...predictors.evaluation import Bands
from ...predictors.shooting import Shooting
from ...predictors.windows import Windows
from ...runs import Smoothed
from ..candidates import SMALL
from .disturbance import ForceDisturbance, covariance
from .joint_posterior import JointPosterior


def prediction_bands(
    smoothed: Smoothed,
    windows: Windows | None,
    model: Model,
    posterior: JointPosterior,
    push: ForceDisturbance,
) -> Bands | None:
    """The bands about a model's predictions in the windows of a run; None: it has none.

    Args:
        smoothed, windows: the run.
        model, posterior: that predicts, and of its fitted values.
        push: the unrecorded force.
    """
    if windows is None:
        return None
    shots = Shooting([smoothed], windows.length)
    std = posterior.std
    around = shots.around(model, {n: SMALL * s for n, s in std.items() if s > 0.0})
    kept = [k for k, s in enumerate(std.values()) if s > 0.0]
    C = posterior.covariance[np.ix_(kept, kept)]
    later = covariance(around.motion, shots.at_start, push)
    first = smoothed.eta[shots.starts.runs[0][1]]
    predicted = np.concatenate([first[:, None], shots.measured - around.residuals], axis=1)
    instants = np.arange(shots.since.size)
    found = np.zeros((len(later), shots.since.size + 1, 3, 3))
    found[:, 1:] = later[:, instants, :, instants].swapaxes(0, 1)
    found[:, 1:] += around.slopes @ C @ np.swapaxes(around.slopes, -1, -2)
    found[:, 0, range(3), range(3)] = shots.at_start[:, :3]
    found[..., range(3), range(3)] += smoothed.noise**2
    return Bands(windows, np.concatenate([[0.0], shots.since]), predicted, found)

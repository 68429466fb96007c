"""A ship that keeps its velocity."""

import numpy as np

from ..entry_predictor import OfLaw, Training
from ..same_windows import Continuous

STEP = 0.05  # s; chosen, ten steps in half a second


def no_acceleration(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
    """(w, 3), zero."""
    return np.zeros_like(nu)


def fit(train: Training) -> OfLaw:
    """Nothing is learned."""
    return OfLaw(Continuous(no_acceleration, STEP * train.model.ship.scale.time))

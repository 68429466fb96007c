"""Ridge regression of the acceleration that the nominal model lacks."""

from collections.abc import Sequence

import numpy as np

from diagnosis import Smoothed

from ..chosen_settings import searched
from ..same_windows import DELAYS, Continuous, Nominal, stacked
from .kalman_regression import regressors

STEP = 0.2  # s
SETTINGS = {
    "inputs": ("forces", "commands"),
    "delay": DELAYS,
    "terms": ("linear", "quadratic"),
    "weight": (1.0, 30.0, 1000.0),  # of the squared factors of standardised terms, in samples
}


def law(
    runs: Sequence[Smoothed], nominal: Nominal, inputs: str, delay: float, terms: str, weight: float
) -> Continuous:
    """The nominal model and a linear model of its error.

    Args:
        runs: to learn from.
        nominal: the model, which also gives the forces of commands.
        inputs: forces or commands.
        delay: of the commands [s].
        terms: of the linear model.
        weight: of the squared factors.
    """
    nu, nu_dot, given = stacked(runs, STEP, delay)
    x = regressors(terms, nu, nominal.inputs(inputs, nu, given))
    size = np.sqrt(np.mean(x**2, axis=0)) + np.finfo(float).tiny
    x = x / size
    left = nu_dot - nominal.acceleration(nu, given)
    factors = np.linalg.solve(x.T @ x + weight * np.eye(x.shape[1]), x.T @ left) / size[:, None]

    def acceleration(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        known = nominal.acceleration(nu, given)
        return known + regressors(terms, nu, nominal.inputs(inputs, nu, given)) @ factors

    return Continuous(acceleration, STEP, delay)


fit = searched("ridge", law, SETTINGS)

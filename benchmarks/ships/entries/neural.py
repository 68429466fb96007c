"""A neural network of what the nominal model's acceleration lacks (scikit-learn)."""

from collections.abc import Sequence

import numpy as np
from sklearn.compose import TransformedTargetRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from diagnosis import Smoothed

from ..chosen_settings import SEED, searched
from ..same_windows import DELAYS, Continuous, Nominal, stacked

STEP = 0.2  # s
SETTINGS = {
    "inputs": ("forces", "commands"),
    "delay": DELAYS,
    "hidden": ((16,), (32, 32)),
    "alpha": (1e-2, 10.0),
}


def law(
    runs: Sequence[Smoothed],
    nominal: Nominal,
    inputs: str,
    delay: float,
    hidden: tuple[int, ...],
    alpha: float,
) -> Continuous:
    """The nominal model and a network beside it.

    Args:
        runs: to learn from.
        nominal: the model, which also tells the forces of commands.
        inputs: forces or commands.
        delay: of the commands [s].
        hidden: units of each layer.
        alpha: weight of the squared weights.
    """
    nu, nu_dot, given = stacked(runs, STEP, delay)
    network = TransformedTargetRegressor(
        make_pipeline(
            StandardScaler(),
            MLPRegressor(hidden_layer_sizes=hidden, alpha=alpha, early_stopping=True, random_state=SEED),
        ),
        transformer=StandardScaler(),
    )
    network.fit(
        np.hstack([nu, nominal.inputs(inputs, nu, given)]), nu_dot - nominal.acceleration(nu, given)
    )

    def acceleration(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        features = np.hstack([nu, nominal.inputs(inputs, nu, given)])
        return nominal.acceleration(nu, given) + network.predict(np.clip(features, -1e6, 1e6))

    return Continuous(acceleration, STEP, delay)


fit = searched("neural", law, SETTINGS)

"""Sparse regression of accelerations on a library of functions (PySINDy)."""

from collections.abc import Sequence

import numpy as np
import pysindy

from diagnosis import Smoothed

from .same_windows import Continuous, Nominal, table

STEP = 0.2  # s
SETTINGS = {
    "inputs": ("forces", "commands"),
    "delay": (0.0, 0.4),
    "library": ("linear", "drag", "cubic"),
    "threshold": (0.0, 0.02, 0.1),
    "derivative": ("own", "smoothed differences"),
}
LIBRARIES = {
    "linear": lambda: pysindy.PolynomialLibrary(degree=1),
    "cubic": lambda: pysindy.PolynomialLibrary(degree=3),
    "drag": lambda: pysindy.ConcatLibrary(
        [
            pysindy.PolynomialLibrary(degree=2),
            pysindy.CustomLibrary([lambda x: np.abs(x) * x], [lambda x: f"|{x}|{x}"]),
        ]
    ),
}


def fit(
    runs: Sequence[Smoothed],
    nominal: Nominal,
    inputs: str,
    delay: float,
    library: str,
    threshold: float,
    derivative: str,
) -> Continuous:
    """A sparse law of acceleration.

    Args:
        runs: to learn from.
        nominal: tells the forces of commands.
        inputs: forces or commands.
        delay: of the commands [s].
        library: of the functions.
        threshold: below which a coefficient is left out.
        derivative: the smoother's accelerations, or smoothed differences of the velocities.
    """
    tables = [table(r, STEP, delay) for r in runs]
    parts = [(t, p) for t in tables for p in t.parts]
    own = derivative == "own"
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=threshold),
        feature_library=LIBRARIES[library](),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )
    model.fit(
        [t.nu[p] for t, p in parts],
        t=STEP,
        x_dot=[t.nu_dot[p] for t, p in parts] if own else None,
        u=[nominal.inputs(inputs, t.nu[p], t.given[p]) for t, p in parts],
    )

    def acceleration(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        u = nominal.inputs(inputs, nu, given)
        return np.asarray(model.predict(np.clip(nu, -1e3, 1e3), u=u))

    return Continuous(acceleration, STEP, delay)

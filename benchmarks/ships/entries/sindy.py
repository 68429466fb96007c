"""Sparse regression of accelerations on a library of functions (PySINDy)."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
import pysindy

from diagnosis import Smoothed

from ..chosen_settings import searched
from ..same_windows import DELAYS, Continuous, Nominal, table

STEP = 0.2  # s
FASTEST = 1e3  # m/s, rad/s; beyond it the prediction is lost
SETTINGS = {
    "inputs": ("forces", "commands"),
    "delay": DELAYS,
    "library": ("linear", "drag", "cubic"),
    "threshold": (0.0, 0.02, 0.1),
    "derivative": ("own", "smoothed differences"),
}
# Name -> degree of the polynomials, and whether |x|x of each variable stands beside them.
LIBRARIES = {"linear": (1, False), "drag": (2, True), "cubic": (3, False)}


@cache
def _factors(variables: int, degree: int) -> np.ndarray:
    """(degree, terms): numbers of the factors of each term from one on, 0 where it has fewer."""
    terms = [
        (*chosen, *[0] * (degree - k))
        for k in range(degree + 1)
        for chosen in combinations_with_replacement(range(1, variables + 1), k)
    ]
    return np.array(terms).T


def columns(library: str, x: np.ndarray) -> np.ndarray:
    """Functions of rows x, the same and in the same order as of PySINDy's libraries, in less time."""
    degree, drag = LIBRARIES[library]
    one = np.column_stack([np.ones(len(x)), x])
    polynomials = one[:, _factors(x.shape[1], degree)].prod(axis=1)
    return np.hstack([polynomials, np.abs(x) * x]) if drag else polynomials


def law(
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
    parts = [(t.nu[p], t.nu_dot[p], t.given[p]) for t in tables for p in t.parts]
    if derivative == "smoothed differences":  # of velocities smoothed once more, as in the package
        d = pysindy.SmoothedFiniteDifference()
        slopes = [(d(nu, t=STEP), d.smoothed_x_, given) for nu, _, given in parts]
        parts = [(nu, slope, given) for slope, nu, given in slopes]
    nu, nu_dot, given = map(np.vstack, zip(*parts, strict=True))
    optimizer = pysindy.STLSQ(threshold=threshold)
    optimizer.fit(columns(library, np.hstack([nu, nominal.inputs(inputs, nu, given)])), nu_dot)
    factors = optimizer.coef_.T

    def acceleration(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        nu = np.clip(nu, -FASTEST, FASTEST)
        return columns(library, np.hstack([nu, nominal.inputs(inputs, nu, given)])) @ factors

    return Continuous(acceleration, STEP, delay)


fit = searched("sindy", law, SETTINGS)

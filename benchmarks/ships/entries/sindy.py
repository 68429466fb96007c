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


def functions(library: str) -> pysindy.feature_library.base.BaseFeatureLibrary:
    """A library of PySINDy."""
    degree, drag = LIBRARIES[library]
    polynomials = pysindy.PolynomialLibrary(degree=degree)
    if not drag:
        return polynomials
    squares = pysindy.CustomLibrary([lambda x: np.abs(x) * x], [lambda x: f"|{x}|{x}"])
    return pysindy.ConcatLibrary([polynomials, squares])


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
    """What that library makes of rows x, in the same order and in less time."""
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
    parts = [(t, p) for t in tables for p in t.parts]
    own = derivative == "own"
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=threshold),
        feature_library=functions(library),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )
    model.fit(
        [t.nu[p] for t, p in parts],
        t=STEP,
        x_dot=[t.nu_dot[p] for t, p in parts] if own else None,
        u=[nominal.inputs(inputs, t.nu[p], t.given[p]) for t, p in parts],
    )
    factors = model.coefficients().T

    def acceleration(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        nu = np.clip(nu, -FASTEST, FASTEST)
        return columns(library, np.hstack([nu, nominal.inputs(inputs, nu, given)])) @ factors

    return Continuous(acceleration, STEP, delay)


fit = searched("sindy", law, SETTINGS)

"""How much acceleration the commands of a run give, by which units and clocks tell themselves.

On each axis the inertial force of the motion, a = M nu_dot + C nu in weak form, is regressed on the
commanded forces T, beside all that else may act on a hull: the model's damping and others of other sizes
(u, v, r, |nu| nu, u r, u v), a force of the surroundings and one that is constant,

    a_j = k_j T_j + sum_i g_i T_i + sum_i b_i x_i + remainder.

k is one for the model's inertia and thrusters in the right units, whatever the drag or the current. A
length in another unit multiplies it by that unit on the axes of force, a force divides it, and a clock
that runs s times too fast divides it by s^2 on all axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import pinv

from ..predictors import Model, WeakWindows
from ..predictors.prediction import FAR_OFF
from ..predictors.uncertainty import MEASURED, correlated_windows
from ..predictors.weak_form import OVERLAP, commanded_force, inertial, needed_force
from ..runs.run_constants import DIGITS
from ..runs.smoothing.command_regression import least_squares
from .settings import SETTINGS


@dataclass(frozen=True, eq=False)
class ThrustGains:
    """k of each axis; NaN where nothing varies.

    Attributes:
        value, error: (3,), k and its standard error.
        stated: (3,), whether the commands of that axis explain most of what all else leaves of its
            inertial force, and follow neither from those of another axis nor from the motion.
    """

    value: np.ndarray
    error: np.ndarray
    stated: np.ndarray

    @property
    def wrong(self) -> np.ndarray:
        """(3,), axes whose k no ship has; where all are less, it is a clock or a unit."""
        most, off = SETTINGS.most_gain, FAR_OFF * self.error
        low, high = self.value - off, self.value + off
        weak = (self.stated & (high < 1.0 / most))[np.isfinite(self.value)]
        return self.stated & ((low > most) | (high < SETTINGS.least_gain) | weak.all())

    @property
    def mean(self) -> float | None:
        """Geometric mean of the wrong axes, each as well as it is known; None if none is."""
        return self.mean_of(self.wrong)

    def mean_of(self, axes: np.ndarray) -> float | None:
        """The same of some axes (3,); None if none of them has a k above zero."""
        known = axes & (self.value > 0.0)
        if not known.any():
            return None
        weights = (self.value[known] / self.error[known]) ** 2
        return float(np.exp(np.average(np.log(self.value[known]), weights=weights)))


def gains(w: WeakWindows, model: Model) -> ThrustGains:
    """The acceleration that the commands of a run give, as shares of what they give by a model."""
    a, z, T = inertial(w, model), needed_force(w, model), w.held @ commanded_force(w, model)
    moves = T.std(axis=0) > DIGITS * np.abs(T).max()
    surroundings = other_forces(w, a, z)
    value, error = np.full((2, 3), np.nan)
    left, stated = np.zeros_like(a), np.zeros(3, bool)
    for j in np.flatnonzero(moves):
        others = [T[:, i] for i in np.flatnonzero(moves) if i != j]
        x = np.column_stack([T[:, j], *others, surroundings[j]])
        few = (
            len(a) < OVERLAP * x.shape[1]
        )  # of fewer independent windows than unknowns nothing is known
        if few or not np.isfinite(x).all() or _own(T[:, j], others) < MEASURED**2:
            continue
        size = np.maximum(np.linalg.norm(x, axis=0), np.finfo(float).tiny)
        inverse = pinv(x / size)
        beta = inverse @ a[:, j]
        left[:, j] = a[:, j] - x / size @ beta
        unexplained, own = left[:, j] @ left[:, j], 1.0 / (inverse[0] @ inverse[0])
        variance = unexplained / max(len(a) - len(beta), 1) / own
        value[j], error[j] = beta[0] / size[0], np.sqrt(variance) / size[0]
        # With less explained than all else leaves, it is not T that moves the ship; with less than a
        # model lacks that is not exact, T follows from the motion, as under feedback of the velocity.
        least = max(unexplained, MEASURED**2 * (a[:, j] @ a[:, j]))
        stated[j] = beta[0] ** 2 * own > least
    return ThrustGains(value, error * np.sqrt(correlated_windows([w], left)), stated)


def other_forces(w: WeakWindows, a: np.ndarray, z: np.ndarray) -> list[np.ndarray]:
    """What may act on a hull in addition to its thrusters, columns (K, m) for each axis.

    Args:
        w: windows of a run.
        a, z: (K, 3), inertial force and that which the motion needs.
    """
    u, v, r = nu = np.where(w.known, w.smoothed.nu.T, 0.0)
    found = []
    for j, constant in enumerate(constant_forces(w)):
        states = [*nu, np.abs(nu[j]) * nu[j], u * r, u * v]
        found.append(np.column_stack([(z - a)[:, j], constant, *(w.smooth @ s for s in states)]))
    return found


def constant_forces(w: WeakWindows) -> list[np.ndarray]:
    """Forces on surge, sway, yaw that are constant in the axes of ship or earth, columns (K, m)."""
    psi, one = w.smoothed.eta[:, 2], np.ones(len(w.middle))
    north, east = np.nan_to_num(np.cos(psi)), np.nan_to_num(np.sin(psi))
    earth = ([north, east], [-east, north], [])
    return [np.column_stack([one, *(w.smooth @ s for s in each)]) for each in earth]


def varying(w: WeakWindows, force: np.ndarray) -> np.ndarray:
    """RMS (3,) of a force (K, 3) beside one that is constant in the axes of ship or earth."""
    left = [f - x @ least_squares(x, f) for x, f in zip(constant_forces(w), force.T, strict=True)]
    return np.sqrt(np.mean(np.square(left), axis=1))


def _own(command: np.ndarray, others: Sequence[np.ndarray]) -> float:
    """Share of the variation of a command (K,) that follows from no other."""
    known = np.column_stack([*others, np.ones(command.size)])
    known = known / np.maximum(np.linalg.norm(known, axis=0), np.finfo(float).tiny)
    left = command - known @ (pinv(known) @ command)
    return float(np.mean(left**2) / np.var(command))

"""A model of the model error as a part of the plant, (7.15), corrected, and what it does to the thrust.

The model error (7.7) is relative to (2.27), which has no rotational damping: a plant that gets a model
of it as a whole loses that of Table 2.1, or it would count twice. With B_tau, the part that multiplies
the thrusters' force, the ship feels (I + B_tau) tau.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.predictors import Model
from diagnosis.report import number
from fmus.declare import variables
from fmus.effects.linear_map import REGRESSORS, parameter
from fmus.hull import RotationalDamping
from fmus.ship import Ship, ship

from .partial_least_squares import AXES, Regressed
from .samples import TAU

# Least share of a commanded force that has to act, in every direction of it (chosen: a twentieth).
EPSILON = 0.05


@dataclass(frozen=True)
class EffectiveThrust:
    """What a model makes of the thrusters' force.

    Attributes:
        eigenvalues: (3,), of I + B_tau; one whose real part is negative reverses the feedback.
        least: smallest eigenvalue of the symmetric part of I + B_tau.
    """

    eigenvalues: np.ndarray
    least: float

    @property
    def holds(self) -> bool:
        """Whether sym(I + B_tau) >= EPSILON I: the ship is pushed to the side that was asked for."""
        return self.least >= EPSILON

    @property
    def sentence(self) -> str:
        """What that means for a simulation."""
        real = ", ".join(number(float(x.real)) for x in sorted(self.eigenvalues, key=lambda x: x.real))
        if self.holds:
            return (
                f"Thrust: sym(I + B_τ) ≥ {number(self.least)} > {EPSILON}, eigenvalues of I + B_τ "
                f"{real}: every force acts in the commanded direction."
            )
        if min(x.real for x in self.eigenvalues) <= 0.0:
            return (
                f"Thrust: eigenvalues of I + B_τ {real}: one is not above zero, which reverses the "
                "feedback of a controller. Do not simulate this model in closed loop."
            )
        return (
            f"Thrust: sym(I + B_τ) ≥ {number(self.least)} only, below {EPSILON}; eigenvalues of I "
            f"+ B_τ {real}. Some force acts across or against its commanded direction: a closed "
            "loop may become unstable."
        )


def effective_thrust(B_tau: np.ndarray) -> EffectiveThrust:
    """The criterion for a matrix B_tau (3, 3)."""
    A = np.eye(3) + B_tau
    return EffectiveThrust(np.linalg.eigvals(A), float(np.linalg.eigvalsh(0.5 * (A + A.T)).min()))


def force_columns(B: np.ndarray, columns: Sequence[str]) -> np.ndarray:
    """B_tau (3, 3) of a map B (3, m); zero where the force is no column."""
    found = [B[:, columns.index(n)] if n in columns else np.zeros(3) for n in TAU]
    return np.column_stack(found)


def thrust_of(found: Regressed) -> EffectiveThrust:
    """What a regression makes of the thrusters' force."""
    return effective_thrust(force_columns(found.B, found.columns))


def regressor(column: str) -> str:
    """A column as the effect ``linear_map`` calls it: ``absu_v`` for ``|u|v``."""
    _, *parts = column.split("|")
    return f"abs{parts[0]}_{parts[1]}" if parts else column


def goes_into_the_plant(columns: Sequence[str]) -> bool:
    """Whether the effect ``linear_map`` has all of these columns."""
    return all(regressor(c) in REGRESSORS for c in columns)


def as_model(c: np.ndarray, B: np.ndarray, columns: Sequence[str], of: Ship | None = None) -> Model:
    """A ship whose model error, (7.7), is c + B x.

    Args:
        c: (3,) [N, N, N m].
        B: (3, m).
        columns: names of the m columns.
        of: the ship, by :func:`~thesis.analysis.samples.model_error`; None: CyberShip Enterprise 1.
    """
    of = of or ship()
    values = (
        {f"delta_{v.name}": -v.start for v in variables(RotationalDamping) if v.start}
        if of.name == ship().name
        else {}
    )
    for k, axis in enumerate(AXES):
        values[parameter(axis, "1")] = float(c[k])
        for column, x in zip(columns, B[k], strict=True):
            values[parameter(axis, regressor(column))] = float(x)
    return Model(ship=of).plus(values)

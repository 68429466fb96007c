"""Polynomial NARX models by forward regression with orthogonal least squares (sysidentpy).

One model for each velocity, the other two and the inputs exogenous, as the package has one output each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

from diagnosis import Smoothed

from ..chosen_settings import searched
from ..same_windows import Nominal, table

SETTINGS = {
    "inputs": ("forces", "commands"),
    "h": (0.2, 0.5),
    "lags": (1, 2),
    "degree": (1, 2),
}
TERMS = 20  # most that the information criterion chooses from


class OfParts(FROLS):
    """Forward regression without the rows whose lags reach into another stretch, run once for all sizes.

    ``broken`` (rows,) says which rows these are. Forward regression adds one term after another, so that
    a model of fewer terms begins the one of ``TERMS``; the package begins anew for each size.
    """

    broken: np.ndarray
    _found: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None = None

    def run_mss_algorithm(self, psi: Any, y: Any, process_term_number: int) -> Any:
        if self._found is None:
            kept = ~self.broken[self.max_lag :]
            y = np.concatenate([y[: self.max_lag], y[self.max_lag :][kept]])
            most = min(TERMS, psi.shape[1])
            self._found = *super().run_mss_algorithm(psi[kept], y, most), y[self.max_lag :]
        err, terms, chosen, target = self._found
        return err, terms[:process_term_number], chosen[:, :process_term_number], target


@dataclass(frozen=True)
class Narx:
    """Law in discrete time: for each velocity codes (terms, degree) of regressors, and factors."""

    models: Sequence[tuple[np.ndarray, np.ndarray]]
    nominal: Nominal
    inputs: str
    h: float
    lags: int
    delay: float = 0.0

    def step(self, nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        """As of :class:`.same_windows.Law`."""
        channels = [
            np.hstack([x, self.nominal.inputs(self.inputs, x, c)])
            for x, c in zip(nu, given, strict=True)
        ]
        found = []
        for axis, (codes, theta) in enumerate(self.models):
            order = [axis, *(k for k in range(channels[0].shape[1]) if k != axis)]
            values = np.zeros(len(nu[0]))
            for term, factor in zip(codes, theta, strict=True):
                product = np.full(values.shape, factor)
                for code in term[term > 0]:  # thousand times the channel, one the output, plus the lag
                    product = product * channels[-(code % 1000)][:, order[code // 1000 - 1]]
                values += product
            found.append(values)
        return np.column_stack(found)


def law(
    runs: Sequence[Smoothed], nominal: Nominal, inputs: str, h: float, lags: int, degree: int
) -> Narx:
    """Models of the next velocity from the last ones and the last inputs.

    Args:
        runs: to learn from.
        nominal: tells the forces of commands.
        inputs: forces or commands.
        h: step [s].
        lags: steps that are looked back.
        degree: of the polynomials.
    """
    parts, broken = [], []
    for t in (table(r, h) for r in runs):
        for p in t.parts:
            parts.append(np.hstack([t.nu[p], nominal.inputs(inputs, t.nu[p], t.given[p])]))
            broken.append(np.arange(len(parts[-1])) < lags)
    rows = np.vstack(parts)
    models = []
    for axis in range(3):
        others = np.delete(rows, axis, axis=1)
        model = OfParts(
            order_selection=True,
            n_info_values=TERMS,
            info_criteria="bic",
            ylag=lags,
            xlag=[list(range(1, lags + 1))] * others.shape[1],
            estimator=LeastSquares(),
            basis_function=Polynomial(degree=degree),
        )
        model.broken = np.concatenate(broken)
        model.fit(X=others, y=rows[:, [axis]])
        models.append((np.asarray(model.final_model), np.asarray(model.theta).ravel()))
    return Narx(models, nominal, inputs, h, lags)


fit = searched("narx", law, SETTINGS)

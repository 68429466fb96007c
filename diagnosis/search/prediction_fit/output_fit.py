"""Coefficients of actuators fitted to what is measured of them beside their commands."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.optimize import least_squares

from cosim import InputError
from cosim.errors import nearest

from ...predictors import Model, WeakWindows
from ...predictors.measured_outputs import named, residual
from ...predictors.weak_form import OVERLAP
from ..prior import NominalPrior, Prior


def fitted(runs: Sequence[WeakWindows], model: Model, prior: Prior, names: Iterable[str]) -> Model:
    """The model with the coefficients of actuators fitted to what is measured of them.

    Least squares of averages over the windows of the weak form, of which :data:`OVERLAP` count as one,
    and of the departure from the prior.

    Args:
        runs: to learn from.
        model: the initial one.
        prior: of the nominal coefficients.
        names: of the outputs, ``ACTUATOR.OUTPUT``.

    Raises:
        InputError: no run has such a measurement, or no law gives it.
    """
    for name in names:
        having = [w for w in runs if name in named(w, model)]
        if not having:
            known = sorted({n for w in runs for n in named(w, model)})
            raise InputError(f"no run has the measured output '{name}'{nearest(name, known)}")
        model = _fitted(having, model, NominalPrior.of(model, prior), name)
    return model


def _fitted(having: Sequence[WeakWindows], start: Model, belief: NominalPrior, name: str) -> Model:
    """The model with one actuator's coefficients fitted to one measured output of it."""
    stem = f"plant_{name.partition('.')[0]}_"
    of = [n for n, std in belief.std.items() if n.startswith(stem) and std > 0.0]
    if not of:
        return start
    std = np.array([belief.std[n] for n in of])

    def at(offset: np.ndarray) -> Model:
        return start.plus(dict(zip(of, (offset * std).tolist(), strict=True)))

    def left(offset: np.ndarray) -> np.ndarray:
        parts = [w.smooth @ np.nan_to_num(residual(w, at(offset), name)) for w in having]
        return np.concatenate(parts)

    offset = np.zeros(len(of))
    for _ in range(2):  # the second is weighted by what the first leaves
        size = float(np.std(left(offset))) * np.sqrt(OVERLAP)
        if size > 0.0:
            weighted = lambda x, size=size: np.append(left(x) / size, x)  # noqa: E731
            offset = least_squares(weighted, offset, method="lm").x
    return at(offset)

"""What is known of a model's parameters together: ``posterior.json``, a multivariate normal."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..scenario.json_files import read_model

# Relative rounding of numbers in a file, as that of a covariance written with seven digits.
ROUNDING = 1e-6


class Posterior(BaseModel):
    """Mean and covariance of all parameters that were fitted; other keys of the file are not read."""

    model_config = ConfigDict(allow_inf_nan=False)

    names: Annotated[list[str], Field(min_length=1, description="names as in model.ssv: vessel.X_u")]
    units: Annotated[list[str], Field(description="unit of each value, that of the FMU")]
    mean: Annotated[list[float], Field(description="of each")]
    covariance: Annotated[
        list[list[float]], Field(description="rows of the covariance, in products of the units")
    ]

    @model_validator(mode="after")
    def _check(self) -> "Posterior":
        n = len(self.names)
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"'{name}' occurs twice in the names")
        for key, count in (("units", len(self.units)), ("mean", len(self.mean))):
            if count != n:
                raise ValueError(f"{key} has {count} entries for {n} names")
        if [len(row) for row in self.covariance] != [n] * n:
            raise ValueError(f"covariance is not {n} rows of {n} numbers")
        C = np.array(self.covariance)
        for k in np.flatnonzero(np.diag(C) < 0.0):
            raise ValueError(f"covariance: the variance of '{self.names[k]}' is negative")
        if (pair := np.argwhere(np.abs(C - C.T) > ROUNDING * np.outer(self.std, self.std))).size:
            i, k = pair[0]
            raise ValueError(f"covariance: '{self.names[i]}' and '{self.names[k]}' are not symmetric")
        least = float(np.linalg.eigvalsh(self.correlation).min())
        if least < -ROUNDING * n:
            raise ValueError(
                "covariance is not positive semidefinite: the smallest eigenvalue of the correlations "
                f"is {least:.2g}"
            )
        return self

    @property
    def std(self) -> np.ndarray:
        """Standard deviation (n,) of each, in its unit."""
        return np.sqrt(np.diag(np.array(self.covariance)))

    @property
    def correlation(self) -> np.ndarray:
        """Correlations (n, n); those of an exact value are zero."""
        std = self.std
        scale = np.divide(1.0, std, out=np.zeros_like(std), where=std > 0.0)
        C = np.array(self.covariance)
        return scale[:, None] * 0.5 * (C + C.T) * scale

    def draws(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Values (count, n) of all parameters, drawn together."""
        zero = np.zeros(len(self.names))
        unit = rng.multivariate_normal(zero, self.correlation, count, "ignore", method="eigh")
        return np.array(self.mean) + self.std * unit


def read_posterior(path: Path) -> Posterior:
    """What a diagnosis knows of the values that it fitted.

    Args:
        path: ``posterior.json`` next to ``model.ssv``.

    Raises:
        InputError: no such file, or no mean with a covariance; says what is wrong.
    """
    return read_model(path, Posterior, "a posterior", strict=False)

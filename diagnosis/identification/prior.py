"""The prior of the nominal coefficients: independent, Gaussian, about their values."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..model import Model

# Relative standard deviation of what is weighed and measured (masses, thrusters' forces and places), at
# the most: a balance or a bollard pull is better than a tenth. Damping is taken over from other ships.
MEASURED = 0.1


@dataclass(frozen=True, eq=False)
class NominalPrior:
    """The prior N(mean, diag(std^2)) of the coefficients of hull and thrusters that are not zero.

    Attributes:
        mean: coefficient -> value in the model that a search starts from, SI.
        std: coefficient -> standard deviation, SI.
    """

    mean: Mapping[str, float]
    std: Mapping[str, float]

    @classmethod
    def of(cls, model: Model, relative: float) -> "NominalPrior":
        """The prior about a model.

        Args:
            model: that a search starts from.
            relative: standard deviation of a damping coefficient, as a share of its value.
        """
        values = {name: model.value(name) for name in model.ship.coefficients}
        mean = {name: value for name, value in values.items() if value != 0.0}
        damping = model.ship.coefficients
        share = {name: relative if damping[name] else min(relative, MEASURED) for name in mean}
        return cls(mean, {name: abs(value) * share[name] for name, value in mean.items()})

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.mean)

    def changes(self, offset: np.ndarray) -> dict[str, float]:
        """Additions to the coefficients, SI, for offsets (size,) in standard deviations."""
        return {
            name: std * float(k)
            for (name, std), k in zip(self.std.items(), offset, strict=True)
            if k != 0.0
        }

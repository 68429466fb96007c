"""The prior of the nominal coefficients: independent, Gaussian, about their values.

How well each is known follows from where its value comes from, which the ship's components declare
(:class:`fmus.declare.Known`): a weighed mass to a hundredth, damping of another ship hardly at all.
The *search* for missing effects believes in every coefficient to a tenth at the least: one that must
change by more than that is what the ship lacks, wherever its value came from. With the origins' own
deviations a drag four times the towed one is absorbed by the nominal coefficients, and nothing is found
where 99 % sure is right (the example of the README). The *fit* of what was found has no such bound:
there the question is no longer what is missing, but how large it is.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from fmus.ship import Ship

from ..predictors import Model
from ..predictors.uncertainty import MEASURED

# One relative standard deviation of all, or of those named, by coefficient or group; None: the ship's.
Prior = float | Mapping[str, float] | None


def shares(ship: Ship, prior: Prior) -> dict[str, float]:
    """The relative standard deviation of each nominal coefficient that is not zero.

    Args:
        ship: its components declare what is known of each.
        prior: one for all, of which masses and thrusters have :data:`MEASURED` at the most; or of groups
            and single coefficients, where the single one counts. What is not named is as the ship says.

    Raises:
        InputError: a name that is none, or a number that is negative or not finite.
    """
    return {n: k.share for n, k in ship.coefficients.items()} | _given(ship, prior)


def _given(ship: Ship, prior: Prior) -> dict[str, float]:
    """The same, of those alone for which the prior gives one."""
    known = ship.coefficients
    given = prior if isinstance(prior, Mapping) else {}
    names = [*known, *dict.fromkeys(k.group for k in known.values())]
    for name in given:
        if name not in names:
            raise InputError(f"no coefficient or group '{name}' for the prior{nearest(name, names)}")
    for share in given.values() if prior is None or isinstance(prior, Mapping) else (prior,):
        if not isinstance(share, float | int):
            raise InputError(f"the prior must be a number, or numbers by name, not {share!r}")
        if not 0.0 <= share < inf:
            raise InputError(f"the prior must be zero or more, not {share:g}")
    if isinstance(prior, float | int):
        return {n: prior if k.group == "damping" else min(prior, MEASURED) for n, k in known.items()}
    named = {n: given.get(n, given.get(k.group)) for n, k in known.items()}
    return {n: share for n, share in named.items() if share is not None}


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
    def of(cls, model: Model, prior: Prior = None, most: float = inf) -> "NominalPrior":
        """The prior about a model.

        Args:
            model: its values are the means.
            prior: see :func:`shares`.
            most: relative standard deviation, at the most, of those that are as the ship says.

        Raises:
            InputError: see :func:`shares`.
        """
        given, mean, std = _given(model.ship, prior), {}, {}
        for name, known in model.ship.coefficients.items():
            value = model.value(name)
            if name in given:
                own = abs(value) * given[name]
            else:  # a zero has no relative one
                own = min(known.deviation(value), most * abs(value) if value else inf)
            if value or own:
                mean[name], std[name] = value, own
        return cls(mean, std)

    @property
    def uncertain(self) -> list[str]:
        """The coefficients that are not known exactly."""
        return [n for n, s in self.std.items() if s > 0.0]

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.mean)

    def rescaled(self, offset: np.ndarray, of: "NominalPrior") -> np.ndarray:
        """Offsets (size,) in standard deviations of another prior, in those of this one."""
        pairs = zip(offset.tolist(), of.std.values(), self.std.values(), strict=True)
        return np.array([k * a / b if b else 0.0 for k, a, b in pairs])

    def changes(self, offset: np.ndarray) -> dict[str, float]:
        """Additions to the coefficients, SI, for offsets (size,) in standard deviations."""
        pairs = zip(self.std.items(), offset.tolist(), strict=True)
        return {name: std * k for (name, std), k in pairs if k != 0.0}

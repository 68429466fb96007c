"""Effects that act like another value of a nominal coefficient, where that is beyond its prior.

A bow thruster that loses a part of its force and one whose force is described wrong move a ship in the
same way. No prediction discriminates them, so that the search, which can change the coefficient, finds
no effect. Only the prior speaks for it: the further the coefficient is off, the likelier the effect.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from fmus.effects import Effect

from ..predictors import Model, WeakWindows
from ..predictors.weak_form import OVERLAP
from ..runs.run_constants import FAR_OFF, NEGLIGIBLE
from ..search.candidates import model_error
from ..search.conclusion import interval
from ..search.findings import Finding
from ..search.nonlinear.multistart import limits
from ..search.prediction_fit.refit import RefitOutcome
from ..search.prior import NominalPrior
from .confidence import EVEN_ODDS
from .prediction_gain import columns_of

EITHER = "another value of {0}, beyond its prior by {1:.2g} standard deviations, acts in the same way"


@dataclass(frozen=True)
class _Far:
    """A coefficient beyond its prior: change, standard deviation, those of its prior, and its force."""

    name: str
    change: float
    std: float
    of_prior: float
    force: np.ndarray

    @property
    def z(self) -> float:
        """By how many standard deviations of its prior it is off."""
        return self.change / self.of_prior

    def odds(self, windows: float, candidates: int) -> float:
        """Logarithm of the odds of one of so many effects in its place, each at its unit information."""
        occam = np.log(self.of_prior / self.std) - 0.5 * np.log(windows)
        return float(0.5 * self.z**2 + occam - np.log(candidates))


def in_place_of_coefficients(
    fit: RefitOutcome, runs: Sequence[WeakWindows], start: Model, prior: NominalPrior
) -> list[Finding]:
    """The effects with one parameter that act like a coefficient beyond its prior, as possibilities.

    At even odds the prior is wrong, and not the ship: no confidence is more than half. An effect that is
    in the learned model already has its own.

    Args:
        fit: the learned model.
        runs: training runs.
        start: the initial model.
        prior: of its coefficients.
    """
    model, std, sigma = fit.findings.model, fit.posterior.std, fit.findings.sigma
    names = [n for n, z in fit.findings.moved.items() if abs(z) > FAR_OFF and std.get(n)]
    if not names:
        return []
    base, first = (model_error(runs, m) for m in (model, start))
    forces = columns_of(runs, model, base, names, sigma).T
    far = [
        _Far(n, fit.findings.moved[n] * prior.std[n], std[n], prior.std[n], force)
        for n, force in zip(names, forces, strict=True)
    ]
    known = {f.id for f in fit.findings.effects}
    effects = [start.ship.effects[i] for i in start.ship.candidates if i not in known]
    windows = len(base) / OVERLAP
    found = []
    for c in far:  # an effect acts on the ship with the coefficient that it takes the place of
        at = model.plus({c.name: -c.change})
        error = model_error(runs, at)
        squares = [float(np.sum((e / sigma) ** 2)) for e in (error, base, first)]
        share = (squares[0] - squares[1]) / squares[2]
        for e in filter(_has_one_value, effects):
            column = columns_of(runs, at, error, e.fitted, sigma)[:, 0]
            possible = _possible(c, e, column, windows, len(start.ship.candidates), at)
            found += [replace(possible, share=share, q2=share)] if possible else []
    return sorted(found, key=lambda f: -f.confidence)


def _has_one_value(e: Effect) -> bool:
    s = e.search
    return s.by == "regression" and len(e.fitted) == 1 and e.differentiable and not (s.times or s.smooth)


def _possible(
    c: _Far, e: Effect, column: np.ndarray, windows: float, candidates: int, model: Model
) -> Finding | None:
    """An effect in place of a coefficient; None: its force is another one, or its value not allowed."""
    square, product = float(np.sum(column**2)), float(np.sum(column * c.force))
    if not product**2 > (1.0 - NEGLIGIBLE) * square * float(np.sum(c.force**2)):
        return None
    (name,), per = e.fitted, product / square
    # With the effect the coefficient is not known by these data, but by its prior.
    value, std = c.change * per, float(np.hypot(c.std, c.of_prior)) * abs(per)
    low, high = limits(next(p for p in e.parameters if p.name == name))
    if not low <= model.value(name) + value <= high:
        return None
    confidence = EVEN_ODDS * float(expit(c.odds(windows, candidates)))
    return Finding(
        e.id,
        {name: value},
        {name: interval(value, std)},
        confidence,
        [],
        0.0,
        0.0,
        model,
        together=confidence,
        doubt=EITHER.format(c.name, abs(c.z)),
    )

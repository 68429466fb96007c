"""What each finding explains: shares of the error's sum of squares, axes weighted by noise."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError

from ..predictors import Model, WeakWindows, omega
from ..search.findings import Finding, Findings


def _squares(runs: Sequence[WeakWindows], model: Model, sigma: np.ndarray) -> float:
    return sum(float(np.sum((omega(w, model) / sigma) ** 2)) for w in runs)


def shares(learned: Findings, start: Model, validate: Sequence[WeakWindows]) -> list[float]:
    """Share of the initial sum of squares that each finding explains.

    It is that of validation runs; without any, and of times within a run, which no other run has, that
    of cross-validation.

    Args:
        learned, start: the findings and the model with them, and the initial model.
        validate: validation runs.
    """
    found = [f.share for f in learned.effects]
    if validate and found:
        models = [start, *(f.model for f in learned.effects)]
        sums = np.array([_squares(validate, model, learned.sigma) for model in models])
        unseen = (-np.diff(sums) / sums[0]).tolist()
        pairs = zip(learned.effects, unseen, strict=True)
        found = [f.share if f.of_runs else share for f, share in pairs]
    return np.clip(found, 0.0, 1.0).tolist()


def unique_shares(
    learned: Findings, start: Model, train: Sequence[WeakWindows], validate: Sequence[WeakWindows]
) -> list[float | None]:
    """Share of the first sum of squares that comes back without one finding.

    The other findings and the nominal coefficients are fitted anew, and so explain what they can in its
    place; coefficients that would be further than FAR_OFF from their prior stay as they are. Of two
    findings that explain the same, neither has a share of its own.

    Args:
        learned, start: the findings and the model with them, and the initial model.
        train: training runs; they count for what holds in them alone, such as times of failures.
        validate: validation runs; where there are any, they count for all else.

    Returns:
        For each finding, in their order, a share [1]; None where the method cannot fit without it.
    """
    if learned.refit is None:
        return [None] * len(learned.effects)

    def unique(finding: Finding, others: Findings) -> float:
        runs = train if finding.of_runs else validate or train
        without = others.model if others.effects else others.refitted or start
        fitted = learned.model.ship.effects[finding.id].search.by == "regression"
        if fitted and not others.plausible:
            without = learned.model.plus({name: -value for name, value in finding.values.items()})
        left, now, first = (_squares(runs, m, learned.sigma) for m in (without, learned.model, start))
        return float(np.clip((left - now) / first, 0.0, 1.0))

    found: list[float | None] = []
    for finding in learned.effects:
        try:
            others = learned.refit([f.id for f in learned.effects if f.id != finding.id])
        except LinAlgError:  # these data do not determine the others alone
            found.append(None)
        else:
            found.append(unique(finding, others))
    return found

"""What each finding explains: its share of the model error, and the part that nothing else explains."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError

from ..predictors import Model, WeakWindows, omega
from ..runs.run_constants import NEGLIGIBLE
from ..search.findings import Finding, Findings


def error_squares(runs: Sequence[WeakWindows], model: Model) -> np.ndarray:
    """(3,), sum of squares of a model's error on each axis."""
    return np.sum([np.square(omega(w, model)).sum(axis=0) for w in runs], axis=0)


def falls_by_axis(found: Findings, start: Model, runs: Sequence[WeakWindows]) -> np.ndarray:
    """(findings, 3), shares of the error's sum of squares of each axis, by which it falls with each."""
    sums = np.array([error_squares(runs, model) for model in (start, *(f.model for f in found.effects))])
    return np.divide(-np.diff(sums, axis=0), sums[0], out=np.zeros_like(sums[1:]), where=sums[0] > 0.0)


def shares(learned: Findings, start: Model, validate: Sequence[WeakWindows]) -> list[float]:
    """Share of the initial sum of squares that each finding explains.

    It is that of validation runs; without any, and of times within a run, which no other run has, that
    of cross-validation. Of waves it is their share of the power, as no model foretells them.

    Args:
        learned, start: the findings and the model with them, and the initial model.
        validate: validation runs.
    """
    found = [f.share for f in learned.effects]
    if validate and found:
        models = [start, *(f.model for f in learned.effects)]
        sums = np.array([error_squares(validate, model) for model in models]) @ learned.sigma**-2.0
        unseen = (-np.diff(sums) / sums[0]).tolist()
        pairs = zip(learned.effects, unseen, strict=True)
        found = [f.share if f.of_runs or is_random(f, start) else share for f, share in pairs]
    return np.clip(found, 0.0, 1.0).tolist()


def is_random(f: Finding, start: Model) -> bool:
    """Whether a finding is a random process, as waves are."""
    return start.ship.effects[f.id].search.by == "spectrum"


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
        For each finding, in their order, a share [1]; None for waves, and where the method cannot fit
        without it.
    """
    if learned.refit is None:
        return [None] * len(learned.effects)

    def unique(finding: Finding, others: Findings) -> float:
        runs = train if finding.of_runs else validate or train
        without = others.model if others.effects else others.refitted or start
        fitted = learned.model.ship.effects[finding.id].search.by == "regression"
        if fitted and not others.plausible:
            without = learned.model.plus({name: -value for name, value in finding.values.items()})
        models = without, learned.model, start
        left, now, first = (float(error_squares(runs, m) @ learned.sigma**-2.0) for m in models)
        return float(np.clip((left - now) / first, 0.0, 1.0))

    found: list[float | None] = []
    for finding in learned.effects:
        if is_random(finding, start):
            found.append(None)
            continue
        try:
            others = learned.refit([f.id for f in learned.effects if f.id != finding.id])
        except LinAlgError:  # these data do not determine the others alone
            found.append(None)
        else:
            found.append(unique(finding, others))
    return found


def replaceable(
    found: Findings, explained: Sequence[float], alone: Sequence[float | None], left: float
) -> set[str]:
    """The effects without which all else, fitted anew, explains as much, by :func:`unique_shares`.

    Of what an effect and the coefficients explain together its own part may be small. It is needed all
    the same where that is more than half of what is left without it.

    Args:
        found: the findings.
        explained, alone: of each, the share that it explains with the coefficients, and its own part.
        left: share of the first sum of squares that the model with all of them leaves.
    """
    return {
        f.id
        for f, share, own in zip(found.effects, explained, alone, strict=True)
        if own is not None and own <= min(NEGLIGIBLE * share, left)
    }


def share_left(found: Findings, start: Model, runs: Sequence[WeakWindows]) -> float:
    """Share of the first sum of squares that a learned model leaves."""
    left, first = (float(error_squares(runs, m) @ found.sigma**-2.0) for m in (found.model, start))
    return left / first if first > 0.0 else 0.0

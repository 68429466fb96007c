"""Possibilities without a proven gain: they are reported, and the learned model does without them.

An effect that is no finding describes the motions that it was found on, whatever their cause is. In
other manoeuvres it may do harm. It stays in the model if data that it was not fitted to show its gain:
validation runs, other training runs, or stretches of a single one.
"""

from ..search.findings import Finding, Findings
from .confidence import confidence_of
from .paired_errors import gain, predicts_worse
from .pruning import without
from .pruning_criteria import Harm
from .validation_data import ValidationData


def proven(found: Findings, data: ValidationData, harm: Harm) -> tuple[Findings, list[Finding]]:
    """Take out the possibilities without which the data are fitted and predicted as well.

    The comparison is that of pruning with the burden of proof reversed. The last possibility is compared
    with the initial model, which takes its place. Waves and failures are not judged, as there.

    Args:
        found: the findings that pruning left.
        data: the data that decide.
        harm: the criterion of pruning.

    Returns:
        The findings that are left, all else fitted anew, and the effects that were taken out.
    """
    start, data = data.start, data.of_other_runs
    search = {f.id: start.ship.effects[f.id].search for f in found.effects}
    doubted = [
        f
        for f in found.effects
        if search[f.id].by == "regression"
        and not search[f.id].times
        and not confidence_of(f, start).is_finding
    ]
    kept, gone = found, []
    while doubted and data.judges(kept):
        rests = [without(found, [*(f.id for f in gone), each.id], start) for each in doubted]
        full, *losses = data.losses(kept, *(rest if rest.effects else start for rest in rests))
        idle = [
            (gain(full, other), k)
            for k, (f, other) in enumerate(zip(doubted, losses, strict=True))
            if not harm(other, full, -len(f.values))
        ]
        if not idle:
            break
        k = max(idle)[1]
        kept = rests[k]
        gone.append(doubted.pop(k))
    return kept, gone


def overfits(fit: Findings, before: Findings, data: ValidationData, harm: Harm) -> bool:
    """Whether a fit to predictions is worse on runs that it has not seen than what it began with.

    Its priors are wider than those of the search, and a coefficient that one run determines may be false
    in another one.

    Args:
        fit, before: the same findings, fitted to predictions and to the model error.
        data: the training runs; validation runs judge the fit by themselves.
        harm: the criterion of pruning.
    """
    data = data.of_other_runs
    if not (data.judges(fit) and data.judges(before)):
        return False
    its, others, first = data.losses(fit, before, data.start)
    return predicts_worse(its, others) or bool(harm(its, first, 0))

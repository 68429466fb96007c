"""Pruning: effects are rejected with which the data that decide are fitted or predicted worse.

Pruning only removes: what is rejected is replaced by nothing. Confidence does not count: what makes
predictions better stays in the model.

Then the possibilities without a proven gain go, which are reported as well. An effect that is no finding
describes the motions that it was found on, whatever their cause is. In other manoeuvres it may do harm.
It stays in the model if data that it was not fitted to show its gain: validation runs, other training
runs, or stretches of a single one.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from ..predictors import Model
from ..search.findings import Finding, Findings
from ..search.refinement import at_limit
from ..search.significance import fits_predict_worse, gain, lower_throughout
from ..search.significance import harm as paired_harm
from .confidence import confidence_of
from .pruning_criteria import Harm
from .validation_data import ValidationData

ALONE = "with this effect {harm}"
WHOLE_SET = "with this effect and the earlier ones {harm} than with the initial model"
NOTHING = "its value is zero after the fit to predictions"
DRIVES = "with this effect the hull gains energy, and {where} do not confirm that"


class Withdrawn(NamedTuple):
    """An effect that was accepted and rejected afterwards, and why."""

    id: str
    reason: str


def prune(
    found: Findings,
    data: ValidationData,
    drives: Callable[[Model, Model], Collection[str]],
    harm: Harm,
) -> tuple[Findings, list[Withdrawn]]:
    """Reject effects that make the data that decide worse.

    Where nothing else is left, the nominal coefficients that were fitted together with them are judged.

    Args:
        found: the findings on the training runs.
        data: the data that decide.
        drives: motions in which the hull of the first model drives the ship on, that of the second not.
        harm: the criterion.

    Returns:
        The findings that are left, all else fitted anew, and the rejected effects.
    """
    start = data.start
    by_data = judgeable(found, start, bool(data.validate))
    if not found.effects or not data.judges(found):
        return found, []
    sizes = {f.id: len(f.values) for f in found.effects}
    gone: list[Withdrawn] = []
    kept, left = found, by_data
    while left:
        rests = {i: without(found, [*(w.id for w in gone), i], start) for i in left}
        models = {i: rest.model if rest.effects else start for i, rest in rests.items()}
        on = {i for i, model in models.items() if drives(kept.model, model)}
        worst = _at_limit(kept, left, start) or _worst(kept, rests, data, on, harm, sizes)
        if worst is None:
            break
        # One at a time: of two that stand in for each other, the other may be needed then.
        gone.append(worst)
        kept = rests[worst.id]
        left = [i for i in left if i != worst.id]
    for i in reversed(left):
        its, first = data.losses(kept, start)
        harmed = harm(its, first, sum(sizes[f.id] for f in kept.effects))
        if not harmed:
            break
        gone.append(Withdrawn(i, WHOLE_SET.format(harm=harmed.format(where=data.where))))
        kept = without(found, [w.id for w in gone], start)
    if len(gone) == len(by_data) and kept.effects:
        its, first = data.losses(kept, start)
        if harm(its, first, 0):
            kept = added(kept, kept.effects, start)
    return kept, gone


def judgeable(found: Findings, start: Model, of_other_runs: bool) -> list[str]:
    """The effects that data can judge, by their ids; ``of_other_runs``: these are validation runs.

    Waves and failures are not: no model has waves, and the times of a failure are those of the run in
    which it was found. Nor are, by validation runs, values that hold in training runs alone.
    """
    effects = start.ship.effects
    search = {f.id: effects[f.id].search for f in found.effects if not (f.of_runs and of_other_runs)}
    return [i for i, s in search.items() if s.by == "regression" and not s.times]


def _alternative(rest: Findings, kept: Findings, start: Model) -> Findings | Model:
    """The findings without an effect, to compare with: all else is fitted anew.

    Coefficients beyond their prior can do what an effect does, and explain nothing: where they are not
    beyond it with the effect, those of the first model take their place.
    """
    if rest.plausible or not kept.plausible:
        return rest
    first = added(rest, rest.effects, start)
    if not rest.effects:
        return start
    folds, runs = ([first.model] * len(models) for models in (rest.fold_models, rest.run_models))
    return replace(first, fold_models=folds, run_models=runs)


def _at_limit(found: Findings, ids: Collection[str], start: Model) -> Withdrawn | None:
    """An effect whose value no data chose; None: there is none.

    A share may well be all there is, as of a force that is lost; other ranges end where nobody looked.
    """
    for f in found.effects:
        values = at_limit(start, f.id, f.values) if f.id in ids else []
        if texts := [str(x) for x in values if x.unit != "1"]:
            return Withdrawn(f.id, " and ".join(texts))
    return None


def _worst(
    kept: Findings,
    rests: Mapping[str, Findings],
    data: ValidationData,
    drive: Collection[str],
    harm: Harm,
    sizes: Mapping[str, int],
) -> Withdrawn | None:
    """The effect without which the data that decide gain the most, of those to reject; None: none is.

    Of each effect ``rests`` has the findings without it, ``sizes`` the number of its parameters; with
    those of ``drive`` the hull drives the ship on.
    """
    others = [_alternative(rest, kept, data.start) for rest in rests.values()]
    full, *losses = data.losses(kept, *others, *rests.values())
    compared = zip(rests, losses[: len(rests)], losses[len(rests) :], strict=True)
    found: list[tuple[float, Withdrawn]] = []
    for i, other, refitted in compared:
        harmed = harm(full, other, sizes[i])
        if harmed and harm(full, refitted, sizes[i]):
            reason = ALONE.format(harm=harmed.format(where=data.where))
        elif i in drive and not lower_throughout(full.omega, other.omega):
            reason = DRIVES.format(where=data.where)
        else:
            continue
        found.append((gain(full, other), Withdrawn(i, reason)))
    return max(found)[1] if found else None


def without(found: Findings, ids: Sequence[str], start: Model) -> Findings:
    """The findings without some effects; by subtraction where the method cannot fit the rest anew."""
    rest = [f for f in found.effects if f.id not in ids]
    return added(found, rest, start) if found.refit is None else found.refit([f.id for f in rest])


def added(found: Findings, effects: Sequence[Finding], start: Model) -> Findings:
    """The findings with some effects as they are, on the nominal coefficients of the first model."""
    model, on_top = start, []
    for f in effects:
        model = model.plus(f.values)
        on_top.append(replace(f, model=model))
    return replace(found, effects=on_top, model=model, suspects=[], moved={})


def proven(found: Findings, data: ValidationData, harm: Harm) -> tuple[Findings, list[Finding]]:
    """Take out the possibilities without which the data are fitted and predicted as well.

    The comparison is that of pruning with the burden of proof reversed. The last possibility is compared
    with the initial model, which takes its place.

    Returns:
        The findings that are left, all else fitted anew, and the effects that were taken out.
    """
    start, by_data = data.start, judgeable(found, data.start, bool(data.validate))
    data = data.of_other_runs
    doubted = [f for f in found.effects if f.id in by_data and not confidence_of(f, start).is_finding]
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
        data: that decide; validation runs were compared with the fit to the model error already.
        harm: the criterion of pruning.
    """
    if data.validate:
        its, first = data.losses(fit.model, data.start)
        return bool(paired_harm(its, first))
    data = data.of_other_runs
    if not (data.judges(fit) and data.judges(before)):
        return False
    its, first = data.losses(fit, data.start)
    return fits_predict_worse(*data.losses_of_folds(fit, before)) or bool(harm(its, first, 0))

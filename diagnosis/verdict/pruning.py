"""Effects taken out after the search: those with which unseen data fit or are predicted worse.

They only veto: what is withdrawn is replaced by nothing. How sure an effect is does not count: what
makes predictions better stays in the model.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError

from ..predictors import Model, WeakWindows, omega
from ..predictors.evaluation import Evaluation
from ..search.findings import Finding, Findings
from ..search.gram import block_folds
from ..search.refinement import at_limit
from ..search.significance import lower_throughout
from .validation_data import Losses, Part, gain, harm, losses

ALONE = "with it {harm}"
WHOLE_SET = "with it and what was found before it {harm} than at first"
AT_LIMIT = "{0} is at the limit of what was looked for"
NOTHING = "fitted to predictions it is nothing"
DRIVES = "with it the hull drives the ship on, and {where} do not show that it does"


class Withdrawn(NamedTuple):
    """An effect that was accepted and taken back, and why."""

    id: str
    reason: str


class Unseen:
    """The data that decide, and what findings miss there.

    Args:
        train: runs that were learned from.
        held_out: runs of which nothing was learned; where there are any, they decide.
        start: the model at first.
        sigma: (3,), what a model error is divided by [N, N, N m].
    """

    def __init__(
        self,
        train: Sequence[WeakWindows],
        held_out: Sequence[WeakWindows],
        start: Model,
        sigma: np.ndarray,
    ) -> None:
        self._start, self._sigma, self._held_out = start, sigma, bool(held_out)
        self._known: dict[int, tuple[Findings | Model, Losses]] = {}
        self.where = "held-out runs" if held_out else "data left out of the fit"
        if held_out or len(train) > 1:
            self._parts = [Part(w) for w in held_out or train]
        else:
            self._parts = [Part(train[0], blocks) for blocks in block_folds(train)]

    def judges(self, found: Findings) -> bool:
        """Whether a method's findings can be held against these data."""
        return self._held_out or len(found.fold_models) == len(self._parts)

    def losses(self, *found: Findings | Model) -> list[Losses]:
        """What models miss, each fitted without the part that it is held against."""
        if any(id(f) not in self._known for f in found):
            # The first model, which comes up again, takes hardly longer beside others.
            due = {id(f): f for f in (*found, self._start) if id(f) not in self._known}
            missed = losses(self._parts, [self._models(f) for f in due.values()], self._sigma)
            self._known |= zip(due, zip(due.values(), missed, strict=True), strict=True)
        return [self._known[id(f)][1] for f in found]

    def _models(self, found: Findings | Model) -> Sequence[Model]:
        if isinstance(found, Findings):
            if not self._held_out:
                return found.fold_models
            found = found.model if found.effects else found.refitted or self._start
        return [found] * len(self._parts)


def withdraw(
    found: Findings, unseen: Unseen, start: Model, drives: Callable[[Model, Model], bool]
) -> tuple[Findings, list[Withdrawn]]:
    """Take back what makes unseen data worse.

    Waves and failures are not judged: no model has waves, and the times of a failure are those of the
    run in which it was found. Where nothing else is left, the nominal coefficients that were fitted
    beside them are.

    Args:
        found: the findings on the training runs.
        unseen: the data that decide.
        start: the model at first.
        drives: whether the hull of the first model drives the ship on where that of the second does not.

    Returns:
        The findings that are left, all else fitted anew, and what was withdrawn.
    """
    search = {f.id: start.ship.effects[f.id].search for f in found.effects}
    judged = [i for i, s in search.items() if s.by == "regression" and not s.times]
    if not found.effects or not unseen.judges(found):
        return found, []
    gone: list[Withdrawn] = []
    kept, left = found, judged
    while left:
        rests = {i: without(found, [*(w.id for w in gone), i], start) for i in left}
        on = {i for i, rest in rests.items() if drives(kept.model, _model(rest, start))}
        against = {i: _instead(r, kept, start) for i, r in rests.items()}
        worst = _at_limit(kept, left, start) or _worst(kept, against, unseen, on)
        if worst is None:
            break
        # One at a time: of two that stand in for each other, the other may be needed then.
        gone.append(worst)
        kept = rests[worst.id]
        left = [i for i in left if i != worst.id]
    for i in reversed(left):
        harmed = harm(*unseen.losses(kept, start))
        if not harmed:
            break
        gone.append(Withdrawn(i, WHOLE_SET.format(harm=harmed.format(where=unseen.where))))
        kept = without(found, [w.id for w in gone], start)
    if len(gone) == len(judged) and kept.effects and harm(*unseen.losses(kept, start)):
        kept = added(kept, kept.effects, start)
    return kept, gone


def _instead(rest: Findings, kept: Findings, start: Model) -> Findings | Model:
    """What an effect is held against: the findings without it, all else fitted anew.

    Coefficients moved beyond belief can do what an effect does, and explain nothing: where they are not
    beyond belief with it, those of the first model stand beside what is left.
    """
    if rest.plausible or not kept.plausible:
        return rest
    first = added(rest, rest.effects, start)
    return replace(first, fold_models=[first.model] * len(rest.fold_models)) if rest.effects else start


def _at_limit(found: Findings, ids: Collection[str], start: Model) -> Withdrawn | None:
    """An effect whose value no data chose; None: there is none.

    A share may well be all there is, as of a force that is lost; other ranges end where nobody looked.
    """
    for f in found.effects:
        names = at_limit(start, f.id, f.values) if f.id in ids else []
        if names := [n for n in names if start.declared(n).unit != "1"]:
            return Withdrawn(f.id, AT_LIMIT.format(" and ".join(names)))
    return None


def _worst(
    kept: Findings,
    rests: Mapping[str, Findings | Model],
    unseen: Unseen,
    drive: Collection[str],
) -> Withdrawn | None:
    """The effect without which unseen data gain the most, of those that are to go; None: none is.

    Args:
        kept: the findings.
        rests: effect -> what is left without it.
        unseen: the data that decide.
        drive: effects with which the hull drives the ship on.
    """
    full, *beside = unseen.losses(kept, *rests.values())
    found: list[tuple[float, Withdrawn]] = []
    for i, other in zip(rests, beside, strict=True):
        if harmed := harm(full, other):
            reason = ALONE.format(harm=harmed.format(where=unseen.where))
        elif i in drive and not lower_throughout(full.omega, other.omega):
            reason = DRIVES.format(where=unseen.where)
        else:
            continue
        found.append((gain(full, other), Withdrawn(i, reason)))
    return max(found)[1] if found else None


def _model(found: Findings, start: Model) -> Model:
    return found.model if found.effects else start


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


def unique_shares(
    learned: Findings, start: Model, evaluations: Sequence[Evaluation]
) -> list[float | None]:
    """Share of the first sum of squares that comes back without one finding.

    The other findings and the nominal coefficients are fitted anew, and so explain what they can in its
    place; coefficients that would be further than MOST_MOVED from what is believed of them stay as they
    are. Of two findings that explain the same, neither has a share of its own.

    Args:
        learned: the findings and the model with them.
        start: the initial model.
        evaluations: of the runs; those held out count if there are any, but for what holds in others
            alone, such as times of failures.

    Returns:
        For each finding, in their order, a share [1], axes weighted by noise; None where the method
        cannot fit without it.
    """
    held_out = [e.weak_windows for e in evaluations if e.held_out]
    trained = [e.weak_windows for e in evaluations if not e.held_out]
    if learned.refit is None or not learned.effects:
        return [None] * len(learned.effects)
    found: list[float | None] = []
    for finding in learned.effects:
        runs = trained if finding.of_runs else held_out or trained

        def squares(model: Model, runs: Sequence[WeakWindows] = runs) -> float:
            return sum(float(np.sum((omega(w, model) / learned.sigma) ** 2)) for w in runs)

        try:
            others = learned.refit([f.id for f in learned.effects if f.id != finding.id])
        except LinAlgError:  # these data do not determine the others alone
            found.append(None)
            continue
        without = others.model if others.effects else others.refitted or start
        fitted = learned.model.ship.effects[finding.id].search.by == "regression"
        if fitted and not others.plausible:
            without = learned.model.plus({name: -value for name, value in finding.values.items()})
        found.append(min(1.0, max(0.0, (squares(without) - squares(learned.model)) / squares(start))))
    return found

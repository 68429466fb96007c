"""Withdrawal: effects with which unseen data fit worse are taken back, once, after the search.

Unseen are held-out runs; where there are none, each training run by a fit to the others. They only veto:
what is withdrawn is replaced by nothing.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..model import Integrals, Model, omega
from .acceptance import worse
from .findings import Findings

MEASURED = "with it the model fits {where} worse"
WHOLE_SET = "with it and what was found before it the model fits {where} worse than at first"
DRIVES = "with it the hull drives the ship on, and {where} do not show that it does"


class Withdrawn(NamedTuple):
    """An effect that was accepted and taken back, and why."""

    id: str
    reason: str


def withdraw(
    found: Findings,
    held_out: Sequence[Integrals],
    start: Model,
    drives: Callable[[Model, Model], bool],
) -> tuple[Findings, list[Withdrawn]]:
    """Take back what makes unseen data worse.

    Args:
        found: the findings on the training runs.
        held_out: runs of which nothing was learned; may be empty.
        start: the model at first.
        drives: whether the hull of the first model drives the ship on where that of the second does not.

    Returns:
        The findings that are left, all else fitted anew, and what was withdrawn.
    """
    fitted = [f for f in found.effects if start.ship.effects[f.id].search.by == "regression"]
    # Held-out runs say nothing of what holds in others alone.
    judged = [f.id for f in fitted if not (held_out and f.of_runs)]
    where = "held-out runs" if held_out else "data left out of the fit"
    if not judged or (not held_out and found.left_out is None):
        return found, []

    def loss(findings: Findings) -> np.ndarray:
        if not held_out and findings.left_out is not None:
            return findings.left_out
        model = findings.model if findings.effects else findings.refitted or start
        return losses(held_out, model, found.sigma)

    gone: list[Withdrawn] = []
    full = loss(found)
    for i in judged:
        rest = without(found, [i], start)
        beside = loss(rest)
        if worse(full, beside):
            gone.append(Withdrawn(i, MEASURED.format(where=where)))
        elif drives(found.model, _model(rest, start)) and not worse(beside, full):
            gone.append(Withdrawn(i, DRIVES.format(where=where)))
    kept = without(found, [w.id for w in gone], start) if gone else found
    first = losses(held_out, start, found.sigma) if held_out else found.left_out_at_first
    for i in reversed([i for i in judged if all(i != w.id for w in gone)]):
        if first is None or not worse(loss(kept), first):
            break
        gone.append(Withdrawn(i, WHOLE_SET.format(where=where)))
        kept = without(found, [w.id for w in gone], start)
    return kept, gone


def _model(found: Findings, start: Model) -> Model:
    return found.model if found.effects else start


def without(found: Findings, ids: Sequence[str], start: Model) -> Findings:
    """The findings without some effects; by subtraction where the method cannot fit the rest anew."""
    rest = [f for f in found.effects if f.id not in ids]
    if found.keep is not None:
        return found.keep([f.id for f in rest])
    model, effects = start, []
    for f in rest:
        model = model.plus(f.values)
        effects.append(replace(f, model=model))
    return replace(found, effects=effects, model=model)


def losses(data: Sequence[Integrals], model: Model, sigma: np.ndarray) -> np.ndarray:
    """Sum of squares of the model error in each block of some runs (blocks,), axes weighted by noise.

    Args:
        data: windows of each run.
        model: whose error it is.
        sigma: (3,), what an error is divided by [N, N, N m].
    """
    found = []
    for w in data:
        squares = np.sum((omega(w, model) / sigma) ** 2, axis=1)
        number = np.unique(w.block, return_inverse=True)[1]
        found.append(np.bincount(number, squares))
    return np.concatenate(found)

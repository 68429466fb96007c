"""What a diagnosis comes to: which model, and what that leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .assessment.evaluation import Evaluation
from .assessment.recurrence import recurrence
from .assessment.regions import Region
from .assessment.remainder import AxisRemainder, Remainder, axis_remainders
from .assessment.remainder_text import remainder_sentence
from .identification.acceptance import worse
from .identification.findings import Findings
from .identification.withdrawal import losses
from .model import Integrals, Model, omega
from .model.uncertainty import omega_std

# Prior standard deviations beyond which a coefficient alone is no explanation; contract.
MOST_MOVED = 3.0


def concluded(
    found: Findings, runs: Sequence[Integrals], held_out: Sequence[Integrals], start: Model
) -> tuple[Findings, bool]:
    """The findings with the model that they amount to, and whether that is other coefficients alone.

    Coefficients alone explain the data if something was missing, nothing is with them, none is further
    from what is believed of it than MOST_MOVED, and unseen data do not fit worse.
    """
    if found.effects:
        return found, False
    other = found.refitted
    if other is not None and all(abs(z) <= MOST_MOVED for z in found.moved.values()):
        spoils = bool(held_out) and worse(
            losses(held_out, other, found.sigma), losses(held_out, start, found.sigma)
        )
        missing, left = (_left(runs, start, m) for m in (start, other))
        if _any(missing) and not _any(left) and not spoils:
            return replace(found, model=other), True
    return replace(found, model=start, suspects=[]), False


def _any(axes: Mapping[str, AxisRemainder]) -> bool:
    return any(a.significant for a in axes.values())


def _left(runs: Sequence[Integrals], start: Model, model: Model) -> dict[str, AxisRemainder]:
    before, after = ([omega(w, m) for w in runs] for m in (start, model))
    return axis_remainders(runs, before, after, [omega_std(w, start) for w in runs])


def remainder_of(
    evaluations: Sequence[Evaluation],
    std: Sequence[np.ndarray],
    regions: Sequence[Region],
    learned: Findings,
) -> Remainder:
    """What the learned model leaves, in numbers and words.

    Args:
        evaluations: one for each run, held-out runs included.
        std: of each run the standard deviation (K, 3) of its model error [N, N, N m].
        regions: where the learned model fails.
        learned: the findings.
    """
    data, left = [e.integrals for e in evaluations], [e.after.omega for e in evaluations]
    axes = axis_remainders(data, [e.before.omega for e in evaluations], left, std)
    how = recurrence(data, np.concatenate(left)) if _any(axes) else None
    effects = learned.model.ship.effects
    waves = any(effects[f.id].search.by == "spectrum" for f in learned.effects)
    return Remainder(axes, remainder_sentence(axes, how, regions, waves))

"""What each finding explains that nothing else does."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError

from ..assessment.evaluation import Evaluation
from ..identification.findings import Findings
from ..model import Model, WeakWindows, omega


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

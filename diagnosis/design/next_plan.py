"""From a diagnosis to the plan of the next runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import InputError

from ..execution.progress import Advance, silent
from ..predictors import Model, WeakWindows
from ..report.finding_text import discriminating_run
from ..search import Prior
from ..search.prior import NominalPrior
from .designing import Designer, Limits, ScoredPlan
from .hypotheses import knowledge, learned_changes, rivals
from .information import Knowledge
from .rehearsal import Rehearsal
from .run_plan import MOST_RUNS, Plan, PlannedRun


@dataclass(frozen=True, eq=False)
class Question:
    """What a design starts from.

    Attributes:
        data: training runs of a diagnosis.
        content: what ``diagnosis.json`` holds.
        start: the initial model.
        prior: of its coefficients.
        limits: of each run.
        criterion: one of :data:`.information.CRITERIA`; where one candidate is left, D-optimality.
        ship: as scenarios name it; None: the default ship.
    """

    data: Sequence[WeakWindows]
    content: Mapping[str, Any]
    start: Model
    prior: Prior
    limits: Limits
    criterion: str = "certainty"
    ship: str | None = None


def prepared(q: Question, advance: Advance = silent) -> tuple[Designer, Knowledge]:
    """What searches plans for a question, and what is known before them.

    Raises:
        InputError: the ship cannot follow a pose, basin or minutes are too small, no such criterion.
    """
    advance("candidates and their weights")
    prior = NominalPrior.of(q.start, q.prior)
    space, k = knowledge(q.data, q.start, prior, rivals(q.content), learned_changes(q.content))
    used = "d-optimal" if len(k.hypotheses) == 1 else q.criterion
    best = int(np.argmax(k.weights))
    model = space.model(k.hypotheses[best], k.estimates[best].mean)
    return Designer(q.data, space, model, q.limits, used, advance), k


def plan_next(q: Question, runs: int = 1, seed: int = 0, advance: Advance = silent) -> Plan:
    """Design the runs that discriminate the candidates of a diagnosis.

    Args:
        q: the diagnosis and the limits.
        runs: how many, each designed after the one before.
        seed: of the search and of all draws.
        advance: progress callback.

    Raises:
        InputError: no run keeps the limits, or the ship cannot follow a pose.
    """
    if not 1 <= runs <= MOST_RUNS:
        raise InputError(f"the number of runs must be from 1 to {MOST_RUNS}; got {runs}")
    designer, k = prepared(q, advance)
    decided = len(k.hypotheses) == 1
    planned: list[PlannedRun] = []
    pairs: list[tuple[int, int]] = []
    now, rehearsal = k, Rehearsal(q.data, designer.space, k)
    earlier: list[WeakWindows] = []

    def sure(s: ScoredPlan) -> float:
        return rehearsal.sure([*earlier, designer.windows(s.motion)], seed)

    for n in range(runs):
        found = designer.search(now, seed + n)
        usual = {name: designer.usual(now, name) for name in designer.usual_runs}
        if n == 0:
            pairs = designer.inseparable(k)
        run, tracks = designer.checked(now, designer.best(found, usual.values()), seed + n)
        advance("simulated outcomes of the plan and of usual runs")
        others = {name: (sure(s), s) for name, s in usual.items() if s.excess == 0.0}
        planned.append(PlannedRun(designer, run, now, tracks, sure(run), others))
        now = now.plus(run.gram)
        earlier.append(designer.windows(run.motion))
    named = [(k.hypotheses[i].ids, k.hypotheses[j].ids) for i, j in pairs]
    advice = [*rehearsal.doubts, *(_advice(q.start, a, b) for a, b in named)]
    if decided:
        advice.append(
            f"One candidate is left ({k.hypotheses[0].name}): the run narrows the intervals of "
            "all values (D-optimality)."
        )
    return Plan(planned, k, named, advice, seed, designer.criterion, q.ship)


def _advice(start: Model, a: Sequence[str], b: Sequence[str]) -> str:
    """What would separate two hypotheses that no manoeuvre does, by the texts of their effects."""
    effects = start.ship.effects
    one, other = ([i for i in x if i not in y] for x, y in ((a, b), (b, a)))
    texts = dict.fromkeys(discriminating_run(effects[i], effects[j]) for i in one for j in other)
    what = "; ".join(texts) or "a higher speed, another sensor, or a longer run"
    return f"To discriminate {' + '.join(a) or 'none'} from {' + '.join(b) or 'none'} otherwise: {what}."

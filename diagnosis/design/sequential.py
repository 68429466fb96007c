"""Design, run, learn, again: the whole sequence on a simulated ship whose truth is known."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cosim
from cosim import InputError

from ..assessment.gathering import gather
from ..execution.progress import Advance, silent
from ..predictors import Model, WeakWindows
from ..report.content import file_content
from ..report.report_data import ReportData
from ..search import Prior
from ..session import begin
from .designing import Limits
from .information import SURE
from .next_plan import plan_next
from .plan import Plan, scenario_file


class Round(NamedTuple):
    """One round of a sequence.

    Attributes:
        plan: of its run.
        folder: with the log of the run.
        verdict: of the diagnosis of all runs so far.
        effects: id -> confidence of the effects that were found.
    """

    plan: Plan
    folder: Path
    verdict: str
    effects: dict[str, float]

    @property
    def certain(self) -> bool:
        """Whether every effect that was found is certain."""
        return self.verdict == "found" and min(self.effects.values()) >= SURE


def confidences(content: dict[str, Any]) -> dict[str, float]:
    """Effect -> confidence, by the content of ``diagnosis.json``; zero where the method gives none."""
    return {e["id"]: e["confidence"] or 0.0 for e in content["effects"]}


def play(
    data: Sequence[WeakWindows],
    content: dict[str, Any],
    start: Model,
    prior: Prior,
    limits: Limits,
    truth: Path,
    out: Path,
    rounds: int,
    seed: int = 0,
    criterion: str = "certainty",
    advance: Advance = silent,
    ship: str | None = None,
) -> list[Round]:
    """Design a run, simulate it with a true ship, learn from all runs, until every effect is certain.

    Args:
        data, content, start, prior, limits, criterion, advance, ship: as of :func:`.plan_next`.
        truth: parameter set of the true ship.
        out: folder; each round gets ``round_1``, ... in it, with plan and log.
        rounds: at the most.
        seed: of the first round; the next one has the next.

    Raises:
        InputError: no run keeps the limits, or the truth is not a parameter set.
    """
    found: list[Round] = []
    runs = list(data)
    for n in range(rounds):
        plan = plan_next(runs, content, start, prior, limits, 1, seed + n, criterion, advance, ship)
        folder = out / f"round_{n + 1}"
        plan.write(folder)
        advance(f"simulating round {n + 1}")
        log = folder / "run"
        scenario = folder / scenario_file(1)
        result = cosim.simulate(
            scenario, log, [truth], seed=seed + n, log="compact", pictures=False, overwrite=True
        )
        if result.status != "done":
            raise InputError(f"the run of round {n + 1} {result.status}: {result.message}")
        runs += gather([log], model=start)
        task = begin(runs, prior=prior, model=start, advance=advance)
        content = file_content(ReportData.of(task.diagnose()))
        found.append(Round(plan, log, content["verdict"], confidences(content)))
        if found[-1].certain or not plan.runs:
            break
        runs = list(task.train)  # with names of their own
    return found

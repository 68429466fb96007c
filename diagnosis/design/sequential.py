"""Design, run, learn, again: the whole sequence on a simulated ship whose truth is known."""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cosim
from cosim import InputError

from ..assessment.gathering import gather
from ..execution.progress import Advance, silent
from ..report.content import file_content
from ..report.report_data import ReportData
from ..runs.run_constants import LEVEL
from ..session import begin
from .next_plan import Question, plan_next
from .run_files import scenario_file
from .run_plan import Plan


class Round(NamedTuple):
    """One round of a sequence.

    Attributes:
        plan: of its run.
        verdict: of the diagnosis of all runs so far.
        effects: id -> confidence of the effects that were found.
    """

    plan: Plan
    verdict: str
    effects: dict[str, float]

    @property
    def certain(self) -> bool:
        """Whether every effect that was found is certain."""
        return self.verdict == "found" and min(self.effects.values()) >= LEVEL


def confidences(content: dict[str, Any]) -> dict[str, float]:
    """Effect -> confidence, by the content of ``diagnosis.json``; zero where the method gives none."""
    return {e["id"]: e["confidence"] or 0.0 for e in content["effects"]}


def play(
    q: Question, truth: Path, out: Path, rounds: int, seed: int = 0, advance: Advance = silent
) -> list[Round]:
    """Design a run, simulate it with a true ship, learn from all runs, until every effect is certain.

    Args:
        q: the first diagnosis and the limits.
        truth: parameter set of the true ship.
        out: folder; each round gets ``round_1``, ... in it, with plan and log.
        rounds: at the most.
        seed: of the first round; the next one has the next.
        advance: progress callback.

    Raises:
        InputError: no run keeps the limits, or the truth is not a parameter set.
    """
    found: list[Round] = []
    for n in range(rounds):
        plan = plan_next(q, 1, seed + n, advance)
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
        runs = [*q.data, *gather([log], model=q.start)]
        task = begin(runs, prior=q.prior, model=q.start, advance=advance)
        content = file_content(ReportData.of(task.diagnose()))
        found.append(Round(plan, content["verdict"], confidences(content)))
        if found[-1].certain:
            break
        q = replace(q, data=task.train, content=content)
    return found

"""What to run next: the manoeuvre that discriminates the candidates that a diagnosis leaves."""

from .designing import Designer, Limits, ScoredPlan
from .hypotheses import knowledge
from .information import CRITERIA, Knowledge, check_criterion
from .manoeuvre_library import DIMENSIONS, sequence
from .next_plan import Question, plan_next, prepared
from .planned_motion import Basin
from .rehearsal import Rehearsal
from .run_files import scenario_file, write_run
from .run_plan import MOST_RUNS, Plan

__all__ = [
    "CRITERIA",
    "DIMENSIONS",
    "MOST_RUNS",
    "Basin",
    "Designer",
    "Knowledge",
    "Limits",
    "Plan",
    "Question",
    "Rehearsal",
    "ScoredPlan",
    "check_criterion",
    "knowledge",
    "plan_next",
    "prepared",
    "scenario_file",
    "sequence",
    "write_run",
]

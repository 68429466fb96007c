"""What to run next: the manoeuvre that discriminates the candidates that a diagnosis leaves."""

from .designing import Limits
from .next_plan import Question, plan_next
from .plan import Plan, PlannedRun
from .planned_motion import Basin

__all__ = ["Basin", "Limits", "Plan", "PlannedRun", "Question", "plan_next"]

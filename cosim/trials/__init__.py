"""Manoeuvring trials: their measures by the definitions of IMO and ISO, table and picture."""

from typing import TYPE_CHECKING

from ..lazy import lazy_names

if TYPE_CHECKING:
    from .measures import KINDS, MEASURES, measure
    from .ship_passage import Passage, executes, passage
    from .trial_outcome import Outcome, outcome, sheet, simulated_trial
    from .trial_picture import draw_trial

__all__ = [
    "KINDS",
    "MEASURES",
    "Outcome",
    "Passage",
    "draw_trial",
    "executes",
    "measure",
    "outcome",
    "passage",
    "sheet",
    "simulated_trial",
]

__getattr__ = lazy_names(
    __name__,
    {
        "MEASURES": "measures",
        "KINDS": "measures",
        "Outcome": "trial_outcome",
        "Passage": "ship_passage",
        "draw_trial": "trial_picture",
        "executes": "ship_passage",
        "measure": "measures",
        "outcome": "trial_outcome",
        "passage": "ship_passage",
        "sheet": "trial_outcome",
        "simulated_trial": "trial_outcome",
    },
)

"""Results for the report that are made up: no run is learned from."""

from types import SimpleNamespace

import numpy as np

from diagnosis import Model
from diagnosis.report import ReportData
from diagnosis.report.reported_effect import ReportedEffect
from diagnosis.search.findings import Ranked, Suspect

STABILITY = SimpleNamespace(
    nominal_min_dissipation=0.6,
    learned_min_dissipation=np.nan,
    bounded=True,
    region=None,
    mass_definite=True,
    closed_loop=True,
    notes=("a note",),
    driven_on=(),
)


def effect(name, confidence, **others):
    """An effect as the report shows it."""
    made = {
        "axis": "X",
        "coefficients": {},
        "share_of_error": 0.904,
        "indistinguishable": [],
        "advice": "",
        "sentence": f"There is {name}.",
        "equation": f"X = {name}",
        "separation": "",
    }
    return ReportedEffect(name, confidence=confidence, **made | others)


def ranked(name, behind, std=3.14159, **others):
    """A candidate, 10 being the first one's score."""
    return Ranked(
        name, **{"score": 10.0 + behind, "q2": 0.9, "behind": behind, "behind_std": std} | others
    )


def diagnosis(**changes):
    """A diagnosis in which nothing was found."""
    start = Model()
    made = {
        "verdict": "none",
        "calibrated": False,
        "learned": SimpleNamespace(suspects=[], ranking=[], model=start, effects=[]),
        "withdrawn": [],
        "remainder": SimpleNamespace(
            significant=False, beyond_chance=False, axes={}, sentence="Little is left."
        ),
        "unrecorded": SimpleNamespace(stretches=[], sentence="No disturbance."),
        "posterior": SimpleNamespace(names=[], correlation=np.zeros((0, 0)), together=[], std={}),
        "start": start,
        "stability": STABILITY,
        "prior": 0.1,
        "seed": 0,
        "gain": None,
        "refitted": False,
        "measured": False,
    }
    return SimpleNamespace(**made | changes)


def learned(ranking=(), suspects=()):
    """What a method found, as far as the report asks."""
    model, found = Model(), [Suspect(*s) for s in suspects]
    return SimpleNamespace(suspects=found, ranking=list(ranking), model=model, effects=[])


def report_data(comparison, of=None, effects=(), possibilities=(), **derived):
    """The report of a comparison and of a diagnosis with these effects; also what it would derive."""
    r = ReportData(comparison, of, None, ["one.json", "two.html"])
    vars(r).update({"_reported": ([*effects], [*possibilities])} | derived)
    return r

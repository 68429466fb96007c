"""A manoeuvring trial as it was measured, and as models predict it from one state."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim import InputError
from cosim.trials import Passage, executes, measure, passage
from fmus.ship import Ship

from ..predictors.evaluation import Evaluation
from ..runs import Run, Smoothed

NUMBERED = re.compile(r"(overshoot(?:_time)?)_\d+")

# Name -> measured, before, after; of what comes several times a list of these.
TrialErrors = dict[str, Any]


def length_of(ship: Ship) -> float:
    """Length between perpendiculars [m]."""
    assert ship.vessel.outline is not None
    return ship.vessel.outline.length


def order_under_trial(run: Run, ship: Ship) -> np.ndarray:
    """(n,), what was ordered: the angle of rudders or azimuths, where there are none the yaw moment.

    Of several angles the mean; of a stop the surge force.
    """
    if run.trial == "stop":
        return run.tau_cmd[:, 0]
    angles = [k for k, unit in enumerate(ship.commands.values()) if unit == "rad"]
    ordered = run.tau_cmd[:, [2]] if run.commands is None or not angles else run.commands[:, angles]
    return ordered.mean(axis=1)


def measured_passage(smoothed: Smoothed, ship: Ship) -> Passage:
    """The trial that a run is, as it was measured.

    Raises:
        InputError: the order under trial never changes.
    """
    run = smoothed.track.run
    x, y, psi = smoothed.eta.T
    found = passage(smoothed.time, x, y, psi, order_under_trial(run, ship))
    try:
        executes(found)
    except InputError as error:
        raise InputError(f"run '{run.name}': {error}") from None
    return found


def trial_errors(e: Evaluation) -> TrialErrors | None:
    """Measures of a trial: measured, and as two models predict it by the commands that were given.

    All three are from shortly before the first execute on, where the predictions begin; the instants
    at which the order is put over are those of the measurement.

    Returns:
        Name of a measure -> [measured, before, after]; ``overshoot`` and ``overshoot_time`` -> a list of
        these; None in place of what a track does not tell. None for a run that is no trial.
    """
    run, ship = e.weak_windows.run, e.model.ship
    if run.trial is None:
        return None
    whole = measured_passage(e.smoothed, ship)
    begin = executes(whole)[0] - e.smoothed.scale.time  # a second of CyberShip Enterprise 1 before
    time, predicted = e.free_runs(begin)
    rows = (whole.time >= time[0]) & (whole.time <= time[-1])
    seen = Passage(*(column[rows] for column in whole))
    found = [_measures(seen, run.trial, ship)]
    for pose in predicted:
        columns = (pose[:, 0], pose[:, 1], np.unwrap(pose[:, 2]))
        x, y, psi = (np.interp(seen.time, time, column) for column in columns)
        found.append(_measures(Passage(seen.time, x, y, psi, seen.order), run.trial, ship))
    return _together(found)


def _measures(p: Passage, trial: str, ship: Ship) -> Mapping[str, float]:
    """The measures of a track; none of one that runs away."""
    return measure(trial, p, length_of(ship)) if all(np.isfinite(c).all() for c in p) else {}


def _together(found: list[Mapping[str, float]]) -> TrialErrors:
    stated: TrialErrors = {}
    for name in dict.fromkeys(name for each in found for name in each):
        triple = [each.get(name) for each in found]
        if numbered := NUMBERED.fullmatch(name):
            stated.setdefault(numbered[1], []).append(triple)
        else:
            stated[name] = triple
    return stated

"""Test runs decide nothing: with another test run all that is learned and said stays the same to the byte."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.measured import commands, sail

import diagnosis
from diagnosis import Model
from diagnosis.predictors import write_model
from diagnosis.report import diagnosis_content
from diagnosis.report.formatting import as_json

SECONDS = 60.0  # at the size of CyberShip Enterprise 1: a few blocks
DRAG = {"delta_X_absu_u": -6.0}  # for a ship of unit scale
OFF = 0.15  # rad, that the heading is off
# What a test run may change in diagnosis.json: what is told of the runs themselves.
OF_RUNS = {
    "data",
    "runs",
    "errors",
    "windows",
    "where",
    "where_after",
    "sensors",
    "inseparable",
    "test_runs",
}


def measured(seed, vessel=None, thrusters=None, off=0.0):
    """A run of a ship with something hidden."""
    run, _ = sail(SECONDS, 0.1, vessel, thrusters, seed=seed, given=partial(later, seed))
    return replace(run, name=f"run {seed}", pose=run.pose + np.array([0.0, 0.0, off]))


def later(seed, t):
    """Commands over time, others for each seed."""
    return commands(t + 700.0 * seed)


# An actuator with a memory, and the measurement; of a force the next test has what decides.
@pytest.mark.slow
def test_another_test_run_changes_nothing_that_is_learned(tmp_path):
    start, hidden = Model(), ({}, {"lag": 0.8}, OFF)
    train = measured(1, *hidden)
    stated = []
    # Of the same ship, and of one without the effect whose file has the name of the training run.
    for test in (measured(2, *hidden), replace(measured(3), name="run 1")):
        runs = diagnosis.gather([train, test], model=start)
        found = diagnosis.diagnose(runs[:1], runs[1:], 0.1, start)
        write_model(tmp_path / "model.ssv", found.learned.model)
        found.posterior.write(tmp_path / "posterior.json")
        said = json.loads(as_json(diagnosis_content(found, None, [])))
        assert [e["held_out"] for e in said["errors"]] == [False, True]
        files = [(tmp_path / n).read_bytes() for n in ("model.ssv", "posterior.json")]
        stated.append((files, {k: v for k, v in said.items() if k not in OF_RUNS}))
    assert stated[0] == stated[1]


def test_validation_runs_decide_what_is_kept():
    """The same training run: a validation run without the drag rejects it, one with it keeps it."""
    start, runs = Model(), [measured(k, DRAG) for k in (1, 2)]
    other = measured(3)
    train, with_it, without_it = diagnosis.gather([*runs, other], model=start)
    kept, rejected = (
        diagnosis.diagnose([train], (), 0.0, start, validate=[w]) for w in (with_it, without_it)
    )
    assert [f.id for f in kept.learned.effects] == ["X_|u|u"]
    assert "X_|u|u" in [w.id for w in rejected.withdrawn]
    assert [e.use for e in kept.comparison.evaluations] == ["train", "validate"]
    assert not any(e.held_out for e in kept.comparison.evaluations)

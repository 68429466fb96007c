"""Test runs decide nothing: with another test run all that is learned and said stays the same to the byte."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.cases import in_part
from support.measured import commands, sail

import diagnosis
from benchmarks import ship_effects
from diagnosis import Model
from diagnosis.predictors import ship_with, write_model
from diagnosis.report import diagnosis_content
from diagnosis.runs import read_frame

SECONDS = 90.0  # at the size of CyberShip Enterprise 1: a few blocks
# Kind of effect -> parameters of the vessel and of the thrusters, for a ship of unit scale.
HIDDEN = {
    "force": ({"delta_X_absu_u": -6.0}, {}),
    "inertia": ({"mass": 4.0}, {}),
    "actuator": ({}, {"lag": 0.8}),
    "environment": ({"V_n": 0.03, "V_e": -0.04}, {}),
    "measurement": ({}, {}),  # of the pose, below
}
OFF = 0.15  # rad, that the heading of a run with an effect of the measurement is off
# What a test run may change in diagnosis.json: what is told of the runs themselves.
OF_RUNS = {"data", "runs", "errors", "windows", "where", "where_after", "sensors", "inseparable"}


def measured(ship, seed, kind=None):
    """A run of a ship with an effect of some kind; None: with none."""
    vessel, thrusters = HIDDEN[kind] if kind else ({}, {})
    off = OFF if kind == "measurement" else 0.0
    if ship.name == "cse1":
        run, _ = sail(SECONDS, 0.1, vessel, thrusters, seed=seed, given=partial(later, seed))
        return replace(run, name=f"run {seed}", pose=run.pose + np.array([0.0, 0.0, off]))
    cause = ship_effects.Cause("", vessel, thrusters)
    table = ship_effects.sail(ship, cause, np.random.default_rng(seed), None)
    table["psi"] += off
    return replace(read_frame(table, of=ship), name=f"run {seed}")


def later(seed, t):
    """Commands over time, others for each seed."""
    return commands(t + 700.0 * seed)


# Each ship and each kind of effect; what a test run could change depends on no pair of them.
CASES = (
    ("cse1", "force"),
    ("cse1", "measurement"),
    ("otter", "actuator"),
    ("otter", "environment"),
    ("cybership2", "inertia"),
)


@pytest.mark.parametrize(("name", "kind"), in_part(CASES, [("cse1", "force"), ("otter", "actuator")]))
def test_another_test_run_changes_nothing_that_is_learned(tmp_path, monkeypatch, name, kind):
    monkeypatch.setattr(ship_effects, "SECONDS", SECONDS)
    ship = ship_with((), name)
    start = Model(ship=ship)
    train = measured(ship, 1, kind)
    told = []
    # Of the same ship, and of one without the effect whose file has the name of the training run.
    for test in (measured(ship, 2, kind), replace(measured(ship, 3), name="run 1")):
        runs = diagnosis.gather([train, test], model=start)
        found = diagnosis.diagnose(runs[:1], runs[1:], 0.1, start)
        write_model(tmp_path / "model.ssv", found.learned.model)
        found.posterior.write(tmp_path / "posterior.json")
        said = json.loads(diagnosis_content(found, None, []).model_dump_json())
        assert [e["held_out"] for e in said["errors"]] == [False, True]
        files = [(tmp_path / n).read_bytes() for n in ("model.ssv", "posterior.json")]
        told.append((files, {k: v for k, v in said.items() if k not in OF_RUNS}))
    assert told[0] == told[1]


def test_validation_runs_decide_what_is_kept():
    """The same training run: a validation run without the drag rejects it, one with it keeps it."""
    start, runs = Model(), [measured(ship_with((), "cse1"), k, "force") for k in (1, 2)]
    other = measured(ship_with((), "cse1"), 3)
    train, with_it, without_it = diagnosis.gather([*runs, other], model=start)
    kept, rejected = (
        diagnosis.diagnose([train], (), 0.0, start, validate=[w]) for w in (with_it, without_it)
    )
    assert [f.id for f in kept.learned.effects] == ["X_|u|u"]
    assert "X_|u|u" in [w.id for w in rejected.withdrawn]
    assert [e.use for e in kept.comparison.evaluations] == ["train", "validate"]
    assert not any(e.held_out for e in kept.comparison.evaluations)

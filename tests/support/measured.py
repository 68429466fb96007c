"""Measured runs whose truth is known: the ship under open-loop commands, and what a camera saw of it."""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from diagnosis import Model, Run, clean, smooth
from diagnosis.predictors.ship_model import parameters
from diagnosis.predictors.weak_form import modelled_force
from diagnosis.search import method
from fmus.declare import variables
from fmus.signals import Force
from support.ccode import stepped
from support.cse1 import THRUSTERS, VESSEL, Inputs
from support.shared import kept

DATA = Path(os.environ.get("CYBERSHIP_DATA", Path(__file__).parents[3] / "shared" / "data"))
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="no measured runs: CYBERSHIP_DATA names no folder that exists"
)
START = {"psi_0": 3.1}  # soon wraps
# Places in the outputs of the vessel, and in those of the thrusters.
MEASURED, VELOCITY = (
    [[v.name for v in variables(VESSEL.outputs)].index(name) for name in names]
    for names in (("x_m", "y_m", "psi_m"), "uvr")
)
ACTING = slice(6, 9)
NOISE = np.array([5e-4, 5e-4, 9e-4])


def commands(t, quick=0.0):
    """tau [N, N, N m] that turns the ship about and moves it in all directions; quick [N] of it at 0.85 Hz."""
    X = 0.3 + 0.3 * np.sin(0.31 * t) + 0.2 * np.sin(0.83 * t)
    Y = 0.3 * np.sin(0.47 * t + 1.0) + 0.15 * np.sin(1.13 * t)
    N = 0.15 * np.sin(0.39 * t + 2.0) + 0.08 * np.sin(0.97 * t)
    slow = np.column_stack([X, Y, N])
    return slow + quick * np.sin(2.0 * np.pi * 0.85 * t)[:, None] * [1.0, 1.0, 0.3]


def jumps(t):
    """tau [N, N, N m] that is held for seven seconds and jumps."""
    return np.random.default_rng(5).uniform(-1.0, 1.0, (t.size, 3))[(t / 7.0).astype(int)] * [
        0.8,
        0.4,
        0.2,
    ]


def slow_swings(t):
    """tau [N, N, N m] that swings once in two minutes."""
    return np.column_stack(
        [0.5 + 0.3 * np.sin(0.05 * t), 0.1 * np.sin(0.07 * t), 0.1 * np.sin(0.06 * t)]
    )


def sail(
    seconds=64.0,
    h=0.02,
    ship=None,
    thrusters=None,
    noise=1.0,
    seed=1,
    quick=0.0,
    craft=None,
    given=commands,
):
    """A run, and the true nu (n, 3): one sample each h [s], pose in (-pi, pi] with noise.

    ``ship`` and ``thrusters`` are their parameters; ``craft`` is a ship with a user's effects; ``given``
    are the commands over time.
    """
    each = (seconds, h, ship or {}, thrusters or {}, quick)
    made = voyage(*each, craft) if craft else kept(voyage, *each, None, given)
    time, true, nu, tau_cmd = made
    pose = true + noise * NOISE * np.random.default_rng(seed).standard_normal(true.shape)
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    return Run("made", time, pose, tau_cmd), nu


@cache
def _minute():
    return sail(60.0)


def base():
    """A run of a minute, to be varied."""
    return _minute()[0]


def true_nu():
    """Its true velocity (n, 3)."""
    return _minute()[1]


def voyage(seconds, h, ship, thrusters, quick, craft=None, given=commands):
    """Time (n,), pose and nu (n, 3) of the ship under the commands, and these."""
    t = np.arange(round(seconds / h)) * h
    tau_cmd = commands(t, quick) if given is commands else given(t)
    hull, drive = (craft.vessel, craft.thrusters) if craft else (VESSEL, THRUSTERS)
    body = stepped(hull, parameters(hull, START | ship), Force())
    machine = stepped(drive, parameters(drive, thrusters), Inputs())
    poses, nu, before, seen = [], [], 0.0, body.advance([0.0, 0.0, 0.0], 0.0)
    for tau in tau_cmd.tolist():
        poses.append([seen[k] for k in MEASURED])
        nu.append([seen[k] for k in VELOCITY])
        acting = machine.advance([*tau, *nu[-1]], before)[ACTING]
        seen, before = body.advance(acting, h), h
    return t, np.array(poses), np.array(nu), tau_cmd


def smoothed(run):
    """The run judged and smoothed; for tests of what comes after."""
    return kept(_smoothed, run)


def _smoothed(run):
    return smooth(clean(run))


def table_of(run):
    """The run as a table of the usual columns."""
    columns = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
    return pd.DataFrame(np.column_stack([run.time, run.pose, run.tau_cmd]), columns=columns)


def csv_of(run, path):
    """The path of a file with the run."""
    table_of(run).to_csv(path, index=False)
    return path


def changed(run, rows, pose):
    """The run with another pose in some rows."""
    new = run.pose.copy()
    new[rows] = pose
    return replace(run, pose=new)


def learn(data, prior, model=None):
    """What forward selection finds in windows of some runs."""
    return method("selection").fit(data, model or Model(), prior, lambda _: None, 0)


def lacking_at_all_rows(w, model):
    """The model error (K, 3) of a run, evaluated at each row of it."""
    nu = w.motion[1]
    return w.slope @ nu @ model.reference_mass.T - modelled_force(w, model, nu)

"""Measured runs whose truth is known: the ship under open-loop commands, and what a camera saw of it."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis import Run
from diagnosis.prediction import THRUSTERS, parameters
from fmus.signals import Force, Velocity
from fmus.thrusters.chain import Inputs
from fmus.vessel import vessel

DATA = Path(os.environ.get("CYBERSHIP_DATA", Path(__file__).parents[2] / "shared" / "data"))
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="no measured runs: CYBERSHIP_DATA names no folder that exists"
)
START = {"psi_0": 3.1}  # soon wraps
NOISE = np.array([5e-4, 5e-4, 9e-4])


def commands(t):
    """tau [N, N, N m] that turns the ship about and moves it in all directions."""
    X = 0.3 + 0.3 * np.sin(0.31 * t) + 0.2 * np.sin(0.83 * t)
    Y = 0.3 * np.sin(0.47 * t + 1.0) + 0.15 * np.sin(1.13 * t)
    N = 0.15 * np.sin(0.39 * t + 2.0) + 0.08 * np.sin(0.97 * t)
    return np.column_stack([X, Y, N])


def sail(seconds=64.0, h=0.02, ship=None, thrusters=None, noise=1.0, seed=1):
    """A run, and the true nu (n, 3): one sample each h [s], pose in (-pi, pi] with noise."""
    t = np.arange(round(seconds / h)) * h
    asked = commands(t)
    p = parameters(vessel.COMPONENT, START | (ship or {}))
    plan = parameters(THRUSTERS, thrusters or {})
    body, machine = vessel.COMPONENT.prepared(p), THRUSTERS.prepared(plan)
    s, past = vessel.COMPONENT.init(Force(), p), THRUSTERS.init(Inputs(), plan)
    _, seen = vessel.COMPONENT.advance(s, Force(), body, 0.0)
    poses, nu, before = [], [], 0.0
    for tau in asked.tolist():
        poses.append(tuple(seen.measured))
        nu.append((s.u, s.v, s.r))
        inputs = Inputs(Force(*tau), Velocity(s.u, s.v, s.r))
        past, out = THRUSTERS.advance(past, inputs, machine, before)
        s, seen = vessel.COMPONENT.advance(s, Force(*out[3 + 3 :]), body, h)
        before = h
    pose = np.array(poses) + noise * NOISE * np.random.default_rng(seed).standard_normal((t.size, 3))
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    return Run("made", t, pose, asked), np.array(nu)


def changed(run, rows, pose):
    """The run with another pose in some rows."""
    new = run.pose.copy()
    new[rows] = pose
    return replace(run, pose=new)

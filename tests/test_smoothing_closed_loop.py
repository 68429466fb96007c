"""Smoothing of a run whose controller answers the noise of the measurement."""

from dataclasses import replace

import numpy as np
import pytest
from support.ccode import stepped
from support.cse1 import THRUSTERS, VESSEL, Inputs
from support.measured import ACTING, MEASURED, NOISE, START, VELOCITY, commands

from diagnosis import Model, Run, clean, smooth
from diagnosis.predictors.ship_model import parameters
from fmus.signals import Force

STEP, SECONDS = 0.05, 100.0
DAMPED = np.array([16.0, 16.0, 2.0])  # N s/m, N s/m, N m s/rad, gains of the controller
FILTER = 1.0  # s, of the noisy pose, by whose slope the controller damps
ERROR = 1.1  # 1, factor of the mass of the plant


@pytest.fixture(scope="module")
def run_and_velocity():
    """A run of a ship that is a tenth heavier than described, and its velocity."""
    time = np.arange(round(SECONDS / STEP)) * STEP
    wanted = commands(time)
    heavier = {"m": ERROR * Model().value("m")}
    body = stepped(VESSEL, parameters(VESSEL, START | heavier), Force())
    machine = stepped(THRUSTERS, parameters(THRUSTERS, {}), Inputs())
    rng, seen = np.random.default_rng(4), body.advance([0.0, 0.0, 0.0], 0.0)
    filtered, poses, taus, velocities = None, [], [], []
    for open_loop in wanted:
        pose = np.array([seen[k] for k in MEASURED]) + 4.0 * NOISE * rng.standard_normal(3)
        filtered = pose if filtered is None else filtered
        off = pose - filtered
        off[2] = np.angle(np.exp(1j * off[2]))
        slope = off / FILTER
        filtered = filtered + STEP * slope
        c, s = np.cos(pose[2]), np.sin(pose[2])
        body_slope = np.array([c * slope[0] + s * slope[1], c * slope[1] - s * slope[0], slope[2]])
        tau = open_loop - DAMPED * body_slope
        velocities.append([seen[k] for k in VELOCITY])
        poses.append(pose)
        taus.append(tau)
        force = machine.advance([*tau.tolist(), *velocities[-1]], STEP)[ACTING]
        seen = body.advance(force, STEP)
    return Run("loop", time, np.array(poses), np.array(taus)), np.array(velocities)


def test_quick_commands_accelerate_the_described_inertia(run_and_velocity):
    """Gains that are fitted, as where commands are in another unit, mistake noise for their effect."""
    run, nu = run_and_velocity
    inner = slice(100, -100)
    described, fitted = (smooth(clean(replace(run, tau_cmd=u * run.tau_cmd))) for u in (1.0, 1e3))
    off, other = ((s.nu - nu)[inner] for s in (described, fitted))
    assert (np.mean((off / described.nu_std[inner]) ** 2, axis=0) < 1.3).all()
    assert (
        np.sqrt(np.mean(off**2, axis=0)) < [0.95, 0.7, 0.7] * np.sqrt(np.mean(other**2, axis=0))
    ).all()

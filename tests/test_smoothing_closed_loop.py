"""Smoothing of runs under control: commands answer the noise of the measurement, and gains are described.

The property is that of the model error of the true model: in units of its standard deviation it is not
larger than one. What a smoother leaves out of the motion would be a force that no ship has.
"""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import cosim
import diagnosis
from benchmarks.hidden_effects.simulated_runs import MEASURED
from cosim.scenario import find_scenario
from diagnosis import Model, omega, smooth
from diagnosis.predictors.uncertainty import omega_std
from diagnosis.runs.prepared_run import prepare
from diagnosis.runs.smoothing import command_response, smoother
from diagnosis.runs.smoothing.command_motion import Commands
from diagnosis.runs.smoothing.command_regression import described_gains
from diagnosis.runs.smoothing.spline import knots
from fmus.hull import inertia_force
from fmus.ship import ship

NOISE = {"kind": "noise", "signals": MEASURED, "std": [0.002, 0.002, 0.0035]}  # m, m, rad


@cache
def under_control(seed, **thrusters):
    """A run of 100 s on an ellipse, the controller of which knows the noisy measurement alone."""
    content = json.loads(find_scenario("ellipse").read_text(encoding="utf-8"))
    content |= {"stop": 100.0, "metrics": {}, "faults": [NOISE]}
    content["fmus"]["thrusters"]["parameters"] = thrusters
    with TemporaryDirectory() as folder:
        cosim.simulate(content, Path(folder) / "run", seed=seed, log="compact", pictures=False)
        return diagnosis.read(Path(folder) / "run")


def chi_squares(run, **true):
    """(3,), mean square of the model error of the true model, in units of its standard deviation."""
    (w,), model = diagnosis.gather([run]), Model().plus(true)
    return np.mean((omega(w, model) / omega_std(w, model)) ** 2, axis=0)


def without_description(monkeypatch):
    """Let gains be fitted in any case."""
    monkeypatch.setattr(command_response, "described_gains", lambda commands: None)
    monkeypatch.setattr(command_response, "explained_late", lambda prompt, *others: prompt)


def test_under_control_the_true_model_leaves_what_the_noise_explains():
    assert (chi_squares(under_control(1)) < 1.0).all()


@pytest.mark.parametrize("late", [{"delay": 0.3}, {"lag": 0.4}])
def test_commands_that_act_late_are_smoothed_as_such(late):
    """Taken for prompt ones, they shifted the motion to the front, and a delay was found too short."""
    run = under_control(4, **late)
    assert (chi_squares(run, **late) < 1.0).all()
    assert (chi_squares(run) > 3.0).all()


def test_fitted_gains_under_control_are_too_small(monkeypatch):
    """With them the true model leaves a force in sway and in yaw, which the cure is for."""
    without_description(monkeypatch)
    assert (chi_squares(under_control(3))[1:] > 1.2).all()


def test_described_gains_are_the_inverse_mass_of_the_ship():
    of = ship(description=under_control(1).ship)
    commands = Commands(
        prepare(under_control(1)).track, np.zeros(0), knots(np.zeros(1), np.ones(1), 0.5)
    )
    np.testing.assert_allclose(described_gains(commands) @ of.mass, np.eye(3), atol=1e-12)
    hull = of.vessel.prepared(of.vessel.params()).hull.inertia
    force = inertia_force(0.1, -0.2, 0.3, hull)
    np.testing.assert_allclose(of.mass @ [0.1, -0.2, 0.3], force)


def test_a_description_of_another_ship_gives_way_to_fitted_gains(monkeypatch):
    """Forces six times as large as those that act are smoothed as the true ones by fitted gains."""
    run = replace(under_control(1), commands=None, signals=())
    strong = smooth(prepare(replace(run, tau_cmd=6.0 * run.tau_cmd)).track)
    without_description(monkeypatch)
    fitted = smooth(prepare(run).track)
    np.testing.assert_allclose(strong.nu, fitted.nu, atol=1e-6)


@pytest.mark.parametrize("described", [True, False])
def test_beside_described_gains_the_way_bends(described, monkeypatch):
    """The spline is stiffer there: without the bend, the sway of an Otter that turns was smoothed away."""
    asked = []
    monkeypatch.setattr(smoother, "with_bend", lambda *given: asked.append(given) or given[-1])
    if not described:
        without_description(monkeypatch)
    smooth(prepare(under_control(1)).track)
    assert bool(asked) == described

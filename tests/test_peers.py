"""Established methods beside ours: the windows are the project's, and what is held out stays held out."""

import json
from dataclasses import asdict, replace
from functools import cache
from importlib import import_module

import numpy as np
import pytest
from support.cse1 import THREE
from support.measured import sail

import diagnosis
from benchmarks.peers import __main__ as peers
from benchmarks.peers.chosen_settings import Answer, Method, answer
from benchmarks.peers.same_windows import Continuous, Held, Nominal, moved, table
from diagnosis import Model, Run
from diagnosis.predictors.thrust import commanded_shares

LENGTH = 8.0
DAMPED = np.array([[-0.2, 0.0, 0.0], [0.0, -0.3, 0.05], [0.0, 0.1, -0.5]])
PUSHED = np.array([[0.05, 0.0, 0.0], [0.0, 0.03, 0.01], [0.0, 0.02, 0.2]])


def linear(nu, given):
    return nu @ DAMPED.T + given @ PUSHED.T


class Ignorant:
    """Knows of no force, and takes commands for forces."""

    def inputs(self, kind, nu, given):
        return given

    def acceleration(self, nu, given):
        return np.zeros_like(nu)


@cache
def toy(seed):
    """A smoothed run of a ship that is linear."""
    h, rng = 0.05, np.random.default_rng(seed)
    time = np.arange(0.0, 48.0, h)
    omega, phase = rng.uniform(0.2, 1.5, (3, 4)), rng.uniform(0.0, 6.3, (3, 4))
    given = 0.4 * np.sin(omega * time[:, None, None] + phase).sum(axis=2)
    law, nu, eta = Continuous(linear, h), np.zeros((1, 3)), np.zeros((1, 3))
    poses = []
    for c in given:
        poses.append(eta[0])
        after = law.step(nu[None], c[None, None])
        nu, eta = after, moved(eta, 0.5 * (nu + after), h)
    pose = np.array(poses) + rng.normal(0.0, 1e-4, (time.size, 3))
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    run = Run(f"toy{seed}", time, pose, given, commands=given, signals=THREE)
    return diagnosis.smooth(diagnosis.clean(run))


def steady_error():
    return Held([toy(3)], LENGTH).errors(Continuous(lambda nu, given: 0.0 * nu, 0.1))


def test_nominal_model_misses_by_what_the_project_says():
    run, _ = sail(32.0, h=0.05)
    run = replace(run, commands=commanded_shares(run, Model()), signals=THREE)
    smoothed = diagnosis.smooth(diagnosis.clean(run))
    wrong = Model(vessel={"X_u": -2.0, "N_r": -0.5})
    expected = diagnosis.Windows([smoothed], LENGTH).errors(wrong).over_all()
    law = Continuous(Nominal(wrong, run.commands).acceleration, 0.05)
    assert Held([smoothed], LENGTH).errors(law) == pytest.approx(expected, rel=0.01)


def test_law_that_is_true_predicts_and_one_that_is_not_does_not():
    held = Held([toy(3)], LENGTH)
    assert held.errors(Continuous(linear, 0.05)) < (0.01, 0.02)
    assert min(steady_error()) > 0.05


def test_diverging_law_is_worse_than_any():
    law = Continuous(lambda nu, given: 1e9 * nu, 0.1)
    position, heading = Held([toy(3)], LENGTH).errors(law)
    assert position > 1e3
    assert heading > 0.5


def test_table_has_the_motion_of_the_run():
    t = table(toy(1), 0.2)
    (part,) = t.parts
    assert t.nu_dot[part] == pytest.approx(linear(t.nu, t.given)[part], abs=0.05)


@pytest.mark.parametrize(
    ("name", "package", "setting"),
    [
        ("narx", "sysidentpy", {"inputs": "commands", "h": 0.2, "lags": 2, "degree": 1}),
        (
            "sindy",
            "pysindy",
            {
                "inputs": "commands",
                "delay": 0.0,
                "library": "linear",
                "threshold": 0.0,
                "derivative": "own",
            },
        ),
        (
            "kalman_regression",
            "numpy",
            {"inputs": "commands", "delay": 0.0, "terms": "linear", "process": 0.1},
        ),
        ("neural", "sklearn", {"inputs": "commands", "delay": 0.0, "hidden": (16,), "alpha": 1e-4}),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_method_predicts_a_linear_ship(name, package, setting):
    pytest.importorskip(package, reason=f"not in the extra dev: {package}")
    law = import_module(f"benchmarks.peers.{name}").fit([toy(1), toy(2)], Ignorant(), **setting)
    errors = Held([toy(3)], LENGTH).errors(law)
    assert np.divide(errors, steady_error()).max() < (0.6 if name == "neural" else 0.1)


@pytest.mark.parametrize("library", ["linear", "drag", "cubic"])
def test_columns_are_those_of_the_library(library):
    sindy = pytest.importorskip("benchmarks.peers.sindy")
    x = np.random.default_rng(1).normal(size=(20, 5))
    theirs = sindy.functions(library).fit(x).transform(x)
    assert sindy.columns(library, x) == pytest.approx(np.asarray(theirs))


def test_held_out_runs_reach_no_fit_and_no_choice():
    seen = []

    def fit(runs, nominal, slower):
        seen.append({r.track.run.name for r in runs})
        return Continuous(lambda nu, given: slower * linear(nu, given), 0.1)

    def ask(left_out):
        method = Method("spy", fit, {"slower": (0.0, 1.0, 0.5)}, fit)
        reference = Continuous(lambda nu, given: 0.0 * nu, 0.1)
        return answer(method, [toy(1), toy(2)], [left_out], Ignorant(), LENGTH, reference)

    told = ask(toy(3))
    assert told.setting == {"slower": 1.0}
    assert {"toy1", "toy2"} in seen
    assert not any("toy3" in names for names in seen)
    backwards = replace(toy(3), eta_dot=-toy(3).eta_dot, nu=-toy(3).nu)
    other = ask(backwards)
    assert other.setting == told.setting
    assert other.position > told.position


def test_what_is_not_installed_is_told_in_one_line(monkeypatch, capsys):
    def missing(name, package):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(peers, "import_module", missing)
    assert [name for name, _ in peers.methods(["steady", "narx", "sindy"], Ignorant())] == ["steady"]
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("not installed, left out: narx (sysidentpy), sindy (pysindy)")


def test_table_compares_with_the_nominal_model(tmp_path):
    for name, errors in {"nominal": (0.4, 0.2), "learn": (0.1, 0.4), "sindy": (0.3, 0.3)}.items():
        kept = {run: asdict(Answer(*errors, 2.0, {})) for run in ("a", "b")[: 1 + (name != "sindy")]}
        (tmp_path / f"{name}.json").write_text(json.dumps(kept))
    found = {name: cells for name, *cells in peers.rows(tmp_path, ["a", "b"])}
    assert found["learn"] == ["100 mm, 22.9°", "100 mm, 22.9°", "4.00x", "0.50x", "2"]
    assert found["sindy"] == ["300 mm, 17.2°", "–", "–", "–", "2"]
    assert "| learn | 100 mm, 22.9°" in peers.write(tmp_path, ["a", "b"]).read_text()

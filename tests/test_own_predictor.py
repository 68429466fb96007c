"""Predictors that are no FMU: a Python function in a file, as docs/foreign_models.md has it, and a class."""

import json
import re

import numpy as np
import pytest
from support.command import command
from support.measured import csv_of, sail
from support.project import ROOT

import diagnosis
from cosim import InputError
from diagnosis import Model, PythonFunction, learn
from diagnosis.predictors import ModelSource, black_box, open_model
from diagnosis.predictors.black_box import commanded, commands_at
from fmus.signals import Force
from fmus.vessel import vessel

DAMPER = {"delta_X_u": -2.0}


def example(page, contains):
    """The block of Python of a page that contains a text."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text("utf-8"), re.DOTALL)
    (found,) = [block for block in blocks if contains in block]
    return found


def equations(extra=0.0):
    """The nominal equations of the hull, with a further linear damping in surge [N.s/m]."""
    hull = Model().hull.hull

    def acceleration(state, commands):
        X, Y, N = (commands[f"tau_{axis}"] for axis in "XYN")
        return vessel.nominal(state, Force(X + extra * state.u, Y, N), hull)

    return acceleration


@pytest.fixture(scope="module")
def runs():
    return diagnosis.gather([sail(40.0)[0]])


@pytest.fixture(scope="module")
def plain(runs):
    return diagnosis.evaluate(runs)


def error(comparison):
    (e,) = comparison.evaluations
    return e.before


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "my_model.py"
    path.write_text(example("docs/foreign_models.md", "def acceleration"))
    return path


def test_a_function_of_the_nominal_equations_predicts_as_the_described_ship(file):
    """Both integrate with the same steps: residuals differ by rounding, forces by finite differences.

    The forces of both are evaluated at the same rows: those of a run at 10 Hz.
    """
    runs = diagnosis.gather([sail(40.0, h=0.1)[0]])
    plain = diagnosis.evaluate(runs)
    for model in (PythonFunction(equations()), file):
        found = diagnosis.compare(runs, model=model)
        assert error(found).residuals == pytest.approx(error(plain).residuals, abs=1e-9)
        assert np.abs(error(found).omega - error(plain).omega).max() < 1e-9
        assert found.before.sentences == plain.before.sentences
        assert found.predictor.model.mass == pytest.approx(Model().mass)


def test_a_wrong_term_is_the_force_that_the_function_lacks(runs, plain):
    found = diagnosis.compare(runs, model=PythonFunction(equations(-2.0)))
    (w,) = runs
    missing = w.smooth @ np.where(w.known, w.smoothed.nu[:, 0], 0.0)
    assert error(found).omega[:, 0] - error(plain).omega[:, 0] == pytest.approx(2.0 * missing, abs=1e-3)
    assert error(found).position > 5.0 * error(plain).position
    same = diagnosis.evaluate(runs, Model().plus(DAMPER))
    assert error(found).residuals == pytest.approx(error(same).residuals, abs=1e-9)


@pytest.mark.slow
def test_a_wrong_term_of_a_function_is_learned(tmp_path, file):
    """The ship has a damper that the function lacks, by the command."""
    for k, seconds in enumerate((48.0, 24.0)):
        csv_of(sail(seconds, 0.1, ship=DAMPER, seed=k)[0], tmp_path / f"{k}.csv")
    given = ("0.csv", "--test", "1.csv", "--model", file, "--prior", 0, "--out", "out")
    done = command(learn.main, *given, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    (effect,) = content["effects"]
    assert effect["coefficients"]["delta_X_u"]["value"] == pytest.approx(-2.0, rel=0.1)
    held_out = content["errors"][1]["window_position_rmse"]
    assert held_out["after"] < 0.1 * held_out["before"]
    assert not {"model.ssv", "posterior.json", "found.fmu", "map.json"} & {*content["files"]}


def test_the_command_takes_a_file_and_says_how_it_predicts(tmp_path, file):
    csv_of(sail(40.0)[0], tmp_path / "run.csv")
    given = ("run.csv", "--model", file, "--out", "out")
    done = command(diagnosis.compare.main, *given, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert content["fmu"]["kind"] == "Python function"
    assert content["fmu"]["name"] == "my_model.py"
    assert "Predictions of the Python function" in done.stdout
    assert {p.name for p in (tmp_path / "out").iterdir()} == {*content["files"]}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("def other(): pass", "has no function acceleration"),
        ("def acceleration(state): pass", "has no function acceleration"),
        ("1 / 0", "fails when imported"),
        ("def acceleration(state, commands):\n    return 0.0, 0.0", "must return u_dot, v_dot, r_dot"),
        ("def acceleration(state, commands):\n    return commands['rudder'], 0, 0", "fails: KeyError"),
        ("def acceleration(state, commands):\n    return [0.0, 0.0], 0.0, 0.0", "fails: ValueError"),
        (
            "def acceleration(state, commands):\n    return state.u * float('nan'), 0.0, 0.0",
            "'bad.py' gives the accelerations nan, 0, 0 in a measured state: u = ",
        ),
    ],
)
def test_a_function_that_is_none_is_refused_in_one_line(runs, tmp_path, content, message):
    path = tmp_path / "bad.py"
    path.write_text(content)
    with pytest.raises(InputError, match=re.escape(message)) as refused:
        diagnosis.evaluate(runs, path)
    assert "\n" not in str(refused.value)


def test_a_map_is_of_fmus_only(file):
    with pytest.raises(InputError, match="--map belongs to an FMU"):
        open_model(file, file)


def test_commands_at_some_times_cost_what_these_times_cost(runs, monkeypatch):
    run = runs[0].run
    every, rows = commanded(run), np.array([0, 7, 40])
    sizes = []
    monkeypatch.setattr(
        black_box.np, "hypot", lambda x, y: sizes.append(x.size) or np.sqrt(x * x + y * y)
    )
    found = commands_at(run, run.time[rows])
    assert sizes == [rows.size]
    assert found.keys() == every.keys()
    for name, values in found.items():
        np.testing.assert_allclose(values, every[name][rows], rtol=1e-12)


def test_a_function_that_runs_away_has_infinite_errors(runs):
    def acceleration(state, commands):
        return 100.0 * state.u**3 + 1.0, 0.0, 0.0

    found = error(diagnosis.evaluate(runs, PythonFunction(acceleration)))
    assert not np.isfinite(found.position)


def test_a_class_with_motion_and_accelerations_is_a_predictor(runs, plain):
    """That of the page; what it lacks is all that moves the ship."""
    names = {}
    exec(example("docs/own_effects.md", "class Adrift"), names)
    source = names["Adrift"]()
    assert isinstance(source, ModelSource)
    found = diagnosis.compare(runs, model=source)
    assert error(found).position > 10.0 * error(plain).position
    (w,) = runs
    expected = w.slope @ np.where(w.known[:, None], w.smoothed.nu, 0.0) @ Model().mass.T
    assert error(found).omega == pytest.approx(expected, abs=5e-3)  # commands change within a sample
    with pytest.deprecated_call():
        assert found.use is found.predictor

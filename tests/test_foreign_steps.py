"""FMUs on their own terms: steps of one length, outputs that come late, starts between samples."""

import json
import re
from functools import partial
from types import SimpleNamespace
from zipfile import ZipFile

import numpy as np
import pytest
from support.foreign import needs_compiler
from support.measured import csv_of, sail

import diagnosis
from cosim import InputError
from diagnosis import Fmu, Run
from diagnosis.predictors.black_box import BlackBox
from diagnosis.predictors.fmu.fmu_playback import Playback
from diagnosis.predictors.predictor import Execution
from fmus.build import build, native_targets

pytestmark = needs_compiler

# It turns at a rate, from a heading and at a speed that are parameters; outputs may come a step late.
TURNING = '''
"""A ship that turns."""

from typing import Annotated, NamedTuple

from fmus.declare import FIXED, Component
from fmus.ops import cos, sin


class Params(NamedTuple):
    x_0: Annotated[float, "m", "place at first", FIXED] = 0.0
    y_0: Annotated[float, "m", "place at first", FIXED] = 0.0
    psi_0: Annotated[float, "rad", "heading at first", FIXED] = 0.0
    u_0: Annotated[float, "m/s", "speed at first", FIXED] = SPEED
    v_0: Annotated[float, "m/s", "speed at first", FIXED] = 0.0
    r_0: Annotated[float, "rad/s", "rate of turn at first", FIXED] = RATE


class Inputs(NamedTuple):
    tau_X: Annotated[float, "N", "force ahead"] = 0.0
    tau_N: Annotated[float, "N.m", "moment"] = 0.0


class State(NamedTuple):
    x: float
    y: float
    psi: float
    u: float
    r: float


class Outputs(NamedTuple):
    x: Annotated[float, "m", "place"] = 0.0
    y: Annotated[float, "m", "place"] = 0.0
    psi: Annotated[float, "rad", "heading"] = 0.0
    u: Annotated[float, "m/s", "speed"] = 0.0
    v: Annotated[float, "m/s", "speed"] = 0.0
    r: Annotated[float, "rad/s", "rate of turn"] = 0.0


def init(i, p):
    return State(p.x_0, p.y_0, p.psi_0, p.u_0, p.r_0)


def step(s, i, p, h):
    r = s.r + 1e-9 * i.tau_N * h
    u = s.u + 1e-9 * i.tau_X * h
    psi = s.psi + r * h
    middle = 0.5 * (s.psi + psi)
    after = State(s.x + u * cos(middle) * h, s.y + u * sin(middle) * h, psi, u, r)
    return after, Outputs(after.x, after.y, psi, u, 0.0, r)


COMPONENT = Component(
    name="turning", description="A ship", params=Params, state=State, inputs=Inputs, outputs=Outputs,
    init=init, step=step, sampled=SAMPLED, max_step=1.0,
)
'''
SPEED, RATE = 0.3, 0.06


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The ship whose outputs follow its start values at once, and one whose outputs are zero until then."""
    folder = tmp_path_factory.mktemp("turning")
    source = TURNING.replace("SPEED", str(SPEED)).replace("RATE", str(RATE))
    (folder / "turning.py").write_text(source.replace("SAMPLED", "False"))
    build([str(folder / "turning.py")], folder, native=native_targets())
    return folder / "turning.fmu"


def described(fmu, path, *changes, without=()):
    """A copy of an FMU with another description."""
    with ZipFile(fmu) as given, ZipFile(path, "w") as copy:
        for name in given.namelist():
            content = given.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                for old, new in changes:
                    text, count = re.subn(old, new, text, count=1, flags=re.S)
                    assert count, old
                content = text.encode()
            copy.writestr(name, content)
    return path


def turned(period, seconds=100.0, offset=0.0, noise=1e-3):
    """A run along which the true ship turns; the first sample is some time after its start."""
    t = offset + period * np.arange(round(seconds / period))
    psi, radius, rng = RATE * t, SPEED / RATE, np.random.default_rng(1)
    pose = np.column_stack([radius * np.sin(psi), radius * (1.0 - np.cos(psi)), psi])
    pose += noise * rng.standard_normal(pose.shape)
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    push = np.column_stack([np.sin(t), 0.0 * t, 0.1 * np.sin(0.3 * t)])
    return Run("turned", t - offset, pose, push)


def loaded(run):
    return diagnosis.gather([run], anyway=True)


def error(found):
    """RMS of position [m] and heading [rad]."""
    (e,) = found.evaluations
    return e.before.position, e.before.heading


def map_of(path, **content):
    path.write_text(json.dumps(content))
    return path


WHOLE = {"inputs": {"tau_X": "tau_X", "tau_N": "tau_N"}, "outputs": {n: n for n in ("x", "y", "psi")}}


SLOW = [pytest.param(run_in, marks=pytest.mark.slow) for run_in in (20.0, 20.5, 20.9)]


@pytest.mark.parametrize("run_in", [20.3, *SLOW])
def test_a_run_in_between_samples_lays_the_prediction_on_the_sample_at_its_time(made, tmp_path, run_in):
    """At 1 Hz and 3.4 deg/s half a sample is 1.7 deg; what is left is the noise of the pose."""
    model = Fmu(made, map_of(tmp_path / "map.json", **WHOLE, run_in=run_in))
    found = diagnosis.evaluate(loaded(turned(1.0)), model)
    (e,) = found.evaluations
    assert found.predictor.whole
    assert e.windows.since[0] == np.ceil(run_in)
    assert np.degrees(error(found)[1]) < 0.2
    assert error(found)[0] < 0.02


@pytest.mark.slow
def test_a_free_run_begins_at_a_sample_too(made, tmp_path):
    model = Fmu(made, map_of(tmp_path / "map.json", **WHOLE, run_in=0.0))
    runs = loaded(turned(1.0))
    (e,) = diagnosis.evaluate(runs, model).evaluations
    time, (pose, _) = e.free_runs(begin=31.4)
    true = RATE * time
    assert time[0] >= 31.0
    assert np.degrees(np.abs(np.angle(np.exp(1j * (pose[:, 2] - true)))).max()) < 0.2


FIXED_STEP = [
    (r'canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"'),
    (r"<DefaultExperiment[^>]*>", '<DefaultExperiment stepSize="0.25"/>'),
]


def steps_of(fmu, tmp_path, **options):
    """The lengths of the steps that an FMU is asked for while it is evaluated, and the result."""
    asked = set()
    run = Playback._run

    def counted(self, prediction):
        asked.add(prediction.h)
        return run(self, prediction)

    patch = pytest.MonkeyPatch()
    patch.setattr(Playback, "_run", counted)
    try:
        model = Fmu(fmu, execution=Execution(**options))
        return asked, diagnosis.evaluate(loaded(turned(0.1, 60.0)), model)
    finally:
        patch.undo()


def test_a_step_over_which_no_error_is_known_is_refused(made):
    runs = loaded(turned(0.1, 60.0))
    with pytest.raises(InputError, match=r"'turning.fmu' has a step of 3.5 s; allowed is at most 3 s"):
        Fmu(made, execution=Execution(step=3.5)).begun_on(runs)
    assert Fmu(made, execution=Execution(step=3.0)).begun_on(runs)


@pytest.mark.slow
def test_an_fmu_of_fixed_step_takes_no_other(made, tmp_path):
    fixed = described(made, tmp_path / "fixed.fmu", *FIXED_STEP)
    asked, found = steps_of(fixed, tmp_path)
    assert asked == {0.25}
    assert any("is stepped every 0.25 s" in s for s in found.predictor.description().sentences)
    free, at_once = steps_of(made, tmp_path)
    assert 0.25 not in free
    assert error(found) == pytest.approx(error(at_once), rel=0.02)


def test_step_sets_the_step(made, tmp_path):
    asked, _ = steps_of(made, tmp_path, step=0.125)
    assert asked == {0.125}


@pytest.mark.slow
def test_what_needs_a_tool_and_what_confines_it_is_said(made, tmp_path):
    change = ('needsExecutionTool="false"', 'needsExecutionTool="true"')
    needs = described(made, tmp_path / "needs.fmu", change)
    _, found = steps_of(needs, tmp_path)
    stated = found.predictor.description()
    assert any("needsExecutionTool" in s for s in stated.sentences)
    assert stated.confinement == found.predictor.confinement
    assert "own process in an empty folder" in stated.confinement
    _, free = steps_of(made, tmp_path, confined=False)
    assert free.predictor.confinement.startswith("unconfined: ")


@pytest.mark.slow
def test_a_first_sample_that_is_an_outlier_leaves_its_window(made, tmp_path):
    run = turned(0.1, 20.0)
    run.pose[0, :2] += 50.0
    for given in ({}, {"run_in": 0.0}):
        content = given and {**WHOLE, **given}
        model = Fmu(made, map_of(tmp_path / "map.json", **content) if content else None)
        (e,) = diagnosis.evaluate(loaded(run), model).evaluations
        assert e.windows is not None
        assert e.before.position < 0.1
    short = turned(0.1, 9.0)
    short.pose[0, :2] += 50.0
    (e,) = diagnosis.evaluate(loaded(short), made).evaluations
    assert e.windows is not None


@pytest.mark.slow
def test_outputs_that_are_zero_until_the_first_step_are_told_and_left_out(made, tmp_path, monkeypatch):
    """As of an FMU that computes its outputs in its steps only; the right model is not condemned."""
    run_of = Playback._run

    def late(self, prediction):
        found = run_of(self, prediction)
        found.outputs[0] = 0.0
        return found

    monkeypatch.setattr(Playback, "_run", late)
    run = turned(0.1, 60.0, offset=200.0)
    found = diagnosis.evaluate(loaded(run), made)
    (e,) = found.evaluations
    assert {"x", "u"} <= {*found.predictor.late}
    assert any("zero until the first step" in s for s in found.predictor.description().sentences)
    assert e.windows.since.min() > 0.0
    monkeypatch.undo()
    at_once = diagnosis.evaluate(loaded(run), made)
    assert at_once.predictor.late == []
    assert error(found) == pytest.approx(error(at_once), rel=0.05)
    omega = [c.evaluations[0].before.omega for c in (found, at_once)]
    assert np.abs(omega[0] - omega[1]).max() < 1e-3


def test_a_hang_is_one_line_that_names_the_run(made, tmp_path):
    stages = "failed on run 'turned'|cannot be set to a measured state"  # whichever call comes first
    with pytest.raises(InputError, match=rf"({stages}): .* took longer than 1e-06 s"):
        steps_of(made, tmp_path, timeout=1e-6)


def test_the_length_of_the_ship_is_stated(made, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    csv_of(sail(20.0)[0], "run.csv")
    assert diagnosis.compare.main(["run.csv", "--model", str(made), "--out", "out"]) == 0
    assert "a ship of 1.105 m" in " ".join(capsys.readouterr().out.split())


def test_a_run_that_is_not_of_the_default_ship_asks_for_the_ship(made, tmp_path, capsys, monkeypatch):
    """Its forces are far beyond those of a ship of 1.105 m."""
    monkeypatch.chdir(tmp_path)
    t = 0.5 * np.arange(240)
    psi, speed = 0.3 * np.sin(0.05 * t), 7.5
    x, y = (0.5 * speed * np.cumsum(f(psi)) for f in (np.cos, np.sin))
    table = np.column_stack([t, x, y, psi, np.full(t.size, 1e5), 0.0 * t, 1e4 * np.cos(0.05 * t)])
    header = "time,x,y,psi,tau_X,tau_Y,tau_N"
    np.savetxt("run.csv", table, delimiter=",", header=header, comments="")
    assert diagnosis.compare.main(["run.csv", "--model", str(made), "--out", "out"]) == 2
    stated = " ".join(capsys.readouterr().err.split())
    assert "of 1.105 m? --ship NAME|FILE.toml selects it" in stated
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("wait", [0.0, 2.0])
def test_a_whole_run_is_laid_on_the_sample_at_the_end_of_its_run_in(wait):
    """A straight track from the origin at 1 m/s, turned to the heading that is measured there."""
    h, time = 0.1, 10.0 + 0.1 * np.arange(200)
    eta = np.column_stack([3.0 + 0.7 * (time - 10.0), -2.0 + 0.0 * time, 0.4 + 0.01 * (time - 10.0)])
    motion = np.zeros((41, 6, 2))
    motion[:, 0], motion[:, 3] = h * np.arange(41.0)[:, None], 1.0
    box = SimpleNamespace(placed=True, run_in=lambda _: wait, motion=lambda *_: motion)
    box._placed_at = partial(BlackBox._placed_at, box)
    runs = [(SimpleNamespace(time=time, eta=eta), np.array([0, 50]))]
    found = BlackBox._poses(box, SimpleNamespace(h=h, steps=40, runs=runs))
    assert found.shape == (41, 3, 1, 2)
    for k, row in enumerate((0, 50)):
        x, y, psi = eta[row + round(wait / h)]
        along = h * np.arange(41.0) - wait
        expected = np.column_stack([x + along * np.cos(psi), y + along * np.sin(psi), psi + 0.0 * along])
        assert found[:, :, 0, k] == pytest.approx(expected, abs=1e-9)

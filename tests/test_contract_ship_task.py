"""The windows and inputs by which the FMU of a ship is calibrated, from runs that are given."""

from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from diagnosis.fmu_parameters import parameter_file, ship_task
from diagnosis.fmu_parameters.ship_task import ShipTask
from diagnosis.predictors.black_box import MOTION, POSE
from diagnosis.predictors.fmu.variable_map import DISTURBANCES

PERIOD = 0.25
LINES = {"x": (2.0, 0.1), "y": (1.0, 0.0), "psi": (-1.0, 0.5)}  # measured = gain times output + offset


def line(gain, offset=0.0):
    return SimpleNamespace(gain=gain, offset=offset)


def cause(name):
    return SimpleNamespace(name=name)


def measured(name="a", rows=161, tau=(1.0, 2.0, 0.5)):
    """A run of 40 s, in which a few samples are not used."""
    time = 5.0 + PERIOD * np.arange(rows)
    eta = np.column_stack([np.arange(rows), 2.0 * np.arange(rows), 0.01 * np.arange(rows)])
    run = SimpleNamespace(
        name=name, time=time, tau_cmd=np.outer(np.where(np.arange(rows) % 2, 1.0, -1.0), tau)
    )
    track = SimpleNamespace(run=run, period=PERIOD, pose=eta + 0.5)
    used = np.ones(rows, bool)
    used[7] = False
    nu = np.ones((rows, 3))
    nu[:3] = np.nan
    smoothed = SimpleNamespace(
        time=time, eta=eta, nu=nu, eta_std=0.1 + 0.01 * eta, nu_std=0.2 + 0.0 * eta, used=used, track=track,
        noise=np.array([0.1, 0.2, 0.3]), scale=SimpleNamespace(time=12.5),  # steps of a quarter of a second
    )  # fmt: skip
    return SimpleNamespace(run=run, smoothed=smoothed, horizon=8.0)


class Predictor:
    """How an FMU and its map are read: x, y, psi and u are seen, and a force and a disturbance taken."""

    def __init__(self, inputs=("tau_X", "tau_N"), disturbances=("tau_Y",), whole=False, placed=False):
        self.whole, self.placed, self.asked = whole, placed, []
        stated = {
            "inputs": {s: cause(f"in.{s}") for s in inputs},
            DISTURBANCES: {s: cause(f"d.{s}") for s in disturbances},
            "outputs": {s: cause(f"out.{s}") for s in (*POSE, "u")},
            "start": {s: cause(f"start.{s}") for s in ("x", "r", "mass")},
        }
        self.map = SimpleNamespace(stated=lambda group: stated.get(group, {}))
        self.lines = {
            "outputs": {s: line(*LINES.get(s, (1.0, 0.0))) for s in (*POSE, "u")},
            "inputs": {s: line(4.0) for s in inputs}, DISTURBANCES: {s: line(-0.5) for s in disturbances},
            "start": {"x": line(-10.0), "r": line(1.0), "mass": line(1.0)},
        }  # fmt: skip
        self.processes = SimpleNamespace(inputs=["in.tau_X"])
        self.given = SimpleNamespace(content=dict)
        self.fmu = SimpleNamespace(fixed_step=None)
        scale = SimpleNamespace(forces=np.array([10.0, 20.0, 30.0]))
        self.ship = SimpleNamespace(ship=SimpleNamespace(scale=scale))

    def run_in(self, smoothed):
        return 1.0

    def requests(self, smoothed, rows, h, steps):
        self.asked.append((rows.tolist(), h, steps))
        return [f"course {rows[0]}"]

    def of_variables(self, group, at):
        names = {"start": ("x", "r"), "inputs": ("tau_X",)}[group]
        return {f"{group}.{n}": at[n] for n in names}


def task(predictor=None, train=(), **more):
    return ShipTask(predictor or Predictor(), [], [], {"train": [*train] or [measured()], **more})


def test_outputs_are_read_by_their_lines():
    made = task()
    assert made.lines.tolist() == [[2.0, 1.0, -1.0], [0.1, 0.0, 0.5]]
    assert made.outputs == ["out.x", "out.y", "out.psi", "out.u"]
    assert made.forces_on == ["in.tau_X", "in.tau_N", "d.tau_Y"]
    assert made.driven == ["in.tau_X"]
    assert (made.angles, made.units) == ((2,), ("m", "m", "rad"))
    assert task(test=[measured("b")], validate=[]).use == {"a": "train", "b": "test"}


def test_a_usual_force_is_that_of_the_commands_in_the_unit_of_the_input():
    """Over all training runs; of an axis that is never commanded the ship's full force."""
    made = task(train=[measured(), measured("b", tau=(3.0, 0.0, 0.0))])
    usual = made.usual
    assert usual["in.tau_X"] == pytest.approx(np.sqrt((1.0 + 9.0) / 2.0) / 4.0)
    assert usual["d.tau_Y"] == pytest.approx(np.sqrt(4.0 / 2.0) / 0.5)
    still = task(train=[measured(tau=(0.0, 0.0, 0.0))]).usual
    assert still == pytest.approx(
        {"in.tau_X": 10.0 / 4.0, "in.tau_N": 30.0 / 4.0, "d.tau_Y": 20.0 / 0.5}
    )


def test_forces_may_be_constant_of_a_velocity_or_of_the_earth():
    made = task()
    ids = [f.id for f in made.possible]
    assert {"in.tau_X:1", "in.tau_X:out.u", "d.tau_Y:1", "earth_force:F_n", "earth_force:F_e"} <= {*ids}
    assert not any("out.x" in i for i in ids)
    north, east = made.possible[-2:]
    # A heading is -1 times the output, and 0.5 rad; the force on the input is 1 / gain.
    for psi in (0.0, 1.0, -2.0):
        output = 0.5 - psi
        for force, ahead, aside in (
            (north, np.cos(psi), -np.sin(psi)),
            (east, np.sin(psi), np.cos(psi)),
        ):
            at = force.earth
            parts = {n: gain * np.cos(at.turn * output + phase) for n, gain, phase in at.parts}
            assert (at.heading, [*parts]) == ("out.psi", ["in.tau_X", "d.tau_Y"])
            assert parts["in.tau_X"] == pytest.approx(ahead / 4.0)
            assert parts["d.tau_Y"] == pytest.approx(aside / -0.5)


def test_without_both_inputs_there_is_no_force_of_the_earth():
    assert not any(f.earth for f in task(Predictor(inputs=("tau_X",), disturbances=())).possible)
    alone = Predictor()
    stated = alone.map.stated
    alone.map.stated = lambda group: {
        k: v for k, v in stated(group).items() if (group, k) != ("outputs", "psi")
    }
    assert not any(f.earth for f in [*task(alone)._earth_forces()])


def test_a_window_begins_in_the_smoothed_state_and_has_its_samples_after_the_run_in(monkeypatch):
    made = task()
    window = made._window(made.runs["train"][0].smoothed, 4, 8.0)
    s = made.runs["train"][0].smoothed
    since = s.time - s.time[4]
    rows = np.flatnonzero((since >= 1.0) & (since <= 8.0))
    rows = rows[rows != 7][:: max(1, (rows.size - 1) // (ship_task.INSTANTS * ship_task.PARTS))]
    np.testing.assert_allclose(window.time, since[rows])
    np.testing.assert_allclose(window.measured, s.track.pose[rows])
    assert (window.run, window.begin, window.course) == ("a", 6.0, "course 4")
    assert window.onto is None
    # One standard deviation of each start value of the motion, in the FMU's unit.
    assert window.start_std == pytest.approx({"start.x": 0.1 * (0.1 + 0.01 * 4), "start.r": 0.2})
    ((first, h, steps),) = made.predictor.asked
    assert (first, h) == ([4], PERIOD)
    assert steps == round(window.time[-1] / PERIOD)
    made.predictor.fmu.fixed_step = 0.3
    made._window(s, 4, 8.0)
    assert made.predictor.asked[-1][1:] == (0.3, int(np.ceil(window.time[-1] / 0.3)))


def test_too_few_samples_are_no_window():
    made = task()
    s = made.runs["train"][0].smoothed
    s.used[:] = False
    s.used[20:29] = True
    assert made._window(s, 0, 8.0) is None
    s.used[29] = True
    assert made._window(s, 0, 8.0) is not None
    s.used[:], made.predictor.whole = False, True
    with pytest.raises(InputError, match="no window of a has enough samples"):
        made.windows()


def test_an_fmu_that_cannot_be_set_has_the_whole_run_laid_onto_its_pose():
    made = task(Predictor(whole=True, placed=True), train=[measured(), measured("b", rows=101)])
    windows, noise = made.windows()
    first, second = windows["train"]
    assert noise.tolist() == [0.1, 0.2, 0.3]
    assert (first.begin, second.time[-1]) == (5.0, 25.0)
    s = made.runs["train"][0].smoothed
    rows = np.flatnonzero(s.used & (s.time - 5.0 >= 1.0))
    np.testing.assert_allclose(first.time, s.time[rows] - 5.0)
    assert first.onto.tolist() == s.eta[rows[0]].tolist()
    assert first.start_std == {}


def test_windows_of_a_ship_follow_one_another(monkeypatch):
    monkeypatch.setattr(
        ship_task, "usable_windows", lambda s, length: SimpleNamespace(first_rows=np.array([4, 40]))
    )
    windows, _ = task(test=[measured("b")]).windows()
    assert [(w.run, w.begin) for w in windows["train"]] == [("a", 6.0), ("a", 15.0)]
    assert [w.run for w in windows["test"]] == ["b", "b"]


def test_the_state_at_a_time_is_that_of_the_nearest_row(monkeypatch):
    made = task()
    names = {n: 10.0 * (k + 1) + np.arange(161) for k, n in enumerate((*MOTION, "tau_X"))}
    monkeypatch.setattr(ship_task, "at_samples", lambda s: names)
    found = made.state_at(7.6)  # row 10
    assert found == {"start.x": 20.0, "start.r": 70.0, "inputs.tau_X": 80.0}
    assert made.state_at(5.6)["start.x"] == 13.0, "the first row with a known velocity"
    for time in (5.4, 45.3, np.nan):
        with pytest.raises(InputError, match="run 'a' has no state at"):
            made.state_at(time)


@pytest.mark.parametrize("given", ["parameters.json", None])
def test_a_task_has_the_parameters_of_a_file_or_those_that_are_proposed(monkeypatch, given):
    from diagnosis import predictors
    from diagnosis.assessment import gathering

    predictor, seen = Predictor(), []
    fmu = SimpleNamespace(name="m.fmu", model="model", start="start", begun_on=lambda runs: predictor)
    monkeypatch.setattr(predictors, "ship_with", lambda effects, ship: (effects, ship))
    monkeypatch.setattr(ship_task, "Fmu", lambda *of: seen.append(of) or fmu)
    monkeypatch.setattr(gathering, "gather", lambda paths, *_: [measured(p) for p in paths])
    monkeypatch.setattr(
        parameter_file, "read_parameters", lambda path, model, mapped: [(path, model, mapped)]
    )
    monkeypatch.setattr(
        parameter_file, "proposed", lambda model, mapped: ([(model, mapped)], ["a note"])
    )
    options = SimpleNamespace(
        effects=(),
        ship="cse1",
        fmu="m.fmu",
        map="map.json",
        anyway=False,
        horizon=None,
        parameters=given,
    )
    paths = {"train": ["a", "b"], "validate": [], "test": ["c"]}
    made = ship_task.ship_task(options, paths, None, None)
    assert seen == [("m.fmu", "map.json", ((), "cse1"), None)]
    assert made.use == {"a": "train", "b": "train", "c": "test"}
    mapped = {f"in.{s}" for s in ("tau_X", "tau_N")} | {"d.tau_Y"}
    mapped |= {f"out.{s}" for s in (*POSE, "u")} | {f"start.{s}" for s in ("x", "r", "mass")}
    if given:
        assert (made.parameters, made.notes) == ([(given, "model", mapped)], [])
    else:
        assert (made.parameters, made.notes) == ([("model", mapped)], ["a note"])
    del options.parameters
    options.model = "other.fmu"
    assert ship_task.ship_task(options, paths, None, None).notes == ["a note"]
    assert seen[-1][0] == "other.fmu"
    monkeypatch.setattr(parameter_file, "proposed", lambda model, mapped: ([], []))
    with pytest.raises(InputError, match="no parameter that can be calibrated"):
        ship_task.ship_task(options, paths, None, None)
    stated = predictor.map.stated
    for outputs, wrong in ((POSE, False), (POSE[:2], True)):
        predictor.map.stated = lambda group, outputs=outputs: (
            {s: cause(s) for s in outputs} if group == "outputs" else stated(group)
        )
        message = "needs outputs for x, y and psi" if wrong else "no parameter"
        with pytest.raises(InputError, match=message):
            ship_task.ship_task(options, paths, None, None)

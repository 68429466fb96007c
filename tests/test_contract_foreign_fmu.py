"""An FMU as a predictor by answers that are given: playback, signals, poses, accelerations, and an FMU of both."""

from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError, SimulationError
from cosim.fmu import MOST_STEPS
from diagnosis.predictors import Model, black_box
from diagnosis.predictors.black_box import MOTION, POSE, VELOCITY, BlackBox, laid
from diagnosis.predictors.fmu import fmu_playback, wrapper
from diagnosis.predictors.fmu.fmu_playback import (
    Playback,
    PlaybackRequest,
    Processes,
    ShortSteps,
)
from diagnosis.predictors.fmu.foreign_fmu import Fmu, FmuPredictor
from diagnosis.predictors.fmu.variable_map import DISTURBANCES, VariableMap
from diagnosis.runs import Column
from diagnosis.runs.run_constants import ORDER
from fmus.addition import Line

# Playback


MANY = MOST_STEPS // 2  # predictions of two steps in one request


class Instance:
    """y' = gain * (u_1 + u_2), of which a reset may leave the state; fails beyond a size."""

    def __init__(self, fmu):
        self.fmu, self.left, self.gone = fmu, 0.0, False
        fmu.made.append(self)

    def bind(self, inputs, outputs, memory, h, redoes):
        self.count, self.width, self.redoes = len(inputs), len(outputs), redoes
        self.bound = [p.slot if hasattr(p, "slot") else p for p in (*inputs, *outputs)], h

    def reset(self):
        self.fmu.resets += 1

    def whole_runs(self, runs, h):
        self.fmu.requests.append(len(runs))
        stated = [self.whole_run(*runs[0], h)]
        for run in runs[1:]:
            self.reset()
            stated.append(self.whole_run(*run, h))
        return stated

    def whole_run(self, start, rows, steps, terms, h):
        if self.fmu.refuses == "always" or (self.fmu.refuses == "once" and not self.redoes):
            raise SimulationError("it refuses")
        u = np.frombuffer(rows).reshape(steps, self.count)
        self.fmu.asked.append((dict(start), u.copy(), h, terms))
        y = start.get("y_0", 0.0) + self.left
        found = [y]
        for row in u:
            y += h * start.get("gain", 1.0) * row.sum()
            if abs(y) > self.fmu.most:
                found.append(self.fmu.beyond)
                break
            found.append(y)
        if not self.fmu.resets_well:
            self.left += 1.0
        return np.array(found).repeat(self.width).tobytes()

    def free(self):
        self.gone = True


def fmu_of(**more):
    variables = {n: SimpleNamespace(name=n, start=x) for n, x in (("a", 0.5), ("b", None), ("y", 0.0))}
    model = SimpleNamespace(variables=variables, path=SimpleNamespace(name="m.fmu"))
    made = SimpleNamespace(
        model=model, made=[], asked=[], requests=[], resets=0, refuses="", most=np.inf, beyond=np.nan, resets_well=True,
        closed=0, stated=str, timeout=None,
    )  # fmt: skip
    made.instance = lambda: Instance(made)
    made.close = lambda: setattr(made, "closed", made.closed + 1)
    for name, value in more.items():
        setattr(made, name, value)
    return made


@pytest.fixture(autouse=True)
def ports(monkeypatch):
    monkeypatch.setattr(
        fmu_playback, "Port", lambda variable, slot: SimpleNamespace(variable=variable, slot=slot)
    )
    monkeypatch.setattr(fmu_playback, "DoubleMemory", lambda count: count)


def request(h=0.5, inputs=((1.0,), (2.0,)), terms=(), **start):
    return PlaybackRequest(h, start, np.array(inputs), terms)


def test_an_input_that_is_not_driven_keeps_its_start_value():
    fmu = fmu_of()
    playback = Playback(fmu, ["b", "a"], ["y"])
    found = playback.run(request(gain=2.0, y_0=1.0))
    assert found.fault == ""
    assert found.outputs.ravel() == pytest.approx([1.0, 1.0 + 1.0 * 1.5, 1.0 + 1.5 + 2.5])
    start, u, h, _ = fmu.asked[0]
    assert (start, h) == ({"gain": 2.0, "y_0": 1.0}, 0.5)
    assert u.tolist() == [[1.0, 0.5], [2.0, 0.5]]
    playback.run(request(a=3.0, b=7.0, terms=("t",)))
    start, u, _, terms = fmu.asked[-1]
    assert (start, u.tolist(), terms) == ({}, [[7.0, 3.0], [7.0, 3.0]], ("t",))


@pytest.mark.parametrize("well", [True, False])
def test_an_instance_is_reset_where_that_is_seen_to_leave_it_as_new(well):
    fmu = fmu_of(resets_well=well)
    playback = Playback(fmu, ["b"], ["y"])
    answers = [playback.run(request()).outputs.tolist() for _ in range(3)]
    assert answers[0] == answers[1] == answers[2] == [[0.0], [0.5], [1.5]]
    assert (len(fmu.made) == 1) == well
    assert all(i.gone for i in fmu.made[:-1])
    assert fmu.made[-1].gone != well
    made = len(fmu.made)
    playback.run(request(h=0.25))
    assert len(fmu.made) == made + 1, "another step needs another instance"
    playback.close()
    assert all(i.gone for i in fmu.made)


def test_where_it_must_know_nothing_of_others_each_has_an_instance():
    fmu = fmu_of()
    playback = Playback(fmu, ["b"], ["y"], fresh=True)
    for _ in range(3):
        playback.run(request())
    assert (len(fmu.made), fmu.resets) == (3, 0)


def test_what_is_refused_once_is_asked_with_its_state_saved():
    fmu = fmu_of(refuses="once")
    found = Playback(fmu, ["b"], ["y"]).run(request())
    assert found.outputs.ravel().tolist() == [0.0, 0.5, 1.5]
    assert [i.redoes for i in fmu.made] == [False, *[True] * (len(fmu.made) - 1)]
    never = Playback(fmu_of(refuses="always"), ["b"], ["y"]).run(request())
    assert never.fault == "it refuses"
    assert never.outputs.shape == (3, 1)
    assert np.isnan(never.outputs).all()


@pytest.mark.parametrize(
    ("beyond", "how"), [(np.nan, "is not finite"), (np.inf, "is not finite"), (1e9, "diverges")]
)
def test_an_fmu_that_fails_says_where(beyond, how):
    fmu = fmu_of(most=1.0, beyond=beyond)
    found = Playback(fmu, ["b"], ["y"]).run(request(inputs=((1.0,), (2.0,), (0.0,))))
    assert found.fault == f"y {how} at t = 1 s"
    assert found.outputs[:2].ravel().tolist() == [0.0, 0.5]
    assert np.isnan(found.outputs[3:]).all()
    assert all(i.gone for i in fmu.made)


@pytest.mark.parametrize(
    ("more", "requests"),
    [
        ({}, [MANY, 1]),
        ({"resets_well": False}, [1] * (MANY + 1)),
        ({"timeout": 5.0}, [1] * (MANY + 1)),
        ({"most": 2.0, "beyond": np.nan}, [MANY, *[1] * MANY, 1, 1]),
    ],
    ids=["a reset is enough", "a reset is not", "each has a time", "half of them fail"],
)
def test_many_predictions_are_one_request_where_a_reset_is_enough(more, requests):
    """Two tries of the first one tell whether it is."""
    starts = [k / MANY for k in range(MANY + 2)]
    fmu = fmu_of(**more)
    found = Playback(fmu, ["b"], ["y"]).run_each([request(y_0=y) for y in starts])
    alone = [Playback(fmu_of(**more), ["b"], ["y"]).run(request(y_0=y)) for y in starts]
    assert [each.fault for each in found] == [each.fault for each in alone]
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_array_equal(one.outputs, other.outputs)
    assert fmu.requests == [1, 1, 1, *requests]


@pytest.mark.parametrize(("fresh", "requests"), [(True, [1] * 7), (False, [1, 1, 1, 1, 1, 1, 2, 3])])
def test_predictions_in_two_processes_keep_their_order(fresh, requests):
    fmu = fmu_of()
    processes = Processes(fmu, ["b"], ["y"], fresh=fresh)
    found = processes.run([request(y_0=float(k)) for k in range(7)])
    assert [p.outputs[0, 0] for p in found] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert sorted(fmu.requests) == requests
    processes.close()
    assert fmu.closed == 1
    assert all(i.gone for i in fmu.made)
    assert len(processes._playbacks) == 2

    def interrupted(prediction):
        raise KeyboardInterrupt

    for playback in processes._playbacks:
        playback.run = playback._at_once = interrupted
    with pytest.raises(KeyboardInterrupt):
        processes.run([request()])
    assert fmu.closed == 2


def test_derivatives_are_those_of_a_polynomial():
    """Of the order of the differences; late ones begin after the first step."""
    for late in (False, True):
        fmu = fmu_of()
        steps = ShortSteps(fmu, ["b"], ["y"], 0.1, late)
        n = ORDER
        t = 0.1 * (np.arange(n + 1) + late)
        x = 2.0 - 3.0 * t + 4.0 * t**2 + 0.5 * t**3
        assert steps.derivatives(x) == pytest.approx((-3.0, 8.0))
        y_0, u = np.array([1.0, -2.0, 0.5]), np.array([2.0, 4.0, -6.0])
        found = steps.run({"y_0": y_0}, {"b": u})["y"]
        np.testing.assert_allclose(found, y_0 + t[:, None] * u)
        np.testing.assert_allclose(steps.derivatives(found), [u, 0.0 * u], atol=1e-9)
        assert fmu.requests == [1, 1, 1, 2]
    with pytest.raises(
        InputError, match=r"cannot be set to a measured state: y is not finite at t = 0\.2 s"
    ):
        ShortSteps(fmu_of(most=0.5), ["b"], ["y"], 0.1, False).run({}, {"b": np.array([1.0, 3.0])})


# Signals


H, ROWS = 0.5, 41
LINES = {"x": Line(2.0, 1.0), "y": Line(1.0, 0.0), "psi": Line(-1.0, 0.0), "u": Line(0.5, 0.0)}


def smoothed(u=0.8, r=0.0):
    """A ship at a constant speed, that may turn; poses from (3, -2) on, a heading of 0.4."""
    time = 10.0 + H * np.arange(ROWS)
    psi = 0.4 + r * (time - 10.0)
    if r:
        x, y = 3.0 + u / r * (np.sin(psi) - np.sin(0.4)), -2.0 - u / r * (np.cos(psi) - np.cos(0.4))
    else:
        x, y = 3.0 + u * np.cos(0.4) * (time - 10.0), -2.0 + u * np.sin(0.4) * (time - 10.0)
    tau = np.column_stack([np.arange(ROWS), np.zeros(ROWS), np.ones(ROWS)])
    run = SimpleNamespace(name="a", time=time, tau_cmd=tau, commanded={})
    return SimpleNamespace(
        time=time, eta=np.column_stack([x, y, psi]), nu=np.tile([u, 0.0, r], (ROWS, 1)),
        used=np.ones(ROWS, bool), nu_std=np.full((ROWS, 3), 0.01), scale=SimpleNamespace(time=1.0, length=1.0, speeds=(1.0, 1.0, 1.0)),
        track=SimpleNamespace(run=run, period=H),
    )  # fmt: skip


def predictor(
    start=(*POSE, *VELOCITY), outputs=POSE, late=False, fixed_step=None, fixed=None, answers=None
):
    """A predictor by an FMU of which only the answers are there."""
    made = object.__new__(FmuPredictor)
    stated = {
        "inputs": {"tau_X": Column(name="force")}, "start": {s: Column(name=f"{s}_0") for s in start},
        "outputs": {s: Column(name=f"{s}_out") for s in outputs} | (fixed or {}),
    }  # fmt: skip
    made.map = VariableMap(**stated)
    made.given = made.map
    made.lines = {
        "inputs": {"tau_X": Line(4.0, 2.0)}, "outputs": {s: LINES.get(s, Line(1.0, 0.0)) for s in outputs},
        "start": {s: Line(10.0, 1.0) for s in start},
    }  # fmt: skip
    made.name, made.starts = "m.fmu", frozenset(start) & set(MOTION)
    asked = []

    def run(requests):
        asked.extend(requests)
        return [SimpleNamespace(fault=made.fault, outputs=answers(q)) for q in requests]

    made.fault = ""
    made.processes = SimpleNamespace(
        inputs=("force",), outputs=tuple(f"{s}_out" for s in outputs), run=run
    )
    made.fmu = SimpleNamespace(fixed_step=fixed_step, step=None)
    made.__dict__["late"] = ["x"] if late else []
    made.asked = asked
    return made


def straight(late=False):
    """Outputs x, y, psi of an FMU that goes north at 0.6 m/s from where it is set, and turns by 0.2 rad/s."""

    def of(q):
        t = q.h * np.arange(len(q.inputs) + 1)
        x = q.start.get("x_0", 0.0) + 0.3 * t
        psi = -0.2 * t
        found = np.column_stack([x, np.zeros(t.size), psi])
        if late:
            found[0] = 0.0
        return found

    return of


def test_signals_and_variables_are_lines_of_each_other():
    made = predictor()
    assert made.of_variables("inputs", {"tau_X": np.array([10.0]), "tau_N": np.ones(1)}) == {
        "force": [2.0]
    }
    assert made.of_variables("start", {"u": np.array([21.0])}) == {"u_0": [2.0]}
    fixed = predictor(outputs=("x", "psi"), fixed={"v": 0.25})
    found = fixed._outputs({"x_out": np.array([1.0, 2.0]), "psi_out": np.array([0.1, 0.2])})
    assert {s: x.tolist() for s, x in found.items()} == {
        "x": [3.0, 5.0],
        "psi": [-0.1, -0.2],
        "v": [0.25, 0.25],
    }


def test_requests_begin_in_rows_and_have_the_commands_of_each_step():
    made, s = predictor(), smoothed()
    first, second = made.requests(s, np.array([2, 5]), 0.25, 4)
    assert (first.h, first.inputs.ravel().tolist()) == (0.25, [0.0, 0.0, 0.25, 0.25])
    assert second.inputs.ravel().tolist() == [0.75, 0.75, 1.0, 1.0]
    assert first.start["x_0"] == pytest.approx((s.eta[2, 0] - 1.0) / 10.0)
    assert first.start["u_0"] == pytest.approx((0.8 - 1.0) / 10.0)
    assert first.start.keys() == {f"{n}_0" for n in MOTION}


def test_a_motion_has_what_the_fmu_gives_in_the_steps_that_are_asked_for():
    made, s = predictor(answers=straight()), smoothed()
    motion = made.motion(s, np.array([1, 4]), 0.5, 6)
    assert motion.shape == (7, 6, 2)
    t = 0.5 * np.arange(7)
    for k, row in enumerate((1, 4)):
        x_0 = 2.0 * (s.eta[row, 0] - 1.0) / 10.0 + 1.0
        assert motion[:, 0, k] == pytest.approx(x_0 + 0.6 * t)
        assert motion[:, 2, k] == pytest.approx(0.2 * t)
    assert np.isnan(motion[:, 3:]).all()
    made.fault = "it broke"
    with pytest.raises(InputError, match=r"'m\.fmu' failed on run 'a': it broke"):
        made.motion(s, np.array([1]), 0.5, 6)


def test_an_fmu_with_a_step_of_its_own_is_read_between_its_steps():
    made = predictor(answers=straight(), fixed_step=0.7)
    motion = made.motion(smoothed(), np.array([0]), 0.5, 6)
    assert [len(q.inputs) for q in made.asked] == [5], "as many as reach 3 s"
    assert motion[:, 2, 0] == pytest.approx(0.2 * 0.5 * np.arange(7))
    made.fmu.fixed_step = 0.5
    made.motion(smoothed(), np.array([0]), 0.5, 6)
    assert len(made.asked[-1].inputs) == 6


def test_outputs_that_are_late_begin_where_the_next_ones_point_to():
    made = predictor(answers=straight(late=True), late=True)
    motion = made.motion(smoothed(), np.array([1]), 0.5, 6)
    assert motion[:, 2, 0] == pytest.approx(0.2 * 0.5 * np.arange(7))
    assert motion[0, 0, 0] == pytest.approx(motion[1, 0, 0] - 0.3)
    made.motion(smoothed(), np.array([1]), 0.5, 1)
    assert len(made.asked[-1].inputs) == 3


def test_a_heading_that_is_wrapped_is_continuous():
    def turning(q):
        t = q.h * np.arange(len(q.inputs) + 1)
        return np.column_stack([t, t, np.angle(np.exp(-2.0j * t))])

    motion = predictor(answers=turning).motion(smoothed(), np.array([0]), 0.5, 12)
    assert motion[:, 2, 0] == pytest.approx(2.0 * 0.5 * np.arange(13))


def test_an_acceleration_is_that_of_velocities_or_of_poses_in_the_body():
    """A ship on a circle: u' = 0.3, and by the pose the same."""
    h, n = 0.01, ORDER
    t = h * np.arange(n + 1)
    u, r, psi0 = 0.8, 0.5, 2.0
    psi = psi0 + r * t
    # The position by trapezia on a fine grid.
    fine = np.linspace(0.0, t[-1], 200 * n + 1)
    speed, course = u + 0.3 * fine, psi0 + r * fine
    ways = []
    for rate in (speed * np.cos(course), speed * np.sin(course)):
        whole = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (rate[1:] + rate[:-1]))])
        ways.append(np.interp(t, fine, whole))
    poses = {"x_out": (ways[0] - 1.0) / 2.0, "y_out": ways[1], "psi_out": -psi}
    made = predictor()
    steps_of = ShortSteps(fmu_of(), ["b"], ["y"], h, False)
    asked = []

    def given(values):
        """The same from each of two states."""
        found = {name: np.column_stack([x, x]) for name, x in values.items()}
        run = lambda *state: asked.append(state) or found  # noqa: E731
        return SimpleNamespace(run=run, derivatives=steps_of.derivatives)

    made._steps = given(poses)
    found = made.accelerations({})
    np.testing.assert_allclose(found, [[0.3, 0.0, 0.0]] * 2, atol=2e-2)
    both = predictor(outputs=VELOCITY)
    values = {"u_out": (u + 0.3 * t) / 0.5, "v_out": -0.2 * t, "r_out": r + 0.7 * t}
    both._steps = given(values)
    many = both.accelerations({"tau_X": np.array([2.0, 6.0]), "u": np.array([1.0, 11.0])})
    np.testing.assert_allclose(many, [[0.3, -0.2, 0.7]] * 2, atol=1e-6)
    start, inputs = asked[-1]
    assert (start["u_0"].tolist(), inputs["force"].tolist()) == ([0.0, 1.0], [0.0, 1.0])


def test_what_can_be_set_and_seen_decides_how_it_predicts():
    assert not predictor().whole
    assert not predictor().placed
    assert predictor(start=POSE).whole
    assert not predictor(start=("u", "r"), fixed={"v": 0.0}, outputs=("x", "y", "psi")).whole
    assert predictor(start=VELOCITY).placed
    assert predictor(outputs=("u", "v", "r")).placed


def test_late_outputs_are_zero_against_a_start_value_that_is_not():
    def of(zero):
        made = predictor(answers=lambda q: np.column_stack([[zero, 1.0], [5.0, 5.0], [6.0, 6.0]]))
        del made.__dict__["late"]
        made.lines["outputs"] = {s: Line(1.0, 0.0) for s in POSE}
        s = smoothed()
        made.runs = [SimpleNamespace(scale=s.scale, smoothed=s, known=np.ones(ROWS, bool))]
        return made

    made = of(0.0)
    assert made.late == ["x"]
    # The row in which all that is seen is far from zero.
    row = int(np.abs(smoothed().eta).min(axis=1).argmax())
    assert made.asked[0].start["y_0"] == pytest.approx((smoothed().eta[row, 1] - 1.0) / 10.0)
    assert of(0.1).late == []
    nothing = predictor(start=("mass",))
    del nothing.__dict__["late"]
    s = smoothed()
    nothing.runs = [SimpleNamespace(scale=s.scale, smoothed=s, known=np.ones(ROWS, bool))]
    assert nothing.late == []


def execution(step=None):
    return SimpleNamespace(step=step)


@pytest.mark.parametrize(
    ("asked", "suggested", "varies", "step", "fixed"),
    [
        (0.1, 0.5, True, 0.1, 0.1),
        (None, 0.5, True, 0.5, None),
        (None, 0.5, False, 0.5, 0.5),
        (None, None, False, None, None),
    ],
)
def test_a_step_is_fixed_where_it_is_asked_for_or_cannot_change(asked, suggested, varies, step, fixed):
    fmu = object.__new__(Fmu)
    stated = SimpleNamespace(canHandleVariableCommunicationStepSize=varies)
    fmu.execution = execution(asked)
    fmu.model = SimpleNamespace(
        suggested_step=suggested, description=SimpleNamespace(coSimulation=stated)
    )
    assert (fmu.step, fmu.fixed_step) == (step, fixed)


# Black boxes


class Slider(BlackBox):
    """Goes at a constant speed and rate, on whatever heading it is set to; its velocity cannot be set."""

    def __init__(self, u=0.8, r=0.1, starts=(), poses=False):
        self.name, self.starts, self.speed, self.poses = "slider", frozenset(starts), (u, r), poses
        self.own_run_in = None

    def motion(self, smoothed, rows, h, steps):
        u, r = self.speed
        found = np.full((steps + 1, 6, rows.size), np.nan)
        t = h * np.arange(steps + 1)[:, None]
        psi = 1.5 + r * t
        if self.poses:
            found[:, 0], found[:, 1] = u / r * np.sin(psi), -u / r * np.cos(psi)
            found[:, 2] = np.angle(np.exp(1j * psi))
        else:
            found[:, 3], found[:, 4], found[:, 5] = u, 0.0, r
        return found

    def accelerations(self, signals):
        raise AssertionError


@pytest.mark.parametrize("poses", [False, True])
def test_a_whole_run_is_laid_onto_its_first_pose(poses):
    """By its velocity where it gives no pose, and the other way round."""
    s = smoothed(r=0.1)
    motion = Slider(poses=poses)._whole_run(s)
    assert motion[:, :3] == pytest.approx(s.eta, abs=3e-4)
    assert motion[2:-2, 3:] == pytest.approx(s.nu[2:-2], abs=1e-3)


def test_a_free_run_is_laid_onto_the_pose_at_which_it_begins():
    s = smoothed(r=0.1)
    time, (before, after) = Slider().free_runs(s, None, 13.1)
    assert before is after
    # From the last sample before, at 13 s; the box itself runs from the start.
    at = np.searchsorted(s.time, 13.0)
    assert time[0] == pytest.approx(13.0)
    assert time[-1] == pytest.approx(s.time[-1])
    step = time[1] - time[0]
    every = round(H / step)
    assert before[::every] == pytest.approx(s.eta[at:], abs=3e-4)
    set_there = Slider(starts=VELOCITY)
    time, (pose, _) = set_there.free_runs(s, None, 13.1)
    assert time[0] == pytest.approx(13.0)
    assert pose[0] == pytest.approx(s.eta[at])


def test_a_run_in_is_that_of_the_map_or_what_a_ship_forgets():
    box, s = Slider(), smoothed()
    s.scale.time = 2.0
    assert box.run_in(s) == black_box.FORGOTTEN * 2.0
    still = smoothed(u=0.0)
    assert box.run_in(still) == 0.0, "from rest"
    box.own_run_in = 7.0
    assert box.run_in(still) == 7.0
    assert box.run_in(s) == 7.0
    box.starts = frozenset(VELOCITY)
    assert box.run_in(s) == 0.0


def test_sentences_say_how_a_box_begins():
    box = Slider()
    whole, placed = box._sentences(7.0)
    assert "u, v, r of the map's start" in whole
    assert "after a run-in of 7 s" in whole
    assert "from rest" in next(box._sentences(0.0))
    assert placed.startswith("At the start of a prediction its pose is aligned")
    (own,) = Slider(starts=MOTION)._sentences(0.0)
    assert own == "Each window starts from the measured state."
    assert box.write(None) == []
    assert box.write(None, Model()) == ["The findings are not written: slider has no parameters."]


def test_residuals_of_additions_change_as_those_of_the_model():
    own, base, other = (
        np.array([[1.0, 2.0, 3.0]]),
        np.array([[0.5, 0.5, 0.1]]),
        np.array([[0.1, 0.2, 0.4]]),
    )

    class Box(Slider):
        @property
        def model(self):
            return SimpleNamespace(during=lambda run: f"model in {run}")

    asked = []
    windows = SimpleNamespace(
        runs=[smoothed()], residuals_by=lambda poses: [own],
        residuals_of_each=lambda models: asked.append(models) or [base, other],
    )  # fmt: skip
    box = Box()
    assert box.residuals(windows) == [own]
    first, changed = box.residuals(windows, [SimpleNamespace(during=lambda run: f"other in {run}")])
    assert first is own
    assert changed == pytest.approx(np.array([[0.6, 1.7, 3.3 - 2.0 * np.pi]]))
    assert asked == [["model in a", "other in a"]]


@pytest.mark.parametrize("inputs", [("tau_X", "tau_Y", "tau_N"), ("tau_X",), ()])
def test_the_inertia_is_that_by_which_it_answers_forces(inputs):
    ship = Model()
    M = ship.mass + np.diag([3.0, 5.0, 0.7])

    class Box(Slider):
        def accelerations(self, signals):
            tau = np.array([signals[n][0] for n in ("tau_X", "tau_Y", "tau_N")])
            return (np.array([0.1, 0.2, 0.3]) + np.linalg.inv(M) @ tau)[None]

    box = Box()
    box.ship, box.inputs = ship, frozenset(inputs)
    box.runs = [SimpleNamespace(smoothed=smoothed())]
    found = box._inertia()
    if not inputs:
        assert found == {}
        return
    new = Model(found).mass
    assert new[0, 0] == pytest.approx(M[0, 0])
    if len(inputs) == 3:
        assert new == pytest.approx(M)
    box.accelerations = lambda signals: np.zeros((1, 3))
    assert box._inertia() == {}, "it answers no force at once"


# An FMU of both


def wrapped(monkeypatch, change, inputs=("tau_X", "tau_N"), disturbances=()):
    """What is written of a change of the model error (K, 3), and the arguments of the container."""
    stated = {
        "inputs": {s: Column(name=f"in.{s}") for s in inputs}, "outputs": {"psi": Column(name="heading"), "u": 0.5},
        "start": {"x": Column(name="x_0"), "u": Column(name="u_out")},
        DISTURBANCES: {s: Column(name=f"d.{s}") for s in disturbances}, "run_in": 7.0,
    }  # fmt: skip
    causality = {"x_0": "parameter", "u_out": "output"}
    variables = {n: SimpleNamespace(name=n, causality=c) for n, c in causality.items()}
    lines = {g: {s: Line(2.0, 0.0) for s in stated[g]} for g in ("inputs", "outputs", DISTURBANCES)}
    model = SimpleNamespace(variables=variables, path="m.fmu")
    fmu = wrapper.Wrapped("m.fmu", model, VariableMap(**stated), lines)
    start, learned = Model(), Model({"delta_X_u": -2.0})
    monkeypatch.setattr(
        wrapper, "omega", lambda w, m: np.array(change) if m is start else 0.0 * np.array(change)
    )
    written = []
    monkeypatch.setattr(wrapper, "write_container", lambda *of: written.append(of))
    monkeypatch.setattr(wrapper, "step_of", lambda s: 0.1)
    runs = [
        SimpleNamespace(smoothed=None, run=SimpleNamespace(time=np.array([3.0, t])))
        for t in (10.04, 8.0)
    ]
    path = SimpleNamespace(name="found.fmu")
    return (*wrapper.write_wrapper(path, fmu, start, learned, runs), written)


def test_an_fmu_of_both_has_the_wires_of_all_signals(monkeypatch):
    stated, of_both, ((_path, _inner, source, wires, span, starts),) = wrapped(
        monkeypatch, [[0.5, 0.0, 0.0]], ("tau_X", "rudder.delta"), ("u_dot",)
    )
    assert stated == "found.fmu is m.fmu with the findings."
    ends = {a.partition(".")[2]: b.partition(".")[2] for a, b in wires}
    assert ends == {
        "heading": "from_psi", "to_tau_X": "in.tau_X", "to_rudder_delta": "in.rudder.delta", "add_u_dot": "d.u_dot",
    }  # fmt: skip
    assert span == (0.1, pytest.approx(7.0))
    assert [s.partition(".")[2] for s in starts] == ["x_0"]
    assert "'delta_X_u': -2.0" in source
    compile(source, "found.py", "exec")
    assert of_both.inputs["rudder.delta"].name.endswith("rudder_delta")
    assert of_both.outputs["psi"].name.endswith(".heading")
    assert of_both.outputs["u"] == 0.5
    assert [*of_both.start] == ["x"]
    assert of_both.run_in == 7.0


def test_without_an_input_for_the_force_none_is_written(monkeypatch):
    stated, of_both, written = wrapped(monkeypatch, [[0.0, 0.5, 0.0]])
    assert "it needs tau_Y or v_dot" in stated
    assert (of_both, written) == (None, [])
    assert wrapped(monkeypatch, [[0.0, 0.5, 0.0]], disturbances=("v_dot",))[1] is not None
    assert wrapped(monkeypatch, [[0.0, 0.5, 0.0]], inputs=("tau.force", "tau.angle"))[1] is not None
    assert (
        "tau_N or r_dot" in wrapped(monkeypatch, [[0.0, 0.5, 0.1]], inputs=("tau.force", "tau.angle"))[0]
    )
    assert wrapped(monkeypatch, [[0.0, 0.0, 0.0]])[:2] == ("The findings add nothing to the FMU.", None)


def test_tracks_are_laid_by_turning_and_moving():
    """A track that passes (1, 2) on the heading 0.5, laid so that it does so at (0, 0) on 2.5."""
    t = np.linspace(0.0, 1.0, 5)
    track = np.column_stack([1.0 + t, 2.0 + t**2, 0.5 + t])[:, :, None]
    found = laid(track, np.zeros(1), np.array([[0.0], [0.0], [2.5]]))[:, :, 0]
    way = (t + 1j * t**2) * np.exp(2.0j)
    assert found == pytest.approx(np.column_stack([way.real, way.imag, 2.5 + t]))

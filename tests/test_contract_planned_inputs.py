"""Inputs that determine parameters of an FMU best: courses, what they give, and the plan's files."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from diagnosis.fmu_parameters import planned_inputs
from diagnosis.fmu_parameters.measured_system import MeasuredRun
from diagnosis.fmu_parameters.parameter_file import CalibratedParameter, Prior
from diagnosis.fmu_parameters.planned_inputs import FmuPlan, FmuRun, course, plan_inputs

SINE, STEPS, CONSTANT = 0.2, 0.6, 0.9  # the number that chooses the form of a course
PARAMETERS = [
    CalibratedParameter(name="k", unit="N/m", value=2.0, prior=Prior(std=0.5)),
    CalibratedParameter(name="d", unit="N.s/m", value=4.0, prior=Prior(std=1.0), log=True),
]


def runs():
    """Two measured runs, the first sampled every 0.25 s."""
    t = 0.25 * np.arange(9)
    first = {"a": np.linspace(-1.0, 2.0, 9), "b": np.full(9, 3.0), "y": np.arange(9.0)}
    first["y"][0] = np.nan
    second = {"a": np.linspace(0.0, 5.0, 5), "b": np.array([1.0, np.nan, 2.0, 2.0, 2.0])}
    second["y"] = np.full(5, 7.0)
    return [MeasuredRun("1", t, first), MeasuredRun("2", np.arange(5.0), second)]


class Task:
    """The part of a task that a plan asks for."""

    def __init__(self, inputs=("a", "b"), slopes=None):
        self.map = SimpleNamespace(inputs=dict.fromkeys(inputs), outputs={"y": None})
        self.runs = {"train": runs()}
        self.parameters, self.confined, self.length = PARAMETERS, SimpleNamespace(model=None), 5.0
        self.slopes, self.closed = slopes, False

    def residuals(self):
        old = SimpleNamespace(processes=None, noise=np.ones(1))
        return {"train": SimpleNamespace(**vars(old), J=np.array([[1.0, 1.0]]))}

    def close(self):
        self.closed = True


def input_course(form, low=0.0, high=1.0, period=0.5, seconds=40.0):
    point = np.array([form, low, high, period, CONSTANT, 0.5, 0.5, 0.0])
    run = course(Task(), point, seconds)
    return run.time, run.columns


def test_a_course_is_sampled_as_the_first_run_and_its_outputs_rest():
    time, columns = input_course(SINE, seconds=40.1)
    assert time == pytest.approx(0.25 * np.arange(161))
    assert columns.keys() == {"a", "b", "y"}
    assert (columns["y"] == 1.0).all(), "the first value that was measured"
    assert (columns["b"] == 2.0).all(), "half of the way from 1 to 3, over all runs"


@settings(max_examples=20)
@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_course_swings_between_two_values_of_the_measured_range(x, y, period):
    low, high = sorted((-1.0 + 6.0 * x, -1.0 + 6.0 * y))
    seconds = 0.02 * 40.0 * 25.0**period
    for form, of in ((SINE, np.sin), (STEPS, lambda phase: np.sign(np.sin(phase)))):
        time, columns = input_course(form, x, y, period)
        wanted = 0.5 * (low + high) + 0.5 * (high - low) * of(2.0 * np.pi * time / seconds)
        assert columns["a"] == pytest.approx(wanted, abs=1e-9)
    assert input_course(CONSTANT, x, y, period)[1]["a"] == pytest.approx(high)


@pytest.mark.parametrize(
    ("number", "form"), [(0.39, SINE), (0.4, STEPS), (0.79, STEPS), (0.8, CONSTANT)]
)
def test_the_forms_share_the_points(number, form):
    np.testing.assert_array_equal(input_course(number)[1]["a"], input_course(form)[1]["a"])


def planned(monkeypatch, slopes, count=2, task=None, points=8):
    """A plan whose courses have the slopes that a function of their values gives."""
    seen = []

    def windows_of(run, *_):
        seen.append(run)
        return run

    def of(r, setting):
        assert setting.z == (0.0, 1.0)
        return r.J if hasattr(r, "J") else slopes(r)

    monkeypatch.setattr(planned_inputs, "windows_of", windows_of)
    monkeypatch.setattr(planned_inputs, "WindowResiduals", lambda _, windows, *__: windows)
    monkeypatch.setattr(planned_inputs, "_slopes", of)
    monkeypatch.setattr(planned_inputs, "POINTS", points)
    task = task or Task(("a",))
    said = []
    return plan_inputs(task, (0.0, 1.0), 10.0, count, 3, said.append), seen, said, task


def test_the_course_that_adds_most_information_is_taken_after_those_before(monkeypatch):
    """Slopes (s, 0) and (0, s): the volume of the first course decides, then that beside it."""

    def slopes(run):
        size = np.ptp(run.columns["a"])
        return np.array([[size, 0.0], [0.0, 0.1 * size]])

    plan, seen, said, task = planned(monkeypatch, slopes)
    assert task.closed
    assert len(seen) == 16
    for chosen, tried in zip(plan.runs, (seen[:8], seen[8:]), strict=True):
        best = max(tried, key=lambda r: np.ptp(r.columns["a"]))
        assert chosen.inputs.keys() == {"a"}
        assert chosen.inputs["a"] is best.columns["a"]
        assert chosen.time is best.time
        J = slopes(best)
        np.testing.assert_allclose(chosen.after.G - chosen.before.G, J.T @ J)
        assert chosen.together == [], "each has a course of its own"
    np.testing.assert_array_equal(plan.runs[0].before.G, np.ones((2, 2)))
    assert plan.runs[1].before is plan.runs[0].after
    assert said[0] == "run 1: 0 of 8 courses of the inputs"
    assert said[-1] == "run 2: 7 of 8 courses of the inputs"
    other = [*seen[0].columns["a"]] != [*seen[8].columns["a"]]
    assert other, "each run has other courses"


def test_parameters_that_every_run_moves_alike_are_named(monkeypatch):
    plan, *_ = planned(monkeypatch, lambda run: np.full((3, 2), np.ptp(run.columns["a"])), 1)
    assert [*map(list, plan.runs[0].together)] == [["k", "d"]]
    assert plan.lines()[-1] == "No input within its range determines k, d alone."


def test_courses_on_which_the_fmu_fails_are_left_out(monkeypatch):
    """Nor are those with slopes that are not finite."""

    def fails(run):
        if np.ptp(run.columns["a"]) > 1.0:
            raise InputError("it fails")
        return np.full((1, 2), np.nan if run.columns["a"][0] < 2.0 else np.ptp(run.columns["a"]))

    plan, seen, *_ = planned(monkeypatch, fails, 1, points=64)
    able = [r for r in seen if np.ptp(r.columns["a"]) <= 1.0 and r.columns["a"][0] >= 2.0]
    best = max(able, key=lambda r: np.ptp(r.columns["a"]))
    assert plan.runs[0].inputs["a"] is best.columns["a"]

    def always(_):
        raise InputError("it fails")

    task = Task(("a",))
    with pytest.raises(InputError, match="fails on every course"):
        planned(monkeypatch, always, 1, task)
    assert task.closed
    with pytest.raises(InputError, match="no input"):
        planned(monkeypatch, always, 1, Task(()))


def plan_of_two():
    """A plan of one run: variances 1/2 and 1/5 before, 1/4 and 1/20 after."""
    before, after = (
        planned_inputs.Knowledge(
            [planned_inputs.Hypothesis(("k", "d"), np.arange(2), np.arange(2))],
            np.ones(1), np.diag(G), np.zeros(2), np.eye(2), np.zeros(2), 1.0,
        )
        for G in ([1.0, 4.0], [3.0, 19.0])
    )  # fmt: skip
    time = np.array([0.0, 60.0, 180.0])
    run = FmuRun(time, {"a": np.array([1.0, 2.0, 3.5])}, before, after, [])
    return FmuPlan(Task(), np.array([0.0, 1.0]), [run], 3)


def test_intervals_are_those_of_the_values_before_and_after():
    k, d = plan_of_two().intervals()
    assert (k["name"], k["unit"], d["name"]) == ("k", "N/m", "d")
    assert k["half_width"] == pytest.approx([1.96 * 0.5 * np.sqrt(v) for v in (1 / 2, 1 / 4)], rel=1e-3)
    # d = 4 exp(z / 4) with z = 1: its slope is exp(1/4).
    slope = np.exp(0.25)
    assert d["half_width"] == pytest.approx(
        [1.96 * slope * np.sqrt(v) for v in (1 / 5, 1 / 20)], rel=1e-3
    )
    shown = plan_of_two().lines()
    assert shown[1] == f"  k: {k['half_width'][0]:.3g}, {k['half_width'][1]:.3g} N/m"
    assert len(shown) == 3


def test_the_criteria_are_of_the_information_of_the_run():
    content = plan_of_two().runs[0].content(4)
    assert (content["commands"], content["scenario"], content["minutes"]) == (
        "commands_4.csv",
        None,
        3.0,
    )
    assert content["criteria"]["d-optimal"] == pytest.approx(0.5 * np.log((4 * 20) / (2 * 5)))
    assert content["criteria"]["a-optimal"] == pytest.approx(-(2 / 4 + 5 / 20) / 2)


def test_the_files_of_a_plan_have_its_inputs(tmp_path):
    names = plan_of_two().write(tmp_path)
    assert names == ["next.json", "plan.md", "commands_1.csv"]
    assert (tmp_path / "commands_1.csv").read_text() == "time,a\n0,1\n60,2\n180,3.5\n"
    stated = json.loads((tmp_path / "next.json").read_text())
    assert [r["commands"] for r in stated["runs"]] == ["commands_1.csv"]
    assert [p["name"] for p in stated["parameters"]] == ["k", "d"]
    assert (stated["seed"], stated["criterion"], stated["inseparable"]) == (3, "d-optimal", [])
    page = (tmp_path / "plan.md").read_text().splitlines()
    assert page[2:5] == plan_of_two().lines()
    assert page[-1] == "Inputs over time: commands_1.csv."

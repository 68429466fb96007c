"""The compiled step loop and the loop in Python leave the same bytes; what cannot be compiled says why."""

import json
import math
import sys
from array import array

import numpy as np
import pytest
from support.cases import slow
from support.foreign import ANY_STEP, STATE, build_lag, needs_compiler

import cosim
from cosim.compiled import library
from cosim.master.loops.rounding import round_to_places
from cosim.scenario import faults, operations

pytestmark = needs_compiler
POSE = ["observer.x_m", "observer.y_m", "observer.psi_m"]

# Every kind, with given and with random times, on inputs and on outputs, on signals of several FMUs.
FAULTS = [
    {"kind": "bias", "signals": POSE, "value": [0.01, -0.02, 0.0]},
    {"kind": "noise", "signals": ["vessel.u", "vessel.v"], "std": 1e-4},
    {"kind": "spikes", "signals": POSE, "rate": 5.0, "size": 0.2},
    {"kind": "spikes", "signals": ["thrusters.u"], "at": [0.3, 0.31, 1.2], "size": 0.01},
    {"kind": "wrap", "signals": ["observer.psi_m"]},
    {"kind": "delay", "signals": POSE, "time": 0.05},
    {"kind": "delay", "signals": ["thrusters.tau_X"], "time": 1e5},
    {"kind": "freeze", "signals": ["controller.r_hat"], "rate": 2.0, "duration": [0.05, 0.2]},
    {"kind": "dropout", "signals": POSE, "at": [0.8], "duration": 0.1},
    {"kind": "dropout", "signals": ["vessel.r"], "rate": 1.0, "duration": 0.02, "value": "zero"},
]
# On an input with a source, one without, outputs, a parameter; two at one instant, one between two steps.
EVENTS = [
    {"time": 0.0, "model": "vessel", "variable": "delta_X_u", "action": "override", "value": -1.0},
    {"time": 0.4, "model": "observer", "variable": "x_m", "action": "bias", "value": 0.05},
    {"time": 0.4, "model": "controller", "variable": "u_hat", "action": "hold"},
    {"time": 0.505, "model": "vessel", "variable": "u", "action": "override", "value": 0.02},
    {"time": 0.9, "model": "observer", "variable": "x_m", "action": "reset"},
    {"time": 1.1, "model": "controller", "variable": "u_hat", "action": "reset"},
    {"time": 1.3, "model": "vessel", "variable": "u", "action": "reset"},
    {"time": 1.9, "model": "vessel", "variable": "delta_X_u", "action": "reset"},
]


@pytest.mark.parametrize(
    ("does", "why"),
    [
        ("sys.exit('a note\\nloop.c:3: error: no such thing')", "fails: loop.c:3: error: no such thing"),
        ("sys.exit(1)", "fails: no message"),
        ("open(sys.argv[sys.argv.index('-o') + 1], 'w').close()", "wrote no library: "),
    ],
)
def test_a_compiler_that_fails_is_told_with_what_it_says(does, why, tmp_path, monkeypatch):
    compiler = [sys.executable, "-c", f"import sys; {does}"]
    monkeypatch.setattr(library, "_compiler", lambda with_zig: compiler)
    with pytest.raises(library.NoLibraryError) as stated:
        library._compiled(tmp_path, False)
    assert str(stated.value).startswith(f"compiler '{sys.executable}' {why}")


def run(content, folder, loop, monkeypatch):
    """A run with a loop; its result, and its log as bytes."""
    monkeypatch.setenv("CYBERSHIP_LOOP", loop)
    result = cosim.simulate(cosim.load_scenario(content), folder / loop)
    return result, (folder / loop / "log.csv").read_bytes()


def same(content, folder, monkeypatch, status="done"):
    """The result of the compiled loop, which leaves the bytes of the plain one."""
    (ours, compiled), (other, plain) = (
        run(content, folder, loop, monkeypatch) for loop in ("compiled", "plain")
    )
    assert (ours.loop, other.loop) == ("compiled", "plain")
    assert (ours.status, ours.message, ours.rows) == (other.status, other.message, other.rows)
    assert ours.status == status
    assert compiled == plain
    return ours


def disturbed(ellipse, seed=0, **changes):
    return ellipse | {"faults": FAULTS, "events": EVENTS, "seed": seed} | changes


@pytest.mark.parametrize("seed", [0, slow(1)])
@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_faults_and_events_are_the_same_to_the_bit(
    algorithm, seed, ellipse, native, tmp_path, monkeypatch
):
    content = disturbed(ellipse, seed, algorithm=algorithm, stop=25.0 if seed else 3.0)
    for entry in content["fmus"].values():
        entry["path"] = str(native[entry["path"].removesuffix(".fmu")])
    same(content, tmp_path, monkeypatch)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_steps_of_several_lengths_are_the_same_to_the_bit(
    algorithm, ellipse, native, tmp_path, monkeypatch
):
    content = disturbed(ellipse, algorithm=algorithm, step=0.005)
    for name, entry in content["fmus"].items():
        entry["path"] = str(native[entry["path"].removesuffix(".fmu")])
        entry["step"] = {"vessel": 0.005, "observer": 0.02, "controller": 0.05}.get(name, 0.01)
    content["log"] = {"signals": ["*.x*", "controller.*"], "every": 3}
    same(content, tmp_path, monkeypatch)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", slow("jacobi")])
def test_python_fmus_too(algorithm, ellipse, tmp_path, monkeypatch):
    same(disturbed(ellipse, algorithm=algorithm), tmp_path, monkeypatch)


def lagging(fmu, **changes):
    """Two instances of a foreign FMU behind one of ours: one input has no source, whole numbers and flags travel."""
    return {
        "name": "lagging", "step": 0.01, "stop": 4.0,
        "fmus": {
            "guidance": {"path": "guidance_ellipse.fmu", "parameters": {"u_t": 0.1}},
            "lag": {"path": str(fmu), "parameters": {"T": 0.5}},
            "second": {"path": str(fmu), "step": 0.02},
        },
        "connections": [["guidance.x_t_dot", "lag.in[1]"], ["lag.out, filtered", "second.in[1]"]],
        "transformations": {"second.in[1]": {"factor": 1.7, "offset": -0.1}},
        "events": [
            {"time": 1.0, "model": "lag", "variable": "on", "action": "override", "value": False},
            {"time": 1.5, "model": "lag", "variable": "on", "action": "reset"},
        ],
    } | changes  # fmt: skip


HABITS = {
    "none": "",
    "discards": "m->last = t; if (fmod(t, 0.5) < 0.05 && h > 0.004) return 2;",
    "warns": "if (t > 1.0) return 1;",
    "takes its time": "m->pending = 3; m->pending_step = h; return 5;",
}


@pytest.mark.parametrize("habit", HABITS)
def test_foreign_fmus_with_all_their_habits_too(habit, tmp_path, monkeypatch):
    fmu = build_lag(tmp_path, "lag", HABITS[habit], f"{ANY_STEP} {STATE}")
    noisy = {"kind": "noise", "signals": ["lag.in[1]"], "std": 0.1}
    late = {"kind": "delay", "signals": ["second.in[1]"], "time": 0.1}
    held = {"kind": "freeze", "signals": ["lag.out, filtered"], "rate": 3.0, "duration": 0.1}
    same(lagging(fmu, faults=[noisy, late, held]), tmp_path, monkeypatch)


FAILURES = {
    "returns error": "if (t > 1.0) return 3;",
    "is fatal": "if (t > 1.0) return 4;",
    "discards for good": "m->last = t; if (t > 1.0) return 2;",
    "is not finite": "if (t > 1.0) m->y = 0.0 / 0.0;",
}


@pytest.mark.parametrize(
    ("failure", "algorithm"),
    [*((f, "gauss_seidel") for f in FAILURES), slow(("is not finite", "jacobi"))],
)
def test_failures_end_the_run_at_the_same_row(failure, algorithm, tmp_path, monkeypatch):
    fmu = build_lag(tmp_path, "lag", FAILURES[failure], f"{ANY_STEP} {STATE}")
    result = same(lagging(fmu, algorithm=algorithm), tmp_path, monkeypatch, "failed")
    assert result.rows in (101, 102, 103)


def test_number_too_large_for_a_whole_number_is_refused_in_the_same_words(tmp_path, monkeypatch):
    fmu = build_lag(tmp_path)
    for value, shown in ((3e9, "3000000001.0"), (2147483646.6, "2147483647.6")):
        event = {"time": 1.0, "model": "lag", "variable": "on", "action": "bias", "value": value}
        result = same(lagging(fmu, events=[event]), tmp_path / shown, monkeypatch, "failed")
        assert f"lag.on = {shown} is not a 32-bit number" in result.message


@pytest.mark.slow
def test_reason_for_the_plain_loop_is_told(tmp_path):
    fmu = build_lag(tmp_path)
    reasons = {
        "a process of its own": {"fmus": {"lag": {"path": str(fmu), "isolate": True}}, "events": []},
        '"native" is false': {"native": False},
    }
    for k, (reason, changes) in enumerate(reasons.items()):
        content = lagging(fmu) | {"connections": [], "transformations": {}, "stop": 0.1} | changes
        content["fmus"] = {"lag": content["fmus"]["lag"]}
        result = cosim.simulate(cosim.load_scenario(content), tmp_path / str(k))
        assert result.loop == "plain"
        assert reason in result.loop_reason
        sidecar = json.loads((tmp_path / str(k) / "log.json").read_text())
        assert (sidecar["loop"], sidecar["loop_reason"]) == ("plain", result.loop_reason)
    scenario = cosim.load_scenario(lagging(fmu, stop=0.05))
    assert "real time" in cosim.simulate(scenario, tmp_path / "r", realtime=50.0).loop_reason
    assert cosim.simulate(scenario, tmp_path / "n", native=False).loop == "plain"
    assert cosim.simulate(scenario, tmp_path / "c").loop == "compiled"


class Quarter(operations.Replace):
    """What a user makes of an operation: C would not know."""

    def act(self, values, row):
        values[self.slots[0]] = 0.25


def quarter(slots):
    def effect(values, t):
        values[slots[0]] = 0.25

    return effect


@pytest.mark.parametrize("effect", [Quarter, quarter])
def test_fault_of_a_user_that_is_no_known_operation_takes_the_plain_loop(effect, tmp_path, monkeypatch):
    monkeypatch.setattr(faults.Bias, "bind", lambda self, slots, step, rng: effect(slots))
    bias = {"kind": "bias", "signals": ["lag.in[1]"], "value": 1.0}
    content = lagging(build_lag(tmp_path), stop=0.1, faults=[bias])
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert result.loop == "plain"
    assert result.loop_reason.startswith("a fault of lag is a Python function")
    assert set(cosim.read_log(tmp_path / "out")["lag.in[1]"][1:]) == {0.25}


def one_of_each(rng):
    """Each kind of operation, twice, from the same random numbers."""
    chance = rng.random(400) < 0.3
    draws = rng.standard_normal((400, 2)).tolist()
    at = iter(range(10**6))
    yield operations.Add([0, 1], lambda t: draws[next(at)])
    yield operations.Replace([0, 1], lambda t: [1.0, math.nan] if chance[round(t)] else None)
    yield operations.Hold([0, 1], lambda t: bool(chance[round(t)]))
    yield operations.DelayOperation([0, 1], 3)
    yield operations.WrapOperation([0, 1])
    yield operations.Convert([0, 1], [1, 2], [(2.0, 1.0), (0.5, -1.0)])


@pytest.mark.parametrize("kind", range(6))
def test_plan_may_be_asked_ahead_and_left_in_the_middle(kind):
    """The rest of what was planned is taken by whoever makes the calls."""
    once, ahead = ([*one_of_each(np.random.default_rng(1))][kind] for _ in range(2))
    values = np.random.default_rng(2).standard_normal((60, 3))
    for k, row in enumerate(values):
        if k in (10, 50):
            ahead.ask_ahead(k + np.arange(40.0 if k == 10 else 10.0))
        ours, other = array("d", row), array("d", row)
        once(ours, float(k))
        ahead(other, float(k))
        assert ours.tobytes() == other.tobytes()


def test_many_times_are_rounded_as_each_is():
    rng = np.random.default_rng(5)
    counted = [
        np.arange(k, k + 200) * h for h in (0.01, 1e-6, 1 / 3, 2.0**-13) for k in (0, 10**6, 10**9)
    ]
    drawn = [rng.uniform(0.0, largest, 500) for largest in (1e-9, 1.0, 4500.0, 8192.0, 1e4)]
    for times in (*counted, *drawn, (rng.integers(0, 2**40, 500) + 0.5) / 1e12):
        assert round_to_places(times).tolist() == [round(t, 12) for t in times.tolist()]


def faults_of_chance(rng):
    """Each fault that draws, on two signals."""
    timed = {"rate": 3.0, "duration": (0.02, 0.4)}
    found = [
        {"kind": "noise", "std": [0.1, 2.0]},
        {"kind": "spikes", "size": 3.0, "rate": 40.0},
        {"kind": "spikes", "size": 3.0, **timed},
        {"kind": "dropout", "at": [0.3, 0.2, 9.0], "duration": 0.5},
        {"kind": "freeze", **timed},
    ]
    made = [faults.KINDS[f["kind"]].model_validate(f | {"signals": ["a.x", "a.y"]}) for f in found]
    return [fault.bind([0, 1], 0.01, np.random.default_rng(rng)) for fault in made]


@pytest.mark.parametrize("kind", range(5))
def test_faults_draw_the_same_for_many_calls_as_call_by_call(kind):
    once, ahead = (faults_of_chance(7)[kind] for _ in range(2))
    values = np.random.default_rng(2).standard_normal((4000, 2))
    times = np.arange(4000) * 0.01
    spans = {5: 1, 6: 1500, 1506: 2, 1508: 700, 2500: 1500}  # between them call by call
    for k, row in enumerate(values):
        if k in spans:
            ahead.ask_ahead(times[k : k + spans[k]])
        ours, other = array("d", row), array("d", row)
        once(ours, times[k])
        ahead(other, times[k])
        assert ours.tobytes() == other.tobytes()

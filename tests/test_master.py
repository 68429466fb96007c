"""The step loop: same numbers as plain Python, no spurious delay, faults, events, rates, failures."""

import errno
import gc
import json
import math
import os
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from support.plain import GAIN, with_unit
from support.project import COMPONENTS

import cosim
from cosim.fmu import component
from cosim.master.algorithm import Master, Messages
from cosim.results.log import LogWriter, Rows
from fmus.signals import Force


def run(content, out, **options):
    """(result, log) of a scenario given as a dict."""
    result = cosim.simulate(cosim.load_scenario(content), out, **options)
    return result, cosim.read_log(out)


def closed_loop_in_plain_python(steps, h=0.01):
    """The ellipse without faults, by the components' own functions: (x, y, psi, tau_X) at each row."""
    names = ("vessel", "thrusters", "observer_mdf", "guidance_ellipse", "controller_abs")
    V, T, O, G, C = (COMPONENTS[name] for name in names)  # noqa: E741
    v_p, t_p, o_p, g_p, c_p = (c.params() for c in (V, T, O, G, C))
    v = V.init(None, v_p)
    v_out = V.step(v, Force(), v_p, 0.0)[1]
    g = G.init(None, g_p)
    g_out = G.step(g, None, g_p, 0.0)[1]
    o_in = O.inputs(v_out.measured, Force())
    o = O.init(o_in, o_p)
    o_out = O.step(o, o_in, o_p, 0.0)[1]
    c_in = C.inputs(o_out, g_out)
    c = C.init(c_in, c_p)
    c_out = C.step(c, c_in, c_p, 0.0)[1]
    t = T.init(None, t_p)
    t_out = T.step(t, T.inputs(c_out.tau, v_out.velocity), t_p, 0.0)[1]
    rows = [(*v_out.pose, c_out.tau.tau_X)]
    for _ in range(steps):
        v, v_out = V.step(v, Force(t_out.tau_act_X, t_out.tau_act_Y, t_out.tau_act_N), v_p, h)
        commanded = Force(t_out.tau_cmd_X, t_out.tau_cmd_Y, t_out.tau_cmd_N)
        o, o_out = O.step(o, O.inputs(v_out.measured, commanded), o_p, h)
        g, g_out = G.step(g, None, g_p, h)
        c, c_out = C.step(c, C.inputs(o_out, g_out), c_p, h)
        t_out = T.step(t, T.inputs(c_out.tau, v_out.velocity), t_p, h)[1]
        rows.append((*v_out.pose, c_out.tau.tau_X))
    return np.array(rows)


def test_closed_loop_of_fmus_is_that_of_plain_python_to_the_bit(ellipse, tmp_path):
    _, log = run(ellipse | {"faults": [], "stop": 5.0}, tmp_path)
    got = np.column_stack([log[n] for n in ("vessel.x", "vessel.y", "vessel.psi", "controller.tau_X")])
    assert np.array_equal(got, closed_loop_in_plain_python(500))


def test_command_of_a_row_acts_from_its_time_to_the_next(ellipse, tmp_path):
    _, log = run(ellipse, tmp_path)
    V = COMPONENTS["vessel"]
    names = ("x", "y", "psi", "u", "v", "r")
    for k in (0, 1, 50, 150):
        state = V.state(*(float(log[f"vessel.{n}"][k]) for n in names))
        tau = Force(*(float(log[f"thrusters.tau_act_{a}"][k]) for a in "XYN"))
        after, _ = V.step(state, tau, V.params(), 0.01)
        assert after[:6] == tuple(log[f"vessel.{n}"][k + 1] for n in names)


def test_time_is_counted_and_rows_are_complete(ellipse, tmp_path):
    result, log = run(ellipse | {"step": 0.01, "stop": 3.3, "faults": []}, tmp_path)
    assert result.rows == 331
    assert log["time"][-1] == 3.3
    assert list(log["time"]) == [round(k * 0.01, 12) for k in range(331)]


def test_same_seed_gives_the_same_bytes_and_another_seed_does_not(ellipse, tmp_path):
    files = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        run(ellipse | {"seed": seed}, tmp_path / name)
        files.append((tmp_path / name / "log.csv").read_bytes())
    assert files[0] == files[1] != files[2]


def test_frozen_measurement_is_frozen_to_the_bit_though_noisy(ellipse, tmp_path):
    signals = ["observer.x_m", "observer.y_m", "observer.psi_m"]
    ellipse["faults"] = [
        {"kind": "freeze", "signals": signals, "at": [0.5], "duration": 0.3},
        {"kind": "noise", "signals": signals, "std": 0.001},
    ]
    _, log = run(ellipse, tmp_path)
    frozen = np.all([np.diff(log[s]) == 0.0 for s in signals], axis=0)
    assert list(np.flatnonzero(frozen) + 1) == list(range(50, 80))
    assert list(np.flatnonzero(log["observer.frozen"])) == list(range(50, 80))
    assert (log["vessel.x_m"] == log["vessel.x"]).all(), "the plant's own output stays true"


def test_fault_on_an_output_reaches_everyone_who_reads_it(ellipse, tmp_path):
    ellipse["fmus"]["second"] = {"path": "observer_mdf.fmu"}
    ellipse["connections"].append(["vessel.*", "second.*"])
    signals = ["vessel.x_m", "vessel.y_m", "vessel.psi_m"]
    ellipse["faults"] = [{"kind": "noise", "signals": signals, "std": 0.001}]
    _, log = run(ellipse, tmp_path)
    assert (log["observer.x_m"] == log["second.x_m"]).all()
    assert log["vessel.x_m"] - log["vessel.x"] == pytest.approx(0.0, abs=0.006)
    assert (log["vessel.x_m"] != log["vessel.x"]).mean() > 0.9


def chain(plain_fmu, algorithm, count=3):
    """A ramp through several gains of 2, listed against the flow."""
    source = plain_fmu(
        "Ramp", 'self.y = 0.0\nself.register_variable(Real("y", causality=Fmi2Causality.output))',
        "self.y = t + h\nreturn True", [('<Unknown index="1"', '<Unknown index="1" dependencies=""')],
    )  # fmt: skip
    gain = plain_fmu("Twice", GAIN, "self.y = 2.0 * self.x\nreturn True")
    names = [f"g{k}" for k in range(count)]
    flow = ["ramp", *names]
    return {
        "name": "chain", "step": 0.1, "stop": 2.0, "algorithm": algorithm,
        "fmus": {n: {"path": str(gain)} for n in reversed(names)} | {"ramp": {"path": str(source)}},
        "connections": [[f"{a}.y", f"{b}.x"] for a, b in zip(flow, names, strict=False)],
    }  # fmt: skip


def test_sequential_order_has_no_delay_and_simultaneous_one_for_each_connection(plain_fmu, tmp_path):
    content = chain(plain_fmu, "gauss_seidel")
    _, log = run(content, tmp_path / "gs")
    assert log["g2.y"][1:] == pytest.approx(8.0 * log["time"][1:])
    _, log = run(content | {"algorithm": "jacobi"}, tmp_path / "jacobi")
    assert log["g2.y"][4:] == pytest.approx(8.0 * (log["time"][4:] - 0.3))


def test_each_fmu_steps_at_its_own_rate(ellipse, tmp_path):
    ellipse["fmus"]["controller"]["step"] = 0.05
    ellipse["fmus"]["observer"]["step"] = 0.02
    result, log = run(ellipse, tmp_path)
    assert result.status == "done"
    changes = np.flatnonzero(np.diff(log["controller.tau_X"])) + 1
    assert set(changes) == set(range(5, 201, 5))
    changes = np.flatnonzero(np.diff(log["observer.x_hat"])) + 1
    assert set(changes) <= set(range(2, 201, 2))
    assert len(changes) > 80
    # What a slow FMU sees belongs to the instant at which it acts.
    assert (log["controller.x_t"][5::5] == log["guidance.x_t"][5::5]).all()


def event(time, action, value=None, model="thrusters", variable="tau_X"):
    e = {"time": time, "model": model, "variable": variable, "action": action}
    return e if value is None else e | {"value": value}


def test_events_on_an_input(ellipse, tmp_path):
    ellipse["faults"] = []
    ellipse["events"] = [
        event(0.5, "override", 0.25), event(0.6, "reset"), event(0.8, "bias", 0.1),
        event(0.9, "reset"), event(1.0, "hold"), event(1.1, "reset"),
    ]  # fmt: skip
    _, log = run(ellipse, tmp_path)
    seen, sent = log["thrusters.tau_X"], log["controller.tau_X"]
    assert (seen[51:61] == 0.25).all()
    assert (seen[61:81] == sent[61:81]).all()
    assert seen[81:91] == pytest.approx(sent[81:91] + 0.1)
    assert (seen[101:111] == seen[100]).all()
    assert (seen[111:] == sent[111:]).all()


def test_events_on_an_output_change_what_others_see(ellipse, tmp_path):
    ellipse["faults"] = []
    ellipse["events"] = [
        event(0.5, "override", 7.0, "guidance", "x_t"),
        event(0.7, "reset", None, "guidance", "x_t"),
    ]
    _, log = run(ellipse, tmp_path)
    assert (log["guidance.x_t"][51:71] == 7.0).all()
    assert (log["controller.x_t"][51:71] == 7.0).all()
    assert log["guidance.x_t"][71] < 6.0


def test_events_on_a_parameter(ellipse, tmp_path):
    ellipse["faults"] = []
    ellipse["events"] = [
        event(0.5, "override", -4.0, "vessel", "delta_X_u"),
        event(1.0, "reset", None, "vessel", "delta_X_u"),
        event(1.5, "bias", -1.0, "vessel", "delta_X_u"),
    ]
    _, log = run(ellipse, tmp_path)
    coefficient = log["vessel.omega_X"][1:] / log["vessel.u"][1:]
    expected = np.select(
        [log["time"][1:] > 1.501, log["time"][1:] > 1.001, log["time"][1:] > 0.501],
        [-1.0, 0.0, -4.0],
        0.0,
    )
    assert coefficient == pytest.approx(expected)


def test_event_at_the_start_acts_from_the_start(ellipse, tmp_path):
    ellipse["faults"] = []
    ellipse["events"] = [event(0.0, "override", 0.5)]
    _, log = run(ellipse, tmp_path)
    assert (log["thrusters.tau_X"] == 0.5).all()
    assert log["thrusters.tau_cmd_X"] == pytest.approx(0.5)


def test_units_are_converted_where_the_dimension_agrees(plain_fmu, tmp_path):
    degrees = plain_fmu(
        "Degrees", 'self.y = 0.0\nself.register_variable(Real("y", causality=Fmi2Causality.output))',
        "self.y = 90.0\nreturn True", with_unit("deg", 'rad="1" factor="0.017453292519943295"'),
    )  # fmt: skip
    kelvin = plain_fmu(
        "Celsius", 'self.y = 0.0\nself.register_variable(Real("y", causality=Fmi2Causality.output))',
        "self.y = 20.0\nreturn True", with_unit("degC", 'K="1" offset="273.15"'),
    )  # fmt: skip
    reader = plain_fmu("Reader", GAIN, edits=with_unit("K", 'K="1"'))
    content = {
        "name": "units", "step": 0.1, "stop": 1.0,
        "fmus": {
            "a": {"path": str(degrees)}, "observer": {"path": "observer_mdf.fmu"},
            "c": {"path": str(kelvin)}, "d": {"path": str(reader)},
        },
        "connections": [["a.y", "observer.psi_m"], ["c.y", "d.x"]],
    }  # fmt: skip
    _, log = run(content, tmp_path)
    assert log["observer.psi_m"][-1] == pytest.approx(math.pi / 2)
    assert log["d.x"][-1] == pytest.approx(293.15)


def test_whole_numbers_and_flags_travel_too(plain_fmu, tmp_path):
    init = """
        self.n, self.flag, self.n_in, self.flag_in = 0, False, 0, False
        self.register_variable(Integer("n", causality=Fmi2Causality.output))
        self.register_variable(Boolean("flag", causality=Fmi2Causality.output))
        self.register_variable(Integer("n_in", causality=Fmi2Causality.input))
        self.register_variable(Boolean("flag_in", causality=Fmi2Causality.input))
    """
    step = "self.n = self.n_in + 1\nself.flag = not self.flag_in\nreturn True"
    fmu = str(plain_fmu("Whole", init, step))
    content = {
        "name": "whole", "step": 0.1, "stop": 1.0,
        "fmus": {"a": {"path": fmu}, "b": {"path": fmu}},
        "connections": [["a.n", "b.n_in"], ["b.n", "a.n_in"], ["a.flag", "b.flag_in"]],
    }  # fmt: skip
    result, log = run(content, tmp_path)
    assert result.status == "done"
    assert "algebraic loop" in result.warnings[-1]
    assert log["b.n"][-1] == 20
    assert list(log["a.flag"][1:]) == [1.0] * 10
    assert list(log["b.flag"][1:]) == [0.0] * 10


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("if t > 0.45: return False\nreturn True", "returned discard"),
        ("if t > 0.45: raise ValueError('boom')\nreturn True", "returned fatal"),
        ("self.y = float('nan') if t > 0.45 else 1.0\nreturn True", "a.y is not finite at t = 0.6 s"),
        (
            "self.log('all is lost', Fmi2Status.error) if t > 0.45 else None\nreturn t < 0.45",
            "all is lost",
        ),
    ],
)
def test_failing_fmu_ends_the_run_and_the_log_is_kept(plain_fmu, tmp_path, step, message):
    name = f"Bad{abs(hash(step))}"
    content = {
        "name": "bad", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(plain_fmu(name, GAIN, step))}},
    }  # fmt: skip
    result, log = run(content, tmp_path / "out")
    assert result.status == "failed"
    assert message in result.message
    assert "a" in result.message
    assert 6 <= len(log["time"]) <= 7
    sidecar = json.loads((tmp_path / "out" / "log.json").read_text())
    assert sidecar["status"] == "failed"
    assert message in sidecar["message"]


def test_flood_of_messages_is_cut(plain_fmu, tmp_path):
    step = "for k in range(100): self.log(f'{k}', Fmi2Status.warning)\nreturn True"
    fmu = plain_fmu("Flood", GAIN, step)
    shown = []
    content = {"name": "flood", "step": 0.01, "stop": 1.0, "fmus": {"a": {"path": str(fmu)}}}
    result, _ = run(content, tmp_path, show=shown.append)
    assert result.status == "done"
    assert 200 <= len(shown) <= 203
    assert any("the rest is not shown" in line for line in shown)


def test_a_message_that_comes_again_at_once_is_shown_once_and_kept_each_time():
    shown = []
    messages = Messages(shown.append)
    for name, text in (("a", "low"), ("a", "low"), ("b", "low"), ("a", "low"), ("a", "high")):
        messages.add(name, 1, text)
    assert shown == ["a: low", "b: low", "a: low", "a: high"]
    assert [each["text"] for each in messages.kept] == ["low"] * 4 + ["high"]
    assert messages.count == 5


def test_selected_signals_and_decimation(ellipse, tmp_path):
    ellipse["log"] = {"signals": ["vessel.x", "observer.*_m", "vessel.X_u", "vessel.x"], "every": 10}
    _, log = run(ellipse, tmp_path)
    assert list(log) == [
        "time",
        "vessel.x",
        "observer.x_m",
        "observer.y_m",
        "observer.psi_m",
        "vessel.X_u",
    ]
    assert log["time"] == pytest.approx(np.arange(21) * 0.1)
    assert (log["vessel.X_u"] == -0.6555).all()
    everything, full = run(ellipse | {"log": {}}, tmp_path / "full")
    assert (full["vessel.x"][::10] == log["vessel.x"]).all()
    assert everything.rows == 201


def test_sidecar_says_what_ran(ellipse, tmp_path):
    result, log = run(ellipse, tmp_path)
    sidecar = json.loads((tmp_path / "log.json").read_text())
    assert sidecar["status"] == "done"
    assert list(sidecar["columns"]) == list(log)
    assert sidecar["columns"]["vessel.u"] == {"unit": "m/s", "description": "surge velocity, forward"}
    assert sidecar["seed"] == 0
    assert len(sidecar["fmus"]["vessel"]["sha256"]) == 64
    assert sidecar["order"] == ["vessel", "observer", "guidance", "controller", "thrusters"]
    assert ["vessel.x_m", "observer.x_m"] in sidecar["scenario"]["connections"]
    again = cosim.load_scenario(sidecar["scenario"])
    cosim.simulate(again, tmp_path / "again")
    assert (tmp_path / "again" / "log.csv").read_bytes() == (tmp_path / "log.csv").read_bytes()
    assert result.warnings == []


def test_bytes_do_not_depend_on_when_blocks_are_written(tmp_path):
    """Rows with NaN beside rows without, in blocks of any length."""
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.arange(50.0), rng.normal(0, 1e-6, (50, 3))])
    rows[20:30, 2] = np.nan
    rows[31, 1] = np.inf
    texts = set()
    for length in (1, 7, 50):
        writer = LogWriter(tmp_path / "log.csv", ["time", "a", "b", "c"])
        for k in range(0, 50, length):
            some = rows[k : k + length]
            writer.write(Rows(some[:, 0], some, np.arange(1, 4)))
        writer.close()
        texts.add((tmp_path / "log.csv").read_bytes())
    assert len(texts) == 1
    log = cosim.read_log(tmp_path)
    assert np.array_equal(np.column_stack(list(log.values())), rows, equal_nan=True)


def test_namespace_of_a_python_fmu_outlives_it_and_is_empty(plain_fmu, tmp_path, monkeypatch):
    # Its class does, as the library never lets go of it; without the namespace it would point to freed memory.
    held, hold = [], component._hold
    monkeypatch.setattr(component, "_hold", lambda namespace: (held.append(namespace), hold(namespace)))
    fmu = plain_fmu("Survivor", GAIN)
    fmus = {"a": {"path": str(fmu)}}
    content = {"name": "one", "step": 0.1, "stop": 0.3, "fmus": fmus, "connections": []}
    run(content, tmp_path / "out")
    gc.collect()
    (namespace,) = held
    held.clear()
    assert namespace == {}
    del namespace
    gc.collect()
    run(content, tmp_path / "again")  # what the library still has of the first one does no harm
    held.clear()
    there = [o for o in gc.get_objects() if isinstance(o, ModuleType) and o.__name__ == "Survivor"]
    assert not any("resources" in str(module.__file__) for module in there)


def test_events_on_an_input_without_source(tmp_path):
    content = {
        "name": "free", "step": 0.01, "stop": 0.5,
        "fmus": {"vessel": {"path": "vessel.fmu", "parameters": {"tau_X": 0.2}}},
        "events": [event(0.1, "bias", 0.1, "vessel"), event(0.2, "override", 0.7, "vessel"),
                   event(0.3, "reset", None, "vessel")],
    }  # fmt: skip
    _, log = run(content, tmp_path)
    seen = log["vessel.tau_X"]
    assert (seen[:11] == 0.2).all()
    assert seen[11:21] == pytest.approx(0.3)
    assert (seen[21:31] == 0.7).all()
    assert (seen[31:] == 0.2).all()


def test_second_event_does_not_repeat_the_first(ellipse, tmp_path):
    ellipse["algorithm"] = "jacobi"
    ellipse["faults"] = []
    ellipse["events"] = [
        event(0.3, "bias", 10.0, "guidance", "x_t"), event(0.6, "bias", 1.0, "guidance", "y_t"),
    ]  # fmt: skip
    _, log = run(ellipse, tmp_path)
    assert log["guidance.x_t"][31:].max() < 16.0
    assert log["controller.x_t"][32:].max() < 16.0


def test_failed_set_up_leaves_no_older_result(plain_fmu, tmp_path):
    good = plain_fmu("Good", GAIN)
    bad = plain_fmu("BadStart", GAIN + "\nself.enter_initialization_mode = lambda: 1 / 0\n")
    for fmu, status in ((good, "done"), (bad, "failed")):
        content = {"name": "s", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(fmu)}}}
        assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == status
        assert json.loads((tmp_path / "out" / "log.json").read_text())["status"] == status
    assert not (tmp_path / "out" / "log.csv").exists()


@pytest.mark.parametrize("folder", ["with#sharp münchen", "50%"])
def test_temporary_folder_may_have_any_name(ellipse, tmp_path, monkeypatch, folder):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / folder))
    (tmp_path / folder).mkdir()
    assert run(ellipse | {"stop": 0.1}, tmp_path / "out")[0].status == "done"


def test_numbers_too_large_for_an_integer_are_refused(plain_fmu, tmp_path):
    init = """
        self.n = 0
        self.register_variable(Integer("n", causality=Fmi2Causality.input))
    """
    fmu = plain_fmu("Large", init)
    content = {
        "name": "large", "step": 0.1, "stop": 1.0,
        "fmus": {"a": {"path": str(fmu), "parameters": {"n": 2**40}}},
    }  # fmt: skip
    with pytest.raises(cosim.InputError, match="type Integer"):
        run(content, tmp_path)
    content["fmus"]["a"]["parameters"] = {}
    content["events"] = [event(0.2, "bias", 1e300, "a", "n")]
    result, _ = run(content, tmp_path)
    assert result.status == "failed"
    assert "not a 32-bit number" in result.message


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, math.inf])
def test_pace_that_is_none_is_refused(factor, ellipse, tmp_path):
    with pytest.raises(cosim.InputError, match="positive factor"):
        cosim.simulate(cosim.load_scenario(ellipse), tmp_path / "out", realtime=factor)
    assert not (tmp_path / "out").exists()


def test_log_does_not_write_into_a_file_that_took_its_place(tmp_path):
    """An FMU may close whatever is open, and open a file of its own."""
    writer = LogWriter(tmp_path / "log.csv", ["time", "a"])
    rows = Rows(np.array([0.0]), np.array([[1.0]]), np.array([0], np.intp))
    writer.write(rows)
    other = os.open(tmp_path / "other", os.O_CREAT | os.O_WRONLY)
    os.dup2(other, writer._file.fileno())
    for _ in range(2):
        with pytest.raises(OSError, match="another part of the program closed its file") as stated:
            writer.write(rows)
        assert stated.value.errno == errno.EBADF
    assert writer.rows == 1
    os.close(other)
    assert (tmp_path / "other").read_bytes() == b""
    assert (tmp_path / "log.csv").read_text().count("\n") == 2


class CalledStepper:
    """Notes its calls; steps every so many base steps."""

    def __init__(self, number, every, calls):
        self.number, self.every = number, every
        for name in ("exchange", "begin", "settle", "advance"):
            setattr(self, name, lambda t, *_, name=name: calls.append((number, name, round(t, 9))))


def mastered(algorithm):
    """A master of three FMUs that step every 1, 2 and 3 base steps of 0.1 s, and what it calls."""
    calls = []
    master = object.__new__(Master)
    master.system = SimpleNamespace(steps=6, scenario=SimpleNamespace(algorithm=algorithm, step=0.1))
    master.steppers = [CalledStepper(k, k + 1, calls) for k in range(3)]
    master._events = []
    return master, calls


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_an_fmu_steps_from_its_last_step_with_the_inputs_of_its_algorithm(algorithm):
    master, calls = mastered(algorithm)
    assert list(master.run()) == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    jacobi = algorithm == "jacobi"
    for number, every in enumerate((1, 2, 3)):
        ends = [k for k in range(1, 7) if k % every == 0]
        mine = [(name, t) for n, name, t in calls if n == number]
        for name, back in (("exchange", 1 if jacobi else 0), ("advance", every)):
            assert [t for called, t in mine if called == name] == pytest.approx(
                [0.1 * (k - back) for k in ends]
            )
        assert [t for called, t in mine if called == "begin"] == pytest.approx(
            [0.1 * (k - every) for k in ends if jacobi]
        )
    last = [(n, name) for n, name, t in calls[-9 if jacobi else -6 :]]
    order = [(n, name) for name in ("exchange", "begin", "advance") for n in range(3)]
    assert last == (
        order if jacobi else [(n, name) for n in range(3) for name in ("exchange", "advance")]
    )


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize(("k", "after"), [(6, [1, 2]), (5, []), (4, [1]), (3, [2])])
def test_the_rest_of_a_step_in_which_the_compiled_loop_has_stopped(algorithm, k, after):
    master, calls = mastered(algorithm)
    master.finish_step(k, master.steppers[0], 0, False)
    assert calls[0] == (0, "settle", round(0.1 * (k - 1), 9))
    assert [(n, t) for n, name, t in calls if name == "advance"] == [
        (n, round(0.1 * (k - n - 1), 9)) for n in after
    ]
    exchanged = [] if algorithm == "jacobi" else [(n, round(0.1 * k, 9)) for n in after]
    assert [(n, t) for n, name, t in calls if name == "exchange"] == exchanged


def test_values_that_must_stay_finite_are_the_real_ones_that_fmus_write():
    def got(name, kind):
        return SimpleNamespace(name=name, variable=SimpleNamespace(type=kind))

    steppers = [
        SimpleNamespace(got=[got("a.x", "Real"), got("a.count", "Integer")]),
        SimpleNamespace(got=[]),
        SimpleNamespace(got=[got("b.on", "Boolean"), got("b.y", "Real"), got("b.text", "String")]),
    ]
    assert Master.outputs.fget(SimpleNamespace(steppers=steppers)) == ["a.x", "b.y"]

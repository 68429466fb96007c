"""An FMU in a process of its own: the same numbers, and whatever it does to itself is one message."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.cosim_run import start
from support.events import once_there
from support.foreign import ANY_STEP, STATE, build_lag, needs_compiler
from support.plain import GAIN
from support.project import ROOT

import cosim

# A watching thread that dies would be told as a warning only.
pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")


def one(path, **entry):
    return {
        "name": "one", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(path), "isolate": True} | entry},
    }  # fmt: skip


def children(pid):
    """Processes whose parent is pid, zombies included."""
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False
    )
    return [int(line) for line in listed.stdout.split()]


def alive(pid):
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def gone(workers):
    return once_there(lambda: not any(map(alive, workers)))


@pytest.fixture(autouse=True)
def _nothing_is_left():
    """No test may leave a process behind, alive or dead."""
    before = set(children(os.getpid()))
    yield
    left = [pid for pid in set(children(os.getpid())) - before if Path(f"/proc/{pid}").exists()]
    assert left == []


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
@pytest.mark.parametrize(
    "names", [["observer"], ["vessel", "thrusters", "observer", "guidance", "controller"]]
)
def test_numbers_are_the_same_to_the_bit(ellipse, tmp_path, algorithm, names):
    ellipse |= {"algorithm": algorithm, "stop": 1.0}
    ellipse["fmus"]["controller"]["step"] = 0.02
    signals = ["observer.x_m", "observer.y_m", "observer.psi_m"]
    ellipse["faults"].append({"kind": "dropout", "signals": signals, "at": [0.5], "duration": 0.1})
    ellipse["events"] = [
        {"time": 0.3, "model": "vessel", "variable": "delta_X_u", "action": "override", "value": -4.0},
        {"time": 0.6, "model": "observer", "variable": "x_hat", "action": "bias", "value": 0.1},
    ]
    for name, chosen in (("together", []), ("apart", names)):
        for instance, entry in ellipse["fmus"].items():
            entry["isolate"] = instance in chosen
        assert cosim.simulate(cosim.load_scenario(ellipse), tmp_path / name).status == "done"
    one, other = ((tmp_path / name / "log.csv").read_bytes() for name in ("together", "apart"))
    assert one == other
    assert b"nan" in one


def test_strings_whole_numbers_flags_and_messages_pass(plain_fmu, tmp_path):
    init = """
        self.text, self.n, self.flag, self.length = "", 0, False, 0
        self.register_variable(String("text", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Integer("n", causality=Fmi2Causality.input))
        self.register_variable(Boolean("flag", causality=Fmi2Causality.output))
        self.register_variable(Integer("length", causality=Fmi2Causality.output))
    """
    step = """
        self.flag, self.length = not self.flag, self.n + len(self.text)
        self.log(self.text, Fmi2Status.warning)
        return True
    """
    fmu, text = plain_fmu("Mixed", init, step), "blåbær\n\"'{}"
    shown = []
    content = one(fmu, parameters={"text": text, "n": 5})
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out", show=shown.append)
    assert result.status == "done"
    log = cosim.read_log(tmp_path / "out")
    assert list(log["a.flag"]) == [0.0, 1.0] * 5 + [0.0]
    assert (log["a.length"][1:] == 5 + len(text)).all()
    assert sum("blåbær" in line for line in shown) == 1, "the same in each step"


CRASHES = {
    "os._exit(7)": "its process died in the step from t = 0.5 s (exit code 7)",
    "import ctypes; ctypes.string_at(0)": "its process died in the step from t = 0.5 s (signal 11, SIGSEGV)",
    "time.sleep(1000)": "the step from t = 0.5 s took longer than 1 s; its process was ended",
    "raise ValueError('boom')": "the step from t = 0.5 s returned fatal",
}


@pytest.mark.parametrize("what", CRASHES)
def test_crash_or_hang_ends_in_one_message_with_the_log_kept(plain_fmu, tmp_path, what):
    fmu = plain_fmu(f"Crash{abs(hash(what))}", GAIN, f"if t > 0.45: {what}\nself.y = t\nreturn True")
    content = one(fmu, timeout=1.0)
    content["fmus"]["b"] = content["fmus"]["a"] | {"isolate": False, "path": "guidance_ellipse.fmu"}
    del content["fmus"]["b"]["timeout"]
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert result.status == "failed"
    assert result.message.startswith(f"a: {CRASHES[what]}")
    assert json.loads((tmp_path / "out" / "log.json").read_text())["message"] == result.message
    assert list(cosim.read_log(tmp_path / "out")["a.y"]) == pytest.approx([0, 0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(
    ("init", "message"),
    [
        ("os._exit(3)", "its process died in its instantiation"),
        ("self.enter_initialization_mode = lambda: os._exit(3)", "died in fmi2EnterInitializationMode"),
        (
            "self.setup_experiment = lambda *_: time.sleep(99)",
            "fmi2SetupExperiment took longer than 1 s",
        ),
    ],
)
def test_crash_before_the_first_step_is_one_message_too(plain_fmu, tmp_path, init, message):
    # The instance that pythonfmu makes to write the description must survive.
    survive = f"if 'pytest' not in __import__('sys').modules: {init}"
    fmu = plain_fmu(f"Early{abs(hash(init))}", f"{GAIN}\n{survive}\n")
    result = cosim.simulate(cosim.load_scenario(one(fmu, timeout=1.0)), tmp_path / "out")
    assert result.status == "failed"
    assert message in result.message


def test_crash_at_the_end_does_not_spoil_the_run(plain_fmu, tmp_path):
    fmu = plain_fmu("Late", f"{GAIN}\nself.terminate = lambda: os._exit(3)\n")
    shown = []
    result = cosim.simulate(cosim.load_scenario(one(fmu)), tmp_path / "out", show=shown.append)
    assert result.status == "done"
    assert any("died in fmi2Terminate (exit code 3)" in line for line in shown)


def test_a_hang_at_the_end_does_not_spoil_the_run(plain_fmu, tmp_path):
    fmu = plain_fmu("Stays", f"{GAIN}\nself.terminate = lambda: time.sleep(99)\n")
    shown = []
    scenario = cosim.load_scenario(one(fmu, timeout=1.0))
    result = cosim.simulate(scenario, tmp_path / "out", show=shown.append)
    assert result.status == "done"
    assert any("fmi2Terminate took longer than 1 s" in line for line in shown)


def test_refused_instantiation_is_bad_input(plain_fmu, tmp_path, capfd):
    fmu = plain_fmu(
        "Refuses",
        GAIN + "\nif 'pytest' not in __import__('sys').modules: raise ValueError('not today')\n",
    )
    with pytest.raises(cosim.InputError, match="cannot be instantiated as 'a'"):
        cosim.simulate(cosim.load_scenario(one(fmu)), tmp_path / "out", show=print)
    assert not (tmp_path / "out").exists()
    printed = "".join(capfd.readouterr())
    assert "died" not in printed
    assert "AttributeError" not in printed


def test_two_versions_that_share_module_names_run_side_by_side(plain_fmu, tmp_path):
    paths = [
        plain_fmu("Version", GAIN, f"self.y = {k}.0\nreturn True").rename(tmp_path / f"v{k}.fmu") for k in (1, 2)
    ]  # fmt: skip
    content = one(paths[0])
    content["fmus"]["b"] = {"path": str(paths[1]), "isolate": True}
    cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    log = cosim.read_log(tmp_path / "out")
    assert (log["a.y"][-1], log["b.y"][-1]) == (1.0, 2.0)


def test_simultaneous_steps_are_taken_at_the_same_time(plain_fmu, tmp_path):
    """Each FMU waits in its step until all four are in theirs."""
    (marks := tmp_path / "marks").mkdir()
    step = f"""
        open({str(marks)!r} + f"/{{t:.1f}}_{{os.getpid()}}", "w").close()
        while len([name for name in os.listdir({str(marks)!r}) if name.startswith(f"{{t:.1f}}_")]) < 4:
            time.sleep(0.01)
        return True
    """
    fmu = str(plain_fmu("Meets", GAIN, step))
    content = one(fmu) | {"algorithm": "jacobi"}
    content["fmus"] = {name: {"path": fmu, "isolate": True} for name in "abcd"}
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert (result.status, len(list(marks.iterdir()))) == ("done", 40)


def test_what_it_prints_goes_to_standard_error(plain_fmu, tmp_path):
    fmu = plain_fmu("Prints", GAIN, "print('to the world', t)\nreturn True")
    path = tmp_path / "s.json"
    path.write_text(json.dumps(one(fmu)))
    done = subprocess.run(
        [sys.executable, "-m", "cosim.run", str(path), "--out", str(tmp_path / "out"), "--no-plots"],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stderr.count("to the world") == 10
    assert "to the world" not in done.stdout


def test_it_reads_nothing_from_standard_input(plain_fmu, tmp_path):
    """The messages of the process are not for it."""
    fmu = plain_fmu("Reads", GAIN, "assert os.read(0, 1) == b''\nreturn True")
    assert cosim.simulate(cosim.load_scenario(one(fmu)), tmp_path / "out").status == "done"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.parametrize("last", ["return True", "os._exit(0)"])
def test_what_an_fmu_has_started_ends_with_it(plain_fmu, tmp_path, last):
    mark = tmp_path / "pid"
    step = f"""
        if t == 0.0:
            if child := os.fork():
                open({str(mark)!r}, "w").write(str(child))
            else:
                time.sleep(1000)
        {last}
    """
    cosim.simulate(
        cosim.load_scenario(one(plain_fmu(f"Forks{len(last)}", GAIN, step), timeout=1.0)),
        tmp_path / "out",
    )
    assert gone([int(mark.read_text())])


@pytest.fixture
def running(ellipse, plain_fmu, tmp_path):
    """A long run with an isolated observer and an isolated FMU that hangs at t = 10 s if that is wanted."""
    processes = []

    def begin(hang):
        mark = tmp_path / "hangs"
        loop = f"if t > 10.0: open({str(mark)!r}, 'w').close()\nwhile t > 10.0: pass\nreturn True"
        lazy = plain_fmu("Lazy", GAIN, loop if hang else "return True")
        ellipse["fmus"]["observer"]["isolate"] = True
        ellipse["fmus"]["lazy"] = {"path": str(lazy), "isolate": True}
        path = tmp_path / "scenario.json"
        path.write_text(json.dumps(ellipse | {"stop": 10000.0}))
        process = start(path, tmp_path / "out")
        assert once_there(lambda: mark.exists() or not hang)
        (simulating,) = children(process.pid)
        workers = children(simulating)
        assert len(workers) == 2
        processes.append(process)
        return process, workers

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


def test_interrupted_run_keeps_its_log_and_leaves_no_process(running, tmp_path):
    process, workers = running(hang=False)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate()
    assert process.returncode == 130
    assert "interrupted: " in stderr
    assert "Traceback" not in stderr
    assert len(cosim.read_log(tmp_path / "out")["time"]) > 10
    assert gone(workers)


@pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM])
def test_second_interrupt_does_not_wait_for_an_fmu_that_hangs(running, tmp_path, first):
    process, workers = running(hang=True)
    for number in (first, signal.SIGINT):
        process.send_signal(number)
        time.sleep(0.3)
    _, stderr = process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in stderr
    assert len(cosim.read_log(tmp_path / "out")["time"]) >= 1000
    assert gone(workers)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process ends after its present call")
@pytest.mark.parametrize("hang", [False, True])
def test_processes_die_with_a_master_that_is_killed(running, hang):
    process, workers = running(hang)
    process.kill()
    process.communicate()
    assert gone(workers)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process ends after its present call")
def test_process_ends_with_the_one_that_has_started_it():
    child = (
        "import os, time\nfrom cosim.process.spawned import end_with_parent\n"
        "end_with_parent(os.getppid()); print(os.getpid(), flush=True); time.sleep(60)"
    )
    parent = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {child!r}])"
    started = subprocess.Popen(
        [sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    pid = int(started.stdout.readline())
    assert alive(pid)
    started.kill()
    started.wait()
    assert gone([pid])


def test_timeout_without_a_process_is_refused():
    with pytest.raises(cosim.InputError, match='timeout needs "isolate": true'):
        cosim.load_scenario(one("x.fmu", isolate=False, timeout=3.0))


@needs_compiler
def test_compiled_fmu_that_discards_is_done_again_in_its_process_too(tmp_path):
    habit = "if (t < 0.437 && t + h > 0.437 + 1e-12) { m->last = 0.437; return 2; }"
    fmu = build_lag(tmp_path, "lag", habit, f"{ANY_STEP} {STATE}")
    logs = []
    for isolate in (False, True):
        content = one(fmu, isolate=isolate, parameters={"in[1]": 1.0})
        assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == "done"
        logs.append((tmp_path / "out" / "log.csv").read_bytes())
    assert logs[0] == logs[1]

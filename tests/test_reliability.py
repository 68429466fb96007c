"""A run that ends, however it ends, says so: exit code, log.json, one line, whole rows."""

import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.command import command as in_this_process
from support.command import main_of
from support.cosim_run import in_a_process as command
from support.plain import GAIN
from support.project import ROOT

import cosim
from benchmarks.reliability import (
    campaigns,
    endings,
    killed_commands,
    mutations,
    sanitized,
    ship_mutations,
)
from benchmarks.reliability.judgement import faults
from cosim import files
from cosim.command import printable
from cosim.results.log import LogWriter
from cybership import scratch_folder
from cybership.message_text import LONGEST_WORD
from cybership.user_cache import make_folder

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="no binary for this test here")


def alone(path, **more):
    return {"name": "alone", "step": 0.01, "stop": 0.2, "fmus": {"bad": {"path": str(path)}}} | more


def run_alone(fmu, tmp_path, **options):
    (tmp_path / "s.json").write_text(json.dumps(alone(fmu)))
    return command(tmp_path / "s.json", "--out", tmp_path / "out", "--no-plots", **options)


DEATHS = {
    "__import__('ctypes').CDLL(None).exit(0)": "exit code 0",
    "__import__('ctypes').string_at(0)": "signal 11, SIGSEGV",
    "os.kill(os.getpid(), 15)": "signal 15, SIGTERM",
}


@linux_only
@pytest.mark.parametrize("death", DEATHS)
def test_death_of_the_simulating_process_is_one_line_and_no_row_is_lost(plain_fmu, tmp_path, death):
    fmu = plain_fmu(f"Dies{abs(hash(death))}", GAIN, f"if t > 0.095: {death}\nreturn True")
    done = run_alone(fmu, tmp_path)
    assert done.returncode == 3
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error")]
    assert line.startswith(f"error: bad: the simulating process died in a step ({DEATHS[death]})")
    stated = json.loads((tmp_path / "out" / "log.json").read_text())
    assert stated["status"] == "failed"
    assert DEATHS[death] in stated["message"]
    time = cosim.read_log(tmp_path / "out")["time"]
    assert stated["rows"] == len(time) == 11
    assert np.allclose(time, np.arange(11) * 0.01)


@linux_only
def test_death_before_the_first_row_replaces_the_earlier_run(plain_fmu, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "log.csv").write_text("time,a.y\n0.0,1.0\n")
    (tmp_path / "out" / "log.json").write_text("{}")
    # The instance that pythonfmu makes to write the description must survive.
    die = "if 'pytest' not in __import__('sys').modules: os._exit(0)"
    done = run_alone(plain_fmu("Early", f"{GAIN}\n{die}\n"), tmp_path)
    assert done.returncode == 3
    assert "bad: the simulating process died in its instantiation (exit code 0)" in done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"log.json"}
    stated = json.loads((tmp_path / "out" / "log.json").read_text())
    assert (stated["status"], stated["rows"], stated["scenario"]["name"]) == ("failed", 0, "alone")


@linux_only
def test_copy_that_an_fmu_makes_by_fork_writes_nothing(plain_fmu, tmp_path):
    fmu = plain_fmu("Doubles", GAIN, "if 0.095 < t < 0.105: os.fork()\nreturn True")
    done = run_alone(fmu, tmp_path)
    assert done.returncode == 0
    assert faults(0, done.stderr, tmp_path / "out", {0}) == []
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 21


class Short(io.FileIO):
    """A file that takes less than it is given, and some time nothing."""

    room = 0

    def write(self, data):
        count = min(len(data), random.Random(self.room).randint(1, 5000), self.room)
        self.room -= count
        if not count:
            raise OSError(28, "No space left on device")
        return super().write(bytes(data[:count]))


@pytest.mark.parametrize("room", [10**9, 70_001])
def test_short_writes_lose_nothing_and_a_full_disk_leaves_whole_rows(
    ellipse, tmp_path, monkeypatch, room
):
    scenario = cosim.load_scenario(ellipse | {"stop": 5.0})
    whole = cosim.simulate(scenario, tmp_path / "whole")
    make = LogWriter.__init__

    def short(self, path, columns, **options):
        make(self, path, columns, **options)
        position = self._file.tell()
        self._file.close()
        self._file = Short(path, "r+")
        self._file.room = room
        self._file.seek(position)

    monkeypatch.setattr(LogWriter, "__init__", short)
    result = cosim.simulate(scenario, tmp_path / "short")
    names = (tmp_path / name / "log.csv" for name in ("whole", "short"))
    log, cut = (path.read_bytes() for path in names)
    assert log.startswith(cut)
    assert cut.endswith(b"\n")
    stated = json.loads((tmp_path / "short" / "log.json").read_text())
    assert stated["rows"] == result.rows == cut.count(b"\n") - 1
    assert stated["status"] == result.status == ("done" if room > len(log) else "failed")
    if room < len(log):
        assert 0 < result.rows < whole.rows
        assert "No space left" in stated["message"]


def test_status_is_written_though_no_new_file_can_be(ellipse, tmp_path, monkeypatch):
    def full(path, content):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "write_json", full)
    stated = {"messages": ["x" * 9000], "message": "y" * 9000, "rows": 7, "status": "failed"}
    files.write_roomy_json(tmp_path / "log.json", {"scenario": ellipse, "status": "running"})
    size = (tmp_path / "log.json").stat().st_size
    files.update_json(tmp_path / "log.json", {"scenario": ellipse}, stated)
    assert (tmp_path / "log.json").stat().st_size == size
    read = json.loads((tmp_path / "log.json").read_text())
    assert (read["scenario"], read["rows"], read["status"]) == (ellipse, 7, "failed")
    assert read["message"].startswith("yyy")


COMMANDS = (
    ["cosim.run", "scenarios/ellipse.json"], ["cosim.metrics", "nowhere"], ["cosim.plots", "nowhere"],
    ["cosim.export", "scenarios/ellipse.json", "--ssp", "/dev/null/x"], ["cosim.scenario"],
    ["cosim.interface", "scenarios/ellipse.json"], ["fmus.build", "--list"], ["fmus.check", "vessel"],
    ["diagnosis.learn", "nowhere"], ["diagnosis.compare", "nowhere"],
)  # fmt: skip


@linux_only
@pytest.mark.parametrize(
    ("arguments", "number"),
    [*((c, signal.SIGINT) for c in COMMANDS), (COMMANDS[0], signal.SIGTERM)],
    ids=lambda x: x[0] if isinstance(x, list) else x.name,
)
def test_interrupt_while_it_imports_is_one_line(tmp_path, arguments, number):
    process = subprocess.Popen(
        [sys.executable, "-m", *arguments], cwd=ROOT, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    while process.poll() is None and not endings.catches(process.pid):
        time.sleep(0.0005)
    process.send_signal(number)
    _, stderr = process.communicate()
    assert (process.returncode, stderr) == (130, "interrupted\n")


def test_import_installs_no_handlers():
    code = (
        "import signal; numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)\n"
        "before = [signal.getsignal(n) for n in numbers]\n"
        "import cosim, cosim.master, cosim.export, cosim.run, cosim.metrics, cosim.plots, fmus.build\n"
        "assert before == [signal.getsignal(n) for n in numbers]"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def interrupt_twice(tmp_path):
    """Ctrl-C, two times, for a run that has come to where its FMU hangs."""
    process = subprocess.Popen(
        [sys.executable, "-m", "cosim.run", tmp_path / "s.json", "--out", tmp_path / "out"],
        cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout.readline() == "here\n"
    for _ in range(2):
        process.send_signal(signal.SIGINT)
        time.sleep(0.3)
    _, stderr = process.communicate()
    assert faults(process.returncode, stderr, tmp_path / "out", {130}) == []


@linux_only
@pytest.mark.parametrize(
    "hang", ["while True: pass", "__import__('ctypes').PyDLL(None).sleep(1000)"], ids=["Python", "C"]
)
def test_second_ctrl_c_ends_a_hanging_fmu(plain_fmu, tmp_path, hang):
    fmu = plain_fmu(
        f"Hangs{len(hang)}",
        GAIN,
        f"if t > 0.095:\n    print('here', flush=True)\n    {hang}\nreturn True",
    )
    (tmp_path / "s.json").write_text(json.dumps(alone(fmu)))
    interrupt_twice(tmp_path)
    assert len(cosim.read_log(tmp_path / "out")["time"]) >= 10


@linux_only
def test_ctrl_c_ends_an_fmu_that_hangs_while_it_terminates(plain_fmu, tmp_path):
    hang = "def stay():\n    print('here', flush=True)\n    while True: pass\nself.terminate = stay"
    (tmp_path / "s.json").write_text(json.dumps(alone(plain_fmu("Stays", f"{GAIN}\n{hang}\n"))))
    interrupt_twice(tmp_path)
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 21


def test_interrupt_while_metrics_are_computed_is_told_in_the_log(ellipse, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.results.performance.compute", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cosim.simulate(cosim.load_scenario(ellipse | {"stop": 0.1}), tmp_path / "out")
    stated = json.loads((tmp_path / "out" / "log.json").read_text())
    assert (stated["status"], stated["rows"]) == ("interrupted", 11)
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 11


def test_interrupt_during_instantiation_is_no_bad_input(plain_fmu, tmp_path):
    slow = "if 'pytest' not in __import__('sys').modules:\n    print('here', flush=True)\n    time.sleep(1.0)"
    (tmp_path / "s.json").write_text(json.dumps(alone(plain_fmu("Slow", f"{GAIN}\n{slow}\n"))))
    process = subprocess.Popen(
        [sys.executable, "-m", "cosim.run", tmp_path / "s.json", "--out", tmp_path / "out"],
        cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout.readline() == "here\n"
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate()
    assert process.returncode == 130
    assert stderr.splitlines()[1:] == ["interrupted"]  # after a warning of its free input
    assert not (tmp_path / "out").exists()


def test_failed_initialisation_is_no_row_of_zeros(tmp_path):
    singular = {"path": "vessel.fmu", "parameters": {"m": 0.0, "X_udot": 0.0}}
    content = {"name": "s", "step": 0.01, "stop": 1.0, "fmus": {"ship": singular}}
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert (result.status, result.rows) == ("failed", 0)
    assert result.message.startswith("ship (vessel.fmu): fmi2ExitInitializationMode failed")
    assert "initialisation failed" in result.message
    assert "division by zero" in result.message
    assert not (tmp_path / "out" / "log.csv").exists()


@pytest.mark.parametrize(
    "wrong",
    [{"step": "0.01"}, {"stop": True}, {"seed": "7"}, {"seed": True}, {"name": 7}, {"seed": 1.0}],
)
def test_values_of_another_type_are_refused(ellipse, wrong):
    (key,) = wrong
    with pytest.raises(cosim.InputError, match=f"scenario: {key}: Input should be a valid"):
        cosim.load_scenario(ellipse | wrong)


def test_control_characters_do_not_reach_the_terminal(plain_fmu, tmp_path):
    fmu = plain_fmu("Colours", GAIN, "self.log('\\x1b[31mred\\x07', Fmi2Status.warning)\nreturn True")
    content = alone(fmu, name="n\x1b[2J", log={"signals": ["bad.\x1b]0;title\x07"]})
    for changes in ({}, {"log": {}}):
        (tmp_path / "s.json").write_text(json.dumps(content | changes))
        done = command(
            tmp_path / "s.json", "--no-plots", cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}
        )
        assert "\\x1b" in done.stderr
        assert not {c for c in done.stderr + done.stdout if ord(c) < 32} - {"\n"}


def test_long_names_are_cut():
    shown = printable("no such FMU: '" + "x" * 5000 + "'")
    assert len(shown) < LONGEST_WORD + 50
    assert shown.startswith("no such FMU: 'xxx")
    assert "..." in shown
    assert shown.endswith("x'")


def test_scratch_folders_of_killed_runs_are_swept_and_those_of_others_not(
    ellipse, tmp_path, monkeypatch
):
    ended = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"],
        capture_output=True,
        text=True,
        check=True,
    )
    for name in (
        f"cybership_{ended.stdout.strip()}_a",
        f"cybership_{os.getpid()}_b",
        "cybership_mine",
        "other",
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text("")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    cosim.simulate(cosim.load_scenario(ellipse | {"stop": 0.1}), tmp_path / "out")
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {f"cybership_{os.getpid()}_b", "cybership_mine", "other", "out"}


@linux_only
def test_scratch_folders_of_a_process_that_nobody_has_waited_for_are_swept(tmp_path):
    """As in a container whose first process waits for nobody."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    while Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
        time.sleep(0.01)
    (tmp_path / f"cybership_{process.pid}_a").mkdir()
    assert scratch_folder.sweep(tmp_path) == 1
    assert process.wait() == 0


def test_what_a_killed_process_has_left_of_a_file_goes_with_its_next_write(tmp_path):
    """A young file stays, as its process may be alive in another container, and that of a living one."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    own, other, young, alive = (
        tmp_path / f".{name}.part"
        for name in (
            f"a.fmu.{ended.pid}",
            f"b.fmu.{ended.pid}",
            "a.fmu.99999999",
            f"a.fmu.{os.getppid()}",
        )
    )
    for each in (own, other, young, alive):
        each.write_text("")
        if each != young:
            os.utime(each, (0, 0))
    with scratch_folder.atomic_write(tmp_path / "a.fmu") as part:
        part.write_text("whole")
    assert (tmp_path / "a.fmu").read_text() == "whole"
    assert {*tmp_path.iterdir()} == {tmp_path / "a.fmu", other, young, alive}
    make_folder(tmp_path, tmp_path / "hash")
    assert {*tmp_path.glob(".*")} == {young, alive}


CALLS = (
    ["cosim.run", "scenarios/setpoint.json", "--stop", "0.1", "--no-plots", "--out"], ["cosim.scenario"],
    ["fmus.build", "--list"], ["fmus.build", "vessel"], ["fmus.check", "--list"], ["fmus.effects"],
    ["cosim.interface", "scenarios/ellipse.json"], ["diagnosis.learn", "--help"],
)  # fmt: skip
PRINTED = """
import json, sys
from support.command import command, main_of
print(json.dumps([command(main_of(name), *arguments) for name, *arguments in json.loads(sys.argv[1])]))
"""


@pytest.mark.slow
def test_commands_without_docstrings_print_the_same(tmp_path):
    calls = [[*call, tmp_path] if call[-1] == "--out" else call for call in CALLS]
    bare = subprocess.run(
        [sys.executable, "-OO", "-c", PRINTED, json.dumps(calls, default=str)],
        capture_output=True, text=True, cwd=ROOT, check=True, env={**os.environ, "PYTHONPATH": "tests"},
    )  # fmt: skip
    for (name, *arguments), (code, printed, _) in zip(calls, json.loads(bare.stdout), strict=True):
        here = in_this_process(main_of(name), *arguments, cwd=ROOT)
        assert (code, here.returncode) == (0, 0)
        assert printed == here.stdout or name == "cosim.scenario", "whose descriptions are docstrings"


GROWTH = """
import gc, sys
from functools import cache
from pathlib import Path
import cosim
from cosim.system import own_fmus

ask = cache(own_fmus.run_builder)  # the builder, a process that has nothing of this one, is asked once
own_fmus.run_builder = lambda *names, warnings: ask(*names)
scenario = cosim.load_scenario(Path(sys.argv[1]))

def repeat(count):
    for _ in range(count):
        cosim.simulate(scenario, Path(sys.argv[2]))
    gc.collect()
    return len(gc.get_objects()), int(Path("/proc/self/statm").read_text().split()[1])

repeat(5)
before, after = repeat(1), repeat(10)
print((after[0] - before[0]) / 10, (after[1] - before[1]) / 10)
"""


@pytest.mark.slow
@linux_only
def test_runs_in_one_process_leave_nothing(ellipse, tmp_path):
    """Of each class of an FMU, which pythonfmu never releases, an empty shell remains: about 130 objects a run."""
    (tmp_path / "s.json").write_text(json.dumps(ellipse | {"stop": 0.1}))
    done = subprocess.run(
        [sys.executable, "-c", GROWTH, tmp_path / "s.json", tmp_path / "out"],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    objects, pages = map(float, done.stdout.split())
    assert objects < 200
    assert pages * os.sysconf("SC_PAGE_SIZE") < 300e3  # bytes


@pytest.mark.slow
@linux_only
def test_campaign_in_small(tmp_path, monkeypatch):
    monkeypatch.setattr(campaigns, "LONGEST", 1.5)
    nothing = lambda: None  # noqa: E731
    assert mutations.broken_scenarios(3, 2, tmp_path, nothing) == []
    assert mutations.broken_files(2, 2, tmp_path, nothing) == []
    assert endings.kills(1, 2, tmp_path, nothing) == []
    assert endings.signals(1, 2, tmp_path, nothing) == []
    assert endings.short_of_disk(1, 2, tmp_path, nothing) == []
    assert endings.deaths(1, 2, tmp_path, nothing) == []
    assert campaigns.interrupted_campaigns(1, 2, tmp_path, nothing) == []
    assert campaigns.deaths_elsewhere(1, 2, tmp_path, nothing) == []
    assert campaigns.spoilt_cache(1, 2, tmp_path, nothing) == []


@linux_only
def test_broken_ships_in_small(tmp_path, monkeypatch):
    monkeypatch.setattr(ship_mutations, "EACH", 1000)  # none but the first is built
    assert ship_mutations.broken_ships(8, 2, tmp_path, lambda: None) == []


@pytest.mark.slow
@linux_only
def test_killed_commands_in_small(tmp_path, monkeypatch):
    for longest in ("COMPARES", "BUILDS", "CAMPAIGNS"):
        monkeypatch.setattr(killed_commands, longest, 1.5)
    nothing = lambda: None  # noqa: E731
    assert killed_commands.interrupted_compares(1, 2, tmp_path, nothing) == []
    assert killed_commands.killed_diagnoses(1, 2, tmp_path, nothing) == []
    assert killed_commands.ended_builds(1, 2, tmp_path, nothing) == []
    assert killed_commands.killed_campaigns(1, 2, tmp_path, nothing) == []


@pytest.mark.slow
@linux_only
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")
def test_random_calls_under_sanitizers(tmp_path):
    assert sanitized.sanitized_calls(2, 2, tmp_path, lambda: None) == []

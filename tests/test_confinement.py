"""An FMU in a confined process finds nothing of the user's, and the process says what confines it."""

import math
import os
import re
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.events import once_there
from support.foreign import build_lag, needs_compiler
from support.plain import GAIN, make_fmu
from support.spy import build_spy, found

from cosim import InputError, SimulationError
from cosim.fmu import ConfinedFmu, DoubleMemory, FmuModel, Port, WholeRun
from cosim.fmu.isolation.channel import FeedbackTerm
from cosim.fmu.isolation.confinement import needed_folders
from cosim.fmu.isolation.worker_process import LONGEST_PRINTED, MOST_PRINTED, cleaned

pytestmark = needs_compiler
MEANS = [("namespaces", "landlock"), ("landlock",), ("namespaces",)]
EACH = [MEANS[0], *(pytest.param(m, marks=pytest.mark.slow) for m in MEANS[1:])]


def opened(fmu, **options):
    return ConfinedFmu(FmuModel(fmu), **options)


def stepped(confined, steps=1):
    """The lag's output after each of some steps of 0.1 s with an input of 1."""
    instance, memory = confined.instance(), DoubleMemory(2)
    known = confined.model.variables
    ports = [Port(known["in[1]"], 0)], [Port(known["out, filtered"], 1)]
    try:
        access = instance.bind(*ports, memory, 0.1)
        instance.set_up(1.0)
        instance.enter_initialization()
        instance.exit_initialization()
        memory.values[0], stated = 1.0, []
        for k in range(steps):
            access.put()
            access.step(0.1 * k)
            stated.append(memory.values[1])
        instance.terminate()
        return stated
    finally:
        instance.free()


@pytest.fixture
def hidden(tmp_path, monkeypatch):
    """A file: in the working directory, open, in the environment, and an argument of another process."""
    folder = tmp_path / "data"
    folder.mkdir()
    path = folder / "MARKED_NAME.csv"
    path.write_text("time,x,y,psi\n0,1,2,3\n")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MEASURED", str(path))
    other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)", str(path)])
    with path.open() as kept:
        os.set_inheritable(kept.fileno(), True)
        yield path
    other.kill()
    other.wait()


@pytest.mark.parametrize("means", EACH)
def test_an_fmu_finds_no_file_of_the_user(tmp_path, hidden, means):
    """By name, in its environment, arguments, descriptors, folder and memory, or in another process."""
    fmu = build_spy(tmp_path, hidden)
    confined = opened(fmu, means=means)
    try:
        if confined.confinement.startswith("unconfined"):
            pytest.skip(confined.confinement)
        assert found(stepped(confined)[0]) == []
        assert not _notifies() or str(hidden) in confined.outside
    finally:
        confined.close()


@pytest.mark.slow
def test_the_spy_finds_the_file_where_nothing_confines_it(tmp_path, hidden):
    """So the test above can fail; and what is not confined is called so."""
    confined = opened(build_spy(tmp_path, hidden), means=())
    try:
        assert confined.confinement.startswith("unconfined: own process in an empty folder")
        seen = found(stepped(confined)[0])
        assert {"open", "other processes", "walk"} <= {*seen}
        assert not {"environment", "arguments", "descriptors", "own memory"} & {*seen}
    finally:
        confined.close()


def test_files_that_it_opens_are_named(tmp_path, hidden):
    """Where the kernel says it; a system's library is none of them."""
    for target, named in ((hidden, True), ("/etc/hostname", False)):
        habit = f'FILE *f = fopen("{target}", "r"); if (f) fclose(f);'
        confined = opened(build_lag(tmp_path, habit=habit))
        try:
            stepped(confined)
            if sys.platform == "linux" and _notifies():
                assert (str(target) in confined.outside) == named
                assert len(confined.outside) == named
        finally:
            confined.close()


def _notifies():
    """Whether the kernel has notifications of system calls (since 5.5)."""
    return tuple(map(int, re.findall(r"\d+", os.uname().release)[:2])) >= (5, 5)


def test_numbers_are_those_of_the_same_process(tmp_path):
    confined = opened(build_lag(tmp_path))
    try:
        assert stepped(confined, 3) == pytest.approx([0.1, 0.19, 0.271], rel=1e-15)
    finally:
        confined.close()


FED_THROUGH = f"""{GAIN}
self.exit_initialization_mode = lambda: setattr(self, "y", 10.0 * self.x)
"""
TERMS = {
    "none": ([], lambda y, before: 0.0),
    "constant": ([FeedbackTerm(0, 0, 0, False, 0.5)], lambda y, before: 0.5),
    "linear": ([FeedbackTerm(0, 0, 1, False, -2.0)], lambda y, before: -2.0 * y),
    "quadratic": ([FeedbackTerm(0, 0, 2, False, -0.1)], lambda y, before: -0.1 * y * abs(y)),
    "rate": ([FeedbackTerm(0, 0, 1, True, -0.3)], lambda y, before: -0.3 * (y - before) / 0.1),
    "turned": (
        [FeedbackTerm(0, 0, 1, False, 2.0, 3.0, 0.4)],
        lambda y, before: 2.0 * math.cos(3 * y + 0.4),
    ),
}


@pytest.fixture(scope="module")
def fed_through(tmp_path_factory):
    return make_fmu(
        tmp_path_factory.mktemp("fed"), "Fed", FED_THROUGH, "self.y += h * self.x\nreturn True"
    )


@pytest.mark.parametrize("kind", TERMS)
def test_a_whole_run_adds_to_its_inputs_what_follows_from_its_outputs(fed_through, kind):
    """The first output follows from the first input; each next one from the input and what is added to it."""
    terms, added = TERMS[kind]
    confined = opened(fed_through)
    inputs, h = [-1.0, 0.5, 2.0, 0.0], 0.1
    try:
        known, instance = confined.model.variables, confined.instance()
        instance.bind([Port(known["x"], 0)], [Port(known["y"], 1)], DoubleMemory(2), h)
        run = WholeRun({}, np.array(inputs).tobytes(), len(inputs), terms)
        first, again = map(np.frombuffer, instance.whole_runs([run, run], h))
    finally:
        confined.close()
    outputs, before = [10.0 * inputs[0]], 10.0 * inputs[0]
    for x in inputs:
        y = outputs[-1]
        outputs.append(y + h * (x + added(y, before)))
        before = y
    assert first == pytest.approx(outputs, rel=1e-12)
    assert again.tolist() == first.tolist(), "after a reset"


def test_an_instance_knows_nothing_of_another_one(tmp_path):
    """Neither by a variable of its library nor by a file; else windows would tell each other the run."""
    habit = """static int before = 0; FILE *f = fopen("note", "r"); m->y = before++ + (f ? 10 : 0); if (f) fclose(f);
    f = fopen("note", "w"); if (f) fclose(f); return 0;"""
    confined = opened(build_lag(tmp_path, habit=habit))
    try:
        assert stepped(confined, 2) == [0.0, 11.0]
        assert stepped(confined, 2) == [0.0, 11.0]
    finally:
        confined.close()


@pytest.mark.parametrize(("means", "more"), [(("landlock",), "setsid();"), ((), "")])
def test_what_it_has_started_ends_with_it(tmp_path, means, more):
    """Else that could tell other instances what this one was given."""
    habit = f"int p = fork(); if (!p) {{ {more} for (;;) pause(); }} m->y = p; return 0;"
    confined = opened(build_lag(tmp_path, habit=habit), means=means)
    try:
        if confined.confinement.startswith("unconfined") and means:
            pytest.skip(confined.confinement)
        started = Path(f"/proc/{int(stepped(confined)[0])}/stat")
        once_there(lambda: not started.exists() or ") Z" in started.read_text())
    finally:
        confined.close()


SHARED = {
    "memory by a key": """#include <sys/shm.h>
        static int other(void) { int there = shmget(7531, 8, 0) >= 0; shmget(7531, 8, IPC_CREAT | 0600); return there; }""",
    "a key ring": """#include <sys/syscall.h>
        static int other(void) { int there = syscall(SYS_keyctl, 10, -4, "user", "cybership", 0) >= 0;
            syscall(SYS_add_key, "user", "cybership", "x", 1, -4); return there; }""",
    "a socket": """#include <sys/socket.h>
        #include <netinet/in.h>
        #include <arpa/inet.h>
        static int other(void) { int s = socket(AF_INET, SOCK_DGRAM, 0); return s >= 0; }""",
}


@pytest.mark.parametrize(("by", "means"), [*((by, MEANS[0]) for by in SHARED), ("a key ring", MEANS[1])])
def test_an_instance_tells_another_one_nothing_but_by_files(tmp_path, by, means):
    """Of what processes of one user share; Landlock alone hides none of it."""
    fmu = build_lag(tmp_path, habit="m->y = other(); return 0;", before=SHARED[by])
    confined = opened(fmu, means=means)
    try:
        if confined.confinement.startswith("unconfined"):
            pytest.skip(confined.confinement)
        assert [stepped(confined), stepped(confined)] == [[0.0], [0.0]]
    finally:
        confined.close()
        subprocess.run(["ipcrm", "-M", "7531"], capture_output=True, check=False)


@pytest.mark.parametrize(
    ("habit", "message", "means"),
    [
        ("sleep(60);", r"the step from t = 0.0 s took longer than 1 s; its process was ended", MEANS[0]),
        ("*(volatile int *)0 = 1;", r"\(signal 11, SIGSEGV\)", ()),
        ("abort();", r"\(signal 6, SIGABRT\)", MEANS[0]),
        ("if (!fork()) for (;;) pause(); exit(7);", "died|took", MEANS[0]),
    ],
)
def test_a_crash_or_a_hang_is_one_message_and_leaves_no_process(tmp_path, habit, message, means):
    confined = opened(build_lag(tmp_path, habit=habit), timeout=1.0, means=means)
    try:
        with pytest.raises(SimulationError) as error:
            stepped(confined)
        assert re.search(message, str(error.value))
        pid = confined._process.pid
    finally:
        confined.close()
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False
    )
    assert listed.stdout.split() == []


def test_usual_time_of_a_step_sets_the_timeout(tmp_path):
    """30 s at the least, else a hundred times what a step has taken."""
    confined = opened(build_lag(tmp_path))
    instance = confined.instance()
    try:
        instance.set_up(1.0)
        assert instance._allowed() == 30.0
        instance._spent, instance._answers = 10.0, 10
        assert instance._allowed() == 100.0
    finally:
        instance.free()
        confined.close()


def test_what_it_prints_is_kept_once_shortened_and_without_escape_codes(tmp_path):
    habit = r"""fprintf(stderr, "\033[2J\033[31mred\033[0m %s\n", m->name); printf("\033]0;title\007plain\n");"""
    confined = opened(build_lag(tmp_path, habit=habit))
    try:
        stepped(confined, 3)
        stepped(confined, 3)
        assert {*confined.printed} == {"red model", "plain"}
    finally:
        confined.close()
    assert len(cleaned("word " * 1000)) == LONGEST_PRINTED


@pytest.mark.parametrize(("lines", "more"), [(MOST_PRINTED, 0), (5000, 5000 - MOST_PRINTED)])
def test_only_so_many_lines_are_kept(tmp_path, lines, more):
    habit = f'for (int k = 0; k < {lines}; k++) printf("%d\\n", k);'
    confined = opened(build_lag(tmp_path, habit=habit))
    try:
        stepped(confined)
        kept = [*confined.printed]
        assert kept[:MOST_PRINTED] == [str(k) for k in range(MOST_PRINTED)]
        assert kept[MOST_PRINTED:] == ([f"... and {more} more lines"] if more else [])
    finally:
        confined.close()


def test_processes_end_with_a_master_that_is_killed(tmp_path):
    """Those of the instances and the one that makes them."""
    fmu = build_lag(tmp_path)
    code = (
        "import sys, time; from pathlib import Path; from cosim.fmu import ConfinedFmu, FmuModel\n"
        f"c = ConfinedFmu(FmuModel(Path({str(fmu)!r}))); i = c.instance(); i.set_up(1.0)\n"
        "print(c._process.pid, i._process._pid, flush=True); time.sleep(60)"
    )
    master = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    pids = master.stdout.readline().split()
    master.send_signal(signal.SIGKILL)
    master.wait()
    master.stdout.close()
    once_there(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids))


def test_installed_packages_of_the_environment_can_be_read_and_no_other_folder(tmp_path, monkeypatch):
    installed, own = tmp_path / "more" / "site-packages", tmp_path / "work"
    for folder in (installed, own):
        folder.mkdir(parents=True)
        monkeypatch.syspath_prepend(folder)
    assert str(installed) in needed_folders()
    assert str(own) not in needed_folders()


def test_a_python_fmu_imports_its_own_module_after_a_reset(plain_fmu):
    late = "if 'pytest' not in __import__('sys').modules: import late_helper; self.y = late_helper.VALUE"
    fmu = plain_fmu("Late", f"{GAIN}\n{late}\n")
    with zipfile.ZipFile(fmu, "a") as archive:
        archive.writestr("resources/late_helper.py", "VALUE = 3.5\n")
    confined = opened(fmu)
    try:
        instance, memory = confined.instance(), DoubleMemory(1)
        instance.bind([], [Port(confined.model.variables["y"], 0)], memory, 0.1)
        instance.reset()
        instance.set_up(1.0)
        instance.enter_initialization()
        instance.exit_initialization()
        assert instance.get_value(confined.model.variables["y"]) == 3.5
        instance.free()
    finally:
        confined.close()


def test_a_package_that_a_python_fmu_lacks_is_named(plain_fmu):
    here = "if 'pytest' not in __import__('sys').modules: import no_such_package"
    confined = opened(plain_fmu("Lacks", f"{GAIN}\n{here}\n"))
    try:
        with pytest.raises(InputError, match="No module named 'no_such_package'"):
            confined.instance().set_up(1.0)
    finally:
        confined.close()

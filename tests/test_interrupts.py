"""Interrupts: held while files are made, and a command that is interrupted leaves nothing, whenever it is."""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress

import pytest
from support.project import ROOT

from cosim.interrupts import Held, on_interrupt, raise_on_interrupt, restore
from cosim.master.loop_surroundings import interruptible
from cosim.process import run_state
from cybership import scratch_folder
from diagnosis.execution.result_folder import clean, default_folder, together

posix = pytest.mark.skipif(os.name != "posix", reason="no SIGINT to send")


def interrupt():
    signal.raise_signal(signal.SIGINT)


def test_a_held_interrupt_acts_at_the_end():
    before, done = signal.getsignal(signal.SIGINT), []

    def work():
        with Held():
            interrupt()
            done.append(1)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is before


def test_a_held_interrupt_acts_where_it_may():
    with Held() as interrupts:
        interrupt()
        with pytest.raises(KeyboardInterrupt):
            interrupts.allow()
        with pytest.raises(KeyboardInterrupt):
            interrupt()
        interrupts.hold()
        interrupt()
        interrupts.finish()


def test_an_interrupt_after_the_end_of_the_inner_comes_too_late():
    before = signal.getsignal(signal.SIGINT)
    with Held() as outer:
        outer.allow()
        with Held() as inner:
            inner.finish()
        interrupt()
        outer.finish()
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_while_the_files_of_an_answer_move_ends_the_command_behind_it():
    """It was lost: the inner work had ended, and the outer knew nothing of it."""
    with Held() as outer:
        outer.allow()
        with Held() as inner:
            interrupt()
            inner.finish()
        with pytest.raises(KeyboardInterrupt):
            outer.allow()


LOST = """
import signal, sys
from contextlib import suppress
from rich.console import Console
from cosim.command import run_command
from diagnosis.execution.progress import progress

def main():
    with progress(Console(stderr=True)) as advance:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        advance("on")
    return 0

run_command(main)
"""


def test_an_interrupt_that_was_lost_acts_at_the_next_step():
    done = subprocess.run([sys.executable, "-c", LOST], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


WRAPPED = """
import signal
from cosim.command import run_command

class Bad:
    def __set_name__(self, owner, name):
        signal.raise_signal(signal.SIGINT)

def main():
    class Made:
        bad = Bad()
    return 0

run_command(main)
"""
UNRAISABLE = """
import signal, time
from cosim.command import run_command
from cosim.interrupts import raise_if_interrupted

class Bad:
    def __del__(self):
        signal.raise_signal(signal.SIGTERM)

def main():
    Bad()
    raise_if_interrupted()
    return 0

run_command(main)
"""


@pytest.mark.parametrize("code", [WRAPPED, UNRAISABLE], ids=["wrapped", "unraisable"])
def test_an_interrupt_is_one_line_wherever_it_is_raised(code):
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def gone():
    """The number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_what_a_killed_call_has_left_goes_with_the_next_one(tmp_path, capsys):
    usual = tmp_path / "comparison"
    for name in (f".new-{gone()}_a", f".new-{os.getpid()}_b", ".new-mine"):
        (usual / name / "files").mkdir(parents=True)
        (usual / name / "files" / "report.html").write_text("half")
    assert default_folder(usual, {"run.csv": "hash"}) == usual.with_name("comparison_2")  # of others
    assert {p.name for p in usual.iterdir()} == {f".new-{os.getpid()}_b", ".new-mine"}
    stated = "note: removed 1 unfinished result(s) of killed calls from"
    assert capsys.readouterr().err.startswith(f"{stated} '{usual}'")
    (usual / f".new-{gone()}_c").mkdir()
    clean(usual)
    with together(usual, ["file"]) as new:
        (new / "file").write_text("x")
    assert {p.name for p in usual.iterdir()} == {f".new-{os.getpid()}_b", ".new-mine", "file"}
    assert stated in capsys.readouterr().err


def test_a_folder_with_what_a_killed_call_has_left_alone_is_free(tmp_path):
    usual = tmp_path / "comparison"
    (usual / f".new-{gone()}_a" / "files").mkdir(parents=True)
    assert default_folder(usual, {"run.csv": "hash"}) == usual


LOST_RUN = """
import signal
from contextlib import suppress
from cosim import run
from cosim.command import run_command
from cosim.scenario import scenario_options

load = scenario_options.load_scenario

def loads(*arguments):
    with suppress(KeyboardInterrupt):  # as where Python runs a callback of C
        signal.raise_signal(signal.SIGTERM)
    return load(*arguments)

scenario_options.load_scenario = loads
run_command(run.main)
"""


@posix
def test_an_interrupt_that_was_lost_before_a_run_ends_it(tmp_path):
    content = {
        "name": "endless", "step": 0.01, "stop": 1e5, "metrics": {},
        "fmus": {"guidance": {"path": "guidance_ellipse.fmu"}}, "connections": [],
    }  # fmt: skip
    (tmp_path / "endless.json").write_text(json.dumps(content))
    done = subprocess.run(
        [sys.executable, "-c", LOST_RUN, str(tmp_path / "endless.json"), "--out", str(tmp_path / "out")],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr.splitlines()[-1]) == (130, "interrupted")


@posix
def test_an_interrupt_that_was_lost_is_not_for_the_next_run():
    before = on_interrupt(lambda: None)
    try:
        raise_on_interrupt()
        with suppress(KeyboardInterrupt):
            interrupt()
        asked = []
        for _ in range(2):
            with interruptible() as interrupted:
                asked.append(interrupted())
    finally:
        restore(before)
    assert asked == [True, False]


def test_other_threads_hold_nothing():
    thread = threading.Thread(target=lambda: Held().__enter__().__exit__(None, None, None))
    thread.start()
    thread.join()
    assert Held._innermost is None


@pytest.mark.parametrize("step", ["mkdtemp", "rmtree"])
def test_interrupt_while_folders_come_and_go(step, tmp_path, monkeypatch):
    home = scratch_folder.tempfile if step == "mkdtemp" else scratch_folder.shutil
    original = getattr(home, step)

    def interrupted(*args, **kwargs):
        interrupt()
        result = original(*args, **kwargs)
        interrupt()
        return result

    monkeypatch.setattr(home, step, interrupted)
    out = tmp_path / "a" / "b"
    made = []
    try:
        with together(out, ["file"]) as new:
            (new / "file").write_text("x")
            made.append(new)
    except KeyboardInterrupt:
        assert step == "mkdtemp"
        assert not made
        assert not list(tmp_path.iterdir())
    else:
        assert [p.name for p in out.iterdir()] == ["file"]
    with pytest.raises(KeyboardInterrupt):
        interrupt()


def test_texts_of_a_run_have_room_of_their_own():
    """What one place holds at most changes no other, and not the first row."""
    state = run_state.RunState()
    names = ("CALL", "FOLDER", "LAYOUT", "CAMPAIGN", "UNFINISHED", "NAMES", "DESCRIPTION")
    places = {name: getattr(run_state, name) for name in names}
    for name, (_, room) in places.items():
        state.write(places[name], name[-1] * room)
    texts = {name: name[-1] * (room - run_state.LENGTH.size) for name, (_, room) in places.items()}
    assert [name for name, text in texts.items() if state.read(places[name]) != text] == []
    assert max(first + room for first, room in places.values()) <= run_state.ROWS[0]
    assert sum(run_state.ROWS) == run_state.SIZE
    assert state.numbers[run_state.INSTANCE] == run_state.NOTHING

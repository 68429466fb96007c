"""An FMU that hangs in a run, or in a run of a campaign, ends in one line; one that is slow does not."""

import json
import subprocess
import sys

import pandas
import pytest
from support.command import command as in_this_process
from support.foreign import build_lag, needs_compiler

from cosim import run
from cosim.process.call_watch import TIMES_USUAL, CallWatch
from cosim.process.run_state import CALLS, INSTANCE, NOTHING, STATE

pytestmark = needs_compiler
HANGS = "if (t > 0.45) for (;;) pause();"  # without a load for the other tests


def scenario(folder, habit, **entry):
    fmu = build_lag(folder, habit=habit)
    content = {"name": "one", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(fmu), **entry}}}
    (folder / "one.json").write_text(json.dumps(content))
    axes = {"T": {"set": "fmus.a.parameters.T", "values": [1.0]}}
    (folder / "campaign.json").write_text(
        json.dumps({"scenario": "one.json", "axes": axes, "design": "grid"})
    )
    return folder


def command(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("entry", [{}, {"isolate": True}])
def test_a_hang_in_a_run_ends_in_one_line_with_the_log_kept(tmp_path, entry):
    folder = scenario(tmp_path, HANGS, **entry)
    done = command(folder, "cosim.run", "one.json", "--timeout", "1", "--no-plots", "--quiet")
    assert done.returncode == 3
    (line,) = done.stderr.splitlines()
    assert "a: " in line
    assert "took longer than 1 s; its process was ended" in line
    log = json.loads((folder / "results" / "one" / "log.json").read_text())
    assert log["status"] == "failed"
    assert log["rows"] == 6


@pytest.mark.slow
@pytest.mark.parametrize("workers", ["0", "1"])
def test_a_hang_in_a_campaign_says_which_call_it_was(tmp_path, workers):
    folder = scenario(tmp_path, HANGS)
    arguments = ["campaign.json", "--timeout", "1", "--quiet", "--out", "out", "--workers", workers]
    done = command(folder, "cosim.campaign", *arguments)
    assert done.returncode == 3
    assert "a: a step took longer than 1 s; its process was ended" in done.stderr
    if workers == "1":
        table = pandas.read_parquet(folder / "out" / "runs.parquet")
        assert list(table["status"]) == ["failed"]


@pytest.fixture
def state():
    """The state of this process, as it was before."""
    kept = STATE.numbers[:10].tolist()
    STATE.steps(["a", "b"], ["b"])
    yield STATE.numbers
    for k, value in enumerate(kept):
        STATE.numbers[k] = value
    STATE.timeout = None


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [1000.0]
    monkeypatch.setattr("cosim.process.call_watch.time.monotonic", lambda: now[0])
    return now


def looks(watch, state, clock, seconds, every):
    """Whether the watch finds a call late within some seconds, in steps that take so long."""
    for _ in range(round(seconds / every)):
        clock[0] += every
        state[CALLS] += 1
        if watch.is_late():
            return True
    return False


def test_a_call_is_late_after_30_s_or_100_times_a_usual_step(state, clock):
    watch = CallWatch()
    state[INSTANCE] = state[CALLS] = 0
    assert not looks(watch, state, clock, 20.0, 1.0)
    clock[0] += 29.0
    assert not watch.is_late()
    clock[0] += 0.9 * TIMES_USUAL - 29.0
    assert not watch.is_late()
    clock[0] += 0.2 * TIMES_USUAL
    assert watch.is_late()
    quick = CallWatch()
    assert not looks(quick, state, clock, 2.0, 0.01)
    clock[0] += 29.0
    assert not quick.is_late()
    clock[0] += 2.0
    assert quick.is_late()


def test_progress_no_call_and_an_fmu_of_its_own_process_are_never_late(state, clock):
    watch = CallWatch()
    STATE.timeout = 1.0
    state[INSTANCE] = 0
    assert not looks(watch, state, clock, 50.0, 0.9)
    for instance in (1, NOTHING):
        state[INSTANCE] = instance
        watch.is_late()
        clock[0] += 500.0
        assert not watch.is_late()


def test_a_timeout_is_a_positive_number():
    for value in ("0", "nan"):
        done = in_this_process(run.main, "ellipse", "--timeout", value)
        assert done.returncode == 2
        assert "needs a positive number" in done.stderr

"""Workers and libraries add nothing to the line with which an interrupted command ends."""

import json
import os
import subprocess
import sys

import pytest
from support.project import ROOT

pytestmark = pytest.mark.skipif(os.name != "posix", reason="no signals to send")


def ran(code, *arguments):
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip


INTERRUPTED_START = """
import asyncio, os, signal
from distributed import Nanny
from cosim.campaign.__main__ import main
from cosim.command import run_command

start = Nanny.start

async def late(self):
    os.kill(os.getpid(), signal.SIGTERM)  # while the workers are neither there nor absent
    await asyncio.sleep(0.5)
    return await start(self)

Nanny.start = late
run_command(main)
"""


@pytest.mark.slow
def test_workers_that_are_interrupted_while_they_start_are_no_traceback(tmp_path):
    fmus = {"path": {"path": "guidance_ellipse.fmu"}}
    (tmp_path / "s.json").write_text(json.dumps({"name": "s", "step": 0.1, "stop": 1.0, "fmus": fmus}))
    axes = {"a": {"set": "path.a_x", "values": [4.0, 5.0]}}
    (tmp_path / "c.json").write_text(json.dumps({"scenario": "s.json", "axes": axes}))
    done = ran(
        INTERRUPTED_START, tmp_path / "c.json", "--workers", 2, "--quiet", "--out", tmp_path / "out"
    )
    line = f"finished runs are in '{tmp_path / 'out'}'; the same command continues"
    assert (done.returncode, done.stderr) == (130, f"interrupted: {line}\n")


STARTS_A_PROCESS = """
import subprocess, sys
from cosim.process.spawned import mute_started_processes

mute_started_processes()
subprocess.run([sys.executable, "-c", "import os; os.write(2, b'of another'); print('heard')"])
print("one line", file=sys.stderr)
"""


def test_what_started_processes_write_to_standard_error_is_not_shown():
    done = ran(STARTS_A_PROCESS)
    assert (done.stdout, done.stderr) == ("heard\n", "one line\n")


SAYS = """
import logging, signal
from cosim.interrupts import raise_on_interrupt
from cosim.process.run_state import REQUESTS, STATE

STATE.watched = {watched}
STATE.numbers[REQUESTS] = 1
raise_on_interrupt()
logging.error("before")
try:
    signal.raise_signal(signal.SIGINT)
except KeyboardInterrupt:
    logging.error("after")
"""


@pytest.mark.parametrize("watched", [False, True])
def test_libraries_log_nothing_after_the_interrupt_of_a_command(watched):
    """In a user's own program they go on."""
    said = ran(SAYS.format(watched=watched)).stderr.splitlines()
    assert said == ["ERROR:root:before"] + ([] if watched else ["ERROR:root:after"])

"""The command ``cosim.run`` on scenarios, and parameter sets for it."""

import subprocess
import sys

from cosim import run

from .command import command as in_this_process
from .events import once_there
from .project import ROOT

SSV = """<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
                  version="1.0" name="learned">
  <ssv:Parameters>{}</ssv:Parameters>
</ssv:ParameterSet>
"""


def parameter(name, value):
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter>'


def command(*arguments, cwd=ROOT):
    """``cosim.run`` in this process."""
    return in_this_process(run.main, *arguments, cwd=cwd)


def in_a_process(*arguments, **options):
    """The same in a process of its own: what reaches its streams from wherever, and what it leaves."""
    return subprocess.run(
        [sys.executable, "-m", "cosim.run", *map(str, arguments)],
        capture_output=True, text=True, check=False, **{"cwd": ROOT} | options,
    )  # fmt: skip


def start(path, out, *arguments):
    """A run in the background, returned once its log has some rows."""
    process = subprocess.Popen(
        [sys.executable, "-m", "cosim.run", str(path), "--out", str(out), "--no-plots", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip
    log = out / "log.csv"
    once_there(lambda: process.poll() is not None or (log.is_file() and log.stat().st_size > 100_000))
    assert process.poll() is None, process.communicate()
    return process

"""The checker and FMUs that do harm: it outlives them, leaves nothing behind and still tells of the others."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import ccode, lag
from support.events import once_there
from support.project import ROOT

from fmucheck.examine import examine
from fmucheck.fmu import FmuArchive
from fmucheck.registry import RULES

compiled = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")

STEP = "s->y += h"
HEAD = "#define _GNU_SOURCE\n#include <dlfcn.h>\n#include <stdio.h>\n#include <signal.h>"


def pack(folder, habit):
    """The FMU with C statements at the start of each step."""
    return lag.pack(folder, c=[("#include <signal.h>", HEAD), (STEP, habit + STEP)])


OWN = "Dl_info d; dladdr(fmi2DoStep, &d); char b[5000]; "  # where an FMU finds its own files


@compiled
@pytest.mark.parametrize(
    ("habit", "number"),
    [("unlink(d.dli_fname);", 1), ('sprintf(b, "rm -rf $(dirname %s)/../../../*", d.dli_fname); system(b);', 3)],
)  # fmt: skip
def test_fmu_that_removes_files_spoils_no_other_trial(habit, number, tmp_path):
    outcomes = examine(FmuArchive(pack(tmp_path, OWN + habit)), [RULES["life"], RULES["reset"]])
    assert f"it removed {number} of its own files, such as 'binaries/" in outcomes["life"].found[0]
    assert outcomes["reset"].found == []


@compiled
def test_nothing_that_an_fmu_leaves_or_does_at_the_end_stays(tmp_path, monkeypatch):
    """Its files where it runs go with the trial, whose process ends before a library may do more."""
    late = f'static __attribute__((destructor)) void late(void) {{ fclose(fopen("{tmp_path}/late", "w")); }}'
    edits = [("#include <signal.h>", f"{HEAD}\n{late}"), (STEP, f'fclose(fopen("left", "w")); {STEP}')]
    path = lag.pack(tmp_path, c=edits)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert examine(FmuArchive(path), [RULES["life"]])["life"].found == []
    assert sorted(tmp_path.rglob("*")) == before


def wait_for(path):
    """The number that another process writes to a file."""
    return int(once_there(lambda: path.exists() and path.read_text()))


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


@compiled
@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("number", [None, signal.SIGINT])
def test_nothing_outlives_a_trial(number, tmp_path):
    pid, place = tmp_path / "pid", tmp_path / "place"
    place.mkdir()
    forks = (
        "static int p; if (!p) { if (!(p = fork())) for (;;) pause(); "
        f'FILE *f = fopen("{pid}", "w"); fprintf(f, "%d", p); fclose(f); }} '
    )
    path = pack(tmp_path, forks + ("for (;;) pause(); " if number else ""))
    process = subprocess.Popen(
        [sys.executable, "-m", "fmus.check", path, "--only", "step-dependencies"],
        cwd=ROOT, env={**os.environ, "TMPDIR": str(place)},
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    child = wait_for(pid)
    for _ in range(3 if number else 0):  # an impatient user
        process.send_signal(number)
        time.sleep(0.01)
    _, said = process.communicate()
    assert (process.returncode, said.strip()) == ((130, "interrupted") if number else (0, ""))
    assert not is_alive(child)
    assert list(place.iterdir()) == []

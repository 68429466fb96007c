"""An entry of the user's cache: made once, whole, and only where nobody else may write."""

import os
import subprocess
import sys

import pytest
from filelock import FileLock, Timeout
from support.project import ROOT

from cybership.user_cache import RefusedError, is_whole, kept

# Each process notes that it makes the entry, and takes long enough for the other one to ask.
ASKING = """
import sys, time
from pathlib import Path
from cybership.user_cache import kept

cache = Path(sys.argv[1])

def make(work):
    with open(cache / "made", "a") as notes:
        notes.write("x")
    time.sleep(1.0)
    (work / "built").write_text("the entry")
    return work / "built"

print(kept(cache, cache / "folder" / "entry", make).read_text())
"""


def test_two_processes_at_once_make_one_entry(tmp_path):
    command = [sys.executable, "-c", ASKING, str(tmp_path)]
    each = [subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate()[0] for process in each] == ["the entry\n"] * 2
    assert (tmp_path / "made").read_text() == "x"


def test_an_entry_that_is_there_is_not_made_again_and_a_damaged_one_is(tmp_path):
    made = []

    def make(work):
        made.append(work)
        (work / "built").write_text(f"entry {len(made)}")
        return work / "built"

    path = tmp_path / "entry"
    assert [kept(tmp_path, path, make).read_text() for _ in range(2)] == ["entry 1"] * 2
    path.write_text("damaged")
    assert kept(tmp_path, path, make).read_text() == "entry 2"
    assert is_whole(path)
    assert not any(work.exists() for work in made)


def test_what_fails_leaves_no_entry_and_no_lock(tmp_path):
    def fail(work):
        raise ValueError("no compiler")

    for _ in range(2):
        with pytest.raises(ValueError, match="no compiler"):
            kept(tmp_path, tmp_path / "entry", fail)
    assert not (tmp_path / "entry").exists()


def test_a_wait_for_another_process_ends(tmp_path):
    with FileLock(tmp_path / "entry.lock"), pytest.raises(Timeout):
        kept(tmp_path, tmp_path / "entry", lambda work: work, patience=0.1)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders of a user are the user's")
def test_an_entry_that_others_may_write_is_refused(tmp_path):
    kept(tmp_path, tmp_path / "entry", lambda work: _written(work))
    (tmp_path / "entry").chmod(0o666)
    with pytest.raises(RefusedError, match="other users may write"):
        kept(tmp_path, tmp_path / "entry", lambda work: _written(work))


def _written(work):
    (work / "built").write_text("the entry")
    return work / "built"

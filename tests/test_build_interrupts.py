"""Builds and checks of FMUs that are interrupted: one line, no file half written, at whatever time."""

import os
import signal
import subprocess
import sys

import pytest
from support.project import ROOT

from cybership.scratch_folder import scratch_folder
from fmus import interruption
from fmus.build import building
from fmus.native import compilers

posix = pytest.mark.skipif(os.name != "posix", reason="no signals to send")

BEGIN = """
import signal, threading, time
from contextlib import suppress
from fmus.interruption import run_interruptible
"""
LOST = """
def main():
    with suppress(KeyboardInterrupt):  # as where Python runs a callback of C
        signal.raise_signal(signal.SIGINT)
    time.sleep(60)
"""
THREAD = """
def main():
    threading.Thread(target=time.sleep, args=(60,)).start()
    signal.raise_signal(signal.SIGTERM)
"""
AGAIN = """
def main():
    try:
        signal.raise_signal(signal.SIGINT)
    finally:
        signal.raise_signal(signal.SIGINT)
"""


def test_all_ways_to_interrupt_end_a_command_but_those_that_are_ignored(monkeypatch):
    taken = {}
    ignored = interruption.SIGNALS[-1]
    monkeypatch.setattr(
        interruption.signal, "getsignal", lambda n: signal.SIG_IGN if n == ignored else signal.SIG_DFL
    )
    monkeypatch.setattr(interruption.signal, "signal", taken.__setitem__)
    interruption.leave_on_interrupt()
    assert taken == dict.fromkeys(interruption.SIGNALS[:-1], interruption._leave)
    assert signal.SIGINT in taken


@posix
@pytest.mark.parametrize("work", [pytest.param(LOST, marks=pytest.mark.slow), THREAD, AGAIN])
def test_an_interrupt_ends_a_command_whatever_it_does(work):
    done = subprocess.run(
        [sys.executable, "-c", f"{BEGIN}{work}\nrun_interruptible(main)"],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


@posix
def test_temporary_files_of_a_compiler_lie_in_the_folder_of_the_build(tmp_path, monkeypatch):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr("tempfile.tempdir", None)
    seen = []
    with scratch_folder() as work:
        (compiler := work / "gcc").write_text("#!/bin/sh\nmktemp\nexit 1\n")
        compiler.chmod(0o755)
        found = compilers.Compiler(((str(compiler),),), (), "")
        monkeypatch.setattr(compilers, "compiler_for", lambda _: found)
        with pytest.raises(compilers.CompilerError):
            compilers.compiled(work / "a.c", "linux64", work)
        seen = [path.name for path in work.iterdir()]
        (outer,) = (tmp_path / "temporary").iterdir()
        assert outer.name.startswith(f"cybership_{os.getpid()}_")
    assert any(name.startswith("tmp.") for name in seen)
    assert not list((tmp_path / "temporary").iterdir())


def test_a_build_that_takes_long_says_so(tmp_path, monkeypatch):
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path))
    monkeypatch.setattr(building, "LONG", 0.0)
    notes = []
    building.build("guidance_ellipse", note=notes.append)
    assert notes == ["building guidance_ellipse takes longer than 0 s"]
    building.build("guidance_ellipse", note=notes.append)  # from the cache
    assert len(notes) == 1


def test_a_build_that_is_interrupted_makes_no_folder(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(building, "_cached", interrupted)
    with pytest.raises(KeyboardInterrupt):
        building.build(["vessel"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_source_that_cannot_be_written_is_not_there_in_part(tmp_path, monkeypatch):
    written, write = [], building.Path.write_text

    def full(path, text, **options):
        if len(written) > 1:
            write(path, text[: len(text) // 2], **options)
            raise OSError(28, "No space left on device")
        written.append(path)
        return write(path, text, **options)

    monkeypatch.setattr(building.Path, "write_text", full)
    with pytest.raises(OSError, match="No space left"):
        building.export(["guidance_setpoint"], tmp_path / "source")
    assert len(written) == 2
    assert not (tmp_path / "source").exists()

"""One trial: a rule that runs the FMU, in a process of its own, on files of its own."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from cybership.scratch_folder import scratch_folder

from .fmu import FmuArchive
from .registry import Outcome, Rule

PACKAGES = Path(__file__).parents[1]


class StoppedError(Exception):
    """The user wants no more trials."""


def attempt(rule: Rule, fmu: FmuArchive, timeout: float, stopped: threading.Event) -> Outcome:
    """Run a trial in a fresh process; a crash or a hang is a finding.

    Args:
        rule: what to try.
        fmu: unpacked anew, since the FMU of the trial before may have changed or removed its files.
        timeout: for the trial [s].
        stopped: set from outside to end the trial at once.

    Raises:
        StoppedError: it was ended.
    """
    # Reports lie apart from the folder that an FMU may take for its own.
    with (
        scratch_folder() as work,
        TemporaryDirectory(dir=work, ignore_cleanup_errors=True) as place,
        TemporaryDirectory(dir=work, ignore_cleanup_errors=True) as reports,
    ):
        folder, desk = Path(place, "fmu"), Path(place, "desk")  # it may leave files where it runs
        report, note = Path(reports, "report"), Path(reports, "note")
        try:
            fmu.unpack(folder)
            (folder / "resources").mkdir(exist_ok=True)
        except Exception as error:
            return Outcome(skipped=f"it cannot be unpacked: {error}")
        desk.mkdir()
        ended = _run([rule.name, folder, fmu.library, report, note], desk, timeout, stopped)
        where = note.read_text(errors="replace").strip() if note.is_file() else ""
        if report.is_file():
            try:
                return Outcome(**json.loads(report.read_text()))
            except (ValueError, TypeError):
                ended = "the report of the trial was overwritten"
    return Outcome(
        [f"{where or 'start of the trial'}: {ended or 'the process ended without a message'}"]
    )


def _run(arguments: list[str | Path], desk: Path, timeout: float, stopped: threading.Event) -> str:
    """Run the child; returns how it ended, nothing if as it should."""
    paths = [str(PACKAGES), os.environ.get("PYTHONPATH")]
    process = subprocess.Popen(
        [sys.executable, "-m", "fmucheck.child", *arguments],
        cwd=desk,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + timeout
    try:
        while time.monotonic() < deadline:
            if stopped.is_set():
                raise StoppedError
            try:
                return _manner(process.wait(0.1))
            except subprocess.TimeoutExpired:
                continue
        return f"it did not return within {timeout:g} s"
    finally:
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a child that still runs, and whatever its FMU started."""
    if hasattr(os, "killpg"):
        # Nobody may be left, which macOS tells with the other error.
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _manner(code: int) -> str:
    if code < 0:
        try:
            return f"the process ended by {signal.Signals(-code).name}"
        except ValueError:
            return f"the process ended by signal {-code}"
    return f"the process ended with exit code {code}" if code else ""

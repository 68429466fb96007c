"""All rules on one FMU: those that read it here, those that run it each in a process of its own."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from . import rules  # noqa: F401  # registers them
from .fmu import Fmu, platform
from .registry import RULES, NotApplicableError, NotInstalledError, Rule

PACKAGES = Path(__file__).parents[2]


@dataclass
class Outcome:
    """What one rule found on one FMU.

    Attributes:
        found: violations, one line each.
        skipped: why the rule says nothing (more); empty if it was checked.
        missing: whether that is because a tool is not installed.
    """

    found: list[str] = field(default_factory=list)
    skipped: str = ""
    missing: bool = False


def examine(
    fmu: Fmu,
    chosen: Sequence[Rule],
    timeout: float = 60.0,
    run: bool = True,
    done: Callable[[], None] = lambda: None,
) -> dict[str, Outcome]:
    """Check one FMU.

    Args:
        fmu: the FMU.
        chosen: rules to check.
        timeout: for each trial [s].
        run: whether to run the FMU at all.
        done: called after each rule.

    Returns:
        Name of the rule -> what it found.
    """
    outcomes: dict[str, Outcome] = {}
    with tempfile.TemporaryDirectory(prefix="fmu_", ignore_cleanup_errors=True) as work:
        folder = Path(work) / "fmu"
        obstacle = "" if run else "the FMU is not to be run"
        if run and any(rule.runs for rule in chosen):
            obstacle = _prepare(fmu, folder)
        for rule in chosen:
            if not rule.runs:
                outcomes[rule.name] = _read(rule, fmu)
            elif obstacle:
                outcomes[rule.name] = Outcome(skipped=obstacle)
            else:
                outcomes[rule.name] = _try(rule, fmu, folder, timeout)
            done()
    return outcomes


def _prepare(fmu: Fmu, folder: Path) -> str:
    """Unpack; returns why the FMU cannot be run, or nothing."""
    if fmu.library not in {member.filename for member in fmu.members}:
        return f"there is no binary for {platform()}"
    if any(RULES["archive"].check(fmu)):
        return "its archive is not to be trusted"
    if not all(v.type and v.reference is not None for v in fmu.description.variables):
        return "variables have no type or no value reference"
    try:
        fmu.unpack(folder)
        (folder / "resources").mkdir(exist_ok=True)
    except Exception as error:
        return f"it cannot be unpacked: {error}"
    return ""


def _read(rule: Rule, fmu: Fmu) -> Outcome:
    outcome = Outcome()
    try:
        outcome.found += rule.check(fmu)
    except NotInstalledError as tool:
        outcome.skipped, outcome.missing = f"{tool} is not installed", True
    except NotApplicableError as reason:
        outcome.skipped = str(reason)
    return outcome


def _try(rule: Rule, fmu: Fmu, folder: Path, timeout: float) -> Outcome:
    """Run a trial in a fresh process; a crash or a hang is a finding."""
    report, note = (folder.parent / f"{rule.name}.{kind}" for kind in ("json", "note"))
    desk = folder.parent / "desk"  # an FMU may leave files where it runs
    desk.mkdir(exist_ok=True)
    paths = [str(PACKAGES), os.environ.get("PYTHONPATH", "")]
    ended = ""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "fmus.check.child", rule.name, folder, fmu.library, report, note],
            cwd=desk,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=timeout,
            check=False,
        )
        if done.returncode:
            ended = f"the process ended {_manner(done.returncode)}"
    except subprocess.TimeoutExpired:
        ended = f"it did not return within {timeout:g} s"
    if report.is_file():
        return Outcome(**json.loads(report.read_text()))
    where = note.read_text().strip() if note.is_file() else ""
    return Outcome([f"{where or 'start of the trial'}: {ended or 'the process ended without a word'}"])


def _manner(code: int) -> str:
    if code < 0:
        try:
            return f"by {signal.Signals(-code).name}"
        except ValueError:
            return f"by signal {-code}"
    return f"with exit code {code}"

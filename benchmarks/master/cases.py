"""What is timed, each in a process of its own."""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from .parts import time_components, time_fmi
from .plan import ROOT, Plan
from .simulators import time_container, time_ecos, time_fmpy, time_libcosim, time_master


@dataclass(frozen=True)
class Case:
    """Something to time: how the report calls it, and the function that a process of its own runs."""

    label: str
    run: Callable[[Plan, Path], dict[str, float]]


TOOLS = {
    "master": Case("this master", time_master),
    "libcosim_default": Case(
        "libcosim, default workers", partial(time_libcosim, structure="default_workers.ssd")
    ),
    "libcosim_0": Case("libcosim, 0 workers", partial(time_libcosim, structure="0_workers.ssd")),
    "ecos": Case("Ecos", time_ecos),
    "fmpy": Case("FMPy, SSP", time_fmpy),
    "container": Case("container FMU in FMPy", time_container),
}
PARTS = {
    "master_like_others": Case(
        "this master, Jacobi, no faults", partial(time_master, faults=False, algorithm="jacobi")
    ),
    "no_faults": Case("this master, no faults", partial(time_master, faults=False)),
    "no_log": Case("this master, no log", partial(time_master, log=False)),
    "neither": Case("this master, no faults, no log", partial(time_master, faults=False, log=False)),
    "fmi": Case("FMI calls alone", time_fmi),
    "components": Case("step functions alone", time_components),
}
CASES = TOOLS | PARTS


def run_apart(case: str, work: Path, timeout: float) -> dict[str, Any]:
    """Run a case in a process of its own; a crash or a hang becomes an ``error``."""
    out = work / case
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    command = [sys.executable, "-m", "benchmarks.master", "--case", case, str(work)]
    try:
        done = subprocess.run(
            command,
            cwd=ROOT,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return {"error": f"no end within {timeout:.0f} s"}
    answer = out / "result.json"
    if answer.is_file():
        return json.loads(answer.read_text())
    if done.returncode < 0:
        return {"error": f"ended by {signal.Signals(-done.returncode).name}"}
    return {"error": (done.stderr.strip().splitlines() or ["no result"])[-1]}


def run_here(case: str, work: Path) -> None:
    """What the process of a case does."""
    try:
        result = CASES[case].run(json.loads((work / "plan.json").read_text()), work / case)
    except ModuleNotFoundError as error:
        result = {"error": f"not installed: {error}"}
    except Exception as error:
        result = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
    (work / case / "result.json").write_text(json.dumps(result))

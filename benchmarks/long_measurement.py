"""What does a long measurement cost? ``python -m benchmarks.long_measurement``.

Sails scenarios/ellipse.json with scenarios/hidden.ssv until there are enough rows, at each of some
intervals between two rows, and runs ``learn`` and ``compare`` on one core: processor time, which on an
idle machine is the wall time, and the largest memory that a process took.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

import cosim

ROOT = Path(__file__).parents[1]
STEP = 0.01  # of the simulation [s]


def measurement(folder: Path, rows: int, interval: float, seed: int) -> Path:
    """A run with so many rows, one each ``interval`` [s]."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    content |= {"stop": (rows - 1) * interval, "seed": seed, "native": True, "metrics": {}}
    content["log"] = {"every": round(interval / STEP)}
    scenario = cosim.load_scenario(content)
    cosim.simulate(scenario, folder, parameters=[ROOT / "scenarios" / "hidden.ssv"])
    return folder


def cost(*arguments: object) -> tuple[int, float, float, str]:
    """Exit code, processor time [s], largest memory [GB] of a command on one core, what it thinned."""
    before = processor_time()
    process = subprocess.Popen(
        [sys.executable, "-m", *map(str, arguments)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}),
    )
    memory, said = 0.0, []
    while process.poll() is None:
        memory = max(memory, resident(process.pid))
        time.sleep(0.05)
    assert process.stdout is not None
    said = [line.strip() for line in process.stdout if "thinned" in line]
    return process.returncode, processor_time() - before, memory / 1e9, (said or [""])[0]


def processor_time() -> float:
    """Of all processes that were started and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def resident(pid: int) -> float:
    """Most memory [bytes] that a process, or one that it has started, has taken until now."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
        started = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return 0.0
    own = next((line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")), "0")
    return max([1024.0 * int(own), *(resident(int(child)) for child in started)])


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.long_measurement", description=__doc__)
    parser.add_argument("--rows", type=int, default=500_000, help="of each measurement (500000)")
    parser.add_argument(
        "--intervals", type=float, nargs="+", default=[0.01, 0.05, 0.1], help="between rows [s]"
    )
    parser.add_argument("--seed", type=int, default=1, help="of noise and faults (1)")
    options = parser.parse_args(arguments)
    table = Table("interval [s]", "command", "exit code", "processor time [s]", "memory [GB]", "it says")
    with tempfile.TemporaryDirectory(prefix="long_") as place:
        for interval in options.intervals:
            run = measurement(Path(place, f"{interval:g}"), options.rows, interval, options.seed)
            for command in ("diagnosis.learn", "diagnosis.compare"):
                code, seconds, memory, said = cost(
                    command, run, "--out", Path(place, command, f"{interval:g}")
                )
                table.add_row(
                    f"{interval:g}", command, str(code), f"{seconds:.0f}", f"{memory:.2f}", said[:120]
                )
    Console(width=200).print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())

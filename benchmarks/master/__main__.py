"""Time the master beside other co-simulation tools: ``python -m benchmarks.master``.

All run the five FMUs of the ellipse scenario, from the same files, with the same connections, the same
step and the same signals logged to CSV at each step, each in a process of its own. The repeats are
interleaved, so that a slow minute of the machine meets all of them.
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Any

from .cases import CASES, TOOLS, run_apart, run_here
from .plan import ROOT, SCENARIO, Plan, make_plan
from .timings import report

PACKAGES = (
    "cybership",
    "fmpy",
    "numpy",
    "pythonfmu",
    "libcosimpy",
    "ecospy",
    "fmu-manipulation-toolbox",
)


def read_end(folder: Path) -> tuple[dict[str, float], float]:
    """The last values that a tool logged, by our names, and the size of its log [MB]."""
    values: dict[str, float] = {}
    size = 0
    for path in folder.rglob("*.csv"):
        # libcosim writes a file for each instance, with the date behind its name.
        instance = re.sub(r"(_\d+){3}$", "", path.stem)
        lines = path.read_text().splitlines()
        size += path.stat().st_size
        for title, value in zip(lines[0].split(","), lines[-1].split(","), strict=True):
            name = title.strip(' "').removesuffix("[REAL]").replace("::", ".")
            values[name if "." in name else f"{instance}.{name}"] = float(value)
    return values, size / 1e6


def compare(plan: Plan, work: Path, case: str) -> dict[str, float]:
    """What a tool left: size of its log, and how far its end is from ours without faults."""
    values, size = read_end(work / case)
    ours, _ = read_end(work / "master_like_others")
    # A row shows the inputs of the step before it, or, in Ecos, those of the step after it.
    outputs = {*plan["signals"]}.difference(target for _, target in plan["connections"])
    missing = {*plan["signals"]}.difference(values)
    away = max(abs(values[n] - ours[n]) / max(1.0, abs(ours[n])) for n in outputs - missing)
    return {"log_mb": size, "away": away, "missing": len(missing)}


def time_commands(work: Path, repeat: int, native: bool) -> dict[str, list[float]]:
    """Whole runs from the command line, from the start of the process to its end [s]."""
    content = json.loads(SCENARIO.read_text()) | {"native": native}
    times: dict[str, list[float]] = {}
    for _ in range(repeat):
        for stop in (content["stop"], 100.0):
            path = work / "cold.json"
            path.write_text(json.dumps(content | {"stop": stop}))
            for label, options in (("no pictures", ["--no-plots"]), ("with pictures", [])):
                command = [sys.executable, "-m", "cosim.run", str(path), "--quiet", *options]
                before = perf_counter()
                subprocess.run([*command, "--out", str(work / "cold")], cwd=ROOT, check=True)
                times.setdefault(f"{stop:g} s, {label}", []).append(perf_counter() - before)
    return times


def machine() -> dict[str, str]:
    """What the numbers depend on."""
    facts = {
        "platform": platform.platform(),
        "CPUs": str(os.cpu_count()),
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
    }
    for package in PACKAGES:
        try:
            facts[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            facts[package] = "not installed"
    return facts


def measure(steps: int, repeat: int, native: bool, chosen: Sequence[str]) -> dict[str, Any]:
    """Run the chosen cases; the result is what ``--json`` writes."""
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        work = Path(folder)
        plan = make_plan(work, steps, native)
        cases: dict[str, dict[str, Any]] = {case: {"runs": []} for case in chosen}
        for k in range(repeat):
            names = list(cases)
            # Each round starts with another case: what ran before makes a difference.
            for case in names[k % len(names) :] + names[: k % len(names)]:
                found = cases[case]
                print(f"\r{k + 1}/{repeat}  {CASES[case].label:40}", end="", file=sys.stderr, flush=True)
                if "error" not in found:
                    result = run_apart(case, work, 60.0 + 0.01 * steps)
                    if "error" in result:
                        found["error"] = result["error"]
                    else:
                        found["runs"].append(result)
        for case in [name for name in TOOLS if name in cases]:
            if "error" not in cases[case]:
                cases[case] |= compare(plan, work, case)
        print(f"\r{'whole runs':46}", end="", file=sys.stderr, flush=True)
        commands = time_commands(work, repeat, native)
        print(f"\r{'':46}\r", end="", file=sys.stderr)
    return {
        "machine": machine(),
        "steps": steps,
        "repeat": repeat,
        "fmus": len(plan["fmus"]),
        "connections": len(plan["connections"]),
        "signals": len(plan["signals"]),
        "native": native,
        "cases": cases,
        "commands": commands,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.master", description=__doc__)
    parser.add_argument("--steps", type=int, default=10_000, help="steps of 0.01 s (10000)")
    parser.add_argument("--repeat", type=int, default=3, help="how often each is run (3)")
    parser.add_argument("--native", action="store_true", help="with native FMUs")
    parser.add_argument(
        "--cases",
        nargs="+",
        choices=CASES,
        default=[*CASES],
        metavar="CASE",
        help="only these, and ours",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here as well")
    parser.add_argument("--case", nargs=2, metavar=("CASE", "FOLDER"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.case:
        run_here(options.case[0], Path(options.case[1]))
        return 0
    if options.steps < 2 or options.repeat < 1:
        parser.error("needs at least 2 steps and 1 repeat")
    results = measure(
        options.steps,
        options.repeat,
        options.native,
        [case for case in CASES if case in {*options.cases, "master", "master_like_others"}],
    )
    report(results)
    if options.json:
        options.json.write_text(json.dumps(results, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

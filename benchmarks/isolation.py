"""What a process of its own costs an FMU: ``python -m benchmarks.isolation``.

The closed loop of the ellipse without faults, with nothing, one FMU and all FMUs isolated, one after the
other (Gauss-Seidel) and at once (Jacobi); then two FMUs that compute for a millisecond each, which
processes can do side by side. All take the step loop in Python, as isolated FMUs need it. Repeats are
interleaved, all signals are logged, and all logs of a system must be the same bytes.
"""

import argparse
import json
import sys
import tempfile
import textwrap
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
SCENARIO = ROOT / "scenarios" / "ellipse.json"

BUSY = textwrap.dedent(
    """
    import time
    from pythonfmu import Fmi2Causality, Fmi2Slave, Real


    class Busy(Fmi2Slave):
        def __init__(self, **kwargs):
            super().__init__(**kwargs)
            self.y = 0.0
            self.register_variable(Real("y", causality=Fmi2Causality.output))

        def do_step(self, t, h):
            end = time.thread_time() + 0.001
            while time.thread_time() < end:
                self.y += 1e-9
            self.y = t + h
            return True
    """
)


def time_run(content: dict[str, Any], isolated: Sequence[str], out: Path) -> tuple[np.ndarray, bytes]:
    """Wall time of each step [s], shape (steps - 1,), and the log."""
    import cosim
    from cosim.master import Master

    for name, entry in content["fmus"].items():
        entry["isolate"] = name in isolated
    marks: list[float] = []
    run = Master.run

    def marked(self: Master):
        for t in run(self):
            marks.append(perf_counter())
            yield t

    Master.run = marked
    try:
        result = cosim.simulate(cosim.load_scenario(content), out)
    finally:
        Master.run = run
    if result.status != "done":
        raise RuntimeError(result.message)
    return np.diff(marks), (out / "log.csv").read_bytes()


def measure(cases: dict[str, tuple[dict[str, Any], list[str]]], repeat: int) -> dict[str, np.ndarray]:
    """Wall time of all steps [s] of each case."""
    times: dict[str, list[np.ndarray]] = {label: [] for label in cases}
    logs: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory(prefix="isolation_") as work:
        for _ in range(repeat):
            for label, (content, isolated) in cases.items():
                spent, log = time_run(content, isolated, Path(work))
                times[label].append(spent)
                if logs.setdefault(content["name"], log) != log:
                    raise RuntimeError(f"'{label}' gives other numbers")
    return {label: np.concatenate(spent) for label, spent in times.items()}


def report(times: dict[str, np.ndarray]) -> None:
    """Print a table [us]; the quickest tenth is what a busy machine disturbs least."""
    print(f"{'us per step':44} {'tenth':>7} {'median':>7} {'mean':>7}")
    for label, steps in times.items():
        tenth, median = 1e6 * np.quantile(steps, [0.1, 0.5])
        print(f"{label:44} {tenth:7.0f} {median:7.0f} {1e6 * steps.mean():7.0f}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.isolation", description=__doc__)
    parser.add_argument("--steps", type=int, default=5000, help="steps of 0.01 s (5000)")
    parser.add_argument("--repeat", type=int, default=3, help="how often each is run (3)")
    options = parser.parse_args(arguments)
    if options.steps < 100 or options.repeat < 1:
        parser.error("needs at least 100 steps and 1 repeat")

    cases: dict[str, tuple[dict[str, Any], list[str]]] = {}
    ellipse = json.loads(SCENARIO.read_text())
    names = list(ellipse["fmus"])
    for algorithm, kind in (("gauss_seidel", "one after the other"), ("jacobi", "at once")):
        content = ellipse | {"algorithm": algorithm, "name": algorithm, "faults": [], "metrics": {}}
        content["native"] = False
        content["stop"] = options.steps * content["step"]
        for label, isolated in (("none", []), ("observer", ["observer"]), ("all five", names)):
            cases[f"ellipse, {kind}: {label} isolated"] = (content, isolated)
    with tempfile.TemporaryDirectory(prefix="busy_") as folder:
        from pythonfmu.builder import FmuBuilder

        script = Path(folder, "busy.py")
        script.write_text(BUSY)
        fmu = str(FmuBuilder.build_FMU(script, dest=folder))
        busy = {
            "name": "busy", "algorithm": "jacobi", "step": 0.01, "stop": options.steps // 10 * 0.01,
            "native": False, "fmus": {name: {"path": fmu} for name in "ab"},
        }  # fmt: skip
        cases["two FMUs of 1 ms, at once: none isolated"] = (busy, [])
        cases["two FMUs of 1 ms, at once: one isolated"] = (busy, ["b"])
        cases["two FMUs of 1 ms, at once: both isolated"] = (busy, ["a", "b"])
        report(measure(cases, options.repeat))
    return 0


if __name__ == "__main__":
    sys.exit(main())

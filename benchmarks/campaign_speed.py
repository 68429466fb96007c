"""What a campaign costs beside its runs: ``python -m benchmarks.campaign_speed``.

The ellipse with faults and metrics, over seeds. The same runs in a bare loop of one process (FMUs loaded
once and reset), as a campaign in this process, on one worker and on two. Repeats are interleaved. At the
end, the memory of a process over many short runs.
"""

import argparse
import json
import os
import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent


def axes(runs: int, stop: float, first: int) -> dict[str, Any]:
    """A campaign of the ellipse over seeds that were not used before."""
    return {
        "scenario": str(ROOT / "scenarios" / "ellipse.json"),
        "axes": {
            "stop": {"set": "stop", "values": [stop]},
            "seed": {"set": "seed", "values": list(range(first, first + runs))},
        },
    }


def campaign(content: dict[str, Any], workers: int) -> tuple[float, Any]:
    """Wall time [s] of a campaign, and its table."""
    import cosim

    with tempfile.TemporaryDirectory(prefix="speed_") as folder:
        started = time.perf_counter()
        made = cosim.run_campaign(content, folder, workers=workers)
        return time.perf_counter() - started, made


def bare(content: dict[str, Any]) -> float:
    """Wall time [s] of the same runs without campaign: prepare, step, compute the metrics."""
    import cosim
    from cosim.master import Master
    from cosim.results import compute
    from cosim.system import InstancePool, prepare

    scenario = json.loads(Path(content["scenario"]).read_text())
    scenario["stop"] = content["axes"]["stop"]["values"][0]
    started = time.perf_counter()
    system = prepare(cosim.load_scenario(scenario))
    pool = InstancePool({model.sha256 for model in system.models.values()})
    for seed in content["axes"]["seed"]["values"]:
        varied = prepare(cosim.load_scenario({**scenario, "seed": seed}), models=system.models)
        master = Master(varied, lambda _: None, pool=pool)
        names = [signal.name for signal in master.table.signals]
        rows = [(0.0, *master.table.row)]
        rows.extend((t, *master.table.row) for t in master.run())
        master.close()
        columns = dict(zip(["time", *names], zip(*rows, strict=True), strict=True))
        compute(columns, varied.scenario.metrics.start, varied.scenario.metrics.stop)
    pool.close()
    system.close()
    return time.perf_counter() - started


def memory(runs: int) -> list[float]:
    """Resident memory [MiB] of this process after each tenth of many short runs."""
    import cosim

    found: list[float] = []
    every = max(1, runs // 10)

    def progress(ended: int, failed: int, of: int) -> None:
        if ended and ended % every == 0:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            found.append(pages * os.sysconf("SC_PAGE_SIZE") / 2**20)

    content = axes(runs, 1.0, 0)
    content["axes"]["since"] = {"set": "metrics.from", "values": [0.0]}
    with tempfile.TemporaryDirectory(prefix="speed_") as folder:
        cosim.run_campaign(content, folder, workers=0, progress=progress)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaign_speed", description=__doc__)
    parser.add_argument("--runs", type=int, default=8, help="runs of each campaign (8)")
    parser.add_argument("--stop", type=float, default=198.0, help="end of a run [s] (198)")
    parser.add_argument("--repeat", type=int, default=3, help="how often each is timed (3)")
    parser.add_argument("--short", type=int, default=1000, help="runs of 1 s for the memory (1000)")
    options = parser.parse_args(arguments)
    cases: dict[str, Callable[[dict[str, Any]], float]] = {
        "bare loop": bare,
        "campaign, this process": lambda c: campaign(c, 0)[0],
        "campaign, 1 worker": lambda c: campaign(c, 1)[0],
        "campaign, 2 workers": lambda c: campaign(c, 2)[0],
    }
    times: dict[str, list[float]] = {name: [] for name in cases}
    for k in range(options.repeat):
        for name, timed in cases.items():
            times[name].append(timed(axes(options.runs, options.stop, 100 * k)))
    print(
        f"Python {platform.python_version()}, {options.runs} runs of {options.stop:g} s, wall time [s]"
    )
    print(f"{'':28}{'median':>9}{'smallest':>10}{'runs/s':>9}")
    for name, each in times.items():
        median = statistics.median(each)
        print(f"{name:28}{median:9.2f}{min(each):10.2f}{options.runs / median:9.3f}")
    if options.short:
        found = memory(options.short)
        print(f"memory over {options.short} runs of 1 s [MiB]: {', '.join(f'{m:.1f}' for m in found)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

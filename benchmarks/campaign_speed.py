"""What a campaign costs beside its runs: ``python -m benchmarks.campaign_speed``.

The ellipse with faults and metrics, over seeds: the same runs in a bare loop of one process (FMUs loaded
once and reset), as a campaign in this process, on one worker and on two; and in bare loops of two
processes at once, each with half of the runs, which tells what the second core of this machine is worth.
Repeats are interleaved; wall time, processor time of all processes and of this one, when the first run
of a campaign had ended, and how many runs a second the others made until the end. Then what a run costs
beside its steps, and the memory of a process over many short runs.
"""

import argparse
import json
import math
import multiprocessing
import os
import platform
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parent.parent
# Runs of two steps that tell the cost beside the steps, and those before, in which all is loaded.
SHORT, WARM = 200, 20


class Taken(NamedTuple):
    """Time [s] of some runs: by the clock, of the processors, of it here, until the first had ended."""

    wall: float
    processor: float
    here: float
    first: float


def axes(scenario: Path, runs: int, first: int) -> dict[str, Any]:
    """A campaign over seeds that were not used before."""
    seeds = list(range(first, first + runs))
    return {"scenario": str(scenario), "axes": {"seed": {"set": "seed", "values": seeds}}}


def ellipse(folder: Path, native: bool, stop: float, **keys: Any) -> Path:
    """The shipped ellipse with another end, in a file of its own."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    path = folder / f"{'native' if native else 'python'}_{stop:g}.json"
    path.write_text(json.dumps(content | {"native": native, "stop": stop} | keys))
    return path


def processor(whose: int) -> float:
    """Processor time [s] of this process, or of those that it has waited for."""
    used = resource.getrusage(whose)
    return used.ru_utime + used.ru_stime


def timed(work: Callable[[], float | None]) -> Taken:
    """Time of some work, which tells when its first run had ended, if it knows."""
    whom = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    started, before = time.perf_counter(), [processor(whose) for whose in whom]
    first = work()
    ended = time.perf_counter()
    here, others = (processor(whose) - used for whose, used in zip(whom, before, strict=True))
    until = math.nan if first is None else first - started
    return Taken(ended - started, here + others, here, until)


def campaign(content: dict[str, Any], workers: int) -> float:
    """The runs as a campaign; returns when the first had ended, of :func:`time.perf_counter`."""
    import cosim

    seen: list[float] = []

    def progress(ended: int, failed: int, of: int) -> None:
        if ended and not seen:
            seen.append(time.perf_counter())

    with tempfile.TemporaryDirectory(prefix="speed_") as folder:
        made = cosim.run_campaign(content, folder, workers=workers, progress=progress)
    assert set(made["status"]) == {"done"}
    return seen[0]


def bare(content: dict[str, Any]) -> None:
    """The same runs without campaign: prepare, step, compute the metrics."""
    import cosim
    from cosim.master import Master, Recorder, choose_loop
    from cosim.results import compute
    from cosim.system import InstancePool, prepare

    scenario = json.loads(Path(content["scenario"]).read_text())
    system = prepare(cosim.load_scenario(scenario))
    pool = InstancePool({model.sha256 for model in system.models.values()})
    for seed in content["axes"]["seed"]["values"]:
        loaded = cosim.load_scenario({**scenario, "seed": seed})
        varied = prepare(loaded, models=system.models, unlogged=system.models)
        master = Master(varied, lambda _: None, pool=pool)
        recorder = Recorder(varied, master, None)
        recorder.take(0.0)
        for _ in choose_loop(master, recorder.pending).steps:
            recorder.flush()
        master.close()
        compute(recorder.kept(), varied.scenario.metrics.start, varied.scenario.metrics.stop)
    pool.close()
    system.close()


def bare_twice(content: dict[str, Any]) -> None:
    """The same runs in two processes at once, without campaign."""
    seeds = content["axes"]["seed"]["values"]
    halves = [{**content, "axes": {"seed": {"values": seeds[first::2]}}} for first in (0, 1)]
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as processes:
        for _ in processes.map(bare, halves):
            pass


def beside_steps(folder: Path, native: bool) -> float:
    """Processor time [ms] of a run of two steps in a campaign of this process."""
    path = ellipse(folder, native, 0.02, metrics={})
    few, many = (
        timed(lambda n=n: campaign(axes(path, n, 0), 0)).processor for n in (WARM, WARM + SHORT)
    )
    return 1e3 * (many - few) / SHORT


def memory(folder: Path, native: bool, runs: int) -> list[float]:
    """Resident memory [MiB] of this process after each tenth of many short runs."""
    import cosim

    found: list[float] = []
    every = max(1, runs // 10)

    def progress(ended: int, failed: int, of: int) -> None:
        if ended and ended % every == 0:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            found.append(pages * os.sysconf("SC_PAGE_SIZE") / 2**20)

    content = axes(ellipse(folder, native, 1.0, metrics={}), runs, 0)
    with tempfile.TemporaryDirectory(prefix="speed_") as out:
        cosim.run_campaign(content, out, workers=0, progress=progress)
    return found


def compare(folder: Path, native: bool, options: argparse.Namespace) -> None:
    """Print what the runs take in each place."""
    path = ellipse(folder, native, options.stop)
    cases: dict[str, Callable[[dict[str, Any]], float | None]] = {
        "bare loop": bare,
        "campaign, this process": lambda c: campaign(c, 0),
    }
    others: dict[str, Callable[[dict[str, Any]], float | None]] = {
        "bare loops, 2 processes": bare_twice,
        "campaign, 1 worker": lambda c: campaign(c, 1),
        "campaign, 2 workers": lambda c: campaign(c, 2),
    }
    if not options.here:
        cases |= others
    campaign(axes(path, 1, 0), 0)  # builds the FMUs, and reads all modules
    taken: dict[str, list[Taken]] = {name: [] for name in cases}
    for k in range(options.repeat):
        for name, work in cases.items():
            content = axes(path, options.runs, 1 + k * options.runs)
            taken[name].append(timed(lambda w=work, c=content: w(c)))
    kind = "native" if native else "Python"
    print(f"{kind} FMUs, {options.runs} runs of {options.stop:g} s; medians")
    head = f"{'':28}{'wall s':>9}{'runs/s':>9}{'processor s':>13}{'a run, s':>10}"
    print(f"{head}{'here, s':>9}{'first, s':>10}{'then/s':>9}")
    for name, each in taken.items():
        wall, used, here, first = (statistics.median(column) for column in zip(*each, strict=True))
        stated = f"{name:28}{wall:9.2f}{options.runs / wall:9.3f}{used:13.2f}{used / options.runs:10.3f}"
        print(f"{stated}{here:9.2f}{first:10.2f}{(options.runs - 1) / (wall - first):9.3f}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaign_speed", description=__doc__)
    parser.add_argument("--runs", type=int, default=8, help="runs of each campaign (8)")
    parser.add_argument("--stop", type=float, default=198.0, help="end of a run [s] (198)")
    parser.add_argument("--repeat", type=int, default=3, help="how often each is timed (3)")
    parser.add_argument("--here", action="store_true", help="only what runs in this process")
    parser.add_argument("--short", type=int, default=1000, help="runs of 1 s for the memory (1000)")
    parser.add_argument("--python", action="store_true", help="Python FMUs, which are slow (native)")
    options = parser.parse_args(arguments)
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(prefix="speed_") as scratch:
        folder, native = Path(scratch), not options.python
        compare(folder, native, options)
        print(f"beside its steps a run takes {beside_steps(folder, native):.1f} ms of processor time")
        if options.short:
            found = memory(folder, native, options.short)
            stated = ", ".join(f"{m:.1f}" for m in found)
            print(f"memory over {options.short} runs of 1 s [MiB]: {stated}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

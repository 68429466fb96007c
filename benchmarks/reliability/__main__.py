"""Run the campaign: ``python -m benchmarks.reliability``; exit code 1 if anything misbehaves."""

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from . import __doc__ as about
from . import campaigns, endings, killed_commands, mutations, sanitized, ship_mutations

Part = tuple[str, int, Callable[[Path, Callable[[], None]], list[str]]]


def parts(options: argparse.Namespace) -> list[Part]:
    """Name, number of cases and work of each part."""
    seed, chosen = options.seed, options.deaths
    numbered = {
        "broken scenarios": (options.scenarios, mutations.broken_scenarios),
        "broken files": (options.files, mutations.broken_files),
        "broken ships": (options.ships, ship_mutations.broken_ships),
        "kills": (options.kills, endings.kills),
        "signals": (options.signals, endings.signals),
        "short of disk": (options.disk, endings.short_of_disk),
        "interrupted campaigns": (options.campaigns, campaigns.interrupted_campaigns),
        "deaths in campaigns and replays": (options.elsewhere, campaigns.deaths_elsewhere),
        "spoilt cache": (options.cache, campaigns.spoilt_cache),
        "interrupted compares": (options.compares, killed_commands.interrupted_compares),
        "killed compares and learns": (options.diagnoses, killed_commands.killed_diagnoses),
        "interrupted and killed native builds": (options.builds, killed_commands.ended_builds),
        "killed campaigns": (options.killed_campaigns, killed_commands.killed_campaigns),
        "calls under sanitizers": (options.calls, sanitized.sanitized_calls),
    }
    found: list[Part] = [
        (name, count, partial(do, count, seed)) for name, (count, do) in numbered.items() if count
    ]
    if (chosen or not options.only) and (count := len(endings.cases(chosen, seed))):
        found.append(("deaths of an FMU", count, partial(endings.deaths, chosen, seed)))
    return found


COUNTS = {
    "scenarios": 1000,
    "files": 300,
    "ships": 200,
    "kills": 100,
    "signals": 100,
    "disk": 30,
    "campaigns": 100,
    "elsewhere": 60,
    "cache": 100,
    "compares": 45,
    "diagnoses": 20,
    "builds": 20,
    "killed-campaigns": 10,
    "calls": 8000,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reliability", description=about)
    for name, count in COUNTS.items():
        parser.add_argument(f"--{name}", type=int, metavar="N", help=f"({count})")
    parser.add_argument(
        "--deaths", type=int, metavar="N", help="of an FMU (every way in every function)"
    )
    parser.add_argument("--only", action="store_true", help="leave out parts without a number")
    parser.add_argument("--seed", type=int, default=1, help="of all random choices (1)")
    options = parser.parse_args(arguments)
    for name, count in COUNTS.items():
        name = name.replace("-", "_")
        if getattr(options, name) is None:
            setattr(options, name, 0 if options.only else count)
    if (
        signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    ):  # in the background of a shell; commands inherit it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    console, table, wrong = Console(), Table("part", "cases", "misbehaved", "minutes"), []
    with (
        tempfile.TemporaryDirectory(prefix="reliability_") as work,
        Progress(console=Console(stderr=True), transient=True) as bar,
    ):
        for name, count, do in parts(options):
            task, begun = bar.add_task(name, total=count), time.perf_counter()
            found = do(Path(work), lambda task=task: bar.advance(task))
            wrong += found
            cases = len({text.partition(":")[0] for text in found})
            table.add_row(name, str(count), str(cases), f"{(time.perf_counter() - begun) / 60:.1f}")
    for text in wrong:
        console.print(ascii(text)[1:-1][:300], markup=False, highlight=False)
    console.print(table)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

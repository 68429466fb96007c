"""Run a scenario: ``python -m cosim.run SCENARIO [--out DIR]``."""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from rich.console import Console

from cybership.message_text import counted

from .command import (
    BAD_INPUT,
    FAILED,
    INTERRUPTED,
    Output,
    command_parser,
    complain,
    folder_name,
    positive,
    printable,
    renamed_option,
    run_command,
    whole_number,
)
from .compiled.library import kind_of
from .errors import InputError, SimulationError
from .interrupts import on_interrupt, restore
from .master.ending import Result
from .master.simulation import simulate
from .process.run_state import STATE
from .process.spawned import mute_started_processes
from .results.performance import METRICS, table
from .scenario.scenario_options import add_scenario_options, chosen_scenario
from .scenario.schema import Scenario
from .trials.trial_outcome import sheet

EXIT_CODES = {"done": 0, "failed": FAILED, "interrupted": INTERRUPTED}


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    console = Console(stderr=True, highlight=False, soft_wrap=True)

    def show(text: str) -> None:
        if not options.quiet:
            console.print(printable(text), markup=False)

    STATE.timeout = options.timeout
    log = [] if options.log is None else [("log.signals", options.log)]
    log += [("log.format", "parquet")] if options.parquet else []
    try:
        scenario = chosen_scenario(options, *log)
        if options.ensemble is not None or options.posterior is not None:
            return _ensemble(scenario, options, console, show)
        with ExitStack() as shown:
            progress = shown.enter_context(_progress(console, scenario, options.quiet))

            def measured(metrics: dict[str, float]) -> None:
                shown.close()  # the metrics do not wait for the pictures
                if not options.quiet and METRICS[0].name in metrics:
                    with suppress(BrokenPipeError):
                        Output(highlight=False).print(table(metrics))

            result = simulate(
                scenario,
                options.out,
                options.parameters,
                options.realtime,
                pictures=not options.no_plots,
                only_own=options.only_own,
                show=show,
                progress=progress,
                controller_model=options.controller_model,
                overwrite=options.overwrite,
                measured=measured,
            )
    except InputError as error:
        complain(error)
        return BAD_INPUT
    if options.verbose and result.loop:
        why = f": {result.loop_reason}" if result.loop_reason else ""
        show(f"note: the {result.loop} step loop ran{why}")
    handlers = on_interrupt(lambda: None)  # too late: the run has ended, and its log says how
    try:
        with suppress(BrokenPipeError):
            _report(result, options.quiet)
    finally:
        restore(handlers)
    return EXIT_CODES[result.status]


def _ensemble(
    scenario: Scenario, options: argparse.Namespace, console: Console, show: Callable[[str], None]
) -> int:
    """Run the scenario with many ships; returns the exit code."""
    if options.ensemble is None or options.posterior is None:
        raise InputError("--ensemble N needs --posterior FILE.json, and --posterior needs --ensemble")
    if options.realtime is not None:
        raise InputError("an ensemble does not run in real time: leave --realtime out")
    from .campaign.ensemble import run_ensemble, spread  # only now: pandas takes a second to import
    from .campaign.shown_progress import shown_progress

    folder = Path(options.out or Path("results", f"{scenario.name}_ensemble"))
    if STATE.watched:
        mute_started_processes()
    try:
        with shown_progress(console, options.quiet) as progress:
            made = run_ensemble(
                scenario,
                options.posterior,
                options.ensemble,
                folder,
                options.parameters,
                options.controller_model,
                options.only_own,
                pictures=not options.no_plots,
                show=show,
                progress=progress,
                overwrite=options.overwrite,
            )
    except SimulationError as error:
        complain(error)
        return FAILED
    except KeyboardInterrupt:
        kept = (
            [f"finished runs are in '{folder}'; the same command continues"] if folder.exists() else []
        )
        raise KeyboardInterrupt(*kept) from None
    failed = made.query("status == 'failed'")
    if len(failed):
        complain(failed["message"].iloc[0], kind=f"{len(failed)} of {len(made)} members failed: ")
    if not options.quiet:
        output = Output(highlight=False)
        output.print(spread(made))
        output.print(printable(f"{len(made)} members in {folder}"), soft_wrap=True)
    return 0


@contextmanager
def _progress(console: Console, scenario: Scenario, quiet: bool) -> Iterator[Callable[[float], None]]:
    """Show how far a run is: ``progress(t)`` with the simulated time [s]."""
    if quiet or not console.is_terminal:
        yield lambda t: None
        return
    from rich.markup import escape  # only now: most runs of a program need none of this
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as shown:
        task = shown.add_task(escape(printable(scenario.name)), total=scenario.stop)
        yield lambda t: shown.update(task, completed=t)


def _report(result: Result, quiet: bool) -> None:
    kept_rows = f"{counted(result.rows, 'row')} {'is' if result.rows == 1 else 'are'} kept in"
    if result.status == "failed":
        kept = f"; {kept_rows} '{result.folder}'" if result.rows else ""
        complain(f"{result.message}{kept}")
    elif result.status == "interrupted":
        complain(f"{kept_rows} '{result.folder}'", kind="interrupted: ")
    if quiet:
        return
    output = Output(highlight=False)
    if result.trial is not None:
        output.print(sheet(result.trial))
    if result.pace:
        output.print(
            f"real time x {result.pace['factor']:g}: {result.pace['deadline_misses']} missed deadlines, "
            f"at most {1e3 * result.pace['lateness_max']:.2f} ms late, "
            f"jitter {1e3 * result.pace['jitter_rms']:.2f} ms RMS"
        )
    if result.status == "done":
        output.print(printable(f"{counted(result.rows, 'row')} in {result.folder}"), soft_wrap=True)
    if kind := kind_of(result.native):
        output.print(kind, soft_wrap=True)


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "cosim.run",
        "Run a co-simulation scenario: log.csv, log.json, metrics.json and pictures.",
        "examples:  %(prog)s scenarios/ellipse.json\n"
        "           %(prog)s scenarios/ellipse.json --out /tmp/e --no-plots\n"
        "           %(prog)s scenarios/ellipse.json --parameters model.ssv\n"
        "           %(prog)s ellipse --parameters model.ssv --ensemble 50 --posterior posterior.json\n"
        "           %(prog)s waypoints --ship my_ship.toml\n"
        "           %(prog)s theirs.json --only-own\n"
        "           %(prog)s scenarios/ellipse.json --set vessel.m=15 --seed 3\n"
        "           %(prog)s scenarios/ellipse.json --set controller=./mine.fmu\n"
        "           %(prog)s system.ssp --stop 100\n"
        "exit codes: 0 done, 2 bad input, 3 simulation failed (log kept), 130 interrupted (log kept)",
    )
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        help="JSON file, or the name of a shipped one; or an SSP archive, an OSP directory or its "
        "OspSystemStructure.xml",
    )
    add_scenario_options(parser, "--stop", "--ship", "--seed", "--set", "--parameters")
    parser.add_argument(
        "--step",
        type=positive,
        metavar="SECONDS",
        help="base step [s] (default: that of the scenario)",
    )
    parser.add_argument(
        "--out",
        type=folder_name,
        metavar="DIR",
        help="result folder (default: results/<name>; if it holds another run, results/<name>_2, ...)",
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="use results/<name> even if it holds another run, and replace a log without a run",
    )
    parser.add_argument(
        "--log",
        choices=("all", "compact"),
        help="signals in the log: all, or only those that metrics, pictures and the diagnosis need "
        "(default: those of the scenario)",
    )
    parser.add_argument("--parquet", action="store_true", help="write log.parquet in place of log.csv")
    renamed_option(
        parser.add_mutually_exclusive_group(),
        "--controller-model",
        metavar="FILE.ssv",
        action="append",
        default=[],
        help="SSP parameter set, such as a learned model.ssv, for the model of the ship inside "
        "controllers and observers; the simulated ship stays as it is; may be given several times",
    )
    parser.add_argument(
        "--ensemble",
        type=whole_number(2),
        metavar="N",
        help="run N ships with parameters drawn from --posterior; draw bands of track and heading",
    )
    parser.add_argument(
        "--posterior",
        type=Path,
        metavar="FILE.json",
        help="mean and covariance of parameters, as the command learn writes it, for --ensemble",
    )
    add_scenario_options(parser, "--timeout", "--quiet")
    parser.add_argument(
        "--verbose", action="store_true", help="also print which step loop ran, and the reason"
    )
    add_scenario_options(parser, "--native")
    parser.add_argument("--no-plots", action="store_true", help="draw no pictures")
    parser.add_argument(
        "--only-own",
        action="store_true",
        help="refuse FMUs with programs that python -m fmus.build has not built on this computer",
    )
    parser.add_argument(
        "--realtime",
        nargs="?",
        type=positive,
        const=1.0,
        metavar="FACTOR",
        help="run in real time, or FACTOR times as fast as real time (without FACTOR: 1)",
    )
    return parser


if __name__ == "__main__":
    run_command(main)

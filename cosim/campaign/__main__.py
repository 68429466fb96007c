"""Run a campaign: ``python -m cosim.campaign campaign.json [--out DIR] [--workers N]``."""

from __future__ import annotations

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
import os
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from cybership.scratch_folder import atomic_write

from ..command import (
    BAD_INPUT,
    FAILED,
    Output,
    command_parser,
    complain,
    folder_name,
    printable,
    run_command,
    whole_number,
)
from ..errors import InputError, SimulationError
from ..process.run_state import STATE
from ..process.spawned import mute_started_processes
from ..scenario.scenario_options import add_scenario_options
from ..trials.measures import EVERY
from .conduct import demand_packages, result_folder, run_campaign
from .shown_progress import shown_progress

if TYPE_CHECKING:
    import pandas

# Metrics of tables and pictures where the user names none: an error, its heading, and what it costs.
USUAL = ("e_pos_rms", "cross_track_rms", "heading_rms", "W", "I_tau_dot")

# Width that no table reaches [characters].
WIDE = 10_000

# Messages of failed runs that are shown; chosen: the table has all.
MESSAGES = 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    out = result_folder(options.campaign, options.out)
    if options.workers != 0 and STATE.watched:
        mute_started_processes()
    STATE.timeout = options.timeout
    try:
        _check(options)
        with shown_progress(console, options.quiet) as progress:
            made = run_campaign(
                options.campaign,
                out,
                options.workers,
                options.scheduler,
                options.keep_logs,
                options.stop_when,
                lambda text: None if options.quiet else console.print(printable(text), markup=False),
                progress,
                options.overwrite,
                native=options.native,
            )
        failed = made.query("status == 'failed'")
        for message, count in Counter(failed["message"]).most_common(MESSAGES):
            complain(message, kind=f"{count} of {len(made)} runs failed: ")
        if not options.quiet:
            Output(highlight=False).print(printable(f"{len(made)} runs in {out}"), soft_wrap=True)
        if len(failed) == len(made):
            return FAILED
        _evaluate(options, made, out)
    except InputError as error:
        complain(error)
        return BAD_INPUT
    except SimulationError as error:
        complain(error)
        return FAILED
    except KeyboardInterrupt:
        kept = [f"finished runs are in '{out}'; the same command continues"] if out.exists() else []
        raise KeyboardInterrupt(*kept) from None
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse what could not be made of the table, before anything runs."""
    metrics = [*(options.metrics or ()), *(options.pareto or ())]
    if options.compare is None and not metrics:
        return
    demand_packages()
    from .campaign_file import LoadedCampaign
    from .comparison import check_request
    from .design import cases

    check_request(cases(LoadedCampaign(options.campaign).campaign), options.compare, metrics)


def _evaluate(options: argparse.Namespace, made: pandas.DataFrame, out: Path) -> None:
    """What is made of the table on request: the Pareto set, differences, pictures."""
    from .campaign_file import LoadedCampaign
    from .comparison import differences, pareto

    loaded = LoadedCampaign(options.campaign)
    campaign = loaded.campaign
    axes = list(campaign.axes)
    over = [name for name, axis in campaign.axes.items() if axis.paths == ["seed"] and len(axes) > 1]
    metrics = options.metrics or [m for m in USUAL if made[m].notna().any()]
    if options.pareto:
        found = pareto(made, axes, options.pareto, over)
        _write(found, out / "pareto.csv")
        rows = [[_number(x) for x in row] for row in found.itertuples(index=False)]
        _print(f"not dominated in both {' and '.join(options.pareto)}", [*found.columns], rows)
    if options.compare:
        found = differences(made, axes, options.compare, metrics)
        units = {metric.name: metric.unit for metric in EVERY}
        _write(found, out / "differences.csv")
        rows = [
            [
                *(str(row[key]) for key in ("value", "against", "metric")),
                units[row["metric"]],
                str(row["pairs"]),
                f"{row['difference']:.3g} ± {row['half']:.2g}",
                "{percent:+.2f} ({percent_low:+.2f} to {percent_high:+.2f})".format(**row),
                _better(row),
            ]
            for row in found.to_dict("records")
        ]
        header = ["against", "metric", "unit", "pairs", "difference", "percent", "better"]
        title = "paired differences with 95 % intervals; less is better for all metrics"
        _print(title, [options.compare, *header], rows)
    if options.plot:
        from .charts import axis_units, draw_campaign

        units = axis_units(loaded)
        for path in draw_campaign(made, axes, over, metrics, out, options.compare, units):
            print(path)


def _better(row: Mapping[Hashable, Any]) -> str:
    """Which of two values is better: one is if the interval of the difference is on one side of zero."""
    low, high = row["difference"] - row["half"], row["difference"] + row["half"]
    return str(row["value"]) if high < 0.0 else str(row["against"]) if low > 0.0 else "not known"


def _write(found: pandas.DataFrame, path: Path) -> None:
    with atomic_write(path) as scratch:
        found.to_csv(scratch, index=False)


def _print(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    shown = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for name in header:
        shown.add_column(printable(name), no_wrap=True)
    for row in rows:
        shown.add_row(*map(printable, row))
    console = Output(highlight=False, soft_wrap=True)
    # A narrow terminal breaks lines, which is better than to cut off numbers.
    whole = console.measure(shown, options=console.options.update(width=WIDE)).maximum
    console.width = max(console.width, whole)
    console.print(shown)


def _number(x: object) -> str:
    return f"{x:.4g}" if isinstance(x, float) else str(x)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "cosim.campaign",
        "Run a scenario many times, and write one table: runs.parquet.",
        "examples:  %(prog)s scenarios/campaigns/gains.campaign.json\n"
        "           %(prog)s gains.campaign.json --compare controller --plot\n"
        "           %(prog)s campaign.json --stop-when 'controller e_pos_rms 2%%'\n"
        "           %(prog)s campaign.json --scheduler tcp://10.0.0.1:8786\n"
        "exit codes: 0 done, 2 bad input, 3 every run failed or the workers were lost, 130 interrupted\n"
        "A finished run is never made again: the same command goes on where it was interrupted.",
    )
    parser.add_argument(
        "campaign", metavar="CAMPAIGN", type=Path, help="JSON file, see docs/campaign.md"
    )
    parser.add_argument(
        "--out", type=folder_name, metavar="DIR", help="result folder (default: results/<file name>)"
    )
    parser.add_argument(
        "--workers",
        type=whole_number(0),
        metavar="N",
        help=f"processes on this computer (default: {os.cpu_count()}); 0: run all in this process, "
        "without Dask",
    )
    parser.add_argument(
        "--scheduler", metavar="tcp://HOST:PORT", help="run on the workers of this Dask scheduler"
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="allow the loss of runs of another campaign in DIR/runs.parquet",
    )
    add_scenario_options(parser, "--native", "--timeout")
    parser.add_argument("--keep-logs", action="store_true", help="keep the log of each run, in DIR/logs")
    parser.add_argument(
        "--stop-when",
        metavar="'AXIS METRIC WIDTH'",
        help="stop when the half width of the paired difference between the first and each other value "
        "of an axis is at most WIDTH, in the unit of the metric or in percent",
    )
    parser.add_argument(
        "--compare",
        metavar="AXIS",
        help="paired differences between the values of this axis, with intervals",
    )
    parser.add_argument(
        "--pareto",
        type=_names,
        metavar="M1,M2",
        help="the choices that are not dominated in these metrics",
    )
    parser.add_argument("--plot", action="store_true", help="pictures of metrics over axes")
    parser.add_argument(
        "--metrics",
        type=_names,
        metavar="M1,M2",
        help=f"metrics for pictures and --compare (default: {','.join(USUAL)})",
    )
    add_scenario_options(parser, "--quiet")
    return parser


if __name__ == "__main__":
    run_command(main)

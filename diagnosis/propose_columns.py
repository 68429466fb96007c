"""Propose the file beside a measurement: ``python -m diagnosis.propose_columns FILE [--write]``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from cosim import InputError
from cosim.command import command_parser, printable, run_command

from .commands.command_line import Done, anyway_option, run, ship_option
from .execution.progress import Advance
from .execution.result_folder import together


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    options.out = options.file.parent
    return run(columns, options)


def columns(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .assessment.gathering import gather
    from .predictors import Model, ship_with
    from .runs import propose  # only now: they take a second to import

    craft = ship_with((), options.ship)
    path = options.file
    beside = path.with_name(f"{path.name}.json")
    if options.write and not options.overwrite and beside.exists():
        raise InputError(f"'{beside}' is there already; --overwrite replaces it")
    found = propose(path, craft)
    (windows,) = gather([found.run], advance, options.anyway, Model(ship=craft))  # as all commands do
    track, counts = windows.smoothed.track, windows.smoothed.counts
    seconds = track.run.time[-1] - track.run.time[0]
    shown = [
        f"'{path}': {counts.samples} samples in {seconds:.4g} s, one each {track.period:.3g} s; "
        f"{counts.frozen} frozen, {counts.dropped} dropped, {counts.spikes} spikes",
        *track.notes,
    ]
    if found.unused:
        shown.append(f"not used: {', '.join(found.unused)}")
    if not found.needed:
        return Done(0, [*map(printable, shown), f"nothing needs to be stated next to '{path}'"])
    text = json.dumps(found.needed, indent=2, ensure_ascii=False)
    if options.write:
        with together(path.parent, (beside.name,)) as new:
            (new / beside.name).write_text(f"{text}\n", encoding="utf-8")
    stated = f"written into '{beside}':" if options.write else f"--write puts this into '{beside}':"
    return Done(0, [*map(printable, [*shown, stated]), text])


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "diagnosis.propose_columns",
        "Look at a measurement, and propose the JSON file beside it: names, units, "
        "separator, decimal mark, lines before the names, encoding.",
        "examples:  %(prog)s my.csv\n"
        "           %(prog)s my.csv --ship otter --write\n"
        "exit codes: 0 done, 2 bad input (nothing is written), 130 interrupted (nothing is written)",
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="CSV or Parquet file")
    ship_option(parser)
    parser.add_argument("--write", action="store_true", help="write it, as FILE.json")
    parser.add_argument("--overwrite", action="store_true", help="also over one that is there")
    anyway_option(parser)
    return parser


if __name__ == "__main__":
    run_command(main)

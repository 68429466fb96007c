"""Repair a measurement by its own channels: ``python -m diagnosis.repair RUN --out FILE``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Sequence
from math import degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from cosim import InputError
from cosim.command import command_parser, run_command

from .commands.command_line import Done, run
from .execution.progress import Advance
from .execution.result_folder import together

if TYPE_CHECKING:
    from fmus.scale import Scale

    from .runs import Examined, Run

WINDOW = 8.0  # s, times the scale of the ship: of a prediction
KINDS = (".csv", ".parquet")
ALONE = (
    "the pose is all that is measured: nothing says the same twice, so nothing can be held against it"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(repair, _parser().parse_args(arguments))


def repair(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .predictors import ship_with
    from .runs import examine, layout_beside, read, table_of  # only now: they take a second to import

    out = options.out
    if out.suffix not in KINDS:
        raise InputError(f"'{out}' is neither .csv nor .parquet")
    if out.exists() and not options.overwrite:
        raise InputError(f"'{out}' is there already; --overwrite replaces it")
    craft = ship_with((), options.ship)
    advance("reading")
    measured = read(options.run, of=craft)
    advance("what channels say of each other")
    found = examine(measured, craft.scale)
    beside = f"{out.name}.json"
    with together(out.parent, (out.name, beside)) as new:
        table = table_of(found.run)
        if out.suffix == ".csv":
            table.to_csv(new / out.name, index=False)
        else:
            table.to_parquet(new / out.name, index=False)
        told = layout_beside(found.run)
        (new / beside).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    return Done(
        0, [*_told(found), *_closed(measured, found.run, craft.scale), f"written: {out}, {out}.json"]
    )


def _told(found: "Examined") -> list[str]:
    """What was found and done, a line each."""
    from .runs import sensor_lines

    beside = ", ".join(found.run.measured)
    first = f"measured beside the pose: {beside}" if beside else ALONE
    lines = [*sensor_lines(found.findings), *found.notes]
    if beside and not found.findings:
        lines.append("no fault: what says the same twice agrees")
    return [first, *lines]


def _closed(before: "Run", after: "Run", scale: "Scale") -> list[str]:
    """What windows of the length of a prediction miss by, before and after."""
    from .runs import closure

    window = WINDOW * scale.time
    pairs = [closure(run, window, window) for run in (before, after)]
    position, heading = zip(*pairs, strict=True)
    lines = []
    if all(map(isfinite, position)):
        shown = " -> ".join(f"{x:.3g}" for x in position)
        lines.append(f"position by speed and heading over {window:.3g} s misses by (median): {shown} m")
    if all(map(isfinite, heading)):
        shown = " -> ".join(f"{degrees(x):.3g}" for x in heading)
        lines.append(f"heading by yaw rate over {window:.3g} s in turns misses by (RMS): {shown}°")
    return lines


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.repair",
        "Hold the channels of a measurement that say the same twice against each other, "
        "and repair what they show to be wrong: clock, scale, offset, place, delay, wraps, units. "
        "No model of the ship is used.",
        "examples:  %(prog)s trial.csv --ship my_ship.toml --out repaired.csv\n"
        "exit codes: 0 done, nothing may be wrong; 2 bad input; 130 interrupted (nothing written)",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="measured run, or folder of a log")
    made.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="CSV or Parquet file; FILE.json beside it tells the noise",
    )
    made.add_argument("--ship", metavar="NAME|FILE.toml", help="the ship that was measured (cse1)")
    made.add_argument("--overwrite", action="store_true", help="also over a file that is there")
    return made


if __name__ == "__main__":
    run_command(main)

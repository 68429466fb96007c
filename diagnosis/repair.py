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

from cosim.command import command_parser, run_command

from .commands.command_line import Done, anyway_option, run, ship_option
from .commands.table_file import table_options, table_target, write_table
from .execution.progress import Advance
from .execution.result_folder import together

if TYPE_CHECKING:
    from fmus.scale import Scale

    from .runs import Examined, Run


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(repair, _parser().parse_args(arguments))


def repair(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .predictors import ship_with
    from .runs import clean, layout_beside, prepare, table_of  # only now: they take a second to import

    out = table_target(options)
    craft = ship_with((), options.ship)
    advance("reading and comparing channels")
    prepared = prepare(options.run, craft, anyway=True)  # what cannot be repaired is reported
    repaired = prepared.sensors.run
    clean(repaired, options.anyway, craft.scale)  # a run that it refuses, no command reads
    side_car = f"{out.name}.json"
    with together(out.parent, (out.name, side_car)) as new:
        write_table(table_of(repaired), new / out.name)
        beside = layout_beside(repaired)
        (new / side_car).write_text(json.dumps(beside, indent=2) + "\n", encoding="utf-8")
    closed = _closed(prepared.raw, repaired, craft.scale)
    return Done(0, [*_found(prepared.sensors), *closed, f"written: {out}, {out}.json"])


def _found(sensors: "Examined") -> list[str]:
    """What was found and done, a line each."""
    from .runs import sensor_lines

    others = ", ".join(sensors.run.measured)
    lines = [*sensor_lines(sensors.findings), *sensors.notes, *sensors.run.notes]
    if not (others or sensors.aside):
        return ["only the pose is measured: no redundant channel for a comparison", *lines]
    if not (sensors.findings or sensors.notes):
        lines.append("no fault detected: redundant channels agree")
    return [f"measured in addition to the pose: {others or 'nothing that agrees with it'}", *lines]


def _closed(before: "Run", after: "Run", scale: "Scale") -> list[str]:
    """Errors of windows of the length of a prediction, before and after."""
    from .predictors.weak_form import HORIZON
    from .runs import closure

    window = HORIZON * scale.time
    pairs = [closure(run, window, window) for run in (before, after)]
    names = {
        "position by speed and heading": ("median", "m", 1.0),
        "heading by yaw rate in turns": ("RMS", "°", degrees(1.0)),
    }
    lines = []
    for errors, (name, (kind, unit, factor)) in zip(
        zip(*pairs, strict=True), names.items(), strict=True
    ):
        if all(map(isfinite, errors)):
            shown = " -> ".join(f"{factor * error:.3g}" for error in errors)
            lines.append(f"error of the {name} over {window:.3g} s ({kind}): {shown} {unit}")
    return lines


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.repair",
        "Compare the redundant channels of a measurement, and repair the detected faults: clock, "
        "scale, offset, place, delay, wraps, units. No model of the ship is used.",
        "examples:  %(prog)s trial.csv --ship my_ship.toml --out repaired.csv\n"
        "exit codes: 0 done, nothing may be wrong; 2 bad input; 130 interrupted (nothing written)",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="measured run, or folder of a log")
    table_options(made, "CSV or Parquet file; FILE.json next to it has the noise")
    ship_option(made)
    anyway_option(made)
    return made


if __name__ == "__main__":
    run_command(main)

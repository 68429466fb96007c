"""Propose the file beside a measurement: ``python -m diagnosis.propose_columns FILE... [--write]``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.text import Text

from cosim import InputError
from cosim.command import command_parser, printable, run_command

from .commands.command_line import Done, anyway_option, run, ship_option
from .execution.progress import Advance
from .execution.result_folder import together

if TYPE_CHECKING:
    from fmus.ship import Ship

    from .runs import Column, Layout, LikelyColumn, Proposal, Run
    from .runs.smoothing.smoother import Smoothed

TABLES = (".csv", ".parquet", ".mat")
HEADS = ("samples", "frozen", "dropped", "spikes", "used")  # what becomes of the samples


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    options.out = options.file[0].parent
    return run(columns, options)


def columns(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .predictors import ship_with  # only now: it takes a second to import

    if len(options.file) == 1 and (folder := options.file[0]).is_dir():
        raise InputError(f"'{folder}' is a folder; give files of it, as '{folder / '*.csv'}'")
    craft = ship_with((), options.ship)
    if len(options.file) == 1:
        return _of_file(options, craft, advance)
    return _of_folder(options, craft, advance)


def _of_file(options: argparse.Namespace, craft: "Ship", advance: Advance) -> Done:
    """The file beside one measurement."""
    from .runs import beside, propose, stated_layout

    path = options.file[0]
    target = beside(path)
    there = stated_layout(path)
    found = propose(path, craft)
    _refuse_there(options, target, there)
    if found.run is None:
        shown = [f"'{path}': no column is known for {', '.join(found.likely)}"]
    else:
        shown = _seen(path, found.run, craft, options.anyway, advance)
    if found.by_numbers:
        units = (f"{signal} in {unit}" for signal, unit in found.by_numbers.items())
        shown.append(f"units by the numbers: {', '.join(units)}")
    if found.unused:
        shown.append(f"not used: {', '.join(found.unused)}")
    shown = list(map(printable, [*shown, *_blanks([found], options)]))
    if not found.needed:
        return Done(0, [*shown, printable(f"no side-car is needed for '{path}'")])
    if found.layout == there:
        return Done(0, [*shown, printable(f"the side-car of '{path}' is complete")])
    return Done(0, [*shown, *_stated(target, found.needed, options.write)])


def _seen(path: Path, run: "Run", craft: "Ship", anyway: bool, advance: Advance) -> list[str]:
    """The samples of a measurement, or why it cannot be used as it is proposed."""
    try:
        s = _smoothed(run, craft, anyway, advance)
    except InputError as error:
        return [f"not usable yet: {error}"]
    return [
        f"'{path}': {s.counts.samples} samples in {_seconds(s):.4g} s, one each "
        f"{s.track.period:.3g} s; {s.counts.frozen} frozen, {s.counts.dropped} dropped, "
        f"{s.counts.spikes} spikes",
        *_found_in(s),
    ]


def _found_in(s: "Smoothed") -> Iterator[str]:
    """What is found in a measurement: by the pose and the commands, and by redundant channels."""
    from .runs import sensor_lines

    yield from s.notes
    if s.sensors is not None:
        yield from sensor_lines(s.sensors.findings)


def _of_folder(options: argparse.Namespace, craft: "Ship", advance: Advance) -> Done:
    """One file for all measurements of a folder, and a table of them."""
    from .runs import FOLDER_FILE, Layout, as_json, common_layout, propose, read, stated_layout

    tables = [path for path in options.file if path.suffix in TABLES or not path.exists()]
    if not tables:
        raise InputError("none of these files is a CSV or Parquet file")
    if len(folders := {path.parent for path in tables}) > 1:
        each = ", ".join(f"'{folder}'" for folder in sorted(folders))
        raise InputError(f"a side-car belongs to one folder, and these files are in several: {each}")
    target = tables[0].with_name(FOLDER_FILE)
    _refuse_there(options, target, stated_layout(tables[0]))
    proposals = {path: propose(path, craft) for path in tables}
    common, others = common_layout(proposals)
    shown: list[RenderableType] = []
    if left := [path.name for path in options.file if path not in proposals]:
        shown.append(printable(f"not tables: {', '.join(left)}"))
    runs = {
        path: read(path, common.model_copy(update={"columns": {**common.columns, **own}}), craft)
        for path, own in others.items()
        if proposals[path].run is not None
    }
    shown += _tabulated(proposals, runs, craft, options.anyway, advance)
    if unused := dict.fromkeys(name for found in proposals.values() for name in found.unused):
        shown.append(printable(f"not used: {', '.join(unused)}"))
    shown += map(printable, _blanks(proposals.values(), options))
    if common != Layout():
        shown += _stated(target, as_json(common), options.write)
    shown += _own_entries(others)
    return Done(0, shown)


def _own_entries(others: Mapping[Path, Mapping[str, "Column"]]) -> Iterator[str]:
    """Entries that the file of a folder cannot have, for the file beside each measurement."""
    from .runs import Layout, as_json, beside, stated_layout

    for path, own in others.items():
        there = (stated_layout(path) or Layout()).columns
        if more := {s: c for s, c in own.items() if c != there.get(s)}:
            text = json.dumps(as_json(Layout(columns=more)), ensure_ascii=False)
            yield printable(f"'{path}' also needs, in '{beside(path)}': {text}")


def _tabulated(
    paths: Iterable[Path], runs: Mapping[Path, "Run"], craft: "Ship", anyway: bool, advance: Advance
) -> list[RenderableType]:
    """A row for each measurement, one for each channel, and why some measurements cannot be used."""
    from .report.terminal import channel_table, plain_table
    from .runs import channels_of

    table, lines, channels = plain_table("file", "time", "every", *HEADS), [], []
    for path in paths:
        cells = ["-"] * (2 + len(HEADS))
        try:
            if path in runs:
                s = _smoothed(runs[path], craft, anyway, advance)
                cells = [f"{_seconds(s):.4g} s", f"{s.track.period:.3g} s", *map(str, s.counts)]
                channels.append((s.track.run.name, [*channels_of(s)]))
                lines += [f"{s.track.run.name}: {line}" for line in _found_in(s)]
        except InputError as error:
            lines.append(f"not usable yet: {error}")
        table.add_row(Text(printable(path.name)), *cells)
    return [table, *channel_table(channels), *map(printable, lines)]


def _refuse_there(options: argparse.Namespace, target: Path, there: "Layout | None") -> None:
    """Refuse to replace a file that states no column; columns that are stated stay, others are added."""
    states = there is not None and there.columns
    if options.write and not options.overwrite and target.exists() and not states:
        raise InputError(f"'{target}' exists; --overwrite replaces it and keeps its entries")


def _smoothed(found: "Run", craft: "Ship", anyway: bool, advance: Advance) -> "Smoothed":
    """The motion of a run, judged as all commands do."""
    from .assessment.gathering import gather
    from .predictors import Model

    (windows,) = gather([found], advance, anyway, Model(ship=craft))
    return windows.smoothed


def _seconds(s: "Smoothed") -> float:
    return float(s.track.run.time[-1] - s.track.run.time[0])


def _blanks(proposals: Iterable["Proposal"], options: argparse.Namespace) -> Iterator[str]:
    """For each blank name its likely columns, by the measurement that shows most; what to do then."""
    from .runs.columns.columns import TAU, stated_otherwise

    found: dict[str, Sequence[LikelyColumn]] = {}
    for each in proposals:
        for signal, likely in each.likely.items():
            before = found.setdefault(signal, likely)
            if sum(c.score for c in likely) > sum(c.score for c in before):
                found[signal] = likely
    for signal, likely in found.items():
        each = "; ".join(f"'{c.name}' ({', '.join(c.reasons)})" for c in likely)
        otherwise = "" if likely else stated_otherwise(signal, "; if {}, put {} in place of the blank")
        yield f"blank: {signal}; likely columns: {each or 'none'}{otherwise}"
    if options.ship is None and found.keys() >= set(TAU):
        yield (
            "if the log has commands of actuators, such as shaft speed and rudder angle, state the "
            "ship by --ship NAME|FILE.toml; its commands are then looked for"
        )
    if found:
        yield (
            "if other files of the run have them, or each row has one value with its name, make one "
            "table: python -m diagnosis.join FILE... --out RUN.csv"
        )
        yield "put the columns' names into the blanks of the side-car, and run this command again"


def _stated(target: Path, content: Mapping[str, Any], write: bool) -> list[RenderableType]:
    """The content of a file, which is written if it should be."""
    text = json.dumps(content, indent=2, ensure_ascii=False)
    if write:
        with together(target.parent, (target.name,)) as new:
            (new / target.name).write_text(f"{text}\n", encoding="utf-8")
    head = f"written into '{target}':" if write else f"--write writes this into '{target}':"
    return [printable(head), text]


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "diagnosis.propose_columns",
        "Inspect measurements, and propose their side-car. This is a JSON file next to the CSV file,\n"
        "which states how to read it: names of columns, units, separator, decimal mark, encoding.\n"
        "Entries of an existing side-car are kept. A signal without a column gets a blank name, and\n"
        "likely columns are listed. A run that cannot be used so is stated, with the reason.",
        "examples:  %(prog)s my.csv\n"
        "           %(prog)s my.csv --ship otter --write\n"
        "           %(prog)s folder/* --ship my_ship.toml --write\n"
        "exit codes: 0 done, 2 bad input (nothing is written), 130 interrupted (nothing is written)",
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        type=Path,
        nargs="+",
        help="CSV or Parquet file; several of one folder get one JSON file, and a table",
    )
    ship_option(parser)
    parser.add_argument(
        "--write", action="store_true", help="write FILE.json, or columns.json for several files"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file too")
    anyway_option(parser)
    return parser


if __name__ == "__main__":
    run_command(main)

"""Propose the parameters of an FMU to calibrate: ``python -m diagnosis.parameters vendor.fmu``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from cosim import InputError
from cosim.command import printable, run_command
from cybership.message_text import counted

from .commands.command_line import Done, execution_of, fmu_parser, run
from .execution.progress import Advance

if TYPE_CHECKING:
    from .fmu_parameters.parameter_file import CalibratedParameter
    from .fmu_parameters.sensitivity import Sensitivities


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    options.out = options.write.parent
    return run(parameters, options)


def parameters(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .fmu_parameters.parameter_file import write_parameters
    from .fmu_parameters.sensitivity import sensitivities
    from .fmu_parameters.system_task import is_system, system_task

    if options.write.exists() and not options.overwrite:
        raise InputError(
            f"'{options.write}' exists; --overwrite replaces it, --write names another file"
        )
    execution = execution_of(options)
    if options.runs and not is_system(options.runs, options.map):
        from .fmu_parameters.ship_task import ship_task

        task = ship_task(options, {"train": options.runs}, advance, execution)
    else:
        task = system_task(options.fmu, options.map, {"train": options.runs}, None, execution=execution)
    if not task.parameters:
        raise InputError("; ".join(task.notes))
    shown: list[RenderableType]
    try:
        if options.runs:
            found = sensitivities(task.residuals()["train"], advance)
            chosen = [s.parameter for s in found.each if s.known]
            shown = [*_told(found), *map(printable, task.confined.sentences())]
        else:
            chosen = task.parameters
            shown = [_of_all(chosen)]
    finally:
        task.close()
    shown += map(printable, task.notes)
    if not chosen:
        return Done(0, [*shown, "The runs identify no parameter; no file is written."])
    options.write.parent.mkdir(parents=True, exist_ok=True)
    write_parameters(options.write, chosen)
    return Done(
        0,
        [
            *shown,
            printable(f"'{options.write}' has {counted(len(chosen), 'parameter')}: check their priors"),
        ],
    )


def _of_all(every: Sequence["CalibratedParameter"]) -> Table:
    made = _table("parameter", "value", "unit", "range", "prior", "of")
    for p in every:
        made.add_row(
            *map(Text, (p.name, f"{p.value:.6g}", p.unit, _range(p), _prior(p), p.prior.origin))
        )
    return made


def _told(found: "Sensitivities") -> Iterator[RenderableType]:
    """What the runs tell of each parameter, best first."""
    made = _table("parameter", "value", "unit", "range", "prior", "std with the runs", "determined")
    for s in sorted(found.each, key=lambda s: s.std_share):
        p = s.parameter
        row = (p.name, f"{p.value:.6g}", p.unit, _range(p), _prior(p))
        share = f"{s.std_share:.2g} of the prior's" if s.change else "no influence"
        made.add_row(*map(Text, (*row, share, "yes" if s.known else "no")))
    yield made
    for group in found.together:
        yield printable(f"identifiable only together: {', '.join(group)}")
    for s in found.each:
        if s.fault:
            yield printable(s.fault)


def _table(*header: str) -> Table:
    made = Table(box=None, pad_edge=False, header_style="")
    for name in header:
        made.add_column(name, overflow="fold")
    return made


def _range(p: "CalibratedParameter") -> str:
    low, high = ("" if x is None else f"{x:.4g}" for x in (p.min, p.max))
    return f"{low} to {high}" if low or high else "-"


def _prior(p: "CalibratedParameter") -> str:
    return f"± {p.std:.3g}" + (" (log)" if p.log else "")


def _parser() -> argparse.ArgumentParser:
    made = fmu_parser(
        "parameters",
        "List the parameters of an FMU that can be calibrated, and write them to a file.",
        "examples:  %(prog)s vendor.fmu\n"
        "           %(prog)s vendor.fmu --map map.json --runs run1.csv run2.csv\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    made.add_argument(
        "--runs",
        type=Path,
        nargs="+",
        metavar="RUN",
        default=[],
        help="measured runs: only parameters that they identify are written (default: all)",
    )
    made.add_argument(
        "--write",
        type=Path,
        metavar="FILE.json",
        default=Path("parameters.json"),
        help="file that is written (default: parameters.json)",
    )
    made.add_argument("--overwrite", action="store_true", help="replace an existing file")
    return made


if __name__ == "__main__":
    run_command(main)

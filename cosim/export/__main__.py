"""Export a scenario to other tools: ``python -m cosim.export SCENARIO --ssp FILE.ssp``."""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from ..command import BAD_INPUT, command_parser, complain, printable, run_command
from ..errors import InputError
from ..scenario.load import with_settings
from ..scenario.scenario_options import add_scenario_options, chosen_scenario
from ..scenario.shipped import find_parameters
from ..system.preparation import prepare
from ..system.system import System
from .writing import export_fmu, export_osp, export_ssp


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        overrides = list(find_parameters(options.parameters))
        scenario = chosen_scenario(options)
        if scenario.native == "auto":  # FMUs in Python run on every computer, compiled ones on this one
            scenario = with_settings(scenario, [("native", False)], Path.cwd())
        system = prepare(scenario, overrides)
        try:
            with console.status("exporting"):
                notes = _export(system, options)
        finally:
            system.close()
    except InputError as error:
        complain(error)
        return BAD_INPUT
    for warning in system.warnings:
        complain(warning, "warning: ")
    for note in notes:
        complain(note, "note: ")
    print(printable(str(options.ssp or options.osp or options.fmu)))
    return 0


def _export(system: System, options: argparse.Namespace) -> list[str]:
    how = options.drop_faults, options.overwrite
    if options.ssp is not None:
        return export_ssp(system, options.ssp, *how)
    if options.osp is not None:
        return export_osp(system, options.osp, *how)
    return export_fmu(system, options.fmu, *how)


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "cosim.export",
        "Write a scenario for other tools: an SSP archive, an OSP directory, or one FMU of the "
        "whole system. Parameters become start values of the project's own FMUs.",
        "examples:  %(prog)s scenarios/setpoint.json --ssp setpoint.ssp\n"
        "           %(prog)s scenarios/hidden_drag.json --osp hidden_drag --drop-faults\n"
        "           %(prog)s scenarios/ellipse.json --fmu ellipse.fmu --drop-faults\n"
        "           %(prog)s waypoints --ship otter --ssp otter.ssp\n"
        "exit codes: 0 done, 2 bad input, or something that the format cannot hold",
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="JSON file")
    target = parser.add_mutually_exclusive_group(required=True)
    target.add_argument("--ssp", type=Path, metavar="FILE.ssp", help="for FMPy, Ecos, libcosim")
    target.add_argument(
        "--osp", type=Path, metavar="DIR", help="for libcosim, cosim-cli and the OSP demo app"
    )
    target.add_argument("--fmu", type=Path, metavar="FILE.fmu", help="for any tool that runs FMUs")
    add_scenario_options(parser, "--parameters", "--ship")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
    parser.add_argument(
        "--drop-faults",
        action="store_true",
        help="leave out parts that the format cannot hold: faults, isolation, events (OSP keeps events)",
    )
    return parser


if __name__ == "__main__":
    run_command(main)

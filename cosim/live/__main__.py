"""Write a page in which a scenario runs: ``python -m cosim.live SCENARIO --out PAGE.html``."""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from ..command import BAD_INPUT, command_parser, complain, printable, run_command
from ..errors import InputError, SimulationError
from ..interrupts import raise_if_interrupted
from ..scenario.scenario_options import add_scenario_options, chosen_scenario
from ..scenario.shipped import find_parameters
from ..system.preparation import prepare
from .page_file import check_replaceable, write_live_page


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        overrides = list(find_parameters(options.parameters))
        # The page starts from values of the FMUs in Python, which no compiler has to make.
        scenario = chosen_scenario(options, ("native", False))
        out = options.out or Path(f"{scenario.name}.html")
        inputs = (options.scenario, *options.parameters, options.ship or "")
        check_replaceable(out, inputs, options.overwrite)
        system = prepare(scenario, overrides)
        try:
            with console.status("writing the page"):
                write_live_page(system, out, overrides)
        finally:
            system.close()
    except (InputError, SimulationError) as error:
        raise_if_interrupted()  # an FMU may report the interrupt as an error of its own
        complain(error)
        return BAD_INPUT
    for warning in system.warnings:
        complain(warning, "warning: ")
    print(printable(str(out)))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "cosim.live",
        "Write one HTML file in which a scenario runs in real time or faster: open it in a browser. "
        "It needs neither a server nor a network.",
        "examples:  %(prog)s ellipse\n"
        "           %(prog)s waypoints --ship otter --out otter.html\n"
        "           %(prog)s ellipse --set controller=controller_bs.fmu --seed 3\n"
        "exit codes: 0 done, 2 bad input, or a scenario that a page cannot run",
    )
    parser.add_argument(
        "scenario",
        nargs="?",
        default="ellipse",
        metavar="SCENARIO",
        help="JSON file, or the name of a shipped one (default: ellipse)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="PAGE.html", help="file to write (default: <name>.html)"
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace an existing file that is not such a page"
    )
    add_scenario_options(parser, "--stop", "--seed", "--ship", "--set", "--parameters")
    return parser


if __name__ == "__main__":
    run_command(main)

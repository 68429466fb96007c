"""Options that the commands of the thesis' methods share."""

import argparse
from pathlib import Path

from cosim.command import command_parser
from diagnosis.commands import anyway_option, out_options


def analysis_parser(
    name: str, description: str, epilog: str, estimates: str, fewest: str = "+"
) -> argparse.ArgumentParser:
    """A parser with what the analyses of the thesis share: runs, ``--estimates``, ``--out``.

    Args:
        name: of the command, and of its result folder.
        description: what it does.
        epilog: examples and exit codes.
        estimates: where velocities come from by default.
        fewest: ``+``: one run at the least; ``*``: none.
    """
    made = command_parser(f"thesis.{name}", description, epilog)
    made.add_argument(
        "runs", type=Path, nargs=fewest, metavar="RUN", help="measured run, or folder of a log"
    )
    made.add_argument(
        "--estimates",
        choices=("smoothed", "mdf"),
        default=estimates,
        help="velocity and acceleration by the smoother, which leaves spikes out, or by the thesis' "
        f"derivative filter (default: {estimates})",
    )
    anyway_option(made)
    out_options(made, Path("results", name))
    return made


def ssv_option(made: argparse.ArgumentParser) -> None:
    """Add ``--ssv``."""
    made.add_argument(
        "--ssv",
        action="store_true",
        help="write model.ssv even if its part of the force fails the check before simulation",
    )


def open_loop_parser(name: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """A parser with what the commands share that play a run to FMUs: run, ``--observer``, ``--out``."""
    made = command_parser(f"thesis.{name}", description, epilog)
    made.add_argument("run", type=Path, metavar="RUN", help="measured run, or folder of a log")
    made.add_argument(
        "--observer",
        metavar="NAME",
        help="an observer of this project (default: the scenario's, or mdf)",
    )
    made.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        help="observer, guidance and controller's parameters, in place of the run's own scenario",
    )
    anyway_option(made)
    out_options(made, Path("results", name))
    return made

"""Draw the pictures of finished runs: ``python -m cosim.plots DIR... --out DIR``."""

if __name__ == "__main__":
    from cosim.interrupts import leave_on_interrupt

    leave_on_interrupt()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from .command import BAD_INPUT, complain, printable, run_command
from .errors import InputError
from .results.drawing import draw
from .results.log import read_log
from .results.run_options import read_options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 2 bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m cosim.plots",
        description="Draw the pictures of finished runs, laid over each other.",
        epilog="example: python -m cosim.plots results/ellipse results/ellipse_bs --out results/both",
    )
    parser.add_argument("folders", metavar="DIR", nargs="+", type=Path, help="results of a run")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(), help="where the PNGs go (.)")
    options = parser.parse_args(arguments)
    try:
        runs = {folder.resolve().name: read_log(folder) for folder in options.folders}
        roles = {folder.resolve().name: read_options(folder).roles for folder in options.folders}
        drawn = draw(runs, options.out, roles=roles)
    except InputError as error:
        complain(error)
        return BAD_INPUT
    except OSError as error:
        complain(f"cannot write to '{options.out}': {error.strerror}")
        return BAD_INPUT
    for path in drawn:
        print(printable(str(path)))
    return 0


if __name__ == "__main__":
    run_command(main)

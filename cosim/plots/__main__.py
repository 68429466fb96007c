"""Draw the pictures of finished runs: ``python -m cosim.plots DIR... --out DIR``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ..command import BAD_INPUT, run_command
from ..errors import InputError
from ..log import read_log
from . import draw


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
        drawn = draw(runs, options.out)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"error: cannot write to '{options.out}': {error.strerror}", file=sys.stderr)
        return BAD_INPUT
    for path in drawn:
        print(path)
    return 0


if __name__ == "__main__":
    run_command(main)

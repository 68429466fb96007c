"""Draw the pictures of finished runs: ``python -m cosim.plots DIR... --out DIR``."""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from .command import BAD_INPUT, command_parser, complain, printable, run_command
from .errors import InputError, not_written
from .results.drawing import draw
from .results.log import read_log
from .results.picture_files import FORMATS, PictureOptions
from .results.run_options import read_options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 2 bad input."""
    parser = command_parser(
        "cosim.plots",
        "Draw the pictures of finished runs, all runs in the same axes.",
        "examples:  %(prog)s results/ellipse results/ellipse_bs --out results/both\n"
        "           %(prog)s results/ellipse --format pdf --width 3.5 --out figures\n"
        "           %(prog)s results/ellipse --format svg --style ggplot --out figures",
    )
    parser.add_argument("folders", metavar="DIR", nargs="+", type=Path, help="results of a run")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, default=Path(), help="folder of the pictures (default: .)"
    )
    usual = PictureOptions()
    parser.add_argument("--format", choices=FORMATS, default=usual.format, help="(default: png)")
    parser.add_argument(
        "--width",
        type=_positive,
        metavar="INCHES",
        default=usual.width,
        help=f"(default: {usual.width:g})",
    )
    parser.add_argument(
        "--dpi",
        type=_positive,
        metavar="N",
        default=usual.dpi,
        help=f"pixels per inch (default: {usual.dpi:g})",
    )
    parser.add_argument("--style", metavar="NAME", help="style of matplotlib, or a style file")
    options = parser.parse_args(arguments)
    look = PictureOptions(options.format, options.dpi, options.width, options.style)
    try:
        runs = {folder.resolve().name: read_log(folder) for folder in options.folders}
        stated = {folder.resolve().name: read_options(folder) for folder in options.folders}
        drawn = draw(runs, options.out, stated, look)
        if not drawn:
            raise InputError("nothing to draw: no log has the signals of a picture, such as a pose")
    except InputError as error:
        complain(error)
        return BAD_INPUT
    except OSError as error:
        complain(not_written(options.out, error))
        return BAD_INPUT
    for path in drawn:
        print(printable(str(path)))
    return 0


def _positive(text: str) -> float:
    """A size; above a thousand nothing could draw it."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1000.0:
        raise argparse.ArgumentTypeError(f"needs a number above 0, at most 1000, not '{text}'")
    return value


if __name__ == "__main__":
    run_command(main)

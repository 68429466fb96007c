"""What the commands of the diagnosis share: options, a user's effects, progress, mistakes."""

import argparse
import io
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console, RenderableType

from cosim import InputError
from cosim.command import BAD_INPUT, Output, complain
from cosim.interrupts import Held
from fmus.declare import DeclarationError
from fmus.effects import STANDARD
from fmus.ship import Ship, ship

from .progress import Advance, progress


class Done(NamedTuple):
    """How a command ended: its exit code, and what it shows."""

    code: int
    shown: Iterable[RenderableType]


def parser(name: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """A parser with the options that both commands have."""
    made = argparse.ArgumentParser(
        prog=f"python -m diagnosis.{name}",
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument(
        "--model", type=Path, metavar="FILE.ssv", help="model to begin with (the nominal one)"
    )
    made.add_argument(
        "--effects",
        type=Path,
        metavar="FILE.py",
        action="append",
        default=[],
        help="a file of model effects of your own; may be repeated",
    )
    made.add_argument(
        "--anyway",
        action="store_true",
        help="go on though a run's units, signs or columns seem to be other ones than said",
    )
    return made


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
    made = argparse.ArgumentParser(
        prog=f"python -m diagnosis.{name}",
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument(
        "runs", type=Path, nargs=fewest, metavar="RUN", help="measured run, or folder of a log"
    )
    made.add_argument(
        "--estimates",
        choices=("smoothed", "mdf"),
        default=estimates,
        help="velocity and acceleration by the smoother, which leaves spikes out, or by the thesis' "
        f"derivative filter ({estimates})",
    )
    out = Path("results", name)
    made.add_argument("--out", type=folder, metavar="DIR", default=out, help=f"result folder ({out})")
    return made


def open_loop_parser(name: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """A parser with what the commands share that play a run to FMUs: run, ``--observer``, ``--out``."""
    made = argparse.ArgumentParser(
        prog=f"python -m diagnosis.{name}",
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("run", type=Path, metavar="RUN", help="measured run, or folder of a log")
    made.add_argument(
        "--observer", metavar="NAME", help="an observer of this project (the scenario's, or mdf)"
    )
    made.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        help="observer, guidance and controller's parameters, in place of the run's own scenario",
    )
    out = Path("results", name)
    made.add_argument("--out", type=folder, metavar="DIR", default=out, help=f"result folder ({out})")
    return made


def folder(text: str) -> Path:
    """The argument of ``--out``."""
    if not text.strip():
        raise argparse.ArgumentTypeError("needs the name of a folder")
    return Path(text)


def ship_with(files: Sequence[Path]) -> Ship:
    """The ship with the effects of a user's files.

    Raises:
        InputError: a file has none, or fails.
    """
    effects = STANDARD
    try:
        for file in files:
            effects = effects.plus_file(file)
        return ship(effects)
    except DeclarationError as error:
        raise InputError(" ".join(str(error).split())) from None


def run(work: Callable[[Advance], Done]) -> int:
    """Do the work of a command, and show what it found.

    Args:
        work: is given a callback for progress.

    Returns:
        The exit code.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without Greek
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    with Held() as interrupts:
        interrupts.allow()
        try:
            with progress(errors) as advance:
                done = work(advance)
        except InputError as error:
            complain(error)
            return BAD_INPUT
        interrupts.hold()  # the files are there: what was found is shown
        output = Output(highlight=False, markup=False)
        for part in done.shown:
            output.print(part)
        interrupts.finish()
    return done.code

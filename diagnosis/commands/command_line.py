"""What the commands of the diagnosis share: options, a user's effects, progress, mistakes."""

import argparse
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console, RenderableType

from cosim import InputError
from cosim.command import BAD_INPUT, Output, command_parser, complain, folder_name, positive
from cosim.interrupts import Held, raise_if_interrupted
from cybership.scratch_folder import sweep
from fmus.ships.naming import DEFAULT
from fmus.ships.ship_warning import ship_warnings_to

from ..execution.progress import Advance, progress
from ..execution.result_folder import clean, default_folder, keep_inputs, sha256
from ..search import Prior

if TYPE_CHECKING:
    from ..predictors import Execution

# Options that name files which decide a result.
INPUTS = (
    "train",
    "validate",
    "test",
    "runs",
    "run",
    "model",
    "map",
    "parameters",
    "effects",
    "criteria",
    "diagnosis",
)
RUNS = ("train", "validate", "test", "runs", "run")  # of these, those that are measured runs


def prior(text: str) -> Prior:
    """What ``--prior`` says: one number, or names with numbers."""
    try:
        if "=" not in text:
            return _share(text)
        pairs = [part.split("=") for part in text.split(",")]
        return {name.strip(): _share(share) for name, share in pairs}
    except ValueError:
        form = "a number of zero or more, or names with numbers as in mass=0.01,thrust=0.5"
        raise argparse.ArgumentTypeError(f"needs {form}, not '{text}'") from None


def moment(text: str) -> tuple[str, float]:
    """What ``--split`` says: the name of a run, and a time [s]."""
    name, _, time = text.rpartition("@")
    try:
        seconds = float(time)
    except ValueError:
        seconds = nan
    if not (name and isfinite(seconds)):
        raise argparse.ArgumentTypeError(
            f"needs the name of a run and seconds, as run1@131, not '{text}'"
        )
    return name, seconds


def _share(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < float("inf"):
        raise ValueError
    return value


class Done(NamedTuple):
    """How a command ended, or one of its answers: its exit code, and what it shows.

    ``more`` says whether another answer follows, which may take longer.
    """

    code: int
    shown: Iterable[RenderableType]
    more: bool = False


Work = Callable[[argparse.Namespace, Advance], Done | Iterator[Done]]


def parser(name: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """A parser with the options that both commands have."""
    made = command_parser(f"diagnosis.{name}", description, epilog)
    made.add_argument(
        "--model",
        type=Path,
        metavar="FILE",
        help="initial model: a parameter set .ssv, an .fmu, a system, .ssp or scenario .json, or a "
        "Python function .py (default: the nominal model)",
    )
    made.add_argument(
        "--effects",
        type=Path,
        metavar="FILE.py|NAME",
        action="append",
        default=[],
        help="a file of your own model effects, or one of an installed package; may be repeated",
    )
    ship_option(made)
    anyway_option(made)
    made.add_argument(
        "--horizon",
        type=float,
        metavar="SECONDS",
        help="length of the prediction windows [s] (default: 8 s, times the time scale of the ship)",
    )
    return made


def fmu_parser(name: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """A parser of a command about an FMU, and about measured runs of what it is a model of."""
    made = command_parser(f"diagnosis.{name}", description, epilog)
    made.add_argument("fmu", type=Path, metavar="FILE.fmu", help="an FMI 2.0 FMU for co-simulation")
    made.add_argument(
        "--map",
        type=Path,
        metavar="FILE.json",
        help="map of the FMU's variables to the columns, and its start values (default: guessed from "
        "names)",
    )
    ship_option(made)
    confinement_options(made)
    anyway_option(made)
    made.set_defaults(effects=[], horizon=None)
    return made


def fmu_options(made: argparse.ArgumentParser) -> None:
    """Add ``--map`` and how an FMU given by ``--model`` is run."""
    made.add_argument(
        "--map",
        type=Path,
        metavar="FILE.json",
        help="map of the FMU's variables to the signals (default: guessed from names and units)",
    )
    made.add_argument(
        "--step",
        type=positive,
        metavar="SECONDS",
        help="step of the FMU [s] (default: its stepSize if it accepts no other, else the step that "
        "predictions need)",
    )
    confinement_options(made)


def confinement_options(made: argparse.ArgumentParser) -> None:
    """Add ``--timeout`` and ``--unconfined``."""
    made.add_argument(
        "--timeout",
        type=positive,
        metavar="SECONDS",
        help="longest time of one prediction by the FMU [s] (default: 120, or 0.1 for each step)",
    )
    made.add_argument(
        "--unconfined",
        action="store_true",
        help="give the FMU access to files, network and other processes; the result states it (for an "
        "FMU that is the client of a tool)",
    )


def execution_of(options: argparse.Namespace) -> "Execution":
    """How the options have an FMU run."""
    from ..predictors import Execution  # only now: it takes a while to import

    return Execution(options.timeout, getattr(options, "step", None), not options.unconfined)


@contextmanager
def proposing() -> Iterator[None]:
    """Where the variables of an FMU are not known inside, propose a map in the working directory.

    Raises:
        InputError: they are not.
    """
    from ..predictors import MAP, UnmatchedError  # only now: it takes a while to import

    try:
        yield
    except UnmatchedError as error:
        hint = f"'{MAP}' has the known entries: complete it, and give it by --map {MAP}"
        if Path(MAP).exists():
            hint = f"complete '{MAP}' for --map, or remove it to get a new proposal"
        else:
            from ..predictors import write_map  # only FMUs have maps

            try:
                write_map(Path(MAP), error.proposal)
            except OSError:
                hint = "--map FILE states them"
        raise InputError(f"{error}; {hint}") from None


def ship_option(made: argparse.ArgumentParser) -> None:
    """Add ``--ship``."""
    made.add_argument(
        "--ship",
        metavar="NAME|FILE.toml",
        help="the measured ship: a shipped one, or a file of your own (default: that of the logs, else "
        "cse1)",
    )


def anyway_option(made: argparse.ArgumentParser) -> None:
    """Add ``--anyway``, which means the same in all commands."""
    made.add_argument(
        "--anyway",
        action="store_true",
        help="use a run although its units, signs or columns seem wrong, or although its channels have "
        "faults that redundant channels cannot repair",
    )


def out_options(made: argparse.ArgumentParser, usual: Path) -> None:
    """Add ``--out`` and ``--overwrite``; without them the folder is ``usual``, or the next one free."""
    made.add_argument(
        "--out",
        type=folder_name,
        metavar="DIR",
        help=f"result folder (default: {usual}; if it holds the result of other inputs, {usual}_2, ...)",
    )
    made.add_argument(
        "--overwrite", action="store_true", help=f"use {usual}, and replace any result in it"
    )
    made.set_defaults(usual=usual)


def _paths(options: argparse.Namespace, names: Sequence[str]) -> list[Path]:
    """The files that some arguments name."""
    given = [getattr(options, name, None) or [] for name in names]
    return [path for each in given for path in (each if isinstance(each, list) else [each])]


def inputs_of(options: argparse.Namespace) -> dict[str, str]:
    """The files that a command reads, as they were named -> SHA-256."""
    return {str(path): sha256(Path(path)) for path in _paths(options, INPUTS)}


def import_later_parts() -> None:
    """Import what is needed once runs are smoothed; it takes a second."""
    for name in ("diagnosis.session", "diagnosis.report.page"):
        import_module(name)


def command_of(name: str) -> str:
    """The command line as it could be given again."""
    return shlex.join(["python", "-m", f"diagnosis.{name}", *sys.argv[1:]])


def _take_ship_of_logs(options: argparse.Namespace) -> None:
    """Take the ship that the logs among the runs are of, unless ``--ship`` names one."""
    if getattr(options, "ship", None) is not None:
        return
    from ..runs import ship_of_logs  # only now: it takes a second to import

    stated = ship_of_logs(_paths(options, RUNS))
    if stated is None:
        return
    ship, path = stated
    if "ship" not in options:
        raise InputError(f"'{path}' is of {ship}; this analysis supports {DEFAULT} only")
    complain(f"the ship is {ship}, as '{path}' states; --ship names another one", "note: ")
    options.ship = ship


def _warn_of_other_ships(options: argparse.Namespace) -> None:
    """Warn of logs among the runs that are of another ship than ``--ship`` names."""
    from ..runs import ships_of_logs

    if not (logs := ships_of_logs(_paths(options, RUNS))):
        return
    from ..predictors import ship_with

    given = ship_with((), options.ship).name
    for path, name in logs.items():
        if name != given:
            text = f"'{path}' is a log of {name}; it is read as one of {given}, as --ship states"
            complain(text, "warning: ")


def run(work: Work, options: argparse.Namespace) -> int:
    """Do the work of a command, and show what it found: each answer as soon as its files are there.

    Args:
        work: is given the options and a callback for progress; gives one answer, or one after the other.
        options: of the command line; ``out`` is filled in.

    Returns:
        The exit code.
    """
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    sweep()
    code = 0
    with Held() as interrupts:
        interrupts.allow()
        try:
            if options.out is not None:
                clean(options.out)
            is_stated = getattr(options, "ship", None) is not None
            _take_ship_of_logs(options)
            inputs = None
            if options.out is None:
                inputs = inputs_of(options)
                options.out = default_folder(options.usual, inputs, options.overwrite)
            with progress(errors) as line, ship_warnings_to(partial(complain, kind="warning: ")):
                if is_stated:
                    _warn_of_other_ships(options)
                given = work(options, line)
                for done in [given] if isinstance(given, Done) else given:
                    interrupts.hold()  # the files are there: what was found is shown
                    code = done.code
                    if inputs is not None:
                        keep_inputs(options.out, inputs)
                    with line.paused():
                        _show(done.shown)
                        if inputs is not None and not done.more and options.out != options.usual:
                            note = "another result is in '{}'; this one is in '{}'"
                            complain(note.format(options.usual, options.out), "note: ")
                    if done.more:
                        interrupts.allow()
        except InputError as error:
            raise_if_interrupted()  # an FMU may report the interrupt as an error of its own
            complain(error)
            return BAD_INPUT
        interrupts.finish()
    return code


def _show(parts: Iterable[RenderableType]) -> None:
    """Print an answer, at once though it goes into a pipe."""
    output = Output(highlight=False, markup=False)
    for part in parts:
        output.print(part)
    sys.stdout.flush()

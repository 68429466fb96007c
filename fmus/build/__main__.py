"""Build the FMUs: ``python -m fmus.build [NAME|FILE.py ...] [--out DIR]``, see ``--help``."""

if __name__ == "__main__":
    from fmus.interruption import leave_on_interrupt

    leave_on_interrupt()  # before all other imports, which take a while

import zipfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from cybership.command_arguments import command_parser, complain, folder_name
from cybership.scratch_folder import sweep

from ..declare import DeclarationError, variables
from ..effects import STANDARD
from ..installed import plus_files
from ..interruption import run_interruptible
from ..ship import Ship
from ..ship import ship as make_ship
from ..ships.naming import described_ship
from ..ships.ship_warning import ship_warnings_to
from . import ledger
from .building import build, came_compiled, export, fmu_cache
from .finding import BuildError, load, which
from .platforms import native_targets
from .start_values_file import read_starts


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; prints the path of each FMU, one a line, in the order asked for."""
    parser = command_parser(
        "fmus.build",
        "Build the FMUs of the project, or an FMU from a component file of your own.",
        "examples:  %(prog)s\n"
        "           %(prog)s vessel controller_abs --out fmu\n"
        "           %(prog)s my_controller.py --out fmu\n"
        "           %(prog)s --list vessel\n"
        "           %(prog)s vessel --effects my_effects.py --out fmu\n"
        "           %(prog)s --ship otter --out fmu\n"
        "           %(prog)s --parameters model.ssv --out fmu\n"
        "           %(prog)s --native --parameters model.ssv --out fmu\n"
        "           %(prog)s --native vessel --target linux64,win64,darwin64 --out fmu\n"
        "           %(prog)s --native vessel thrusters --source firmware\n"
        "           %(prog)s --verify fmu/vessel.fmu",
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="FMU name or component file (default: all)"
    )
    parser.add_argument(
        "--out",
        type=folder_name,
        metavar="DIR",
        help="copy the FMUs to this folder (default: cache of the user)",
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="with --out, --source or --webassembly: replace existing files of these names",
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="list the FMUs (with --native: the precompiled ones), or the variables of the named FMUs",
    )
    parser.add_argument(
        "--verify",
        action="store_true",
        help="build nothing; check whether all programs in these .fmu files were built on this computer",
    )
    parser.add_argument(
        "--effects",
        type=Path,
        metavar="FILE.py|NAME",
        action="append",
        default=[],
        help="a file of your own model effects, or one of an installed package, for vessel and "
        "thrusters; may be repeated",
    )
    parser.add_argument(
        "--ship",
        metavar="NAME|FILE.toml",
        help="ship of the FMUs: a shipped one, or a file of your own (default: cse1)",
    )
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE.ssv",
        help="SSP parameter set whose values become start values (without NAME: of the FMUs in the set)",
    )
    parser.add_argument(
        "--native",
        action="store_true",
        help="compile the FMUs, which need no Python then",
    )
    parser.add_argument(
        "--target",
        metavar="PLATFORM,...",
        help="with --native: linux64, win64, darwin64 (this computer); python: run all others in Python",
    )
    parser.add_argument(
        "--source",
        type=folder_name,
        metavar="DIR",
        help="with --native: write plain C to this folder, build no FMU",
    )
    parser.add_argument(
        "--webassembly",
        type=folder_name,
        metavar="DIR",
        help="write WebAssembly for pages to this folder, build no FMU",
    )
    options = parser.parse_args(arguments)
    if not options.native and (options.target is not None or options.source is not None):
        parser.error("--target and --source need --native")
    sweep()
    note = partial(complain, kind="note: ")
    try:
        effects = plus_files(STANDARD, options.effects)
        with ship_warnings_to(note):
            ship = described_ship(options.ship)
        if options.verify:
            _verify(options.names)
            lines = []
        elif options.list:
            lines = [*_listed(options.names, make_ship(effects, ship), options.native)]
        else:
            starts = None if options.parameters is None else read_starts(options.parameters)
            if (folder := options.source or options.webassembly) is not None:
                made = export(
                    options.names,
                    folder,
                    starts,
                    note,
                    effects,
                    options.overwrite,
                    ship,
                    webassembly=options.source is None,
                )
            else:
                native = native_targets(options.target) if options.native else None
                made = build(
                    options.names, options.out, starts, note, effects, native, options.overwrite, ship
                )
            lines = list(map(str, made))
    except (BuildError, DeclarationError) as error:
        complain(error)
        return 2
    except OSError as error:
        complain(f"'{error.filename}': {error.strerror}" if error.filename else error)
        return 2
    for line in lines:
        print(line)
    return 0


def _verify(names: Sequence[str]) -> None:
    """Refuse FMUs with a program file that no build on this computer has made.

    Raises:
        BuildError: names the first such file; or a file cannot be read.
    """
    if not names:
        raise BuildError("--verify needs the name of an FMU file")
    for name in names:
        try:
            wrong = ledger.unknown_binary(Path(name), fmu_cache())
        except (OSError, zipfile.BadZipFile, RuntimeError, ValueError) as error:
            raise BuildError(f"'{name}' cannot be read: {error}") from error
        if wrong:
            raise BuildError(f"'{name}' was not built here: it holds '{wrong}'")


def _listed(names: Sequence[str], of: Ship, native: bool) -> Iterator[str]:
    """The FMUs there are, or every variable of those that are named.

    Raises:
        BuildError: none of the FMUs came compiled.
    """
    if native and not names and not any(came_compiled(c.name) for _, c in of.components.values()):
        raise BuildError(
            "no FMU is precompiled in this installation; build --native compiles them, --list without "
            "--native lists them"
        )
    for _, component in of.components.values() if not names else ():
        if not native or came_compiled(component.name):
            yield f"{component.name:24} {component.description}"
    for name in names:
        _, component = load(*which(name), of)
        yield f"{component.name}: {component.description}"
        kinds = [
            ("parameter", component.params),
            ("input", component.inputs),
            ("output", component.outputs),
        ]
        for kind, group in kinds:
            for v in variables(group):
                start = f"{v.start:g}" if kind != "output" else ""
                limits = f", {v.range.words}" if v.range.words else ""
                yield f"  {kind:10}{v.name:18}{start:>9} {v.unit:14}{v.description}{limits}"


if __name__ == "__main__":
    run_interruptible(main)

"""Take a scenario to other tools: ``python -m cosim.export SCENARIO --ssp FILE.ssp``."""

import argparse
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from .command import BAD_INPUT, run_command
from .errors import InputError
from .exchange import portable
from .exchange.container import write_container
from .exchange.osp import STRUCTURE, write_osp
from .exchange.portable import Format, Part
from .exchange.ssp import write_ssp
from .scenario import load_scenario
from .ssv import read_parameters
from .system import System, prepare

Write = Callable[[System, Sequence[Part], Path, Path], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        overrides = [(path, read_parameters(path)) for path in options.parameters]
        system = prepare(load_scenario(options.scenario), overrides)
        try:
            with console.status("exporting"):
                notes = _export(system, options)
        finally:
            system.close()
    except InputError as error:
        console.print(f"error: {error}", markup=False)
        return BAD_INPUT
    for warning in system.warnings:
        console.print(f"warning: {warning}", markup=False)
    for note in notes:
        console.print(f"note: {note}", markup=False)
    print(options.ssp or options.osp or options.fmu)
    return 0


def _export(system: System, options: argparse.Namespace) -> list[str]:
    drop = options.drop_faults
    if options.ssp is not None:
        return export_ssp(system, options.ssp, drop)
    if options.osp is not None:
        return export_osp(system, options.osp, drop)
    return export_fmu(system, options.fmu, drop)


def export_ssp(system: System, archive: Path, drop: bool = False) -> list[str]:
    """Write a system as an SSP 1.0 archive.

    Args:
        system: from :func:`cosim.system.prepare`.
        archive: the ``.ssp`` file to write.
        drop: leave out what cannot travel.

    Returns:
        Notes on what stays behind or is different there.

    Raises:
        InputError: something cannot travel, or the file cannot be written.
    """
    return _file(system, portable.SSP, archive, ".ssp", drop, write_ssp)


def export_fmu(system: System, fmu: Path, drop: bool = False) -> list[str]:
    """Write a system as one container FMU; as :func:`export_ssp`."""
    return _file(system, portable.CONTAINER, fmu, ".fmu", drop, write_container)


def export_osp(system: System, folder: Path, drop: bool = False) -> list[str]:
    """Write a system as an OSP directory, in place of an earlier one; as :func:`export_ssp`.

    A file that the new directory would not hold is somebody's, and is never deleted: InputError.
    """
    notes = portable.check(system, portable.OSP, drop)
    with _beside(folder) as (work, target):
        if target.exists() and not _is_replaceable(target):
            raise InputError(f"'{folder}' is there already, and is no OSP directory to replace")
        if Path.cwd().is_relative_to(target):
            raise InputError(f"'{folder}' is the working directory, which cannot be replaced")
        new = work / "new"
        new.mkdir()
        parts, more = portable.pack(system, new)
        more += write_osp(system, parts, new)
        if foreign := sorted(_inside(target) - _inside(new)):
            raise InputError(
                f"'{folder}' also holds {', '.join(foreign[:3])}{', ...' if foreign[3:] else ''}, which "
                "this export does not write; take it out, or choose another folder"
            )
        _replace(target, new, work / "old")
    return notes + more


def _is_replaceable(folder: Path) -> bool:
    return folder.is_dir() and (not any(folder.iterdir()) or (folder / STRUCTURE).is_file())


def _inside(folder: Path) -> set[str]:
    """All files and folders in a folder, at any depth."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def _replace(folder: Path, new: Path, old: Path) -> None:
    """Put a folder in the place of another, which comes back if that fails."""
    if not folder.exists():
        os.replace(new, folder)
        return
    os.replace(folder, old)
    try:
        os.replace(new, folder)
    except BaseException:
        os.replace(old, folder)
        raise


def _file(
    system: System, target: Format, path: Path, suffix: str, drop: bool, write: Write
) -> list[str]:
    if path.suffix != suffix:
        raise InputError(f"'{path}' should end in {suffix}")
    notes = portable.check(system, target, drop)
    with _beside(path) as (work, whole):
        if whole.is_dir():
            raise InputError(f"'{path}' is a folder")
        parts, more = portable.pack(system, work)
        (work / "out").mkdir()
        new = work / "out" / path.name
        write(system, parts, work, new)
        os.replace(new, whole)
    return notes + more


@contextmanager
def _beside(path: Path) -> Iterator[tuple[Path, Path]]:
    """A scratch folder on the same file system, gone afterwards, and the path without links and dots.

    Raises:
        InputError: the system refuses to read or write something there.
    """
    try:
        whole = Path(os.path.realpath(path))
        whole.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=".export_", dir=whole.parent))
        try:
            yield work, whole
        finally:
            shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        name = Path(error.filename or path).name
        raise InputError(
            f"'{path}' cannot be written: {error.strerror or error}"
            + (f": '{name}'" if name != path.name else "")
        ) from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m cosim.export",
        description="Write a scenario as other tools read it: an SSP archive, an OSP directory, or one "
        "FMU of the whole system. Parameters are baked into the project's own FMUs.",
        epilog="examples:  python -m cosim.export scenarios/setpoint.json --ssp setpoint.ssp\n"
        "           python -m cosim.export scenarios/hidden_drag.json --osp hidden_drag --drop-faults\n"
        "           python -m cosim.export scenarios/ellipse.json --fmu ellipse.fmu --drop-faults\n"
        "exit codes: 0 done, 2 bad input, or something that the format cannot hold",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="JSON file")
    target = parser.add_mutually_exclusive_group(required=True)
    target.add_argument("--ssp", type=Path, metavar="FILE.ssp", help="for FMPy, Ecos, libcosim")
    target.add_argument(
        "--osp", type=Path, metavar="DIR", help="for libcosim, cosim-cli and the OSP demo app"
    )
    target.add_argument("--fmu", type=Path, metavar="FILE.fmu", help="for whatever runs FMUs")
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE.ssv",
        action="append",
        default=[],
        help="SSP parameter set that beats the scenario's values; may be given several times",
    )
    parser.add_argument(
        "--drop-faults",
        action="store_true",
        help="leave out what cannot travel: faults, isolation, and events but in an OSP directory",
    )
    return parser


if __name__ == "__main__":
    run_command(main)

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
    """Write a system as an OSP directory, in place of an earlier one; as :func:`export_ssp`."""
    notes = portable.check(system, portable.OSP, drop)
    free = not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))
    if not free and not (folder / STRUCTURE).is_file():
        raise InputError(f"'{folder}' is there already, and is no OSP directory to replace")
    with _beside(folder) as work:
        new = work / "new"
        new.mkdir()
        parts, more = portable.pack(system, new)
        write_osp(system, parts, new)
        if folder.exists():
            os.replace(folder, work / "old")
        os.replace(new, folder)
    return notes + more


def _file(
    system: System, target: Format, path: Path, suffix: str, drop: bool, write: Write
) -> list[str]:
    if path.suffix != suffix:
        raise InputError(f"'{path}' should end in {suffix}")
    if path.is_dir():
        raise InputError(f"'{path}' is a folder")
    notes = portable.check(system, target, drop)
    with _beside(path) as work:
        parts, more = portable.pack(system, work)
        (work / "out").mkdir()
        new = work / "out" / path.name
        write(system, parts, work, new)
        os.replace(new, path)
    return notes + more


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """A scratch folder on the same file system, gone afterwards."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=".export_", dir=path.parent))
    except OSError as error:
        raise InputError(f"cannot write to '{path.parent}': {error.strerror}") from None
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)


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

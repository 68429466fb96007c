"""Systems as files of other tools: SSP archive, OSP directory, container FMU."""

import os
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from cybership.scratch_folder import Scratch, sweep

from ..errors import InputError
from ..formats.namespaces import OSP_STRUCTURE
from ..system.system import System
from . import portable
from .container import write_container
from .osp import write_osp
from .portable import ExportedInstance, Format
from .ssp import write_ssp

EXPORT = ".export_"  # begins the names of scratch folders
Write = Callable[[System, Sequence[ExportedInstance], Path, Path], None]


def export_ssp(system: System, archive: Path, drop: bool = False, overwrite: bool = False) -> list[str]:
    """Write a system as an SSP 1.0 archive.

    Args:
        system: from :func:`cosim.system.prepare`.
        archive: the ``.ssp`` file to write.
        drop: leave out what the format cannot hold.
        overwrite: whether a file that is there may be replaced.

    Returns:
        Notes on what is left out or different there.

    Raises:
        InputError: the format cannot hold something, or the file cannot be written.
    """
    return _file(system, portable.SSP, archive, ".ssp", drop, write_ssp, overwrite)


def export_fmu(
    system: System,
    fmu: Path,
    drop: bool = False,
    overwrite: bool = False,
    expose: Collection[str] = (),
) -> list[str]:
    """Write a system as one container FMU; as :func:`export_ssp`.

    Args:
        system, fmu, drop, overwrite: as there.
        expose: parameters, ``instance.variable``, that the container has as well.
    """
    write = partial(write_container, expose=expose)
    return _file(system, portable.CONTAINER, fmu, ".fmu", drop, write, overwrite)


def export_osp(system: System, folder: Path, drop: bool = False, overwrite: bool = False) -> list[str]:
    """Write a system as an OSP directory; as :func:`export_ssp`.

    Other files in an earlier directory are never deleted: they raise InputError.
    """
    notes = portable.check(system, portable.OSP, drop)
    with _beside(folder) as (work, target):
        if target.exists() and not _is_replaceable(target):
            raise InputError(f"'{folder}' exists, and is not an OSP directory that can be replaced")
        if Path.cwd().is_relative_to(target):
            raise InputError(f"'{folder}' is the working directory, which cannot be replaced")
        new = work / "new"
        new.mkdir()
        parts, more = portable.pack(system, new)
        more += write_osp(system, parts, new)
        if foreign := sorted(_inside(target) - _inside(new)):
            raise InputError(
                f"'{folder}' also holds {', '.join(foreign[:3])}{', ...' if foreign[3:] else ''}, "
                "which this export does not write; remove this, or choose another folder"
            )
        if _inside(target) and not overwrite:
            raise InputError(f"'{folder}' exists; --overwrite replaces it")
        _replace(target, new, work / "old")
    return notes + more


def _is_replaceable(folder: Path) -> bool:
    return folder.is_dir() and (not any(folder.iterdir()) or (folder / OSP_STRUCTURE).is_file())


def _inside(folder: Path) -> set[str]:
    """All files and folders in a folder, at any depth."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def _replace(folder: Path, new: Path, old: Path) -> None:
    """Replace a folder by another; the old one is restored if that fails."""
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
    system: System, target: Format, path: Path, suffix: str, drop: bool, write: Write, overwrite: bool
) -> list[str]:
    if path.suffix != suffix:
        raise InputError(f"'{path}' should end in {suffix}")
    notes = portable.check(system, target, drop)
    with _beside(path) as (work, resolved):
        if resolved.is_dir():
            raise InputError(f"'{path}' is a folder")
        if resolved.exists() and not overwrite:
            raise InputError(f"'{path}' exists; --overwrite replaces it")
        parts, more = portable.pack(system, work)
        (work / "out").mkdir()
        new = work / "out" / path.name
        write(system, parts, work, new)
        os.replace(new, resolved)
    return notes + more


@contextmanager
def _beside(path: Path) -> Iterator[tuple[Path, Path]]:
    """A scratch folder on the same file system, removed afterwards, and the path without links and dots.

    Raises:
        InputError: the system refuses to read or write something there.
    """
    try:
        resolved = Path(os.path.realpath(path))
        resolved.parent.mkdir(parents=True, exist_ok=True)
        sweep(resolved.parent, EXPORT)
        scratch = Scratch(resolved.parent, EXPORT)
        try:
            yield scratch.path, resolved
        finally:
            scratch.remove()
    except OSError as error:
        name = Path(error.filename or path).name
        raise InputError(
            f"'{path}' cannot be written: {error.strerror or error}"
            + (f": '{name}'" if name != path.name else "")
        ) from error

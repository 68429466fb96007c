"""Builds FMUs that are up to date with their source, and keeps them in a cache."""

import hashlib
import importlib.metadata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Timer
from typing import Any

from cybership.scratch_folder import scratch_folder
from cybership.user_cache import RefusedError, cache_folder, kept, place

from ..declare import Component
from ..effects import STANDARD, EffectSet
from ..ship import Ship
from ..ship import ship as make_ship
from ..ship_description import Description
from ..ships.naming import described_ship
from . import ledger
from .finding import ROOT, BuildError, load, which
from .packing import changes, hash_of, pack, sources
from .platforms import Native, native_targets
from .released import released
from .start_values_file import StartValues

# Wall time after which a build says that it takes long [s]; chosen: an FMU takes a second or two, and
# one that is compiled for all platforms up to ten.
LONG = 15.0


def build(
    names: str | Path | Sequence[str | Path],
    out: str | Path | None = None,
    starts: StartValues | None = None,
    note: Callable[[str], None] = lambda _: None,
    effects: EffectSet = STANDARD,
    native: Native | None = None,
    overwrite: bool = False,
    ship: Description | str | Path | None = None,
) -> list[Path]:
    """FMUs that are up to date with the source.

    Args:
        names: of an FMU or several, with or without ``.fmu``, or paths of component files; an empty
            list means all.
        out: folder that receives copies; None leaves them in the user's cache.
        starts: a parameter set. The FMUs that it names start with its values; without names, they are
            the ones that are built.
        note: receives a line where a part of the parameter set is not used, or an FMU in the cache was
            damaged.
        effects: that vessel and thrusters are to have.
        native: the platforms to compile for; None means FMUs that run in Python.
        overwrite: whether other files of these names may be replaced in ``out``.
        ship: that the FMUs are to be made for: a description, its file, or the name of a shipped one;
            None: the default ship.

    Returns:
        Path of each FMU, in the order of the names.

    Raises:
        BuildError: unknown name, a file that declares no component, no compiler, a cache that others
            may write to, or files in ``out`` that would be replaced.
        DeclarationError: a parameter set that does not fit.
    """
    out = None if out is None else Path(out)
    if out is not None and out.exists() and not out.is_dir():
        raise BuildError(f"'{out}' is a file, not a folder")
    of = make_ship(effects, described_ship(ship))
    built = [_cached(name, of, starts, native, note) for name in _every(_listed(names), starts, of)]
    if starts is not None:
        _tell_unused(starts, [fmu.stem for fmu in built], of, note)
    if out is None:
        return built
    return _placed(built, out, overwrite)


def export(
    names: Sequence[str],
    folder: Path,
    starts: StartValues | None = None,
    note: Callable[[str], None] = lambda _: None,
    effects: EffectSet = STANDARD,
    overwrite: bool = False,
    ship: Description | str | Path | None = None,
    webassembly: bool = False,
) -> list[Path]:
    """Components as plain C, or as WebAssembly; other arguments and errors are those of :func:`build`.

    Returns:
        The files written.
    """
    from ..fmi.trace import TraceError
    from ..native.export_source import exported_source
    from ..native.webassembly import exported_webassembly

    of = make_ship(effects, described_ship(ship))
    found = [load(*which(name), of)[1] for name in _every(names, starts, of)]
    if starts is not None:
        found = [starts.baked(component) for component in found]
        _tell_unused(starts, [component.name for component in found], of, note)
    try:
        files = exported_webassembly(found) if webassembly else exported_source(found)
    except TraceError as error:
        raise BuildError(str(error)) from error
    with scratch_folder() as work:
        for name, text in files.items():
            (work / name).write_text(text, encoding="utf-8")
        return _placed([work / name for name in files], folder, overwrite)


def came_compiled(name: str) -> bool:
    """Whether a compiled FMU of a component came with the package, for this source and computer."""
    with scratch_folder() as work:
        return released(name, own_source(), native_targets(), work) is not None


def _placed(made: Sequence[Path], folder: Path, overwrite: bool) -> list[Path]:
    """Copies of files in a folder, which is made.

    Raises:
        BuildError: another file would be replaced, and ``overwrite`` does not allow it.
    """
    for file in made if not overwrite else ():
        there = folder / file.name
        if there.is_dir() or (there.exists() and there.read_bytes() != file.read_bytes()):
            raise BuildError(f"'{there}' exists and is another file; --overwrite replaces it")
    folder.mkdir(parents=True, exist_ok=True)
    return [place(file, folder / file.name) for file in made]


def _listed(names: object) -> list[str]:
    """The names of one FMU or several, of whatever kind."""
    every = names if isinstance(names, (list, tuple)) else [names]
    for name in every:
        if not isinstance(name, (str, Path)):
            raise BuildError(f"an FMU is named by a text or a path, not by {type(name).__name__}")
    return [str(name) for name in every]


def _every(names: Sequence[str], starts: StartValues | None, of: Ship) -> Sequence[str]:
    """The components asked for; without names those of the parameter set, or all that a ship has."""
    if starts is not None:
        return names or list(starts.values)
    return names or list(of.components)


def _tell_unused(
    starts: StartValues, built: Sequence[str], of: Ship, note: Callable[[str], None]
) -> None:
    """Say what of a parameter set went into no FMU.

    Raises:
        BuildError: it names an FMU that does not exist.
    """
    for name in starts.values:
        if name not in built:
            load(name, None, of)
            note(f"'{starts.path}' has values for {name}, which is not built")
    for text in starts.beside:
        note(f"'{starts.path}' has values that no FMU can hold, {text}")
    for run in starts.runs[:1]:
        note(f"'{starts.path}' has times that were found in run '{run}' and are valid for that run only")
    if not starts.values:
        note(f"'{starts.path}' holds no values, so no FMU is changed")


def _cached(
    name: str,
    of: Ship,
    starts: StartValues | None = None,
    native: Native | None = None,
    note: Callable[[str], None] = lambda _: None,
) -> Path:
    """Path of an up-to-date FMU, built now if the cache does not hold it."""
    stem, own_file = which(name)
    cache, values = fmu_cache(), {}
    if starts is not None or own_file is not None:  # whose name and values the FMU has
        component = _loaded(stem, own_file, of, starts)[1]
        stem, values = component.name, component.starts if starts is not None else {}
    fmu = cache / _source_hash(own_file, of, values, native) / f"{stem}.fmu"

    def make(work: Path) -> Path:
        from filelock import FileLock  # only now: it takes a while to import

        module, component = _loaded(stem, own_file, of, starts)
        if fmu.exists():
            note(f"'{fmu}' in the cache was damaged, and is built again")
        python = _cached(name, of, starts, note=note) if native is not None and native.python else None
        with _told_if_long(component.name, note):
            as_released = starts is None and own_file is None and of is make_ship()
            if native is None:
                built = pack(component, module, own_file, work, of)
            elif as_released and (fits := released(stem, own_source(), native, work)):
                built = fits
            else:
                code_hash = hash_of(sources(module, own_file, of), component.starts, of)
                built = _compiled(component, code_hash, native, work, python)
        with FileLock(cache / "ledger.lock"):
            ledger.record(built, cache)
        return built

    try:
        return kept(cache, fmu, make)
    except RefusedError as error:
        raise BuildError(str(error)) from None
    except OSError as error:
        why = f"cannot keep FMUs in '{fmu.parent}' ({error.strerror})"
        raise BuildError(f"{why}; set CYBERSHIP_CACHE to another folder") from None


def _loaded(
    name: str, own_file: Path | None, of: Ship, starts: StartValues | None
) -> tuple[str, Component]:
    """Module name and component of an FMU, with its start values."""
    module, component = load(name, own_file, of)
    return module, component if starts is None else starts.baked(component)


def fmu_cache() -> Path:
    """Where built FMUs are kept.

    Raises:
        BuildError: the user has no folder of that kind.
    """
    if (folder := cache_folder()) is None:
        raise BuildError("this user has no home folder: set CYBERSHIP_CACHE to a folder for built FMUs")
    return folder


@contextmanager
def _told_if_long(name: str, note: Callable[[str], None]) -> Iterator[None]:
    """Say while an FMU is built that it takes long."""
    timer = Timer(LONG, note, [f"building {name} takes longer than {LONG:g} s"])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _compiled(
    component: Component, code_hash: str, native: Native, work: Path, python: Path | None
) -> Path:
    from ..fmi.trace import TraceError
    from ..native.compilers import CompilerError
    from ..native.native_fmu import native_fmu

    try:
        return native_fmu(component, code_hash, native.targets, work, python)
    except CompilerError as error:
        raise BuildError(f"{component.name} cannot be compiled: {error}") from error
    except TraceError as error:
        raise BuildError(str(error)) from error


def _source_hash(
    own_file: Path | None, of: Ship, starts: Mapping[str, float], native: Native | None = None
) -> str:
    """Hash of all that a build reads, of ship and start values, and of its compilers."""
    digest = hashlib.sha256(own_source().encode())
    digest.update(repr(of.description).encode())
    digest.update(importlib.metadata.version("pythonfmu").encode())
    for path in [*of.effects.files, *([own_file] if own_file else [])]:
        _read(digest, path)
    digest.update(changes(starts).encode())
    if native is not None:
        digest.update(native.key.encode())
    return digest.hexdigest()[:16]


@cache
def own_source() -> str:
    """Hash of this package's source: read once in a process."""
    digest = hashlib.sha256()
    for path in sorted(p for suffix in ("py", "c") for p in ROOT.rglob(f"*.{suffix}")):
        _read(digest, path)
    return digest.hexdigest()


def _read(digest: Any, path: Path) -> None:
    digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")

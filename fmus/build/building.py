"""Builds FMUs that are up to date with their source, and keeps them in a cache."""

import hashlib
import importlib.metadata
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from filelock import FileLock
from platformdirs import user_cache_path

from ..declare import discover
from ..effects import STANDARD, EffectSet
from . import ledger
from .finding import ROOT, BuildError, load, which
from .packing import changes, pack
from .start_values_file import Starts

CHECKER = ROOT / "check"  # judges FMUs, and is in none


def build(
    names: Sequence[str],
    out: Path | None = None,
    starts: Starts | None = None,
    note: Callable[[str], None] = lambda _: None,
    effects: EffectSet = STANDARD,
) -> list[Path]:
    """FMUs that are up to date with the source.

    Args:
        names: FMU names, with or without ``.fmu``, or paths of component files; none means all.
        out: folder that receives copies; None leaves them in the user's cache.
        starts: a parameter set. The FMUs that it names start with its values; without names, they are
            the ones that are built.
        note: receives a line where a part of the parameter set is not used.
        effects: that vessel and thrusters are to have.

    Returns:
        Path of each FMU, in the order of the names.

    Raises:
        BuildError: unknown name, or a file that declares no component.
        DeclarationError: a parameter set that does not fit.
    """
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise BuildError(f"'{out}' is a file, not a folder") from None
    if starts is None:
        every = names or [component.name for _, component in discover()]
        built = [_cached(name, effects) for name in every]
    else:
        built = [_cached(name, effects, starts) for name in names or starts.values]
        _tell_unused(starts, [fmu.stem for fmu in built], note)
    return built if out is None else [_place(fmu, out / fmu.name) for fmu in built]


def _tell_unused(starts: Starts, built: Sequence[str], note: Callable[[str], None]) -> None:
    """Say what of a parameter set went into no FMU.

    Raises:
        BuildError: it names an FMU that does not exist.
    """
    for name in starts.values:
        if name not in built:
            load(name, None)
            note(f"'{starts.path}' has values for {name}, which is not built")
    for text in starts.beside:
        note(f"'{starts.path}' has what no FMU can hold, {text}")
    if not starts.values:
        note(f"'{starts.path}' holds no values: no FMU is changed by it")


def _place(source: Path, target: Path) -> Path:
    """Copy a file so that the target is either the old one or the whole new one."""
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        shutil.copyfile(source, part)
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
    return target


def cache_folder() -> Path:
    """Where built FMUs are kept: ``CYBERSHIP_CACHE``, else the user's cache folder."""
    chosen = os.environ.get("CYBERSHIP_CACHE")
    return Path(chosen) if chosen else user_cache_path("cybership")


def _cached(name: str, effects: EffectSet, starts: Starts | None = None) -> Path:
    """Path of an up-to-date FMU, built now if the cache does not hold it."""
    stem, own_file = which(name)
    folder = cache_folder() / _source_hash(own_file, effects, {})
    fmu = folder / f"{stem}.fmu"
    if starts is None and fmu.is_file():
        return fmu
    module, component = load(stem, own_file, effects)
    if starts is not None:
        component = starts.baked(component)
        folder = cache_folder() / _source_hash(own_file, effects, component.starts)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BuildError(
            f"cannot keep FMUs in '{folder}' ({error.strerror}); CYBERSHIP_CACHE may name another folder"
        ) from None
    fmu = folder / f"{component.name}.fmu"
    with FileLock(folder / "lock"):
        if not fmu.is_file():
            with tempfile.TemporaryDirectory(prefix="fmu_") as work:
                built = pack(component, module, own_file, Path(work), effects)
                with FileLock(cache_folder() / "ledger.lock"):
                    ledger.record(built, cache_folder())
                _place(built, fmu)
    return fmu


def _source_hash(own_file: Path | None, effects: EffectSet, starts: Mapping[str, float]) -> str:
    """Hash of everything that a build reads, and of the start values that it changes."""
    digest = hashlib.sha256(importlib.metadata.version("pythonfmu").encode())
    own = [*effects.files, *([own_file] if own_file else [])]
    for path in [*sorted(p for p in ROOT.rglob("*.py") if CHECKER not in p.parents), *own]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    digest.update(changes(starts).encode())
    return digest.hexdigest()[:16]

"""Build the FMUs: ``python -m fmus.build [NAME|FILE.py ...] [--out DIR]``, see ``--help``."""

import argparse
import hashlib
import importlib.metadata
import os
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from filelock import FileLock
from platformdirs import user_cache_path

from . import ledger
from .baking import Starts, read_starts
from .declare import DeclarationError, Range, discover, variables
from .effects import registry
from .finding import ROOT, BuildError, load, which
from .packing import changes, pack

CHECKER = ROOT / "check"  # judges FMUs, and is in none


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; prints the path of each FMU, one a line, in the order asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m fmus.build",
        description="Build the project's FMUs, or an FMU from a component file of your own.",
        epilog="examples:  python -m fmus.build\n"
        "           python -m fmus.build vessel controller_abs --out fmu\n"
        "           python -m fmus.build my_controller.py --out fmu\n"
        "           python -m fmus.build --list vessel\n"
        "           python -m fmus.build vessel --effects my_effects.py --out fmu\n"
        "           python -m fmus.build --parameters model.ssv --out fmu\n"
        "           python -m fmus.build --verify fmu/vessel.fmu",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="FMU name or component file (all)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="copy the FMUs here (user's cache)")
    parser.add_argument(
        "--list", action="store_true", help="list the FMUs, or the variables of those named"
    )
    parser.add_argument(
        "--verify",
        action="store_true",
        help="build nothing; tell whether all programs in these .fmu files were built on this computer",
    )
    parser.add_argument(
        "--effects",
        type=Path,
        metavar="FILE.py",
        action="append",
        default=[],
        help="a file of model effects of your own, for vessel and thrusters; may be repeated",
    )
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE.ssv",
        help="SSP parameter set whose values become start values (without NAME: of the FMUs it names)",
    )
    options = parser.parse_args(arguments)
    try:
        for file in options.effects:
            registry.load(file)
        if options.verify:
            _verify(options.names)
        elif options.list:
            _print_list(options.names)
        else:
            starts = None if options.parameters is None else read_starts(options.parameters)
            for path in build(options.names, options.out, starts, _note):
                print(path)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads has seen enough; the rest must not raise while Python ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (BuildError, DeclarationError, OSError) as error:
        print("error:", " ".join(str(error).split()), file=sys.stderr)
        return 2
    return 0


def _verify(names: Sequence[str]) -> None:
    """Refuse FMUs with a program file that no build on this computer has made.

    Raises:
        BuildError: names the first such file; or a file cannot be read.
    """
    for name in names:
        try:
            wrong = ledger.stranger(Path(name), cache_folder())
        except (OSError, zipfile.BadZipFile, RuntimeError, ValueError) as error:
            raise BuildError(f"'{name}' cannot be read: {error}") from error
        if wrong:
            raise BuildError(f"'{name}' was not built here: it holds '{wrong}'")


def _print_list(names: Sequence[str]) -> None:
    """Print the FMUs there are, or every variable of those that are named."""
    if not names:
        for _, component in discover():
            print(f"{component.name:24} {component.description}")
    for name in names:
        _, component = load(*which(name))
        print(f"{component.name}: {component.description}")
        kinds = [
            ("parameter", component.params),
            ("input", component.inputs),
            ("output", component.outputs),
        ]
        for kind, group in kinds:
            for v in variables(group):
                start = f"{v.start:g}" if kind != "output" else ""
                print(f"  {kind:10}{v.name:18}{start:>9} {v.unit:14}{v.description}{_limits(v.range)}")


def _limits(allowed: Range) -> str:
    if allowed.min is None:
        return "" if allowed.max is None else f", at most {allowed.max:g}"
    return (
        f", {allowed.min:g} to {allowed.max:g}" if allowed.max is not None else f", >= {allowed.min:g}"
    )


def build(
    names: Sequence[str],
    out: Path | None = None,
    starts: Starts | None = None,
    note: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """FMUs that are up to date with the source.

    Args:
        names: FMU names, with or without ``.fmu``, or paths of component files; none means all.
        out: folder that receives copies; None leaves them in the user's cache.
        starts: a parameter set. The FMUs that it names start with its values; without names, they are
            the ones that are built.
        note: receives a line where a part of the parameter set is not used.

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
        built = [_cached(name) for name in names or [component.name for _, component in discover()]]
    else:
        built = [_cached(name, starts) for name in names or starts.values]
        _tell_unused(starts, [fmu.stem for fmu in built], note)
    return built if out is None else [_place(fmu, out / fmu.name) for fmu in built]


def _note(text: str) -> None:
    print("note:", text, file=sys.stderr)


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


def _cached(name: str, starts: Starts | None = None) -> Path:
    """Path of an up-to-date FMU, built now if the cache does not hold it."""
    stem, own_file = which(name)
    folder = cache_folder() / _source_hash(own_file, {})
    fmu = folder / f"{stem}.fmu"
    if starts is None and fmu.is_file():
        return fmu
    module, component = load(stem, own_file)
    if starts is not None:
        component = starts.baked(component)
        folder = cache_folder() / _source_hash(own_file, component.starts)
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
                built = pack(component, module, own_file, Path(work))
                with FileLock(cache_folder() / "ledger.lock"):
                    ledger.record(built, cache_folder())
                _place(built, fmu)
    return fmu


def _source_hash(own_file: Path | None, starts: Mapping[str, float]) -> str:
    """Hash of everything that a build reads, and of the start values that it changes."""
    digest = hashlib.sha256(importlib.metadata.version("pythonfmu").encode())
    own = [*registry.LOADED.values(), *([own_file] if own_file else [])]
    for path in [*sorted(p for p in ROOT.rglob("*.py") if CHECKER not in p.parents), *own]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    digest.update(changes(starts).encode())
    return digest.hexdigest()[:16]


if __name__ == "__main__":
    sys.exit(main())

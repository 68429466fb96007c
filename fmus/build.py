"""Build the FMUs: ``python -m fmus.build [NAME|FILE.py ...] [--out DIR]``, see ``--help``.

An FMU carries the source of its component and of every module of ours that this imports, in a package
whose name holds a hash of that source. So two FMUs in one process never run each other's code, nor that
of an older build, and the same source gives the same bytes.
"""

import argparse
import ast
import hashlib
import importlib
import importlib.metadata
import importlib.util
import keyword
import math
import os
import re
import shutil
import sys
import tempfile
import traceback
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock
from platformdirs import user_cache_path

from . import ledger
from .baking import Starts, read_starts
from .declare import Component, DeclarationError, Range, discover, nearest, variables, width
from .effects import registry
from .trace import trace_init, trace_step
from .units import base_exponents

ROOT = Path(__file__).parent
FACE = "fmus.slave"
EFFECTS = "fmus.effects"
CHECKER = ROOT / "check"  # judges FMUs, and is in none
# Zip files cannot hold an earlier date, and any fixed one makes builds repeatable.
ZIP_DATE = (1980, 1, 1, 0, 0, 0)

SCRIPT = '''"""Entry point of the FMU {name}."""

{effects}from {package}.{module} import COMPONENT
from {package}.slave import Slave


class {class_name}(Slave):
    component = COMPONENT{starting}
    code_hash = "{code_hash}"
    code_version = "{version}"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
'''


class BuildError(Exception):
    """What was asked for cannot be built; the message says why."""


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
            return 0
        if options.list:
            _print_list(options.names)
            return 0
        if options.parameters is None:
            built = build(options.names, options.out)
        else:
            built = build(options.names, options.out, read_starts(options.parameters), _note)
        for path in built:
            print(path)
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
        _, component = _load(*_which(name))
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
            _load(name, None)
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
    stem, own_file = _which(name)
    folder = cache_folder() / _source_hash(own_file, {})
    fmu = folder / f"{stem}.fmu"
    if starts is None and fmu.is_file():
        return fmu
    module, component = _load(stem, own_file)
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
                built = _pack(component, module, own_file, Path(work))
                with FileLock(cache_folder() / "ledger.lock"):
                    ledger.record(built, cache_folder())
                _place(built, fmu)
    return fmu


def _which(name: str) -> tuple[str, Path | None]:
    """What a name on the command line means: an FMU of ours, or a user's file and its stem."""
    if not name.endswith(".py"):
        return name.removesuffix(".fmu"), None
    own_file = Path(name)
    if not own_file.is_file():
        raise BuildError(f"no such component file: '{name}'")
    stem = own_file.stem
    taken = {path.stem for path in ROOT.iterdir()}
    if not stem.isidentifier() or keyword.iskeyword(stem) or stem in taken:
        raise BuildError(f"'{name}': a component file cannot be called '{stem}'")
    return stem, own_file


def _source_hash(own_file: Path | None, starts: Mapping[str, float]) -> str:
    """Hash of everything that a build reads, and of the start values that it changes."""
    digest = hashlib.sha256(importlib.metadata.version("pythonfmu").encode())
    own = [*registry.LOADED.values(), *([own_file] if own_file else [])]
    for path in [*sorted(p for p in ROOT.rglob("*.py") if CHECKER not in p.parents), *own]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    digest.update(_changes(starts).encode())
    return digest.hexdigest()[:16]


def _changes(starts: Mapping[str, float]) -> str:
    """Changed start values as Python writes them, in the order of names; empty if there are none."""
    return repr(dict(sorted(starts.items()))) if starts else ""


def _load(name: str, own_file: Path | None) -> tuple[str, Component]:
    """Module name and component of an FMU of ours, or of a user's file."""
    if own_file is None:
        known = {component.name: (module, component) for module, component in discover()}
        if name in known:
            if registry.LOADED:
                _check_effects(known[name][1])
            return known[name]
        hint = nearest(name, known) or f"; there are {', '.join(known)}"
        raise BuildError(f"no FMU '{name}'{hint}")
    spec = importlib.util.spec_from_file_location(own_file.stem, own_file)
    if spec is None or spec.loader is None:
        raise BuildError(f"'{own_file}' cannot be read as a Python module")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise BuildError(f"'{own_file}' fails when imported: {error!r}") from error
    component = getattr(module, "COMPONENT", None)
    if not isinstance(component, Component):
        raise BuildError(f"'{own_file}' declares no COMPONENT = Component(...)")
    try:
        _check(component)
    except Exception as error:
        raise BuildError(f"{_place_of(error, own_file)}: {error}") from error
    return f"fmus.{own_file.stem}", component


def _check(component: Component) -> None:
    """Find out now what is wrong with a user's component, while the error can still name the line."""
    if not component.name.isidentifier() or not component.name.isascii():
        raise DeclarationError(f"'{component.name}' cannot be the name of an FMU")
    for v in component.variables:
        base_exponents(v.unit)
        if not math.isfinite(v.start):
            raise DeclarationError(f"{v.name} starts at {v.start}")
    for trace in (trace_init(component), trace_step(component)):
        if len(trace.outputs) != width(component.outputs):
            raise DeclarationError(
                f"step gives {len(trace.outputs)} outputs, {width(component.outputs)} are declared"
            )


def _check_effects(component: Component) -> None:
    """Find out now whether a component works with the effects of a user's files."""
    try:
        _check(component)
    except Exception as error:
        places = [_place_of(error, file) for file in registry.LOADED.values()]
        told = [place for place in places if ":" in place] or places
        raise BuildError(f"{told[0]}: {error}") from error


def _place_of(error: Exception, own_file: Path) -> str:
    """File and line of a user's file where an error comes from."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [f for f in frames if Path(f.filename).resolve() == own_file.resolve()]
    return f"{own_file}:{lines[-1].lineno}: {lines[-1].line}" if lines else str(own_file)


def _sources(module: str, own_file: Path | None) -> dict[str, str]:
    """Source of a component's module and of all modules of ours that it and the face import.

    Args:
        module: full name of the component's module.
        own_file: file behind that name, where it is not one of ours.

    Returns:
        Path inside the package -> source text.
    """
    found: dict[str, str] = {}
    pending = [module, FACE]
    while pending:
        name = pending.pop()
        relative = Path(*name.split(".")[1:])
        if own_file is not None and name == module:
            path, inside = own_file, f"{relative}.py"
        elif name.startswith(f"{EFFECTS}.") and relative.name in registry.LOADED:
            path, inside = registry.LOADED[relative.name], f"{relative}.py"
        elif (ROOT / relative).is_dir():
            path, inside = ROOT / relative / "__init__.py", str(relative / "__init__.py")
        elif (ROOT / relative).with_suffix(".py").is_file():
            path, inside = (ROOT / relative).with_suffix(".py"), f"{relative}.py"
        else:
            continue  # a name inside a module, not a module
        if inside in found:
            continue
        found[inside] = path.read_text()
        package = name if inside.endswith("__init__.py") else name.rpartition(".")[0]
        pending += [package, *_imports(found[inside], package)]
        if name == EFFECTS:
            pending += [f"{EFFECTS}.{stem}" for stem in registry.LOADED]
    return found


def _imports(source: str, package: str) -> list[str]:
    """Full names of what a module imports from this package (modules, or names inside them)."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = importlib.util.resolve_name("." * node.level + base, package)
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    return [name for name in names if name == "fmus" or name.startswith("fmus.")]


def _pack(component: Component, module: str, own_file: Path | None, work: Path) -> Path:
    """Build one FMU in a scratch folder and return its path."""
    from pythonfmu.builder import FmuBuilder

    sources = _sources(module, own_file)
    digest = hashlib.sha256()
    for inside in sorted(sources):
        digest.update(f"{inside}\0{sources[inside]}\0".encode())
    changes = _changes(component.starts)
    digest.update(changes.encode())
    code_hash = digest.hexdigest()
    package = f"{component.name}_{code_hash[:16]}"
    for inside, text in sources.items():
        path = work / package / inside
        path.parent.mkdir(parents=True, exist_ok=True)
        # A user's file imports fmus by name; inside the FMU the package is called otherwise.
        path.write_text(re.sub(r"^(\s*(?:from|import)\s+)fmus\b", rf"\g<1>{package}", text, flags=re.M))
    script = work / f"{package}_fmu.py"
    script.write_text(
        SCRIPT.format(
            name=component.name,
            package=package,
            module=module.partition(".")[2],
            starting=f".starting({changes})" if changes else "",
            class_name=component.name.title().replace("_", ""),
            effects="".join(
                f"import {package}.effects.{stem}\n"
                for stem in registry.LOADED
                if f"effects/{stem}.py" in sources
            ),
            code_hash=code_hash,
            version=importlib.metadata.version("cybership"),
        )
    )
    with _own_imports(package, script.stem):
        raw = FmuBuilder.build_FMU(script, dest=work / "raw", project_files=[work / package])
    return _repeatable(Path(raw), work / f"{component.name}.fmu")


@contextmanager
def _own_imports(*names: str) -> Iterator[None]:
    """pythonfmu imports what it packs: neither from an FMU that has run here, nor for the next build."""

    def forget() -> None:
        for module in [m for m in sys.modules if m.partition(".")[0] in names]:
            del sys.modules[module]

    path = list(sys.path)
    forget()
    try:
        yield
    finally:
        sys.path[:] = path
        forget()


def _repeatable(raw: Path, fmu: Path) -> Path:
    """The same archive with sorted names and without dates."""
    with zipfile.ZipFile(raw) as source, zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as target:
        for name in sorted(source.namelist()):
            info = zipfile.ZipInfo(name, ZIP_DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            with source.open(name) as reader, target.open(info, "w") as writer:
                shutil.copyfileobj(reader, writer)
    return fmu


if __name__ == "__main__":
    sys.exit(main())

"""Packs a component and the source that it needs into an FMU.

The source of every module of ours that the component imports goes into a package whose name holds a
hash of that source. So two FMUs in one process never run each other's code, nor that of an older build,
and the same source gives the same bytes.
"""

import ast
import hashlib
import importlib.metadata
import importlib.util
import re
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from ..declare import Component
from ..fmi.repeatable_archive import write_archive
from ..ship import Ship
from ..ships.naming import DEFAULT
from .finding import ROOT

FACE = "fmus.fmi.slave"
EFFECTS = "fmus.effects"
# What an FMU imports in addition to its component, by whether it is made of effects or to scale.
DESCRIPTION, EXPANSION, SIZING = "fmus.ship_description", "fmus.ships.expansion", "fmus.sizing"
NAMING, SHIPPED = Path("ships", "naming.py"), Path("shipped", f"{DEFAULT}.toml")

SCRIPT = '''"""Entry point of the FMU {name}."""

{imports}
from {package}.fmi.slave import Slave


class {class_name}(Slave):
    component = {component}{starting}
    code_hash = "{code_hash}"
    code_version = "{version}"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
'''


def changes(starts: Mapping[str, float]) -> str:
    """Changed start values as Python writes them, in the order of names; empty if there are none."""
    return repr(dict(sorted(starts.items()))) if starts else ""


def sources(module: str, own_file: Path | None, of: Ship) -> dict[str, str]:
    """Source of a component's module and of all modules of ours that it and the face import.

    Args:
        module: full name of the component's module.
        own_file: file behind that name, where it is not one of ours.
        of: the ship that it is made for; users' files of effects come with it.

    Returns:
        Path inside the package -> source text.
    """
    found: dict[str, str] = {}
    files = {f"{EFFECTS}.{file.stem}": file for file in of.effects.files}
    pending = [module, FACE]
    if own_file is None:
        pending += [DESCRIPTION, EXPANSION if _has_factory(module) else SIZING]
    while pending:
        name = pending.pop()
        relative = Path(*name.split(".")[1:])
        if own_file is not None and name == module:
            path, inside = own_file, f"{relative}.py"
        elif name in files:
            path, inside = files[name], f"{relative}.py"
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
            pending += files
    if str(NAMING) in found:  # a component that asks for the default ship
        from ..ships.ship_file import find_ship  # only now: pydantic takes a while to import

        found[str(SHIPPED)] = find_ship(DEFAULT).read_text(encoding="utf-8")
    return found


@cache
def _imports(source: str, package: str) -> tuple[str, ...]:
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
    return tuple(name for name in names if name == "fmus" or name.startswith("fmus."))


def hash_of(files: Mapping[str, str], starts: Mapping[str, float], of: Ship) -> str:
    """What identifies a component, in Python and compiled: hash of its source, start values and ship."""
    digest = hashlib.sha256(repr(of.description).encode())
    for inside in sorted(files):
        digest.update(f"{inside}\0{files[inside]}\0".encode())
    digest.update(changes(starts).encode())
    return digest.hexdigest()


def pack(
    component: Component,
    module: str,
    own_file: Path | None,
    work: Path,
    of: Ship,
) -> Path:
    """Build one FMU in a scratch folder and return its path."""
    from pythonfmu.builder import FmuBuilder

    files, changed = sources(module, own_file, of), changes(component.starts)
    code_hash = hash_of(files, component.starts, of)
    package = f"{component.name}_{code_hash[:16]}"
    for inside, text in files.items():
        path = work / package / inside
        path.parent.mkdir(parents=True, exist_ok=True)
        # A user's file imports fmus by name; inside the FMU the package is called otherwise.
        path.write_text(re.sub(r"^(\s*(?:from|import)\s+)fmus\b", rf"\g<1>{package}", text, flags=re.M))
    script = work / f"{package}_fmu.py"
    imports, made = _entry(f"{package}.{module.partition('.')[2]}", package, own_file, of)
    script.write_text(
        SCRIPT.format(
            name=component.name,
            package=package,
            imports=imports,
            component=made,
            starting=f".starting({changed})" if changed else "",
            class_name=component.name.title().replace("_", ""),
            code_hash=code_hash,
            version=importlib.metadata.version("cybership"),
        )
    )
    with _own_imports(package, script.stem):
        raw = FmuBuilder.build_FMU(script, dest=work / "raw", project_files=[work / package])
    with zipfile.ZipFile(raw) as archive:
        inside_fmu = {name: archive.read(name) for name in archive.namelist()}
    return write_archive(work / f"{component.name}.fmu", inside_fmu)


def _entry(module: str, package: str, own_file: Path | None, of: Ship) -> tuple[str, str]:
    """How an FMU's script imports its component, and names it."""
    if own_file is not None:
        return f"from {module} import COMPONENT", "COMPONENT"
    described = [
        f"from {package}.ship_description import Description, Part, Value",
        f"SHIP = {of.description!r}",
    ]
    if not _has_factory(f"fmus.{module.partition('.')[2]}"):
        lines = [f"from {package}.sizing import sized", f"from {module} import COMPONENT"]
        return "\n".join([*lines, *described]), "sized(COMPONENT, SHIP)"
    stems = [file.stem for file in of.effects.files]
    lines = [
        f"from {package}.effects import STANDARD, effects_of{''.join(f', {s}' for s in stems)}",
        f"from {package}.ships.expansion import effects_of_ship",
        f"from {module} import make",
    ]
    more = "".join(f".plus(effects_of({stem}))" for stem in stems)
    return "\n".join([*lines, *described]), f"make(effects_of_ship(SHIP, STANDARD{more}), SHIP)"


def _has_factory(module: str) -> bool:
    """Whether a module makes components of a set of effects and of a ship."""
    return hasattr(sys.modules.get(module), "make")


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

"""Packs a component as an FMU whose libraries are its own machine code: no Python at run time.

Variables, value references, units, start values and dependencies are those of the Python FMU. The same
source gives the same bytes, as far as the compiler does.
"""

from __future__ import annotations

import importlib.metadata
import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from ..declare import Component
from ..fmi.model_description import guid_of, model_description
from ..fmi.repeatable_archive import write_archive
from .compilers import TARGETS, compiled
from .model_source import FACE, TABLES, repeated_source, tables
from .program import program

FACE_FILE = Path(__file__).with_name(FACE)


def native_fmu(
    component: Component,
    code_hash: str,
    targets: Sequence[str],
    work: Path,
    python: Path | None = None,
) -> Path:
    """Build one FMU in a scratch folder.

    Args:
        component: what it computes.
        code_hash: identifies it.
        targets: platforms to compile for, of :data:`~fmus.native.compilers.TARGETS`.
        work: the scratch folder.
        python: the same component's Python FMU, whose body then serves all other platforms.

    Returns:
        Path of the FMU.

    Raises:
        CompilerError: no compiler for a platform, or it fails.
        TraceError: the component does what cannot be compiled.
    """
    recorded = program(component)
    guid = guid_of(code_hash)
    source = {**repeated_source(recorded), TABLES: tables(recorded, guid)}
    for name, text in source.items():
        (work / name).write_text(text, encoding="utf-8")
    version = importlib.metadata.version("cybership")
    root = model_description(component, guid, version, python is not None, "cybership")
    ElementTree.indent(root)
    files = {"modelDescription.xml": ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)}
    for target in targets:
        inside = f"binaries/{target}/{component.name}{TARGETS[target].suffix}"
        files[inside] = compiled(FACE_FILE, target, work)
    if python is not None:
        files = _python_body(python, targets) | files
    return write_archive(work / f"{component.name}.fmu", files)


def _python_body(python: Path, targets: Sequence[str]) -> dict[str, bytes]:
    """What a Python FMU needs on platforms that are not among the targets."""
    native = tuple(f"binaries/{target}/" for target in targets)
    with zipfile.ZipFile(python) as archive:
        return {
            name: archive.read(name)
            for name in archive.namelist()
            if not name.endswith("/") and not name.startswith(native)
        }

"""A system as one FMU, by the container of fmu-manipulation-toolbox: a small FMI master in C around the
FMUs."""

import logging
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..formats.documents import parse
from ..formats.elements import value_text, write_document
from ..system.preparation import newest_first
from ..system.system import System
from .portable import ExportedInstance


def write_container(
    system: System,
    parts: Sequence[ExportedInstance],
    folder: Path,
    fmu: Path,
    expose: Collection[str] = (),
) -> None:
    """Write the container; it keeps the order of stepping.

    All outputs are outputs of the container, called ``instance.variable``; so are inputs that nothing
    feeds.

    Args:
        system: checked system.
        parts: its instances; their FMUs are in the folder.
        folder: where the FMUs are; also used for scratch.
        fmu: the file to write.
        expose: parameters that the container has as well.

    Raises:
        InputError: the toolbox is not installed, or cannot make the container.
    """
    try:
        from fmu_manipulation_toolbox.container import FMUContainer
        from fmu_manipulation_toolbox.container.errors import FMUContainerError
    except ModuleNotFoundError:
        raise InputError(
            "a container FMU needs fmu-manipulation-toolbox: pip install 'cybership[export]'"
        ) from None
    by_name = {part.name: part for part in parts}
    # Every link becomes a local variable named after the FMU; the plain names are for outputs.
    files = {part.name: f"link_{part.file}" for part in parts}
    # It logs every unconnected variable; errors are exceptions.
    logger = logging.getLogger("fmu_manipulation_toolbox")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        identifier = re.sub(r"^(?=\d)|\W", "_", fmu.stem, flags=re.ASCII)
        container = _without_claims(FMUContainer, _convention(parts))(identifier, folder)
        vars(container).update(start_time=0.0, stop_time=system.scenario.stop)
        # The order of stepping is that of initialisation as well, which simultaneous steps need too.
        order, _ = newest_first(system)
        for name in order:
            container.get_fmu(by_name[name].file, files[name])
        for c in system.connections:
            container.add_link(
                files[c.source.instance],
                c.source.variable.name,
                files[c.target.instance],
                c.target.variable.name,
            )
        for name in order:
            _add_ports(container, system, by_name[name], files[name], expose)
        container.make_fmu(
            fmu, system.scenario.step, sequential=system.scenario.algorithm == "gauss_seidel"
        )
    except FMUContainerError as error:
        raise InputError(f"the container cannot be made: {error.reason}") from None
    finally:
        logger.setLevel(level)


def _convention(parts: Sequence[ExportedInstance]) -> str:
    """Naming convention of the container: is ``instance.variable`` a structured name in FMI?"""
    structured = all(
        re.fullmatch(r"[A-Za-z_]\w*", part.name, re.ASCII)
        and part.model.description.variableNamingConvention == "structured"
        for part in parts
    )
    return "structured" if structured else "flat"


def _without_claims(toolbox_container: Any, convention: str) -> Any:
    """The toolbox's class without its claims about author, licence and naming convention."""

    class Container(toolbox_container):
        def make_fmu_xml(self, xml_filename: Path, *arguments: Any, **options: Any) -> None:
            super().make_fmu_xml(xml_filename, *arguments, **options)
            root = parse(xml_filename.read_bytes(), xml_filename, "fmiModelDescription")
            for claim in ("author", "license"):
                root.attrib.pop(claim, None)
            root.set("variableNamingConvention", convention)
            write_document(root, xml_filename)

    return Container


def _add_ports(
    container: Any, system: System, part: ExportedInstance, file: str, expose: Collection[str]
) -> None:
    """Ports of the container, and start values."""
    fed = {c.target.name for c in system.connections}
    given = {v.name for v, _ in system.parameters[part.name]}
    for v in part.model.variables.values():
        name = f"{part.name}.{v.name}"
        if v.causality == "output":
            container.add_output(file, v.name, name)
        elif name in expose or (v.causality == "input" and name not in fed and v.name not in given):
            container.add_input(name, file, v.name)
    for v, value in part.values:
        if v.type == "String" and any(c.isspace() for c in str(value)):
            raise InputError(
                f"fmus.{part.name}: {v.name}: a container FMU cannot hold a text with blanks: {value!r}"
            )
        container.add_start_value(file, v.name, value_text(v, value))

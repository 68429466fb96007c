"""Systems of other tools as the content of a scenario, and what their readers share."""

import shutil
import tempfile
import weakref
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ..archive import check_xml, integer, real
from ..errors import InputError, nearest

if TYPE_CHECKING:
    from ..fmu import Model, Variable

# No system has longer paths.
LONGEST = 4096


class Unpacked:
    """A folder for what was unpacked, gone when nobody needs it any more."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="cosim_"))
        weakref.finalize(self, shutil.rmtree, self.path, True)


@dataclass
class Imported:
    """A system as a scenario.

    Attributes:
        content: what a scenario file would hold.
        folder: what its paths are relative to.
        notes: what was assumed or left out.
        unpacked: keeps the folder alive, where it is a scratch one.
    """

    content: dict[str, Any]
    folder: Path
    notes: list[str] = field(default_factory=list)
    unpacked: Unpacked | None = None


def is_system(path: Path) -> bool:
    """Whether this is for :func:`read_system`, not a scenario."""
    return path.suffix in (".ssp", ".xml") or path.is_dir()


def read_system(path: Path) -> Imported:
    """A system from an SSP archive, an OSP directory or its OspSystemStructure.xml.

    Raises:
        InputError: missing, unreadable, or it has something that this master cannot do.
    """
    from .read_osp import read_osp
    from .read_ssp import read_ssp

    if not path.exists():
        raise InputError(f"no such system: '{path}'")
    return read_ssp(path) if path.suffix == ".ssp" else read_osp(path)


def parse(text: bytes, path: Path | str, tag: str, namespace: str = "") -> Element:
    """The root of a document, which must be of this kind.

    Args:
        text: the document.
        path: where it comes from.
        tag: of the root.
        namespace: of the root; any if empty.

    Raises:
        InputError: it has a DOCTYPE, is not XML, or of another kind.
    """
    check_xml(text, path, tag)
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as {tag}: {error}") from None
    if local(root) != tag or (namespace and root.tag != f"{{{namespace}}}{tag}"):
        raise InputError(f"'{path}' is no {tag} that this reader knows, but '{root.tag}'")
    return root


def read_file(path: Path) -> bytes:
    """What a file holds.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}") from None


def need(element: Element, name: str, where: str) -> str:
    """An attribute that must be there."""
    value = element.get(name)
    if value is None:
        raise InputError(f"{where}: <{local(element)}> has no '{name}'")
    return value


def number(text: str | None, where: str) -> float:
    """A finite number."""
    value = real(text or "")
    if value is None:
        raise InputError(f"{where} = '{text}' is not a number")
    return value


def start_value(element: Element, where: str) -> bool | int | float | str:
    """The value of an element called after its type: <Real value="1.0"/>, with any prefix."""
    text = need(element, "value", where)
    kind = local(element)
    if kind == "String":
        return text
    if kind == "Boolean":
        if text not in ("true", "false", "1", "0"):
            raise InputError(f"{where} = '{text}' is neither true nor false")
        return text in ("true", "1")
    if kind == "Real":
        return number(text, where)
    if kind == "Integer":
        value = integer(text)
        if value is None:
            raise InputError(f"{where} = '{text[:100]}' is not a whole number")
        return value
    raise InputError(f"{where}: values of type {kind} are not supported")


def variable(models: Mapping[str, "Model"], instance: str, name: str, where: str) -> "Variable":
    """The variable that one end of a connection means; * is a wildcard in scenarios only.

    Raises:
        InputError: no such instance, or it has no such variable.
    """
    if instance not in models:
        raise InputError(f"{where}: there is no '{instance}'{nearest(instance, models)}")
    known = models[instance].variables
    if name not in known or "*" in name:
        raise InputError(f"{where}: '{instance}' has no variable '{name}'{nearest(name, known)}")
    return known[name]


def local(element: Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def file_of(source: str, where: str) -> str:
    """The path that a URI means: relative, or absolute with the scheme ``file``."""
    with suppress(ValueError):
        parts = urlsplit(source)
        is_plain = not (parts.netloc or parts.query or parts.fragment) and len(source) <= LONGEST
        if parts.scheme in ("", "file") and is_plain:
            return unquote(parts.path)
    raise InputError(f"{where}: '{source[:100]}' is not a file; only files are supported")

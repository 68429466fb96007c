"""XML documents of untrusted origin: parsing, attributes, numbers, references to files and variables."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ..errors import InputError, nearest
from ..fmu.archive_check import check_xml, integer, real
from ..fmu.fmu_model import FmuModel, FmuVariable, Value

# Longest URI of a file [characters]: PATH_MAX of Linux.
LONGEST = 4096


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
        raise InputError(f"'{path}' is not a supported {tag}; its root element is '{root.tag}'")
    return root


def read_file(path: Path) -> bytes:
    """Content of a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}") from None


def need(element: Element, name: str, where: str) -> str:
    """A required attribute."""
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


def start_value(element: Element, where: str) -> Value:
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


def variable(models: Mapping[str, FmuModel], instance: str, name: str, where: str) -> FmuVariable:
    """The variable at one end of a connection; * is a wildcard in scenarios only.

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
    """The path of a URI: relative, or absolute with the scheme ``file``."""
    with suppress(ValueError):
        parts = urlsplit(source)
        is_plain = not (parts.netloc or parts.query or parts.fragment) and len(source) <= LONGEST
        if parts.scheme in ("", "file") and is_plain:
            return unquote(parts.path)
    raise InputError(f"{where}: '{source[:100]}' is not a file; only files are supported")

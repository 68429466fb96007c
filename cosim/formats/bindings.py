"""Parameter bindings of SSP 1.0: values from parameter sets, with names and scales from mappings."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

from ..conversion import Conversion
from ..errors import InputError, nearest
from ..fmu.archive_check import Archive
from ..fmu.fmu_model import Value
from .documents import file_of, local, need, number, parse, start_value
from .namespaces import SSM, SSP_SPACES

SET_TYPE = "application/x-ssp-parameter-set"
NAMES = {**SSP_SPACES, "ssm": SSM}


@dataclass(frozen=True)
class BoundValue:
    """A start value.

    Attributes:
        value: in its unit.
        unit: as stated; None: that of the variable it is for.
        where: its origin, for messages.
    """

    value: Value
    unit: str | None
    where: str


class Bindings:
    """Reads the bindings of components and of the system.

    Args:
        archive: holds the files.
        notes: receives notes for the user.
    """

    def __init__(self, archive: Archive, notes: list[str]) -> None:
        self.archive = archive
        self.notes = notes

    def read(self, owner: Element, where: str) -> dict[str, BoundValue]:
        """Parameter -> value of all bindings of a component or of the system; the last one counts.

        Raises:
            InputError: a file is missing, or uses a feature that this reader lacks.
        """
        found: dict[str, BoundValue] = {}
        for binding in owner.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMES):
            if binding.get("type", SET_TYPE) != SET_TYPE or binding.get("sourceBase", "SSD") != "SSD":
                raise InputError(f"{where}: this kind of parameter binding is not supported")
            values = self._values(binding, where)
            mapping = binding.find("ssd:ParameterMapping", NAMES)
            found |= values if mapping is None else self._mapped(mapping, values, where)
        return found

    def _values(self, binding: Element, where: str) -> dict[str, BoundValue]:
        root = self._content(binding, "ssd:ParameterValues/ssv:ParameterSet", SSP_SPACES["ssv"], where)
        if root is None:
            raise InputError(f"{where}: a parameter binding without values")
        prefix = binding.get("prefix", "")
        values: dict[str, BoundValue] = {}
        for entry in root.iterfind("ssv:Parameters/ssv:Parameter", NAMES):
            name = prefix + need(entry, "name", where)
            typed = next(iter(entry), None)
            if typed is None:
                raise InputError(f"{where}: the parameter '{name}' has no value")
            values[name] = BoundValue(start_value(typed, f"{where}: {name}"), typed.get("unit"), where)
        return values

    def _mapped(
        self, mapping: Element, values: dict[str, BoundValue], where: str
    ) -> dict[str, BoundValue]:
        root = self._content(mapping, "ssm:ParameterMapping", SSM, where)
        entries: Iterable[Element] = () if root is None else root.iterfind("ssm:MappingEntry", NAMES)
        found: dict[str, BoundValue] = {}
        for entry in entries:
            name, target = need(entry, "source", where), need(entry, "target", where)
            given = values.get(name)
            if given is None:
                self.notes.append(
                    f"{where}: no parameter '{name}' exists to map to '{target}'{nearest(name, values)}"
                )
                continue
            how = linear(entry, f"{where}: mapping of '{name}'")
            if how is not None:
                if not isinstance(given.value, (int, float)) or isinstance(given.value, bool):
                    raise InputError(
                        f"{where}: mapping of '{name}': a LinearTransformation needs a number, "
                        f"not {given.value!r}"
                    )
                given = replace(given, value=how.factor * given.value + how.offset)
            found[target] = replace(given, unit=None) if is_unit_kept(entry) else given
        return found

    def _content(self, element: Element, inline: str, namespace: str, where: str) -> Element | None:
        """The content of an element, inline or in the file that it names."""
        source = element.get("source")
        if source is None:
            return element.find(inline, NAMES)
        file = file_inside(source, where)
        return parse(self.archive.read(file), file, inline.rpartition(":")[2], namespace)


def linear(parent: Element, where: str) -> Conversion | None:
    """The transformation of a connection or of a mapping entry, if it has one."""
    for child in parent:
        if child.tag.startswith(f"{{{SSP_SPACES['ssc']}}}"):
            if local(child) != "LinearTransformation":
                raise InputError(f"{where}: {local(child)} is not supported")
            factor, offset = child.get("factor", "1"), child.get("offset", "0")
            return Conversion(number(factor, f"{where}: factor"), number(offset, f"{where}: offset"))
    return None


def is_unit_kept(element: Element) -> bool:
    """Whether a connection or a mapping entry suppresses the conversion of units."""
    return element.get("suppressUnitConversion", "false") in ("true", "1")


def file_inside(source: str, where: str) -> str:
    """The entry of the archive that a URI names."""
    return str(PurePosixPath(file_of(source, where)))

"""Parameter sets of the SSP standard (``.ssv``): values for FMUs, by model name."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ..conversion import BASE_UNITS, Unit, conversion
from ..errors import InputError
from ..files import write_text
from ..fmu.archive_check import check_xml, real
from .namespaces import SSC, SSV

# Types of annotations that hold values of this project; the standard leaves annotations to the tools.
BESIDE, RUN, LEARNED = "cybership.beside", "cybership.run", "cybership.learned_from"
CONTENT = "Content"  # element of an annotation that holds text
Values = Mapping[str, Mapping[str, "Parameter"]]  # model name -> parameter -> value


@dataclass(frozen=True)
class Parameter:
    """A number of a parameter set.

    Attributes:
        value: in its unit.
        unit: as stated; None: the FMU's.
        description: one line.
    """

    value: float
    unit: str | None = None
    description: str = ""


@dataclass(frozen=True)
class ParameterSet:
    """The content of a parameter set.

    Attributes:
        values: model name -> parameter -> value.
        units: name -> exponents of the SI base units, rad, factor, offset, by the names of the standard.
        beside: values of the model that are no parameter of an FMU, so that no tool applies them.
        name: of the set.
        runs: measured run -> values that hold in it alone. Those of the first run stand in ``values``,
            too, if these have no other value, so that a tool without measured runs can apply them.
        learned_from: description of each training run of the values.
    """

    values: Values = field(default_factory=dict)
    units: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    beside: Mapping[str, Parameter] = field(default_factory=dict)
    name: str = "parameters"
    runs: Mapping[str, Values] = field(default_factory=dict)
    learned_from: Sequence[Mapping[str, Any]] = ()

    @property
    def of_one_run(self) -> dict[str, list[str]]:
        """Model name -> parameters in ``values`` that were found in the first of the runs."""
        first = next(iter(self.runs.values()), {})
        return {m: [n for n in v if first.get(m, {}).get(n) == v[n]] for m, v in self.values.items()}

    def unit(self, name: str) -> Unit:
        """A unit that a value of this set states."""
        if name not in self.units:
            return Unit(name)
        own = self.units[name]
        exponents = tuple(int(own.get(base, 0)) for base in BASE_UNITS)
        return Unit(name, exponents, own.get("factor", 1.0), own.get("offset", 0.0))

    def number(self, given: Parameter, unit: Unit | None, where: str) -> float:
        """A value of this set in the unit of an FMU.

        Args:
            given: the value.
            unit: the FMU's; None where it states none.
            where: what is converted, for messages.

        Raises:
            InputError: the units cannot be compared, or are of different dimensions.
        """
        if given.unit is None or unit is None:
            return given.value
        how = conversion(self.unit(given.unit), unit, where)
        if how is None:
            raise InputError(
                f"{where} is in '{given.unit}', but the FMU's unit is '{unit.name}', and the "
                "conversion is not defined"
            )
        return how.factor * given.value + how.offset


def read_parameters(path: str | Path) -> ParameterSet:
    """Numbers of a parameter set.

    Args:
        path: an SSP 1.0 ``.ssv`` file whose names read ``model.parameter``.

    Raises:
        InputError: missing, no parameter set, a name twice, or a value that is no number.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
        check_xml(content, path, "a parameter set")
        root = ElementTree.fromstring(content)
    except FileNotFoundError:
        raise InputError(f"no such parameter set: '{path}'") from None
    except IsADirectoryError:
        raise InputError(f"'{path}' is a folder; a parameter set is a file") from None
    except (OSError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as a parameter set (XML, .ssv): {error}") from None
    if root.tag != f"{{{SSV}}}ParameterSet":
        raise InputError(f"'{path}' is not an SSP 1.0 parameter set")
    values = _values(root, path)
    units = {
        entry.get("name", ""): _exponents(base, f"'{path}': unit '{entry.get('name', '')}'")
        for entry in root.iterfind(f"{{{SSV}}}Units/{{{SSC}}}Unit")
        for base in entry.iterfind(f"{{{SSC}}}BaseUnit")
    }
    own = f"{{{SSV}}}Annotations/{{{SSC}}}Annotation"
    entries = root.iterfind(f"{own}[@type='{BESIDE}']/{{{SSV}}}Parameters/*")
    beside = {e.get("name", ""): _parameter(e, f"'{path}': {e.get('name')}") for e in entries}
    sets = root.iterfind(f"{own}[@type='{RUN}']/{{{SSV}}}ParameterSet")
    runs = {s.get("name", ""): _values(s, path) for s in sets}
    if "" in runs:
        raise InputError(f"'{path}' has values of a run without a name")
    learned = [_told(e.text, path) for e in root.iterfind(f"{own}[@type='{LEARNED}']/{CONTENT}")]
    return ParameterSet(values, units, beside, root.get("name", ""), runs, learned)


def _told(text: str | None, path: Path) -> dict[str, Any]:
    """What an annotation tells of a run."""
    try:
        return dict(json.loads(text or ""))
    except (ValueError, TypeError, RecursionError):
        raise InputError(f"'{path}': an annotation {LEARNED} is not an object of JSON") from None


def _values(root: Element, path: Path) -> dict[str, dict[str, Parameter]]:
    """The values of an element ``ParameterSet``."""
    values: dict[str, dict[str, Parameter]] = {}
    for entry in root.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
        name = entry.get("name", "")
        model, dot, parameter = name.partition(".")
        if not dot:
            raise InputError(f"'{path}': '{name}' is not of the form model.parameter")
        if parameter in values.setdefault(model, {}):
            raise InputError(f"'{path}': {name} occurs twice")
        values[model][parameter] = _parameter(entry, f"'{path}': {name}")
    return values


def _parameter(entry: Element, where: str) -> Parameter:
    for kind in ("Real", "Integer"):
        child = entry.find(f"{{{SSV}}}{kind}")
        if child is not None:
            return Parameter(
                _number(child.get("value", ""), f"{where}: its value is not a number"),
                child.get("unit"),
                entry.get("description", ""),
            )
    raise InputError(f"{where}: its value is not a number")


def _number(text: str, message: str) -> float:
    value = real(text)
    if value is None:
        raise InputError(message)
    return value


def _exponents(base: Element, where: str) -> dict[str, float]:
    found = {key: _number(text, f"{where}: {key} is not a number") for key, text in base.items()}
    if found.get("factor") == 0.0:
        raise InputError(f"{where}: its factor is zero")
    return found


def write_parameters(path: str | Path, content: ParameterSet) -> None:
    """Write a parameter set as an SSP 1.0 file, numbers to the last digit, completely or not at all.

    Args:
        path: the file, whose folder is made; an older one is replaced.
        content: its ``units`` must define every unit that a value states.

    Raises:
        InputError: a value is no :class:`Parameter`, or not finite; nothing is written.
    """
    ElementTree.register_namespace("ssv", SSV)
    ElementTree.register_namespace("ssc", SSC)
    root = Element(f"{{{SSV}}}ParameterSet", version="1.0", name=content.name)
    _write_entries(root, _named(content.values))
    if content.units:
        units = SubElement(root, f"{{{SSV}}}Units")
        for name, own in content.units.items():
            unit = SubElement(units, f"{{{SSC}}}Unit", name=name)
            SubElement(unit, f"{{{SSC}}}BaseUnit", {key: f"{value:.17g}" for key, value in own.items()})
    if content.beside or content.runs or content.learned_from:
        annotations = SubElement(root, f"{{{SSV}}}Annotations")
        if content.beside:
            _write_entries(SubElement(annotations, f"{{{SSC}}}Annotation", type=BESIDE), content.beside)
        for run, values in content.runs.items():
            own = SubElement(annotations, f"{{{SSC}}}Annotation", type=RUN)
            within = SubElement(own, f"{{{SSV}}}ParameterSet", version="1.0", name=run)
            _write_entries(within, _named(values))
        for stated in content.learned_from:
            within = SubElement(annotations, f"{{{SSC}}}Annotation", type=LEARNED)
            SubElement(within, CONTENT).text = json.dumps(stated)  # the standard wants an element
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n')


def _named(values: Values) -> dict[str, Parameter]:
    return {f"{m}.{p}": value for m, found in values.items() for p, value in found.items()}


def _write_entries(parent: Element, entries: Mapping[str, Parameter]) -> None:
    """The element ``Parameters`` with these entries."""
    listed = SubElement(parent, f"{{{SSV}}}Parameters")
    for name, given in entries.items():
        if not isinstance(given, Parameter):
            raise InputError(
                f"'{name}' is {given!r}, and no Parameter; write Parameter({given!r}, \"kg\")"
            )
        if not isfinite(given.value):
            raise InputError(f"'{name}' is {given.value}; a parameter set holds finite numbers")
        entry = SubElement(listed, f"{{{SSV}}}Parameter", name=name)
        if given.description:
            entry.set("description", given.description)
        real = SubElement(entry, f"{{{SSV}}}Real", value=repr(float(given.value)))
        if given.unit is not None:
            real.set("unit", given.unit)

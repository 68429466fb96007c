"""A modelDescription.xml of FMI 2.0 as it is written, with the defaults that the standard gives.

Lenient on purpose: what is malformed reads as None, so that every other rule can still look.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from xml.etree.ElementTree import Element

TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")


def number(text: str | None) -> float | None:
    """A finite or infinite number as XML writes it; None where there is none."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def whole(text: str | None) -> int | None:
    """An integer, or None."""
    try:
        return None if text is None else int(text)
    except ValueError:
        return None


def flag(text: str | None) -> bool:
    """A boolean attribute; absent is false."""
    return text in ("true", "1")


@dataclass(frozen=True, eq=False)
class DescribedVariable:
    """One ScalarVariable.

    Attributes:
        index: one-based place among the ScalarVariables.
        initial: as written, else the default of causality and variability; None where there is none.
        own: attributes of its Real, Integer, ... element.
        all: the same, completed by the declared type.
        items: values of the declared Enumeration.
    """

    index: int
    name: str
    reference: int | None
    type: str
    causality: str
    variability: str
    initial: str | None
    own: dict[str, str]
    all: dict[str, str]
    items: frozenset[int]

    @property
    def start(self) -> str | None:
        """As written."""
        return self.own.get("start")

    @property
    def derivative(self) -> int | None:
        """Index of the variable of which this is the derivative."""
        return whole(self.own.get("derivative"))

    @property
    def limits(self) -> tuple[float, float]:
        """(min, max), infinite where open."""
        low, high = number(self.all.get("min")), number(self.all.get("max"))
        return (-math.inf if low is None else low, math.inf if high is None else high)

    @property
    def settable(self) -> bool:
        """Whether a master may set it at some time of its life."""
        return self.variability != "constant" and (
            self.causality in ("input", "parameter") or self.initial in ("exact", "approx")
        )


@dataclass(frozen=True)
class Unknown:
    """One entry of the ModelStructure; None where the attribute is absent."""

    index: int | None
    dependencies: list[int | None] | None
    kinds: list[str] | None


class FmuDescription:
    """The whole description.

    Args:
        root: its root element.
    """

    def __init__(self, root: Element) -> None:
        self.root = root
        self.cs: dict[str, str] = dict(_first(root, "CoSimulation").attrib)
        self.experiment = _first(root, "DefaultExperiment").attrib
        self.units = list(root.iterfind("UnitDefinitions/Unit"))
        self.types = list(root.iterfind("TypeDefinitions/SimpleType"))

    def has(self, capability: str) -> bool:
        """Whether the FMU declares a capability of 4.3.1."""
        return flag(self.cs.get(capability))

    @cached_property
    def variables(self) -> list[DescribedVariable]:
        """All variables in order."""
        declared = {t.get("name"): t[0].attrib for t in self.types if len(t)}
        items = {t.get("name"): _items(t) for t in self.types}
        return [
            _variable(k, element, declared, items)
            for k, element in enumerate(self.root.iterfind("ModelVariables/ScalarVariable"), 1)
        ]

    def variable(self, index: int | None) -> DescribedVariable | None:
        """By one-based index; None if there is none."""
        if index is None or not 1 <= index <= len(self.variables):
            return None
        return self.variables[index - 1]

    def unknowns(self, element: str) -> list[Unknown] | None:
        """Entries of Outputs, Derivatives or InitialUnknowns; None without that element."""
        listed = self.root.find(f"ModelStructure/{element}")
        if listed is None:
            return None
        return [
            Unknown(
                whole(u.get("index")), _indices(u.get("dependencies")), _words(u, "dependenciesKind")
            )
            for u in listed.iterfind("Unknown")
        ]

    def inputs(self) -> list[DescribedVariable]:
        """Variables with causality input."""
        return [v for v in self.variables if v.causality == "input"]

    def outputs(self) -> list[DescribedVariable]:
        """Variables with causality output."""
        return [v for v in self.variables if v.causality == "output"]

    def time(self) -> tuple[float, float]:
        """Start [s] and step [s] of the default experiment, made up where it is silent."""
        start = number(self.experiment.get("startTime")) or 0.0
        duration = number(self.experiment.get("stopTime", "inf")) or 0.0
        duration -= start
        step = number(self.experiment.get("stepSize")) or 0.0
        if not 0.0 < step < math.inf:
            step = duration / 100.0 if 0.0 < duration < math.inf else 0.01
        return start, step


def _first(root: Element, tag: str) -> Element:
    found = root.find(tag)
    return Element(tag) if found is None else found


def _words(element: Element, attribute: str) -> list[str] | None:
    text = element.get(attribute)
    return None if text is None else text.split()


def _indices(text: str | None) -> list[int | None] | None:
    return None if text is None else [whole(word) for word in text.split()]


def _items(declared: Element) -> frozenset[int]:
    values = [whole(item.get("value")) for item in declared.iterfind("Enumeration/Item")]
    return frozenset(value for value in values if value is not None)


def _default_of_initial(causality: str, variability: str) -> str | None:
    """Default of ``initial`` (table in 2.2.7); None where there is none."""
    if causality in ("input", "independent"):
        return None
    return "exact" if causality == "parameter" or variability == "constant" else "calculated"


def _variable(
    index: int,
    element: Element,
    declared: dict[str | None, dict[str, str]],
    items: dict[str | None, frozenset[int]],
) -> DescribedVariable:
    kinds = [child for child in element if child.tag in TYPES]
    own = dict(kinds[0].attrib) if kinds else {}
    causality = element.get("causality", "local")
    variability = element.get("variability", "continuous")
    return DescribedVariable(
        index,
        element.get("name", ""),
        whole(element.get("valueReference")),
        kinds[0].tag if kinds else "",
        causality,
        variability,
        element.get("initial", _default_of_initial(causality, variability)),
        own,
        {**declared.get(own.get("declaredType"), {}), **own},
        items.get(own.get("declaredType"), frozenset()),
    )

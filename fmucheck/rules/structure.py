"""The model structure (2.2.8)."""

from collections.abc import Iterator, Sequence

from ..description import DescribedVariable, FmuDescription, Unknown
from ..fmu import FmuArchive
from ..registry import rule
from .header import twice

ELEMENTS = ("Outputs", "Derivatives", "InitialUnknowns")
KINDS = ("dependent", "constant", "fixed", "tunable", "discrete")


def _listed(description: FmuDescription, element: str) -> list[str]:
    found = [description.variable(u.index) for u in description.unknowns(element) or []]
    return [v.name for v in found if v is not None]


def _without(names: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those that are not among the others, in order."""
    known = set(others)
    return [name for name in names if name not in known]


@rule("2.2.8")
def outputs(fmu: FmuArchive) -> Iterator[str]:
    """Outputs lists every variable with causality output and no other; without outputs it is absent."""
    description = fmu.description
    unknowns = description.unknowns("Outputs")
    listed, meant = _listed(description, "Outputs"), [v.name for v in description.outputs()]
    yield from (f"{name} is an output, but not listed" for name in _without(meant, listed))
    yield from (f"{name} is listed, but is not an output" for name in _without(listed, meant))
    if unknowns is not None and not unknowns:
        yield "Outputs exists, but is empty"


@rule("2.2.8")
def state_derivatives(fmu: FmuArchive) -> Iterator[str]:
    """Derivatives lists only variables with the attribute derivative, and all of them if
    directional derivatives need them.
    """
    description = fmu.description
    unknowns = description.unknowns("Derivatives")
    listed = _listed(description, "Derivatives")
    meant = [v.name for v in description.variables if "derivative" in v.own]
    for name in _without(listed, meant):
        yield f"{name} is listed, but has no attribute derivative"
    exchange = description.root.find("ModelExchange") is not None
    if exchange or description.has("providesDirectionalDerivative"):
        for name in _without(meant, listed):
            yield f"{name} is a derivative, but not listed"
    if unknowns is not None and not unknowns:
        yield "Derivatives exists, but is empty"


@rule("2.2.8")
def initial_unknowns(fmu: FmuArchive) -> Iterator[str]:
    """InitialUnknowns lists, in ascending order, the outputs, states and derivatives that are
    calculated or approx, and all calculated parameters.
    """
    description = fmu.description
    meant = {v.index for v in description.variables if v.causality == "calculatedParameter"}
    unsettled = [v for v in description.outputs() if v.initial in ("calculated", "approx")]
    # States of co-simulation count where Derivatives tells of them, and only there.
    for unknown in description.unknowns("Derivatives") or []:
        v = description.variable(unknown.index)
        pair = [v, description.variable(v.derivative)] if v else []
        unsettled += [x for x in pair if x and x.initial in ("calculated", "approx")]
    meant |= {v.index for v in unsettled}
    unknowns = description.unknowns("InitialUnknowns")
    listed = [u.index for u in unknowns or []]
    missing, surplus = meant.difference(listed), set(listed) - meant
    for v in description.variables:
        if v.index in missing:
            yield f"{v.name} is missing"
        if v.index in surplus:
            yield f"{v.name} does not belong there"
    known = [k for k in listed if k is not None]
    if known != sorted(known):
        yield "the entries are not in ascending order"
    if unknowns is not None and not unknowns:
        yield "InitialUnknowns exists, but is empty"


@rule("2.2.8")
def structure(fmu: FmuArchive) -> Iterator[str]:
    """Each entry is a variable that occurs once; so are its dependencies, in ascending order and
    with one kind each.
    """
    description = fmu.description
    for element in ELEMENTS:
        unknowns = description.unknowns(element) or []
        for index in twice(str(u.index) for u in unknowns):
            yield f"{element} lists variable {index} twice"
        for unknown in unknowns:
            v = description.variable(unknown.index)
            if v is None:
                yield f"{element} lists variable {unknown.index}, which does not exist"
            else:
                where = f"{v.name} in {element}"
                yield from (f"{where}: {text}" for text in _lists(description, unknown))


def _lists(description: FmuDescription, unknown: Unknown) -> Iterator[str]:
    dependencies, kinds = unknown.dependencies, unknown.kinds
    if dependencies is None:
        if kinds is not None:
            yield "dependenciesKind without dependencies"
        return
    for index in dependencies:
        if description.variable(index) is None:
            yield f"it depends on variable {index}, which does not exist"
    for index in twice(map(str, dependencies)):
        yield f"it depends on variable {index} twice"
    known = [d for d in dependencies if d is not None]
    if known != sorted(known):
        yield "its dependencies are not in ascending order"
    if kinds is not None and len(kinds) != len(dependencies):
        yield f"{len(kinds)} kinds for {len(dependencies)} dependencies"


@rule("2.2.8")
def dependencies(fmu: FmuArchive) -> Iterator[str]:
    """Dependencies are on known quantities: inputs, states and time; at initialisation inputs,
    exact values and time.
    """
    description = fmu.description
    states = {v.derivative for v in description.variables if "derivative" in v.own}
    for element in ELEMENTS:
        for unknown in description.unknowns(element) or []:
            v = description.variable(unknown.index)
            if v is None:
                continue
            for k, index in enumerate(unknown.dependencies or []):
                known = description.variable(index)
                if known is None:
                    continue
                if not _is_known(known, element, states):
                    yield f"{v.name} in {element} depends on {known.name}, which is not known there"
                if unknown.kinds is not None and k < len(unknown.kinds):
                    yield from _kind(v, known, element, unknown.kinds[k])


def _is_known(v: DescribedVariable, element: str, states: set[int | None]) -> bool:
    if v.causality in ("input", "independent"):
        return True
    return v.initial == "exact" if element == "InitialUnknowns" else v.index in states


def _kind(v: DescribedVariable, known: DescribedVariable, element: str, kind: str) -> Iterator[str]:
    where = f"{v.name} in {element}: the kind of {known.name}"
    if kind not in KINDS:
        yield f"{where} is '{kind}'"
    elif element == "InitialUnknowns" and kind not in ("dependent", "constant"):
        yield f"{where} is {kind}; only dependent and constant are allowed at initialisation"
    elif kind != "dependent" and not v.type == known.type == "Real":
        yield f"{where} is {kind}, but not both are Real"

"""The dependencies in the model structure (2.2.8)."""

from collections.abc import Iterator

from ..description import DescribedVariable
from ..fmu import FmuArchive
from ..registry import rule

ELEMENTS = ("Outputs", "Derivatives", "InitialUnknowns")
KINDS = ("dependent", "constant", "fixed", "tunable", "discrete")


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

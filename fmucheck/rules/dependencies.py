"""Dependencies held against what the FMU does when one value is changed (2.2.8)."""

from collections.abc import Iterator, Sequence

from ..api import StatusError
from ..description import DescribedVariable, Unknown
from ..fmu_on_trial import FmuOnTrial, near, other, same, start_value
from ..registry import NotApplicableError, trial

# Two short steps, as shares of the usual one.
SHORT, SHORTER = 1e-3, 1e-6


def _told(fmu: FmuOnTrial, element: str) -> list[tuple[DescribedVariable, set[int | None]]]:
    """Real unknowns that list their dependencies, with those; without a list, any may be."""
    listed: list[Unknown] = fmu.description.unknowns(element) or []
    pairs = [(fmu.description.variable(u.index), u.dependencies) for u in listed]
    return [(v, set(d)) for v, d in pairs if v is not None and v.type == "Real" and d is not None]


@trial("2.2.8")
def initial_dependencies(fmu: FmuOnTrial) -> Iterator[str]:
    """During initialisation an unknown changes only with its dependencies in InitialUnknowns."""
    stated = _told(fmu, "InitialUnknowns")
    unknowns = [v for v, _ in stated]
    one = fmu.initialising()
    for known in fmu.description.variables:
        if known.type != "Real" or not (known.causality == "input" or known.initial == "exact"):
            continue
        if not known.settable or start_value(known) is None:
            continue
        moved: set[str] = set()
        for share in (1.0, -0.3):
            before = one.get(unknowns)
            one.set({known: near(known, share)})
            moved |= _moved(unknowns, before, one.get(unknowns))
            one.set({known: start_value(known)})
        yield from _undeclared(stated, known, moved, "while initialising")
    one.free()


@trial("2.2.8")
def output_dependencies(fmu: FmuOnTrial) -> Iterator[str]:
    """At a communication point, before the next step, an output depends only on inputs that it lists."""
    stated = _told(fmu, "Outputs")
    outputs = [v for v, _ in stated]
    one = fmu.ready()
    fmu.play(one, 5, seed=0)
    for v in fmu.description.inputs():
        if v.type != "Real":
            continue
        (usual,) = one.get([v])
        before = one.get(outputs)
        one.set({v: other(v, usual)})
        yield from _undeclared(stated, v, _moved(outputs, before, one.get(outputs)), "without a step")
        one.set({v: usual})


@trial("2.2.7, 2.2.8")
def step_dependencies(fmu: FmuOnTrial) -> Iterator[str]:
    """Over a step of vanishing length an output depends only on inputs that it lists, or that are
    discrete: by convention these act at communication points.

    What follows an input through a state shrinks with the step, what follows it directly does not.
    """
    fmu.needs("canHandleVariableCommunicationStepSize")
    stated = _told(fmu, "Outputs")
    outputs = [v for v, _ in stated]
    usual = [_after(fmu, outputs, share) for share in (SHORT, SHORTER)]
    for v in fmu.description.inputs():
        if v.type != "Real" or v.variability != "continuous":
            continue
        changed = [_after(fmu, outputs, share, v) for share in (SHORT, SHORTER)]
        moved = set()
        for k, output in enumerate(outputs):
            large, small = (abs(b[k] - a[k]) for a, b in zip(usual, changed, strict=True))
            if small > 1e-8 * max(1.0, abs(usual[1][k])) and small > 0.1 * large:
                moved.add(output.name)
        yield from _undeclared(stated, v, moved, "over a step of no length")


def _after(
    fmu: FmuOnTrial,
    outputs: Sequence[DescribedVariable],
    share: float,
    changed: DescribedVariable | None = None,
) -> list[float]:
    """Outputs of a new instance after some steps and a short one, for which one input may be changed."""
    one = fmu.ready()
    fmu.play(one, 3, seed=0)
    if changed is not None:
        (usual,) = one.get([changed])
        one.set({changed: other(changed, usual)})
    try:
        one.step(fmu.start + 3 * fmu.step, share * fmu.step)
    except StatusError as refused:
        raise NotApplicableError(f"the FMU refuses so short a step: {refused}") from None
    found = one.get(outputs)
    one.free()
    return found


def _moved(
    names: Sequence[DescribedVariable], before: Sequence[float], after: Sequence[float]
) -> set[str]:
    return {v.name for v, a, b in zip(names, before, after, strict=True) if not same(a, b)}


def _undeclared(
    stated: Sequence[tuple[DescribedVariable, set[int | None]]],
    known: DescribedVariable,
    moved: set[str],
    when: str,
) -> Iterator[str]:
    for unknown, dependencies in stated:
        if unknown.name in moved and known.index not in dependencies:
            yield f"{unknown.name} depends on {known.name} {when}, but does not list it"

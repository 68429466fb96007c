"""Dependencies held against what the FMU does when one value is changed (2.2.8)."""

from collections.abc import Iterator, Sequence

from ..bench import Bench, near, same, start_value
from ..description import Unknown, Variable
from ..registry import trial


def _told(bench: Bench, element: str) -> list[tuple[Variable, set[int | None]]]:
    """Real unknowns that list their dependencies, with those; without a list, any may be."""
    listed: list[Unknown] = bench.description.unknowns(element) or []
    pairs = [(bench.description.variable(u.index), u.dependencies) for u in listed]
    return [(v, set(d)) for v, d in pairs if v is not None and v.type == "Real" and d is not None]


@trial("2.2.8")
def initial_dependencies(bench: Bench) -> Iterator[str]:
    """While initialising, an unknown changes only with what its dependencies in InitialUnknowns list."""
    told = _told(bench, "InitialUnknowns")
    unknowns = [v for v, _ in told]
    one = bench.initialising()
    for known in bench.description.variables:
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
        yield from _undeclared(told, known, moved, "while initialising")
    one.free()


@trial("2.2.8")
def output_dependencies(bench: Bench) -> Iterator[str]:
    """At a communication point, before the next step, an output changes only with inputs that it lists.

    What an input does during a step goes through the state, and is nothing that Outputs would list.
    """
    told = _told(bench, "Outputs")
    outputs = [v for v, _ in told]
    one = bench.ready()
    bench.play(one, 5, seed=0)
    for v in bench.description.inputs():
        if v.type != "Real":
            continue
        (usual,) = one.get([v])
        before = one.get(outputs)
        one.set({v: _other(v, usual)})
        yield from _undeclared(told, v, _moved(outputs, before, one.get(outputs)), "without a step")
        one.set({v: usual})


def _other(v: Variable, value: float) -> float:
    """A value of an input that is not the one it has."""
    changed = near(v, 1.0)
    return near(v, -0.5) if same(changed, value) else changed


def _moved(names: Sequence[Variable], before: Sequence[float], after: Sequence[float]) -> set[str]:
    return {v.name for v, a, b in zip(names, before, after, strict=True) if not same(a, b)}


def _undeclared(
    told: Sequence[tuple[Variable, set[int | None]]], known: Variable, moved: set[str], when: str
) -> Iterator[str]:
    for unknown, dependencies in told:
        if unknown.name in moved and known.index not in dependencies:
            yield f"{unknown.name} follows {known.name} {when}, but does not list it"

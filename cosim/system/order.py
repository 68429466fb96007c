"""Order of stepping in which a value travels as far as possible within one step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise


@dataclass(frozen=True)
class Link:
    """A connection from one instance's output to another's input."""

    source: str
    output: str
    target: str
    input: str

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"


def execution_order(
    instances: Sequence[str],
    links: Sequence[Link],
    feedthrough: Mapping[str, Mapping[str, Sequence[str]]],
) -> tuple[list[str], list[str]]:
    """Order for sequential stepping.

    An instance whose connected outputs follow an input at the same instant steps after the source of
    that input. Where only unconnected outputs follow it, the order is a preference, not a must.

    Args:
        instances: names in the order of the scenario, which breaks ties.
        links: all connections.
        feedthrough: for each instance, input -> outputs that follow it at the same instant.

    Returns:
        The order, and a warning for each loop that was cut: there, a value arrives one step late.
    """
    used = {(link.source, link.output) for link in links}
    hard: dict[tuple[str, str], list[Link]] = {}
    soft: dict[tuple[str, str], list[Link]] = {}
    for link in links:
        followers = feedthrough[link.target].get(link.input, [])
        sink = not any(feedthrough[link.target].values())
        if any((link.target, output) in used for output in followers):
            hard.setdefault((link.source, link.target), []).append(link)
        elif followers or sink:
            soft.setdefault((link.source, link.target), []).append(link)

    warnings: list[str] = []
    while True:
        try:
            return _sorted(instances, [*hard, *soft]), warnings
        except CycleError as error:
            nodes: list[str] = error.args[1]  # each steps before the next; the last is the first
            edges = list(pairwise(nodes))
        yielding = [edge for edge in edges if edge in soft and edge not in hard]
        if yielding:
            for edge in yielding:
                del soft[edge]
            continue
        late = min((e for e in edges if e in hard), key=lambda e: instances.index(e[1]))
        warnings.append(_explain(nodes, hard.pop(late), links, feedthrough))
        soft.pop(late, None)


def _sorted(instances: Sequence[str], edges: Sequence[tuple[str, str]]) -> list[str]:
    sorter: TopologicalSorter[str] = TopologicalSorter({name: [] for name in instances})
    for before, after in edges:
        sorter.add(after, before)
    sorter.prepare()
    order: list[str] = []
    ready: list[str] = []
    while sorter.is_active():
        ready += sorter.get_ready()
        ready.sort(key=instances.index)
        order.append(ready.pop(0))
        sorter.done(order[-1])
    return order


def _explain(
    nodes: Sequence[str],
    late: Sequence[Link],
    links: Sequence[Link],
    feedthrough: Mapping[str, Mapping[str, Sequence[str]]],
) -> str:
    """A warning that distinguishes an algebraic loop from an order that does not exist."""
    inside = set(nodes)
    variables: TopologicalSorter[tuple[str, str]] = TopologicalSorter()
    for link in links:
        if link.source in inside and link.target in inside:
            variables.add((link.target, link.input), (link.source, link.output))
            for output in feedthrough[link.target].get(link.input, []):
                variables.add((link.target, output), (link.target, link.input))
    where = ", ".join(map(str, late[:3])) + (", ..." if len(late) > 3 else "")
    try:
        variables.prepare()
    except CycleError as error:
        loop = " -> ".join(f"{instance}.{name}" for instance, name in error.args[1])
        return f"algebraic loop {loop}; opened at {where}, where the value is one step late"
    return (
        f"no order of {', '.join(sorted(inside))} gives every input the newest value; "
        f"{where} is one step late"
    )

"""The numbers of a traced component."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from fmus.fmi.trace import OPERATIONS, Symbol, ordered


def evaluated(results: Sequence[Any], points: Iterable[Mapping[str, Any]]) -> Iterator[list[Any]]:
    """What traced results are at each of several points, the values of the variables by name."""
    nodes = ordered(results)
    place = {id(node): k for k, node in enumerate(nodes)}
    fixed: list[Any] = []  # the arguments that are numbers; their places are counted from the end

    def place_of(arg: Any) -> int:
        if isinstance(arg, Symbol):
            return place[id(arg)]
        fixed.append(arg)
        return -len(fixed)

    steps = [
        (None, node.args[0])
        if node.operation == "variable"
        else (OPERATIONS[node.operation], [place_of(a) for a in node.args])
        for node in nodes
    ]
    wanted = [place_of(r) for r in results]
    for values in points:
        known = [None] * len(nodes) + fixed[::-1]
        for k, (operation, args) in enumerate(steps):
            known[k] = values[args] if operation is None else operation(*[known[a] for a in args])
        yield [known[k] for k in wanted]

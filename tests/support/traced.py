"""The numbers of a traced component."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from fmus.fmi.trace import OPERATIONS, Symbol, ordered


def evaluated(results: Sequence[Any], points: Iterable[Mapping[str, Any]]) -> Iterator[list[Any]]:
    """What traced results are at each of several points, the values of the variables by name."""
    nodes = ordered(results)
    for values in points:
        known: dict[int, Any] = {}
        for node in nodes:
            if node.operation == "variable":
                known[id(node)] = values[node.args[0]]
            else:
                args = [known[id(a)] if isinstance(a, Symbol) else a for a in node.args]
                known[id(node)] = OPERATIONS[node.operation](*args)
        yield [known[id(r)] if isinstance(r, Symbol) else r for r in results]

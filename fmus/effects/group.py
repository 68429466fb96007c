"""Effects that act together in one component: their parameters as one NamedTuple class."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from ..declare import Fields, Variable, group_of
from ..ops import Condition, when
from .effect import Effect


class Member(NamedTuple):
    """An effect in a group: where its parameters and its coefficients lie among the group's."""

    effect: Effect
    parameters: slice
    coefficients: tuple[int, ...]

    def acting(self, values: Fields) -> Condition:
        """Whether any coefficient is not zero, for the group's parameters."""
        return _any(self.coefficients, values)

    def apply(self, acts: Condition, values: Fields, otherwise: object, *at: object) -> Any:
        """What the effect makes of its leading arguments.

        Args:
            acts: whether it acts, from :meth:`acting`.
            values: the group's parameters.
            otherwise: what holds without the effect.
            at: the leading arguments of the effect's function.
        """
        if acts is False:  # as most effects do, most of the time
            return otherwise
        function = self.effect.function
        assert function is not None
        return when(acts, lambda: function(*at, *values[self.parameters]), lambda: otherwise)


class Group(NamedTuple):
    """Effects that act together in one component, and the NamedTuple class of their parameters."""

    params: type[Fields]
    members: tuple[Member, ...]

    def acting(self, values: Fields) -> tuple[Condition, ...]:
        """For each effect whether it acts, for the group's parameters."""
        return tuple([member.acting(values) for member in self.members])

    def any_acts(self, values: Fields) -> Condition:
        """Whether any effect acts, for the group's parameters."""
        return _any([k for member in self.members for k in member.coefficients], values)


def group(typename: str, chosen: Iterable[Effect]) -> Group:
    """The parameters of some effects as a NamedTuple class for a component."""
    members: list[Member] = []
    found: list[Variable] = []
    for e in chosen:
        first = len(found)
        found += e.parameters
        which = tuple(k for k, p in enumerate(e.parameters, first) if p.name in e.coefficients)
        members.append(Member(e, slice(first, len(found)), which))
    return Group(group_of(typename, found), tuple(members))


def _any(coefficients: Iterable[int], values: Fields) -> Condition:
    """Whether any of some values is not zero."""
    total = 0.0
    for k in coefficients:
        total = total + abs(values[k])
    return total > 0.0

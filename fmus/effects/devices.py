"""Actuators that an effect concerns, and what their effects are made with.

What may go wrong with actuators is declared once, for :class:`Devices`, and made for those of each ship:
:mod:`.lost_force`, :mod:`.own_curves`, :mod:`.misplaced`, :mod:`.all_thrusters`. The effects act on
:class:`~fmus.effects.effect.Thrust`, the forces of all actuators, one after the other. Which of them a
ship has :mod:`fmus.actuators.failings` says.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..declare import Range, Variable
from ..ops import Number
from ..scale import REFERENCE, Scale
from .effect import Effect, EffectFunction, Picture, Shows, Thrust, Wording, effect
from .families import Family
from .text import Found, capital

ANY = Range()
SHARE = Range(-1.0, 1.0)


class Devices(NamedTuple):
    """Actuators that an effect concerns.

    Attributes:
        name: in ids and parameters.
        title: in sentences.
        label: in descriptions of parameters.
        members: numbers of the actuators.
        commands: for each of these the number in :attr:`.effect.Running.part` of the command that makes
            its force on each axis, X and Y.
        axis: axes on which their force may act.
        family: the manoeuvre that brings out what is wrong with them.
        full: the largest force of one of them at rest [N].
        strength: name of the parameter that is this force; empty: there is none.
        plural: whether the title is of several.
        scale: of the ship.
        apart: whether their effects show only where each unit has commands of its own.
    """

    name: str
    title: str
    label: str
    members: tuple[int, ...]
    commands: tuple[tuple[int, int], ...]
    axis: str
    family: Family
    full: float = 0.0
    strength: str = ""
    plural: bool = False
    scale: Scale = REFERENCE
    apart: bool = False

    def does(self, verb: str, article: str = "The") -> str:
        """Subject and verb of a sentence, such as ``The propellers give``."""
        return f"{article} {self.title} {verb if self.plural else f'{verb}s'}"

    def picture(self, what: Shows, axis: str = "") -> Picture:
        """A picture of the force along an axis, by default the first that it acts on."""
        axis = axis or self.axis[0]
        return Picture(what, capital(self.title), self.members, self.commanding(axis), axis)

    def commanding(self, axis: str) -> tuple[int, ...]:
        """For each actuator the number of the command that makes its force along an axis."""
        return tuple([pair["XY".index(axis)] for pair in self.commands])


def with_one(values: tuple[Number, ...], k: int, value: Number) -> tuple[Number, ...]:
    """The values with another one at place k."""
    return (*values[:k], value, *values[k + 1 :])


def pushed(f: Thrust, k: int, X: Number, Y: Number) -> Thrust:
    """The forces with others of actuator k."""
    return f._replace(X=with_one(f.X, k, X), Y=with_one(f.Y, k, Y))


def replaced(
    values: tuple[Number, ...], members: Sequence[int], change: Callable[[Number], Number]
) -> tuple[Number, ...]:
    """The values with some changed; those that are one object, as of actuators alike, only once."""
    known = {id(values[k]): values[k] for k in members}
    after = {key: change(x) for key, x in known.items()}
    return tuple([after[id(x)] if k in members else x for k, x in enumerate(values)])


def by_command(
    f: Thrust,
    members: Sequence[int],
    axis: str,
    parts: Sequence[Number],
    change: Callable[[Number, Number], Number],
) -> Thrust:
    """The forces with those of some actuators along an axis changed, each by its command.

    Args:
        f: the forces.
        members: the actuators.
        axis: X or Y.
        parts: command of each of these; those that are one object are of actuators alike.
        change: ``change(force, command)``: the force instead.
    """
    known: dict[tuple[int, int], Number] = {}
    after = list(getattr(f, axis))
    for k, c in zip(members, parts, strict=True):
        key = id(after[k]), id(c)
        if key not in known:
            known[key] = change(after[k], c)
        after[k] = known[key]
    return f._replace(X=tuple(after)) if axis == "X" else f._replace(Y=tuple(after))


def changed(f: Thrust, members: Sequence[int], change: Callable[[Number], Number]) -> Thrust:
    """The forces with both components of some actuators changed, and their couples alike."""
    couple = replaced(f.couple, members, change) if f.couple else ()
    return f._replace(X=replaced(f.X, members, change), Y=replaced(f.Y, members, change), couple=couple)


def added(f: Thrust, members: Sequence[int], axis: str, extra: Number) -> Thrust:
    """The forces with more of some actuators [N], each along an axis."""
    more = replaced(getattr(f, axis), members, lambda x: x + extra)
    return f._replace(X=more) if axis == "X" else f._replace(Y=more)


def parameter(name: str, unit: str, text: str, limits: Range = ANY) -> Variable:
    """A parameter that is zero where there is no effect."""
    return Variable(name, unit, text, 0.0, limits)


def declared(
    d: Devices,
    id: str,  # noqa: A002
    parameters: tuple[Variable, ...],
    sentence: Callable[[Found], str],
    *,
    axis: str = "",
    apart: dict[str, str] | None = None,
    pictures: tuple[Picture, ...] = (),
    measured: Callable[[float, Callable[[str], float]], str] | None = None,
    **more: Any,
) -> Callable[[EffectFunction], Effect]:
    """The decorator that makes an effect of actuators.

    Args:
        d: the actuators.
        id, axis, parameters: of the effect; by default it acts on the axes of the actuators.
        sentence, apart, pictures, measured: see :class:`~fmus.effects.effect.Wording`.
        more: further arguments of :func:`~fmus.effects.effect.effect`.
    """
    wording = Wording(sentence, d.family, apart or {}, pictures, measured)
    return effect(
        id, "actuator", axis or d.axis, parameters=parameters, wording=wording, apart=d.apart, **more
    )

"""What a law of an actuator is: from its commands and the flow at its place to a force on the hull.

A law is one subclass of :class:`Law`, which registers itself by its name. It is written with the
operations of :mod:`fmus.ops`, so that it runs on floats, arrays and symbols.
"""

from typing import Any, ClassVar, NamedTuple

from ..declare import DeclarationError
from ..ops import Number

Span = tuple[Any, Any]


class Command(NamedTuple):
    """One command of an actuator; an angle has the name of the parameter that limits it to either side.

    Where that limit is half a turn or more, the angle goes round by the shorter way.
    """

    name: str
    unit: str
    description: str
    angle_limit: str = ""


class Flow(NamedTuple):
    """Velocity [m/s, m/s] of the actuator's place through the water, along the ship's axes."""

    u: Any = 0.0
    v: Any = 0.0


class Law:
    """A kind of actuator.

    Attributes:
        name: by which descriptions call it.
        commands: that it gets.
        components: axes X and Y of the force that it can be asked for; empty: it is not asked.
        limiting: parameters that are limits of commands, which are not fitted.
        Parameters: NamedTuple class of its parameters, of which the place has its own.
    """

    name: ClassVar[str]
    commands: ClassVar[tuple[Command, ...]]
    components: ClassVar[str] = ""
    limiting: ClassVar[tuple[str, ...]] = ("n_max", "n_min")
    Parameters: ClassVar[type[Any]]
    known: ClassVar[dict[str, type["Law"]]] = {}

    def __init_subclass__(cls) -> None:
        taken = Law.known.get(cls.name)
        if taken is not None and taken.__module__.startswith(f"{__package__}."):
            raise DeclarationError(f"there is a law '{cls.name}' already")
        Law.known[cls.name] = cls

    @staticmethod
    def limits(p: Any) -> tuple[Span, ...]:
        """For each command the lowest and the highest value."""
        raise NotImplementedError

    @staticmethod
    def force(commands: tuple[Any, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        """Force on the hull (X, Y) [N, N], for commands within their limits."""
        raise NotImplementedError

    @staticmethod
    def reach(flow: Flow, p: Any) -> tuple[Span, ...]:
        """For each of ``components`` the lowest and the highest force [N]."""
        raise NotImplementedError

    @staticmethod
    def commanded(forces: tuple[Any, ...], flow: Flow, p: Any) -> tuple[Any, ...]:
        """The commands that give a force on each of ``components`` [N], within their reach."""
        raise NotImplementedError

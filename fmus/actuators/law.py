"""What a law of an actuator is: from its commands and the flow at its place to a force on the hull.

A law is one subclass of :class:`Law`, which registers itself by its name. It is written with the
operations of :mod:`fmus.ops`, so that it runs on floats, arrays and symbols.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from ..declare import DeclarationError
from ..effects.families import Family
from ..hull_functions import Change
from ..ops import Number
from ..ship_description import Part

Span = tuple[Number, Number]
P = TypeVar("P", bound=tuple[Number, ...])  # parameters of a law


class Command(NamedTuple):
    """One command of an actuator; an angle has the name of the parameter that limits it to either side.

    Where that limit is half a turn or more, the angle goes round by the shorter way.
    """

    name: str
    unit: str
    description: str
    angle_limit: str = ""


class Race(NamedTuple):
    """What a propeller makes of the water behind it.

    Attributes:
        inflow: speed of the water that it meets [m/s].
        jet: speed of its race far behind it [m/s], by momentum theory.
        diameter: of the propeller [m].
        added: 8 T / (pi rho D^2) [m2/s2], what the thrust T adds to the square of the speed.
        n: shaft speed [1/s], negative where it turns astern.
    """

    inflow: Number
    jet: Number
    diameter: Number
    added: Number = 0.0
    n: Number = 0.0


class Flow(NamedTuple):
    """Velocity [m/s, m/s] of the actuator's place through the water, along the ship's axes.

    ``hull_u`` and ``hull_v`` are those of the ship's origin, to which publications refer angles of
    drift, ``r`` [rad/s] is the yaw rate; ``race`` is that of the propeller in front, where there is one.
    """

    u: Number = 0.0
    v: Number = 0.0
    hull_u: Number = 0.0
    hull_v: Number = 0.0
    r: Number = 0.0
    race: Race | None = None


class Law(Generic[P]):
    """A kind of actuator.

    Attributes:
        name: by which descriptions call it.
        strength: parameter that is its full force; empty: none is.
        commands: that it gets.
        components: axes X and Y of the force that it can be asked for; empty: it is not asked.
        pushes: axes X and Y of the force that it has; empty: those of ``components``.
        limiting: parameters that are limits of commands, which are not fitted.
        changes: what a ship may have otherwise than described.
        in_race: whether it works in the race of a propeller; has_race: whether it has one itself.
        has_couple: whether it turns the ship by more than its force at its place.
        measurable: what can be measured of it beside its commands -> unit.
        by_axis: whether its first command pushes ahead and its last one to starboard.
        powered: whether its force is scaled by a power setting.
        proportional: whether its force is in proportion to its commands.
        family: the manoeuvre that shows its effects; None: one of its own.
        allocated: law by which its commands are allocated; None: itself.
        variants: name of another form of its force over the command -> the law of that form.
        Parameters: NamedTuple class of its parameters, of which the place has its own.
    """

    name: ClassVar[str]
    strength: ClassVar[str] = ""
    commands: ClassVar[tuple[Command, ...]]
    components: ClassVar[str] = ""
    pushes: ClassVar[str] = ""
    limiting: ClassVar[tuple[str, ...]] = ("n_max", "n_min")
    changes: ClassVar[tuple[Change, ...]] = ()
    in_race: ClassVar[bool] = False
    has_race: ClassVar[bool] = False
    has_couple: ClassVar[bool] = False
    measurable: ClassVar[Mapping[str, str]] = {}
    by_axis: ClassVar[bool] = False
    powered: ClassVar[bool] = False
    proportional: ClassVar[bool] = False
    family: ClassVar[Family | None] = None
    allocated: ClassVar["type[Law] | None"] = None
    variants: ClassVar[Mapping[str, str]] = {}
    Parameters: ClassVar[type[Any]]
    known: ClassVar[dict[str, type["Law"]]] = {}

    def __init_subclass__(cls) -> None:
        taken = Law.known.get(cls.name)
        if taken is not None and taken.__module__.startswith(f"{__package__}."):
            raise DeclarationError(f"there is a law '{cls.name}' already")
        Law.known[cls.name] = cls
        super().__init_subclass__()

    @classmethod
    def limits(cls, p: P) -> tuple[Span, ...]:
        """For each command the lowest and the highest value."""
        raise NotImplementedError

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: P) -> tuple[Number, Number]:
        """Force on the hull (X, Y) [N, N], for commands within their limits."""
        raise NotImplementedError

    @classmethod
    def acts_at(cls, x: Number, p: P) -> Number:
        """Where along the ship [m] the force of an actuator at x [m] acts."""
        return x

    @classmethod
    def couple(cls, commands: tuple[Number, ...], flow: Flow, p: P) -> Number:
        """Yaw moment on the hull [N m], beside that of its force where it acts."""
        return 0.0

    @classmethod
    def race(cls, commands: tuple[Number, ...], flow: Flow, p: P) -> Race | None:
        """Its race; None: it has none that others could work in."""
        return None

    @classmethod
    def measured(cls, part: Part) -> Mapping[str, str]:
        """Those of ``measurable`` of which a description tells enough."""
        return cls.measurable

    @classmethod
    def output(cls, name: str, commands: tuple[Number, ...], flow: Flow, p: P) -> Number:
        """One of ``measurable``, in its unit."""
        raise NotImplementedError

    @classmethod
    def reach(cls, flow: Flow, p: P) -> tuple[Span, ...]:
        """For each of ``components`` the lowest and the highest force [N]."""
        return ()

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: P) -> tuple[Number, ...]:
        """The commands that give a force on each of ``components`` [N], within their reach."""
        raise NotImplementedError

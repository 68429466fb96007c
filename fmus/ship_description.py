"""The description of a ship, as every component reads it: plain nested tuples of texts and numbers.

Its ``repr`` is Python that makes it again, which is how an FMU carries the ship that it was built for.
Files are read by :mod:`fmus.ships.ship_file`.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from .declare import Known, ShipOutline, Variable
from .scale import REFERENCE_LENGTH, Scale

GUESSED = "guessed"  # origin of a number of which a file gives none


class Value(NamedTuple):
    """A number of a description, and how well it is known.

    Attributes:
        name: of the parameter.
        value: in the parameter's unit.
        origin: where it comes from: weighed, tank test, borrowed, guessed, or a publication.
        share: standard deviation, as a share of the value.
        std: the same in the parameter's unit, where a file states that; 0: the share holds.
    """

    name: str
    value: float
    origin: str
    share: float
    std: float = 0.0

    def known(self, group: str) -> Known:
        """Where it comes from, for the declaration of a parameter of some group."""
        return Known(group, self.origin, self.share, self.std)

    def of(self, v: Variable, group: str) -> Variable:
        """The declaration of a parameter that starts at this value.

        A zero without a standard deviation stays zero; one of stated origin is a coefficient where
        another model of the ship has it.
        """
        stated = self.value != 0.0 or self.std or self.origin != GUESSED
        return replace(v, start=self.value, known=self.known(group) if stated else None)


class Part(NamedTuple):
    """What a description names by the law that it follows: an actuator, or a function of the hull.

    Attributes:
        name: of the actuator; of a function of the hull that of the law.
        law: see :mod:`fmus.actuators.laws` and :mod:`fmus.hull_functions`.
        title: its name in sentences.
        values: of its parameters; what is not named is as the law declares it.
        order: name of the commands that it shares with others; empty: they have its own name.
        behind: actuator in whose race it works; empty: in none.
        label: its name in descriptions of variables; empty: the title.
    """

    name: str
    law: str
    title: str
    values: tuple[Value, ...]
    order: str = ""
    behind: str = ""
    label: str = ""

    def number(self, name: str, otherwise: float = 0.0) -> float:
        """A number of the part, by its name."""
        stated = self.stated(name)
        return otherwise if stated is None else stated.value

    def stated(self, name: str) -> Value | None:
        """The value of a parameter of the part; None: it is as the law declares it."""
        return next((v for v in self.values if v.name == name), None)


class Description(NamedTuple):
    """A ship.

    Attributes:
        name: by which it is called, as ``--ship`` has it.
        title: its name for people.
        source: publications that its numbers are from.
        length: L_pp [m], which sets the scale of the ship.
        beam: [m].
        outline: corners (forward, to starboard) [m, m] of the waterline, from the body origin.
        inertia: parameters of :class:`fmus.hull.Inertia`.
        terms: damping coefficients, each named by its axis and its product of speeds.
        functions: damping that is no product of speeds.
        actuators: what drives it, in the order of its commands.
        allocates: whether its thrusters get a force to give; else commands of each actuator.
        wind: what is above the water, numbers of :mod:`fmus.ships.wind`; empty: not known.
        effects: effects of its actuators, ``KIND ACTUATOR`` or ``KIND``, in the order in which they act;
            empty: all that each actuator may have, see :mod:`fmus.actuators.failings`.
        aliases: (name, alias) of variables of its actuators; a name also stands for the beginning of
            longer ones, and ``each_`` before that of a command means it where each unit has its own.
        wind_measured: whether the wind over time is an input of the vessel, and of predictions.
    """

    name: str
    title: str
    source: str
    length: float
    beam: float
    outline: tuple[tuple[float, float], ...]
    inertia: tuple[Value, ...]
    terms: tuple[Value, ...]
    functions: tuple[Part, ...] = ()
    actuators: tuple[Part, ...] = ()
    allocates: bool = True
    wind: tuple[Value, ...] = ()
    effects: tuple[str, ...] = ()
    aliases: tuple[tuple[str, str], ...] = ()
    wind_measured: bool = False

    @property
    def scale(self) -> Scale:
        """Its size beside that of CyberShip Enterprise 1."""
        return Scale(self.length / REFERENCE_LENGTH)

    @property
    def drawn(self) -> ShipOutline:
        """What pictures need of it."""
        return ShipOutline(self.name, self.length, self.outline)

    def called(self, name: str) -> str:
        """The alias of a variable of its actuators, or its name where there is none."""
        known = dict(self.aliases)
        if name in known:
            return known[name]
        stem = next((s for s in known if name.startswith(f"{s}_")), "")
        return known[stem] + name[len(stem) :] if stem else name

    def values(self) -> Mapping[str, Value]:
        """Numbers of the hull, by the name of the parameter."""
        return {v.name: v for v in (*self.inertia, *self.terms)}

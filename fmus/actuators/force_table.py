"""Actuators whose force was measured at some commands: a table, read by straight lines."""

from itertools import pairwise

from ..declare import Fields, Variable, group_of
from ..effects.curve import interpolate
from ..ops import Number, clip, fmax
from .law import Command, Flow, Law, Span
from .laws import SMALL

NODES = 11  # of the table, from command -1 to 1


def _forces(way: str) -> type[Fields]:
    """The force at each node; a straight line of one newton as it starts."""
    at = [2.0 * k / (NODES - 1) - 1.0 for k in range(NODES)]
    fields = [Variable(f"F_{k}", "N", f"force {way} at command {c:g}", c) for k, c in enumerate(at, 1)]
    return group_of("Forces", fields)


class ForceTableAhead(Law[Fields]):
    """Force ahead at the commands -1, -0.8 ... 1 as it was measured at rest; it must not fall."""

    name = "force_table_surge"
    commands = (Command("u", "1", "command, -1...1"),)
    components = "X"
    limiting = ()
    Parameters = _forces("ahead")

    @classmethod
    def limits(cls, p: Fields) -> tuple[Span, ...]:
        return ((-1.0, 1.0),)

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Fields) -> tuple[Number, Number]:
        f = interpolate(commands[0], -1.0, 1.0, p)
        return f, 0.0 * f

    @classmethod
    def reach(cls, flow: Flow, p: Fields) -> tuple[Span, ...]:
        return ((p[0], p[-1]),)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Fields) -> tuple[Number, ...]:
        # Each stretch between two nodes is gone as far as the force asks for.
        c: Number = -1.0
        for low, high in pairwise(p):
            share = clip((forces[0] - low) / fmax(high - low, SMALL), 0.0, 1.0)
            c = c + 2.0 / (NODES - 1.0) * share
        return (c,)


class ForceTableAside(ForceTableAhead):
    """The same, of a force to starboard."""

    name = "force_table_sway"
    components = "Y"
    Parameters = _forces("to starboard")

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Fields) -> tuple[Number, Number]:
        f = interpolate(commands[0], -1.0, 1.0, p)
        return 0.0 * f, f

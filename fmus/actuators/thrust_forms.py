"""Other forms of the force over the command: by its square, (2.11), and by a table with inflow, (2.12).

The square is that of a propeller whose speed of rotation n follows the command: with the force
sign(n) K_T rho D^4 n^2, and F the force at full command, it is F |u| u. The allocation takes the root.

A table has the shares of the full force at nine commands from -1 to 1, for three inflow speeds: none,
half and all of ``table_speed``. It starts as a straight line without influence of the inflow; by such a
line commands are allocated.
"""

from collections.abc import Mapping, Sequence

from ..declare import Fields, Range, Variable, group_of, variables
from ..effects.curve import hats
from ..ops import Number, signed_root
from .law import Flow, Law
from .laws import TunnelThruster, VoithSchneider

COMMANDS = 9
SPEEDS = 3
NODES = COMMANDS * SPEEDS
TABLE_SPEED = Variable("table_speed", "m/s", "largest inflow speed of the table", 0.4, Range(min=0.01))


def squared(line: type[Law]) -> type[Law]:
    """The law of actuators whose force is by the square of each command of one that is in proportion."""

    class Squared(line):
        name = f"squared_{line.name}"
        proportional = False
        variants = {}  # noqa: RUF012

        @classmethod
        def force(cls, commands: tuple[Number, ...], flow: Flow, p: Fields) -> tuple[Number, Number]:
            return line.force(tuple([abs(c) * c for c in commands]), flow, p)

        @classmethod
        def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Fields) -> tuple[Number, ...]:
            return tuple([signed_root(c) for c in line.commanded(forces, flow, p)])

    return Squared


def tabulated(line: type[Law], tables: Mapping[str, str]) -> type[Law]:
    """The law of actuators whose force has a table over each command and the inflow.

    Args:
        line: law of the force at a straight line.
        tables: for each command the name of its table -> its inflow, a speed of :class:`.law.Flow`.
    """
    cells = [v for name in tables for v in _table(name)]

    class Tabulated(line):
        name = f"tabulated_{line.name}"
        proportional = False
        allocated = line
        variants = {}  # noqa: RUF012
        limiting = (*line.limiting, TABLE_SPEED.name)
        Parameters = group_of("Tabulated", [*variables(line.Parameters), *cells, TABLE_SPEED])

        @classmethod
        def force(cls, commands: tuple[Number, ...], flow: Flow, p: Fields) -> tuple[Number, Number]:
            first = len(p) - 1 - len(cells)
            shares = [
                looked_up(c, abs(getattr(flow, speed)), p[first + k * NODES :][:NODES], p.table_speed)
                for k, (c, speed) in enumerate(zip(commands, tables.values(), strict=True))
            ]
            return line.force(tuple(shares), flow, p)

    return Tabulated


def _table(name: str) -> list[Variable]:
    """The table of one command, row by row."""
    text = "share of full force at command {:g}, speed {} of 2"
    return [
        Variable(f"{name}_{i}_{j + 1}", "1", text.format(c, j), c)
        for i, c in enumerate([2.0 * k / (COMMANDS - 1) - 1.0 for k in range(COMMANDS)], 1)
        for j in range(SPEEDS)
    ]


def looked_up(command: Number, speed: Number, table: Sequence[Number], most: Number) -> Number:
    """Share of full force by linear interpolation in both directions, constant beyond the table."""
    by_speed = hats(speed, 0.0, most, SPEEDS)
    total = 0.0
    for i, weight in enumerate(hats(command, -1.0, 1.0, COMMANDS)):
        row = table[i * SPEEDS : (i + 1) * SPEEDS]
        total = total + weight * (by_speed[0] * row[0] + by_speed[1] * row[1] + by_speed[2] * row[2])
    return total


FORMS = (
    squared(TunnelThruster),
    squared(VoithSchneider),
    tabulated(TunnelThruster, {"table": "hull_u"}),
    tabulated(VoithSchneider, {"table_x": "hull_u", "table_y": "hull_v"}),
)

"""Thrusters with a table of their force over command and inflow speed, (2.12).

Each thruster has the shares of its full force at nine commands from -1 to 1, for three inflow speeds:
none, half and all of ``table_speed``. The VSP's inflow in surge is u, in sway v at its place; the bow
thruster's is |u|. The table starts as a straight line without influence of the inflow, as the allocation
believes.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import Range, vector
from ..effects import Running
from ..effects.curve import hats
from ..hull import Triple
from ..ops import Number
from .chain import thrusters
from .thrusters import same

COMMANDS = 9
SPEEDS = 3


def _shares(typename: str, prefix: str, what: str) -> type[Any]:
    """The table of one thruster as parameters, command by command."""
    return vector(
        typename,
        [
            (
                f"{prefix}_{i + 1}_{j + 1}",
                "1",
                f"share of full {what} at command {2 * i / (COMMANDS - 1) - 1:g}, speed {j} of 2",
                2.0 * i / (COMMANDS - 1) - 1.0,
            )
            for i in range(COMMANDS)
            for j in range(SPEEDS)
        ],
    )


SurgeTable = _shares("SurgeTable", "table_vsp_x", "VSP surge force")
SwayTable = _shares("SwayTable", "table_vsp_y", "VSP sway force")
BowTable = _shares("BowTable", "table_bow", "bow force")


class Table(NamedTuple):
    surge: Any = SurgeTable()
    sway: Any = SwayTable()
    bow: Any = BowTable()
    table_speed: Annotated[float, "m/s", "largest inflow speed of the table", Range(min=0.01)] = 0.4


def looked_up(command: Number, speed: Number, table: Any, most: Number) -> Any:
    """Share of full force by linear interpolation in both directions, constant beyond the table."""
    by_speed = hats(speed, 0.0, most, SPEEDS)
    total = 0.0
    for i, weight in enumerate(hats(command, -1.0, 1.0, COMMANDS)):
        row = table[i * SPEEDS : (i + 1) * SPEEDS]
        total = total + weight * (by_speed[0] * row[0] + by_speed[1] * row[1] + by_speed[2] * row[2])
    return total


def tabulated(now: Running, p: Table) -> Triple:
    """Shares of full force from the tables, (2.12)."""
    x, y, bow = now.given
    return (
        looked_up(x, abs(now.u), p.surge, p.table_speed),
        looked_up(y, abs(now.v), p.sway, p.table_speed),
        looked_up(bow, abs(now.u), p.bow, p.table_speed),
    )


make = thrusters(
    "thrusters_table",
    "Thrust allocation, and thrusters by tables over command and inflow speed",
    Table,
    tabulated,
    same,
)
COMPONENT = make()

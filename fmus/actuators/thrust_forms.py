"""Other forms of the force over the command: by its square, (2.11), and by a table with inflow, (2.12).

The square is that of a propeller whose speed of rotation n follows the command: with the force
sign(n) K_T rho D^4 n^2, and F the force at full command, it is F |u| u. The allocation takes the root.

A table has the shares of the full force at nine commands from -1 to 1, for three inflow speeds: none,
half and all of ``table_speed``. It starts as a straight line without influence of the inflow; by such a
line commands are allocated.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

from ..declare import Range, Variable, group_of, variables
from ..effects.curve import hats
from ..ops import Number, signed_root
from .law import Flow
from .laws import Cycloidal, Tunnel, TunnelThruster, VoithSchneider

COMMANDS = 9
SPEEDS = 3
NODES = COMMANDS * SPEEDS


class SquaredTunnelThruster(TunnelThruster):
    """Thruster in a tunnel across the ship, whose force is by the square of its command, (2.11)."""

    name = "squared_tunnel_thruster"
    proportional = False
    variants: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        (u,) = commands
        return 0.0 * u, p.F * (abs(u) * u)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, ...]:
        return (signed_root(forces[0] / p.F),)


class SquaredVoithSchneider(VoithSchneider):
    """Voith Schneider propeller whose force is by the square of each command, (2.11)."""

    name = "squared_voith_schneider"
    proportional = False
    variants: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        surge, sway = commands
        return p.F * (abs(surge) * surge), p.F * (abs(sway) * sway)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, ...]:
        return signed_root(forces[0] / p.F), signed_root(forces[1] / p.F)


def _table(prefix: str, what: str) -> list[Variable]:
    """The table of one component of a force, command by command."""
    at = [2.0 * i / (COMMANDS - 1) - 1.0 for i in range(COMMANDS)]
    return [
        Variable(
            f"{prefix}_{i}_{j + 1}",
            "1",
            f"share of full {what} at command {c:g}, speed {j} of 2",
            c,
            Range(),
            False,
        )
        for i, c in enumerate(at, 1)
        for j in range(SPEEDS)
    ]


TABLE_SPEED = Variable(
    "table_speed", "m/s", "largest inflow speed of the table", 0.4, Range(min=0.01), False
)


def looked_up(command: Number, speed: Number, table: Any, most: Number) -> Any:
    """Share of full force by linear interpolation in both directions, constant beyond the table."""
    by_speed = hats(speed, 0.0, most, SPEEDS)
    total = 0.0
    for i, weight in enumerate(hats(command, -1.0, 1.0, COMMANDS)):
        row = table[i * SPEEDS : (i + 1) * SPEEDS]
        total = total + weight * (by_speed[0] * row[0] + by_speed[1] * row[1] + by_speed[2] * row[2])
    return total


class TabulatedTunnelThruster(TunnelThruster):
    """Thruster in a tunnel across the ship with a table of its force over command and |u|, (2.12)."""

    name = "tabulated_tunnel_thruster"
    proportional = False
    allocated = TunnelThruster
    variants: ClassVar[Mapping[str, str]] = {}
    limiting = ("table_speed",)
    Parameters: ClassVar[type[Any]] = group_of(
        "Tabulated", [*variables(Tunnel), *_table("table", "force"), TABLE_SPEED]
    )

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        (u,) = commands
        return 0.0 * u, p.F * looked_up(u, abs(flow.hull_u), p[-NODES - 1 : -1], p.table_speed)


class TabulatedVoithSchneider(VoithSchneider):
    """Voith Schneider propeller with tables of its force over command and |u| or |v|, (2.12)."""

    name = "tabulated_voith_schneider"
    proportional = False
    allocated = VoithSchneider
    variants: ClassVar[Mapping[str, str]] = {}
    limiting = (*VoithSchneider.limiting, "table_speed")
    Parameters: ClassVar[type[Any]] = group_of(
        "Tabulated",
        [
            *variables(Cycloidal),
            *_table("table_x", "surge force"),
            *_table("table_y", "sway force"),
            TABLE_SPEED,
        ],
    )

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        surge, sway = commands
        ahead, aside = p[-2 * NODES - 1 : -NODES - 1], p[-NODES - 1 : -1]
        return (
            p.F * looked_up(surge, abs(flow.hull_u), ahead, p.table_speed),
            p.F * looked_up(sway, abs(flow.hull_v), aside, p.table_speed),
        )

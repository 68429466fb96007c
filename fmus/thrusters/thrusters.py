"""Thrusters whose force is linear in the command, (2.10)."""

from typing import Any, NamedTuple

from ..declare import Component
from ..effects import STANDARD, EffectSet, Running
from ..hull import Triple
from ..ops import Number
from ..ship_description import Description
from .chain import thrusters
from .described import described


class Line(NamedTuple):
    """A straight line needs no parameters."""


def linear(now: Running, p: Any) -> Triple:
    """Shares of full force: the commands themselves, (2.10)."""
    x, y, bow = now.given
    return x, y, bow


def same(share: Number) -> Number:
    return share


_three = thrusters(
    "thrusters",
    "Thrust allocation and thrusters of CyberShip Enterprise 1",
    Line,
    linear,
    same,
)


def make(effects: EffectSet = STANDARD, ship: Description | None = None) -> Component:
    """The FMU of the thrusters of CyberShip Enterprise 1, or of a described ship."""
    return _three(effects) if ship is None else described(effects, ship)


COMPONENT = make()

"""Thrusters whose force is straight in the command, (2.10)."""

from typing import Any, NamedTuple

from ..effects.registry import Running
from ..hull import Triple
from ..ops import Number
from .chain import thrusters


class Line(NamedTuple):
    """A straight line needs no parameters."""


def straight(now: Running, p: Any) -> Triple:
    """Shares of full force: the commands themselves, (2.10)."""
    return now.u_vsp_x, now.u_vsp_y, now.u_bow


def same(share: Number) -> Number:
    return share


COMPONENT = thrusters(
    "thrusters",
    "Thrust allocation and thrusters of CyberShip Enterprise 1",
    Line,
    straight,
    same,
)

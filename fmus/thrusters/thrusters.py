"""Thrusters whose force is linear in the command, (2.10)."""

from typing import Any, NamedTuple

from ..effects import Running
from ..hull import Triple
from ..ops import Number
from .chain import thrusters


class Line(NamedTuple):
    """A straight line needs no parameters."""


def linear(now: Running, p: Any) -> Triple:
    """Shares of full force: the commands themselves, (2.10)."""
    return now.u_vsp_x, now.u_vsp_y, now.u_bow


def same(share: Number) -> Number:
    return share


make = thrusters(
    "thrusters",
    "Thrust allocation and thrusters of CyberShip Enterprise 1",
    Line,
    linear,
    same,
)
COMPONENT = make()

"""Thrusters that are propellers: the force grows with the square of the speed of rotation, (2.11).

f = sign(n) K_T rho D^4 n^2; with n proportional to the command and F the force at full command this is
F |u| u. The allocation knows and takes the root.
"""

from typing import Any

from ..effects import Running
from ..hull import Triple
from ..ops import signed_root
from .chain import thrusters
from .thrusters import Line


def squared(now: Running, p: Any) -> Triple:
    """Shares of full force: the commands squared, with their sign, (2.11)."""
    x, y, bow = now.given
    return abs(x) * x, abs(y) * y, abs(bow) * bow


make = thrusters(
    "thrusters_propeller",
    "Thrust allocation, and thrusters whose force grows with the square of the command",
    Line,
    squared,
    signed_root,
)
COMPONENT = make()

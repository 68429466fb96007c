"""Thrusters that the diagnosis does not know: the bow's effectiveness is exp(-(u/u_0)^2).

A component file: ``python -m fmus.build benchmarks/hidden_effects/other_thrusters.py --out fmu``.
"""

from typing import Annotated, NamedTuple

from fmus.declare import POSITIVE
from fmus.effects import Running
from fmus.hull import Triple
from fmus.ops import exp
from fmus.thrusters.chain import thrusters
from fmus.thrusters.thrusters import same


class Bow(NamedTuple):
    bow_exp: Annotated[float, "s/m", "1/u_0: inverse of the surge speed that costs 63 %", POSITIVE] = 0.0


def fading(now: Running, p: Bow) -> Triple:
    """Shares of full force."""
    slow = p.bow_exp * now.u
    x, y, bow = now.given
    return x, y, bow * exp(-slow * slow)


make = thrusters("other_thrusters", "Thrusters whose bow fades with the surge speed", Bow, fading, same)
COMPONENT = make()

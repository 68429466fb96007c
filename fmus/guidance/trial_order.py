"""The order that the guidance of a manoeuvring trial gives: what the trials share.

A trial commands what turns the ship. Where thrusters get commands that is the angle of a rudder or an
azimuth, and a scenario connects ``delta`` with it; where they get a force it is a moment, and ``tau_N``
is connected. What drives the ship ahead keeps the setting of the approach: a start value of the
thrusters' inputs. The order itself is 1 for all of it to starboard, -1 to port, and 0 before the first
execute.
"""

from typing import Annotated, NamedTuple

from ..declare import POSITIVE, Range
from ..ops import Condition, Number, where

START = Annotated[float, "s", "time of the first execute", POSITIVE]
ANGLE = Annotated[
    float, "rad", "angle that turns the ship to starboard; negative of an aft azimuth", Range(-1.6, 1.6)
]
TENTH = 0.17453292519943295  # 10 degrees [rad]
HARD_OVER = 0.6108652381980153  # 35 degrees [rad], of a turning circle (MSC.137(76), 4.2.1)


class Helm(NamedTuple):
    """What is put over."""

    moment: Annotated[float, "N.m", "moment, for thrusters that are commanded a force", POSITIVE] = 0.1
    side: Annotated[float, "1", "side of the first execute: 1 starboard, -1 port", Range(-1.0, 1.0)] = (
        1.0
    )


class Order(NamedTuple):
    """What the ship's thrusters get."""

    order: Annotated[float, "1", "order under trial: 1 to starboard, -1 to port, 0 none"] = 0.0
    delta: Annotated[float, "rad", "the order as an angle"] = 0.0
    tau_N: Annotated[float, "N.m", "the order as a moment"] = 0.0


class TrialTime(NamedTuple):
    """State of a trial that goes by time alone [s]."""

    t: Number = 0.0


def begun(t: Number, start: Number, h: Number) -> Condition:
    """Whether the instant t [s] is the first execute's or later, at steps of h [s]."""
    return t > start - 0.5 * h


def first_side(helm: Helm) -> Number:
    return where(helm.side < 0.0, -1.0, 1.0)


def given(order: Number, angle: Number, helm: Helm) -> Order:
    """An order as the thrusters get it: of an angle [rad], and of a moment."""
    return Order(order, order * angle, order * helm.moment)

"""Guidance of a zig-zag trial: the order is reversed whenever the heading has changed so far.

After a steady approach the order is put over to one side (first execute); when the heading is
``psi_check`` off the original one, to the other side (second execute), and so on (IMO, MSC.137(76),
4.2.4 to 4.2.8; ISO 13643-2:2017). With ``angle`` = ``psi_check`` = 10 degrees it is the 10/10 trial.

An input that is NaN or infinite keeps its last finite value.
"""

from typing import Annotated, NamedTuple

from ..declare import Range, component
from ..ops import Number, where
from .trial_order import ANGLE, START, TENTH, Helm, Order, begun, first_side, given


class Inputs(NamedTuple):
    psi_hat: Annotated[float, "rad", "estimated heading, continuous over turns"] = 0.0


class Params(NamedTuple):
    start: START = 20.0
    angle: ANGLE = TENTH
    psi_check: Annotated[float, "rad", "heading change at which the order is reversed",
                         Range(0.01, 1.6)] = TENTH  # fmt: skip
    helm: Helm = Helm()


class State(NamedTuple):
    """Time [s], original heading [rad], the order."""

    t: Number = 0.0
    psi_0: Number = 0.0
    order: Number = 0.0


def init(i: Inputs, p: Params) -> State:
    return State(psi_0=i.psi_hat)


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Order]:
    t = s.t + h
    first = (s.order == 0.0) & (h > 0.0) & begun(t, p.start, h)
    psi_0 = where(first, i.psi_hat, s.psi_0)
    order = where(first, first_side(p.helm), s.order)
    # How far the ship has gone to the side of its order.
    off = order * (i.psi_hat - psi_0)
    reversed_ = (h > 0.0) & (off >= p.psi_check) & (order * order > 0.0)
    order = where(reversed_, -order, order)
    return State(t, psi_0, order), given(order, p.angle, p.helm)


COMPONENT = component(
    name="guidance_zigzag",
    description="Zig-zag trial: an order that is reversed by the heading",
    init=init,
    step=step,
    trial="zigzag",
)

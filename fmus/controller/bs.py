"""Backstepping without adaptation, (4.12) with constant estimates.

An input that is NaN or infinite keeps its last finite value.
"""

from typing import Any, NamedTuple

from ..declare import Component
from ..ops import Number
from .backstepping import Belief, Gains, Inputs, Outputs, PhiHat, PhiStart, control, control_errors


class Params(NamedTuple):
    gains: Gains = Gains()
    belief: Belief = Belief()
    phi: Any = PhiStart()


class State(NamedTuple):
    """Nothing to remember."""


def init(i: Inputs, p: Params) -> State:
    return State()


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Outputs]:
    errors, alpha_dot = control_errors(i.estimate, i.target, p.gains)
    phi = PhiHat._make(p.phi)
    return s, control(i.estimate, errors, alpha_dot, p.gains, p.belief, phi, (0.0, 0.0, 0.0))


COMPONENT = Component(
    name="controller_bs",
    description="Backstepping controller",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Outputs,
    init=init,
    step=step,
)

"""Backstepping without adaptation, (4.12) with constant estimates.

An input that is NaN or infinite keeps its last finite value.
"""

from typing import NamedTuple

from ..declare import Component, Fields
from ..ops import Number
from .backstepping import (
    HELD,
    Energy,
    FeedbackGains,
    Inputs,
    control,
    control_errors,
    outputs,
    tracking_energy,
)
from .models import ROTATIONAL
from .parametrisation import ControllerModel

Outputs = outputs(ROTATIONAL)


class Params(NamedTuple):
    gains: FeedbackGains = FeedbackGains()
    controller_model: ControllerModel = ControllerModel()
    phi: Fields = ROTATIONAL.start()


class State(NamedTuple):
    """Nothing to remember."""


def init(i: Inputs, p: Params) -> State:
    return State()


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Fields]:
    e = i.estimate
    nu = (e.u_hat, e.v_hat, e.r_hat)
    errors = control_errors(e, i.target, p.gains)
    rest = (0.0, 0.0, 0.0)
    F = ROTATIONAL.regressors(nu, errors[1], rest, p.controller_model)
    demand = control(ROTATIONAL, nu, errors, p.gains, p.controller_model, F, p.phi, rest)
    energy = Energy(tracking_energy(errors[0], p.controller_model.inertia))
    return s, Outputs(*demand, ROTATIONAL.hat._make(p.phi), energy)


COMPONENT = Component(
    name="controller_bs",
    description="Backstepping controller",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Outputs,
    init=init,
    step=step,
    held=HELD,
)

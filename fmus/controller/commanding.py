"""A controller for ships whose thrusters get commands: it steers and drives them itself.

The surge force and the yaw moment that it asks for become shaft speeds and angles of rudders or azimuths
(:mod:`fmus.actuators.steering`), by what the description says of them and the estimated velocity, which
is over ground. What these commands give is the force that acts, for its integrals.
"""

from typing import Annotated, NamedTuple

from ..actuators.actuation import actuators
from ..actuators.command_variables import commands_of
from ..actuators.steering import nominal_values, steer
from ..declare import Component, Fields, Range, bundle
from ..ops import Number, choose
from ..ship_description import Description
from ..signals import Estimate, Force, Target

HARD_OVER = 0.6108652381980153  # 35 degrees [rad], to which rudders are put over in service


class HelmLimit(NamedTuple):
    angle_max: Annotated[
        float, "rad", "largest angle of rudder or azimuth that the controller commands", Range(0.01, 1.5)
    ] = HARD_OVER


class State(NamedTuple):
    """The controller's own, the force of its last commands [N, N, N m], the share of the angle."""

    own: tuple[object, ...]
    applied: Fields
    helm: Number = 0.0


class Inputs(NamedTuple):
    estimate: Estimate = Estimate()
    target: Target = Target()


class CommandedForce(NamedTuple):
    """The force of the commands."""

    tau_cmd_X: Annotated[float, "N", "surge force of the commands, by the controller model"] = 0.0
    tau_cmd_Y: Annotated[float, "N", "sway force of the commands, by the controller model"] = 0.0
    tau_cmd_N: Annotated[float, "N.m", "yaw moment of the commands, by the controller model"] = 0.0


def commanding(controller: Component, ship: Description) -> Component:
    """A controller that gives commands in place of a force.

    Args:
        controller: made for the ship; asks for a surge force and a yaw moment.
        ship: that it serves.
    """
    commands = commands_of(ship)
    names = [a.part.name for a in actuators(ship)]
    parts = bundle("Actuators", None, **dict(zip(names, nominal_values(ship), strict=True)))
    params = bundle("Params", own=controller.params(), actuators=parts(), helm=HelmLimit())
    outputs = bundle("Outputs", own=controller.outputs(), commands=commands(), force=CommandedForce())
    unreported = controller.inputs().applied

    def inputs(i: Inputs, applied: Fields) -> tuple[object, ...]:
        return controller.inputs(i.estimate, i.target, applied)

    def init(i: Inputs, p: Fields) -> State:
        return State(controller.init(inputs(i, unreported), p.own), unreported)

    def prepare(p: Fields) -> Fields:
        return p._replace(own=controller.prepared(p.own))

    def prepared_step(s: State, i: Inputs, b: Fields, h: Number) -> tuple[State, Fields]:
        own, out = controller.law(s.own, inputs(i, s.applied), b.own, h)
        asked: Force = out.demand.tau
        nu = i.estimate.u_hat, i.estimate.v_hat, i.estimate.r_hat
        given = steer(ship, asked.tau_X, asked.tau_N, s.helm, nu, b.helm.angle_max, b.actuators)
        after = State(own, type(unreported)(*given.tau), given.helm)
        kept = choose(h > 0.0, (after.applied, after.helm), (s.applied, s.helm))
        return State(own, *kept), outputs(out, commands(*given.commands), CommandedForce(*given.tau))

    def step(s: State, i: Inputs, p: Fields, h: Number) -> tuple[State, Fields]:
        return prepared_step(s, i, prepare(p), h)

    return Component(
        name=controller.name,
        description=f"{controller.description}: gives {ship.title} its commands",
        params=params,
        state=State,
        inputs=Inputs,
        outputs=outputs,
        init=init,
        step=step,
        prepare=prepare,
        prepared_step=prepared_step,
    )

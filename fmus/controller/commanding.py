"""A controller for ships whose thrusters get commands: it steers and drives them itself.

The surge force and the yaw moment that it asks for become shaft speeds and angles of rudders or azimuths
(:mod:`fmus.actuators.steering`), by what the description says of them and the estimated velocity, which
is over ground. What these commands give is the force that acts, for its integrals.
"""

from typing import Annotated, NamedTuple

from ..actuators.actuation import actuators
from ..actuators.command_variables import commands_of
from ..actuators.steering import believed, steer
from ..declare import Component, Range, Record, bundle
from ..ops import Number, choose
from ..ship_description import Description
from ..signals import Estimate, Force, Target

HARD_OVER = 0.6108652381980153  # 35 degrees [rad], to which rudders are put over in service


class Helm(NamedTuple):
    angle_max: Annotated[
        float, "rad", "largest angle of rudder or azimuth that the controller takes", Range(0.01, 1.5)
    ] = HARD_OVER


class State(NamedTuple):
    """The controller's own, the force of its last commands [N, N, N m], the share of the angle."""

    own: tuple[object, ...]
    told: Record
    helm: Number = 0.0


class Inputs(NamedTuple):
    estimate: Estimate = Estimate()
    target: Target = Target()


class Commanded(NamedTuple):
    """The force of the commands."""

    tau_cmd_X: Annotated[float, "N", "surge force of the commands, as believed"] = 0.0
    tau_cmd_Y: Annotated[float, "N", "sway force of the commands, as believed"] = 0.0
    tau_cmd_N: Annotated[float, "N.m", "yaw moment of the commands, as believed"] = 0.0


def commanding(controller: Component, ship: Description) -> Component:
    """A controller that gives commands in place of a force.

    Args:
        controller: made for the ship; asks for a surge force and a yaw moment.
        ship: that it serves.
    """
    commands = commands_of(ship)
    names = [a.part.name for a in actuators(ship)]
    parts = bundle("Believed", None, **dict(zip(names, believed(ship), strict=True)))
    params = bundle("Params", own=controller.params(), believed=parts(), helm=Helm())
    outputs = bundle("Outputs", own=controller.outputs(), commands=commands(), force=Commanded())
    untold = controller.inputs().applied

    def inputs(i: Inputs, told: Record) -> tuple[object, ...]:
        return controller.inputs(i.estimate, i.target, told)

    def init(i: Inputs, p: Record) -> State:
        return State(controller.init(inputs(i, untold), p.own), untold)

    def prepare(p: Record) -> Record:
        return p._replace(own=controller.prepared(p.own))

    def prepared_step(s: State, i: Inputs, b: Record, h: Number) -> tuple[State, Record]:
        own, out = controller.law(s.own, inputs(i, s.told), b.own, h)
        asked: Force = out.demand.tau
        nu = i.estimate.u_hat, i.estimate.v_hat, i.estimate.r_hat
        given = steer(ship, asked.tau_X, asked.tau_N, s.helm, nu, b.helm.angle_max, b.believed)
        after = State(own, type(untold)(*given.tau), given.helm)
        kept = choose(h > 0.0, (after.told, after.helm), (s.told, s.helm))
        return State(own, *kept), outputs(out, commands(*given.commands), Commanded(*given.tau))

    def step(s: State, i: Inputs, p: Record, h: Number) -> tuple[State, Record]:
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

"""The closed loop of pure functions: true states and exact accelerations to the controller."""

import math

from fmus.controller.backstepping import Inputs
from fmus.declare import flatten, packer
from fmus.frames import rotate_to_body
from fmus.guidance import ellipse, multisine
from fmus.hull import motion
from fmus.signals import Estimate, Force, Nothing
from fmus.vessel import vessel
from support.ccode import stepped
from support.cse1 import VESSEL

NO_LOSS = (0.0, 0.0, 0.0)
NO_FORCE = (0.0, 0.0, 0.0)


def guided(guidance, params):
    """A function of the step k and its length: the target at that time."""
    state = guidance.COMPONENT.init(Nothing(), params)

    def target(k, h):
        nonlocal state
        state, out = guidance.COMPONENT.step(state, Nothing(), params, h if k else 0.0)
        return out

    return target


def multisine_target(rate=1.0):
    return guided(multisine, multisine.Params(rate=rate))


def ellipse_target(u_t=0.08):
    return guided(ellipse, ellipse.Params(u_t=u_t))


def acting(s, tau, loss=NO_LOSS, earth=NO_FORCE):
    """What acts on the hull: the request less the loss of the thrusters, and an earth-fixed force."""
    X, Y = rotate_to_body(s.psi, earth[0], earth[1])
    return Force(
        (1.0 - loss[0]) * tau[0] + X,
        (1.0 - loss[1]) * tau[1] + Y,
        (1.0 - loss[2]) * tau[2] + earth[2],
    )


def unlimited(params):
    """The parameters of a controller for thrusters without limits: no request is too large."""
    if not hasattr(params, "blocker"):
        return params
    return params._replace(blocker=params.blocker._replace(tau_max=1e6))


def closed_loop(
    component,
    params,
    seconds,
    h,
    target,
    start=None,
    plant=None,
    loss=NO_LOSS,
    earth=NO_FORCE,
):
    """Yield (t, vessel state, controller with its state, outputs) of each step; every request acts in full."""
    params, pack = unlimited(params), packer(component.outputs)
    b = VESSEL.prepare(plant or VESSEL.params()).hull
    s = start or vessel.State(5.0, 2.0)
    goal = target(0, h)

    def estimate(s, tau):
        return Estimate(*s[:6], *motion(s.u, s.v, s.r, acting(s, tau, loss, earth), b), 0.0)

    # The acceleration before the first step is none of the controller's force; init takes its own.
    law = stepped(component, params, Inputs(estimate(s, NO_FORCE), goal))
    tau = getattr(law.state, "tau", NO_FORCE)
    for k in range(math.ceil(seconds / h)):
        out = pack(law.advance(flatten(Inputs(estimate(s, tau), goal)), h))
        yield k * h, s, law, out
        tau = out.tau
        s = vessel.integrate(s, acting(s, tau, loss, earth), b, h)
        goal = target(k + 1, h)

"""A ship that the diagnosis does not know: drag by |u|^1.5, integrated by semi-implicit Euler.

A component file: ``python -m fmus.build benchmarks/hidden_effects/other_vessel.py --out fmu``.
"""

from typing import Annotated, Any, NamedTuple

from fmus.declare import POSITIVE, Component, bundle
from fmus.frames import rotate_to_earth
from fmus.ops import Number, sqrt
from fmus.ship import ship
from fmus.signals import Force, VelocityInCurrent
from fmus.vessel import vessel

SHIP = ship().vessel


class Drag(NamedTuple):
    drag_1_5: Annotated[float, "N", "surge drag at 1 m/s, growing as |u|^1.5", POSITIVE] = 0.0


Params = bundle("Params", ship=SHIP.params(), drag=Drag())


def motion(
    s: vessel.State, tau: Force, p: Any, b: vessel.PreparedVessel
) -> tuple[Number, Number, Number]:
    """nu_dot [m/s2, m/s2, rad/s2]."""
    drag = p.drag.drag_1_5 * s.u * sqrt(abs(s.u))
    return vessel.disturbed(s, tau._replace(tau_X=tau.tau_X - drag), b)


def step(s: vessel.State, i: Force, p: Any, h: Number) -> tuple[vessel.State, vessel.Outputs]:
    b = SHIP.prepared(p.ship)
    du, dv, dr = motion(s, i, p, b)
    u, v, r = s.u + h * du, s.v + h * dv, s.r + h * dr
    x_dot, y_dot = rotate_to_earth(s.psi + h * r, u, v)
    after = vessel.State(s.x + h * x_dot, s.y + h * y_dot, s.psi + h * r, u, v, r, s.t + h)
    nu_dot = motion(after, i, p, b)
    omega = vessel.model_error(after, nu_dot, i, p.ship)
    pose, speed = (
        vessel.Pose(after.x, after.y, after.psi),
        VelocityInCurrent(u, v, r, *vessel.water_velocity(after, b)),
    )
    return after, vessel.Outputs(pose, speed, *nu_dot, vessel.measured(after, b), *omega, *omega)


def init(i: Force, p: Any) -> vessel.State:
    return SHIP.init(i, p.ship)


COMPONENT = Component(
    name="other_vessel",
    description="Hull with drag by |u|^1.5, integrated by the semi-implicit Euler method",
    params=Params,
    state=vessel.State,
    inputs=Force,
    outputs=vessel.Outputs,
    init=init,
    step=step,
    sampled=False,
    max_step=0.005,
)

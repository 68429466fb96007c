"""PID control of position and heading: the baseline that knows of the ship no more than three masses.

tau = K_P e + K_D e_dot + K_I int e dt with e the target minus the estimate, along, across and in heading
(T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, Wiley, 2011, ch. 12). The
integral of the position error is kept north and east, where what it compensates for is often constant.
There is no feed-forward.

An input that is NaN or infinite keeps its last finite value.
"""

from dataclasses import replace
from typing import Annotated, NamedTuple

from ..declare import Component, Variable, component, redeclared
from ..effects import EffectSet
from ..frames import rotate_to_body
from ..hull import Inertia, described_mass, mass_matrix
from ..ops import Number, clip, where, wrap
from ..ship_description import Description
from ..signals import Estimate, Force, Target
from ..sizing import sized
from .backstepping import Demand, Errors
from .parametrisation import GAIN

# Fossen's rule for a mass without damping: K_P = m w^2, K_D = 2 z w m, K_I = w K_P / 10. The natural
# frequency w is chosen: a measurement that freezes for 1 s, as in the shipped scenarios, is half a
# radian of it. The damping ratio z = 1 does not overshoot.
FREQUENCY = 0.5  # rad/s
DAMPING = 1.0
INTEGRAL = 0.1  # of the natural frequency
_M = mass_matrix(Inertia())
_SURGE, _SWAY, _YAW = _M[0][0], _M[1][1], _M[2][2]


def _proportional(mass: float) -> float:
    return mass * FREQUENCY * FREQUENCY


def _derivative(mass: float) -> float:
    return 2.0 * DAMPING * FREQUENCY * mass


def _integral(mass: float) -> float:
    return INTEGRAL * FREQUENCY * _proportional(mass)


class Inputs(NamedTuple):
    estimate: Estimate = Estimate()
    target: Target = Target()


class Params(NamedTuple):
    K_P_x: Annotated[float, "N/m", "proportional gain, along", GAIN] = _proportional(_SURGE)
    K_P_y: Annotated[float, "N/m", "proportional gain, across", GAIN] = _proportional(_SWAY)
    K_P_psi: Annotated[float, "N.m/rad", "proportional gain, heading", GAIN] = _proportional(_YAW)
    K_D_x: Annotated[float, "N.s/m", "derivative gain, along", GAIN] = _derivative(_SURGE)
    K_D_y: Annotated[float, "N.s/m", "derivative gain, across", GAIN] = _derivative(_SWAY)
    K_D_psi: Annotated[float, "N.m.s/rad", "derivative gain, heading", GAIN] = _derivative(_YAW)
    K_I_x: Annotated[float, "N/(m.s)", "integral gain, along", GAIN] = _integral(_SURGE)
    K_I_y: Annotated[float, "N/(m.s)", "integral gain, across", GAIN] = _integral(_SWAY)
    K_I_psi: Annotated[float, "N.m/(rad.s)", "integral gain, heading", GAIN] = _integral(_YAW)
    # Against windup: with the gains above 2.1 N, 3.1 N and 0.2 N m, about what the thrusters give.
    limit_position: Annotated[float, "m.s", "limit of an integral of position", GAIN] = 10.0
    limit_heading: Annotated[float, "rad.s", "limit of the integral of heading", GAIN] = 6.0


class State(NamedTuple):
    """Integrals of the errors north, east and in heading [m s, m s, rad s]."""

    north: Number = 0.0
    east: Number = 0.0
    heading: Number = 0.0


def init(i: Inputs, p: Params) -> State:
    return State()


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Demand]:
    e, t = i.estimate, i.target
    north, east, turn = t.x_t - e.x_hat, t.y_t - e.y_hat, wrap(t.psi_t - e.psi_hat)
    seen = where(e.frozen > 0.5, 0.0, h)  # of a frozen measurement nothing adds up
    s = State(
        clip(s.north + seen * north, -p.limit_position, p.limit_position),
        clip(s.east + seen * east, -p.limit_position, p.limit_position),
        clip(s.heading + seen * turn, -p.limit_heading, p.limit_heading),
    )
    ahead, aside = rotate_to_body(e.psi_hat, north, east)
    t_u, t_v = rotate_to_body(e.psi_hat, t.x_t_dot, t.y_t_dot)
    u, v, r = t_u - e.u_hat, t_v - e.v_hat, t.psi_t_dot - e.r_hat
    along, across = rotate_to_body(e.psi_hat, s.north, s.east)
    iX, iY, iN = p.K_I_x * along, p.K_I_y * across, p.K_I_psi * s.heading
    X = p.K_P_x * ahead + p.K_D_x * u + iX
    Y = p.K_P_y * aside + p.K_D_y * v + iY
    N = p.K_P_psi * turn + p.K_D_psi * r + iN
    errors = Errors(0.0 - ahead, 0.0 - aside, 0.0 - turn, 0.0 - u, 0.0 - v, 0.0 - r)
    # The integral stands for what the law does not know: minus the estimated model error.
    estimate = (0.0 - iX, 0.0 - iY, 0.0 - iN)
    return s, Demand(Force(X, Y, N), X, Y, N, 0.0, 0.0, 0.0, errors, *estimate)


COMPONENT = component(
    name="controller_pid",
    description="PID controller",
    init=init,
    step=step,
)


def make(effects: EffectSet, ship: Description) -> Component:
    """The controller of a ship: gains in proportion to its three masses, the frequency to its scale."""
    made, length = sized(COMPONENT, ship), ship.scale.length
    M = described_mass({v.name: v.value for v in ship.inertia})
    of_scale = {"x": _SURGE * length**3, "y": _SWAY * length**3, "psi": _YAW * length**5}
    heavier = {axis: M[k][k] / m for k, (axis, m) in enumerate(of_scale.items())}

    def for_ship(v: Variable) -> Variable:
        kind, _, axis = v.name.rpartition("_")
        return replace(v, start=v.start * heavier[axis]) if kind in ("K_P", "K_D", "K_I") else v

    return replace(made, params=redeclared(made.params, for_ship))

"""From commands to the force that acts: delay, rate limit, characteristic, lag, and what goes wrong.

A thruster model is a characteristic: which share of its full force each thruster gives for a command.
All else is the same for every model and stands here; :func:`thrusters` makes an FMU of a characteristic.

Commands pass the effects with a memory of commands (a delay), the limit of their rate, the
characteristic, the effects with a memory of forces (a lag), all in :mod:`fmus.actuators.response`, and
then the effects without a memory.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple

from ..actuators.response import (
    Layout,
    Past,
    Prepared,
    ThrusterEffects,
    at_rest,
    command_response,
    force_response,
    prepared,
    thruster_effects,
)
from ..declare import POSITIVE, Component, Known, bundle
from ..effects import STANDARD, EffectSet, Running, Thrust
from ..effects.cse1 import ASIDE, PORT, STARBOARD
from ..hull import Triple
from ..ops import Number, clip, finite, when
from ..signals import Force, Velocity
from .allocation import Allocation, allocate, thrust

# Thrust goes with the square of a propeller's speed, which is not recorded: a third less speed is half
# the thrust.
PULLED = Known("thrust", "bollard pulls at another propeller speed", 0.5)
# The place of an axis is known to millimetres, that of the force which acts on its disc to a centimetre.
RULED = Known("place", "by ruler", 0.02)


class Plant(NamedTuple):
    """What the thrusters really are."""

    plant_F_vsp: Annotated[float, "N", "real force of the VSP at full command", POSITIVE, PULLED] = 1.165
    plant_F_bow: Annotated[float, "N", "real force of the bow at full command", POSITIVE, PULLED] = 2.629
    plant_l_vsp: Annotated[float, "m", "real VSP position forward of the body origin", RULED] = -0.4575
    plant_l_bow: Annotated[float, "m", "real bow thruster position forward of the origin", RULED] = (
        0.3875
    )
    plant_p_x: Annotated[float, "m", "real point of attack, forward", RULED] = 0.0
    plant_p_y: Annotated[float, "m", "real point of attack, to starboard", RULED] = 0.0


class Power(NamedTuple):
    """How hard the thrusters run: what a characteristic and its effects give is scaled by these."""

    power_vsp: Annotated[float, "1", "thrust of the VSP, of that at their full speed", POSITIVE] = 1.0
    power_bow: Annotated[float, "1", "thrust of the bow, of that at its full power", POSITIVE] = 1.0


class Rate(NamedTuple):
    plant_rate: Annotated[float, "1/s", "limit of a command's rate; 0: none", POSITIVE] = 0.0


# Commands of VSP 1, VSP 2 and the bow thruster where one set of commands is for both VSP.
BOTH = (0, 1, 0, 1, 2)


class Inputs(NamedTuple):
    request: Force = Force()
    velocity: Velocity = Velocity()


class Outputs(NamedTuple):
    u_vsp_x: Annotated[float, "1", "VSP command in surge, -1...1"] = 0.0
    u_vsp_y: Annotated[float, "1", "VSP command in sway, -1...1"] = 0.0
    u_bow: Annotated[float, "1", "bow thruster command, -1...1"] = 0.0
    tau_cmd_X: Annotated[float, "N", "requested surge force after clipping"] = 0.0
    tau_cmd_Y: Annotated[float, "N", "requested sway force after clipping"] = 0.0
    tau_cmd_N: Annotated[float, "N.m", "requested yaw moment after clipping"] = 0.0
    tau_act_X: Annotated[float, "N", "surge force that acts"] = 0.0
    tau_act_Y: Annotated[float, "N", "sway force that acts"] = 0.0
    tau_act_N: Annotated[float, "N.m", "yaw moment that acts"] = 0.0


def running(
    t: Number, u: Number, v: Number, r: Number, commands: tuple[Number, ...], b: Prepared
) -> Running:
    """What the force of this ship's thrusters may depend on, one set of commands for both VSP."""
    vsp, bow = b.params.power
    return Running(t, u, v, r, commands, tuple([commands[k] for k in BOTH]), (vsp, vsp, bow))


def running_apart(t: Number, u: Number, v: Number, r: Number, commands: Any, b: Prepared) -> Running:
    """The same where each VSP has commands of its own."""
    vsp, bow = b.params.power
    return Running(t, u, v, r, commands, commands, (vsp, vsp, bow))


def acting(shares: Triple, now: Running, b: Prepared) -> Thrust:
    """The forces of thrusters that give these shares of their full force, effects included.

    Args:
        shares: of the VSP's surge and sway force, half of which is of each, and of the bow thruster's.
        now: of :func:`running`.
        b: the thrusters.
    """
    F_vsp = b.params.plant.plant_F_vsp
    ahead, aside = F_vsp * shares[0], F_vsp * shares[1]
    return _forces((ahead, ahead), (aside, aside), shares[2], 0.5, now, b)


def acting_apart(shares: Sequence[Number], now: Running, b: Prepared) -> Thrust:
    """The same for shares of surge and sway force of VSP 1, of VSP 2, and of the bow thruster."""
    port, port_aside, starboard, starboard_aside, across = shares
    F_vsp = b.params.plant.plant_F_vsp
    ahead, aside = (F_vsp * port, F_vsp * starboard), (F_vsp * port_aside, F_vsp * starboard_aside)
    return _forces(ahead, aside, across, 1.0, now, b)


def _forces(
    ahead: tuple[Number, Number],
    aside: tuple[Number, Number],
    across: Any,
    each: float,
    now: Running,
    b: Prepared,
) -> Thrust:
    """The forces of both VSP [N], ``each`` of which counts so often, and of the bow thruster."""
    p = b.params
    _, F_bow, l_vsp, l_bow, p_x, p_y = p.plant
    vsp, bow = p.power
    f = Thrust(
        (*ahead, 0.0),
        (*aside, F_bow * across),
        (l_vsp + p_x, l_vsp + p_x, l_bow + p_x),
        (ASIDE[PORT] + p_y, ASIDE[STARBOARD] + p_y, p_y),
        (each * vsp, each * vsp, bow),
    )
    for member, acts in zip(b.effects.forces.members, b.acting, strict=True):
        f = member.apply(acts, p.wrong, f, f, now)
    return f


def believed(commands: Triple, p: Any) -> Triple:
    """tau [N, N, N m] that the allocation expects of three shares of full force."""
    return thrust(*commands, p.allocation)


def believed_apart(commands: Any, p: Any) -> Triple:
    """The same of five shares of full force, at the power of the thrusters."""
    port, port_aside, starboard, starboard_aside, across = commands
    vsp, bow = p.power
    X, Y, N = thrust(vsp * port, vsp * port_aside, bow * across, _shifted(p.allocation, PORT))
    more = thrust(vsp * starboard, vsp * starboard_aside, 0.0, _shifted(p.allocation, STARBOARD))
    return X + more[0], Y + more[1], N + more[2]


def allocate_apart(tau: Triple, p: Any) -> tuple[Number, ...]:
    """Five shares of full force that give a force, both VSP alike."""
    shares = allocate(*tau, _both(p.allocation))
    return tuple([shares[k] for k in BOTH])


def _both(a: Allocation) -> Allocation:
    return a._replace(F_vsp=2.0 * a.F_vsp)


def _shifted(a: Allocation, side: int) -> Allocation:
    return a._replace(p_y=a.p_y + ASIDE[side])


def full(p: Any) -> Triple:
    """The largest force and moment on each axis [N, N, N m]."""
    F_vsp, F_bow, l_vsp, l_bow, p_x, _ = p.allocation
    return F_vsp, F_vsp + F_bow, abs(l_vsp + p_x) * F_vsp + abs(l_bow + p_x) * F_bow


def powered(b: Prepared, settings: Any) -> Prepared:
    """The thrusters at settings (VSP, bow) of their power."""
    p = b.params
    power = Power(p.power[0] * settings[0], p.power[1] * settings[1])
    return b._replace(params=p._replace(power=power))


THREE = Layout(
    ("u_vsp_x", "u_vsp_y", "u_bow"),
    running,
    acting,
    believed,
    lambda tau, p: allocate(tau[0], tau[1], tau[2], p.allocation),
    full,
    lambda p: ((-1.0, 1.0),) * 3,
    powered,
    BOTH,
)
# Of the real ship: each VSP has commands of its own, in surge and sway, and then the bow thruster.
FIVE = Layout(
    ("u1", "u2", "u3", "u4", "u5"),
    running_apart,
    acting_apart,
    believed_apart,
    allocate_apart,
    lambda p: full(p._replace(allocation=_both(p.allocation))),
    lambda p: ((-1.0, 1.0),) * 5,
    powered,
)
act = THREE.act


def thrusters(
    name: str,
    description: str,
    model: type[Any],
    characteristic: Callable[[Running, Any], Triple],
    command: Callable[[Number], Number],
) -> Callable[..., Component]:
    """The factory of a thruster model's FMU.

    Args:
        name, description: of the FMU.
        model: NamedTuple class of the model's parameters.
        characteristic: ``characteristic(now, parameters)``: shares of full force by the commands in now.
        command: the command that the allocation gives for a share of full force.

    Returns:
        ``make(effects)``, which gives the component with some effects, those of this project by default;
        a request that is NaN or infinite counts as zero.
    """

    def make(effects: EffectSet = STANDARD) -> Component:
        return _thrusters(
            name, description, model, characteristic, command, thruster_effects(effects, THREE)
        )

    return make


def _thrusters(
    name: str,
    description: str,
    model: type[Any],
    characteristic: Callable[[Running, Any], Triple],
    command: Callable[[Number], Number],
    effects: ThrusterEffects,
) -> Component:
    params = bundle(
        "Params",
        allocation=Allocation(),
        plant=Plant(),
        model=model(),
        power=Power(),
        rate=Rate(),
        dynamics=effects.dynamics.params(),
        wrong=effects.forces.params(),
    )

    def prepare(p: Any) -> Prepared:
        return prepared(p, effects)

    def init(i: Inputs, p: Any) -> Past:
        return at_rest(effects)

    def prepared_step(s: Past, i: Inputs, b: Prepared, h: Number) -> tuple[Past, Outputs]:
        p = b.params
        X, Y, N = i.request
        raw = allocate(finite(X, 0.0), finite(Y, 0.0), finite(N, 0.0), p.allocation)
        s_x, s_y, s_bow = clip(raw[0], -1.0, 1.0), clip(raw[1], -1.0, 1.0), clip(raw[2], -1.0, 1.0)
        commands = command(s_x), command(s_y), command(s_bow)
        past, given = command_response(s, commands, b, h)
        u, v, r = i.velocity
        now = running(s.t + h, finite(u, 0.0), finite(v, 0.0), finite(r, 0.0), given, b)
        past, shares = force_response(past, characteristic(now, p.model), b, h)
        vsp, bow = p.power
        tau = when(
            b.any_acts,
            lambda: act(shares, now, b),
            lambda: thrust(vsp * shares[0], vsp * shares[1], bow * shares[2], p.plant),
        )
        possible = thrust(s_x, s_y, s_bow, p.allocation)
        # At h = 0 nothing has had time to change.
        after = when(h > 0.0, lambda: past, lambda: s)
        return after, Outputs._make((*commands, *possible, *tau))

    def step(s: Past, i: Inputs, p: Any, h: Number) -> tuple[Past, Outputs]:
        return prepared_step(s, i, prepare(p), h)

    return Component(
        name=name,
        description=description,
        params=params,
        state=Past,
        inputs=Inputs,
        outputs=Outputs,
        init=init,
        step=step,
        sampled=True,
        hold_nonfinite=False,
        prepare=prepare,
        prepared_step=prepared_step,
    )

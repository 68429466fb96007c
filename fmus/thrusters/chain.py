"""From commands to the force that acts: delay, rate limit, characteristic, lag, and what goes wrong.

A thruster model is a characteristic: which share of its full force each thruster gives for a command.
All else is the same for every model and stands here; :func:`thrusters` makes an FMU of a characteristic.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from ..declare import POSITIVE, Component, bundle
from ..effects import registry
from ..effects.registry import Running, Thrust
from ..hull import Triple
from ..ops import Number, clip, exp, finite, fmax, pick, when, where
from ..signals import Force, Velocity
from .allocation import Allocation, allocate, moments, thrust

IN_THRUSTERS = registry.group(
    "ThrusterEffects", [e for e in registry.effects("actuator") if e.function is not None]
)
Dynamics = registry.group("Dynamics", [registry.find("delay"), registry.find("lag")]).params
# Commands that a delay keeps; a longer one is remembered in coarser steps.
SLOTS = 64


class Plant(NamedTuple):
    """What the thrusters really are."""

    plant_F_vsp: Annotated[float, "N", "real force of the VSP at full command", POSITIVE] = 1.165
    plant_F_bow: Annotated[float, "N", "real force of the bow at full command", POSITIVE] = 2.629
    plant_l_vsp: Annotated[float, "m", "real VSP position forward of the body origin"] = -0.4575
    plant_l_bow: Annotated[float, "m", "real bow thruster position forward of the origin"] = 0.3875
    plant_p_x: Annotated[float, "m", "real point of attack, forward"] = 0.0
    plant_p_y: Annotated[float, "m", "real point of attack, to starboard"] = 0.0


class Power(NamedTuple):
    """How hard the thrusters run: what a characteristic and its effects give is scaled by these."""

    power_vsp: Annotated[float, "1", "thrust of the VSP, of that at their full speed", POSITIVE] = 1.0
    power_bow: Annotated[float, "1", "thrust of the bow, of that at its full power", POSITIVE] = 1.0


class Rate(NamedTuple):
    plant_rate: Annotated[float, "1/s", "limit of a command's rate; 0: none", POSITIVE] = 0.0


class Past(NamedTuple):
    """What the thrusters remember: time, past commands, the limited command, the lagged shares."""

    t: Any = 0.0
    since: Any = 0.0
    commands: tuple[Triple, ...] = ((0.0, 0.0, 0.0),) * SLOTS
    limited: Triple = (0.0, 0.0, 0.0)
    lagged: Triple = (0.0, 0.0, 0.0)


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


def between(delay: Number, h: Number) -> Number:
    """Time between two remembered commands [s]: a step, or more where the delay is long."""
    return fmax(fmax(h, delay / (SLOTS - 1.0)), 1e-9)


def remember(s: Past, command: Triple, delay: Number, h: Number) -> Past:
    """The memory with one more command, kept so that it reaches back by the delay [s]."""
    since = s.since + h
    tick = between(delay, h)
    due = (h > 0.0) & (since >= tick - 1e-9)
    commands = when(due, lambda: (command, *s.commands[:-1]), lambda: s.commands)
    return s._replace(since=where(due, since - tick, since), commands=commands)


def delayed(s: Past, delay: Number, h: Number) -> Triple:
    """The command of ``delay`` [s] ago, to the nearest that is kept."""
    return pick(s.commands, delay / between(delay, h))


def rate_limited(before: Triple, wanted: Triple, rate: Number, h: Number) -> Triple:
    """Commands that move from ``before`` towards the wanted ones at no more than ``rate`` [1/s]."""
    most = rate * h
    a, b, c = (x + clip(w - x, -most, most) for x, w in zip(before, wanted, strict=True))
    return a, b, c


def lagged(before: Triple, wanted: Triple, T: Number, h: Number) -> Triple:
    """First-order lag with time constant T [s], exact for a constant input."""
    share = 1.0 - exp(-h / fmax(T, 1e-9))
    a, b, c = (x + share * (w - x) for x, w in zip(before, wanted, strict=True))
    return a, b, c


FULL_POWER = Power()


def act(
    shares: Triple, now: Running, plant: Plant, acting: Any, wrong: Any, power: Any = FULL_POWER
) -> Triple:
    """tau [N, N, N m] of thrusters that give these shares of their full force, effects included.

    Args:
        shares: of the VSP's surge and sway force and of the bow thruster's.
        now: time, velocity and commands.
        plant: the real thrusters.
        acting: for each effect, whether it acts.
        wrong: parameters of the effects.
        power: of the VSP and of the bow thruster.
    """
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = plant
    f = Thrust(F_vsp * shares[0], F_vsp * shares[1], F_bow * shares[2])
    for member, acts in zip(IN_THRUSTERS.members, acting, strict=True):
        f = member.apply(acts, wrong, f, f, now)
    vsp, bow = power
    X, Y, N = moments(vsp * f.vsp_x, vsp * f.vsp_y, bow * f.bow, l_vsp, l_bow, p_x + f.dx, p_y + f.dy)
    return X * (1.0 - f.loss_X), Y * (1.0 - f.loss_Y), N * (1.0 - f.loss_N)


def thrusters(
    name: str,
    description: str,
    model: type[Any],
    characteristic: Callable[[Running, Any], Triple],
    command: Callable[[Number], Number],
) -> Component:
    """The FMU of a thruster model.

    Args:
        name, description: of the FMU.
        model: NamedTuple class of the model's parameters.
        characteristic: ``characteristic(now, parameters)``: shares of full force by the commands in now.
        command: the command that the allocation gives for a share of full force.

    Returns:
        The component; a request that is NaN or infinite counts as zero.
    """

    params = bundle(
        "Params",
        allocation=Allocation(),
        plant=Plant(),
        model=model(),
        power=Power(),
        rate=Rate(),
        dynamics=Dynamics(),
        wrong=IN_THRUSTERS.params(),
    )

    def prepare(p: Any) -> Any:
        acting = tuple([member.acting(p.wrong) for member in IN_THRUSTERS.members])
        return p, acting, IN_THRUSTERS.acting(p.wrong)

    def init(i: Inputs, p: Any) -> Past:
        return Past()

    def prepared_step(s: Past, i: Inputs, prepared: Any, h: Number) -> tuple[Past, Outputs]:
        p, acting, any_acts = prepared
        X, Y, N = i.request
        raw = allocate(finite(X, 0.0), finite(Y, 0.0), finite(N, 0.0), p.allocation)
        s_x, s_y, s_bow = clip(raw[0], -1.0, 1.0), clip(raw[1], -1.0, 1.0), clip(raw[2], -1.0, 1.0)
        asked = command(s_x), command(s_y), command(s_bow)
        delay, lag = p.dynamics
        past = when(delay > 0.0, lambda: remember(s, asked, delay, h), lambda: s)
        given = when(delay > 0.0, lambda: delayed(past, delay, h), lambda: asked)
        rate = p.rate.plant_rate
        given = when(rate > 0.0, lambda: rate_limited(s.limited, given, rate, h), lambda: given)
        u, v, r = i.velocity
        now = Running._make((s.t + h, finite(u, 0.0), finite(v, 0.0), finite(r, 0.0), *given))
        wanted = characteristic(now, p.model)
        shares = when(lag > 0.0, lambda: lagged(s.lagged, wanted, lag, h), lambda: wanted)
        vsp, bow = p.power
        tau = when(
            any_acts,
            lambda: act(shares, now, p.plant, acting, p.wrong, p.power),
            lambda: thrust(vsp * shares[0], vsp * shares[1], bow * shares[2], p.plant),
        )
        possible = thrust(s_x, s_y, s_bow, p.allocation)
        # At h = 0 nothing has had time to change.
        after = when(
            h > 0.0,
            lambda: past._replace(t=s.t + h, limited=given, lagged=shares),
            lambda: s,
        )
        return after, Outputs._make((*asked, *possible, *tau))

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

"""From commands to the force that acts: delay, rate limit, characteristic, lag, and what goes wrong.

A thruster model is a characteristic: which share of its full force each thruster gives for a command.
All else is the same for every model and stands here; :func:`thrusters` makes an FMU of a characteristic.

Commands pass the effects with a memory of commands (a delay), the limit of their rate, the
characteristic, the effects with a memory of forces (a lag), and then the effects without a memory. The
functions run on floats, step by step in an FMU, and on arrays, which is how a diagnosis computes whole
series with them.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Annotated, Any, NamedTuple

from ..declare import POSITIVE, Component, Known, bundle
from ..effects import STANDARD, EffectSet, Memory, Running, Thrust
from ..effects.group import Group, Member, group
from ..hull import Triple
from ..ops import Number, clip, finite, when
from ..signals import Force, Velocity
from .allocation import Allocation, allocate, moments, thrust

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


class ThrusterEffects(NamedTuple):
    """The effects of a set that act on thrusters.

    Attributes:
        dynamics: those with a memory.
        forces: those without.
        remembering: of dynamics, those with a memory of commands and those with one of forces, each with
            its place among the memories.
    """

    dynamics: Group
    forces: Group
    remembering: Mapping[str, Sequence[tuple[int, Member, Memory]]]


@cache
def thruster_effects(effects: EffectSet) -> ThrusterEffects:
    """The groups of a set of effects; those with a memory of commands come first."""
    actuator = [e for e in effects.of_kind("actuator") if e.function is not None]
    slow = [e for of in ("command", "force") for e in actuator if e.memory and e.memory.of == of]
    dynamics = group("Dynamics", slow)
    remembering: dict[str, list[tuple[int, Member, Memory]]] = {"command": [], "force": []}
    for k, member in enumerate(dynamics.members):
        memory = member.effect.memory
        assert memory is not None
        remembering[memory.of].append((k, member, memory))
    forces = group("ThrusterEffects", [e for e in actuator if e.memory is None])
    return ThrusterEffects(dynamics, forces, remembering)


class Past(NamedTuple):
    """What the thrusters remember: time [s], the memory of each slow effect, the last command."""

    t: Any
    memories: tuple[Any, ...]
    limited: Triple


def at_rest(effects: ThrusterEffects) -> Past:
    """The past of thrusters that were never at work."""
    memories = [member.effect.memory for member in effects.dynamics.members]
    return Past(0.0, tuple([m.initial for m in memories if m is not None]), (0.0, 0.0, 0.0))


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


class Prepared(NamedTuple):
    """What follows from the parameters alone: which effects act.

    Attributes:
        params: of the thrusters.
        effects: of the thrusters.
        slow: for each effect with a memory, whether it acts.
        acting: for each effect without, whether it acts.
        any_acts: whether any of these acts.
    """

    params: Any
    effects: ThrusterEffects
    slow: tuple[Any, ...]
    acting: tuple[Any, ...]
    any_acts: Any


def prepared(p: Any, effects: ThrusterEffects) -> Prepared:
    """Everything that a step needs of the parameters."""
    return Prepared(
        p,
        effects,
        effects.dynamics.acting(p.dynamics),
        effects.forces.acting(p.wrong),
        effects.forces.any_acts(p.wrong),
    )


def remember(
    memories: tuple[Any, ...], signals: Triple, of: str, b: Prepared, h: Number
) -> tuple[tuple[Any, ...], Triple]:
    """The memories a step later, and what they make of commands or of shares of full force.

    Args:
        memories: of all effects that have one.
        signals: three commands, or three shares.
        of: which of the two, "command" or "force".
        b: the thrusters.
        h: step [s].
    """
    found = list(memories)
    for k, member, memory in b.effects.remembering[of]:
        idle = found[k] if memory.idle is None else memory.idle(found[k], signals)
        if b.slow[k] is False:
            found[k] = idle
            continue
        otherwise = idle, signals
        found[k], signals = member.apply(b.slow[k], b.params.dynamics, otherwise, found[k], signals, h)
    return tuple(found), signals


def rate_limited(before: Triple, wanted: Triple, rate: Number, h: Number) -> Triple:
    """Commands that move from ``before`` towards the wanted ones at no more than ``rate`` [1/s]."""
    most = rate * h
    a, b, c = (x + clip(w - x, -most, most) for x, w in zip(before, wanted, strict=True))
    return a, b, c


def command_response(s: Past, commands: Triple, b: Prepared, h: Number) -> tuple[Past, Triple]:
    """The commands that reach the thrusters in a step of h [s]: delayed, and limited in their rate."""
    memories, given = remember(s.memories, commands, "command", b, h)
    rate = b.params.rate.plant_rate
    given = when(rate > 0.0, lambda: rate_limited(s.limited, given, rate, h), lambda: given)
    return Past(s.t + h, memories, given), given


def force_response(s: Past, shares: Triple, b: Prepared, h: Number) -> tuple[Past, Triple]:
    """The shares of full force that act after a step of h [s], for those of the characteristic."""
    memories, shares = remember(s.memories, shares, "force", b, h)
    return s._replace(memories=memories), shares


def act(shares: Triple, now: Running, b: Prepared) -> Triple:
    """tau [N, N, N m] of thrusters that give these shares of their full force, effects included.

    Args:
        shares: of the VSP's surge and sway force and of the bow thruster's.
        now: time, velocity and commands.
        b: the thrusters.
    """
    p = b.params
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p.plant
    vsp, bow = p.power
    now = now._replace(l_vsp=l_vsp, power_vsp=vsp, power_bow=bow)
    f = Thrust(F_vsp * shares[0], F_vsp * shares[1], F_bow * shares[2])
    for member, acts in zip(b.effects.forces.members, b.acting, strict=True):
        f = member.apply(acts, p.wrong, f, f, now)
    X, Y, N = moments(vsp * f.vsp_x, vsp * f.vsp_y, bow * f.bow, l_vsp, l_bow, p_x + f.dx, p_y + f.dy)
    N = N + vsp * f.turn
    return X * (1.0 - f.loss_X), Y * (1.0 - f.loss_Y), N * (1.0 - f.loss_N)


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
        return _thrusters(name, description, model, characteristic, command, thruster_effects(effects))

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
        now = Running(s.t + h, finite(u, 0.0), finite(v, 0.0), finite(r, 0.0), *given)
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

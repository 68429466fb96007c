"""From commands to what reaches the actuators of any ship: delay, limit of rate, lag.

Commands pass the effects with a memory of commands (a delay), the limit of their rate, the
characteristic of the thrusters, and the effects with a memory of forces (a lag). What becomes of them
then is of the ship: see :class:`Layout`. The functions run on floats, step by step in an FMU, and on
arrays, which is how a diagnosis computes whole series with them.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from ..effects import EffectSet, Memory, Running, Thrust
from ..effects.all_thrusters import way
from ..effects.group import Group, Member, group
from ..hull import Triple
from ..ops import Condition, Number, clip, when


def total(f: Thrust) -> Triple:
    """tau [N, N, N m] of the forces of all actuators."""
    X, Y, N = 0.0, 0.0, 0.0
    for gain, f_x, f_y, x, y in zip(f.gain, f.X, f.Y, f.x, f.y, strict=True):
        f_x, f_y = gain * f_x, gain * f_y
        X, Y, N = X + f_x, Y + f_y, N + x * f_y - y * f_x
    N = N + f.dx * Y - f.dy * X
    return X * (1.0 - f.loss_X), Y * (1.0 - f.loss_Y), N * (1.0 - f.loss_N)


class Layout(NamedTuple):
    """What a ship has for thrusters: how many commands they get, and how these become a force.

    Attributes:
        commands: names of their variables, in the order of all tuples of commands and shares.
        running: ``running(t, u, v, r, commands, b)``: what a thruster's force may depend on.
        thrust: ``thrust(shares, running, b)``: the force of each unit, effects included.
        believed: ``believed(commands, params)``: tau that the allocation expects of commands at rest.
        allocate: ``allocate(tau, params)``: the commands, or shares of full force, that give a force.
        full: ``full(params)``: the largest force and moment on each axis [N, N, N m].
        limits: ``limits(params)``: the lowest and the highest value of each command.
        powered: ``powered(b, settings)``: the thrusters at settings of their power, if they have any.
        shared: for each command of each actuator the place of the one that is given; empty: each is.
        curved: whether forces are not in proportion to what acts.
        round: for each command whether it is an angle that goes round; empty: none is.
    """

    commands: tuple[str, ...]
    running: Callable[..., Any]
    thrust: Callable[[Any, Any, Any], Thrust]
    believed: Callable[[Any, Any], Triple]
    allocate: Callable[[Triple, Any], tuple[Number, ...]]
    full: Callable[[Any], Triple]
    limits: Callable[[Any], tuple[tuple[Number, Number], ...]]
    powered: Callable[[Any, Any], Any] = lambda b, settings: b
    shared: tuple[int, ...] = ()
    curved: bool = False
    round: tuple[bool, ...] = ()

    def act(self, shares: Sequence[Number], now: Running, b: Any) -> Triple:
        """tau [N, N, N m], effects included, of :attr:`thrust`."""
        return total(self.thrust(shares, now, b))


class ThrusterEffects(NamedTuple):
    """The effects of a set that act on thrusters.

    Attributes:
        layout: of the thrusters.
        dynamics: those with a memory.
        forces: those without.
        changes: those that change parameters of the thrusters.
        remembering: of dynamics, those with a memory of commands and those with one of forces, each with
            its place among the memories.
    """

    layout: Layout
    dynamics: Group
    forces: Group
    remembering: Mapping[str, Sequence[tuple[int, Member, Memory]]]
    changes: Group


@cache
def thruster_effects(effects: EffectSet, layout: Layout) -> ThrusterEffects:
    """The groups of a set of effects; those with a memory of commands come first."""
    actuator = [e for e in effects.of_kind("actuator") if e.function is not None]
    slow = [e for of in ("command", "force") for e in actuator if e.memory and e.memory.of == of]
    dynamics = group("Dynamics", slow)
    remembering: dict[str, list[tuple[int, Member, Memory]]] = {"command": [], "force": []}
    for k, member in enumerate(dynamics.members):
        memory = member.effect.memory
        assert memory is not None
        remembering[memory.of].append((k, member, memory))
    now = [e for e in actuator if e.memory is None]
    forces = group("ThrusterEffects", [e for e in now if e.gives == "force"])
    changes = group("Changes", [e for e in now if e.gives == "parameters"])
    return ThrusterEffects(layout, dynamics, forces, remembering, changes)


class Past(NamedTuple):
    """What the thrusters remember: time [s], the memory of each slow effect, the last command."""

    t: Number
    memories: tuple[Number, ...]
    limited: tuple[Number, ...]


def at_rest(effects: ThrusterEffects) -> Past:
    """The past of thrusters that were never at work."""
    width = len(effects.layout.commands)
    memories = [member.effect.memory for member in effects.dynamics.members]
    return Past(0.0, tuple([m.start(width) for m in memories if m is not None]), (0.0,) * width)


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
    slow: tuple[Condition, ...]
    acting: tuple[Condition, ...]
    any_acts: Condition


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
    memories: tuple[Number, ...], signals: tuple[Number, ...], of: str, b: Prepared, h: Number
) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
    """The memories a step later, and what they make of commands or of shares of full force.

    Args:
        memories: of all effects that have one.
        signals: commands, or shares.
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


def rate_limited(before: Number, wanted: Number, rate: Number, h: Number, angle: bool) -> Number:
    """A command that moves from ``before`` towards the wanted one at no more than ``rate`` a second."""
    most = rate * h
    return before + clip(way(before, wanted, angle), -most, most)


def command_response(
    s: Past, commands: tuple[Number, ...], b: Prepared, h: Number
) -> tuple[Past, tuple[Number, ...]]:
    """The commands that reach the thrusters in a step of h [s]: delayed, and limited in their rate."""
    memories, given = remember(s.memories, commands, "command", b, h)
    rates = b.params.rate if len(b.params.rate) == len(given) else tuple(b.params.rate) * len(given)
    angles = b.effects.layout.round or (False,) * len(given)
    given = tuple(
        [
            when(
                rate > 0.0,
                lambda x=x, w=w, rate=rate, angle=angle: rate_limited(x, w, rate, h, angle),
                lambda w=w: w,
            )
            for x, w, rate, angle in zip(s.limited, given, rates, angles, strict=True)
        ]
    )
    return Past(s.t + h, memories, given), given


def force_response(
    s: Past, shares: tuple[Number, ...], b: Prepared, h: Number
) -> tuple[Past, tuple[Number, ...]]:
    """The shares of full force that act after a step of h [s], for those of the characteristic."""
    memories, shares = remember(s.memories, shares, "force", b, h)
    return s._replace(memories=memories), shares

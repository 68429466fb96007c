"""From commands to what reaches the actuators of any ship: delay, limit of rate, lag.

Commands pass the effects with a memory of commands (a delay), the limit of their rate, the
characteristic of the thrusters, and the effects with a memory of forces (a lag). What becomes of them
then is of the ship: see :class:`CommandLayout`. The functions run on floats, step by step in an FMU,
and on arrays, by which a diagnosis computes whole series.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

from ..declare import Fields
from ..effects import EffectSet, Memory, Running, Thrust
from ..effects.group import Group, Member, group
from ..effects.steering_gear import rate_limited
from ..hull import Triple
from ..ops import Condition, Number, Series, clip, fmax, when
from ..ship_description import Description
from .actuation import (
    actuators,
    command_names,
    forces,
    limits,
    ordered,
    power_of,
    shared,
    variable,
)
from .actuator import Actuator
from .law import Law, Span
from .weighted_allocation import TINY, allocate, largest

AT_REST = (0.0, 0.0, 0.0)


def total(f: Thrust) -> Triple:
    """tau [N, N, N m] of the forces of all actuators."""
    X, Y, N = 0.0, 0.0, 0.0
    for gain, f_x, f_y, x, y in zip(f.gain, f.X, f.Y, f.x, f.y, strict=True):
        f_x, f_y = gain * f_x, gain * f_y
        X, Y, N = X + f_x, Y + f_y, N + x * f_y - y * f_x
    for gain, couple in zip(f.gain, f.couple, strict=False):
        N = N + gain * couple
    N = N + f.dx * Y - f.dy * X
    return X * (1.0 - f.loss_X), Y * (1.0 - f.loss_Y), N * (1.0 - f.loss_N)


@dataclass(frozen=True, eq=False)
class CommandLayout:
    """How a ship's commands become a force, with the effects of its actuators.

    Attributes:
        ship: whose actuators they are.
        apart: whether each unit of those with two has commands of its own.
    """

    ship: Description
    apart: bool = False

    @cached_property
    def commands(self) -> tuple[str, ...]:
        """Names of their variables, in the order of all tuples of commands and shares."""
        return tuple(map(variable, command_names(self.ship, self.apart)))

    @cached_property
    def shared(self) -> tuple[int, ...]:
        """For each command of each actuator the place of the one that is given; empty: each is."""
        places = shared(self.ship)
        return places if not self.apart and len(places) > len(self.commands) else ()

    @cached_property
    def curved(self) -> bool:
        """Whether forces are not in proportion to what acts."""
        return not all(a.law.proportional for a in actuators(self.ship))

    @cached_property
    def round(self) -> tuple[bool, ...]:
        """For each command whether it is an angle that goes round."""
        return tuple([angle for a, _ in self._sets() for angle in a.round])

    @cached_property
    def lags(self) -> tuple[float, ...]:
        """For each command the lag of its actuator [s], as it is described."""
        return tuple([a.part.number("lag") for a, _ in self._sets() for _ in a.law.commands])

    @cached_property
    def rates(self) -> tuple[float, ...]:
        """For each command the limit of its rate, as it is described; zero: none."""
        return tuple([a.part.number(f"{c.name}_rate") for a, _ in self._sets() for c in a.law.commands])

    def _sets(self) -> list[tuple[Actuator, float]]:
        """Each actuator with commands of its own, as often as it has them."""
        return [(a, side) for a in ordered(self.ship) for side in (a.sides if self.apart else (0.0,))]

    def running(
        self,
        t: Series,
        u: Series,
        v: Series,
        r: Series,
        commands: Sequence[Series],
        b: "PreparedThrusters",
    ) -> Running:
        """What the force of the actuators may depend on, at a time [s], velocity and commands."""
        p = b.params
        units = [c.unit for a, _ in self._sets() for c in a.law.commands]
        part = [
            c if unit == "1" else clip(c / fmax(fmax(high, -low), TINY), -1.0, 1.0)
            for c, unit, (low, high) in zip(commands, units, self.limits(p), strict=True)
        ]
        each = part if self.apart else [part[k] for k in shared(self.ship)]
        power = zip(actuators(self.ship), power_of(self.ship, p.power), strict=True)
        gains = [x for a, x in power for _ in a.sides]
        return Running(t, u, v, r, tuple(commands), tuple(each), tuple(gains))

    def thrust(self, acting: Sequence[Number], now: Running, b: "PreparedThrusters") -> Thrust:
        """The force of each unit by the commands that act, effects included."""
        p = b.params
        f = forces(self.ship, acting, (now.u, now.v, now.r), p.plant, p.power, self.apart)
        for member, acts in zip(b.effects.forces.members, b.acting, strict=True):
            f = member.apply(acts, p.wrong, f, f, now)
        return f

    def act(self, acting: Sequence[Number], now: Running, b: "PreparedThrusters") -> Triple:
        """tau [N, N, N m], effects included, of :meth:`thrust`."""
        return total(self.thrust(acting, now, b))

    def nominal_force(
        self, commands: Sequence[Number], p: Fields, nu: tuple[Series, Series, Series] = AT_REST
    ) -> Triple:
        """tau [N, N, N m] that the allocation expects of commands at a velocity, by default at rest."""
        settings = p.power if self.apart else ()  # of a run are given with the commands of each unit
        return total(forces(allocating(self.ship), commands, nu, p.allocation, settings, self.apart))

    def allocate(self, tau: Triple, p: Fields) -> tuple[Number, ...]:
        """The commands that give a force, as nearly as they can."""
        return allocate(allocating(self.ship), tau, AT_REST, p.allocation, self.apart)

    def full(self, p: Fields) -> Triple:
        """The largest force and moment on each axis [N, N, N m]."""
        return largest(allocating(self.ship), p.allocation, self.apart)

    def limits(self, p: Fields) -> tuple[Span, ...]:
        """The lowest and the highest value of each command."""
        return limits(self.ship, p.plant, self.apart)

    def powered(self, b: "PreparedThrusters", settings: Sequence[Number]) -> "PreparedThrusters":
        """The actuators at settings of their power, of each that has one."""
        p = b.params
        power = p.power._make([x * s for x, s in zip(p.power, settings, strict=True)])
        return b._replace(params=p._replace(power=power))


@cache
def allocating(ship: Description) -> Description:
    """The ship as the allocation has it, which may know simpler laws."""
    laws = [Law.known[part.law].allocated for part in ship.actuators]
    parts = [
        p if x is None else p._replace(law=x.name) for p, x in zip(ship.actuators, laws, strict=True)
    ]
    return ship._replace(actuators=tuple(parts))


@cache
def layouts(ship: Description) -> tuple[CommandLayout, ...]:
    """How runs may have a ship's commands: as its FMU does, and each unit by its own."""
    each = any(len(a.sides) > 1 for a in actuators(ship))
    return (CommandLayout(ship), CommandLayout(ship, apart=True)) if each else (CommandLayout(ship),)


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

    layout: CommandLayout
    dynamics: Group
    forces: Group
    remembering: Mapping[str, Sequence[tuple[int, Member, Memory]]]
    changes: Group


@cache
def thruster_effects(effects: EffectSet, layout: CommandLayout) -> ThrusterEffects:
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
    memories: tuple[tuple[object, ...], ...]
    limited: tuple[Number, ...]


def at_rest(effects: ThrusterEffects) -> Past:
    """The past of thrusters that were never at work."""
    width = len(effects.layout.commands)
    memories = [member.effect.memory for member in effects.dynamics.members]
    return Past(0.0, tuple([m.start(width) for m in memories if m is not None]), (0.0,) * width)


class PreparedThrusters(NamedTuple):
    """What follows from the parameters alone: which effects act.

    Attributes:
        params: of the thrusters.
        effects: of the thrusters.
        slow: for each effect with a memory, whether it acts.
        acting: for each effect without, whether it acts.
        any_acts: whether any of these acts.
    """

    params: Fields
    effects: ThrusterEffects
    slow: tuple[Condition, ...]
    acting: tuple[Condition, ...]
    any_acts: Condition


def prepared(p: Fields, effects: ThrusterEffects) -> PreparedThrusters:
    """Everything that a step needs of the parameters."""
    return PreparedThrusters(
        p,
        effects,
        effects.dynamics.acting(p.dynamics),
        effects.forces.acting(p.wrong),
        effects.forces.any_acts(p.wrong),
    )


def remember(
    memories: tuple[tuple[object, ...], ...],
    signals: tuple[Number, ...],
    of: str,
    b: PreparedThrusters,
    h: Number,
) -> tuple[tuple[tuple[object, ...], ...], tuple[Number, ...]]:
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


def command_response(
    s: Past, commands: tuple[Number, ...], b: PreparedThrusters, h: Number
) -> tuple[Past, tuple[Number, ...]]:
    """The commands that reach the thrusters in a step of h [s]: delayed, and limited in their rate.

    Where a command moves within a step its mean arrives, as the vessel holds the force over a step.
    """
    memories, given = remember(s.memories, commands, "command", b, h)
    rates = b.params.rate if len(b.params.rate) == len(given) else tuple(b.params.rate) * len(given)
    both = [
        when(
            rate > 0.0,
            lambda x=x, w=w, rate=rate, angle=angle: rate_limited(x, w, rate, h, angle),
            lambda w=w: (w, w),
        )
        for x, w, rate, angle in zip(s.limited, given, rates, b.effects.layout.round, strict=True)
    ]
    return Past(s.t + h, memories, tuple([x for x, _ in both])), tuple([x for _, x in both])


def force_response(
    s: Past, shares: tuple[Number, ...], b: PreparedThrusters, h: Number
) -> tuple[Past, tuple[Number, ...]]:
    """The shares of full force that act over a step of h [s], for those of the characteristic."""
    memories, shares = remember(s.memories, shares, "force", b, h)
    return s._replace(memories=memories), shares

"""What may go wrong with an actuator: one declaration for all, made for each actuator of a ship.

The effects act on :class:`Pushing`, the forces of all actuators, one after the other. Their ids and
parameters end in the name of the actuator.
"""

from collections.abc import Callable
from math import degrees, pi
from typing import Any, NamedTuple

from ..declare import POSITIVE, Range, Variable, variables
from ..effects.actuator import SHARE, limited, reduced
from ..effects.curve import NODES, interpolate, node_parameters
from ..effects.effect import Effect, Memory, Search, Wording, effect
from ..effects.families import Family
from ..effects.outages import INSTANT, inside, outage_parameters, pairs_of, spans
from ..effects.text import Found, lost, number, peak, percent, towards
from ..effects.thruster_dynamics import FORGOTTEN, LONGEST, TIMES, share_reached
from ..ops import Number, cos, fmax, sin, where
from ..scale import Scale
from ..ship_description import Part
from .law import Flow, Law
from .response import way

ANY = Range()
# Shares of full force, or of the effect of full speed, to try.
SHARES = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
SPEED_LOSSES = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 15.0)  # s/m at the size of the reference ship


class Working(NamedTuple):
    """What an actuator's force may depend on: time [s], velocity of the ship, commands that arrive.

    ``given`` has the commands of all actuators, ``part`` each as a share of its largest one.
    """

    t: Any
    u: Any
    v: Any
    r: Any
    given: tuple[Any, ...]
    part: tuple[Any, ...]


class Pushing(NamedTuple):
    """Forces X and Y [N] of each actuator, where they act (x, y) [m], and what their sum loses.

    ``loss_*`` is the part of tau that is lost on each axis; ``dx`` and ``dy`` [m] is how far from the
    assumed point all of it acts.
    """

    X: tuple[Any, ...]
    Y: tuple[Any, ...]
    x: tuple[Any, ...]
    y: tuple[Any, ...]
    loss_X: Any = 0.0
    loss_Y: Any = 0.0
    loss_N: Any = 0.0
    dx: Any = 0.0
    dy: Any = 0.0


def with_one(values: tuple[Any, ...], k: int, value: Any) -> tuple[Any, ...]:
    """The values with another one at place k."""
    return (*values[:k], value, *values[k + 1 :])


def pushed(f: Pushing, k: int, X: Any, Y: Any) -> Pushing:
    """The forces with others of actuator k."""
    return f._replace(X=with_one(f.X, k, X), Y=with_one(f.Y, k, Y))


def scaled(f: Pushing, k: int, gain: Any) -> Pushing:
    """The forces with those of actuator k times a gain."""
    return pushed(f, k, f.X[k] * gain, f.Y[k] * gain)


def stopped(f: Pushing, k: int, dead: Any) -> Pushing:
    """The forces without those of actuator k where it is dead."""
    return pushed(f, k, where(dead, 0.0, f.X[k]), where(dead, 0.0, f.Y[k]))


class Actuator(NamedTuple):
    """An actuator of a ship.

    Attributes:
        k: its number.
        first: number of its first command among those of the ship.
        part: its description.
        law: that it follows.
        scale: of its ship.
        round: for each of its commands whether it is an angle that goes round.
    """

    k: int
    first: int
    part: Part
    law: type[Law]
    scale: Scale
    round: tuple[bool, ...]

    @property
    def commands(self) -> slice:
        """Where its commands lie among those of the ship."""
        return slice(self.first, self.first + len(self.law.commands))

    @property
    def axis(self) -> str:
        """Axes on which its force may act."""
        ahead = self.law.components != "Y" or self.law.name == "rudder"
        aside = "Y" in self.law.components
        turns = aside or self.part.number("y") != 0.0
        return "X" * ahead + "Y" * aside + "N" * turns

    @property
    def family(self) -> Family:
        """The manoeuvre that brings out what is wrong with it."""
        title = self.part.title
        return Family(
            title,
            f"the {title} alone, at several commands, at rest and at speed",
            {title: f"the {title} at rest and at speed, small and large commands"},
        )


def goes_round(part: Part, law: type[Law]) -> tuple[bool, ...]:
    """For each command of an actuator whether it is an angle that goes round."""
    starts = {v.name: v.start for v in variables(law.Parameters)}
    limits = [c.angle_limit for c in law.commands]
    return tuple([bool(name) and part.number(name, starts[name]) >= pi for name in limits])


def declared(
    a: Actuator,
    name: str,
    axis: str,
    parameters: tuple[Variable, ...],
    sentence: Callable[[Found], str],
    **more: Any,
) -> Callable[[Callable[..., Any]], Effect]:
    """The decorator that makes an effect of an actuator."""
    return effect(
        name,
        "actuator",
        axis,
        parameters=parameters,
        wording=Wording(sentence, a.family),
        **more,
    )


def parameter(name: str, unit: str, text: str, limits: Range = ANY) -> tuple[Variable, ...]:
    """One parameter that is zero where there is no effect."""
    return (Variable(name, unit, text, 0.0, limits, False),)


def loss(a: Actuator) -> Effect:
    """A share of the force is lost."""
    name, title, k = f"loss_{a.part.name}", a.part.title, a.k
    believed = f"The {title} gives {{}} {{}} force than the model believes."

    @declared(
        a,
        name,
        a.axis,
        parameter(name, "1", f"share of the {title}'s force lost", SHARE),
        lost(name, believed.format("{}", "less"), believed.format("{}", "more")),
        formula="f (1 - δ)",
        symbol="δ",
        sign="positive: force is lost",
        description=f"force lost by the {title}",
    )
    def function(f: Pushing, now: Working, share: Number) -> Pushing:
        return scaled(f, k, 1.0 - share)

    return function


def speed_loss(a: Actuator) -> Effect:
    """The force falls with the ship's speed."""
    name, title, k = f"{a.part.name}_speed_loss", a.part.title, a.k

    @declared(
        a,
        name,
        a.axis,
        parameter(name, "s/m", f"effectiveness of the {title} lost with surge speed", POSITIVE),
        lambda f: (
            f"The {title} loses force with the speed: "
            f"{percent(min(1.0, f[name] * f.speeds[0]))} of it at {f.speeds[0]:.2g} m/s."
        ),
        formula="f max(0, 1 - k |u|)",
        symbol="k",
        sign="positive: less force at speed",
        linear=False,
        search=Search(tries=[{name: a.scale.factor("s/m") * x} for x in SPEED_LOSSES]),
        description=f"{title} less effective with surge speed",
    )
    def function(f: Pushing, now: Working, slope: Number) -> Pushing:
        return scaled(f, k, fmax(0.0, 1.0 - slope * abs(now.u)))

    return function


def failure(a: Actuator) -> Effect:
    """Dead from a time on."""
    name, title, k = f"{a.part.name}_failure", a.part.title, a.k
    time = f"{name}_time"

    @declared(
        a,
        name,
        a.axis,
        parameter(time, "s", f"time from which the {title} is dead; 0: never", POSITIVE),
        lambda f: f"The {title} is dead from t = {number(f[time])} s on.",
        formula="f = 0 for t >= time",
        symbol="time",
        sign="0: never",
        linear=False,
        search=Search(intervals=((time, ""),)),
        description=f"{title} dead from a time on",
    )
    def function(f: Pushing, now: Working, since: Number) -> Pushing:
        return stopped(f, k, (since > 0.0) & (now.t >= since - INSTANT))

    return function


def outage(a: Actuator) -> Effect:
    """Dead during intervals."""
    name, title, k = a.part.name, a.part.title, a.k
    times = outage_parameters(name)

    @declared(
        a,
        f"{name}_outage",
        a.axis,
        times,
        lambda f: f"The {title} is dead {spans(f)}.",
        formula="f = 0 for start_k <= t < end_k",
        symbol="intervals",
        sign="an interval that ends where it starts: none",
        linear=False,
        search=Search(intervals=pairs_of(times), lasting=f"{name}_failure"),
        description=f"{title} dead during intervals",
    )
    def function(f: Pushing, now: Working, *intervals: Number) -> Pushing:
        return stopped(f, k, inside(now.t, intervals))

    return function


def full_force(a: Actuator) -> float:
    """The largest force [N] that the description gives it at rest."""
    p = a.law.Parameters(
        **{v.name: v.value for v in a.part.values if v.name in a.law.Parameters._fields}
    )
    most = [abs(end) for span in a.law.reach(Flow(0.0, 0.0), p) for end in span]
    return max(most, default=0.0)


def clipped(a: Actuator) -> list[Effect]:
    """A dead band, and a limit below that of the commands."""
    title, k, full = a.part.title, a.k, full_force(a)
    if full == 0.0:
        return []
    band, limit = f"deadband_{a.part.name}", f"saturation_{a.part.name}"

    @declared(
        a,
        band,
        a.axis,
        parameter(band, "N", f"force of the {title} without effect", POSITIVE),
        lambda f: (
            f"The {title} gives nothing below {number(f[band])} N, and {number(f[band])} N less above."
        ),
        formula="f - clip(f, -d, d)",
        symbol="d",
        sign="forces below d are lost, the rest is reduced by d",
        linear=False,
        search=Search(tries=[{band: share * full} for share in SHARES[:5]]),
        description=f"dead band of the {title}",
    )
    def dead_band(f: Pushing, now: Working, d: Number) -> Pushing:
        return pushed(f, k, reduced(f.X[k], d), reduced(f.Y[k], d))

    @declared(
        a,
        limit,
        a.axis,
        parameter(limit, "N", f"real limit of the {title}'s force; 0: none", POSITIVE),
        lambda f: f"The {title} gives at most {number(f[limit])} N, whatever is commanded.",
        formula="clip(f, -limit, limit)",
        symbol="limit",
        sign="0: no limit",
        linear=False,
        search=Search(tries=[{limit: share * full} for share in SHARES[3:]]),
        description=f"real limit of the {title}, lower than that of its commands",
    )
    def saturation(f: Pushing, now: Working, most: Number) -> Pushing:
        return pushed(f, k, limited(f.X[k], most), limited(f.Y[k], most))

    return [dead_band, saturation]


def elsewhere(a: Actuator) -> Effect:
    """The force acts elsewhere than described."""
    name, title, k = f"place_{a.part.name}", a.part.title, a.k
    dx, dy = f"{name}_dx", f"{name}_dy"
    at = Range(-0.6 * a.scale.length, 0.6 * a.scale.length)

    @declared(
        a,
        name,
        "N",
        (
            *parameter(dx, "m", f"place of the {title} forward of the assumed one", at),
            *parameter(dy, "m", f"place of the {title} to starboard of the assumed one", at),
        ),
        lambda f: (
            f"The {title} acts {towards(100.0 * f[dx], 'cm', 'X')} and "
            f"{towards(100.0 * f[dy], 'cm', 'Y')} of where the model believes."
        ),
        formula="N + dx · Y - dy · X",
        symbol="dx, dy",
        sign="positive: ahead and to starboard of where it is assumed",
        description=f"the {title} acts elsewhere than assumed",
    )
    def function(f: Pushing, now: Working, dx: Number, dy: Number) -> Pushing:
        return f._replace(x=with_one(f.x, k, f.x[k] + dx), y=with_one(f.y, k, f.y[k] + dy))

    return function


def turned(a: Actuator) -> Effect:
    """The force points elsewhere than described."""
    name, title, k = f"angle_{a.part.name}", a.part.title, a.k

    @declared(
        a,
        name,
        "XYN",
        parameter(name, "rad", f"angle of the {title}'s force to starboard of the assumed one", SHARE),
        lambda f: (
            f"The {title} pushes {degrees(abs(f[name])):.3g}° to "
            f"{'starboard' if f[name] > 0.0 else 'port'} of where the model believes."
        ),
        formula="(X cos a - Y sin a, Y cos a + X sin a)",
        symbol="a",
        sign="positive: to starboard",
        linear=False,
        search=Search(differentiable=True),
        description=f"the {title} points elsewhere than assumed",
    )
    def function(f: Pushing, now: Working, angle: Number) -> Pushing:
        c, s = cos(angle), sin(angle)
        return pushed(f, k, f.X[k] * c - f.Y[k] * s, f.Y[k] * c + f.X[k] * s)

    return function


def inflow(a: Actuator) -> Effect:
    """The force falls with the water's speed at the actuator."""
    name, title, k, first = f"inflow_{a.part.name}", a.part.title, a.k, a.first + len(a.law.commands) - 1

    @declared(
        a,
        name,
        "XYN",
        parameter(name, "N.s/m", f"force of the {title} lost with the water's speed at its place"),
        lambda f: (
            f"The {title} gives {number(f[name] * f.speeds[0])} N "
            f"{'less' if f[name] > 0.0 else 'more'} at {f.speeds[0]:.2g} m/s and full command."
        ),
        formula="f - k |c| v_local",
        symbol="k",
        sign="positive: force against the water's motion, with the command",
        description=f"force of the {title} lost with the water's speed at its place",
    )
    def function(f: Pushing, now: Working, slope: Number) -> Pushing:
        lost = slope * abs(now.part[first])
        X = f.X[k] - lost * (now.u - f.y[k] * now.r)
        return pushed(f, k, X, f.Y[k] - lost * (now.v + f.x[k] * now.r))

    return function


def curve(a: Actuator) -> Effect:
    """The force follows a curve of its own over the command."""
    place = a.first + len(a.law.commands) - 1
    command = a.law.commands[-1]
    title, k, stem = a.part.title, a.k, f"curve_{a.part.name}"
    nodes = node_parameters(stem, "1", f"change of the {title}'s force", "command", "1", 1.0)

    def sentence(f: Found) -> str:
        at, value = peak(f)
        return (
            f"The {title}'s force follows another curve over its command than the model's: "
            f"{percent(value)} {'less' if value < 0.0 else 'more'} at {percent(2.0 * at - 1.0)} of "
            f"full {'ahead' if at >= 0.5 else 'astern'}."
        )

    @declared(
        a,
        f"{stem}({command.name})",
        a.axis,
        nodes,
        sentence,
        formula=f"f (1 + Σ c_k · hat_k(c)), {NODES} nodes over the command's range",
        symbol=f"c_1 … c_{NODES}",
        sign="positive: more force than assumed",
        settings=(f"{stem}_range",),
        search=Search(smooth=True),
        description=f"free change of the {title}'s force over its command",
    )
    def function(f: Pushing, now: Working, *values: Number) -> Pushing:
        *heights, span = values
        return scaled(f, k, 1.0 + interpolate(now.part[place], -span, span, heights))

    return function


def slow(a: Actuator, width: int) -> Effect:
    """A first-order lag of its commands."""
    name, title, own = f"lag_{a.part.name}", a.part.title, a.commands

    @declared(
        a,
        name,
        a.axis,
        parameter(name, "s", f"first-order lag of the {title}", a.scale.limits("s", LONGEST)),
        lambda f: f"The {title} follows its command with a time constant {number(f[name])} s longer.",
        formula="T dc/dt = c_cmd - c",
        symbol="T",
        sign="0: none",
        linear=False,
        memory=Memory(
            (0.0,) * width, "force", lambda lag: FORGOTTEN * lag, idle=lambda before, wanted: wanted
        ),
        search=Search(tries=[{name: a.scale.time * T} for T in (*TIMES, 2.0)]),
        description=f"first-order lag of the {title}",
    )
    def function(
        before: tuple[Any, ...], wanted: tuple[Any, ...], h: Number, lag: Number
    ) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        share = share_reached(h, lag)
        moved = [
            x + share * way(x, w, angle)
            for x, w, angle in zip(before[own], wanted[own], a.round, strict=True)
        ]
        after = (*wanted[: own.start], *moved, *wanted[own.stop :])
        return after, after

    return function


def failings(a: Actuator, width: int) -> list[Effect]:
    """All that may go wrong with an actuator of a ship with ``width`` commands."""
    return [
        curve(a),
        loss(a),
        speed_loss(a),
        inflow(a),
        failure(a),
        *clipped(a),
        turned(a),
        elsewhere(a),
        outage(a),
        slow(a, width),
    ]

"""Effects on all thrusters of any ship together: losses by axis, point of attack, lag and delay."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple

from ..declare import Range
from ..ops import Number, exp, floor, fmax, pick, when, where, wrap
from ..scale import REFERENCE
from .devices import SHARE, Devices, declared, parameter
from .effect import Effect, Memory, Running, Search, Thrust, Wording, effect
from .families import PROPELLERS, SIDE_THRUST, SYNC_PULSE, TIMING, Family
from .misplaced import place_parameters
from .text import Found, against_command, lost, number, offset

SLOTS = 64  # commands that a delay keeps; a longer one is remembered in coarser steps
FORGOTTEN = 12.0  # time constants after which e^-12 = 6e-6 of an earlier command is left
LONGEST = Range(0.0, 60.0)  # s
DEDUCTION = 0.2  # 1, share of thrust that the hull takes: 0.1 to 0.3 of most ships, by direction
# s: from a sample or two to the longest that a ship of this size could be steered with.
TIMES = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5)


def shares_reached(h: Number, lag: Number) -> tuple[Number, Number]:
    """Shares of its way that a first-order lag [s] has gone after h [s], and in the mean over these.

    Both are exact for an input that is held.
    """
    x = fmax(h / fmax(lag, 1e-9), 1e-6)  # no step takes no time: the mean is the value
    gone = 1.0 - exp(-x)
    return gone, 1.0 - gone / x


def lag_filter(h: float, lag: float) -> tuple[Sequence[float], Sequence[float]]:
    """The mean over each step of a first-order lag as a linear filter, see :class:`.effect.Memory`."""
    gone, mean = shares_reached(h, lag)
    return (mean, gone - mean), (1.0, gone - 1.0)


def way(before: Number, wanted: Number, angle: bool) -> Number:
    """From a command to another one; of an angle that goes round the shorter way [rad]."""
    return wrap(wanted - before) if angle else wanted - before


def slow(
    d: Devices,
    name: str,
    sentence: Callable[[Found], str],
    own: slice,
    turns: Sequence[bool] = (),
    **more: Any,
) -> Effect:
    """A first-order lag of some of the commands, of which the mean over a step acts.

    The vessel holds a force over a step, so that the one of the step's end would be half a step early.

    Args:
        d: the actuators.
        name: of the effect and its parameter.
        sentence: its finding.
        own: places of the commands among those of the ship.
        turns: for each of these whether it is an angle that goes round; empty: none is.
        more: further arguments of :func:`declared`.
    """

    @declared(
        d,
        name,
        (parameter(name, "s", f"first-order lag of {d.label}", d.scale.limits("s", LONGEST)),),
        sentence,
        formula="T df/dt = f_cmd - f",
        symbol="T",
        sign="0: none",
        source="6.4.5",
        linear=False,
        memory=Memory(
            lambda width: (0.0,) * width,
            "force",
            lambda lag: FORGOTTEN * lag,
            idle=lambda before, wanted: wanted,
            filter=lag_filter,
            own=own,
        ),
        search=Search(tries=[{name: d.scale.time * T} for T in (*TIMES, 2.0)]),
        description=f"first-order lag of {d.label}",
        **more,
    )
    def function(
        before: tuple[Number, ...], wanted: tuple[Number, ...], h: Number, lag: Number
    ) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
        gone, mean = shares_reached(h, lag)
        angles = turns or (False,) * len(before[own])
        ways = [way(x, w, angle) for x, w, angle in zip(before[own], wanted[own], angles, strict=True)]

        def moved(share: Number) -> tuple[Number, ...]:
            own_ones = [x + share * along for x, along in zip(before[own], ways, strict=True)]
            return (*wanted[: own.start or 0], *own_ones, *wanted[own.stop or len(wanted) :])

        return moved(gone), moved(mean)

    return function


def _axis_loss(axis: str, way: str, what: str, family: Family, apart: dict[str, str]) -> Effect:
    """A share of tau that is lost on one axis."""
    name, field = f"loss_{way}", f"loss_{axis}"
    sentence = lost(
        name,
        lambda size, than: (
            f"The thrusters lose {size} of the commanded {way} {what}."
            if than == "less"
            else f"The {way} {what} is {size} larger than commanded."
        ),
    )

    @effect(
        name,
        "actuator",
        axis,
        formula=f"{axis}_act = (1 - δ) {axis}_cmd",
        symbol="δ",
        sign=f"positive: {what} is lost",
        source="(2.39), (7.3)-(7.6)",
        parameters=(parameter(name, "1", f"share of {way} {what} lost", SHARE),),
        usual=DEDUCTION,
        description=f"{what} lost in {way}",
        wording=Wording(sentence, family, apart, measured=against_command),
    )
    def function(f: Thrust, now: Running, share: float) -> Thrust:
        return f._replace(**{field: getattr(f, field) + share})

    return function


APART_SURGE = {
    "X_u": "change the speed often, instead of holding it",
    "mass": "run steady and accelerating legs",
}
APART_SWAY = {"Y_r": "crab to both sides with no turn"}
APART_YAW = {"N_r": "turn on the spot, with starts and stops of the turn"}
loss_surge = _axis_loss("X", "surge", "force", PROPELLERS, APART_SURGE)
loss_sway = _axis_loss("Y", "sway", "force", SIDE_THRUST, APART_SWAY)
loss_yaw = _axis_loss("N", "yaw", "moment", SIDE_THRUST, APART_YAW)


@effect(
    "attack_point",
    "actuator",
    "N",
    formula="N + dx · Y - dy · X",
    symbol="dx, dy",
    sign="positive: ahead and to starboard of the assumed point",
    source="(2.17)-(2.19)",
    parameters=place_parameters("attack_point", "point of attack", REFERENCE),
    description="the force acts at another point than assumed",
    wording=Wording(
        lambda f: f"The thrust acts {offset(f, 'attack_point')} of the point in the model.",
        SIDE_THRUST,
    ),
)
def attack_point(f: Thrust, now: Running, dx: float, dy: float) -> Thrust:
    return f._replace(dx=f.dx + dx, dy=f.dy + dy)


LOSSES = (loss_surge, loss_sway, loss_yaw, attack_point)


lag = slow(
    Devices("", "thrusters", "all thrusters", (), (), "XYN", TIMING, plural=True),
    "lag",
    lambda f: f"The thrusters follow their commands with a time constant of {number(f['lag'])} s.",
    slice(None),
    apart={
        "delay": "apply steps in the commands, and sample faster",
        "clock_offset": "apply steps in the commands; " + SYNC_PULSE,
    },
)


class Kept(NamedTuple):
    """Commands that a delay remembers, the latest first, and the time since the latest [s]."""

    since: Number
    commands: tuple[tuple[Number, ...], ...]


def delay_filter(h: float, delay: float) -> tuple[Sequence[float], Sequence[float]]:
    """A delay that keeps every step as a linear filter, see :class:`.effect.Memory`."""
    ago = floor(delay / h + 1e-6)
    part = fmax(0.0, delay / h - ago)
    return (*[0.0] * int(ago), 1.0 - part, part), (1.0,)


@effect(
    "delay",
    "actuator",
    "XYN",
    formula="f(t) = f_cmd(t - T)",
    symbol="T",
    sign="0: none",
    source="6.4.5",
    linear=False,
    description="pure delay of all thrusters",
    memory=Memory(
        lambda width: Kept(0.0, ((0.0,) * width,) * SLOTS),
        "command",
        lambda delay: delay,
        SLOTS,
        filter=delay_filter,
    ),
    search=Search(tries=[{"delay": T} for T in TIMES]),
    wording=Wording(
        lambda f: f"The thrusters act {number(f['delay'])} s after they are commanded.",
        TIMING,
        {"clock_offset": SYNC_PULSE},
    ),
)
def delay(
    kept: Kept,
    command: tuple[Number, ...],
    h: Number,
    delay: Annotated[float, "s", "pure delay of all thrusters", LONGEST] = 0.0,
) -> tuple[Kept, tuple[Number, ...]]:
    """Pure delay: the mean over the step of held commands of some time ago."""
    since = kept.since + h
    # Time between two remembered commands: a step, or more where the delay is long.
    tick = fmax(fmax(h, delay / (SLOTS - 1.0)), 1e-9)
    due = (h > 0.0) & (since >= tick - 1e-9)
    commands = when(due, lambda: (command, *kept.commands[:-1]), lambda: kept.commands)
    place = delay / tick
    ago = floor(place + 1e-6)
    part = fmax(0.0, place - ago)
    arriving = tuple(
        (1.0 - part) * a + part * b
        for a, b in zip(pick(commands, ago), pick(commands, ago + 1.0), strict=True)
    )
    return Kept(where(due, since - tick, since), commands), arriving

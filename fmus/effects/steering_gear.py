"""What a steering gear does to a commanded angle: it turns at a limited rate, and has play."""

from collections.abc import Callable, Sequence
from math import degrees, pi
from typing import Any, Literal

from ..declare import Range, Variable
from ..ops import Number, clip, fmax
from .all_thrusters import way
from .devices import Devices, declared, parameter
from .effect import EachSignal, Effect, Memory, Search
from .text import Found

# rad/s, times the scale of the ship. Chosen about the 65 degrees in 28 s that SOLAS asks of a ship of
# 100 m, 0.4 rad/s at the size of the reference ship: half a turn takes 2 to 40 s.
RATES = (0.08, 0.13, 0.2, 0.32, 0.5, 0.8, 1.3)
PLAYS = (0.03, 0.06, 0.1, 0.15, 0.22, 0.32)  # rad, from end to end; chosen
# s, times the scale of the ship; after that an angle was moved by more than its play. Chosen.
USED = 20.0


def rate_limited(
    before: Number, wanted: Number, rate: Number, h: Number, angle: bool
) -> tuple[Number, Number]:
    """A command that moves from ``before`` towards the wanted one at no more than ``rate`` a second.

    Returns:
        Its value after h [s], and its mean over these.
    """
    most = rate * h
    moved = clip(way(before, wanted, angle), -most, most)
    moving = abs(moved) / fmax(most, 1e-12)  # share of the step until it is there
    return before + moved, before + moved * (1.0 - 0.5 * moving)


def dragged(
    before: Number, wanted: Number, play: Number, h: Number, angle: bool
) -> tuple[Number, Number]:
    """An angle that a command drags along behind a play, half of it to each side.

    Returns:
        Its value after h [s], and its mean over these, which is the same: it moves with the command.
    """
    half = 0.5 * play
    after = wanted + clip(way(wanted, before, angle), -half, half)
    return after, after


def gear(
    d: Devices,
    v: Variable,
    places: Sequence[int],
    turns: Sequence[bool],
    of: Literal["command", "force"],
    move: Callable[..., tuple[Number, Number]],
    lasts: Callable[[Number], Number],
    **more: Any,
) -> Effect:
    """An effect of one parameter on some of the angles that are commanded.

    Args:
        d: the actuators.
        v: the parameter, by whose name the effect is called.
        places: of the angles among the commands of the ship.
        turns: for each of these whether it goes round.
        of: see :class:`.Memory`.
        move: ``move(before, wanted, value, h, turns)``: an angle after a step, and its mean over it.
        lasts: of the memory.
        more: further arguments of :func:`declared`.
    """

    @declared(
        d,
        v.name,
        (v,),
        linear=False,
        memory=Memory(
            (0.0,) * len(places),
            of,
            lasts,
            idle=lambda before, wanted: tuple([wanted[k] for k in places]),
            each=EachSignal(move, tuple(places), tuple(turns)),
            own=slice(min(places), max(places) + 1),
        ),
        **more,
    )
    def function(
        before: tuple[Number, ...], wanted: tuple[Number, ...], h: Number, value: Number
    ) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
        each = zip(before, places, turns, strict=True)
        after, means = zip(*[move(x, wanted[k], value, h, angle) for x, k, angle in each], strict=True)
        moved = dict(zip(places, means, strict=True))
        return after, tuple([moved.get(k, x) for k, x in enumerate(wanted)])

    return function


def gears(d: Devices, places: Sequence[int], turns: Sequence[bool]) -> list[Effect]:
    """The rate limit and the play of some angles that are commanded; arguments as of :func:`gear`."""
    rate, play = f"rate_{d.name}", f"play_{d.name}"
    at = d.scale.factor("rad/s")
    reach = 2.0 * pi if any(turns) else pi  # rad, from end to end

    def limited(f: Found) -> str:
        return f"{d.does('turn')} at {degrees(f[rate]):.3g} °/s at the most."

    def loose(f: Found) -> str:
        return f"{d.does('follow')} the command with a play of {degrees(f[play]):.3g}°."

    return [
        gear(
            d,
            parameter(
                rate,
                "rad/s",
                f"largest rate of turn of the {d.label}",
                d.scale.limits("rad/s", Range(0.0, 10.0)),
            ),
            places,
            turns,
            "command",
            rate_limited,
            lambda rate: reach / fmax(rate, 1e-9),
            sentence=limited,
            formula="|dα/dt| <= rate",
            symbol="rate",
            sign="0: no limit",
            source="SOLAS II-1, 29: 65 degrees in 28 s",
            search=Search(tries=[{rate: at * x} for x in RATES]),
            description=f"limited rate of turn of the {d.title}",
        ),
        gear(
            d,
            parameter(play, "rad", f"play of the {d.label} from end to end", Range(0.0, pi)),
            places,
            turns,
            "force",  # behind the gear, whose rate is limited and which lags
            dragged,
            lambda play: USED * d.scale.time + 0.0 * play,
            sentence=loose,
            formula="α = clip(α, α_cmd - play / 2, α_cmd + play / 2)",
            symbol="play",
            sign="0: none",
            source="backlash of a mechanism",
            search=Search(tries=[{play: x} for x in PLAYS]),
            description=f"play of the {d.title}",
        ),
    ]

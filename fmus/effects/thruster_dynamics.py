"""Thrusters that follow their commands late or slowly."""

from typing import Annotated, Any, NamedTuple

from ..declare import Range
from ..ops import Number, exp, floor, fmax, pick, when, where
from .effect import Memory, Search, Wording, effect
from .families import SYNC_PULSE, TIMING
from .text import number

# Commands that a delay keeps; a longer one is remembered in coarser steps.
SLOTS = 64
# Values to try [s]: from a sample or two to the longest that a ship of this size could be steered with.
TIMES = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5)
FORGOTTEN = 12.0  # time constants after which e^-12 = 6e-6 of an earlier command is left
LONGEST = Range(0.0, 60.0)  # s


def share_reached(h: Number, lag: Number) -> Number:
    """Share of its way that a first-order lag [s] has gone after h [s], for an input that is held."""
    return 1.0 - exp(-h / fmax(lag, 1e-9))


@effect(
    "lag",
    "actuator",
    "XYN",
    formula="T df/dt = f_cmd - f",
    symbol="T",
    sign="0: none",
    source="6.4.5",
    linear=False,
    description="first-order lag of all thrusters",
    memory=Memory(
        lambda width: (0.0,) * width,
        "force",
        lambda lag: FORGOTTEN * lag,
        idle=lambda before, wanted: wanted,
    ),
    search=Search(tries=[{"lag": T} for T in (*TIMES, 2.0)]),
    wording=Wording(
        lambda f: (
            f"The thrusters follow their commands slowly, with a time constant of {number(f['lag'])} s."
        ),
        TIMING,
        {
            "delay": "give steps in the commands, and measure faster",
            "clock_offset": "give steps in the commands; " + SYNC_PULSE,
        },
    ),
)
def lag(
    before: tuple[Any, ...],
    wanted: tuple[Any, ...],
    h: Number,
    lag: Annotated[float, "s", "first-order lag of all thrusters", LONGEST] = 0.0,
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """First-order lag, exact at the step's end for an input that is held over it."""
    share = share_reached(h, lag)
    after = tuple([x + share * (w - x) for x, w in zip(before, wanted, strict=True)])
    return after, after


class Kept(NamedTuple):
    """Commands that a delay remembers, the latest first, and the time since the latest [s]."""

    since: Any
    commands: tuple[tuple[Any, ...], ...]


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
        lambda width: Kept(0.0, ((0.0,) * width,) * SLOTS), "command", lambda delay: delay, keeps=SLOTS
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
    command: tuple[Any, ...],
    h: Number,
    delay: Annotated[float, "s", "pure delay of all thrusters", LONGEST] = 0.0,
) -> tuple[Kept, tuple[Any, ...]]:
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

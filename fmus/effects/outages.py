"""Thrusters that fail, come back and may fail again: no force during intervals of a run."""

from collections.abc import Sequence

from ..declare import POSITIVE, Variable
from ..ops import Number, where
from .effect import Running, Search, Thrust, Wording, effect
from .families import BOW_THRUSTER, PROPELLERS
from .text import Found, number

INTERVALS = 8  # that an effect holds: the parameters of the FMU are so many
INSTANT = 1e-9  # s; times that differ by less are the same


def inside(t: Number, times: Sequence[Number]) -> Number:
    """Whether a time lies in any of some intervals [start, end), given one after the other [s]."""
    pairs = zip(times[::2], times[1::2], strict=True)
    found, *others = [(t >= start - INSTANT) & (t < end - INSTANT) for start, end in pairs]
    for other in others:
        found = found | other
    return found


def outage_parameters(device: str) -> tuple[Variable, ...]:
    """Start and end of each interval, one after the other."""
    meaning = {
        "start": "first instant of outage {} of the {}",
        "end": "end of outage {} of the {}; none if not after its start",
    }
    return tuple(
        Variable(f"{device}_outage_{at}_{k}", "s", text.format(k, device), 0.0, POSITIVE, False)
        for k in range(1, INTERVALS + 1)
        for at, text in meaning.items()
    )


def pairs_of(parameters: Sequence[Variable]) -> tuple[tuple[str, str], ...]:
    """The names of each interval's start and end."""
    names = [p.name for p in parameters]
    return tuple(zip(names[::2], names[1::2], strict=True))


def spans(f: Found) -> str:
    """The intervals of an outage in words."""
    found = [(f[a], f[b]) for a, b in pairs_of(f.effect.parameters) if f[b] > f[a]]
    if not found:
        return "at no time"
    *most, last = [f"from {number(a)} to {number(b)} s" for a, b in sorted(found)]
    return f"{', '.join(most)} and {last}" if most else last


BOW, VSP = outage_parameters("bow"), outage_parameters("vsp")


@effect(
    "bow_outage",
    "actuator",
    "YN",
    formula=f"f_bow = 0 for start_k <= t < end_k, k = 1 … {INTERVALS}",
    symbol="intervals",
    sign="an interval that ends where it starts: none",
    source="7.2.5, for failures that pass",
    linear=False,
    needs=("bow",),
    parameters=BOW,
    search=Search(intervals=pairs_of(BOW), lasting="bow_failure"),
    wording=Wording(lambda f: f"The bow thruster is dead {spans(f)}.", BOW_THRUSTER),
)
def bow_outage(f: Thrust, now: Running, *times: Number) -> Thrust:
    """Bow thruster dead during intervals."""
    return f._replace(bow=where(inside(now.t, times), 0.0, f.bow))


@effect(
    "vsp_outage",
    "actuator",
    "XYN",
    formula=f"f_vsp = 0 for start_k <= t < end_k, k = 1 … {INTERVALS}",
    symbol="intervals",
    sign="an interval that ends where it starts: none",
    source="7.2.5, for failures that pass, on the other thrusters",
    linear=False,
    needs=("vsp",),
    parameters=VSP,
    search=Search(intervals=pairs_of(VSP)),
    wording=Wording(lambda f: f"The propellers are dead {spans(f)}.", PROPELLERS),
)
def vsp_outage(f: Thrust, now: Running, *times: Number) -> Thrust:
    """Voith Schneider propellers dead during intervals."""
    dead = inside(now.t, times)
    return f._replace(
        vsp_x=where(dead, 0.0, f.vsp_x), vsp_y=where(dead, 0.0, f.vsp_y), turn=where(dead, 0.0, f.turn)
    )

"""Force that actuators lose: a share, with speed or inflow, when dead, where it is small or large."""

from collections.abc import Sequence
from typing import NamedTuple

from ..declare import POSITIVE, Variable
from ..ops import Condition, Number, clip, fmax, where
from .devices import SHARE, Devices, added, changed, declared, parameter
from .effect import Effect, Running, Search, Thrust, Values
from .text import Found, against_command, capital, enumeration, lost, number, percent

INTERVALS = 8  # of an outage: the parameters of the FMU are so many
INSTANT = 1e-9  # s; times that differ by less are the same
# Values to try at the size of the reference ship, times the scale of another one.
# s/m: from an effect that is small at full speed to an actuator that is dead at 0.07 m/s.
SPEED_LOSSES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 15.0)
# Shares of full force.
DEADBANDS = (0.0086, 0.017, 0.026, 0.043, 0.06, 0.086, 0.11, 0.146, 0.19, 0.26)
USUAL_DEADBAND = 0.1  # 1, share of full force, about the middle of those to try
LIMITS = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)


def loss(d: Devices, others: bool = True) -> Effect:
    """A share of the force is lost; ``others``: there are a loss with speed and a failure as well."""
    name = f"loss_{d.name}"

    @declared(
        d,
        name,
        (parameter(name, "1", f"share of {d.label} force lost", SHARE),),
        lost(name, lambda size, than: f"{d.does('give')} {size} {than} force than the model."),
        apart={
            f"{d.name}_speed_loss": f"use the {d.title} at rest and at speed",
            f"{d.name}_failure": f"use the {d.title} from the very start of a run to its end",
        }
        if others
        else {},
        search=Search(of_each_run=True),
        measured=against_command,
        formula="f (1 - δ)",
        symbol="δ",
        sign="positive: force is lost; negative: more power than specified",
        source="(2.39), on one thruster",
        description=f"force lost by the {d.title}",
    )
    def function(f: Thrust, now: Running, share: Number) -> Thrust:
        return changed(f, d.members, lambda x: x * (1.0 - share))

    return function


def speed_loss(d: Devices) -> Effect:
    """The force falls with the ship's speed."""
    name = f"{d.name}_speed_loss"

    @declared(
        d,
        name,
        (parameter(name, "s/m", f"{d.label} effectiveness lost with surge speed", POSITIVE),),
        lambda f: (
            f"{d.does('lose')} force with the speed: "
            f"{percent(min(1.0, f[name] * f.speeds[0]))} of it at {f.speeds[0]:.2g} m/s."
        ),
        pictures=(d.picture("effectiveness over speed"),),
        formula="f max(0, 1 - k |u|)",
        symbol="k",
        sign="positive: less force at speed",
        source="6.4.4, after Skjetne et al. 2004",
        linear=False,
        search=Search(tries=[{name: d.scale.factor("s/m") * x} for x in SPEED_LOSSES]),
        description=f"{d.title} less effective with surge speed",
    )
    def function(f: Thrust, now: Running, slope: Number) -> Thrust:
        left = fmax(0.0, 1.0 - slope * abs(now.u))
        return changed(f, d.members, lambda x: x * left)

    return function


def failure(d: Devices) -> Effect:
    """Dead from a time on."""
    name = f"{d.name}_failure"
    time = f"{name}_time"

    @declared(
        d,
        name,
        (parameter(time, "s", f"time from which the {d.label} gives no force; 0: never", POSITIVE),),
        lambda f: f"{d.does('give')} no force from t = {number(f[time])} s on.",
        formula="f = 0 for t >= time",
        symbol="time",
        sign="0: never",
        source="7.2.5",
        linear=False,
        search=Search(intervals=((time, ""),)),
        description=f"{d.title} without force from a time on",
    )
    def function(f: Thrust, now: Running, since: Number) -> Thrust:
        dead = (since > 0.0) & (now.t >= since - INSTANT)
        return changed(f, d.members, lambda x: where(dead, 0.0, x))

    return function


def inside(t: Number, times: Sequence[Number]) -> Condition:
    """Whether a time lies in any of some intervals [start, end), given one after the other [s]."""
    pairs = zip(times[::2], times[1::2], strict=True)
    found, *others = [(t >= start - INSTANT) & (t < end - INSTANT) for start, end in pairs]
    for other in others:
        found = found | other
    return found


def outage_parameters(name: str) -> tuple[Variable, ...]:
    """Start and end of each interval, one after the other."""
    meaning = {
        "start": "first instant of outage {} of the {}",
        "end": "end of outage {} of the {}; no outage if not after its start",
    }
    return tuple(
        parameter(f"{name}_outage_{at}_{k}", "s", text.format(k, name), POSITIVE)
        for k in range(1, INTERVALS + 1)
        for at, text in meaning.items()
    )


def outage(d: Devices, lasting: str = "") -> Effect:
    """Dead during intervals; ``lasting`` is the id of one without an end."""
    times = outage_parameters(d.name)
    pairs = tuple(zip([p.name for p in times[::2]], [p.name for p in times[1::2]], strict=True))

    def sentence(f: Found) -> str:
        found = sorted((f[a], f[b]) for a, b in pairs if f[b] > f[a])
        intervals = [f"from {number(a)} to {number(b)} s" for a, b in found]
        return f"{d.does('fail')} {enumeration(intervals or ['at no time'])}."

    @declared(
        d,
        f"{d.name}_outage",
        times,
        sentence,
        formula=f"f = 0 for start_k <= t < end_k, k = 1 … {INTERVALS}",
        symbol="intervals",
        sign="an interval that ends where it starts: none",
        source="7.2.5, for temporary failures",
        linear=False,
        search=Search(intervals=pairs, lasting=lasting),
        description=f"{d.title} without force during intervals",
    )
    def function(f: Thrust, now: Running, *intervals: Number) -> Thrust:
        dead = inside(now.t, intervals)
        return changed(f, d.members, lambda x: where(dead, 0.0, x))

    return function


def deadband(d: Devices, parts: Sequence[Devices] = (), name: str = "") -> Effect:
    """Small forces are lost, of the actuators or of each of several ``parts`` together."""
    name = name or f"deadband_{d.name}"
    who = "Each thruster gives" if parts else d.does("give")

    @declared(
        d,
        name,
        (parameter(name, "N", f"{d.label} force without effect", POSITIVE),),
        lambda f: (
            f"{who} no force for commands below {number(f[name])} N, and {number(f[name])} N less than "
            "commanded above."
        ),
        pictures=tuple(part.picture("force given") for part in parts or (d,)),
        formula="f - clip(f, -d, d), of each actuator",
        symbol="d",
        sign="forces below d are lost, the rest is reduced by d",
        source="7.2.5; static tests of the ship",
        linear=False,
        search=Search(tries=[{name: share * d.full} for share in DEADBANDS]),
        usual=USUAL_DEADBAND * d.full,
        description=f"dead band of the {d.title}",
    )
    def function(f: Thrust, now: Running, least: Number) -> Thrust:
        return changed(f, d.members, lambda x: x - clip(x, -least, least))

    return function


def saturation(parts: Sequence[Devices], whole: Devices, name: str = "") -> Effect:
    """Forces are limited, of each part by a limit of its own."""
    limits = {f"saturation_{d.name}": d for d in parts}

    def sentence(f: Found) -> str:
        parts = [f"{d.does('give', 'the')} at most {number(f[n])} N" for n, d in limits.items() if f[n]]
        return capital(f"{' and '.join(parts)}, independently of the command.")

    def tries(model: Values) -> list[Values]:
        """Shares of the full force that the model in use has."""
        full = {n: model.get(d.strength, d.full) for n, d in limits.items()}
        return [{n: share * force} for n, force in full.items() for share in LIMITS]

    @declared(
        whole,
        name or f"saturation_{whole.name}",
        tuple(
            parameter(n, "N", f"real limit of the {d.label} force; 0: none", POSITIVE)
            for n, d in limits.items()
        ),
        sentence,
        pictures=tuple(d.picture("force given") for d in parts),
        formula="clip(f, -limit, limit)",
        symbol="limit",
        sign="0: no limit",
        source="2.1.1",
        linear=False,
        search=Search(tries=tries),
        description=f"real limit of the {whole.title}, lower than that of the commands",
    )
    def function(f: Thrust, now: Running, *most: Number) -> Thrust:
        for d, limit in zip(parts, most, strict=True):
            f = changed(
                f, d.members, lambda x, limit=limit: where(limit > 0.0, clip(x, -limit, limit), x)
            )
        return f

    return function


class Inflow(NamedTuple):
    """A slope by which force is lost with the inflow: its parameter, axes, and that of the command."""

    parameter: Variable
    axes: str
    command: str


def inflow(d: Devices, slopes: Sequence[Inflow], apart: dict[str, str] | None = None) -> Effect:
    """The force falls with the water's speed at the actuator."""

    def sentence(f: Found) -> str:
        ways = {"X": ("ahead", f.speeds[0]), "Y": ("sideways", f.speeds[1])}
        parts = []
        for slope in slopes:
            way, at = ways[slope.axes[0]]
            x = f[slope.parameter.name] * at
            parts.append(f"{number(x)} N {'less' if x > 0.0 else 'more'} {way} at {number(at)} m/s")
        stated = [p for p, s in zip(parts, slopes, strict=True) if f[s.parameter.name]]
        return f"{d.does('lose')} force with the inflow: {', '.join(stated)}, at full command."

    @declared(
        d,
        f"inflow_{d.name}",
        tuple(slope.parameter for slope in slopes),
        sentence,
        axis="XYN",
        apart=apart,
        formula="f_x - k_x |c_x| (u - y r), f_y - k_y |c_y| (v + x r), at an actuator's place (x, y)",
        symbol="k",
        sign="positive: less force against the inflow",
        source="(2.12): a propeller's force depends on the inflow; measured runs of the ship",
        description=f"force of the {d.title} lost with the water's speed at its place",
    )
    def function(f: Thrust, now: Running, *values: Number) -> Thrust:
        commanding = {slope: d.commanding(slope.command) for slope in slopes}
        for n, k in enumerate(d.members):
            for slope, value in zip(slopes, values, strict=True):
                lost = value * abs(now.part[commanding[slope][n]])
                if "X" in slope.axes:
                    f = added(f, [k], "X", -lost * (now.u - f.y[k] * now.r))
                if "Y" in slope.axes:
                    f = added(f, [k], "Y", -lost * (now.v + f.x[k] * now.r))
        return f

    return function

"""Forces of actuators that follow curves of their own, over the command or the ship's speed."""

from ..declare import Range
from ..ops import Number, fmax, where
from .curve import NODES, interpolate, node_parameters
from .devices import SHARE, Devices, by_command, changed, declared, parameter
from .effect import Effect, Running, Search, Thrust
from .text import Found, peak, percent, reach, signed, towards

# Shares of the full command: closer where a small one matters.
COMMAND_DEADBANDS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)
ALONG = {"X": "surge", "Y": "sway"}


def speed_curve(d: Devices) -> Effect:
    """The force changes freely with the ship's speed."""
    stem = f"curve_{d.name}_u"

    @declared(
        d,
        f"curve_{d.name}(|u|)",
        node_parameters(
            stem,
            "1",
            f"change of {d.label} effectiveness",
            "surge speed",
            "m/s",
            0.6 * d.scale.factor("m/s"),
            0.01 * d.scale.factor("m/s"),
        ),
        lambda f: (
            f"The force of the {d.title} changes with the speed: {percent(peak(f)[1])} "
            f"{'less' if peak(f)[1] < 0.0 else 'more'} than in the model at "
            f"{peak(f)[0] * reach(f):.2g} m/s."
        ),
        pictures=(d.picture("effectiveness over speed"),),
        formula=f"f (1 + Σ c_k · hat_k(|u|)), {NODES} nodes over [0, range]",
        symbol=f"c_1 … c_{NODES}",
        sign="positive: more force than assumed",
        source="6.4.4; 3.2.3, on a triangle basis",
        settings=(f"{stem}_range",),
        search=Search(smooth=True),
        description=f"free change of the {d.title}'s effectiveness over the surge speed",
    )
    def function(f: Thrust, now: Running, *values: Number) -> Thrust:
        *nodes, span = values
        gain = 1.0 + interpolate(abs(now.u), 0.0, span, nodes)
        return changed(f, d.members, lambda x: x * gain)

    return function


def command_curve(d: Devices, command: str) -> Effect:
    """The force changes freely over the command, as a share of it."""
    stem, places = f"curve_{d.name}", d.commanding("X")

    def sentence(f: Found) -> str:
        at, value = peak(f)
        return (
            f"The force of the {d.title} over the command differs from the model, most by "
            f"{percent(value)} {'less' if value < 0.0 else 'more'} force at "
            f"{signed(100.0 * (2.0 * at - 1.0))} % of the largest {command}."
        )

    @declared(
        d,
        f"{stem}({command})",
        node_parameters(stem, "1", f"change of {d.label} force", "command", "1", 1.0),
        sentence,
        formula=f"f (1 + Σ c_k · hat_k(c)), {NODES} nodes over the command's range",
        symbol=f"c_1 … c_{NODES}",
        sign="positive: more force than assumed",
        settings=(f"{stem}_range",),
        search=Search(smooth=True),
        description=f"free change of the {d.title}'s force over the command",
    )
    def function(f: Thrust, now: Running, *values: Number) -> Thrust:
        *heights, span = values
        for k, place in zip(d.members, places, strict=True):
            gain = 1.0 + interpolate(now.part[place], -span, span, heights)
            f = changed(f, [k], lambda x, gain=gain: x * gain)
        return f

    return function


def force_curve(d: Devices, axis: str) -> Effect:
    """A free force along an axis over the command on that axis."""
    way, on = ALONG[axis], axis.lower()
    stem, places = f"curve_{d.name}_{on}_c", d.commanding(axis)

    def sentence(f: Found) -> str:
        at, value = peak(f)
        return (
            f"The {way} force of the {d.title} over the command differs from the model, most by "
            f"{towards(value, 'N', axis)} at command "
            f"{(2.0 * at - 1.0) * reach(f):.2g}."
        )

    @declared(
        d,
        f"curve_{d.name}_{on}(c)",
        node_parameters(stem, "N", f"{d.label} {way} force", "command, both ways", "1", 1.0),
        sentence,
        axis=axis + "N" * (axis == "Y" or not d.plural),
        pictures=(d.picture("force over command", axis),),
        formula=f"f_{on} + Σ c_k · hat_k(c_{on}), {NODES} nodes over [-range, range]",
        symbol=f"c_1 … c_{NODES}",
        sign=f"positive acts {'ahead' if axis == 'X' else 'to starboard'}",
        source="(2.12); 3.2.3, on a triangle basis",
        settings=(f"{stem}_range",),
        search=Search(smooth=True),
        description=f"free addition to the {way} force of the {d.title} over the command",
    )
    def function(f: Thrust, now: Running, *values: Number) -> Thrust:
        *nodes, span = values
        parts = [now.part[place] for place in places]
        return by_command(f, d.members, axis, parts, lambda x, c: x + interpolate(c, -span, span, nodes))

    return function


def thrust_curve(d: Devices) -> Effect:
    """The surge force is another ahead than astern, and has a dead band over the command."""
    name, places = "thrust_curve", d.commanding("X")
    ways = (f"{name}_ahead", f"{name}_astern")
    band = f"{name}_deadband"

    def sentence(f: Found) -> str:
        change = {way: f[f"{name}_{way}"] for way in ("ahead", "astern")}
        parts = [
            f"{percent(x)} {'more' if x > 0.0 else 'less'} force {way}" for way, x in change.items() if x
        ]
        push = f"give {' and '.join(parts)} than in the model" if parts else ""
        still = f"give no force at commands below {percent(f[band])}" if f[band] else ""
        return f"The {d.title} {' and '.join(filter(None, (push, still)))}."

    @declared(
        d,
        name,
        (
            *[
                parameter(
                    way, "1", f"relative change of the {d.label} force {way.split('_')[-1]}", SHARE
                )
                for way in ways
            ],
            parameter(band, "1", f"{d.label} surge command without effect", Range(0.0, 0.9)),
        ),
        sentence,
        axis="X",
        pictures=(d.picture("force over command", "X"),),
        formula="f = f_nominal(c') · (1 + ahead or astern), c' = c less its dead band",
        symbol="ahead, astern, dead band",
        sign="positive: more force than assumed",
        source="(2.10)-(2.12)",
        linear=False,
        search=Search(tries=[{band: x} for x in (0.0, *COMMAND_DEADBANDS)], fitted=ways),
        description=f"surge force of the {d.title} asymmetric and with a dead band over the command",
    )
    def function(f: Thrust, now: Running, ahead: Number, astern: Number, least: Number) -> Thrust:
        def change(x: Number, c: Number) -> Number:
            size = abs(c)
            left = fmax(0.0, size - least) / fmax(size, 1e-9)
            return x * left * (1.0 + where(c > 0.0, ahead, astern))

        return by_command(f, d.members, "X", [now.part[place] for place in places], change)

    return function

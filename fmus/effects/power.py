"""Forces of actuators by the power that they run at, and across what they are commanded."""

from collections.abc import Sequence

from ..declare import Range
from ..ops import Number, power
from .devices import SHARE, Devices, added, changed, declared, parameter
from .effect import Effect, Running, Search, Thrust
from .families import PROPELLERS
from .text import Found, number, percent

# Additions to the exponent 1 to try: up to thrust by the square of a setting, as by a propeller's speed.
EXPONENTS = (-0.5, 0.5, 1.0)
CROSSED = 0.3  # 1, force of a cycloidal propeller across its command, by the command's; chosen


def crossed_forces(d: Devices) -> Effect:
    """Forces of two units abreast across their commands."""
    name = f"cross_{d.name}"
    by_surge, by_sway = f"{name}_sway", f"{name}_surge"

    def sentence(f: Found) -> str:
        inwards = {True: "to starboard", False: "to port"}
        sway, surge = f[by_surge], f[by_sway]
        parts = [
            f"{percent(sway)} of its surge force {inwards[sway < 0.0]}" if sway else "",
            f"{percent(surge)} of its sway force {'ahead' if surge > 0.0 else 'astern'}"
            if surge
            else "",
        ]
        return (
            "The propeller to port also gives a force across its command: "
            f"{' and '.join(filter(None, parts))}; the one to starboard mirrored."
        )

    @declared(
        d._replace(apart=True),
        name,
        (
            parameter(by_surge, "1", "sway force by a propeller's surge force", SHARE),
            parameter(by_sway, "1", "surge force by a propeller's sway force", SHARE),
        ),
        sentence,
        axis="XYN",
        apart={"attack_point": "turn with one propeller only"},
        formula="f_y ∓ k_sway f_x, f_x ± k_surge f_y: upper sign to port, lower to starboard",
        symbol="k_sway, k_surge",
        sign="k_sway: ahead commands give an outward force on both; k_surge: starboard commands give "
        "an ahead force on the port one",
        source="(2.12); measured runs of the ship",
        usual=CROSSED,
        description="Force of each propeller across its command, mirrored between port and starboard.",
    )
    def function(f: Thrust, now: Running, sway: Number, surge: Number) -> Thrust:
        for k, way in zip(d.members, (1.0, -1.0), strict=True):
            X, Y = f.X[k], f.Y[k]
            f = added(f, [k], "X", way * surge * Y)
            f = added(f, [k], "Y", -way * sway * X)
        return f

    return function


def power_exponent(every: Devices, parts: Sequence[Devices]) -> Effect:
    """Another exponent than one of the settings of power, of each of some actuators."""
    names = {f"exponent_{d.name}": d for d in parts}

    def sentence(f: Found) -> str:
        stated = [f"of the {d.title} is {number(1.0 + f[n])}" for n, d in names.items() if f[n]]
        return f"Thrust is not linear in the power setting: the exponent {', '.join(stated)}."

    tries: list[dict[str, float]] = [{}]
    for name in names:
        tries = [{**one, name: x} for one in tries for x in (0.0, *EXPONENTS)]

    @declared(
        every._replace(family=PROPELLERS, apart=True),
        "power_exponent",
        tuple(
            [
                parameter(n, "1", f"exponent of the {d.label}'s power setting, less 1", Range(-0.9, 2.0))
                for n, d in names.items()
            ]
        ),
        sentence,
        formula="f · setting^e, so that thrust ∝ setting^(1 + e)",
        symbol="e",
        sign="positive: less force at part power",
        source="measured runs of the ship; thrust of a propeller by the square of its speed, (2.11)",
        linear=False,
        search=Search(tries=[one for one in tries if any(one.values())]),
        description="Exponent of the power settings by which the thrust is scaled.",
    )
    def function(f: Thrust, now: Running, *exponents: Number) -> Thrust:
        for d, exponent in zip(parts, exponents, strict=True):
            gain = power(now.power[d.members[0]], exponent)
            f = changed(f, d.members, lambda x, gain=gain: gain * x)
        return f

    return function

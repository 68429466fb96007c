"""Effects of the actuators of a ship: all that each may have, or those that the ship names."""

from collections.abc import Callable, Mapping, Sequence

from ..declare import DeclarationError, nearest
from ..effects.all_thrusters import slow
from ..effects.devices import Devices, parameter
from ..effects.effect import Effect
from ..effects.families import SMALL_OR_LARGE
from ..effects.lost_force import (
    Inflow,
    deadband,
    failure,
    inflow,
    loss,
    outage,
    saturation,
    speed_loss,
)
from ..effects.misplaced import elsewhere, turned
from ..effects.own_curves import ALONG, command_curve, force_curve, speed_curve, thrust_curve
from ..effects.power import crossed_forces, power_exponent
from ..effects.steering_gear import gears
from ..effects.text import number
from .actuator import Actuator, both, twins


def failings(a: Actuator) -> list[Effect]:
    """All that may go wrong with an actuator."""
    d = a.devices
    lag = f"lag_{a.order}"
    lost = parameter(
        f"inflow_{d.name}", "N.s/m", f"force of the {d.title} lost with the water's speed at its place"
    )
    lagging = slow(
        d._replace(label=f"the {d.title}"),
        lag,
        lambda f: (
            f"{d.does('follow')} its command with a time constant that is {number(f[lag])} s longer."
        ),
        a.commands,
        a.round,
    )
    return [
        command_curve(d, a.law.commands[-1].name),
        loss(d),
        speed_loss(d),
        inflow(d, [Inflow(lost, "XY", "Y")]),
        failure(d),
        *([deadband(d), saturation([d], d)] if d.full > 0.0 else []),
        turned(d),
        elsewhere(d),
        outage(d, f"{d.name}_failure"),
        *([lagging, *steered(d._replace(name=a.order), a)] if a.leads else []),
    ]


def steered(d: Devices, *alike: Actuator) -> list[Effect]:
    """Effects of the steering gears of some actuators, where these are commanded an angle."""
    angles = [
        (a.first + k, a.round[k])
        for a in alike
        for k, command in enumerate(a.law.commands)
        if command.unit == "rad"
    ]
    places, turns = zip(*angles, strict=True) if angles else ((), ())
    return gears(d, places, turns) if angles else []


def failings_of_twins(every: Sequence[Actuator]) -> list[Effect]:
    """What may go wrong with two twins alike, as where both were set up by one mistake."""
    pairs = [(both(*pair), pair) for pair in twins(every)]
    return [e for d, pair in pairs for e in (turned(d), *steered(d, *pair))]


def by_axis(d: Devices) -> Effect:
    """Force lost with the inflow, by a slope on each axis."""
    slopes = [
        Inflow(
            parameter(
                f"inflow_{d.name}_{axis.lower()}",
                "N.s/m",
                f"{way} force lost by the inflow, full command",
            ),
            axis,
            axis,
        )
        for axis, way in ALONG.items()
    ]
    apart = {"X_u": "coast, and run under thrust at the same speed", "Y_v": "drift freely"}
    return inflow(d._replace(apart=True), slopes, apart)


# Of an actuator, or of one of its units, by what a ship's description calls them.
KINDS: Mapping[str, Callable[[Devices, frozenset[str]], list[Effect]]] = {
    "thrust_curve": lambda d, named: [thrust_curve(d)],
    "force_curves": lambda d, named: [force_curve(d, axis) for axis in "XY"],
    "speed_curve": lambda d, named: [speed_curve(d)],
    "loss": lambda d, named: [loss(d, f"failure {d.name}" in named)],
    "speed_loss": lambda d, named: [speed_loss(d)],
    "crossed_forces": lambda d, named: [crossed_forces(d)],
    "inflow": lambda d, named: [by_axis(d)],
    "failure": lambda d, named: [failure(d)],
    "outage": lambda d, named: [outage(d, f"{d.name}_failure" if f"failure {d.name}" in named else "")],
}
# Of all actuators together.
TOGETHER: Mapping[str, Callable[[Devices, Sequence[Devices]], Effect]] = {
    "power_exponent": lambda every, parts: power_exponent(every, parts),
    "deadband": lambda every, parts: deadband(every, parts, "deadband"),
    "saturation": lambda every, parts: saturation(parts, every, "saturation"),
}


def named_effects(
    every: Sequence[Actuator], names: Sequence[str], others: Mapping[str, Effect]
) -> list[Effect]:
    """The effects that a ship's description names, in their order.

    Args:
        every: the actuators of the ship.
        names: ``KIND ACTUATOR`` of :data:`KINDS`, ``KIND`` of :data:`TOGETHER`, or an id of ``others``.
        others: effects of every ship.

    Raises:
        DeclarationError: there is no such effect or actuator.
    """
    devices = {a.part.name: a.devices for a in every}
    parts = tuple(devices.values())
    devices |= {d.name: d for a in every for d in a.devices_each}
    together = Devices(
        "",
        "thrusters",
        "thruster",
        tuple([k for d in parts for k in d.members]),
        tuple([pair for d in parts for pair in d.commands]),
        "XYN",
        SMALL_OR_LARGE,
        parts[0].full if parts else 0.0,
        plural=True,
    )
    found: list[Effect] = []
    for name in names:
        kind, _, of = name.partition(" ")
        if of in devices and kind in KINDS:
            found += KINDS[kind](devices[of], frozenset(names))
        elif kind in TOGETHER and not of:
            found.append(TOGETHER[kind](together, parts))
        elif name in others:
            found.append(others[name])
        else:
            known = [*(f"{k} {d}" for k in KINDS for d in devices), *TOGETHER, *others]
            raise DeclarationError(f"effects: there is no {name!r:.60}{nearest(name, known)}")
    return found

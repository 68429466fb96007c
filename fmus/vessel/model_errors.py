"""The model effects that act on the vessel: their parameters, and their forces as outputs."""

from typing import Any

from ..declare import vector
from ..effects import force, registry
from ..effects.registry import Effect, Group, Ship

WATER = registry.group("Current", [registry.find("current")])
CHANGES = registry.group("DampingChanges", force.CHANGES)
OUTSIDE = registry.group(
    "OutsideForces",
    [
        e
        for e in registry.effects("force", "environment")
        if e not in force.CHANGES and e.id != "current"
    ],
)
INERTIA = registry.group("InertiaEffects", registry.effects("inertia"))
IN_MEASUREMENT = registry.group(
    "MeasurementEffects", [e for e in registry.effects("measurement") if e.function is not None]
)

NONE = (0.0, 0.0, 0.0)


def _outputs_of(e: Effect) -> list[tuple[str, str, str, float]]:
    """The force outputs of an effect, one for each axis that it acts on."""
    names = [f"force_{e.slug}"] if len(e.axis) == 1 else [f"force_{e.slug}_{a}" for a in e.axis]
    return [
        (name, "N.m" if axis == "N" else "N", f"force of the effect {e.id}, {axis}", 0.0)
        for name, axis in zip(names, e.axis, strict=True)
    ]


ChangeForces = vector("ChangeForces", [o for m in CHANGES.members for o in _outputs_of(m.effect)])
OutsideForces = vector("OutsideForces", [o for m in OUTSIDE.members for o in _outputs_of(m.effect)])
CALM = OutsideForces()
UNCHANGED = ChangeForces()


def forces_of(group: Group, acting: tuple[Any, ...], values: Any, ship: Ship) -> list[Any]:
    """The force of each effect of a group [N, N m], on the axes that it acts on."""
    found: list[Any] = []
    for member, acts in zip(group.members, acting, strict=True):
        force = member.apply(acts, values, NONE, ship)
        found += [force["XYN".index(axis)] for axis in member.effect.axis]
    return found

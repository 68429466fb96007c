"""The model effects that act on a vessel: their parameters, and their forces as outputs."""

from functools import cache
from typing import NamedTuple

from ..declare import Declared, Fields, Variable, group_of, variables
from ..effects import Effect, EffectSet, Loaded, Motion
from ..effects.group import Group, group
from ..hull import Damping
from ..ops import Condition, Number

NONE = (0.0, 0.0, 0.0)


class VesselEffects(NamedTuple):
    """The effects of a set that act on a vessel, by what they act on.

    Attributes:
        water: velocity of the water.
        changes: additions to damping coefficients, in the order of :class:`~fmus.hull.Damping`.
        outside: all other forces on the hull.
        inertia, measurement: what changes mass and inertia, and the measured pose.
        change_forces, outside_forces: NamedTuple classes of the force outputs.
        wind: place among ``outside`` of the wind, where it is measured over time; -1: it is not.
    """

    water: Group
    changes: Group
    outside: Group
    inertia: Group
    measurement: Group
    change_forces: type[Fields]
    outside_forces: type[Fields]
    wind: int = -1


@cache
def vessel_effects(
    effects: EffectSet, damping: Declared = Damping, wind_measured: bool = False
) -> VesselEffects:
    """The groups of a set of effects, for a hull with these damping coefficients."""
    order = [v.name for v in variables(damping)]
    forces = effects.of_kind("force", "environment")
    changes = sorted((e for e in forces if e.gives in order), key=lambda e: order.index(e.gives))
    outside = [e for e in forces if e.gives == "force"]
    return VesselEffects(
        group("Current", [e for e in forces if e.gives == "water velocity"]),
        group("DampingChanges", changes),
        group("OutsideForces", outside),
        group("InertiaEffects", effects.of_kind("inertia")),
        group(
            "MeasurementEffects",
            [e for e in effects.of_kind("measurement") if e.function is not None],
        ),
        group_of("ChangeForces", [o for e in changes for o in _outputs_of(e)]),
        group_of("OutsideForces", [o for e in outside for o in _outputs_of(e)]),
        [e.id for e in outside].index("wind") if wind_measured else -1,
    )


def _outputs_of(e: Effect) -> list[Variable]:
    """The force outputs of an effect, one for each axis that it acts on."""
    names = [f"force_{e.slug}"] if len(e.axis) == 1 else [f"force_{e.slug}_{a}" for a in e.axis]
    return [
        Variable(name, "N.m" if axis == "N" else "N", f"force of the effect {e.id}, {axis}", 0.0)
        for name, axis in zip(names, e.axis, strict=True)
    ]


def forces_of(
    group: Group, acting: tuple[Condition, ...], values: Fields, ship: Motion | Loaded
) -> list[Number]:
    """The force of each effect of a group [N, N m], on the axes that it acts on."""
    found: list[Number] = []
    for member, acts in zip(group.members, acting, strict=True):
        force = member.apply(acts, values, NONE, ship)
        found += [force["XYN".index(axis)] for axis in member.effect.axis]
    return found

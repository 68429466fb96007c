"""Components for a ship: their models of it, and all else to its size."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from .declare import Component, Fields, Variable, flatten, packer, redeclared, variables
from .hull import Damping, Inertia
from .ops import Number
from .scale import REFERENCE, Scale
from .ship_description import Description


def sized(component: Component, ship: Description) -> Component:
    """A component for a ship: parameters that a hull has too are the ship's, the others to its scale.

    The law itself works at the size of CyberShip Enterprise 1: what it gets and gives is converted by
    Froude's law, so that its constants are to scale, too.

    Args:
        component: made for CyberShip Enterprise 1, such as a controller.
        ship: that it is to serve.
    """
    nominal = {v.name: v for v in [*variables(Inertia), *variables(Damping)]}
    given = {name: v.value for name, v in ship.values().items()}
    scale = ship.scale

    def for_ship(v: Variable) -> Variable:
        estimate = v.estimate
        name = estimate.of if estimate else v.name
        known = name in nominal and nominal[name].unit == v.unit
        if known and (estimate is None or (v.start != 0.0 and not estimate.change)):
            return replace(v, start=given.get(name, 0.0))
        return scale.of(v)

    declared = redeclared(component.params, for_ship)
    if scale == REFERENCE:
        return replace(component, params=declared)
    params, inputs = (_converted(group, scale, -1) for group in (component.params, component.inputs))
    outputs = _converted(component.outputs, scale, 1)

    def init(i: Fields, p: Fields) -> tuple[object, ...]:
        return component.init(inputs(i), params(p))

    def prepare(p: Fields) -> Any:
        return component.prepared(params(p))

    def prepared_step(
        s: tuple[object, ...], i: Fields, b: Fields, h: Number
    ) -> tuple[tuple[object, ...], Fields]:
        s, o = component.law(s, inputs(i), b, h / scale.time)
        return s, outputs(o)

    def step(
        s: tuple[object, ...], i: Fields, p: Fields, h: Number
    ) -> tuple[tuple[object, ...], Fields]:
        return prepared_step(s, i, prepare(p), h)

    return replace(
        component,
        params=declared,
        inputs=redeclared(component.inputs, scale.of),
        init=init,
        step=step,
        prepare=prepare,
        prepared_step=prepared_step,
        max_step=None if component.max_step is None else component.max_step * scale.time,
    )


def _converted(group: type[Fields], scale: Scale, power: int) -> Callable[[Fields], Fields]:
    """The function that converts values of a group from the reference size to a ship's, or back (-1)."""
    factors = [scale.factor(v.unit) ** power for v in variables(group)]
    pack = packer(group)

    def convert(values: Fields) -> Fields:
        pairs = zip(flatten(values), factors, strict=True)
        return pack([x if f == 1.0 else x * f for x, f in pairs])

    return convert

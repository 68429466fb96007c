"""The thrusters of a ship: from a request, or from commands, to the force that acts.

Commands pass the effects with a memory of commands (a delay), the limit of their rate, the effects with
a memory of forces (a lag), all in :mod:`fmus.actuators.response`, the laws of the actuators, and then
the effects without a memory.
"""

from typing import Annotated, NamedTuple

from ..actuators.actuation import actuators, forces, measurable, ordered, output, parameters, variable
from ..actuators.attack import Attack, RealAttack, attacking
from ..actuators.command_variables import commands_of, powers_of, rates_of
from ..actuators.law import Law
from ..actuators.response import (
    Past,
    PreparedThrusters,
    allocating,
    at_rest,
    command_response,
    force_response,
    layouts,
    prepared,
    thruster_effects,
    total,
)
from ..actuators.weighted_allocation import allocate
from ..declare import Component, Fields, Variable, bundle, group_of, redeclared, variables
from ..effects import EffectSet
from ..ops import Number, finite, when
from ..ship_description import Description
from ..signals import Force, VelocityInCurrent


class ThrusterForces(NamedTuple):
    """Forces of a thrusters' FMU."""

    tau_cmd_X: Annotated[float, "N", "surge force of the commands, by the allocation"] = 0.0
    tau_cmd_Y: Annotated[float, "N", "sway force of the commands, by the allocation"] = 0.0
    tau_cmd_N: Annotated[float, "N.m", "yaw moment of the commands, by the allocation"] = 0.0
    tau_act_X: Annotated[float, "N", "surge force that acts"] = 0.0
    tau_act_Y: Annotated[float, "N", "sway force that acts"] = 0.0
    tau_act_N: Annotated[float, "N.m", "yaw moment that acts"] = 0.0


def outputs_of(ship: Description) -> type[Fields]:
    """What can be measured of a ship's actuators beside their commands, as a group of variables."""
    titles = {a.part.name: a.label for a in actuators(ship)}

    def text(name: str) -> str:
        of, what = name.split(".")
        return f"{titles[of]}: {what}"

    units = measurable(ship)
    return group_of("Measured", [Variable(variable(n), unit, text(n), 0.0) for n, unit in units.items()])


def make(effects: EffectSet, ship: Description, name: str = "thrusters", form: str = "") -> Component:
    """The FMU of a ship's thrusters, with the effects that it may have.

    Args:
        effects: that it has.
        ship: whose actuators they are.
        name: of the FMU.
        form: of their force over the command, for its description; empty: that of their laws.
    """
    shape, known = layouts(ship)[0], allocating(ship)
    groups = thruster_effects(effects, shape)
    lags = {f"lag_{a.order}": x for a in ordered(ship) if (x := a.part.stated("lag")) is not None}
    slow = redeclared(
        groups.dynamics.params, lambda v: lags[v.name].of(v, "lag") if v.name in lags else v
    )
    parts = actuators(ship)
    params = bundle(
        "Params",
        allocation=bundle(
            "Allocation",
            None,
            **{a.part.name: parameters(ship, a, "", False)() for a in actuators(known)},
        )(),
        attack=Attack(),
        plant=bundle(
            "Plant", None, **{a.part.name: parameters(ship, a, "plant_", True)() for a in parts}
        )(),
        plant_attack=RealAttack(),
        power=powers_of(ship)(),
        rate=rates_of(ship)(),
        dynamics=slow(),
        wrong=groups.forces.params(),
        changed=groups.changes.params(),
    )
    commands = commands_of(ship)
    reported = variables(commands) if ship.allocates else ()
    beside = measurable(ship)
    outputs = group_of("Outputs", [*reported, *variables(ThrusterForces), *variables(outputs_of(ship))])
    request = Force() if ship.allocates else commands()
    inputs = bundle("Inputs", request=request, velocity=VelocityInCurrent())

    def prepare(p: Fields) -> PreparedThrusters:
        plant = p.plant
        for member in groups.changes.members:
            plant = member.apply(member.acting(p.changed), p.changed, plant, plant)
        plant = attacking(plant, p.plant_attack)
        return prepared(p._replace(plant=plant, allocation=attacking(p.allocation, p.attack)), groups)

    def init(i: Fields, p: Fields) -> Past:
        return at_rest(groups)

    def prepared_step(s: Past, i: Fields, b: PreparedThrusters, h: Number) -> tuple[Past, Fields]:
        p = b.params
        u, v, r, u_c, v_c = (finite(x, 0.0) for x in i.velocity)
        through_water = u - u_c, v - v_c, r
        asked = tuple([finite(x, 0.0) for x in i.request])
        given = allocate(known, asked, (u, v, r), p.allocation) if ship.allocates else asked
        past, arriving = command_response(s, given, b, h)
        past, acting = force_response(past, arriving, b, h)
        tau = shape.act(acting, shape.running(s.t + h, *through_water, arriving, b), b)
        possible = total(forces(known, given, (u, v, r), p.allocation))
        after = when(h > 0.0, lambda: past, lambda: s)
        shown = given if ship.allocates else ()
        found = [output(ship, name, acting, through_water, p.plant) for name in beside]
        return after, outputs(*shown, *possible, *tau, *found)

    def step(s: Past, i: Fields, p: Fields, h: Number) -> tuple[Past, Fields]:
        return prepared_step(s, i, prepare(p), h)

    what = "Thrust allocation and thrusters" if ship.allocates else "Thrusters"
    return Component(
        name=name,
        description=f"{what} of {ship.title}{form}",
        params=params,
        state=Past,
        inputs=inputs,
        outputs=outputs,
        init=init,
        step=step,
        sampled=True,
        hold_nonfinite=False,
        prepare=prepare,
        prepared_step=prepared_step,
    )


def variant(name: str, kind: str, form: str, effects: EffectSet, ship: Description) -> Component | None:
    """The FMU of thrusters whose force has another form over the command; None: no actuator has it.

    Args:
        name: of the FMU.
        kind: of the form, one of :attr:`fmus.actuators.law.Law.variants`.
        form: the same for its description.
        effects, ship: as for :func:`make`.
    """
    laws = [Law.known[part.law].variants.get(kind, "") for part in ship.actuators]
    if not any(laws):
        return None
    parts = [p._replace(law=law or p.law) for p, law in zip(ship.actuators, laws, strict=True)]
    return make(effects, ship._replace(actuators=tuple(parts)), name, form)

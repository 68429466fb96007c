"""The model error of one sample as a component, see :mod:`.prediction_component`.

The weak form (:mod:`.weak_form`) integrates three signals over its windows: velocity, acceleration by
the hull, and acceleration by the thrusters. The state has the first two, by the motion that was
measured, and the velocity with which thrusters meet the water; the output is the third, by that
velocity halfway to the next sample.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from fmus.declare import Component, Fields, Variable, group_of
from fmus.effects.linear_map import AXES, parameter
from fmus.hull import accelerated
from fmus.ops import Number
from fmus.signals import Force
from fmus.vessel import vessel

from ...runs import Run
from ..prediction import true_motion
from ..ship_model import Model
from .prediction_component import START, solved_pose, with_values
from .recorded_step import Ready

MET = ("met_u", "met_v", "met_r")  # inputs: velocity with which the thrusters meet the water


class ByHull(NamedTuple):
    """Velocity, acceleration by the hull, and velocity through the water."""

    u: Number
    v: Number
    r: Number
    u_dot: Number
    v_dot: Number
    r_dot: Number
    met_u: Number
    met_v: Number
    met_r: Number


def balance_component(model: Model, names: Sequence[str], run: Run, points: int) -> Component:
    """The signals of the weak form at a sample of a run.

    Args:
        model, names, run: as of :func:`.prediction_component.prediction_component`.
        points: at how many points from a sample to the next shares act.

    Returns:
        Its inputs are :data:`START`, :data:`MET`, commands that arrive, shares that act at each point,
        and power settings.
    """
    layout = model.ship.layout_of(run.commands)
    width, settings = len(layout.commands), 0 if run.power is None else run.power.shape[1]
    first = len(START) + len(MET)
    last = first + (1 + points) * width
    commands = range(first, last, width)
    by_thrusters = group_of("ByThrusters", [Variable(f"{n}_dot", "1", n, 0.0) for n in "uvr"])
    named = [*START, *MET, *(f"signal_{k}" for k in range(last + settings - first))]

    def ready(p: Fields) -> tuple[Ready, tuple[tuple[Number, ...], ...]]:
        m = with_values(model, names, p)
        drive = m.drive._replace(effects=m.drive.effects._replace(layout=layout))
        gains = [[m.vessel.get(parameter(a, f"tau_{b}"), 0.0) for b in AXES] for a in AXES]
        return Ready(m.hull, drive), tuple(map(tuple, gains))

    def init(i: Fields, p: Fields) -> ByHull:
        m = with_values(model, names, p)
        pose, nu = true_motion(i[:3], i[3:6], m, solved_pose)
        s = vessel.State._make([*pose, *nu, i[6]])
        u_c, v_c = vessel.water_velocity(s, m.hull)
        by_hull = vessel.disturbed(s, Force(0.0, 0.0, 0.0), m.hull)
        return ByHull._make([*nu, *by_hull, s.u - u_c, s.v - v_c, s.r])

    def prepared_step(
        s: ByHull, i: Fields, b: tuple[Ready, tuple[tuple[Number, ...], ...]], h: Number
    ) -> tuple[ByHull, Fields]:
        (hull, drive), gains = b
        drive = layout.powered(drive, i[last:]) if settings else drive
        given, *acting = (i[k : k + width] for k in commands)
        u, v, r = i[len(START) : first]
        now = layout.running(i[6], u, v, r, given, drive)
        forces = [layout.act(shares, now, drive) for shares in acting]
        tau = [sum(each) / points for each in zip(*forces, strict=True)]
        force = [
            own + sum(gain * x for gain, x in zip(row, tau, strict=True))
            for own, row in zip(tau, gains, strict=True)
        ]
        return s, by_thrusters(*accelerated(hull.hull.inverse, force[0], force[1], force[2]))

    def step(s: ByHull, i: Fields, p: Fields, h: Number) -> tuple[ByHull, Fields]:
        return prepared_step(s, i, ready(p), h)

    return Component(
        name="balance",
        description="The model error of a sample",
        params=group_of("Moved", [replace(model.declared(n), name=n) for n in names]),
        state=ByHull,
        inputs=group_of("Signals", [Variable(n, "1", n, 0.0) for n in named]),
        outputs=by_thrusters,
        init=init,
        step=step,
        sampled=False,
        prepare=ready,
        prepared_step=prepared_step,
    )

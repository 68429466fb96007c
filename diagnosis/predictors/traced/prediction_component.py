"""One step of a prediction as a component, whose parameters are those that a reader may move.

All other parameters are those of a model, so that what does not act costs nothing. Recorded by
:mod:`fmus.native`, the component becomes C, and WebAssembly in the page of a report.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fmus.declare import Component, Fields, Variable, group_of
from fmus.ops import Number
from fmus.signals import Force, Measurement
from fmus.vessel import vessel

from ...runs import Run
from ...runs.run_constants import STEPS
from ..prediction import nearer_pose, true_motion
from ..ship_model import Model
from .recorded_step import Inputs, Ready
from .recorded_step import step as one_step

# What a window starts from: measured pose and its rate [m, m, rad, m/s, m/s, rad/s], and the time [s].
START = ("x", "y", "psi", "x_dot", "y_dot", "psi_dot", "t")


def prediction_component(model: Model, names: Sequence[str], run: Run, windy: bool) -> Component:
    """A step of the prediction of a run.

    Args:
        model: a described ship without filters; its values hold, but for those of ``names``.
        names: parameters of vessel and thrusters that are the parameters of the component.
        run: whose layout the commands have; power settings are inputs if it has any.
        windy: whether the wind that is measured is an input.

    Returns:
        Its inputs are :data:`START`, commands that arrive, shares that act, power settings, and wind
        [m/s] to north and east; all but the first are means over a step. Its outputs are the pose as it
        is measured.
    """
    layout = model.ship.layout_of(run.commands)
    width, settings = len(layout.commands), 0 if run.power is None else run.power.shape[1]
    counts = {"given": width, "acting": width, "power": settings, "wind": 2 if windy else 0}
    named = [*START, *(f"{group}_{k}" for group, n in counts.items() for k in range(n))]
    ends = [len(START)]
    for n in counts.values():
        ends.append(ends[-1] + n)
    given, acting, power, wind = map(slice, ends[:-1], ends[1:])

    def ready(p: Fields) -> Ready:
        m = with_values(model, names, p)
        return Ready(m.hull, m.drive._replace(effects=m.drive.effects._replace(layout=layout)))

    def init(i: Fields, p: Fields) -> vessel.State:
        pose, nu = true_motion(i[:3], i[3:6], with_values(model, names, p), solved_pose)
        return vessel.State._make([*pose, *nu, i[6]])

    def prepared_step(
        s: vessel.State, i: Fields, b: Ready, h: Number
    ) -> tuple[vessel.State, Measurement]:
        given_now = Inputs(
            i[given], i[acting], i[power] if settings else None, i[wind] if windy else None
        )
        after = one_step(s, given_now, b, h)
        return after, vessel.measured(after, b.hull)

    def step(s: vessel.State, i: Fields, p: Fields, h: Number) -> tuple[vessel.State, Measurement]:
        return prepared_step(s, i, ready(p), h)

    return Component(
        name="prediction",
        description="A step of a prediction",
        params=group_of("Moved", [replace(model.declared(n), name=n) for n in names]),
        state=vessel.State,
        inputs=group_of("Given", [Variable(n, "1", n, 0.0) for n in named]),
        outputs=Measurement,
        init=init,
        step=step,
        sampled=False,
        prepare=ready,
        prepared_step=prepared_step,
    )


def allocation_component(model: Model) -> Component:
    """The commands that the thrusters of a model get for a force."""
    layout, p = model.drive.effects.layout, model.drive.params
    outputs = group_of("Shares", [Variable(n, "1", n, 0.0) for n in layout.commands])
    nothing = group_of("Nothing", [])

    def init(i: Force, _: Fields) -> Fields:
        return nothing()

    def step(s: Fields, i: Force, _: Fields, h: Number) -> tuple[Fields, Fields]:
        return s, outputs(*layout.allocate((i.tau_X, i.tau_Y, i.tau_N), p))

    return Component("allocation", "Commands for a force", nothing, nothing, Force, outputs, init, step)


def with_values(model: Model, names: Sequence[str], values: Fields) -> Model:
    """A model with other values, which may be symbols, in all runs."""
    parts: dict[str, dict[str, Any]] = {
        part: dict(getattr(model, part)) for part in model.ship.parameters
    }
    for name, value in zip(names, values, strict=True):
        parts[model.owner(name)][name] = value
    return replace(model, **parts, runs={})


def solved_pose(measured: Sequence[Number], b: vessel.PreparedVessel) -> list[Number]:
    """As :func:`.prediction.true_pose`, of numbers and with as many iterations for all."""
    pose = [*measured]
    for _ in range(STEPS):
        pose, _ = nearer_pose(pose, measured, b)
    return pose

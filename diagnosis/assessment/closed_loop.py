"""Closed-loop simulation of a model on the reference paths, in one process and without files.

A ship of another size sails the paths of its size, held by the same controller with gains of its size:
observer, controller and path are made for it (:mod:`fmus.sizing`).

Vessel and thrusters have the parameters of a model; observer, controller and paths are those of
``scenarios/ellipse.json`` and ``scenarios/eight.json``, without noise and freezes.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from itertools import takewhile
from math import inf
from typing import Any, NamedTuple

from cosim.scenario import find_scenario
from fmus.controller import abs as adaptive
from fmus.controller.backstepping import Inputs as ControllerInputs
from fmus.declare import Component, flatten, rebuild
from fmus.guidance import eight, ellipse
from fmus.native.python_text import function
from fmus.native.tape import Kernels, Tape
from fmus.observer import mdf
from fmus.observer.screen import Inputs as ObserverInputs
from fmus.ops import Number, sqrt
from fmus.signals import Estimate, Force, Measurement, Nothing, Target

from ..predictors import Model
from ..predictors.ship_model import parameters
from ..runs.cleaning import BRIEF
from .settings import SETTINGS


class ReferencePath(NamedTuple):
    """A path to follow.

    Attributes:
        name: for people.
        guidance: the component.
        start: initial pose of the ship, as parameters of the vessel [m].
        observer: its parameters.
        seconds: duration [s].
    """

    name: str
    guidance: Component
    start: Mapping[str, float]
    observer: Mapping[str, float]
    seconds: float

    @classmethod
    def of(cls, name: str, guidance: Component, scenario: str) -> "ReferencePath":
        """The path of a shipped scenario."""
        content = json.loads(find_scenario(scenario).read_text(encoding="utf-8"))
        vessel, observer = (content["fmus"][name]["parameters"] for name in ("vessel", "observer"))
        return cls(name, guidance, vessel, observer, content["stop"])


REFERENCES = (
    ReferencePath.of("ellipse", ellipse.COMPONENT, "ellipse"),
    ReferencePath.of("figure of eight", eight.COMPONENT, "eight"),
)


class ClosedLoop(NamedTuple):
    """A closed loop at an instant: the states of its components, and what they give to each other."""

    states: tuple[Any, ...]  # of vessel, path, observer, controller and thrusters
    velocity: Any
    target: Target
    estimate: Estimate
    poses: tuple[Measurement, ...]  # on their way to the observer, the oldest first


def closed_loop(
    reference: ReferencePath, model: Model
) -> tuple[ClosedLoop, Callable[[ClosedLoop, float], tuple[ClosedLoop, Number]]]:
    """A closed loop at its start, and the function that advances it by a step.

    That function gets the time [s] since controller and thrusters acted last, and gives the distance [m]
    between the ship and its target as well.
    """
    length, h_path = model.ship.scale.length, BRIEF * model.ship.scale.time
    start = {name: length * x for name, x in reference.start.items()}
    ship = LoopPart(model.ship.vessel, {**model.vessel, **start})
    serving = model.ship.serving
    path = LoopPart(serving(reference.guidance), {})
    observer = LoopPart(serving(mdf.COMPONENT), reference.observer)
    controller = LoopPart(serving(adaptive.COMPONENT), {})
    drive, stated = LoopPart(model.ship.thrusters, model.thrusters), model.ship.thrusters.inputs
    pushed = model.ship.vessel.inputs
    s, vessel = ship.begin(pushed())
    g, target = path.begin(Nothing())
    measured = ObserverInputs(vessel.measured, Force())
    o, estimate = observer.begin(measured)
    c, _ = controller.begin(ControllerInputs(estimate, target))
    t, _ = drive.begin(stated())
    late = max(1, 1 + round(model.clock / h_path))
    first = ClosedLoop((s, g, o, c, t), vessel.velocity, target, estimate, (vessel.measured,) * late)

    def step(now: ClosedLoop, h: float) -> tuple[ClosedLoop, Number]:
        s, g, o, c, t = now.states
        c, demand = controller.advance(c, ControllerInputs(now.estimate, now.target), h)
        t, thrust = drive.advance(t, stated(demand.tau, now.velocity), h)
        acting = pushed(thrust.tau_act_X, thrust.tau_act_Y, thrust.tau_act_N)
        s, vessel = ship.advance(s, acting, h_path)
        g, target = path.advance(g, Nothing(), h_path)
        x, y = vessel.pose.x - target.x_t, vessel.pose.y - target.y_t
        poses = (*now.poses[1:], vessel.measured)
        commanded = Force(thrust.tau_cmd_X, thrust.tau_cmd_Y, thrust.tau_cmd_N)
        o, estimate = observer.advance(o, ObserverInputs(poses[0], commanded), h_path)
        return ClosedLoop((s, g, o, c, t), vessel.velocity, target, estimate, poses), sqrt(x * x + y * y)

    return first, step


class LoopPart:
    """A component with a set of parameters."""

    def __init__(self, component: Component, values: Mapping[str, float]) -> None:
        self._params = parameters(component, values)
        self._component, self.prepared = component, component.prepared(self._params)

    def begin(self, inputs: Any) -> tuple[Any, Any]:
        """State and outputs at first."""
        return self.advance(self._component.init(inputs, self._params), inputs, 0.0)

    def advance(self, state: Any, inputs: Any, h: float) -> tuple[Any, Any]:
        """State and outputs a step of h [s] later; h = 0 gives the outputs of the present state."""
        return self._component.advance(state, inputs, self.prepared, h)


def distances(reference: ReferencePath, model: Model) -> Iterator[float]:
    """Distance [m] between the ship and its target after each step.

    The loop is recorded once for the model's parameters, and runs without what does not act in it.
    """
    first, step = closed_loop(reference, model)
    now, distance = step(first, 0.0)
    yield distance
    tape, values, h = Tape(Kernels()), flatten(now), BRIEF * model.ship.scale.time
    names = [f"s{k}" for k in range(len(values))]
    after, further = step(rebuild(now, [tape.variable(name) for name in names]), h)
    advance = function(tape.recording([*flatten(after), further]), tape.kernels, *names)
    for _ in range(round(reference.seconds / BRIEF) - 1):
        *values, distance = advance(*values)
        yield distance


def bound_of(model: Model) -> float:
    """Distance [m] from its target beyond which a ship is lost."""
    return SETTINGS.bound * model.ship.scale.length


def largest_distance(reference: ReferencePath, model: Model) -> float:
    """Largest distance [m] between the ship and its target; infinite as soon as the ship is lost."""
    bound = bound_of(model)
    try:
        kept = [*takewhile(lambda distance: distance < bound, distances(reference, model))]
    except (OverflowError, ValueError, ZeroDivisionError):  # numbers beyond what a float holds
        return inf
    return max(kept) if len(kept) == round(reference.seconds / BRIEF) else inf

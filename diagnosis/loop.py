"""The closed loop of the reference scenarios, in process: is this ship held on its path?

Vessel and thrusters have the parameters of a model; observer, controller and paths are those of
``scenarios/ellipse.json`` and ``scenarios/eight.json``, without noise and freezes.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from math import hypot, inf
from typing import Any, NamedTuple

from fmus.controller import abs as adaptive
from fmus.controller.backstepping import Inputs as Wanted
from fmus.declare import Component
from fmus.guidance import eight, ellipse
from fmus.observer import mdf
from fmus.observer.screen import Inputs as Watched
from fmus.signals import Force, Nothing, Velocity
from fmus.thrusters.chain import Inputs as Asked

from .model import INSTANCES, Model
from .prediction import parameters

STEP = 0.04  # s; errors agree with those at 0.01 s to about a millimetre
# m: some four ship lengths, and most of the basin's width; a good loop stays within a tenth of that.
BOUND = 5.0
FILTER = {"a": 0.08, "b": 0.05}


class Reference(NamedTuple):
    """A path to follow.

    Attributes:
        name: for people.
        guidance: the component.
        start: where the ship begins, parameters of the vessel.
        seconds: how long.
    """

    name: str
    guidance: Component
    start: Mapping[str, float]
    seconds: float


REFERENCES = (
    Reference("ellipse", ellipse.COMPONENT, {"x_0": 5.0, "y_0": 2.0}, 198.0),  # two rounds
    Reference("figure of eight", eight.COMPONENT, {"x_0": 6.0, "y_0": 0.5}, 422.0),  # one round
)


class Running:
    """A component with its state.

    Args:
        component: what runs.
        inputs: those of the start.
        values: parameters that do not have their start value.
    """

    def __init__(self, component: Component, inputs: Any, values: Mapping[str, float]) -> None:
        chosen = parameters(component, values)
        self._component = component
        self._prepared = component.prepared(chosen)
        self.state = component.init(inputs, chosen)

    def step(self, inputs: Any, h: float) -> Any:
        """The outputs after h [s]; 0 gives those of the present state."""
        self.state, outputs = self._component.advance(self.state, inputs, self._prepared, h)
        return outputs


def errors(reference: Reference, model: Model) -> Iterator[float]:
    """Distance [m] between the ship and its target at each step."""
    ship = Running(INSTANCES["vessel"], Force(), {**model.vessel, **reference.start})
    seen = ship.step(Force(), 0.0)
    guidance = Running(reference.guidance, Nothing(), {})
    target = guidance.step(Nothing(), 0.0)
    late = max(1, 1 + round(model.clock / STEP))
    poses = deque([seen.measured] * late, late)
    observer = Running(mdf.COMPONENT, Watched(seen.measured, Force()), FILTER)
    estimate = observer.step(Watched(seen.measured, Force()), 0.0)
    controller = Running(adaptive.COMPONENT, Wanted(estimate, target), {})
    thrusters = Running(INSTANCES["thrusters"], Asked(), model.thrusters)
    h = 0.0
    for _ in range(round(reference.seconds / STEP)):
        demand = controller.step(Wanted(estimate, target), h)
        given = thrusters.step(Asked(demand.tau, Velocity(*seen.velocity)), h)
        h = STEP
        seen = ship.step(Force(given.tau_act_X, given.tau_act_Y, given.tau_act_N), h)
        target = guidance.step(Nothing(), h)
        yield hypot(seen.pose.x - target.x_t, seen.pose.y - target.y_t)
        poses.append(seen.measured)
        asked = Force(given.tau_cmd_X, given.tau_cmd_Y, given.tau_cmd_N)
        estimate = observer.step(Watched(poses[0], asked), h)


def largest_error(reference: Reference, model: Model) -> float:
    """Largest distance [m] from the target; infinite as soon as it is beyond BOUND."""
    largest = 0.0
    try:
        for error in errors(reference, model):
            if not error < BOUND:
                return inf
            largest = max(largest, error)
    except (OverflowError, ValueError, ZeroDivisionError):  # numbers beyond what a float holds
        return inf
    return largest

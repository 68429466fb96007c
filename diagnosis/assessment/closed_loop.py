"""Closed-loop simulation of a model on the reference paths, in one process and without files.

Vessel and thrusters have the parameters of a model; observer, controller and paths are those of
``scenarios/ellipse.json`` and ``scenarios/eight.json``, without noise and freezes.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from math import hypot, inf
from typing import Any, Generic, NamedTuple, TypeVar

from fmus.controller import abs as adaptive
from fmus.controller.backstepping import Inputs as ControllerInputs
from fmus.declare import Component
from fmus.guidance import eight, ellipse
from fmus.observer import mdf
from fmus.observer.screen import Inputs as ObserverInputs
from fmus.signals import Estimate, Force, Nothing, Target, Velocity
from fmus.thrusters.chain import Inputs as ThrusterInputs
from fmus.thrusters.chain import Outputs as ThrusterOutputs
from fmus.vessel.vessel import Outputs as VesselOutputs

from ..model import Model
from ..model.ship_model import parameters

InputsT = TypeVar("InputsT")
OutputsT = TypeVar("OutputsT")

STEP = 0.04  # s; chosen, distances agree with those at 0.01 s to about a millimetre
# m. Chosen: some four ship lengths, most of the basin's width; a good loop stays within a tenth of it.
BOUND = 5.0
OBSERVER_WEIGHTS = {"a": 0.08, "b": 0.05}  # 1; those of the scenarios


class Reference(NamedTuple):
    """A path to follow.

    Attributes:
        name: for people.
        guidance: the component.
        start: initial pose of the ship, as parameters of the vessel [m].
        seconds: duration [s].
    """

    name: str
    guidance: Component
    start: Mapping[str, float]
    seconds: float


REFERENCES = (
    Reference("ellipse", ellipse.COMPONENT, {"x_0": 5.0, "y_0": 2.0}, 198.0),  # two rounds
    Reference("figure of eight", eight.COMPONENT, {"x_0": 6.0, "y_0": 0.5}, 422.0),  # one round
)


class SteppedComponent(Generic[InputsT, OutputsT]):
    """A component with its present state.

    Args:
        component: its functions and parameters.
        inputs: initial inputs.
        values: parameters that do not have their start value.
    """

    state: Any  # of the component's own class, which only its functions know

    def __init__(self, component: Component, inputs: InputsT, values: Mapping[str, float]) -> None:
        chosen = parameters(component, values)
        self._component = component
        self._prepared = component.prepared(chosen)
        self.state = component.init(inputs, chosen)

    def step(self, inputs: InputsT, h: float) -> OutputsT:
        """Outputs after a step of h [s]; h = 0 gives those of the present state."""
        self.state, outputs = self._component.advance(self.state, inputs, self._prepared, h)
        return outputs


def distances(reference: Reference, model: Model) -> Iterator[float]:
    """Distance [m] between the ship and its target after each step."""
    ship: SteppedComponent[Force, VesselOutputs] = SteppedComponent(
        model.ship.vessel, Force(), {**model.vessel, **reference.start}
    )
    vessel = ship.step(Force(), 0.0)
    guidance: SteppedComponent[Nothing, Target] = SteppedComponent(reference.guidance, Nothing(), {})
    target = guidance.step(Nothing(), 0.0)
    clock_steps = max(1, 1 + round(model.clock / STEP))
    poses = deque([vessel.measured] * clock_steps, clock_steps)
    measured = ObserverInputs(vessel.measured, Force())
    observer: SteppedComponent[ObserverInputs, Estimate] = SteppedComponent(
        mdf.COMPONENT, measured, OBSERVER_WEIGHTS
    )
    estimate = observer.step(measured, 0.0)
    controller: SteppedComponent[ControllerInputs, Any] = SteppedComponent(
        adaptive.COMPONENT, ControllerInputs(estimate, target), {}
    )
    thrusters: SteppedComponent[ThrusterInputs, ThrusterOutputs] = SteppedComponent(
        model.ship.thrusters, ThrusterInputs(), model.thrusters
    )
    h = 0.0
    for _ in range(round(reference.seconds / STEP)):
        demand = controller.step(ControllerInputs(estimate, target), h)
        thrust = thrusters.step(ThrusterInputs(demand.tau, Velocity(*vessel.velocity)), h)
        h = STEP
        vessel = ship.step(Force(thrust.tau_act_X, thrust.tau_act_Y, thrust.tau_act_N), h)
        target = guidance.step(Nothing(), h)
        yield hypot(vessel.pose.x - target.x_t, vessel.pose.y - target.y_t)
        poses.append(vessel.measured)
        commanded = Force(thrust.tau_cmd_X, thrust.tau_cmd_Y, thrust.tau_cmd_N)
        estimate = observer.step(ObserverInputs(poses[0], commanded), h)


def largest_distance(reference: Reference, model: Model) -> float:
    """Largest distance [m] between the ship and its target; infinite as soon as it is beyond BOUND."""
    largest = 0.0
    try:
        for distance in distances(reference, model):
            if not distance < BOUND:
                return inf
            largest = max(largest, distance)
    except (OverflowError, ValueError, ZeroDivisionError):  # numbers beyond what a float holds
        return inf
    return largest
